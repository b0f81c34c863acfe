"""Flights in space, over what stands around them."""

import numpy as np
import pytest

pytest.importorskip('matplotlib')

from flights import by_label

from flightdyn.environment.surroundings import (
    Cylinder,
    Gate,
    Mark,
    Polygon,
    Surroundings,
    Terrain,
)
from flightdyn.trajectory import Trajectory
from flightdyn.viewing import figures
from flightdyn.viewing.surroundings_drawing import height_at


def turn(climb: float = 0.0) -> Trajectory:
    """Return a half circle of 500 m radius to the right, first north."""
    t = np.linspace(0, 40, 81)
    track = np.pi * t / 40
    n = np.ones(81)
    return Trajectory(
        time=t,
        states={
            'x_e': 500 * np.sin(track), 'y_e': 500 * (1 - np.cos(track)),
            'z_e': -100 - climb * t, 'speed': 39.27 * n, 'gamma': 0 * n, 'track': track,
        },
        controls={'bank': 0.3 * n, 'throttle': 0.5 * n},
        outputs={'airspeed': 39.27 * n + 5 * np.sin(track), 'load_factor': 1.05 * n + 0.01 * t},
        model='DynamicsPointMass3DSpeedGammaTrack',
    )  # fmt: skip


def slope() -> Terrain:
    """Return ground that rises by 1 in 10 to the east, and is higher by 20 m from x_e = 0 on."""
    x, y = np.array([-1000.0, 0, 1000]), np.array([-2000.0, 2000])
    return Terrain(x, y, 0.1 * y + np.array([[0.0], [20.0], [20.0]]))


SURROUNDINGS = Surroundings(
    terrain=slope(),
    keep_out=[
        Cylinder(name='tower', centre=(100.0, 700.0), radius=50.0),
        Polygon(name='village', corners=[(200, 300), (300, 300), (300, 400)]),
    ],
    gates=[
        Gate(name='gate', centre=(500.0, 500.0, 110.0), heading=0.0, width=60, height=40),
        Gate(name='above', centre=(500.0, 500.0, 160.0), heading=0.0, width=60, height=40),
    ],
    marks=[Mark(name='field', place=(0.0, 0.0, 0.0), radius=80.0)],
)


def test_a_flight_is_seen_from_above_over_what_stands_there() -> None:
    figure = figures.figure_for(turn(), SURROUNDINGS)
    ground = figure.axes[0]
    assert (ground.get_xlabel(), ground.get_ylabel()) == ('y_e, east [m]', 'x_e, north [m]')
    names = {text.get_text() for text in ground.texts}
    assert {'tower', 'village', 'gate, above', 'field'} <= names
    circles = {tuple(p.center): p.radius for p in ground.patches if hasattr(p, 'radius')}
    assert circles == {(700.0, 100.0): 50.0, (0.0, 0.0): 80.0}  # east, north
    corners = next(p for p in ground.patches if hasattr(p, 'get_xy'))
    assert corners.get_xy()[:3].tolist() == [[300, 200], [300, 300], [400, 300]]
    # a gate flown through to the north stands across, from west to east
    gate = next(line for line in ground.lines if line.get_linewidth() == 3)
    np.testing.assert_allclose(gate.get_xydata(), [[470, 500], [530, 500]])
    path = next(c for c in ground.collections if c.get_array() is not None and c.get_segments())
    assert len(path.get_segments()) == 80


def test_heights_are_over_the_ground_below() -> None:
    heights = by_label(figures.path_figure(turn(), SURROUNDINGS))['altitude [m]']
    assert heights.get_xlabel() == 'distance flown [m]'
    # chords of half a circle in 80 steps: short of pi r by (pi / 160)^2 / 6
    assert heights.lines[0].get_xdata()[-1] == pytest.approx(500 * np.pi, rel=1e-4)
    (below,) = heights.collections
    top = below.get_paths()[0].vertices[:, 1].max()
    assert top == pytest.approx(0.1 * 1000 + 20)  # at the end, 1000 m east
    gate = heights.lines[1]
    np.testing.assert_allclose(gate.get_ydata(), [90, 130])
    assert gate.get_xdata()[0] == pytest.approx(250 * np.pi, rel=1e-4)


def test_height_of_the_ground_is_linear_between_lines_and_goes_on_outside() -> None:
    x, y = np.array([-500.0, 0, 500, 3000]), np.array([0.0, 100, -300, 9000])
    np.testing.assert_allclose(height_at(slope(), x, y), [10, 30, -10, 220])


def test_histories_have_what_varies_controls_and_the_load_factor() -> None:
    axes = by_label(figures.path_figure(turn()))
    assert {'airspeed, speed [m/s]', 'bank [deg]', 'throttle [-]', 'load_factor [-]'} <= set(axes)
    calm = turn()
    calm.outputs['airspeed'] = calm.states['speed']
    limits = {'speed': (30.0, 39.27)}
    axes = by_label(figures.path_figure(calm, about=figures.About(limits=limits)))
    assert 'speed [m/s]' in axes and 'airspeed, speed [m/s]' not in axes


def test_a_steep_flight_is_drawn_in_space() -> None:
    flat = figures.path_figure(turn())
    assert not any(hasattr(ax, 'get_zlabel') for ax in flat.axes)
    steep = figures.path_figure(turn(climb=10.0))
    (space,) = (ax for ax in steep.axes if hasattr(ax, 'get_zlabel'))
    assert space.get_zlabel() == 'altitude [m]'
    shadow, path = space.lines[:2]
    np.testing.assert_allclose(path.get_data_3d()[2][[0, -1]], [100, 500])
    assert np.ptp(shadow.get_data_3d()[2]) == 0
    assert 'altitude [m]' in by_label(steep)


def test_a_rigid_body_in_space_is_drawn_as_it_is_turned() -> None:
    t = np.linspace(0, 2, 21)
    names = ('front', 'rear', 'left')
    quad = Trajectory(
        time=t,
        states={
            'x_e': 10 * t, 'y_e': t, 'z_e': -5 * t, 'phi': 0 * t, 'theta': 0 * t + np.pi / 2,
            'psi': 0 * t, 'p': 0 * t,
        },
        controls=dict.fromkeys(names, 1 + 1e-6 * np.sin(t)),
    )  # fmt: skip
    figure = figures.figure_for(quad)
    (space,) = (ax for ax in figure.axes if hasattr(ax, 'get_zlabel'))
    bars = [np.array(line.get_data_3d()) for line in space.lines if line.get_linewidth() == 1.8]
    assert len(bars) == 3 * 11
    # nose up: fore and aft is upright, what was up points back to the south
    fore = np.diff(bars[0], axis=1).ravel()
    np.testing.assert_allclose(fore, [0, 0, np.linalg.norm(fore)], atol=1e-9)
    up = np.diff(bars[-1], axis=1).ravel()
    np.testing.assert_allclose(up, [0, -np.linalg.norm(up), 0], atol=1e-9)
    # rotors have no unit: three or more share an axis all the same
    axes = by_label(figure)
    assert [t.get_text() for t in axes['[-]'].get_legend().get_texts()] == list(names)
    assert axes['[-]'].get_ylim() == pytest.approx(
        (0.95, 1.05), rel=1e-5
    )  # steady, not magnified noise
