"""What all classes share: packing, indexing, loads, axes, energies, and what they refuse."""

import inspect
from typing import Any

import casadi as cas
import numpy as np
import pytest
from dynamics_making import BODY, CLASSES, WIND, add_loads, random_values
from hypothesis import given
from hypothesis import strategies as st

from flightdyn.dynamics import (
    Dynamics,
    DynamicsPointMass1DVertical,
    DynamicsPointMass2DSpeedGamma,
    DynamicsPointMass3DCartesian,
    DynamicsPointMass3DSpeedGammaTrack,
    DynamicsRigidBody2DBody,
    DynamicsRigidBody3DBodyEuler,
    MassProperties,
)
from flightdyn.errors import InputError
from flightdyn.frames import AXES

FINITE = st.floats(-1e3, 1e3)

every_class = pytest.mark.parametrize('cls', CLASSES)


def turning() -> DynamicsPointMass3DSpeedGammaTrack:
    return DynamicsPointMass3DSpeedGammaTrack(
        BODY, speed=30.0, gamma=0.1, track=2.0, alpha=4.0, beta=-3.0, bank=0.5
    )


@every_class
@given(data=st.data())
def test_pack_and_unpack_are_inverse(cls: type[Dynamics], data: st.DataObject) -> None:
    n = len(cls.states)
    flat = np.array(data.draw(st.lists(FINITE, min_size=n, max_size=n)))
    dyn = cls().get_new_instance_with_state(cls.pack_state(flat))
    np.testing.assert_array_equal(dyn.unpack_state(), flat)
    np.testing.assert_array_equal(cls().get_new_instance_with_state(flat).unpack_state(), flat)


@every_class
@pytest.mark.parametrize('kind', [cas.SX, cas.MX])
def test_symbolic_states_pack_and_unpack(cls: type[Dynamics], kind: Any) -> None:
    y = kind.sym('y', len(cls.states), 4)
    dyn = cls().get_new_instance_with_state(cls.pack_state(y))
    assert len(dyn) == 4
    function = cas.Function('f', [y], [dyn.unpack_state()])
    numbers = np.arange(4.0 * len(cls.states)).reshape(-1, 4)
    np.testing.assert_array_equal(function(numbers).full(), numbers)


@every_class
def test_a_state_of_wrong_length_is_refused(cls: type[Dynamics]) -> None:
    with pytest.raises(InputError, match=r'states \(.*\), got 3 rows'):
        cls.pack_state([1.0, 2.0, 3.0])
    with pytest.raises(InputError, match=f'also needs the state {cls.states[-1]}'):
        cls().unpack_state(dict.fromkeys(cls.states[:-1], 0.0))


@every_class
def test_the_signature_names_every_value(cls: type[Dynamics]) -> None:
    names = list(inspect.signature(cls).parameters)
    assert names[0] == 'mass_props'
    assert {*cls.states, *cls.indirect_controls, *cls.rotor_momenta} <= set(names)


def test_unknown_names_are_refused_with_the_nearest_one() -> None:
    with pytest.raises(InputError, match="has no 'sped', did you mean 'speed'"):
        DynamicsPointMass2DSpeedGamma(sped=3.0)
    with pytest.raises(InputError, match="'airframe' are unknown; known: earth, body"):
        turning().add_force(1, axes='airframe')
    with pytest.raises(InputError, match="'path' are unknown"):
        DynamicsPointMass3DCartesian().convert_axes(1, 0, 0, 'earth', 'path')
    with pytest.raises(InputError, match="has no state 'gama', did you mean 'gamma'"):
        turning().constrain_derivatives(None, 0.0, which=['speed', 'gama'])


@pytest.mark.parametrize('value', ['fast', None, {'knots': 3}, [1.0, 'x']])
def test_what_is_no_number_is_refused(value: Any) -> None:
    with pytest.raises(InputError, match='speed must be a number, an array or a CasADi'):
        DynamicsPointMass2DSpeedGamma(speed=value)


def test_lists_count_as_arrays() -> None:
    x = cas.MX.sym('x')
    dyn = DynamicsPointMass2DSpeedGamma(speed=[1, 2, 3], gamma=[x, 2 * x, 0.0])
    assert len(dyn) == 3
    assert dyn[1].speed == 2


def test_arrays_of_different_lengths_are_refused() -> None:
    with pytest.raises(InputError, match='z_e has 3 values, w_e has 4'):
        DynamicsPointMass1DVertical(z_e=np.zeros(3), w_e=np.zeros(4))


