"""The standard atmosphere against its own tables, its equations and another implementation."""

import json
import warnings
from pathlib import Path
from typing import Any

import casadi as cas
import numpy as np
import pytest

from flightdyn.environment.atmosphere import (
    G0,
    Atmosphere,
    gas_constant_air,
    gas_constant_universal,
    geometric_altitude,
    geopotential_altitude,
)
from flightdyn.errors import InputError

GOLDEN = Path(__file__).parents[1] / 'data' / 'golden'
CORNERS = [11e3, 20e3, 32e3, 47e3, 51e3, 71e3, 84_852.0]
ALTITUDES = np.linspace(-1000.0, 86_000.0, 8701)
QUANTITIES = 'temperature pressure density speed_of_sound dynamic_viscosity mean_free_path'.split()


def printed(value: float, digits: int) -> float:
    return float(f'{value:.{digits - 1}e}')


# NOAA-S/T 76-1562, table I by geopotential and geometric altitude: K, Pa, kg/m^3.
BY_GEOPOTENTIAL = [
    (0, 288.150, 1.01325e5, 1.2250),
    (5000, 255.650, 5.4020e4, 7.3612e-1),
    (11_000, 216.650, 2.2632e4, 3.6392e-1),
    (20_000, 216.650, 5.4749e3, 8.8035e-2),
    (32_000, 228.650, 8.6802e2, 1.3225e-2),
    (47_000, 270.650, 1.1091e2, 1.4275e-3),
    (51_000, 270.650, 6.6939e1, 8.6160e-4),
    (71_000, 214.650, 3.9564e0, 6.4211e-5),
    (84_852, 186.946, 3.7338e-1, 6.9579e-6),
]
BY_GEOMETRIC = [
    (5000, 255.676, 5.4048e4, 7.3643e-1),
    (10_000, 223.252, 2.6500e4, 4.1351e-1),
    (20_000, 216.650, 5.5293e3, 8.8910e-2),
    (30_000, 226.509, 1.1970e3, 1.8410e-2),
    (40_000, 250.350, 2.8714e2, 3.9957e-3),
    (50_000, 270.650, 7.9779e1, 1.0269e-3),
    (60_000, 247.021, 2.1959e1, 3.0968e-4),
    (70_000, 219.585, 5.2209e0, 8.2829e-5),
]


@pytest.mark.parametrize(('altitude', 'temperature', 'pressure', 'density'), BY_GEOPOTENTIAL)
def test_printed_table_by_geopotential_altitude(
    altitude: float, temperature: float, pressure: float, density: float
) -> None:
    air = Atmosphere(altitude, 'isa')
    assert round(air.temperature(), 3) == temperature
    assert printed(air.pressure(), 5 if altitude else 6) == pressure
    assert printed(air.density(), 5) == density


@pytest.mark.parametrize(('altitude', 'temperature', 'pressure', 'density'), BY_GEOMETRIC)
def test_printed_table_by_geometric_altitude(
    altitude: float, temperature: float, pressure: float, density: float
) -> None:
    air = Atmosphere.at_geometric_altitude(altitude, 'isa')
    assert round(air.temperature(), 3) == temperature
    assert printed(air.pressure(), 5) == pressure
    assert printed(air.density(), 5) == density


def test_printed_speed_of_sound_and_viscosity() -> None:
    ground, high = Atmosphere(0.0), Atmosphere.at_geometric_altitude(10e3)
    assert round(ground.speed_of_sound(), 2) == 340.29
    assert round(high.speed_of_sound(), 2) == 299.53
    assert printed(ground.dynamic_viscosity(), 5) == 1.7894e-5
    assert printed(high.dynamic_viscosity(), 5) == 1.4577e-5
    assert printed(ground.kinematic_viscosity(), 5) == 1.4607e-5
    assert ground.ratio_of_specific_heats() == 1.4
    assert gas_constant_universal == 8.31432


@pytest.mark.parametrize('deviation', [0, 15])
def test_isa_agrees_with_another_implementation(deviation: int) -> None:
    golden = json.loads((GOLDEN / 'atmosphere.json').read_text())
    altitude = np.array(golden['altitude'])
    expected = golden[f'isa_dT{deviation}']
    air = Atmosphere(altitude, 'isa', deviation)
    for name in [*QUANTITIES, 'kinematic_viscosity']:
        # both are the same closed forms, so only rounding may differ
        np.testing.assert_allclose(getattr(air, name)(), expected[name], rtol=1e-12)
    lower = altitude < 11e3  # the other's formula is the troposphere's
    np.testing.assert_allclose(
        air.density_altitude()[lower],
        np.array(expected['density_altitude_approximate'])[lower],
        atol=1e-9,
    )


