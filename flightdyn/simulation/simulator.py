"""A vehicle flying in simulated time, by the controls of a trajectory or of a controller."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import get_args

import casadi as cas
import numpy as np
from numpy.typing import NDArray

from ..config import suggestion
from ..dynamics.stage import Model, Stage
from ..errors import InputError
from ..trajectory import Columns, Trajectory
from .calls import ArrayCall
from .gusts import GUST_STEP, Gusts, gust_earth
from .inputs import Inputs
from .integrator import ABSOLUTE_TOLERANCE, RELATIVE_TOLERANCE, Method, rk4_step
from .steering import OpenLoop, Steering
from .steppers import cvodes

Array = NDArray[np.float64]

MAX_STEP = 1e-3  # s; RK4 then errs by some micrometres a second when a vehicle spins at 10 Hz
MAX_SUBSTEPS = 16  # in one call of the integrator
MAX_SAMPLES = 50_000_000
MAX_STIFF_STEPS = 100_000  # of CVODES between two breaks of the controls


class Simulator:
    """Integrates a model's equations of motion; knows nothing of wall time or ROS.

    Parameters
    ----------
    model : Model
    initial : mapping of state name to value
        The others start at `stage.rest`: 0, or an attitude quaternion of length 1.
    controls : Trajectory or Steering
        Whose controls are followed, by its own time and beyond its ends held; or a controller,
        such as `control.tracker.Tracker`.
    wind : x, y, z [m/s]
        Where the air moves to, earth axes.
    gusts : Gusts, optional
        Turbulence on top of the wind; it starts anew at a reset.
    max_step : float
        Longest integration step of Runge and Kutta [s].
    method : 'rk4' or 'cvodes'
        Runge-Kutta steps of equal length, or CVODES to 1e-10, for models that are stiff.

    Raises
    ------
    InputError
        If a name is not the model's, a value is not finite, or the method unknown.
    """

    def __init__(
        self,
        model: Model,
        initial: Mapping[str, float],
        controls: Trajectory | Steering,
        *,
        wind: Sequence[float] = (0.0, 0.0, 0.0),
        gusts: Gusts | None = None,
        max_step: float = MAX_STEP,
        method: Method = 'rk4',
    ) -> None:
        self.model = model
        self.stage = model.stage()
        self.wind = np.array(wind, dtype=float)
        self.gusts = gusts
        self._steps: dict[int, ArrayCall] = {}
        self._max_step = max_step
        if method not in get_args(Method):
            raise InputError(f"unknown method '{method}'{suggestion(method, get_args(Method))}")
        self._stiff: Callable[[Array, Array], Array | None] | None = None
        if method == 'cvodes':
            inputs = Inputs(self.stage, dict.fromkeys(self.stage.controls, 0.0))
            self._stiff = cvodes(
                inputs,
                np.ones(1),
                RELATIVE_TOLERANCE,
                ABSOLUTE_TOLERANCE,
                max_num_steps=MAX_STIFF_STEPS,
            )
        self._motion = ArrayCall(_motion(self.stage))
        self._evaluate = ArrayCall(self.stage.function)
        self.time = 0.0
        self.follow(controls)
        self.reset(initial)

    def reset(self, initial: Mapping[str, float], time: float = 0.0) -> None:
        """Put the vehicle into a state at a time [s]."""
        for name, value in initial.items():
            if name not in self.stage.states:
                raise InputError(
                    f"{self.model.vehicle} has no state '{name}'"
                    f'{suggestion(name, self.stage.states)}'
                )
            if not math.isfinite(value):
                raise InputError(f'initial {name} is {value}: must be finite')
        for name, value in self.model.dynamics.singular_at.items():
            if initial.get(name, 0.0) == value:
                raise InputError(
                    f'{self.model.vehicle} cannot start at {name} = {value:g}, where '
                    f'{self.model.dynamics.__name__} is singular: give another initial {name}'
                )
        rest = zip(self.stage.states, self.stage.rest, strict=True)
        self._x = np.array([float(initial.get(name, value)) for name, value in rest])
        self.time = time
        self._steering.begin(time)
        self._gust = np.zeros(3)
        if self.gusts is not None:
            self._gusting = self.gusts.start()
            self._start, self._blown = time, 0
            self._blow()

    def blow(self, wind: Sequence[float], gusts: Gusts | None = None) -> None:
        """Let the air move at another wind [m/s] from now on, and with other gusts if given."""
        self.wind = np.array(wind, dtype=float)
        if gusts is not None:
            self.gusts = gusts
            self._gusting = gusts.start()
            self._start, self._blown = self.time, 0
            self._blow()

    def follow(self, controls: Trajectory | Steering) -> None:
        """Follow the controls of a trajectory, or a controller's, from now on."""
        if isinstance(controls, Trajectory):
            controls = OpenLoop(self.stage, controls)
        self._steering = controls
        self._steering.begin(self.time)

    def advance_to(self, time: float) -> None:
        """Fly until `time` [s]; steps end where the controls jump or bend.

        Raises
        ------
        InputError
            If the state grows beyond all bounds.
        """
        breaks = self._steering.breaks(self.time, time)
        if self.gusts is not None:
            last = math.ceil((time - self._start) / GUST_STEP)
            blows = self._start + GUST_STEP * np.arange(self._blown, last)
            breaks = np.union1d(breaks, blows[(blows > self.time) & (blows < time)])
        for end in (*breaks.tolist(), time):
            if self.gusts is not None and self.time >= self._start + GUST_STEP * self._blown:
                self._blow()
            span = end - self.time
            if span <= 0:
                continue
            u0, u1 = self._steering.over(self.time, end, self._x)
            (self._run if self._stiff is None else self._run_stiff)(span, u0, u1)
            self.time = end
        if not np.isfinite(self._x).all():
            raise InputError(f'the state of {self.model.vehicle} diverged before {time:g} s')

    def _run(self, span: float, u0: Array, u1: Array) -> None:
        """Take Runge-Kutta steps over a span without a break inside."""
        # A call costs more than the few steps in it: as many substeps as fit go into one.
        steps = max(1, math.ceil(span / self._max_step - 1e-9))
        calls = math.ceil(steps / MAX_SUBSTEPS)
        step = self._step_of(math.ceil(steps / calls))
        for i in range(calls):
            u_begin = u0 + (u1 - u0) * (i / calls)
            u_end = u0 + (u1 - u0) * ((i + 1) / calls)
            (self._x,) = step(self._x, u_begin, u_end, self.parameters, span / calls)
            self.time += span / calls

    def _run_stiff(self, span: float, u0: Array, u1: Array) -> None:
        assert self._stiff is not None
        begin, end = self.time, self.time + span
        wind = self.wind + self._gust
        x = self._stiff(
            self._x, np.concatenate([u0, u1, [begin, end], wind, [begin, end - begin]])
        )
        self._x = np.full(self._x.size, math.nan) if x is None else x[:, 0]

    @property
    def parameters(self) -> Array:
        """The stage's parameters now: wind and gust [m/s], and time [s]."""
        p = np.empty(4)
        p[:3], p[3] = self.wind + self._gust, self.time
        return p

    def _blow(self) -> None:
        """Let the gust of the next GUST_STEP begin."""
        u = self._steering.now(self.time, self._x)
        (motion,) = self._motion(self._x, u, self.parameters)
        dt = GUST_STEP if self._blown else 0.0
        self._gust = gust_earth(self._gusting, dt, motion[:3], self.wind, -motion[3])
        self._blown += 1

    def _step_of(self, substeps: int) -> ArrayCall:
        if substeps not in self._steps:
            self._steps[substeps] = ArrayCall(rk4_step(self.stage, substeps))
        return self._steps[substeps]

    def sample(self) -> tuple[dict[str, float], dict[str, float], dict[str, float]]:
        """Return states, controls and outputs now."""
        u = self._steering.now(self.time, self._x)
        _, outputs = self._evaluate(self._x, u, self.parameters)
        return (
            dict(zip(self.stage.states, self._x.tolist(), strict=True)),
            dict(zip(self.stage.controls, u.tolist(), strict=True)),
            dict(zip(self.stage.outputs, outputs.tolist(), strict=True)),
        )