def test_a_rigid_body_without_inertia_is_refused() -> None:
    with pytest.raises(InputError, match=r'Body2DBody needs mass_props.Iyy, which is 0'):
        DynamicsRigidBody2DBody(MassProperties(mass=1.0)).state_derivatives()
    with pytest.raises(InputError, match='no inverse: Ixx = 0'):
        DynamicsRigidBody3DBodyEuler(MassProperties(mass=1.0)).state_derivatives()


@every_class
@pytest.mark.parametrize('wind', [None, WIND])
def test_the_order_of_loads_does_not_matter(cls: type[Dynamics], wind: Any) -> None:
    there, back = (cls(BODY, wind=wind, **random_values(cls)) for _ in range(2))
    for axes in AXES:
        there.add_force(3.0, -1.0, 7.0, axes=axes)
    there.add_gravity_force()
    back.add_gravity_force()
    for axes in reversed(AXES):
        back.add_force(3.0, -1.0, 7.0, axes=axes)
    expected = back.state_derivatives()
    for name, value in there.state_derivatives().items():
        assert value == pytest.approx(expected[name], rel=1e-12, abs=1e-12)


@every_class
@pytest.mark.parametrize('wind', [None, WIND])
def test_arrays_and_symbols_give_what_floats_give(cls: type[Dynamics], wind: Any) -> None:
    values = random_values(cls, 5)

    def derivatives(values: dict[str, Any]) -> list[Any]:
        dyn = cls(BODY, wind=wind, **values)
        add_loads(dyn)
        return [*dyn.state_derivatives().values(), dyn.airspeed, dyn.load_factor]

    arrays = np.array(np.broadcast_arrays(*derivatives(values)))
    for i in range(5):
        floats = derivatives({name: float(value[i]) for name, value in values.items()})
        np.testing.assert_array_equal(floats, arrays[:, i])  # to the last bit
    for kind in (cas.SX, cas.MX):
        symbols = {name: kind.sym(name, 5) for name in values}
        outputs = [cas.repmat(v, 5 // v.shape[0], 1) for v in derivatives(symbols)]
        function = cas.Function('f', [*symbols.values()], [cas.horzcat(*outputs)])
        found = function(*values.values()).full().T
        np.testing.assert_allclose(found, arrays, rtol=1e-13, atol=1e-14)


@every_class
def test_numbers_arrays_and_symbols_mix(cls: type[Dynamics]) -> None:
    values = random_values(cls, 4)
    names = list(values)
    x = cas.MX.sym('x', 4)
    mixed = {**values, names[0]: x, names[1]: float(values[names[1]][0])}
    plain = {**values, names[1]: float(values[names[1]][0])}
    symbolic, numeric = cls(BODY, **mixed), cls(BODY, **plain)
    for dyn in (symbolic, numeric):
        add_loads(dyn)
    expected = numeric.state_derivatives()
    for name, value in symbolic.state_derivatives().items():
        found = cas.Function('f', [x], [value])(values[names[0]]).full()[:, 0]
        np.testing.assert_allclose(
            np.broadcast_to(found, 4), np.broadcast_to(expected[name], 4), rtol=1e-13, atol=1e-14
        )


@every_class
@pytest.mark.parametrize(
    'index', [0, -1, np.int64(3), slice(1, 4), slice(None, None, 2), np.array([4, 0])]
)
def test_indexing_keeps_state_controls_loads_mass_and_wind(
    cls: type[Dynamics], index: Any
) -> None:
    n, values = 5, random_values(cls, 5)
    mass = np.linspace(2, 3, n)
    wind = (np.linspace(1, 2, n), 3.0, np.linspace(-1, 1, n))
    many = cls(
        MassProperties(mass=mass, Ixx=1.0, Iyy=1.0, Izz=1.0),
        wind=wind,
        time=np.arange(n),
        **values,
    )
    add_loads(many, np.linspace(1, 2, n))
    part = many[index]
    assert type(part) is cls
    assert len(many) == n
    assert len(part) == np.size(mass[index])
    for name, value in many.state_derivatives().items():
        np.testing.assert_array_equal(
            part.state_derivatives()[name], np.broadcast_to(value, n)[index]
        )
    np.testing.assert_array_equal(part.load_factor, many.load_factor[index])
    np.testing.assert_array_equal(part.op_point.velocity, many.op_point.velocity[index])


def test_columns_of_symbols_are_indexed_too() -> None:
    x = cas.MX.sym('x', 5)
    dyn = DynamicsPointMass2DSpeedGamma(speed=x, gamma=np.linspace(0, 1, 5))
    dyn.add_force(Fx=3 * x)
    last = dyn[-1].state_derivatives()['speed']
    assert cas.Function('f', [x], [last])(np.arange(5)) == 12
    assert len(dyn[1:]) == 4


def test_a_scalar_instance_has_length_one_and_ends() -> None:
    dyn = turning()
    assert len(dyn) == 1
    assert len(list(dyn)) == 1
    assert dyn[0].state == dyn.state
    with pytest.raises(IndexError, match=r'index 1 of .* of length 1'):
        dyn[1]


def test_setting_a_value_is_seen_by_what_was_already_evaluated() -> None:
    dyn = turning()
    before = dyn.convert_axes(1, 0, 0, 'wind', 'earth'), dyn.op_point.alpha
    dyn.bank, dyn.alpha, dyn.gamma = -0.2, 1.0, 0.3
    assert dyn.op_point.alpha == 1.0 != before[1]
    assert dyn.convert_axes(1, 0, 0, 'wind', 'earth')[2] == pytest.approx(-np.sin(0.3))


@every_class
def test_a_new_instance_keeps_all_but_state_and_loads(cls: type[Dynamics]) -> None:
    dyn = cls(BODY, wind=WIND, time=3.0, **random_values(cls))
    add_loads(dyn)
    twin = dyn.get_new_instance_with_state(random_values(cls, seed=3))
    assert (twin.mass_props, twin.wind, twin.time) == (dyn.mass_props, dyn.wind, 3.0)
    for name in (*cls.rotor_momenta, *cls.indirect_controls):
        assert name in twin.control_variables
    loads = [twin.control_variables[name] for name in cls.loads]
    assert loads == [0.0] * len(loads)


@every_class
def test_loads_are_read_back_in_their_axes(cls: type[Dynamics]) -> None:
    dyn = cls(BODY, wind=WIND, **random_values(cls))
    dyn.add_force(1.0, 2.0, 3.0)
    found = dyn.control_variables
    for name, value in zip('xyz', (1.0, 2.0, 3.0), strict=True):
        load = next((n for n in cls.loads if n.startswith(f'F{name}')), None)
        if load:
            assert found[load] == pytest.approx(value)


def test_load_factor_is_lift_over_weight() -> None:
    bank, speed, mass = 0.7, 40.0, BODY.mass
    dyn = DynamicsPointMass3DSpeedGammaTrack(BODY, speed=speed, track=1.0, bank=bank)
    dyn.add_gravity_force(9.81)
    dyn.add_force(Fz=-mass * 9.81 / np.cos(bank), axes='wind')
    derivatives = dyn.state_derivatives()
    assert derivatives['track'] == pytest.approx(9.81 * np.tan(bank) / speed)
    assert (derivatives['gamma'], derivatives['speed']) == pytest.approx((0, 0), abs=1e-12)
    assert dyn.load_factor == pytest.approx(1 / np.cos(bank))


def test_load_factor_of_a_rigid_body_is_along_its_own_axis() -> None:
    dyn = DynamicsRigidBody2DBody(BODY, u_b=20.0, w_b=5.0, theta=0.4)
    dyn.add_gravity_force(9.81)
    dyn.add_force(Fz=-3 * BODY.mass * 9.81)
    assert dyn.load_factor == pytest.approx(3.0)


def test_alpha_of_a_rigid_body_comes_from_its_velocity() -> None:
    dyn = DynamicsRigidBody2DBody(BODY, u_b=10.0, w_b=10.0 * np.tan(0.1), theta=0.3)
    assert np.radians(dyn.alpha) == pytest.approx(0.1)
    assert dyn.gamma == pytest.approx(0.3 - 0.1)  # gamma = theta - alpha


def test_moments_of_a_planar_body_turn_by_iyy_alone() -> None:
    dyn = DynamicsRigidBody2DBody(MassProperties(mass=1.0, Iyy=0.5), hx_b=3.0, hz_b=2.0, q=1.0)
    dyn.add_moment(My=1.5)
    dyn.add_moment(My=-0.5, axes='geometry')
    assert dyn.state_derivatives()['q'] == pytest.approx(1.0 / 0.5)
    assert dyn.control_variables == {'Fx_b': 0.0, 'Fz_b': 0.0, 'My_b': 1.0}


def test_potential_energy_is_of_the_gravity_that_was_added() -> None:
    dyn = DynamicsPointMass1DVertical(MassProperties(mass=2.0), z_e=-10.0)
    assert dyn.potential_energy == pytest.approx(2 * 9.81 * 10)
    dyn.add_gravity_force(1.62)
    assert dyn.potential_energy == pytest.approx(2 * 1.62 * 10)


def test_repr_names_class_mass_and_state() -> None:
    text = repr(DynamicsRigidBody2DBody(x_e=1.0))
    assert text.startswith('DynamicsRigidBody2DBody(mass_props=MassProperties(')
    assert 'x_e=1.0' in text
