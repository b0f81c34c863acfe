"""Airspeeds against published figures, closed forms written out again, and round trips."""

from typing import Any

import casadi as cas
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightdyn.environment import airspeed
from flightdyn.environment.atmosphere import Atmosphere

KNOT = 1852 / 3600
FOOT = 0.3048


def test_250_knots_at_flight_level_100() -> None:
    air = Atmosphere(10_000 * FOOT, 'isa')
    tas = airspeed.true_from_calibrated(250 * KNOT, air.pressure(), air.temperature())
    assert tas / KNOT == pytest.approx(288.7, abs=0.05)
    assert airspeed.mach_from_true(tas, air.temperature()) == pytest.approx(0.4523, abs=5e-5)


def test_mach_078_at_flight_level_350() -> None:
    # by hand: delta 0.23531, qc / p0 = 0.23531 ((1 + 0.2 0.78^2)^3.5 - 1) = 0.11640,
    # CAS = 661.47 kt sqrt(5 (1.11640^(2/7) - 1)) = 264.4 kt; TAS = 0.78 x 576.4 kt
    air = Atmosphere(35_000 * FOOT, 'isa')
    calibrated = airspeed.calibrated_from_mach(0.78, air.pressure())
    assert calibrated / KNOT == pytest.approx(264.4, abs=0.05)
    assert airspeed.true_from_mach(0.78, air.temperature()) / KNOT == pytest.approx(
        449.6, abs=0.05
    )


@given(st.floats(0.05, 0.99), st.floats(0.05, 1.0))
def test_subsonic_agrees_with_the_textbook_form(mach: float, ratio: float) -> None:
    impact = ratio * ((1 + 0.2 * mach**2) ** 3.5 - 1)
    expected = 340.2941 * np.sqrt(5 * ((impact + 1) ** (2 / 7) - 1))
    # the textbook form loses eps / mach^2 by cancellation
    assert airspeed.calibrated_from_mach(mach, 101_325 * ratio) == pytest.approx(
        expected, rel=1e-6
    )


@given(st.floats(1.0, 8.0))
def test_supersonic_impact_pressure_is_rayleighs(mach: float) -> None:
    g = 1.4
    m = mach**2
    behind = ((g + 1) ** 2 * m / (4 * g * m - 2 * (g - 1))) ** (g / (g - 1))
    pitot = behind * (1 - g + 2 * g * m) / (g + 1)
    assert airspeed.impact_pressure(mach, 1.0) == pytest.approx(pitot - 1, rel=1e-12)


def test_rayleigh_of_a_published_table() -> None:
    # NACA Report 1135, table II: p1 / pt2 at Mach 2 and 3
    assert 1 / (1 + airspeed.impact_pressure(2.0, 1.0)) == pytest.approx(0.1773, abs=5e-5)
    assert 1 / (1 + airspeed.impact_pressure(3.0, 1.0)) == pytest.approx(0.08291, abs=5e-6)


@pytest.mark.parametrize('altitude', [-1000.0, 0.0, 5000.0, 11_000.0, 20_000.0, 40_000.0])
def test_calibrated_round_trip_at_all_speeds(altitude: float) -> None:
    air = Atmosphere(altitude)
    tas = np.linspace(0, 3000, 3001)
    cas_ = airspeed.calibrated_from_true(tas, air.pressure(), air.temperature())
    assert (np.diff(cas_) > 0).all()
    back = airspeed.true_from_calibrated(cas_, air.pressure(), air.temperature())
    np.testing.assert_allclose(back, tas, rtol=1e-12, atol=1e-12)


def test_calibrated_is_true_at_sea_level() -> None:
    tas = np.linspace(0, 1500, 501)
    np.testing.assert_allclose(
        airspeed.calibrated_from_true(tas, 101_325.0, 288.15), tas, rtol=1e-12, atol=1e-12
    )


def test_slow_flight_has_calibrated_equal_equivalent() -> None:
    air = Atmosphere(6000.0)
    equivalent = airspeed.equivalent_from_true(5.0, air.density())
    calibrated = airspeed.calibrated_from_true(5.0, air.pressure(), air.temperature())
    # compressibility is of order mach^2 / 8
    assert calibrated == pytest.approx(equivalent, rel=1e-4)
    assert airspeed.true_from_equivalent(equivalent, air.density()) == pytest.approx(5)


def test_equivalent_is_below_calibrated_at_altitude() -> None:
    air = Atmosphere(11_000.0)
    assert airspeed.equivalent_from_true(230.0, air.density()) < airspeed.calibrated_from_true(
        230.0, air.pressure(), air.temperature()
    )


@pytest.mark.parametrize('symbol', [cas.SX, cas.MX])
def test_derivatives_are_right_and_finite_also_at_rest_and_at_mach_1(symbol: Any) -> None:
    x = symbol.sym('mach')
    functions = []
    for way in (airspeed.calibrated_from_mach, airspeed.impact_pressure):
        out = way(x, 40_000.0)
        slope = cas.jacobian(out, x)
        functions.append(cas.Function('f', [x], [out, slope, cas.jacobian(slope, x)]))
    x = symbol.sym('cas')
    out = airspeed.true_from_calibrated(340 * x, 40_000.0, 220.0)
    slope = cas.jacobian(out, x)
    functions.append(cas.Function('f', [x], [out, slope, cas.jacobian(slope, x)]))
    h = 1e-5
    for f in functions:
        for mach in (0.0, 0.3, 0.999, 1.0, 1.001, 1.6, 2.5):
            values = [float(v) for v in f(mach)]
            assert np.isfinite(values).all()
            difference = (float(f(mach + h)[0]) - float(f(mach - h)[0])) / (2 * h)
            # at Mach 1 the third derivative jumps; h^2 times that is far below
            assert values[1] == pytest.approx(difference, rel=1e-6, abs=1e-4)