def _motion(stage: Stage) -> cas.Function:
    """Return (x, u, p) -> velocity over the earth [m/s] and z_e [m]: what gusts depend on."""
    x, u, p = (cas.SX.sym('xup'[i], stage.function.size1_in(i)) for i in range(3))
    outputs = stage.function(x, u, p)[1]
    known = dict(
        zip((*stage.outputs, *stage.states), cas.vertsplit(cas.vertcat(outputs, x)), strict=True)
    )
    values = [known[name] for name in ('u_e', 'v_e', 'w_e', 'z_e')]
    return cas.Function('motion', [x, u, p], [cas.vertcat(*values)])


def fly(
    simulator: Simulator, duration: float, rate: float, also_at: Array | None = None
) -> Trajectory:
    """Return what the simulator flies from now on for `duration` [s], sampled at `rate` [Hz].

    The last sample is at the very end, whatever the rate; `also_at` gives more times [s], such
    as a plan's nodes, so that both can be compared without interpolating.

    Raises
    ------
    InputError
        If duration or rate is not positive, or they ask for more than 50 million samples.
    """
    if not (duration > 0 and rate > 0 and math.isfinite(duration * rate)):
        raise InputError(f'duration {duration:g} s and rate {rate:g} Hz must be positive')
    if duration * rate > MAX_SAMPLES:
        raise InputError(f'{duration:g} s at {rate:g} Hz are over {MAX_SAMPLES} samples')
    times = np.arange(0, duration, 1 / rate)
    times = np.union1d(times, [duration] if also_at is None else [*also_at, duration])
    # two that differ by rounding alone are one; the later stays, so that the end does
    times = times[np.append(np.diff(times) > 1e-9, True) & (times <= duration)]
    start = simulator.time
    rows = []
    for t in times:
        simulator.advance_to(start + t)
        rows.append(simulator.sample())
    states, controls, outputs = (_columns([row[i] for row in rows]) for i in range(3))
    return Trajectory(
        time=times,
        states=states,
        controls=controls,
        outputs=outputs,
        model=simulator.model.dynamics.__name__,
        vehicle=simulator.model.vehicle,
    )


def _columns(rows: list[dict[str, float]]) -> Columns:
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}
