"""What colours a path, and the vectors drawn at a vehicle."""

import numpy as np
import pytest
from flights import flip, soaring

from flightdyn.errors import InputError
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem_file import load_problem
from flightdyn.trajectory import Trajectory
from flightdyn.viewing.arrows import arrows_of, wind_earth
from flightdyn.viewing.coloring import DERIVED, color_map, coloring_of
from flightdyn.viewing.kinematics import motion_of


def colored(flight, quantity, **more):
    return coloring_of(flight, motion_of(flight), quantity, **more)


def test_energy_height_is_altitude_and_half_the_speed_squared_over_g():
    flight = soaring(50, gap=False)
    found = colored(flight, 'energy')
    by_hand = flight['altitude'] + flight['speed'] ** 2 / (2 * 9.80665)
    np.testing.assert_allclose(found.values, by_hand)
    assert (found.title, found.share.min(), found.share.max()) == ('energy height [m]', 0.0, 1.0)


def test_any_column_colours_in_the_unit_it_is_shown_in():
    flight = soaring(50)
    bank = colored(flight, 'bank')
    assert bank.unit == 'deg'
    np.testing.assert_allclose(bank.values, np.degrees(flight['bank']))
    assert bank.low < bank.values[0] < bank.high  # a constant lies in the middle of a range


def test_deviation_and_uncertainty_colour_where_they_are_known():
    flight = flip(20)
    apart = flight.time, np.linspace(0, 3, 20)
    np.testing.assert_allclose(colored(flight, 'deviation', deviation=apart).values, apart[1])
    with pytest.raises(InputError, match='no such quantity'):
        colored(flight, 'deviation')
    with pytest.raises(InputError, match='no such quantity'):
        colored(flight, 'uncertainty')
    known = Trajectory(
        time=np.arange(3.0),
        states={'x_e': np.arange(3.0), 'y_e': np.zeros(3), 'z_e': np.zeros(3)},
        outputs={f'{k}_std': np.full(3, v) for k, v in (('x_e', 2), ('y_e', 3), ('z_e', 6))},
    )
    np.testing.assert_allclose(colored(known, 'uncertainty').values, 7)
    assert 'uncertainty' in DERIVED


def test_a_misspelt_quantity_is_told_the_right_one():
    with pytest.raises(InputError, match="did you mean 'load_factor'"):
        colored(soaring(50), 'loadfactor')


def test_colours_rise_in_luminance():
    light = color_map(np.linspace(0, 1, 50)) @ (0.2126, 0.7152, 0.0722)
    assert (np.diff(light) > 0).all()


def test_wind_is_found_from_the_motion_over_ground_and_through_the_air():
    wind = (-5.0, 3.0, 1.0)
    flight = (
        Planner()
        .plan(load_problem('cessna152_turnback', [f'wind_ned={list(wind)}', 'refine=false']))
        .trajectory
    )
    found = wind_earth(flight, motion_of(flight))
    np.testing.assert_allclose(found, np.tile(wind, (len(flight), 1)), atol=1e-6)  # rounding


def test_lift_and_drag_lie_along_the_air():
    n = 3
    zero = np.zeros(n)
    flight = Trajectory(
        time=np.arange(n, dtype=float),
        states={'x_e': np.arange(n) * 10.0, 'z_e': zero, 'speed': zero + 10, 'gamma': zero},
        controls={'alpha': zero + 30.0},
        outputs={'lift': zero + 200, 'drag': zero + 50},
    )
    arrows = {a.name: a for a in arrows_of(flight, motion_of(flight))}
    motion = motion_of(flight)
    # in level flight lift is up, drag is back, whatever alpha is
    np.testing.assert_allclose(motion.in_earth(arrows['lift'].vectors)[0], (0, 0, -200), atol=1e-9)
    np.testing.assert_allclose(motion.in_earth(arrows['drag'].vectors)[0], (-50, 0, 0), atol=1e-9)
    assert arrows['lift'].scale_with == arrows['drag'].scale_with


def test_a_replay_without_forces_shows_its_load_factor_square_to_its_path():
    flight = soaring(50)
    motion = motion_of(flight)
    (load,) = [a for a in arrows_of(flight, motion) if a.name == 'load factor']
    earth = motion.in_earth(load.vectors)
    np.testing.assert_allclose(np.linalg.norm(earth, axis=1), 1.17)
    np.testing.assert_allclose((earth * motion.velocity).sum(axis=1), 0, atol=1e-9)
    assert (earth[:, 2] < 0).all()  # up, and into the turn
