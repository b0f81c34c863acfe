"""Events of a flight from its samples."""

from dataclasses import replace

import pytest

from flightdyn.nodes.sim_watch import Watch
from flightdyn.vehicles.vehicle import load_vehicle

GLIDER = replace(load_vehicle('cessna152'), aerodynamics=None)
"""With limits of airspeed up to 76.65 m/s and load factors from -1.76 to 4.4."""


def at(altitude: float, **values: float) -> dict[str, float]:
    level = {'x_e': 0.0, 'y_e': 0.0, 'speed': 30.0, 'w_e': 1.0, 'airspeed': 30.0, 'load_factor': 1}
    return {**level, 'z_e': -altitude, **values}


def test_the_ground_is_met_between_two_samples() -> None:
    watch = Watch(GLIDER, 100.0)
    assert not list(watch.look(0.0, at(103.0)))
    (event,) = watch.look(1.0, at(99.0))
    assert (event.kind, event.limit) == ('ground_contact', 100.0)
    assert event.time == pytest.approx(0.75)
    assert not list(watch.look(2.0, at(98.0)))


@pytest.mark.parametrize('heights', [(0.0, -1.0), (-1.0, 1.0), (-2.0, -3.0)])
def test_a_start_on_the_ground_or_below_is_no_contact(heights: tuple[float, float]) -> None:
    watch = Watch(GLIDER, 0.0)
    assert not [event for t, h in enumerate(heights) for event in watch.look(t, at(h))]


def test_limits_are_left_once_and_kept_again_once() -> None:
    watch = Watch(GLIDER, 0.0)
    kinds = []
    for t, airspeed in enumerate((70.0, 77.0, 78.0, 76.64, 76.0, 70.0)):
        kinds += [(event.kind, t) for event in watch.look(t, at(500.0, airspeed=airspeed))]
    assert kinds == [('limit_left', 1), ('limit_kept', 4)]
    (event,) = watch.look(9.0, at(500.0, load_factor=-2.0))
    assert (event.quantity, event.value, event.limit) == ('load_factor', -2.0, -1.76)
    assert 'load_factor of -2' in event.message


def test_the_range_of_the_aerodynamics_is_watched() -> None:
    watch = Watch(load_vehicle('cessna152'), -1e4)
    (event,) = watch.look(0.0, at(3600.0))
    assert (event.quantity, event.value, event.limit) == ('altitude', 3600.0, 3500.0)
