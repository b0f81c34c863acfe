"""Motions with known answers: invariants, closed forms, and the same flight in two classes."""

from typing import Any

import numpy as np
import pytest
from dynamics_making import BODY, CLASSES, WIND, add_loads, random_values
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from flightdyn.dynamics import (
    Dynamics,
    DynamicsPointMass2DCartesian,
    DynamicsPointMass2DSpeedGamma,
    DynamicsPointMass3DCartesian,
    DynamicsPointMass3DSpeedGammaTrack,
    DynamicsRigidBody2DBody,
    DynamicsRigidBody3DBodyEuler,
    DynamicsRigidBody3DBodyQuaternion,
    MassProperties,
)

every_class = pytest.mark.parametrize('cls', CLASSES)

# Principal moments 0.37, 0.50 and 0.73: a body that tumbles, with all three products.
TUMBLER = MassProperties(mass=2.0, Ixx=0.4, Iyy=0.5, Izz=0.7, Ixy=0.05, Iyz=-0.03, Ixz=0.1)
ROTOR = {'hx_b': 0.3, 'hy_b': -0.1, 'hz_b': 0.2}


def fly(start: Dynamics, duration: float, attach: Any = None, rtol: float = 1e-12) -> Dynamics:
    """Return the states of a flight at 101 times, as one instance."""

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        dyn = start.get_new_instance_with_state(start.pack_state(y))
        dyn.time = t
        if attach is not None:
            attach(dyn)
        return dyn.unpack_state(dyn.state_derivatives())

    times = np.linspace(0, duration, 101)
    flown = solve_ivp(
        rates, (0, duration), start.unpack_state(), 'DOP853', times, rtol=rtol, atol=rtol
    )
    return start.get_new_instance_with_state(flown.y)


def weight(dyn: Dynamics) -> None:
    dyn.add_gravity_force()


@pytest.mark.parametrize('cls', [DynamicsRigidBody3DBodyEuler, DynamicsRigidBody3DBodyQuaternion])
def test_a_free_body_keeps_angular_momentum_and_energy(cls: type[Dynamics]) -> None:
    start = cls(TUMBLER, p=1.0, q=2.0, r=-0.7, u_b=3.0, v_b=-1.0, w_b=2.0, **ROTOR)
    # 60 s are some 20 turns; DOP853 at 1e-13 leaves a few 1e-12
    flown: Any = fly(start, 60.0, rtol=1e-13)
    for vector in (flown.angular_momentum_earth, flown.momentum_earth):
        first = np.array([component[0] for component in vector])
        drift = np.linalg.norm(np.array(vector) - first[:, None], axis=0)
        assert drift.max() < 1e-10 * np.linalg.norm(first)
    assert np.ptp(flown.rotational_kinetic_energy) < 1e-10 * flown.rotational_kinetic_energy[0]
    assert np.ptp(flown.kinetic_energy) < 1e-10 * flown.kinetic_energy[0]
    assert np.ptp(flown.p) > 1.0  # it does tumble


def test_euler_angles_and_quaternion_describe_one_flight() -> None:
    def attach(dyn: Any) -> None:
        dyn.add_gravity_force()
        dyn.add_force(1.0, 0.5, -20.0, axes='wind')
        dyn.add_moment(0.1, -0.02, 0.05, axes='stability')
        dyn.add_moment(0.01, 0.03, 0.02, axes='earth')

    values = {'u_b': 20.0, 'v_b': 1.0, 'w_b': 2.0, 'p': 0.4, 'q': -0.2, 'r': 0.3, **ROTOR}
    angles = {'phi': 0.3, 'theta': -0.4, 'psi': 2.0}
    by_angles: Any = fly(
        DynamicsRigidBody3DBodyEuler(TUMBLER, wind=WIND, **values, **angles), 4.0, attach
    )
    by_quaternion: Any = fly(
        DynamicsRigidBody3DBodyQuaternion.from_euler(TUMBLER, wind=WIND, **values, **angles),
        4.0,
        attach,
    )
    assert np.abs(by_angles.theta).max() < 1.4  # away from the pole
    for name in ('x_e', 'y_e', 'z_e', 'u_b', 'v_b', 'w_b', 'p', 'q', 'r', 'theta', 'airspeed'):
        np.testing.assert_allclose(
            getattr(by_quaternion, name), getattr(by_angles, name), atol=1e-9, err_msg=name
        )
    for name in ('phi', 'psi'):
        apart = np.exp(1j * getattr(by_angles, name)) - np.exp(1j * getattr(by_quaternion, name))
        np.testing.assert_allclose(np.abs(apart), 0.0, atol=1e-9)


