"""Meshes, path colours, curtain, ground and cameras."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from flights import flip, soaring

from flightdyn.environment.geodesy import GeodeticPoint
from flightdyn.trajectory import Trajectory
from flightdyn.viewing import events, meshes, scenery, solids
from flightdyn.viewing.blueprint import _value_range
from flightdyn.viewing.coloring import coloring_of
from flightdyn.viewing.kinematics import motion_of
from flightdyn.viewing.quantities import Group, Series, plot_groups

SHAPES = [
    meshes.quadcopter(), meshes.glider(), meshes.aeroplane(), meshes.rocket(), meshes.balloon(),
    meshes.paraglider(), meshes.wingsuit(), meshes.airliner(), solids.sphere(),
]  # fmt: skip


@pytest.mark.parametrize('mesh', SHAPES)
def test_meshes_are_closed_low_poly_and_lit_from_outside(mesh):
    assert len(mesh.vertices) == len(mesh.normals) == len(mesh.colors)
    assert len(mesh.vertices) / 3 < 1500
    assert np.isfinite(mesh.vertices).all()
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-5)
    # Winding agrees with the normals.
    a, b, c = np.moveaxis(mesh.vertices.reshape(-1, 3, 3).astype(float), 1, 0)
    outward = np.einsum('ij,ij->i', np.cross(b - a, c - a), mesh.normals[::3])
    assert (outward > 0).all()


def test_large_altitudes_are_written_out():
    assert events._figure(12_000.0, 4) == '12000'  # it was 1.2e+04
    assert events._figure(-1e-17, 3) == '0'


def test_sizes_and_sides():
    assert meshes.glider().size == pytest.approx(15.0)
    assert meshes.aeroplane().size == pytest.approx(11.0)
    quad = meshes.mesh_for('quadcopter')
    rotors = quad.vertices[(quad.colors == solids.ORANGE).all(axis=1)]
    middle = (rotors.min(axis=0) + rotors.max(axis=0)) / 2
    np.testing.assert_allclose(middle[:2], (0.05, 0), atol=1e-6)  # forward rotors
    assert rotors[:, 2].max() < 0  # above the body
    for shape in (meshes.glider(), meshes.aeroplane()):
        right = shape.vertices[(shape.colors == solids.GREEN).all(axis=1)]
        assert right[:, 1].min() > 0
        assert shape.vertices[:, 2].min() < -0.5  # the fin is up
    small = replace(motion_of(soaring()), position=motion_of(soaring()).position / 500)
    assert meshes.mesh_for('', motion=small).size == pytest.approx(0.05 * small.size)
    assert meshes.mesh_for('cessna152').size == pytest.approx(10.2)


def test_strips_share_ends_within_a_segment_and_break_at_gaps():
    flight = soaring()
    motion = motion_of(flight)
    strips = scenery.colored_strips(motion, coloring_of(flight, motion))
    ends = {part.stop - 1 for part in motion.segments}
    for a, b in pairwise(strips):
        assert (a.index[-1] in ends and b.index[0] == a.index[-1] + 1) or (
            a.index[-1] == b.index[0]
        )
    assert set(np.concatenate([s.index for s in strips])) == set(range(len(motion.time)))


def test_long_paths_stay_within_their_budget_and_keep_their_ends():
    motion = motion_of(soaring(5000))
    parts = scenery.drawn_samples(motion, 1000)
    assert sum(part.size for part in parts) < 1100
    for part, whole in zip(parts, motion.segments, strict=True):
        assert (part[0], part[-1]) == (whole.start, whole.stop - 1)


def test_curtain_falls_to_the_lowest_point_of_a_real_flight():
    flight = soaring()
    motion = motion_of(flight)
    ground = scenery.ground_altitude(flight, motion)
    assert ground == flight['altitude'].min()
    vertices, triangles, colors = scenery.curtain(motion, coloring_of(flight, motion), ground)
    drop = vertices[1::2, 2] - vertices[::2, 2]
    np.testing.assert_allclose(drop, flight['altitude'] - ground)
    assert len(vertices) == len(colors) == 2 * len(flight)
    assert len(triangles) == 2 * (len(flight) - len(motion.segments))  # none across the gap
    assert scenery.ground_altitude(flip(), motion_of(flip())) == 0.0


@pytest.mark.parametrize('hilly', [False, True])
@pytest.mark.parametrize('flight', [flip(), soaring()])
def test_overview_sees_all_of_the_path_start_left(flight, hilly):
    motion = motion_of(flight)
    camera = scenery.overview_camera(motion, ground_z=0.0, margin=0.0, hilly=hilly)
    eye, target = np.array(camera.position), np.array(camera.target)
    forward = (target - eye) / np.linalg.norm(target - eye)
    assert forward[2] > (0.85 if hilly else 0)  # looks down, steeply where hills may hide
    right = np.cross(forward, (0, 0, -1.0))
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    seen = (motion.position - eye) @ np.column_stack([right, up, forward])
    tan_v = np.tan(scenery.FIELD_OF_VIEW / 2)
    assert (np.abs(seen[:, 1]) < tan_v * seen[:, 2]).all()
    assert (np.abs(seen[:, 0]) < 1.2 * tan_v * seen[:, 2]).all()
    assert seen[0, 0] < seen[-1, 0]


def test_map_zoom_and_the_date_line():
    # One degree of 360 on a panel 340 px wide: 256 * 2^zoom / 360 = 340.
    line = np.array([[0.0, 10.0], [0.0, 11.0]])
    assert scenery.map_zoom(line) == pytest.approx(np.log2(340 * 360 / 256))
    across = np.array([[0.0, 179.0], [0.0, 179.5], [0.0, -179.9], [0.0, -179.0]])
    pieces = scenery.lines_on_map(across, np.arange(4))
    assert [len(piece) for piece in pieces] == [2, 2]
    assert scenery.map_zoom(across) > 7


def test_grid_lies_on_round_numbers_under_the_flight():
    motion = motion_of(soaring())
    grid = scenery.ground_grid(motion, 12.0)
    assert grid.spacing in (200.0, 500.0, 1000.0)
    np.testing.assert_allclose(np.mod(grid.lines[:, :, :2] / grid.spacing + 0.5, 1), 0.5)
    low, high = motion.bounds
    assert (grid.vertices[:, :2].min(axis=0) <= low[:2]).all()
    assert (grid.vertices[:, :2].max(axis=0) >= high[:2]).all()
    assert np.ptp(grid.lines[..., 2]) == 0
    wide = scenery.ground_grid(motion, 12.0, around=np.array([(0.0, 9000.0)]))
    assert wide.vertices[:, 1].max() >= 9000.0


def test_a_flight_of_hundreds_of_kilometres_stays_above_the_ground():
    # the ground was a plane: 400 km away a flight at 8 km is 4 km below it
    x = np.linspace(0, 400e3, 50)
    z = -8000 + x**2 / (2 * 6_371e3)
    flight = Trajectory(
        time=np.arange(50.0),
        states={'x_e': x, 'z_e': z},
        outputs={'altitude': np.full(50, 8300.0)},
        origin=GeodeticPoint(50.0, 8.0, 300.0),
    )
    motion = motion_of(flight)
    level = scenery.ground_level(motion, 300.0, round_earth=True)
    assert level == pytest.approx(0.0, abs=1e-6)
    grid = scenery.ground_grid(motion, level, round_earth=True)
    under = np.interp(x, grid.lines[-1, :, 0], grid.lines[-1, :, 2])
    assert (z < under).all()


def test_rounding_of_a_constant_is_not_blown_up():
    # the axis once spanned a few 1e-16, and a steady load factor looked like noise
    values = 1.661 + np.array([0.0, 2e-16, -2e-16])
    low, high = _value_range(Group('load', 'Load factor', '-', (Series('n', values),)))
    assert low < 1.6
    assert high > 1.7


def test_plots_leave_out_what_tells_nothing_of_a_vehicle():
    n = 5
    zero, one = np.zeros(n), np.ones(n)
    angles = dict.fromkeys(('gamma', 'alpha', 'phi', 'psi'), one)
    rotors = Trajectory(
        time=np.arange(5.0),
        states={'x_e': one, 'z_e': one, 'theta': one, 'q': one, 'charge': one},
        controls={'thrust_left': one},
        outputs={**angles, 'beta': zero, 'p': zero, 'load_factor': one},
    )
    keys = {g.key: [s.name for s in g.series] for g in plot_groups(rotors, motion_of(rotors))}
    assert keys == {
        'altitude': ['altitude'], 'speed': ['speed'], 'angles': ['gamma', 'phi', 'theta'],
        'track': ['psi'], 'rates': ['q'], 'controls': ['thrust_left'], 'states': ['charge'],
        'load_factor': ['load_factor'],
    }  # fmt: skip
    plane = replace(rotors, outputs={**rotors.outputs, 'lift': one, 'drag': zero})
    found = {g.key: [s.name for s in g.series] for g in plot_groups(plane, motion_of(plane))}
    assert found['angles'] == ['gamma', 'alpha', 'phi', 'theta']
    assert found['forces'] == ['lift']
    point = replace(rotors, states={'x_e': one}, outputs={**angles, 'theta': one})
    found = {g.key: [s.name for s in g.series] for g in plot_groups(point, motion_of(point))}
    assert found['angles'] == ['gamma', 'alpha']
    assert 'track' not in found
