"""One run of the simulator: which vehicle flies, from where, and by whose controls; no ROS."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import casadi as cas
import numpy as np
from numpy.typing import NDArray

from .. import frames
from ..config import suggestion
from ..control.reference import planned_wind
from ..control.tracker import Tracker
from ..dynamics.stage import Model, Stage
from ..errors import InputError
from ..simulation.calls import ArrayCall
from ..simulation.gusts import Gusts
from ..simulation.integrator import Method
from ..simulation.simulator import MAX_STEP, Simulator
from ..simulation.steering import OpenLoop, Steering
from ..trajectory import Trajectory
from ..vehicles.vehicle import Vehicle

Array = NDArray[np.float64]
Following = Literal['lqr', 'open_loop']
SpecificForce = Callable[
    [Mapping[str, float], Mapping[str, float], Array], tuple[float, float, float]
]


@dataclass(frozen=True)
class Setting:
    """How runs are made.

    Parameters
    ----------
    vehicle : str
        What flies when no plan names one.
    following : 'lqr' or 'open_loop'
        Whether plans are kept to by feedback, or their controls flown whatever happens.
    wind : x, y, z [m/s]
        Where the air moves to, unless a plan says so itself.
    gusts : Gusts, optional
        Turbulence on top of it.
    method, max_step
        As the Simulator takes them.
    period : float
        Of the controller [s]; 0 lets it be chosen by the plan's duration.
    """

    vehicle: str
    following: Following = 'lqr'
    wind: tuple[float, ...] = (0.0, 0.0, 0.0)
    gusts: Gusts | None = None
    method: Method = 'rk4'
    max_step: float = MAX_STEP
    period: float = 0.0


class Run:
    """A vehicle in flight from time 0 on.

    Parameters
    ----------
    believed, vehicle : Vehicle
        What the controller is designed for, and what flies.
    setting : Setting
    initial : mapping of state name to value
        `altitude` is taken for z_e; states not named are at rest.
    wind : x, y, z [m/s]
    controls : Trajectory or None
        Flown from the start; None flies neutral controls.
    planned : bool
        Whether they are a plan to keep to, or commands.

    Raises
    ------
    InputError
        If a name is not the model's.
    """

    def __init__(
        self,
        believed: Vehicle,
        vehicle: Vehicle,
        setting: Setting,
        initial: Mapping[str, float],
        controls: Trajectory | None = None,
        *,
        planned: bool = True,
    ) -> None:
        self.believed, self.vehicle = believed, vehicle
        self._setting = setting
        self._model = believed.model()
        self._stage = self._model.stage()
        model = vehicle.model()
        self.initial = states_of(model, initial)
        wind = setting.wind if controls is None else planned_wind(controls, setting.wind)
        self._wind = tuple(wind)
        self.plan: Trajectory | None = None
        self.simulator = Simulator(
            model,
            self.initial,
            self.neutral(),
            wind=self._wind,
            gusts=setting.gusts,
            max_step=setting.max_step,
            method=setting.method,
        )
        if controls is None:
            controls, planned = self.neutral(), False
        self._first: Steering = OpenLoop(self._stage, controls)
        if planned:
            self._first = self.steering(controls)
            self.plan = controls
        self._first_plan = self.plan
        self.simulator.follow(self._first)
        self.specific_force = specific_force(self.simulator.stage, vehicle.gravity)

    def begin_again(self, initial: Mapping[str, float]) -> None:
        """Put the vehicle back to the start, or some of its states elsewhere."""
        states = self.initial | states_of(self.simulator.model, initial)
        self.simulator.wind = np.array(self._wind)
        self.simulator.gusts = self._setting.gusts
        self.simulator.follow(self._first)
        self.simulator.reset(states)
        self.plan = self._first_plan

    def follow(self, plan: Trajectory, begin: float) -> None:
        """Fly on along a plan whose time 0 is at a time of the run [s].

        Raises
        ------
        InputError
            If the plan is not for the vehicle; the plan before is flown on.
        """
        shifted = replace(plan, time=plan.time + begin)
        self.simulator.follow(self.steering(shifted))
        self.plan = shifted

    def command(self, controls: Trajectory) -> None:
        """Fly controls, by their own time, whatever happens."""
        self.simulator.follow(controls)
        self.plan = None

    def steering(self, plan: Trajectory) -> Steering:
        """Return what keeps to a plan."""
        if self._setting.following == 'open_loop':
            return OpenLoop(self._stage, plan)
        return Tracker(
            self._stage,
            plan,
            self._model.controls,
            rates=self.believed.rates,
            period=self._setting.period or None,
            wind=planned_wind(plan, self._wind),
        )

    def neutral(self) -> Trajectory:
        """Return controls at 0, or as near to it as their ranges allow."""
        return Trajectory(
            time=np.zeros(1),
            states={},
            controls={
                name: np.full(1, min(max(0.0, lower), upper))
                for name, (lower, upper) in self._model.controls.items()
            },
            control_interpolation='previous',
        )


def states_of(model: Model, values: Mapping[str, float]) -> dict[str, float]:
    """Return initial values by the names of states; `altitude` is taken for z_e.

    Raises
    ------
    InputError
        If a name is not the model's, or a value not finite.
    """
    found = {}
    for name, value in values.items():
        if name == 'altitude' and 'z_e' in model.states:
            found['z_e'] = -float(value)
            continue
        if name not in model.states:
            known = (*model.states, 'altitude')
            raise InputError(f"{model.vehicle} has no state '{name}'{suggestion(name, known)}")
        found[name] = float(value)
    for name, value in found.items():
        if not math.isfinite(value):
            raise InputError(f'{name} is {value}: must be finite')
    return found


def check_within(controls: Trajectory, vehicle: Vehicle) -> None:
    """Refuse controls beyond the ranges of a vehicle."""
    for name, (lower, upper) in vehicle.model().controls.items():
        values = controls.controls.get(name, np.zeros(0))
        if values.size and not (lower <= values.min() and values.max() <= upper):
            raise InputError(
                f'{name} of {values.min():g} to {values.max():g} is outside '
                f'[{lower:g}, {upper:g}] of {vehicle.name}'
            )


def specific_force(stage: Stage, gravity: float) -> SpecificForce:
    """Return a function that gives acceleration less gravity in body axes, for any model.

    The acceleration is the velocity's derivative along the motion, by the chain rule; controls
    that a velocity depended on would have to change with a known rate, and none does.
    """
    x, u, p = (cas.SX.sym('xup'[i], stage.function.size1_in(i)) for i in range(3))
    dx, outputs = stage.function(x, u, p)
    known = dict(zip(stage.outputs, cas.vertsplit(outputs), strict=True))
    known |= dict(zip(stage.states, cas.vertsplit(x), strict=True))
    if stage.controls:
        known |= dict(zip(stage.controls, cas.vertsplit(u), strict=True))
    velocity = cas.vertcat(*(known[name] for name in ('u_e', 'v_e', 'w_e')))
    north, east, down = cas.vertsplit(cas.jtimes(velocity, x, dx))
    r_eb = frames.rotation_from_euler(known['phi'], known['theta'], known['psi'])
    force = frames.rotate(frames.transpose(r_eb), (north, east, down - gravity))
    function = ArrayCall(cas.Function('specific_force', [x, u, p], [cas.vertcat(*force)]))

    def evaluate(
        states: Mapping[str, float], controls: Mapping[str, float], parameters: Array
    ) -> tuple[float, float, float]:
        (force,) = function(list(states.values()), list(controls.values()), parameters)
        x_b, y_b, z_b = force.tolist()
        return x_b, y_b, z_b

    return evaluate
