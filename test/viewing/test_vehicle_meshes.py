"""Meshes by a vehicle's geometry, from files, and by how it moves."""

import json
import struct
from dataclasses import replace

import numpy as np
import pytest
from flights import soaring

from flightdyn import frames
from flightdyn.errors import InputError
from flightdyn.vehicles.geometry import load_geometry, read_geometry
from flightdyn.viewing import meshes, solids
from flightdyn.viewing.airframe import airframe
from flightdyn.viewing.kinematics import motion_of
from flightdyn.viewing.mesh_files import MeshFile, read_glb, read_stl

CORNERS = np.array([(3.0, 0, 0), (0, 2, 0), (0, 0, 1), (3, 0, 0), (0, -2, 0), (0, 0, 1)])


def binary_stl(corners):
    faces = corners.reshape(-1, 9).astype('<f4')
    body = b''.join(bytes(12) + face.tobytes() + bytes(2) for face in faces)
    return bytes(80) + struct.pack('<I', len(faces)) + body


def text_stl(corners):
    lines = ['solid x']
    for face in corners.reshape(-1, 3, 3):
        rows = [f'vertex {x} {y} {z}' for x, y, z in face]
        lines += ['facet normal 0 0 0', 'outer loop', *rows, 'endloop', 'endfacet']
    return '\n'.join([*lines, 'endsolid x']).encode()


def glb(document):
    chunk = json.dumps(document).encode()
    chunk += b' ' * (-len(chunk) % 4)
    head = struct.pack('<4sIII4s', b'glTF', 2, 20 + len(chunk), len(chunk), b'JSON')
    return head + chunk


BOX = {
    'accessors': [{'min': [-1, -2, -3], 'max': [1, 2, 5]}],
    'meshes': [{'primitives': [{'attributes': {'POSITION': 0}}]}],
}


def test_cessna_is_drawn_by_its_geometry():
    mesh = meshes.mesh_for('whatever', geometry=load_geometry('cessna152'))
    assert mesh.size == pytest.approx(10.16, abs=0.05)  # span, of the file
    right = mesh.vertices[(mesh.colors == solids.GREEN).all(axis=1)]
    left = mesh.vertices[(mesh.colors == solids.RED).all(axis=1)]
    assert right[:, 1].min() > 4.0
    np.testing.assert_allclose(left[:, 1].max(), -right[:, 1].min())
    assert mesh.vertices[:, 2].min() < -0.9  # the fin is up
    assert -4.6 > mesh.vertices[:, 0].min() > -7.0  # and aft


def test_an_airframe_without_fuselage_or_tips_is_drawn():
    wing = {'sections': [{'le': [0, 0, 0], 'chord': 1.0}, {'le': [0, 0.05, 0], 'chord': 1.0}]}
    assert airframe({'wings': [wing]}).size == pytest.approx(1.0)


@pytest.mark.parametrize('make', [binary_stl, text_stl])
def test_stl_is_forward_left_up_and_scaled(tmp_path, make):
    path = tmp_path / 'a.stl'
    path.write_bytes(make(CORNERS))
    mesh = read_stl(path, 0.1)
    np.testing.assert_allclose(mesh.vertices, CORNERS * (0.1, -0.1, -0.1), atol=1e-7)
    assert mesh.size == pytest.approx(0.4)


@pytest.mark.parametrize(
    ('name', 'data', 'said'),
    [
        ('a.stl', b'no mesh', 'is no STL'),
        ('a.stl', b'solid\nvertex 0 0 1\n', '1 corners do not make triangles'),
        ('a.stl', b'solid\nvertex 0 x 1\n', 'is no STL'),
        ('a.stl', binary_stl(CORNERS * np.nan), 'not a finite number'),
        ('a.glb', b'glTF', 'is no binary glTF 2'),
        ('a.glb', glb({}), 'is no binary glTF 2'),
        ('a.glb', bytes(100), 'is no binary glTF 2'),
    ],
)
def test_broken_mesh_files_are_named(tmp_path, name, data, said):
    path = tmp_path / name
    path.write_bytes(data)
    with pytest.raises(InputError, match=said) as caught:
        (read_stl if name.endswith('stl') else read_glb)(path)
    assert str(path) in str(caught.value)


def test_glb_knows_its_size_and_which_way_it_faces(tmp_path):
    path = tmp_path / 'a.glb'
    path.write_bytes(glb(BOX))
    assert read_glb(path, 0.5) == MeshFile(path, 0.5, 4.0)
    assert read_glb(path).scaled(2.0).size == 16.0
    # glTF: z forward, x left, y up
    r_bg = frames.rotation_from_quaternion(frames.Q_BODY_GLTF)
    for gltf, body in (((0, 0, 1), (1, 0, 0)), ((1, 0, 0), (0, -1, 0)), ((0, 1, 0), (0, 0, -1))):
        np.testing.assert_allclose(frames.rotate(r_bg, gltf), body, atol=1e-15)


def test_mesh_of_a_vehicle_file_is_checked(tmp_path):
    given = {'kind': 'mesh', 'file': 'a.stl'}
    with pytest.raises(InputError, match='no file'):
        read_geometry(given, tmp_path, 'v.yaml: geometry')
    (tmp_path / 'a.stl').write_bytes(binary_stl(CORNERS))
    geometry = read_geometry({**given, 'scale': 2}, tmp_path, 'v.yaml: geometry')
    assert meshes.mesh_for('', geometry=geometry).size == pytest.approx(8.0)
    with pytest.raises(InputError, match=r'v\.yaml: geometry: scale: must be positive'):
        read_geometry({**given, 'scale': 0}, tmp_path, 'v.yaml: geometry')
    with pytest.raises(InputError, match=r'must be \.stl or \.glb'):
        read_geometry({**given, 'file': 'a.obj'}, tmp_path, 'v.yaml: geometry')
    with pytest.raises(InputError, match="unknown 'mash'"):
        read_geometry({'kind': 'mash'}, tmp_path, 'v.yaml: geometry')
    assert load_geometry('no such vehicle') == {}


@pytest.mark.parametrize(
    ('geometry', 'size'),
    [
        ({'kind': 'rocket', 'length': 50, 'diameter': 5}, 50),
        ({'kind': 'balloon', 'diameter': 0.3}, 0.3),
        ({'kind': 'quadcopter', 'width': 0.4}, 0.648),
    ],
)
def test_shapes_have_the_sizes_of_their_geometry(geometry, size):
    assert meshes.mesh_for('', geometry=geometry).size == pytest.approx(size, rel=0.02)


def test_what_nobody_named_is_drawn_by_how_it_moves():
    motion = motion_of(soaring())
    assert not motion.hovers
    hovering = replace(motion, speed=np.where(np.arange(600) % 3, 20.0, 0.5))
    assert hovering.hovers
    fast = replace(motion, speed=motion.speed * 8)
    sizes = [meshes.mesh_for('', motion=m).size for m in (motion, hovering, fast)]
    expected = [meshes.aeroplane(11.0), meshes.quadcopter(0.5), meshes.airliner()]
    assert sizes == pytest.approx([mesh.size for mesh in expected])


@pytest.mark.parametrize(
    ('name', 'size'),
    [('igc_paraglider', 11.05), ('ASW 27 glider', 15), ('my_plane', 11), ('Cessna 172', 10.2)],
)
def test_names_tell_what_flies(name, size):
    standing = replace(motion_of(soaring()), speed=np.zeros(600))
    assert meshes.mesh_for(name, motion=standing).size == pytest.approx(size, rel=0.02)
