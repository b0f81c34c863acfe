"""Derivatives of every class: right where the motion is smooth, finite where it is singular."""

from typing import Any

import casadi as cas
import numpy as np
import pytest
from dynamics_making import BODY, CLASSES, WIND, add_loads, random_values

from flightdyn.dynamics import (
    Dynamics,
    DynamicsPointMass3DCartesian,
    DynamicsRigidBody3DBodyQuaternion,
)

every_class = pytest.mark.parametrize('cls', CLASSES)
with_and_without_wind = pytest.mark.parametrize('wind', [None, WIND, (0.0, 0.0, 0.0)])


def function_of(cls: type[Dynamics], wind: Any) -> cas.Function:
    """Return everything that a model may use of an instance as function of its values.

    The loads are a drag along the velocity through the air, lift, and fixed ones in all axes.
    """
    names = (*cls.states, *cls.indirect_controls)
    x = cas.SX.sym('x', len(names))
    dyn = cls(BODY, wind=wind, **dict(zip(names, cas.vertsplit(x), strict=True)))
    add_loads(dyn)
    pressure = dyn.op_point.dynamic_pressure()
    lift = pressure * (0.1 + 0.01 * dyn.op_point.alpha + 0.002 * dyn.op_point.beta)
    dyn.add_force(-0.02 * pressure, 0.0, -lift, axes='wind')
    air = dyn.op_point
    outputs = cas.vertcat(
        *dyn.state_derivatives().values(),
        *(air.velocity, air.mach(), air.reynolds(1.0), dyn.load_factor),
        *(dyn.kinetic_energy, dyn.potential_energy),
        *(getattr(dyn, name) for name in ('speed', 'gamma', 'track') if hasattr(dyn, name)),
    )
    return cas.Function('f', [x], [outputs, cas.jacobian(outputs, x)])


def values(cls: type[Dynamics], **given: float) -> np.ndarray:
    names = (*cls.states, *cls.indirect_controls)
    found = random_values(cls) | {name: v for name, v in given.items() if name in names}
    return np.array([found[name] for name in names])


AT_REST = dict.fromkeys(('speed', 'u_e', 'v_e', 'w_e', 'u_b', 'v_b', 'w_b'), 0.0)
SINGULAR = {
    'at rest': AT_REST,
    'straight up': {'u_e': 0.0, 'v_e': 0.0, 'u_b': 0.0, 'v_b': 0.0, 'gamma': np.pi / 2},
    'straight down': {'u_e': 0.0, 'v_e': 0.0, 'w_e': 5.0, 'gamma': -np.pi / 2},
    'nose up': {
        'theta': np.pi / 2,
        **dict(zip(('qw', 'qx', 'qy', 'qz'), (1, 0, 1, 0), strict=True)),
    },
    'nose down': {
        'theta': -np.pi / 2,
        **dict(zip(('qw', 'qx', 'qy', 'qz'), (1, 0, -1, 0), strict=True)),
    },
    'all zero': dict.fromkeys(
        ('x_e', 'y_e', 'z_e', 'alpha', 'beta', 'bank', 'gamma', 'track', 'phi', 'theta', 'psi')
        + ('p', 'q', 'r', 'qx', 'qy', 'qz'),
        0.0,
    )
    | AT_REST
    | {'qw': 1.0},
}


@every_class
@with_and_without_wind
@pytest.mark.parametrize('where', SINGULAR)
def test_values_and_gradients_are_finite(cls: type[Dynamics], wind: Any, where: str) -> None:
    value, gradient = function_of(cls, wind)(values(cls, **SINGULAR[where]))
    assert np.isfinite(value.full()).all()
    assert np.isfinite(gradient.full()).all()


@every_class
@with_and_without_wind
def test_gradients_are_those_of_central_differences(cls: type[Dynamics], wind: Any) -> None:
    function = function_of(cls, wind)
    x = values(cls)
    gradient = function(x)[1].full()
    for i in range(x.size):
        h = 1e-5 * max(1.0, abs(x[i]))  # error h^2 against rounding 1e-16/h
        ahead, behind = x.copy(), x.copy()
        ahead[i], behind[i] = x[i] + h, x[i] - h
        difference = (function(ahead)[0] - function(behind)[0]).full()[:, 0] / (2 * h)
        # Reynolds number and potential energy are in the millions
        scale = np.maximum(1.0, np.abs(function(x)[0].full()[:, 0]))
        np.testing.assert_allclose(gradient[:, i] / scale, difference / scale, atol=2e-8)


@pytest.mark.parametrize('theta', [np.pi / 2, -np.pi / 2])
def test_the_quaternion_class_is_smooth_with_the_nose_up(theta: float) -> None:
    cls = DynamicsRigidBody3DBodyQuaternion
    half = theta / 2
    x = values(cls, qw=np.cos(half), qx=0.0, qy=np.sin(half), qz=0.0)
    rates = cas.Function('rates', *_rates(cls))
    gradient = cas.Function('gradient', *_rates(cls, gradient=True))(x).full()
    assert np.abs(gradient).max() < 100  # rates and speeds here are of order 1 to 20
    for i in range(x.size):
        ahead, behind = x.copy(), x.copy()
        ahead[i], behind[i] = x[i] + 1e-6, x[i] - 1e-6
        difference = (rates(ahead) - rates(behind)).full()[:, 0] / 2e-6
        np.testing.assert_allclose(gradient[:, i], difference, atol=1e-7)


def _rates(cls: type[Dynamics], gradient: bool = False) -> tuple[list[cas.SX], list[cas.SX]]:
    x = cas.SX.sym('x', len(cls.states))
    dyn = cls(BODY, **dict(zip(cls.states, cas.vertsplit(x), strict=True)))
    add_loads(dyn)
    rates = cas.vertcat(*dyn.state_derivatives().values())
    return [x], [cas.jacobian(rates, x) if gradient else rates]


def test_drag_has_no_gradient_at_rest() -> None:
    u = cas.SX.sym('u', 3)
    dyn = DynamicsPointMass3DCartesian(u_e=u[0], v_e=u[1], w_e=u[2])
    dyn.add_force(Fx=-dyn.op_point.dynamic_pressure(), axes='wind')
    rates = cas.vertcat(*dyn.state_derivatives().values())[3:]
    gradient = cas.Function('gradient', [u], [cas.jacobian(rates, u)])
    assert (gradient([0, 0, 0]).full() == 0).all()
