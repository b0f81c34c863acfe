"""Wind: aerodynamics see the velocity through the air, speed and track stay inertial."""

from typing import Any

import casadi as cas
import numpy as np
import pytest
from dynamics_making import BODY, CLASSES, WIND, add_loads, random_values

from flightdyn.dynamics import (
    Dynamics,
    DynamicsPointMass1DVertical,
    DynamicsPointMass2DSpeedGamma,
    DynamicsPointMass3DCartesian,
    DynamicsPointMass3DSpeedGammaTrack,
    DynamicsRigidBody3DBodyEuler,
    DynamicsRigidBody3DBodyQuaternion,
)
from flightdyn.environment.atmosphere import Atmosphere

every_class = pytest.mark.parametrize('cls', CLASSES)


@every_class
def test_airspeed_is_the_length_of_velocity_less_wind(cls: type[Dynamics]) -> None:
    dyn = cls(BODY, wind=WIND, **random_values(cls))
    expected = np.linalg.norm(np.array(dyn.velocity_earth) - WIND)
    assert dyn.airspeed == pytest.approx(expected, rel=1e-14)
    assert dyn.op_point.velocity == pytest.approx(expected, rel=1e-14)
    assert dyn.speed == pytest.approx(np.linalg.norm(dyn.velocity_earth), rel=1e-14)


def test_hand_worked_wind_on_a_rigid_body_flying_north() -> None:
    # moving 20 m/s north, level; the air moves 5 m/s south, 3 m/s west and 2 m/s up
    for cls in (DynamicsRigidBody3DBodyEuler, DynamicsRigidBody3DBodyQuaternion):
        dyn = cls(BODY, u_b=20.0, wind=(-5.0, -3.0, -2.0))
        assert dyn.air_velocity_body == (25.0, 3.0, 2.0)
        assert dyn.airspeed == pytest.approx(np.sqrt(25**2 + 3**2 + 2**2))
        assert dyn.alpha == pytest.approx(np.degrees(np.arctan(2 / 25)))  # updraught: nose high
        assert dyn.beta == pytest.approx(np.degrees(np.arcsin(3 / dyn.airspeed)))
        assert (dyn.speed, dyn.gamma, dyn.track) == (20.0, 0.0, 0.0)


@every_class
def test_drag_pushes_towards_the_wind(cls: type[Dynamics]) -> None:
    dyn = cls(BODY, wind=WIND, **random_values(cls))
    dyn.add_force(Fx=-3.0, axes='wind')
    force = dyn.convert_axes(-3.0, 0.0, 0.0, 'wind', 'earth')
    np.testing.assert_allclose(
        force, -3.0 * np.array(dyn.air_velocity_earth) / dyn.airspeed, rtol=1e-12, atol=1e-14
    )


@every_class
def test_still_air_by_wind_zero_is_still_air(cls: type[Dynamics]) -> None:
    values = random_values(cls)
    none, zero = cls(BODY, **values), cls(BODY, wind=(0.0, 0.0, 0.0), **values)
    for dyn in (none, zero):
        add_loads(dyn)
    expected = none.state_derivatives()
    for name, value in zero.state_derivatives().items():
        assert value == pytest.approx(expected[name], rel=1e-12, abs=1e-13)
    assert zero.load_factor == pytest.approx(none.load_factor)


@pytest.mark.parametrize('axes', ['wind', 'stability', 'body', 'geometry'])
def test_a_uniform_wind_only_carries_the_vehicle(axes: str) -> None:
    """Seen from the air, a flight in wind is the flight in still air."""
    values = random_values(DynamicsPointMass3DCartesian)
    still = DynamicsPointMass3DCartesian(BODY, **values)
    carried = {name: values[name] + w for name, w in zip(('u_e', 'v_e', 'w_e'), WIND, strict=True)}
    blown = DynamicsPointMass3DCartesian(BODY, wind=WIND, **{**values, **carried})
    for dyn in (still, blown):
        dyn.add_force(1.0, 2.0, -3.0, axes=axes)
    for name in ('u_e', 'v_e', 'w_e'):
        assert blown.state_derivatives()[name] == pytest.approx(
            still.state_derivatives()[name], rel=1e-12
        )


def test_bank_rolls_about_the_velocity_through_the_air() -> None:
    # flying north over the ground in a wind from the east: the nose points right of the track
    dyn = DynamicsPointMass3DSpeedGammaTrack(BODY, speed=20.0, wind=(0.0, -20.0, 0.0), bank=0.3)
    assert dyn.airspeed == pytest.approx(np.hypot(20, 20))
    north, east, down = dyn.convert_axes(1, 0, 0, 'wind', 'earth')
    assert (north, east, down) == pytest.approx((np.sqrt(0.5), np.sqrt(0.5), 0))
    lift = dyn.convert_axes(0, 0, -1, 'wind', 'earth')  # tilted right of a flight north-east
    assert lift == pytest.approx(
        (-np.sin(0.3) * np.sqrt(0.5), np.sin(0.3) * np.sqrt(0.5), -np.cos(0.3))
    )


def test_wind_may_depend_on_position_and_time() -> None:
    def wind(x_e: Any, y_e: Any, z_e: Any, time: Any) -> tuple[Any, Any, Any]:
        return 0.1 * -z_e, 0.2 * x_e, 3.0 * time

    dyn = DynamicsPointMass2DSpeedGamma(x_e=10.0, z_e=-50.0, speed=20.0, wind=wind, time=0.5)
    assert dyn.wind_earth == pytest.approx((5.0, 2.0, 1.5))
    t = cas.SX.sym('t')
    symbolic = DynamicsPointMass1DVertical(w_e=0.0, wind=wind, time=t)
    assert cas.Function('f', [t], [symbolic.airspeed])(2.0) == pytest.approx(6.0)


def test_the_atmosphere_may_be_another() -> None:
    dyn = DynamicsPointMass1DVertical(
        z_e=-1000.0, atmosphere=lambda h: Atmosphere(h, temperature_deviation=15.0)
    )
    assert dyn.op_point.atmosphere.temperature() == pytest.approx(
        Atmosphere(1000.0).temperature() + 15
    )
    assert dyn[0].op_point.atmosphere.temperature_deviation == 15.0
