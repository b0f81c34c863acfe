"""The operating point against reference numbers, by hand, and in place of AeroSandbox's own."""

import json
from pathlib import Path
from typing import Any

import casadi as cas
import numpy as np
import pytest

from flightdyn.dynamics.operating_point import OperatingPoint
from flightdyn.environment.atmosphere import SPEED_OF_SOUND_SEA_LEVEL, Atmosphere
from flightdyn.errors import InputError

GOLDEN = Path(__file__).parents[1] / 'data' / 'golden' / 'operating_point.json'
CASES = json.loads(GOLDEN.read_text())['cases']
STATE = ('velocity', 'alpha', 'beta', 'p', 'q', 'r')
SCALARS = (
    'dynamic_pressure total_pressure total_temperature mach equivalent_airspeed energy_altitude'
).split()


def of_case(case: dict[str, Any]) -> OperatingPoint:
    air = Atmosphere(case['altitude'], case['method'])
    return OperatingPoint(air, **{name: case[name] for name in STATE})


@pytest.mark.parametrize('case', CASES, ids=range(len(CASES)))
def test_agrees_with_another_implementation(case: dict[str, Any]) -> None:
    point = of_case(case)
    for name in SCALARS:
        assert getattr(point, name)() == pytest.approx(case[name], rel=1e-12), name
    assert point.reynolds(1.0) == pytest.approx(case['reynolds_L1'], rel=1e-12)
    assert point.reynolds(0.3) == pytest.approx(case['reynolds_L0p3'], rel=1e-12)
    for found, expected in (
        (point.compute_rotation_matrix_wind_to_geometry(), 'R_wind_to_geometry'),
        (point.compute_freestream_direction_geometry_axes(), 'freestream_direction_geometry'),
        (
            point.compute_rotation_velocity_geometry_axes(case['rotation_velocity_points']),
            'rotation_velocity_geometry',
        ),
    ):
        np.testing.assert_allclose(found, case[expected], atol=1e-13)
    for pair in case['convert_axes']:
        out = point.convert_axes(*pair['v'], pair['from_axes'], pair['to_axes'])
        np.testing.assert_allclose(out, pair['out'], atol=1e-13)


def test_indicated_airspeed_at_sea_level_is_true_airspeed() -> None:
    point = OperatingPoint(velocity=0.8 * SPEED_OF_SOUND_SEA_LEVEL)
    # incompressible Bernoulli with the total pressure would give 294.5 m/s
    assert point.indicated_airspeed() == pytest.approx(272.235, abs=1e-3)
    fast = OperatingPoint(velocity=np.array([0.0, 50.0, 340.0, 700.0]))
    np.testing.assert_allclose(fast.calibrated_airspeed(), fast.velocity, rtol=1e-12)


def test_freestream_comes_from_below_and_from_the_right() -> None:
    point = OperatingPoint(velocity=10.0, alpha=30.0, beta=0.0)
    # geometry axes point aft, right, up: the air goes aft and up
    np.testing.assert_allclose(
        point.compute_freestream_velocity_geometry_axes(), [5 * np.sqrt(3), 0, 5]
    )
    point = OperatingPoint(velocity=10.0, alpha=0.0, beta=30.0)
    np.testing.assert_allclose(
        point.compute_freestream_velocity_geometry_axes(), [5 * np.sqrt(3), -5, 0]
    )


def test_rolling_right_meets_air_from_below_on_the_right_wing() -> None:
    point = OperatingPoint(p=2.0)
    velocity = point.compute_rotation_velocity_geometry_axes([[0.0, 3.0, 0.0]])
    np.testing.assert_allclose(velocity, [[0.0, 0.0, 6.0]], atol=1e-15)


@pytest.mark.parametrize('symbol', [cas.SX, cas.MX])
def test_symbols_give_the_numbers_of_arrays(symbol: Any) -> None:
    rng = np.random.default_rng(2)
    values = rng.uniform((0, 10, -10, -5), (15e3, 300, 15, 5), (6, 4))
    values[0, 1] = 0.0

    def evaluated(x: Any) -> list[Any]:
        point = OperatingPoint(Atmosphere(x[:, 0]), x[:, 1], x[:, 2], x[:, 3], 0.1, 0.2, 0.3)
        scalars = [getattr(point, name)() for name in [*SCALARS, 'calibrated_airspeed']]
        directions = point.compute_freestream_velocity_geometry_axes()
        return [*scalars, *(directions[:, i] for i in range(3))]

    x = symbol.sym('x', 6, 4)
    out = cas.horzcat(*evaluated(x))
    function = cas.Function('point', [x], [out, cas.jacobian(out, x)])
    found, slopes = (np.array(v) for v in function(values))
    np.testing.assert_allclose(found, np.transpose(evaluated(values)), rtol=1e-12, atol=1e-12)
    assert np.isfinite(slopes).all()  # at rest, too


