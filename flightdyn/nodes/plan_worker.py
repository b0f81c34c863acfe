"""The process that plans: it gets requests through a pipe and answers them in turn; no ROS.

Solvers live here, and not in the node, so that the node answers whatever they do: CasADi holds the
interpreter while it builds, and native code can neither be stopped nor survive its own crash. What
was built stays for the requests to come. The pipe leads to the node that started the process, and
to nobody else; when it closes, the process ends.
"""

import contextlib
import sys
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from ..dynamics.stage import WIND, WIND_STRENGTH
from ..environment.wind import ScaledWind
from ..errors import FlightdynError, ResultCode
from ..planning.planner import Planner
from ..planning.problem_file import list_problems
from ..planning.report import Plan, PlanReport
from ..planning.solver import Iteration
from ..trajectory import Trajectory
from .receding import Horizon, ReplanRequest
from .requests import (
    EvaluateRequest,
    PlanRequest,
    evaluate,
    problem_of_request,
)

FEEDBACK_RATE = 500.0  # Hz, above what solvers do; a reader's queue of 10 overflows beyond
FLIGHT_S = 0.2  # between iterates that are shown as flights
MAX_NEAR = 32  # plans from which others of the same kind start

Clock = Callable[[], float]


@dataclass(frozen=True)
class Call:
    """A request of the node; the number is in every answer to it."""

    number: int
    kind: str
    body: Any
    config_dir: str = ''
    warm_start: bool = True
    with_flights: bool = False


@dataclass(frozen=True)
class Stop:
    """Asks for the end of a call under way."""

    number: int


@dataclass(frozen=True)
class Ready:
    """The first word of a process: it takes calls."""


@dataclass(frozen=True)
class Taken:
    """A call has come out of the pipe: from here on it can be what ends the process."""

    number: int


@dataclass(frozen=True)
class Progressed:
    """An iteration of a call under way, and now and then the flight that it is."""

    number: int
    iteration: Iteration
    flight: Trajectory | None = None


@dataclass(frozen=True)
class Outcome:
    """How a request ended.

    Parameters
    ----------
    code : ResultCode
    message : str
    trajectory : Trajectory or None
        The plan, or the last iterate: `report.converged` tells; with the wind among its outputs.
    report : PlanReport or None
    value : Any
        What else was asked for.
    fault : str
        Type and place of an error in flightdyn itself.
    """

    code: ResultCode
    message: str
    trajectory: Trajectory | None = None
    report: PlanReport | None = None
    value: Any = None
    fault: str = ''


@dataclass(frozen=True)
class Answer:
    """The last word on a call."""

    number: int
    outcome: Outcome


class Progress:
    """Thins a solver's iterations to a rate; the first and the last always pass.

    Mesh refinements count on: a reader sees one solve whose iterations never go back.

    Parameters
    ----------
    publish : function of an Iteration
    clock : function
        Returns monotonic seconds; `elapsed` runs from the construction.
    """

    def __init__(
        self,
        publish: Callable[[Iteration], None],
        *,
        rate: float = FEEDBACK_RATE,
        clock: Clock = time.monotonic,
    ) -> None:
        self._publish, self._interval, self._clock = publish, 1 / rate, clock
        self._began = clock()
        self._sent = -float('inf')
        self._offset = 0
        self._last: Iteration | None = None
        self._waiting: Iteration | None = None

    def __call__(self, iteration: Iteration) -> None:
        """Take an iteration, and publish it if it is time."""
        if self._last is not None and iteration.number + self._offset < self._last.number:
            self._offset = self._last.number
        now = self._clock()
        self._last = self._waiting = replace(
            iteration, number=iteration.number + self._offset, elapsed=now - self._began
        )
        if now - self._sent >= self._interval:
            self.flush(now)

    def flush(self, now: float | None = None) -> None:
        """Publish the last iteration if it is not out yet."""
        if self._waiting is not None:
            waiting, self._waiting = self._waiting, None
            self._sent = self._clock() if now is None else now
            self._publish(waiting)