def test_the_quaternion_class_loops_through_the_poles() -> None:
    start = DynamicsRigidBody3DBodyQuaternion(TUMBLER, u_b=10.0, q=1.0)

    def steady(dyn: Any) -> None:
        """Hold the pitch rate, and the speed along the nose."""
        dyn.add_moment(*np.array([TUMBLER.Iyz, 0.0, -TUMBLER.Ixy]) * dyn.q**2)
        dyn.add_force(Fz=-2.0 * dyn.q * dyn.u_b)

    flown: Any = fly(start, 4 * np.pi, steady)
    t = np.linspace(0, 4 * np.pi, 101)
    np.testing.assert_allclose(flown.x_e, 10 * np.sin(t), atol=1e-8)  # two loops of radius V/q
    np.testing.assert_allclose(flown.altitude, 10 * (1 - np.cos(t)), atol=1e-8)


def test_the_quaternion_keeps_unit_length_and_returns_to_it() -> None:
    start = DynamicsRigidBody3DBodyQuaternion(TUMBLER, p=1.0, q=2.0, r=-0.7)
    loose: Any = fly(start, 60.0, rtol=1e-6)
    length = np.sqrt(loose.qw**2 + loose.qx**2 + loose.qy**2 + loose.qz**2)
    assert np.abs(length - 1).max() < 1e-5  # bounded by the tolerance, not growing with time
    start.qw = 1.2
    far: Any = fly(start, 10.0)
    assert far.qw[-1] ** 2 + far.qx[-1] ** 2 + far.qy[-1] ** 2 + far.qz[-1] ** 2 == pytest.approx(
        1
    )
    # length does not matter to the attitude
    assert far.convert_axes(1, 0, 0, 'body', 'earth')[0][0] == pytest.approx(1)


def test_the_quaternion_turns_as_scipy_turns() -> None:
    q = np.array([0.5, -0.1, 0.7, 0.3]) * 1.1
    dyn = DynamicsRigidBody3DBodyQuaternion(**dict(zip(('qw', 'qx', 'qy', 'qz'), q, strict=True)))
    rotation = Rotation.from_quat(q[[1, 2, 3, 0]])
    v = (1.0, 2.0, 3.0)
    np.testing.assert_allclose(dyn.convert_axes(*v, 'body', 'earth'), rotation.apply(v))
    np.testing.assert_allclose(dyn.convert_axes(*v, 'earth', 'body'), rotation.inv().apply(v))
    np.testing.assert_allclose([dyn.psi, dyn.theta, dyn.phi], rotation.as_euler('ZYX'))


@every_class
def test_gravity_alone_keeps_the_energy(cls: type[Dynamics]) -> None:
    flown = fly(cls(BODY, **random_values(cls)), 3.0, weight)
    energy = flown.kinetic_energy + flown.potential_energy
    if 'z_e' in cls.states:
        assert np.ptp(energy) < 1e-9 * np.abs(energy).max()
        assert np.ptp(flown.potential_energy) > 1.0
    else:
        np.testing.assert_array_equal(np.ptp(energy), 0)


@every_class
def test_without_loads_the_velocity_stays(cls: type[Dynamics]) -> None:
    flown = fly(cls(BODY, wind=WIND, **random_values(cls)), 3.0)
    for component in flown.velocity_earth:
        assert np.ptp(component) < 1e-10 * flown.speed.max()


def test_a_cannonball_flies_a_parabola() -> None:
    start = DynamicsPointMass3DSpeedGammaTrack(BODY, speed=50.0, gamma=0.8, track=0.3)
    end = fly(start, 5.0, weight)[-1]
    level, up = 50 * np.cos(0.8) * 5, 50 * np.sin(0.8) * 5 - 9.81 / 2 * 25
    position = (end.x_e, end.y_e, end.z_e)
    np.testing.assert_allclose(
        position, [level * np.cos(0.3), level * np.sin(0.3), -up], atol=1e-9
    )