def test_gradients_agree_with_differences_at_rest_and_in_flight() -> None:
    x = cas.SX.sym('x', 4)
    point = OperatingPoint(Atmosphere(x[0]), x[1], x[2], x[3])
    out = cas.vertcat(
        point.mach(),
        point.calibrated_airspeed(),
        point.total_pressure(),
        point.reynolds(1.0),
        *point.convert_axes(1.0, 2.0, 3.0, 'wind', 'geometry'),
    )
    slope = cas.jacobian(out, x)
    f = cas.Function('f', [x], [out, slope, cas.jacobian(slope, x)])
    for at in ([500.0, 0.0, 0.0, 0.0], [11_000.0, 230.0, 4.0, -2.0], [20e3, 500.0, 1.0, 1.0]):
        value, jacobian, hessian = (np.array(v) for v in f(at))
        assert np.isfinite(hessian).all()
        for k, h in enumerate((0.1, 1e-3, 1e-3, 1e-3)):
            step = np.eye(4)[k] * h
            high, low = (np.array(f(at + s)[0]) for s in (step, -step))
            np.testing.assert_allclose(
                ((high - low) / (2 * h)).ravel(),
                jacobian[:, k],
                rtol=1e-6,
                atol=1e-11 * np.abs(value).max() / h,
            )


def test_arrays_have_the_points_on_the_first_axis() -> None:
    point = OperatingPoint(velocity=np.array([10.0, 20.0]), alpha=5.0, beta=np.array([0.0, 3.0]))
    assert point.compute_rotation_matrix_wind_to_geometry().shape == (2, 3, 3)
    for i in range(2):
        np.testing.assert_array_equal(
            point.compute_rotation_matrix_wind_to_geometry()[i],
            point[i].compute_rotation_matrix_wind_to_geometry(),
        )
        np.testing.assert_array_equal(
            point.compute_freestream_velocity_geometry_axes()[i],
            point[i].compute_freestream_velocity_geometry_axes(),
        )


def test_symbolic_rotation_matrix() -> None:
    alpha = cas.SX.sym('alpha')
    matrix = OperatingPoint(alpha=alpha, beta=2.0).compute_rotation_matrix_wind_to_geometry()
    found = cas.Function('r', [alpha], [matrix])(5.0)
    expected = OperatingPoint(alpha=5.0, beta=2.0).compute_rotation_matrix_wind_to_geometry()
    np.testing.assert_allclose(np.array(found), expected, atol=1e-15)
    vector = OperatingPoint(alpha=cas.SX.sym('alpha', 2))
    with pytest.raises(InputError, match='index the operating point first'):
        vector.compute_rotation_matrix_wind_to_geometry()


def test_items_and_length() -> None:
    point = OperatingPoint(
        Atmosphere(np.array([0.0, 1000.0, 2000.0])), np.array([1.0, 2.0, 3.0]), alpha=4.0
    )
    assert len(point) == 3 and len(OperatingPoint()) == 1
    last = point[-1]
    assert (last.atmosphere.altitude, last.velocity, last.alpha) == (2000.0, 3.0, 4.0)
    assert len(point[:2]) == 2 and len(list(point)) == 3
    with pytest.raises(IndexError, match='index 3'):
        point[3]
    with pytest.raises(InputError, match='velocity 3, alpha 2'):
        len(OperatingPoint(velocity=np.ones(3), alpha=np.ones(2)))


def test_state_packs_and_unpacks() -> None:
    point = OperatingPoint(Atmosphere(1000.0), 50.0, 3.0, 1.0, 0.1, 0.2, 0.3)
    assert point.pack_state(point.unpack_state()) == point.state == point.pack_state()
    faster = point.get_new_instance_with_state({'velocity': 60.0})
    assert (faster.velocity, faster.alpha, point.velocity) == (60.0, 3.0, 50.0)
    assert faster.get_new_instance_with_state(point.unpack_state()).state == point.state
    with pytest.raises(InputError, match='has no speed; it has atmosphere, velocity'):
        point.get_new_instance_with_state({'speed': 60.0})
    with pytest.raises(InputError, match='2 values for an operating point; it has 7'):
        point.pack_state([1.0, 2.0])


def test_copies_are_independent() -> None:
    point = OperatingPoint(alpha=3.0)
    other = point.copy()
    other.alpha += 1.0
    assert (point.alpha, other.alpha) == (3.0, 4.0)


def test_unknown_axes_are_refused() -> None:
    for pair in (('earth', 'body'), ('body', 'Wind'), ('earth', 'earth')):
        with pytest.raises(InputError, match='known: geometry, body, wind, stability'):
            OperatingPoint().convert_axes(1.0, 2.0, 3.0, *pair)


def test_aerosandbox_takes_it_in_place_of_its_own() -> None:
    asb = pytest.importorskip('aerosandbox')
    airfoil = asb.Airfoil('naca2412')
    sections = [
        asb.WingXSec(xyz_le=[0.0, 0.0, 0.0], chord=1.0, airfoil=airfoil),
        asb.WingXSec(xyz_le=[0.2, 4.0, 0.3], chord=0.6, airfoil=airfoil),
    ]
    airplane = asb.Airplane(wings=[asb.Wing(symmetric=True, xsecs=sections)])
    values = {'velocity': 63.0, 'alpha': 5.0, 'beta': 3.0, 'p': 0.1, 'q': 0.2, 'r': -0.15}
    theirs = asb.OperatingPoint(asb.Atmosphere(3000.0, method='isa'), **values)
    ours = OperatingPoint(Atmosphere(3000.0, 'isa'), **values)
    expected, found = (
        asb.AeroBuildup(airplane=airplane, op_point=point).run() for point in (theirs, ours)
    )
    for name in ('F_w', 'M_b', 'F_g', 'CL', 'CD', 'Cm'):
        np.testing.assert_allclose(
            np.squeeze(found[name]), np.squeeze(expected[name]), rtol=1e-12, atol=1e-12
        )
