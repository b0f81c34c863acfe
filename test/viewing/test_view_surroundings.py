"""Terrain, keep-outs, gates and marks, read back from recordings."""

import numpy as np
import pytest

pytest.importorskip('rerun')
pytest.importorskip('pyarrow')

from flights import flip, soaring
from recordings import read, rows

from flightdyn.environment.geodesy import geodetic_from_ned
from flightdyn.environment.surroundings import (
    Cylinder,
    Gate,
    Mark,
    Polygon,
    Surroundings,
    Terrain,
)
from flightdyn.trajectory import Trajectory
from flightdyn.viewing.events import gates_passed
from flightdyn.viewing.kinematics import motion_of
from flightdyn.viewing.rerun_view import save_rrd
from flightdyn.viewing.view_surroundings import contour_step, outline

X, Y = np.linspace(-100, 900, 11), np.linspace(-300, 300, 7)
HILL = 50 + 40 * np.exp(-(((X[:, None] - 400) / 200) ** 2) - (Y / 150) ** 2)
AROUND = Surroundings(
    terrain=Terrain(X, Y, HILL),
    keep_out=[
        Cylinder(name='mast', centre=(200.0, 50.0), radius=30.0, top=120.0),
        Polygon(name='town', corners=[(0, 0), (50, 0), (0, 80)], bottom=60.0),
    ],
    gates=[Gate(name='one', centre=(10.0, 20.0, 30.0), heading=np.pi / 2, width=4.0, height=2.0)],
    marks=[Mark(name='field', place=(300.0, 100.0, 55.0), radius=20.0)],
)


def points(entity, name):
    return np.array(rows(entity, name)[0]).reshape(-1, 3)


def test_everything_stands_where_it_is(tmp_path):
    flight = soaring(100)
    save_rrd(tmp_path / 'a.rrd', flight, surroundings=AROUND)
    data = read(tmp_path / 'a.rrd')
    ground = points(data['/world/ground/terrain'], 'vertex_positions')
    assert len(ground) == X.size * Y.size
    np.testing.assert_allclose(ground[:, 2], -HILL.ravel(), rtol=1e-6)
    np.testing.assert_allclose(ground[8, :2], (X[1], Y[1]))
    normals = points(data['/world/ground/terrain'], 'vertex_normals')
    assert (normals[:, 2] < 0).all()  # up
    assert '/world/ground/plane' not in data
    assert '/world/curtain' not in data
    mast = points(data['/world/keep_out/mast'], 'vertex_positions')
    np.testing.assert_allclose(np.hypot(mast[:, 0] - 200, mast[:, 1] - 50), 30, rtol=1e-5)
    assert mast[:, 2].min() == -120
    town = points(data['/world/keep_out/town'], 'vertex_positions')
    # open above: as high as the flight is
    np.testing.assert_allclose([town[:, 2].max(), town[:, 2].min()],
                               [-60, -flight['altitude'].max()], rtol=1e-6)  # fmt: skip
    # a gate flown through eastwards stands across the way, north to south
    gate = np.array(rows(data['/world/gates/one'], 'strips')[0][0])
    np.testing.assert_allclose(np.ptp(gate, axis=0), (4, 0, 2), atol=1e-5)
    np.testing.assert_allclose((gate.min(axis=0) + gate.max(axis=0)) / 2, (10, 20, -30))
    assert rows(data['/world/marks'], ':labels') == [['field']]
    ring = np.array(rows(data['/world/marks/circles'], 'strips')[0][0])
    np.testing.assert_allclose(np.hypot(ring[:, 0] - 300, ring[:, 1] - 100), 20, rtol=1e-5)
    lat, lon, _ = geodetic_from_ned(300.0, 100.0, 0.0, flight.origin)
    on_map = np.ravel(rows(data['/map/marks'], 'positions')[0])
    np.testing.assert_allclose(on_map, (float(lat), float(lon)), atol=1e-9)


def test_nothing_is_on_a_map_without_a_place_on_earth(tmp_path):
    save_rrd(tmp_path / 'a.rrd', flip(), surroundings=AROUND)
    assert not [name for name in read(tmp_path / 'a.rrd') if name.startswith('/map')]


def test_large_terrain_is_thinned_to_its_edges(tmp_path):
    x = np.linspace(0, 1000, 1201)
    terrain = Terrain(x, x, np.add.outer(x, x))
    save_rrd(tmp_path / 'a.rrd', flip(), surroundings=Surroundings(terrain=terrain))
    ground = points(read(tmp_path / 'a.rrd')['/world/ground/terrain'], 'vertex_positions')
    assert len(ground) == 400**2
    np.testing.assert_allclose(ground[-1], (1000, 1000, -2000))


def test_contours_are_about_ten_round_steps():
    assert [contour_step(span) for span in (100.0, 23.0, 4000.0)] == [10.0, 2.0, 500.0]


def test_outline_of_a_polygon_is_its_corners():
    np.testing.assert_array_equal(outline(AROUND.keep_out[1]), [(0, 0), (50, 0), (0, 80)])


def test_gates_are_passed_the_right_way_and_within_their_frame(tmp_path):
    t = np.arange(11.0)
    flight = Trajectory(
        time=t, states={'x_e': t * 10, 'y_e': 0 * t, 'z_e': -20 + 0 * t, 'theta': 0 * t}
    )
    gates = [
        Gate(name='second', centre=(75.0, 1.0, 21.0), heading=0.3, width=4.0, height=4.0),
        Gate(name='first', centre=(33.0, 0.0, 20.0), heading=0.0, width=4.0, height=4.0),
        Gate(
            name='grazed',
            centre=(95.0, 2.0 + 1e-8, 22.0 + 1e-8),
            heading=0.0,
            width=4.0,
            height=4.0,
        ),
        Gate(name='beside', centre=(50.0, 3.0, 20.0), heading=0.0, width=4.0, height=4.0),
        Gate(name='below', centre=(50.0, 0.0, 15.0), heading=0.0, width=4.0, height=4.0),
        Gate(name='backward', centre=(60.0, 0.0, 20.0), heading=np.pi, width=4.0, height=4.0),
    ]
    found = gates_passed(motion_of(flight), gates)
    assert [gate.name for _, gate in found] == ['first', 'second', 'grazed']
    # plans graze the frame, and a little more by the solver's tolerance: once none was passed
    # the second one's plane is turned: at y = 0 it is passed 1 m * tan(0.3) later
    np.testing.assert_allclose([time for time, _ in found], [3.3, 7.5 + 0.1 * np.tan(0.3), 9.5])
    save_rrd(tmp_path / 'a.rrd', flight, surroundings=Surroundings(gates=gates))
    data = read(tmp_path / 'a.rrd')
    texts = [row[0] for row in rows(data['/events'], 'text')]
    assert [text for text in texts if 'gate' in text] == [
        'through gate first', 'through gate second', 'through gate grazed'
    ]  # fmt: skip
    states = rows(data['/lanes/gate'], ':state')
    assert states == [['to first'], ['to second'], ['to grazed'], ['after grazed']]
