"""The stage function: a model's physics traced once, for planning, simulation and replay alike."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import casadi as cas
import numpy as _np
from numpy.typing import NDArray

from .. import numpy as np
from ..config import suggestion
from ..environment.atmosphere import Atmosphere
from ..environment.surroundings import NOTHING, Surroundings
from ..environment.surroundings_outputs import SOURCE_LEVEL, surroundings_outputs
from ..environment.wind import ConstantWind, ScaledWind, Wind
from ..errors import InputError
from ..frames import Rotation, euler_from_rotation, transpose
from ..numpy import Vectorizable
from .base import Dynamics
from .mass_properties import MassProperties
from .opaque import Call, recorded, written_out

Array = NDArray[_np.float64]

WIND = ('wind_x_e', 'wind_y_e', 'wind_z_e')
"""Where the air moves to besides the model's own wind, earth axes [m/s]."""

PARAMETERS = (*WIND, 'time')
"""Parameters of every stage function: wind, and time [s] for what depends on it."""

KINEMATICS = (
    *('x_e', 'y_e', 'z_e', 'u_e', 'v_e', 'w_e', 'phi', 'theta', 'psi', 'p', 'q', 'r'),
    *('speed', 'gamma', 'track', 'bank', 'alpha', 'beta', 'airspeed', 'load_factor'),
)
"""Outputs of every stage function, but for those that are states or controls already."""

WIND_STRENGTH = 'wind_strength'
"""The state that a model's own wind is multiplied by, if it has one."""

Attach = Callable[[Dynamics, Mapping[str, Vectorizable]], Mapping[str, Vectorizable] | None]


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
        What can be commanded, with its limits, in SI units. A control named like an indirect
        control or a rotor momentum of the class is set as that.
    mass_props : MassProperties, or function of the extra states by name
    attach : function of (dynamics, controls and extra states by name)
        Adds forces and moments to the instance, whose `time` and wind it may use. Returns the
        rates of the extra states by name, and by other names what else the stage shall put out.
        Not to differentiate in: there symbols stand for the values of tables.
    extra_states : names
        States beside the class's, such as the mass of fuel or the charge of a battery.
    wind : callable (x_e, y_e, z_e, time) -> (x, y, z), optional
        Where the air moves to, earth axes [m/s]; the stage's parameters add to it.
    free_wind : bool
        Whether that wind is multiplied by a further state, `wind_strength`, which stays as it is:
        for planners to find it, or to change it without tracing the model again.
    atmosphere : callable of altitude [m] -> Atmosphere
    surroundings : Surroundings
        The stage puts out what `surroundings_outputs` tells of them.
    """

    vehicle: str
    dynamics: type[Dynamics]
    mass_props: MassProperties | Callable[[Mapping[str, Vectorizable]], MassProperties]
    controls: Mapping[str, tuple[float, float]]
    attach: Attach
    extra_states: tuple[str, ...] = ()
    wind: Wind | None = None
    free_wind: bool = False
    atmosphere: Callable[[Vectorizable], Atmosphere] = Atmosphere
    surroundings: Surroundings = NOTHING

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the class's states and the extra ones."""
        strength = (WIND_STRENGTH,) if self.free_wind else ()
        return (*self.dynamics.states, *self.extra_states, *strength)

    def stage(self) -> 'Stage':
        """Trace the model with scalar symbols."""
        x = {name: cas.SX.sym(name) for name in self.dynamics.states}
        extra = {name: cas.SX.sym(name) for name in self.extra_states}
        u = {name: cas.SX.sym(name) for name in self.controls}
        p = {name: cas.SX.sym(name) for name in PARAMETERS}
        steered = (*self.dynamics.indirect_controls, *self.dynamics.rotor_momenta)
        mass_props = self.mass_props(extra) if callable(self.mass_props) else self.mass_props
        wind, steady = self.wind, {}
        if self.free_wind:
            steady[WIND_STRENGTH] = cas.SX.sym(WIND_STRENGTH)
            wind = None if wind is None else ScaledWind(wind, steady[WIND_STRENGTH])
        dyn = self.dynamics(
            mass_props=mass_props,
            wind=ConstantWind(*(p[name] for name in WIND)) + wind,
            time=p['time'],
            atmosphere=self.atmosphere,
            **x,
            **{name: value for name, value in u.items() if name in steered},
        )
        with recorded() as calls:
            attached = self.attach(dyn, u | extra) or {}
            x |= extra | steady
            derivatives = dyn.state_derivatives() | {name: attached[name] for name in extra}
            derivatives |= dict.fromkeys(steady, 0.0)
            every = _kinematics(dyn) | {k: v for k, v in attached.items() if k not in extra}
            every |= surroundings_outputs(
                self.surroundings,
                (every['x_e'], every['y_e'], every['z_e']),
                dyn.velocity_earth,
                every.get(SOURCE_LEVEL),
            )
        outputs = {k: v for k, v in every.items() if k not in x and k not in u}
        traced = Outline(
            cas.vertcat(*x.values()),
            cas.vertcat(*u.values()),
            cas.vertcat(*p.values()),
            cas.vertcat(*(derivatives[name] for name in x)),
            cas.vertcat(*outputs.values()),
            tuple(calls),
        )
        return Stage(
            tuple(x),
            tuple(u),
            tuple(outputs),
            cas.Function(
                'stage',
                [traced.x, traced.u, traced.p],
                written_out([traced.dx, traced.outputs], calls),
                ['x', 'u', 'p'],
                ['dx', 'outputs'],
            ),
            tuple(float(getattr(self.dynamics, name, name in steady)) for name in x),
            traced,
        )


