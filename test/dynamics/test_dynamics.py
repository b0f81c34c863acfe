"""What the Dynamics classes share, and closed forms of each."""

import casadi as cas
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from flightdyn.dynamics import (
    FAMILY,
    Dynamics,
    DynamicsPointMass3DSpeedGammaTrack,
    DynamicsRigidBody2DBody,
    MassProperties,
)
from flightdyn.errors import InputError
from flightdyn.frames import AXES

FINITE = st.floats(-1e3, 1e3)
BODY = MassProperties(mass=2.0, Iyy=0.5)


def turning() -> DynamicsPointMass3DSpeedGammaTrack:
    return DynamicsPointMass3DSpeedGammaTrack(
        BODY, speed=30.0, gamma=0.1, track=2.0, alpha=4.0, beta=-3.0, bank=0.5
    )


@pytest.mark.parametrize('cls', FAMILY.values())
@given(data=st.data())
def test_pack_and_unpack_are_inverse(cls: type[Dynamics], data: st.DataObject) -> None:
    n = len(cls.states)
    flat = np.array(data.draw(st.lists(FINITE, min_size=n, max_size=n)))
    dyn = cls().get_new_instance_with_state(cls.pack_state(flat))
    np.testing.assert_array_equal(dyn.unpack_state(), flat)


@pytest.mark.parametrize('cls', FAMILY.values())
def test_a_state_of_wrong_length_is_refused(cls: type[Dynamics]) -> None:
    with pytest.raises(InputError, match='states, got 2'):
        cls.pack_state([1.0, 2.0])


def test_unknown_axes_are_refused_by_name() -> None:
    with pytest.raises(InputError, match="'airframe' are unknown; known: earth, body"):
        turning().add_force(1, axes='airframe')


def test_the_order_of_forces_does_not_matter() -> None:
    forces = [((3.0, -1.0, 7.0), axes) for axes in AXES]
    there, back = turning(), turning()
    for force, axes in forces:
        there.add_force(*force, axes=axes)
    for force, axes in reversed(forces):
        back.add_force(*force, axes=axes)
    for name, value in there.state_derivatives().items():
        assert value == pytest.approx(back.state_derivatives()[name], rel=1e-13)


@pytest.mark.parametrize('cls', FAMILY.values())
def test_arrays_and_symbols_give_what_floats_give(cls: type[Dynamics]) -> None:
    rng = np.random.default_rng(11)
    rows = rng.uniform(0.2, 1.2, size=(len(cls.states), 5))

    def derivatives(state: dict[str, object]) -> list[object]:
        dyn = cls(BODY, **state)  # type: ignore[arg-type]
        dyn.add_gravity_force()
        for axes in AXES:
            dyn.add_force(1.0, 2.0, -3.0, axes=axes)
        return list(dyn.state_derivatives().values())

    arrays = np.array(np.broadcast_arrays(*derivatives(dict(zip(cls.states, rows, strict=True)))))
    for kind in (cas.SX, cas.MX):
        x = [kind.sym(name) for name in cls.states]
        outputs = derivatives(dict(zip(cls.states, x, strict=True)))
        function = cas.Function('f', x, [cas.vertcat(*outputs)])
        for i, column in enumerate(rows.T):
            np.testing.assert_allclose(function(*column).full()[:, 0], arrays[:, i], rtol=1e-13)
            floats = derivatives(dict(zip(cls.states, column.tolist(), strict=True)))
            np.testing.assert_allclose(floats, arrays[:, i], rtol=1e-13)


def test_level_turn_has_the_textbook_rate_and_load_factor() -> None:
    bank, speed, mass = 0.7, 40.0, BODY.mass
    dyn = DynamicsPointMass3DSpeedGammaTrack(BODY, speed=speed, track=1.0, bank=bank)
    dyn.add_gravity_force(9.81)
    dyn.add_force(Fz=-mass * 9.81 / np.cos(bank), axes='wind')
    derivatives = dyn.state_derivatives()
    assert derivatives['track'] == pytest.approx(9.81 * np.tan(bank) / speed)
    assert (derivatives['gamma'], derivatives['speed']) == pytest.approx((0, 0), abs=1e-12)
    assert dyn.load_factor == pytest.approx(1 / np.cos(bank))


def test_cannonball_in_speed_and_angles_is_a_parabola() -> None:
    def rates(_: float, y: np.ndarray) -> np.ndarray:
        dyn = DynamicsPointMass3DSpeedGammaTrack(BODY, **cls.pack_state(y))
        dyn.add_gravity_force(9.81)
        return dyn.unpack_state(dyn.state_derivatives())

    cls = DynamicsPointMass3DSpeedGammaTrack
    y0 = [0, 0, 0, 50.0, 0.8, 0.3]
    end = solve_ivp(rates, (0, 5), y0, rtol=1e-11, atol=1e-11).y[:, -1]
    level, up = 50 * np.cos(0.8) * 5, 50 * np.sin(0.8) * 5 - 9.81 / 2 * 25
    np.testing.assert_allclose(end[:3], [level * np.cos(0.3), level * np.sin(0.3), -up], atol=1e-7)


def test_alpha_of_a_rigid_body_comes_from_its_velocity() -> None:
    dyn = DynamicsRigidBody2DBody(BODY, u_b=10.0, w_b=10.0 * np.tan(0.1), theta=0.3)
    assert np.radians(dyn.alpha) == pytest.approx(0.1)
    u_e, _, w_e = dyn.velocity_earth
    assert np.arctan2(-w_e, u_e) == pytest.approx(0.3 - 0.1)  # gamma = theta - alpha


def test_moments_turn_by_iyy_alone() -> None:
    dyn = DynamicsRigidBody2DBody(BODY)
    dyn.add_moment(My=1.5)
    dyn.add_moment(My=-0.5, axes='geometry')
    assert dyn.state_derivatives()['q'] == pytest.approx(1.0 / 0.5)
    assert dyn.control == {'Fx_b': 0.0, 'Fz_b': 0.0, 'My_b': 1.0}


def test_repr_names_the_state() -> None:
    assert repr(DynamicsRigidBody2DBody(x_e=1.0)).startswith('DynamicsRigidBody2DBody(x_e=1.0, ')
