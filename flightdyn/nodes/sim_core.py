"""Flying plans and commands in run time: when to step, when to publish, when to stop; no ROS."""

import math
import time as _time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as cas
import numpy as np
from numpy.typing import NDArray

from .. import frames
from ..dynamics.stage import WIND, Stage
from ..errors import InputError
from ..simulation.gusts import Gusts
from ..simulation.simulator import Simulator
from ..trajectory import Trajectory
from ..vehicles.vehicle import Vehicle

MAX_STEP_S = 60.0  # of one request: the node answers nothing else meanwhile
BUDGET_S = 0.02  # wall time of one tick; requests wait no longer than this
MAX_LAG_S = 0.1  # wall time that is made up for; a sim that is slower runs slower

_EPS = 1e-9


Array = NDArray[np.float64]
SpecificForce = Callable[
    [Mapping[str, float], Mapping[str, float], Array], tuple[float, float, float]
]


@dataclass(frozen=True)
class Sample:
    """One instant of a run.

    Parameters
    ----------
    time : float
        Seconds since the start of the run.
    clock_ns : int
        The same instant on the clock that never goes back [ns].
    states, controls, outputs : mapping of name to value
        In the library's units.
    specific_force_b : x, y, z [m/s^2]
        Acceleration less gravity, body axes.
    """

    time: float
    clock_ns: int
    states: dict[str, float]
    controls: dict[str, float]
    outputs: dict[str, float]
    specific_force_b: tuple[float, float, float]
    vehicle: str
    model: str


@dataclass(frozen=True)
class Run:
    """What is flown from time 0 on: a plan, or commands from the vehicle's initial state."""

    vehicle: Vehicle
    simulator: Simulator
    specific_force: SpecificForce
    initial: Mapping[str, float]
    controls: Trajectory
    problem: str
    duration: float | None


