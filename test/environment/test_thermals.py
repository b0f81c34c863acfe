"""Thermals: signs and sizes by hand, the same for numbers and symbols, smooth."""

from math import exp, nan
from typing import Any

import casadi as cas
import numpy as np
import pytest

from flightdyn.environment.thermals import Thermal
from flightdyn.environment.wind import ConstantWind
from flightdyn.errors import InputError

COLUMN = Thermal(100.0, -50.0, 3.0, 80.0)
CAPPED = Thermal(100.0, -50.0, 3.0, 80.0, top=1500.0, fade=100.0)


def rising(wind: Any, x: Any, y: Any, altitude: Any = 500.0) -> Any:
    north, east, down = wind(x, y, -altitude, 0.0)
    assert north == east == 0.0
    return -down


def test_air_rises_most_on_the_axis_and_at_1_over_e_a_radius_away() -> None:
    assert rising(COLUMN, 100.0, -50.0) == 3.0
    for x, y in ((180.0, -50.0), (20.0, -50.0), (100.0, 30.0), (148.0, 14.0)):
        assert rising(COLUMN, x, y) == pytest.approx(3.0 * exp(-1))
    assert rising(COLUMN, 100.0, -50.0, 9000.0) == 3.0


def test_it_is_half_as_strong_at_its_top_and_gone_above() -> None:
    strengths = [rising(CAPPED, 100.0, -50.0, h) for h in (0.0, 1400.0, 1500.0, 1600.0, 3000.0)]
    assert strengths == pytest.approx([3.0, 3.0 * 0.8808, 1.5, 3.0 * 0.1192, 0.0], abs=1e-3)


def test_it_adds_to_a_wind() -> None:
    assert (COLUMN + (1.0, 2.0, 0.5))(100.0, -50.0, 0.0, 0.0) == (1.0, 2.0, -2.5)
    assert (ConstantWind(1.0) + COLUMN)(100.0, -50.0, 0.0, 0.0) == (1.0, 0.0, -3.0)


@pytest.mark.parametrize('symbol', [cas.SX, cas.MX])
def test_numbers_and_symbols_agree_and_derivatives_are_right(symbol: Any) -> None:
    place = symbol.sym('place', 3)
    down = CAPPED(place[0], place[1], place[2], 0.0)[2]
    function = cas.Function('thermal', [place], [down, cas.jacobian(down, place)])
    at = np.array([140.0, -20.0, -1450.0])
    value, slope = (np.array(each).ravel() for each in function(at))
    assert value == pytest.approx(CAPPED(*at, 0.0)[2], rel=1e-14)
    for i, step in enumerate(np.eye(3) * 1e-3):
        change = CAPPED(*(at + step), 0.0)[2] - CAPPED(*(at - step), 0.0)[2]
        assert slope[i] == pytest.approx(change / 2e-3, rel=1e-6)  # of second order in 1e-3 m


@pytest.mark.parametrize(
    ('given', 'message'),
    [
        ({'radius': 0.0}, 'radius is 0.0, must be positive'),
        ({'updraft': nan}, 'updraft is nan'),
        ({'top': nan}, 'top is nan'),
        ({'fade': -1.0}, 'fade is -1.0'),
    ],
)
def test_bad_thermals_are_refused(given: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Thermal(**{'x': 0.0, 'y': 0.0, 'updraft': 3.0, 'radius': 80.0, **given})