@pytest.mark.parametrize(
    'start',
    [
        DynamicsPointMass3DSpeedGammaTrack(BODY, speed=30.0, gamma=0.2, bank=0.6),
        DynamicsPointMass3DCartesian(BODY, u_e=30 * np.cos(0.2), w_e=-30 * np.sin(0.2), bank=0.6),
    ],
)
def test_a_climbing_turn_is_a_helix(start: Dynamics) -> None:
    lift = BODY.mass * 9.81 * np.cos(0.2) / np.cos(0.6)

    def attach(dyn: Dynamics) -> None:
        dyn.add_gravity_force()
        dyn.add_force(Fx=BODY.mass * 9.81 * np.sin(0.2), Fz=-lift, axes='wind')

    flown = fly(start, 20.0, attach)
    level = 30 * np.cos(0.2)
    rate = lift * np.sin(0.6) / (BODY.mass * level)
    t = np.linspace(0, 20, 101)
    np.testing.assert_allclose(flown.x_e, level / rate * np.sin(rate * t), atol=1e-7)
    np.testing.assert_allclose(flown.y_e, level / rate * (1 - np.cos(rate * t)), atol=1e-7)
    np.testing.assert_allclose(flown.altitude, 30 * np.sin(0.2) * t, atol=1e-7)


def accelerations(dyn: Any) -> np.ndarray:
    """Return du_e/dt, dv_e/dt, dw_e/dt whatever the state."""
    rates = dyn.state_derivatives()
    if 'speed' in rates:
        h = 1e-6
        ends = []
        for sign in (1, -1):
            moved = {k: v + sign * h * rates[k] for k, v in dyn.state.items()}
            ends.append(np.array(dyn.get_new_instance_with_state(moved).velocity_earth))
        return (ends[0] - ends[1]) / (2 * h)
    return np.array([rates['u_e'], rates.get('v_e', 0.0), rates['w_e']])


@pytest.mark.parametrize('wind', [None, WIND])
def test_speed_and_angles_accelerate_as_components_do(wind: Any) -> None:
    values = random_values(DynamicsPointMass3DSpeedGammaTrack)
    by_angles = DynamicsPointMass3DSpeedGammaTrack(BODY, wind=wind, **values)
    u_e, v_e, w_e = by_angles.velocity_earth
    steering = {name: values[name] for name in ('alpha', 'beta', 'bank')}
    by_components = DynamicsPointMass3DCartesian(
        BODY, wind=wind, u_e=u_e, v_e=v_e, w_e=w_e, **steering
    )
    for dyn in (by_angles, by_components):
        add_loads(dyn)
    # the angles' accelerations are differences of h = 1e-6: h^2 and rounding 1e-15/h
    np.testing.assert_allclose(accelerations(by_angles), accelerations(by_components), rtol=1e-7)


def test_the_plane_is_a_part_of_space() -> None:
    values = random_values(DynamicsPointMass2DSpeedGamma)
    in_plane = DynamicsPointMass2DSpeedGamma(BODY, **values)
    in_space = DynamicsPointMass3DSpeedGammaTrack(BODY, **values)
    flat = DynamicsPointMass2DCartesian(BODY, x_e=0.0, u_e=3.0, w_e=-2.0, alpha=5.0)
    full = DynamicsPointMass3DCartesian(BODY, x_e=0.0, u_e=3.0, w_e=-2.0, alpha=5.0)
    body = DynamicsRigidBody2DBody(BODY, u_b=3.0, w_b=2.0, theta=0.4, q=0.3)
    whole = DynamicsRigidBody3DBodyEuler(
        MassProperties(mass=2.0, Ixx=0.4, Iyy=0.5, Izz=0.7), u_b=3.0, w_b=2.0, theta=0.4, q=0.3
    )
    for small, large in ((in_plane, in_space), (flat, full), (body, whole)):
        for dyn in (small, large):
            dyn.add_gravity_force()
            for axes in ('earth', 'body', 'wind', 'stability', 'geometry'):
                dyn.add_force(3.0, 0.0, -4.0, axes=axes)
        expected = large.state_derivatives()
        for name, value in small.state_derivatives().items():
            assert value == pytest.approx(expected[name], rel=1e-13, abs=1e-14)