def test_deviation_shifts_temperature_and_leaves_pressure() -> None:
    warm, standard = Atmosphere(3000.0, 'isa', 15.0), Atmosphere(3000.0, 'isa')
    assert warm.pressure() == standard.pressure()
    assert warm.temperature() == standard.temperature() + 15
    assert warm.density() * warm.temperature() == pytest.approx(
        standard.density() * standard.temperature()
    )


@pytest.mark.parametrize(
    ('name', 'allowed'), [('temperature', 4.01e-4), ('density', 4.01e-4), ('pressure', 5.6e-6)]
)
def test_rounded_corners_stay_close_to_the_standard(name: str, allowed: float) -> None:
    altitude = np.linspace(-1000, 86_000, 87_001)
    rounded, exact = (getattr(Atmosphere(altitude, m), name)() for m in ('differentiable', 'isa'))
    assert np.abs(rounded / exact - 1).max() < allowed


def test_standard_is_untouched_between_the_corners() -> None:
    far = np.abs(ALTITUDES[:, None] - CORNERS).min(axis=1) > 1000
    rounded, exact = Atmosphere(ALTITUDES[far]), Atmosphere(ALTITUDES[far], 'isa')
    np.testing.assert_array_equal(rounded.temperature(), exact.temperature())
    np.testing.assert_array_equal(rounded.pressure(), exact.pressure())


@pytest.mark.parametrize(('method', 'allowed'), [('isa', 1e-8), ('differentiable', 1e-6)])
def test_pressure_is_hydrostatic(method: str, allowed: float) -> None:
    x = cas.SX.sym('altitude')
    air = Atmosphere(x, method)
    residual = cas.Function(
        'residual', [x], [cas.jacobian(air.pressure(), x) / (G0 * air.density()) + 1]
    )
    worst = np.abs(np.array(residual.map(ALTITUDES.size)(ALTITUDES))).max()
    # rounding leaves ln p the integral of a temperature that is right to the first order only
    assert worst < allowed


def all_of(air: Atmosphere) -> list[Any]:
    return [getattr(air, name)() for name in [*QUANTITIES, 'density_altitude']]


@pytest.mark.parametrize('symbol', [cas.SX, cas.MX])
@pytest.mark.parametrize('method', ['isa', 'differentiable'])
def test_symbols_give_the_numbers_of_arrays(symbol: Any, method: str) -> None:
    x = symbol.sym('altitude', ALTITUDES.size)
    function = cas.Function('air', [x], [cas.horzcat(*all_of(Atmosphere(x, method)))])
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        expected = np.transpose(all_of(Atmosphere(ALTITUDES, method)))
    # 1e-10: density altitude is 0 somewhere
    np.testing.assert_allclose(np.array(function(ALTITUDES)), expected, rtol=1e-13, atol=1e-10)


@pytest.mark.parametrize('method', ['isa', 'differentiable'])
def test_scalars_and_arrays_agree_to_the_bit(method: str) -> None:
    altitude = np.concatenate((ALTITUDES[::37], CORNERS, np.nextafter(CORNERS, 0)))
    one_by_one = [all_of(Atmosphere(float(x), method)) for x in altitude]
    np.testing.assert_array_equal(np.transpose(one_by_one), all_of(Atmosphere(altitude, method)))
    np.testing.assert_array_equal(
        all_of(Atmosphere(np.array(5000.0), method)), all_of(Atmosphere(5000, method))
    )


def derivatives() -> tuple[cas.Function, list[str]]:
    """Return value, first and second derivative by altitude of everything."""
    x = cas.SX.sym('altitude')
    out = cas.vertcat(*all_of(Atmosphere(x)))
    first = cas.jacobian(out, x)
    return cas.Function('air', [x], [out, first, cas.jacobian(first, x)]), QUANTITIES


def test_gradients_agree_with_differences() -> None:
    function, _ = derivatives()
    h = 1.0
    for x in np.random.default_rng(1).uniform(-1000, 86_000, 50):
        low, high = (np.array(function(v)[0]) for v in (x - h, x + h))
        difference = (high - low) / (2 * h)
        # central differences: relative to the scale height, 1e-8 h^2 plus rounding
        np.testing.assert_allclose(
            np.array(function(x)[1]), difference, rtol=1e-5, atol=np.abs(low).max() * 1e-14
        )


@pytest.mark.parametrize('corner', CORNERS)
def test_two_derivatives_are_continuous_at_corners_and_where_rounding_ends(corner: float) -> None:
    function, names = derivatives()
    n = len(names)
    air = Atmosphere(corner + np.arange(-1100.0, 1100.0), 'differentiable')
    standard = Atmosphere(air.altitude, 'isa')
    touched = np.flatnonzero(air.temperature() != standard.temperature())
    ends = air.altitude[touched[[0, -1]]] + [-1.0, 1.0]
    for x in (corner, *ends):
        for k in (1, 2):
            around = [np.array(function(x + d)[k]).ravel()[:n] for d in (-0.5, 0.0, 0.5)]
            scale = np.abs(
                [np.array(function(x + d)[k]).ravel()[:n] for d in np.linspace(-900, 900, 61)]
            ).max(axis=0)
            # A jump would be of the order of the scale; a change over 1 m is of 1 m / 171 m, the
            # narrowest corner.
            assert (np.ptp(around, axis=0) < 0.08 * scale).all(), (x, k)


