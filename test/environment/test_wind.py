"""Winds: signs by hand, laws by formula, smoothness by derivatives."""

from typing import Any

import casadi as cas
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from flightdyn.environment.wind import (
    ConstantWind,
    LogWind,
    PowerLawWind,
    ScaledWind,
    ShearWind,
    TableWind,
    as_wind,
)
from flightdyn.errors import InputError

HEIGHTS = [0.0, 10.0, 50.0, 200.0, 1000.0]
NORTH = [0.0, 5.0, 8.0, -3.0, 12.0]
EAST = [1.0, 2.0, 4.0, 8.0, 16.0]
TABLE = TableWind(HEIGHTS, NORTH, EAST)
PROFILES = {
    'power': PowerLawWind(12.0, 200.0),
    'log': LogWind(12.0, 200.0),
    'shear': ShearWind(0.1, 200.0),
    'table': TABLE,
    'sum': TABLE + PowerLawWind(3.0, 45.0),
}


def at(wind: Any, height: Any) -> Any:
    return wind(0.0, 0.0, -height, 0.0)


def test_wind_from_the_west_blows_to_the_east() -> None:
    assert at(ConstantWind.from_direction(10.0, 270.0), 0.0) == pytest.approx((0, 10, 0))


def test_wind_from_north_north_east_blows_to_south_south_west() -> None:
    north, east, down = at(ConstantWind.from_direction(2.0, 30.0), 0.0)
    assert (north, east, down) == pytest.approx((-np.sqrt(3), -1.0, 0.0))


@pytest.mark.parametrize('law', [PowerLawWind, LogWind])
def test_profiles_have_their_speed_and_direction_at_the_reference_height(law: Any) -> None:
    wind = law(8.0, 300.0, reference_height=25.0)
    assert at(wind, 25.0) == pytest.approx(at(ConstantWind.from_direction(8.0, 300.0), 0.0))


def test_power_law() -> None:
    wind = PowerLawWind(10.0, 180.0, reference_height=10.0, exponent=0.2)
    for height in (1.0, 2.0, 40.0, 300.0):
        assert at(wind, height)[0] == pytest.approx(10 * (height / 10) ** 0.2, rel=1e-14)
    assert np.array_equal(at(wind, 0.0), (0, 0, 0)) and np.array_equal(at(wind, -5.0), (0, 0, 0))


def test_shear_is_in_proportion_to_the_height() -> None:
    wind = ShearWind(0.1, 270.0)
    assert at(wind, 50.0) == pytest.approx((0, 5, 0))
    assert at(wind, -10.0) == pytest.approx((0, -1, 0))


def test_a_scaled_wind_is_so_many_times_the_wind() -> None:
    wind = ScaledWind(ConstantWind(1.0, 2.0, 3.0), 2.0) + (10.0, 0.0, 0.0)
    assert at(wind, 0.0) == (12.0, 4.0, 6.0)


def test_log_law() -> None:
    wind = LogWind(10.0, 180.0, reference_height=10.0, roughness=0.05)
    for height in (0.25, 0.5, 2.0, 40.0, 300.0):
        expected = 10 * np.log(height / 0.05) / np.log(10 / 0.05)
        assert at(wind, height)[0] == pytest.approx(expected, rel=0.01)
    assert 0 < at(wind, -10.0)[0] < 0.01 < at(wind, 0.0)[0] < at(wind, 0.05)[0]


def test_table_meets_its_values_and_is_constant_outside() -> None:
    for height, north, east in zip(HEIGHTS, NORTH, EAST, strict=True):
        assert at(TABLE, height) == pytest.approx((north, east, 0.0), abs=1e-12)
    assert at(TABLE, -100.0) == pytest.approx((0.0, 1.0, 0.0), abs=1e-12)
    assert at(TABLE, 5000.0) == pytest.approx((12.0, 16.0, 0.0), abs=1e-12)


def test_table_is_a_cubic_spline_between_its_inner_heights() -> None:
    height = np.linspace(10, 200, 200)
    expected = CubicSpline(HEIGHTS, NORTH, bc_type='clamped')(height)
    np.testing.assert_allclose(at(TABLE, height)[0], expected, atol=1e-12)


def test_table_with_updraught_and_two_heights() -> None:
    wind = TableWind([0.0, 100.0], [0.0, 0.0], [0.0, 0.0], down=[0.0, -2.0])
    assert at(wind, 50.0) == pytest.approx((0, 0, -1))


