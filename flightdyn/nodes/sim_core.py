"""Flying plans and commands in run time: when to step, when to publish, when to stop; no ROS."""

import math
import time as _time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from ..errors import InputError
from ..simulation.gusts import Gusts
from ..trajectory import Trajectory
from ..vehicles.vehicle import Vehicle
from .sim_run import Run, Setting, check_within
from .sim_watch import Event, Watch

MAX_STEP_S = 60.0  # of one request: the node answers nothing else meanwhile
MAX_AHEAD_S = 60.0  # how far in the future a plan may begin that is to be joined
BUDGET_S = 0.02  # wall time of one tick; requests wait no longer than this
MAX_LAG_S = 0.1  # wall time that is made up for; a sim that is slower runs slower

_EPS = 1e-9

Vehicles = Callable[[str], tuple[Vehicle, Vehicle]]
"""Name of a vehicle -> as controllers believe it to be, and as it flies."""


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


@dataclass(frozen=True, kw_only=True)
class Rules:
    """What happens when; each can be changed in flight.

    Parameters
    ----------
    real_time_factor : float
        Run time per wall time; 0 runs as fast as possible.
    after_plan : 'pause' or 'hold'
        Whether time stops at a plan's end, or goes on: by the controls that keep the vehicle
        there if it is tracked and there are such, else by the last ones.
    new_plan : 'restart' or 'join'
        Whether a plan is flown from its own start, or the flight goes on along it.
    controls_timeout : float
        How long after a command's end the next must come [s]; 0 allows any time.
    on_timeout : 'hold', 'neutral' or 'stop'
        What follows if it does not: the last controls held, neutral ones, or a pause.
    on_ground : 'report' or 'stop'
        Whether time stops on the ground.
    """

    real_time_factor: float = 1.0
    after_plan: Literal['pause', 'hold'] = 'pause'
    new_plan: Literal['restart', 'join'] = 'restart'
    controls_timeout: float = 0.0
    on_timeout: Literal['hold', 'neutral', 'stop'] = 'hold'
    on_ground: Literal['report', 'stop'] = 'report'


@dataclass(frozen=True, kw_only=True)
class Start:
    """A flight that is there before any plan; none if `initial` is empty.

    Parameters
    ----------
    initial : mapping of state name to value
    wait : bool
        Whether time stands still until a plan or controls come; else neutral controls are flown.
    """

    initial: Mapping[str, float] = field(default_factory=dict)
    wait: bool = True


