"""When to plan anew in flight, and which plan is in force; no ROS, no thread.

Every time is that of one clock, the one that states are stamped with [ns].
"""

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from ..errors import ResultCode
from ..trajectory import Trajectory
from .diagnostics import Level, Status
from .plan_worker import Outcome
from .receding import ReplanRequest

LEAD_FACTOR = 1.2  # over the longest of the last solves
LEAD_MARGIN = 0.02  # s, to publish and to take
REMEMBERED = 5  # solves
OTHER_CLOCK = 5.0  # s: states that are older, or newer, are stamped by another clock
LATE = 2.0  # periods: a plan that is older than that is late

_NS = 10**9


@dataclass(frozen=True, kw_only=True)
class ReplanSettings:
    """What is planned anew, and how often.

    Parameters
    ----------
    problem : str
    settings : sequence of 'KEY=VALUE'
        Override entries of its file.
    rate : float [Hz]
    stop_before : float
        No new plan when less than this is left of the one before [s].
    max_wall_time : float
        Of the first plan [s]; the others have a few periods.
    """

    problem: str
    settings: tuple[str, ...] = ()
    rate: float
    stop_before: float
    max_wall_time: float


@dataclass(frozen=True)
class Sample:
    """A vehicle's state, as far as it is told.

    Parameters
    ----------
    stamp_ns : int
    run_time : float
        Since the start of the run [s]; when it goes back another run has begun.
    values, controls : mapping of name to value
        In the library's units.
    """

    stamp_ns: int
    run_time: float
    values: Mapping[str, float]
    controls: Mapping[str, float]