@pytest.mark.parametrize('name', PROFILES)
def test_scalars_arrays_and_symbols_agree(name: str) -> None:
    wind = PROFILES[name]
    height = np.array([-10.0, 0.0, 0.02, 0.5, 3.0, 10.0, 77.0, 200.0, 1000.0, 4000.0])
    expected = np.array(np.broadcast_arrays(*at(wind, height)))
    np.testing.assert_array_equal(
        np.transpose([np.broadcast_to(at(wind, float(h)), 3) for h in height]), expected
    )
    for symbol in (cas.SX, cas.MX):
        x = symbol.sym('height', height.size)
        north, east, _ = at(wind, x)
        values = cas.Function('wind', [x], [north, east])(height)
        # relative to the wind; the logarithm of nearly 1 loses digits beneath the ground
        np.testing.assert_allclose(
            np.hstack([np.array(v) for v in values]).T, expected[:2], rtol=1e-12, atol=1e-13
        )


@pytest.mark.parametrize('name', PROFILES)
@pytest.mark.parametrize('height', [-3.0, 0.0, 0.03, 0.5, 1.0, 10.0, 120.0, 1000.0, 2000.0])
def test_two_derivatives_are_finite_continuous_and_right(name: str, height: float) -> None:
    x = cas.SX.sym('height')
    out = cas.vertcat(*at(PROFILES[name], x)[:2])
    slope = cas.jacobian(out, x)
    f = cas.Function('wind', [x], [out, slope, cas.jacobian(slope, x)])
    value, first, second = (np.array(v).ravel() for v in f(height))
    assert np.isfinite([*value, *first, *second]).all()
    h = 1e-4
    low, high = ([np.array(v).ravel() for v in f(height + d)] for d in (-h, h))
    scale = 12 / 0.03  # the steepest: the log law over its roughness
    np.testing.assert_allclose((high[0] - low[0]) / (2 * h), first, rtol=1e-3, atol=1e-6 * scale)
    # The third derivative jumps, so the second moves by at most h times it on either side.
    np.testing.assert_allclose((low[2] + high[2]) / 2, second, rtol=0.05, atol=1e-3 * scale)


def test_winds_add_up() -> None:
    wind = ConstantWind(1.0, 2.0, 3.0) + (10.0, 20.0, 30.0) + (lambda x, y, z, t: (t, 0.0, x))
    assert wind(100.0, 0.0, 0.0, 7.0) == (18.0, 22.0, 133.0)
    assert ConstantWind(1.0) + None == ConstantWind(1.0)


def test_as_wind() -> None:
    assert as_wind(None) is None
    assert as_wind(TABLE) is TABLE
    assert as_wind([1.0, 2.0, 3.0]) == ConstantWind(1.0, 2.0, 3.0)
    for nonsense in (5.0, (1.0, 2.0), 'north'):
        with pytest.raises(InputError, match='is no wind'):
            as_wind(nonsense)


def test_constant_wind_may_be_symbolic() -> None:
    w = cas.MX.sym('w', 3)
    assert as_wind((w[0], w[1], w[2])) is not None


@pytest.mark.parametrize(
    ('make', 'message'),
    [
        (lambda: ConstantWind(float('nan')), 'x is nan'),
        (lambda: ShearWind(float('inf'), 0.0), 'gradient is inf'),
        (lambda: PowerLawWind(5.0, 0.0, reference_height=0.0), 'reference_height is 0.0'),
        (lambda: PowerLawWind(5.0, 0.0, exponent=-0.1), 'exponent is -0.1'),
        (lambda: LogWind(5.0, 0.0, roughness=0.0), 'roughness is 0.0'),
        (lambda: LogWind(5.0, 0.0, reference_height=0.01), 'above the roughness'),
        (lambda: TableWind([0, 10, 10], [0, 0, 0], [0, 0, 0]), '10.0 is followed by 10.0'),
        (lambda: TableWind([0, 10], [0, 0, 0], [0, 0]), 'north has shape'),
        (lambda: TableWind([0], [0], [0]), 'at least 2'),
        (lambda: TableWind([0, 1], [0, float('inf')], [0, 0]), 'north has values'),
    ],
)
def test_bad_winds_are_refused(make: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()