class SimCore:
    """A simulator on a clock; whoever owns it calls `tick` often.

    Time stands still until there is something to fly, and while paused. The clock never goes
    back: each run begins one publishing interval after the last sample of the run before.

    Parameters
    ----------
    vehicles : function of a name
        Returns the vehicle as controllers believe it to be, and as it flies.
    setting : Setting
    publish : function of a Sample
        Called for each multiple of 1/rate, and exactly at the start and at a plan's end.
    on_event : function of an Event
    rate : float
        Samples per second of run time.
    epoch_ns : int
        What the clock shows before the first run [ns].
    rules : Rules
    start : Start
    ground_altitude : float
        Above the local origin [m].
    clock : function
        Returns monotonic wall seconds.
    """

    def __init__(
        self,
        vehicles: Vehicles,
        setting: Setting,
        publish: Callable[[Sample], None],
        on_event: Callable[[Event], None],
        *,
        rate: float,
        epoch_ns: int,
        rules: Rules | None = None,
        start: Start | None = None,
        ground_altitude: float = 0.0,
        clock: Callable[[], float] = _time.monotonic,
    ) -> None:
        self._vehicles, self._setting = vehicles, setting
        self._publish, self._on_event = publish, on_event
        self._rate = rate
        self._ground_altitude = ground_altitude
        self._clock = clock
        self._rules = rules or Rules()
        self._start = start or Start()
        self.run: Run | None = None
        self._flown = False
        self._stopped = ''  # by: hand, wait, plan, timeout, ground, diverged
        self._end: float | None = None  # of the plan that is flown
        self._deadline: float | None = None  # of the next command
        self._pending: tuple[Trajectory, float] | None = None  # a plan, and when it begins
        self._base_ns = epoch_ns
        self._index = 0  # of the next sample in multiples of 1/rate
        self._anchor = 0.0, 0.0  # wall and run time that were simultaneous

    # Commands. -----------------------------------------------------------------------------------
    def begin(self) -> None:
        """Begin the flight that is there before any plan, if one is wanted.

        Raises
        ------
        InputError
            If a name of its initial state is not the model's.
        """
        if self._start.initial:
            vehicles = self._vehicles(self._setting.vehicle)
            self._begin(Run(*vehicles, self._setting, self._start.initial))

    def fly(self, plan: Trajectory) -> None:
        """Fly a plan: from its own start, or joining it from where the vehicle is.

        A plan that is joined is at its time 0 at the instant `plan.start_ns` of the clock, or
        now if that is 0. A flight that has been waiting takes a plan of another clock for now.

        Raises
        ------
        InputError
            If the vehicle is unknown, the plan is not for it, or not for now; the run before
            goes on.
        """
        if self.run is not None and self._rules.new_plan == 'join':
            self._join(self.run, plan)
            return
        vehicles = self._vehicles(plan.vehicle or self._setting.vehicle)
        _check_model(plan, vehicles[1])
        initial = {name: float(values[0]) for name, values in plan.states.items()}
        self._begin(Run(*vehicles, self._setting, initial, _from_zero(plan)))

    def command(self, controls: Trajectory) -> None:
        """Follow these controls from now on; one sample holds until the next command.

        Raises
        ------
        InputError
            If a control is missing or beyond the vehicle's limits; nothing changes then.
        """
        run = self.run
        if run is None:
            vehicles = self._vehicles(self._setting.vehicle)
            check_within(controls, vehicles[1])
            run = Run(*vehicles, self._setting, {}, _from_zero(controls), planned=False)
            self._begin(run)
        else:
            check_within(controls, run.vehicle)
            now = run.simulator.time
            run.command(_from_zero(controls, now))
            self._end, self._pending = None, None  # the plan is left
            self._go_on()
        timeout = self._rules.controls_timeout
        if timeout > 0:
            self._deadline = run.simulator.time + controls.duration + timeout

    def reset(self, initial: Mapping[str, float] | None = None) -> None:
        """Begin the run again, from its start or another state.

        It stays paused if it was paused by hand.

        Raises
        ------
        InputError
            If nothing is flown, or a state is unknown or not finite.
        """
        if self.run is None:
            raise InputError('nothing to reset: no plan and no controls have come yet')
        self._begin(self.run, initial or {})

    def pause(self) -> None:
        """Stop run time."""
        self._stopped = 'hand'

    def resume(self) -> None:
        """Let run time go on."""
        self._stopped = ''
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
        if not self._stopped:
            raise InputError('not paused: pause first')
        if not 0 < duration <= MAX_STEP_S:
            raise InputError(f'duration must be above 0 and at most {MAX_STEP_S:g} s')
        stopped = self._stopped
        until = self.run.simulator.time + duration
        while self._next_time() < until - _EPS:
            self._advance(self._next_time())
        self._advance(until)
        self._stopped = stopped

    def set_wind(self, wind: Sequence[float], severity: str = '') -> None:
        """Let the air move otherwise from now on.

        Parameters
        ----------
        wind : north, east, down [m/s]
        severity : str
            Of gusts on top of it; empty leaves them as they are.

        Raises
        ------
        InputError
            If nothing is flown, the wind is not finite or the severity unknown.
        """
        if self.run is None:
            raise InputError('no wind to set: no plan and no controls have come yet')
        if len(wind) != 3 or not all(map(math.isfinite, wind)):
            raise InputError(f'wind must be 3 finite components in m/s, got {list(wind)}')
        seed = 0 if self._setting.gusts is None else self._setting.gusts.seed
        gusts = Gusts(severity, seed) if severity else None
        self.run.simulator.blow(wind, gusts)

    @property
    def is_paused(self) -> bool:
        """Whether time stands still."""
        return bool(self._stopped)

    @property
    def is_waiting(self) -> bool:
        """Whether a flight stands still until a plan or controls come."""
        return self._stopped == 'wait'

    @property
    def state(self) -> str:
        """What the simulator is doing, in a few words."""
        if self.run is None:
            return 'nothing to fly'
        return {
            '': 'flying',
            'hand': 'paused',
            'wait': 'waiting for a plan or controls',
            'plan': 'paused at the end of the plan',
            'timeout': 'paused: no controls came',
            'ground': 'paused on the ground',
            'diverged': 'stopped: the flight diverged',
        }[self._stopped]

    @property
    def rules(self) -> Rules:
        """What happens when; can be replaced in flight."""
        return self._rules

    @rules.setter
    def rules(self, rules: Rules) -> None:
        self._rebase()
        self._rules = rules

    @property
    def clock_ns(self) -> int:
        """What the clock shows: the instant of the last sample [ns]."""
        return self.at(0.0 if self.run is None else self.run.simulator.time)

    def at(self, time: float) -> int:
        """Return what the clock shows at a time of the run [ns]."""
        return self._base_ns + _ns(time)

    @property
    def plan_age(self) -> float:
        """How long ago the plan that is flown began [s]; NaN without one."""
        if self.run is None or self.run.plan is None:
            return math.nan
        return float(self.run.simulator.time - self.run.plan.time[0])

    # Time. ---------------------------------------------------------------------------------------
    def tick(self) -> None:
        """Fly up to now.

        Raises
        ------
        InputError
            If the flight diverges; time is stopped then.
        """
        if self.run is None or self._stopped:
            return
        began = self._clock()
        wall, start = self._anchor
        factor = self._rules.real_time_factor
        due = math.inf if factor == 0 else start + (began - wall) * factor
        lag = MAX_LAG_S * factor + 1 / self._rate
        target = due if factor == 0 else min(due, self.run.simulator.time + lag)
        while not self._stopped and self._next_time() <= target + _EPS:
            self._advance(self._next_time())
            if self._clock() - began > BUDGET_S:
                break
        if due - self.run.simulator.time > lag:
            self._rebase()

    def _next_time(self) -> float:
        times = [self._index / self._rate]
        if self._end is not None:
            times.append(self._end)
        if self._deadline is not None:
            times.append(self._deadline)
        if self._pending is not None:
            times.append(self._pending[1])
        return min(times)

    def _advance(self, time: float) -> None:
        assert self.run is not None
        simulator = self.run.simulator
        try:
            simulator.advance_to(time)
        except InputError as error:
            self._stop('diverged', Event('diverged', simulator.time, str(error)))
            raise
        self._index = math.floor(time * self._rate + _EPS) + 1
        if self._pending is not None and time >= self._pending[1] - _EPS:
            (plan, begin), self._pending = self._pending, None
            self._take(self.run, plan, begin)
        sample = self._sample(time)
        self._publish(sample)
        for event in self._watch.look(time, sample.outputs | sample.controls | sample.states):
            if event.kind == 'ground_contact' and self._rules.on_ground == 'stop':
                self._stop('ground', event)
            else:
                self._on_event(event)
        self._look_at_clock(time)

    def _look_at_clock(self, time: float) -> None:
        """Act on the plan's end and the next command's deadline."""
        assert self.run is not None
        if self._end is not None and time >= self._end - _EPS:
            self._end = None
            event = Event('plan_ended', time, 'end of the plan')
            self._stop('plan' if self._rules.after_plan == 'pause' else '', event)
        if self._deadline is not None and time >= self._deadline - _EPS:
            self._deadline = None
            then = {'hold': 'the last are held', 'neutral': 'neutral ones are flown'}
            policy = self._rules.on_timeout
            message = f'no controls for too long: {then.get(policy, "time stops")}'
            if policy == 'neutral':
                self.run.command(self.run.neutral())
            event = Event('controls_timed_out', time, message)
            self._stop('timeout' if policy == 'stop' else '', event)

    def _stop(self, why: str, event: Event) -> None:
        self._stopped = self._stopped or why
        self._on_event(event)

    def _join(self, run: Run, plan: Trajectory) -> None:
        if plan.vehicle and plan.vehicle != run.vehicle.name:
            raise InputError(f'the plan is for {plan.vehicle}, {run.vehicle.name} is flying')
        _check_model(plan, run.vehicle)
        now = run.simulator.time
        begin = (plan.start_ns - self._base_ns) / 1e9 if plan.start_ns else now
        if not begin - MAX_AHEAD_S <= now < begin + plan.duration:
            if self._stopped != 'wait':
                ended = begin <= now
                off = now - begin - plan.duration if ended else begin - now
                told = f'ended {off:.4g} s ago' if ended else f'begins {off:.4g} s from now'
                raise InputError(
                    f'the plan {told}: not flown; if that is another clock, set use_sim_time'
                )
            begin = now
        plan = _from_zero(plan)
        if begin > now + _EPS:
            self._pending = plan, begin
        else:
            self._take(run, plan, begin)
            self._pending = None
        self._go_on()

    def _take(self, run: Run, plan: Trajectory, begin: float) -> None:
        run.follow(plan, begin)
        self._end, self._deadline = begin + plan.duration, None

    def _begin(self, run: Run, initial: Mapping[str, float] | None = None) -> None:
        was = self.clock_ns
        run.begin_again(initial or {})
        if self._flown:
            self._base_ns = was + _ns(1 / self._rate)
        self.run, self._flown, self._index = run, True, 1
        self._end = None if run.plan is None else float(run.plan.time[-1])
        self._deadline, self._pending = None, None
        self._watch = Watch(run.vehicle, self._ground_altitude)
        waits = bool(self._start.initial) and self._start.wait and run.plan is None
        if self._stopped != 'hand':
            self._stopped = 'wait' if waits else ''
        sample = self._sample(0.0)
        self._publish(sample)
        self._on_event(Event('run_began', 0.0, f'{run.vehicle.name} begins a run'))
        for event in self._watch.look(0.0, sample.outputs | sample.controls | sample.states):
            self._on_event(event)
        self._rebase()

    def _go_on(self) -> None:
        """Let time go on if it stood for want of a plan or controls."""
        if self._stopped in ('wait', 'plan', 'timeout'):
            self.resume()

    def _rebase(self) -> None:
        self._anchor = self._clock(), 0.0 if self.run is None else self.run.simulator.time

    def _sample(self, time: float) -> Sample:
        assert self.run is not None
        simulator = self.run.simulator
        states, controls, outputs = simulator.sample()
        return Sample(
            time=time,
            clock_ns=self.at(time),
            states=states,
            controls=controls,
            outputs=outputs,
            specific_force_b=self.run.specific_force(states, controls, simulator.parameters),
            vehicle=self.run.vehicle.name,
            model=self.run.vehicle.model_name,
        )


def _check_model(plan: Trajectory, vehicle: Vehicle) -> None:
    if plan.model and plan.model != vehicle.model_name:
        raise InputError(
            f'the plan is for the model {plan.model}, {vehicle.name} flies by {vehicle.model_name}'
        )


def _from_zero(trajectory: Trajectory, begin: float = 0.0) -> Trajectory:
    return replace(trajectory, time=trajectory.time - trajectory.time[0] + begin)


def _ns(seconds: float) -> int:
    return round(seconds * 1e9)