@dataclass(frozen=True, eq=False)
class Outline:
    """A stage as expressions, with symbols for the values of opaque functions.

    Parameters
    ----------
    x, u, p : symbols (n, 1)
    dx, outputs : expressions (n, 1)
    calls : sequence of Call
        Of opaque functions, in the order they were made in.
    """

    x: cas.SX
    u: cas.SX
    p: cas.SX
    dx: cas.SX
    outputs: cas.SX
    calls: tuple[Call, ...] = ()


@dataclass(frozen=True)
class Stage:
    """A traced model: f(x, u, p) -> dx/dt, outputs, and the names of their rows.

    `rest` is the state of what nothing else is said: 0, but for an attitude quaternion of
    length 1 and a wind as strong as it was given. `traced` is for derivatives, see `outline`.
    """

    states: tuple[str, ...]
    controls: tuple[str, ...]
    outputs: tuple[str, ...]
    function: cas.Function
    rest: tuple[float, ...]
    traced: Outline | None = field(default=None, repr=False, compare=False)

    @property
    def outline(self) -> Outline:
        """Expressions to differentiate, around the opaque functions where they are known."""
        if self.traced is not None:
            return self.traced
        x, u, p = (cas.SX.sym('xup'[i], self.function.size1_in(i)) for i in range(3))
        return Outline(x, u, p, *self.function(x, u, p))

    def right_hand_side(
        self,
        controls: Mapping[str, float] | None = None,
        wind: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> Callable[[float, Array], Array]:
        """Return a compiled f(t, y) -> dy/dt, as `scipy.integrate.solve_ivp` wants it.

        Parameters
        ----------
        controls : mapping of name to value
            Held throughout; every control of the stage.
        wind : x, y, z [m/s]
            Where the air moves to besides the model's own wind, earth axes.

        Returns
        -------
        function of time [s] and state (n_states,)
            Gives a new array (n_states,) each time; not for two threads at once.

        Raises
        ------
        InputError
            If a control is missing or unknown.
        """
        given = dict(controls or {})
        for name in given:
            if name not in self.controls:
                raise InputError(
                    f"the stage has no control '{name}'{suggestion(name, self.controls)}"
                )
        missing = [name for name in self.controls if name not in given]
        if missing:
            raise InputError(f'the stage also needs the control {", ".join(missing)}')
        function = cas.Function('f', *_only_derivatives(self.function))
        buffer, evaluate = function.buffer()
        x, dx = _np.zeros(len(self.states)), _np.zeros(len(self.states))
        u = _np.array([float(given[name]) for name in self.controls])
        p = _np.array([*(float(w) for w in wind), 0.0])
        for i, array in enumerate((x, u, p)):
            buffer.set_arg(i, memoryview(array))  # type: ignore[call-arg, arg-type]
        buffer.set_res(0, memoryview(dx))  # type: ignore[call-arg, arg-type]

        def right_hand_side(t: float, y: Array) -> Array:
            x[:] = y
            p[3] = t
            evaluate()
            return dx.copy()

        # what is compiled holds addresses alone: its owners must live as long as the function
        right_hand_side.owners = function, buffer, u  # type: ignore[attr-defined]
        return right_hand_side


def _only_derivatives(function: cas.Function) -> tuple[list[cas.SX], list[cas.SX]]:
    symbols = [cas.SX.sym('xup'[i], function.size1_in(i)) for i in range(3)]
    return symbols, [function(*symbols)[0]]


def _kinematics(dyn: Dynamics) -> dict[str, Vectorizable]:
    u_e, v_e, w_e = dyn.velocity_earth
    if hasattr(dyn, 'theta'):
        phi, theta, psi = dyn.phi, dyn.theta, dyn.psi  # type: ignore[attr-defined]
    else:
        phi, theta, psi = euler_from_rotation(_rotation(dyn, 'body'))
    values: dict[str, Vectorizable] = {
        'u_e': u_e,
        'v_e': v_e,
        'w_e': w_e,
        'phi': phi,
        'theta': theta,
        'psi': psi,
        'speed': dyn.speed,
        'gamma': np.arctan2(-w_e, np.hypot(u_e, v_e)),
        'track': np.arctan2(v_e, u_e),
        'airspeed': dyn.airspeed,
        'load_factor': dyn.load_factor,
        'bank': _bank(dyn),
    }
    return {name: values.get(name, getattr(dyn, name, 0.0)) for name in KINEMATICS}


def _rotation(dyn: Dynamics, axes: str) -> Rotation:
    """Return the rotation from given axes to earth axes."""
    first, second, third = (
        dyn.convert_axes(*axis, axes, 'earth')
        for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    )
    return transpose((first, second, third))


def _bank(dyn: Dynamics) -> Vectorizable:
    """Return the roll of the wind axes about the velocity through the air."""
    if 'bank' in dyn.indirect_controls:
        return dyn.bank  # type: ignore[attr-defined]
    return euler_from_rotation(_rotation(dyn, 'wind'))[0]
