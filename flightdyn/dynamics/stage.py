"""The stage function: a model's physics traced once, for planning, simulation and replay alike."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import casadi as cas

from .. import numpy as np
from ..frames import euler_from_rotation
from ..numpy import Vectorizable
from .base import Dynamics
from .mass_properties import MassProperties

WIND = ('wind_x_e', 'wind_y_e', 'wind_z_e')
"""Parameters of every stage function: where the air moves to, earth axes [m/s]."""

KINEMATICS = (
    *('x_e', 'y_e', 'z_e', 'u_e', 'v_e', 'w_e', 'phi', 'theta', 'psi', 'p', 'q', 'r'),
    *('speed', 'gamma', 'track', 'bank', 'alpha', 'beta', 'airspeed', 'load_factor'),
)
"""Outputs of every stage function, but for those that are states or controls already."""

Attach = Callable[[Dynamics, Mapping[str, Vectorizable]], None]


@dataclass(frozen=True, kw_only=True)
class Model:
    """A Dynamics class and the function that attaches a vehicle's forces to it.

    Parameters
    ----------
    vehicle : str
        Name of the vehicle.
    dynamics : type
        A class of the Dynamics family.
    controls : mapping of name to (lower, upper)
        What can be commanded, with its limits, in SI units.
    attach : function of (dynamics, controls by name)
        Adds forces and moments to the instance.
    """

    vehicle: str
    dynamics: type[Dynamics]
    mass_props: MassProperties
    controls: Mapping[str, tuple[float, float]]
    attach: Attach

    def stage(self) -> 'Stage':
        """Trace the model with scalar symbols."""
        x = {name: cas.SX.sym(name) for name in self.dynamics.states}
        u = {name: cas.SX.sym(name) for name in self.controls}
        p = {name: cas.SX.sym(name) for name in WIND}
        indirect = {k: v for k, v in u.items() if k in self.dynamics.indirect_controls}
        dyn = self.dynamics(mass_props=self.mass_props, **x, **indirect)  # type: ignore[arg-type]
        self.attach(dyn, u)
        derivatives = dyn.state_derivatives()
        every = _kinematics(dyn, tuple(p.values()))
        outputs = {k: v for k, v in every.items() if k not in x and k not in u}
        function = cas.Function(
            'stage',
            [cas.vertcat(*x.values()), cas.vertcat(*u.values()), cas.vertcat(*p.values())],
            [
                cas.vertcat(*(derivatives[name] for name in x)),
                cas.vertcat(*outputs.values()),
            ],
            ['x', 'u', 'p'],
            ['dx', 'outputs'],
        )
        return Stage(tuple(x), tuple(u), tuple(outputs), function)


@dataclass(frozen=True)
class Stage:
    """A traced model: f(x, u, p) -> dx/dt, outputs, and the names of their rows."""

    states: tuple[str, ...]
    controls: tuple[str, ...]
    outputs: tuple[str, ...]
    function: cas.Function


def _kinematics(dyn: Dynamics, wind: tuple[cas.SX, ...]) -> dict[str, Vectorizable]:
    u_e, v_e, w_e = dyn.velocity_earth
    horizontal = np.hypot(u_e, v_e)
    if hasattr(dyn, 'theta'):
        phi, theta, psi = dyn.phi, dyn.theta, dyn.psi  # type: ignore[attr-defined]
    else:
        columns = [dyn.convert_axes(*axis, 'body', 'earth') for axis in _UNIT_VECTORS]
        r_eb = tuple(zip(*columns, strict=True))
        phi, theta, psi = euler_from_rotation(r_eb)  # type: ignore[arg-type]
    air = tuple(v - w for v, w in zip((u_e, v_e, w_e), wind, strict=True))
    values: dict[str, Vectorizable] = {
        'u_e': u_e,
        'v_e': v_e,
        'w_e': w_e,
        'phi': phi,
        'theta': theta,
        'psi': psi,
        'speed': np.hypot(u_e, v_e, w_e),
        'gamma': np.arctan2(-w_e, horizontal),
        'track': np.arctan2(v_e, u_e),
        'alpha': dyn.alpha,
        'beta': dyn.beta,
        'airspeed': np.hypot(*air),
        'load_factor': dyn.load_factor,
        'bank': _bank(dyn),
    }
    return {name: values.get(name, getattr(dyn, name, cas.SX(0))) for name in KINEMATICS}


_UNIT_VECTORS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def _bank(dyn: Dynamics) -> Vectorizable:
    """Return the roll of the wind axes about the velocity."""
    if 'bank' in dyn.indirect_controls:
        return dyn.bank  # type: ignore[attr-defined]
    columns = [dyn.convert_axes(*axis, 'wind', 'earth') for axis in _UNIT_VECTORS]
    return euler_from_rotation(tuple(zip(*columns, strict=True)))[0]  # type: ignore[arg-type]