class SimCore:
    """A simulator on a clock; whoever owns it calls `tick` often.

    Time stands still until there is something to fly, and while paused. The clock never goes
    back: each run begins one publishing interval after the last sample of the run before.

    Parameters
    ----------
    load_vehicle : function of a name
    publish : function of a Sample
        Called for each multiple of 1/rate, and exactly at the start and at a plan's end.
    vehicle : str
        What commands fly, and plans that name no vehicle.
    rate : float
        Samples per second of run time.
    real_time_factor : float
        Run time per wall time; 0 runs as fast as possible.
    after_plan : 'pause' or 'hold'
        Whether time stops at a plan's end, or goes on with the last controls held.
    epoch_ns : int
        What the clock shows before the first run [ns].
    wind : x, y, z [m/s]
        Where the air moves to, unless a plan says so itself.
    gusts : Gusts, optional
        Turbulence on top of it.
    on_plan_end : function
        Called after the sample at a plan's end.
    clock : function
        Returns monotonic wall seconds.
    """

    def __init__(
        self,
        load_vehicle: Callable[[str], Vehicle],
        publish: Callable[[Sample], None],
        *,
        vehicle: str,
        rate: float,
        epoch_ns: int,
        real_time_factor: float = 1.0,
        after_plan: str = 'pause',
        wind: Sequence[float] = (0.0, 0.0, 0.0),
        gusts: Gusts | None = None,
        on_plan_end: Callable[[], None] = lambda: None,
        clock: Callable[[], float] = _time.monotonic,
    ) -> None:
        self._load, self._publish, self._on_plan_end = load_vehicle, publish, on_plan_end
        self._vehicle, self._rate = vehicle, rate
        self._wind, self._gusts = tuple(wind), gusts
        self._clock = clock
        self.after_plan = after_plan
        self._factor = real_time_factor
        self.run: Run | None = None
        self._flown = False
        self._paused = self._paused_by_plan = False
        self._ended = False
        self._base_ns = epoch_ns
        self._index = 0  # of the next sample in multiples of 1/rate
        self._anchor = 0.0, 0.0  # wall and run time that were simultaneous

    # Commands. -----------------------------------------------------------------------------------
    def fly(self, plan: Trajectory) -> None:
        """Begin a run at the plan's initial state that follows its controls.

        Raises
        ------
        InputError
            If the vehicle is unknown or the plan is not for it; the run before goes on.
        """
        vehicle = self._load(plan.vehicle or self._vehicle)
        if plan.model and plan.model != vehicle.model_name:
            raise InputError(
                f'the plan is for the model {plan.model}, {vehicle.name} flies by '
                f'{vehicle.model_name}'
            )
        controls = replace(plan, time=plan.time - plan.time[0])
        initial = {name: float(values[0]) for name, values in plan.states.items()}
        self._begin(self._new_run(vehicle, controls, initial, controls.duration))

    def command(self, controls: Trajectory) -> None:
        """Follow these controls from now on; one sample holds until the next command.

        Raises
        ------
        InputError
            If a control is missing or beyond the vehicle's limits; nothing changes then.
        """
        run = self.run
        vehicle = self._load(self._vehicle) if run is None else run.vehicle
        for name, (lower, upper) in vehicle.model().controls.items():
            values = controls.controls.get(name, np.zeros(0))
            if values.size and not (lower <= values.min() and values.max() <= upper):
                raise InputError(
                    f'{name} of {values.min():g} to {values.max():g} is outside '
                    f'[{lower:g}, {upper:g}] of {vehicle.name}'
                )
        if run is None:
            shifted = replace(controls, time=controls.time - controls.time[0])
            self._begin(self._new_run(vehicle, shifted, {}, None))
            return
        now = run.simulator.time
        run.simulator.follow(replace(controls, time=controls.time - controls.time[0] + now))
        self._ended = True  # the plan is left; its end means nothing any more
        self._resume_after_plan()

    def reset(self) -> None:
        """Begin the run again from its start; stays paused if it was paused by hand."""
        if self.run is None:
            raise InputError('nothing to reset: no plan and no controls have come yet')
        run = self.run
        run.simulator.follow(run.controls)
        self._begin(run)

    def pause(self) -> None:
        """Stop run time."""
        self._paused, self._paused_by_plan = True, False

    def resume(self) -> None:
        """Let run time go on."""
        self._paused = self._paused_by_plan = False
        self._rebase()

    def step(self, duration: float) -> None:
        """Advance by a run time while paused, and publish a sample at the end of it.

        Raises
        ------
        InputError
            If not paused, nothing is flown, or the duration is out of range.
        """
        if self.run is None:
            raise InputError('nothing to step: no plan and no controls have come yet')
        if not self._paused:
            raise InputError('not paused: pause first')
        if not 0 < duration <= MAX_STEP_S:
            raise InputError(f'duration must be above 0 and at most {MAX_STEP_S:g} s')
        by_plan = self._paused_by_plan
        until = self.run.simulator.time + duration
        while self._next_time() < until - _EPS:
            self._advance(self._next_time())
        self._advance(until)
        self._paused, self._paused_by_plan = True, by_plan

    @property
    def is_paused(self) -> bool:
        return self._paused

    @property
    def real_time_factor(self) -> float:
        return self._factor

    @real_time_factor.setter
    def real_time_factor(self, factor: float) -> None:
        self._rebase()
        self._factor = factor

    @property
    def clock_ns(self) -> int:
        """What the clock shows: the instant of the last sample [ns]."""
        return self._base_ns + (0 if self.run is None else _ns(self.run.simulator.time))

    # Time. ---------------------------------------------------------------------------------------
    def tick(self) -> None:
        """Fly up to now.

        Raises
        ------
        InputError
            If the flight diverges; time is stopped then.
        """
        if self.run is None or self._paused:
            return
        began = self._clock()
        wall, start = self._anchor
        target = math.inf if self._factor == 0 else start + (began - wall) * self._factor
        while not self._paused and self._next_time() <= target + _EPS:
            self._paused = True  # unless it goes well: else the same error would come each tick
            self._advance(self._next_time())
            self._paused = self._paused_by_plan
            if self._clock() - began > BUDGET_S:
                break
        behind = target - self.run.simulator.time
        if self._factor == 0 or behind > MAX_LAG_S * self._factor + 1 / self._rate:
            self._rebase()

    def _next_time(self) -> float:
        assert self.run is not None
        on_grid = self._index / self._rate
        if self._ended or self.run.duration is None:
            return on_grid
        return min(on_grid, self.run.duration)

    def _advance(self, time: float) -> None:
        assert self.run is not None
        self.run.simulator.advance_to(time)
        self._index = math.floor(time * self._rate + _EPS) + 1
        self._publish(self._sample(time))
        duration = self.run.duration
        if not self._ended and duration is not None and time >= duration - _EPS:
            self._ended = True
            if self.after_plan == 'pause':
                self._paused = self._paused_by_plan = True
            self._on_plan_end()

    def _begin(self, run: Run) -> None:
        if self._flown:
            self._base_ns = self.clock_ns + _ns(1 / self._rate)
        run.simulator.reset(run.initial)
        self.run, self._flown, self._ended, self._index = run, True, False, 1
        self._resume_after_plan()
        self._publish(self._sample(0.0))
        self._rebase()

    def _resume_after_plan(self) -> None:
        if self._paused_by_plan:
            self.resume()

    def _rebase(self) -> None:
        self._anchor = self._clock(), 0.0 if self.run is None else self.run.simulator.time

    def _new_run(
        self,
        vehicle: Vehicle,
        controls: Trajectory,
        initial: Mapping[str, float],
        duration: float | None,
    ) -> Run:
        wind = [
            float(controls.outputs[name][0]) if name in controls.outputs else default
            for name, default in zip(WIND, self._wind, strict=True)
        ]
        simulator = Simulator(vehicle.model(), initial, controls, wind=wind, gusts=self._gusts)
        return Run(
            vehicle=vehicle,
            simulator=simulator,
            specific_force=specific_force(simulator.stage, vehicle.gravity),
            initial=dict(initial),
            controls=controls,
            problem=controls.problem,
            duration=duration,
        )

    def _sample(self, time: float) -> Sample:
        assert self.run is not None
        simulator = self.run.simulator
        states, controls, outputs = simulator.sample()
        return Sample(
            time=time,
            clock_ns=self._base_ns + _ns(time),
            states=states,
            controls=controls,
            outputs=outputs,
            specific_force_b=self.run.specific_force(states, controls, simulator.parameters),
            vehicle=self.run.vehicle.name,
            model=self.run.vehicle.model_name,
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
    function = cas.Function('specific_force', [x, u, p], [cas.vertcat(*force)])

    def evaluate(
        states: Mapping[str, float], controls: Mapping[str, float], parameters: Array
    ) -> tuple[float, float, float]:
        result = function(list(states.values()), list(controls.values()), parameters)
        x_b, y_b, z_b = result.full().ravel().tolist()
        return x_b, y_b, z_b

    return evaluate


def _ns(seconds: float) -> int:
    return round(seconds * 1e9)