def test_derivatives_are_finite_everywhere() -> None:
    function, _ = derivatives()
    middles = [15_500.0, 26_000.0, 39_500.0, 49_000.0, 61_000.0, 77_926.0]
    for x in [-1e4, -1000.0, 0.0, *CORNERS, *middles, 86_000.0, 1e5, 5e5]:
        for values in function(x)[:2]:
            assert np.isfinite(np.array(values)).all(), x
        assert np.isfinite(np.array(function(x)[2])).all(), x


def test_density_altitude_of_the_standard_is_the_altitude() -> None:
    air = Atmosphere(ALTITUDES, 'isa')
    np.testing.assert_allclose(air.density_altitude(), ALTITUDES, atol=1e-9)


def test_hot_day_has_a_higher_density_altitude() -> None:
    # 118.8 ft a kelvin is the pilot's rule of thumb for small deviations near sea level
    assert Atmosphere(0.0, 'isa', 1.0).density_altitude() / 0.3048 == pytest.approx(118.8, abs=2)


def test_geopotential_altitude_of_86_km() -> None:
    assert geopotential_altitude(86_000.0) == pytest.approx(84_852, abs=0.5)
    assert geometric_altitude(geopotential_altitude(12_345.0)) == pytest.approx(12_345)


def test_isothermal_above_the_table_with_a_warning_for_numbers() -> None:
    with pytest.warns(UserWarning, match='-5 km to 86 km'):
        air = Atmosphere(np.array([84_852.0, 90_000.0, 120_000.0]), 'isa')
    np.testing.assert_allclose(air.temperature(), 186.946)
    scale = gas_constant_air * 186.946 / G0
    expected = air.pressure()[0] * np.exp(-(air.altitude - 84_852) / scale)
    np.testing.assert_allclose(air.pressure(), expected, rtol=1e-12)
    with pytest.warns(UserWarning, match='-5 km to 86 km'):
        Atmosphere(-6000.0)
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        Atmosphere.at_geometric_altitude(np.array([-5000.0, 86_000.0]))
        Atmosphere(cas.MX.sym('altitude'))


def test_nan_in_is_nan_out() -> None:
    for value in (np.nan, np.array([1000.0, np.nan])):
        for quantity in all_of(Atmosphere(value)):
            np.testing.assert_array_equal(np.isnan(quantity), np.isnan(value))


def test_unknown_method_names_the_two() -> None:
    with pytest.raises(InputError, match="'ISA 76' is unknown; known: differentiable, isa"):
        Atmosphere(0.0, 'ISA 76')


def test_values_cannot_change_behind_what_is_kept() -> None:
    altitude = np.array([0.0, 1000.0])
    air = Atmosphere(altitude)
    before = air.pressure().copy()
    altitude[:] = 5000.0
    np.testing.assert_array_equal(air.pressure(), before)
    with pytest.raises(AttributeError):
        air.altitude = 3.0  # type: ignore[misc]
    with pytest.raises(ValueError, match='read-only'):
        air.altitude[0] = 3.0


def test_items_and_length() -> None:
    air = Atmosphere(np.array([0.0, 1000.0, 2000.0]), 'isa', 5.0)
    assert len(air) == 3 and len(air[1:]) == 2 and len(Atmosphere(7.0)) == 1
    assert air[-1].altitude == 2000 and air[-1].temperature_deviation == 5
    assert air[-1].method == 'isa'
    assert [one.altitude for one in air] == [0, 1000, 2000]
    with pytest.raises(IndexError, match='3 elements, index 3'):
        air[3]
    with pytest.raises(InputError, match='altitude 3, temperature_deviation 2'):
        len(Atmosphere(np.zeros(3), temperature_deviation=np.zeros(2)))
    symbols = Atmosphere(cas.SX.sym('h', 4))
    assert len(symbols) == 4 and symbols[2].altitude.shape == (1, 1)


def test_repr_shows_what_it_was_made_of() -> None:
    assert repr(Atmosphere(1000.0, 'isa')) == (
        "Atmosphere(altitude=1000.0, method='isa', temperature_deviation=0.0)"
    )


def test_mean_free_path_and_knudsen_number() -> None:
    air = Atmosphere(0.0)
    # Vincenti and Kruger: 6.4e-8 m at standard conditions
    assert air.mean_free_path() == pytest.approx(6.37e-8, rel=5e-3)
    assert air.knudsen(2.0) == air.mean_free_path() / 2