class PlanWorker:
    """Answers calls that come through a pipe, one after the other.

    Parameters
    ----------
    pipe : Connection
        Takes `Call` and `Stop`, gives `Ready`, `Taken`, `Progressed` and `Answer`.
    """

    def __init__(self, pipe: Connection, planner: Planner | None = None) -> None:
        self._pipe = pipe
        self._planner = planner or Planner()
        self._plans: OrderedDict[str, Plan] = OrderedDict()
        self._horizon: Horizon | None = None
        self._call = Call(0, '', None)
        self._stopped = False
        self._shown = 0.0
        self._kinds: dict[str, Callable[[Any], Outcome]] = {
            'list': self._list,
            'check': self._check,
            'evaluate': self._evaluate,
            'plan': self._plan,
            'replan': self._replan,
        }

    def run(self) -> None:
        """Answer calls until the other end of the pipe is closed."""
        try:
            self._pipe.send(Ready())
            while True:
                message = self._pipe.recv()
                if isinstance(message, Call):
                    self._call, self._stopped = message, False
                    self._pipe.send(Taken(message.number))
                    self._pipe.send(Answer(message.number, self._outcome(message)))
        except (EOFError, OSError):
            return

    def _outcome(self, call: Call) -> Outcome:
        try:
            return self._kinds[call.kind](call.body)
        except FlightdynError as error:
            return Outcome(error.result_code, str(error))
        except (EOFError, OSError):
            raise
        except Exception as error:  # the request ends with a code, the process goes on
            said = f'{type(error).__name__}: {error}'
            return Outcome(
                ResultCode.INTERNAL, f'an error in flightdyn itself: {said}', fault=_place(error)
            )

    def _should_stop(self) -> bool:
        while not self._stopped and self._pipe.poll():
            message = self._pipe.recv()
            self._stopped = isinstance(message, Stop) and message.number == self._call.number
        return self._stopped

    def _list(self, _body: None) -> Outcome:
        problems, wrong = list_problems(self._call.config_dir)
        rows = [(each.name, each.vehicle.name, each.description) for each in problems]
        return Outcome(ResultCode.SUCCESS, '', value=(rows, [str(error) for error in wrong]))

    def _check(self, request: PlanRequest) -> Outcome:
        problem = problem_of_request(request, self._call.config_dir)
        said = f'{problem.name} with {problem.nodes} nodes'
        return Outcome(ResultCode.SUCCESS, said, value=problem.max_wall_time)

    def _evaluate(self, request: EvaluateRequest) -> Outcome:
        return Outcome(ResultCode.SUCCESS, '', value=evaluate(request, self._call.config_dir))

    def _plan(self, request: PlanRequest) -> Outcome:
        problem = problem_of_request(request, self._call.config_dir)
        progress = Progress(self._tell)
        warm = self._call.warm_start and request.guess is None
        plan = self._planner.plan(
            problem,
            near=self._plans.get(problem.name) if warm else None,
            on_iteration=progress,
            should_stop=self._should_stop,
        )
        progress.flush()
        if plan.report.verified:
            self._plans[problem.name] = plan
            self._plans.move_to_end(problem.name)
            while len(self._plans) > MAX_NEAR:
                self._plans.popitem(last=False)
        return outcome_of(plan)

    def _tell(self, iteration: Iteration) -> None:
        flight, now = None, time.monotonic()
        if self._call.with_flights and iteration.trajectory and now > self._shown + FLIGHT_S:
            self._shown = now
            with contextlib.suppress(FlightdynError):  # an iterate may be no flight at all
                flight = iteration.trajectory()
        plain = replace(iteration, variables=None, trajectory=None)  # functions do not travel
        self._pipe.send(Progressed(self._call.number, plain, flight))

    def _replan(self, request: ReplanRequest) -> Outcome:
        if self._horizon is None or self._horizon.differs(request):
            self._horizon = Horizon(self._planner, request, self._call.config_dir)
        plan = self._horizon.plan(request, self._should_stop)
        return outcome_of(plan)


def outcome_of(plan: Plan) -> Outcome:
    """Return what travels of a plan: all but what its solve was made of."""
    return Outcome(plan.report.code, plan.report.message, with_wind(plan), plan.report)


def with_wind(plan: Plan) -> Trajectory:
    """Return the plan's trajectory with the wind on its way among its outputs.

    The message has no field for it, and who flies the plan needs the same air.
    """
    trajectory = plan.trajectory
    varying: Any = (0.0, 0.0, 0.0)
    if plan.wind is not None:
        x, y, z = (trajectory[name] for name in ('x_e', 'y_e', 'z_e'))
        strength = trajectory.states.get(WIND_STRENGTH, 1.0)
        varying = ScaledWind(plan.wind, strength)(x, y, z, trajectory.time)
    wind = {
        name: np.full(len(trajectory), float(steady)) + more
        for name, steady, more in zip(WIND, plan.wind_ned, varying, strict=True)
    }
    return replace(trajectory, outputs={**trajectory.outputs, **wind})


def _place(error: BaseException) -> str:
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    if trace is None:
        return ''
    return f'{trace.tb_frame.f_code.co_filename}:{trace.tb_lineno}'


def main() -> None:
    """Serve the pipe whose file descriptor is the first argument."""
    PlanWorker(Connection(int(sys.argv[1]))).run()