class Replanner:
    """Asks for a plan from the newest state whenever one is due; keeps the last valid one.

    Parameters
    ----------
    submit : function of a ReplanRequest and of its number
        Has it planned; `done` is to be called with the outcome and that number.
    publish : function of a Trajectory
        Takes a new valid plan; its `start_ns` says when it begins.
    warn : function of str
        Takes a sentence on what went wrong.
    """

    def __init__(
        self,
        settings: ReplanSettings,
        *,
        submit: Callable[[ReplanRequest, int], None],
        publish: Callable[[Trajectory], None],
        warn: Callable[[str], None],
    ) -> None:
        self.settings = settings
        self._submit, self._publish, self._warn = submit, publish, warn
        self._counts = dict.fromkeys(('plans', 'failures', 'late plans'), 0)
        self._took: deque[float] = deque(maxlen=REMEMBERED)
        self._number = 0
        self._asked: tuple[int, ReplanRequest, int, int] | None = None
        self.forget()

    def forget(self) -> None:
        """Begin anew: the clock has jumped, or another run has begun."""
        self._plan: Trajectory | None = None
        self._plan_state_ns = 0
        if self._asked is not None and not self._asked[1].prepare:
            self._asked = None
        self._due_ns: int | None = None
        self._newest: Sample | None = None
        self._failed_in_row = 0
        self._message = ''
        self._fresh = True

    @property
    def plan(self) -> Trajectory | None:
        """The plan in force."""
        return self._plan

    @property
    def _period_ns(self) -> int:
        return round(_NS / self.settings.rate)

    @property
    def lead(self) -> float:
        """How far ahead of its state the next plan begins [s]."""
        period = 1 / self.settings.rate
        expected = LEAD_FACTOR * max(self._took, default=period) + LEAD_MARGIN
        return min(expected, LATE * period)

    def take(self, sample: Sample, now_ns: int) -> None:
        """Take the newest state, and ask for a plan if one is due."""
        before, self._newest = self._newest, sample
        if before is not None and sample.run_time < before.run_time:
            self.forget()
            self._newest = sample
        if self._due_ns is None:
            self._due_ns = now_ns
        if self._asked is not None or now_ns < self._due_ns or self._is_over(now_ns):
            return
        if abs(now_ns - sample.stamp_ns) > OTHER_CLOCK * _NS:
            return
        # a slow solve does not make the next ones come faster
        self._due_ns = max(self._due_ns + self._period_ns, now_ns)
        wall_time = self.settings.max_wall_time
        if self._plan is not None:
            wall_time = min(wall_time, 1 + LATE / self.settings.rate)
        self._ask(
            ReplanRequest(
                problem=self.settings.problem,
                settings=self.settings.settings,
                state=sample.values,
                controls=sample.controls,
                time=sample.stamp_ns / _NS,
                lead=self.lead + max(now_ns - sample.stamp_ns, 0) / _NS,
                max_wall_time=wall_time,
                fresh=self._fresh,
            ),
            sample.stamp_ns,
            now_ns,
        )
        self._fresh = False

    def prepare(self, now_ns: int) -> None:
        """Have the problem built and planned as it is written, so that plans in flight are quick.

        The first one takes as long as several others: from a state in flight it would be late.
        """
        request = ReplanRequest(
            problem=self.settings.problem,
            settings=self.settings.settings,
            state={},
            controls={},
            time=0.0,
            lead=0.0,
            max_wall_time=self.settings.max_wall_time,
            prepare=True,
        )
        self._ask(request, 0, now_ns)

    def _ask(self, request: ReplanRequest, state_ns: int, now_ns: int) -> None:
        self._number += 1
        self._asked = self._number, request, state_ns, now_ns
        self._submit(request, self._number)

    def done(self, number: int, outcome: Outcome, now_ns: int) -> None:
        """Take the outcome of a request."""
        if self._asked is None or self._asked[0] != number:
            return  # of a run that is over
        _, request, state_ns, asked_ns = self._asked
        self._asked = None
        if request.prepare:
            if outcome.code == ResultCode.BAD_REQUEST:
                self._warn(f'cannot plan anew: {outcome.message}')
            return
        if outcome.code == ResultCode.SUCCESS and outcome.trajectory is not None:
            self._took.append((now_ns - asked_ns) / _NS)
            start_ns = state_ns + round(request.lead * _NS)
            self._counts['plans'] += 1
            self._counts['late plans'] += now_ns > start_ns
            self._plan = replace(outcome.trajectory, start_ns=start_ns)
            self._plan_state_ns = state_ns
            self._failed_in_row = 0
            self._message = outcome.message
            self._publish(self._plan)
        elif outcome.code != ResultCode.CANCELLED:
            self._counts['failures'] += 1
            self._failed_in_row += 1
            self._message = f'{outcome.code.name}: {outcome.message}'
            kept = (
                'there is no plan yet'
                if self._plan is None
                else f'the plan of {self.age(now_ns):.2f} s ago stays in force'
            )
            if self._failed_in_row == 1:
                self._warn(f'planning anew failed, {kept}: {self._message}')

    def age(self, now_ns: int) -> float:
        """Return how old the state is that the plan in force begins from [s]; NaN without one."""
        return float('nan') if self._plan is None else (now_ns - self._plan_state_ns) / _NS

    def left(self, now_ns: int) -> float:
        """Return what is left of the plan in force [s]; NaN without one."""
        plan = self._plan
        if plan is None:
            return float('nan')
        return float(plan.time[-1]) + (plan.start_ns - now_ns) / _NS

    def _is_over(self, now_ns: int) -> bool:
        return self.left(now_ns) < self.settings.stop_before

    def status(self, now_ns: int) -> Status:
        """Return how it goes."""
        level, message = Level.OK, 'planning anew'
        age, limit = self.age(now_ns), LATE / self.settings.rate
        newest = self._newest
        if newest is None:
            level, message = Level.WARN, 'no state has come'
        elif abs(now_ns - newest.stamp_ns) > max(OTHER_CLOCK, limit) * _NS:
            behind = (now_ns - newest.stamp_ns) / _NS
            level = Level.WARN
            message = f'the newest state is {behind:.1f} s old; by another clock? set use_sim_time'
        elif self._plan is None:
            level = Level.WARN
            message = self._message or 'the first plan is being made'
        elif self._is_over(now_ns):
            message = 'the plan nears its end; no more are made'
        elif age > limit:
            level, message = Level.WARN, f'the plan is {age:.2f} s old; {self._message}'
        elif self._failed_in_row:
            level, message = Level.WARN, self._message
        return Status(
            'planning anew',
            message,
            level,
            {
                'problem': self.settings.problem,
                'plan age [s]': age,
                'left of the plan [s]': self.left(now_ns),
                'lead [s]': self.lead,
                'longest of the last solves [s]': max(self._took, default=float('nan')),
                'failed in a row': self._failed_in_row,
                **self._counts,
            },
        )
