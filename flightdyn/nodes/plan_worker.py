"""Planning one goal after another on a thread of its own; no ROS."""

import queue
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from ..errors import FlightdynError, ResultCode
from ..planning.planner import Planner
from ..planning.problem import Problem
from ..planning.report import Plan
from ..planning.solver import Iteration

FEEDBACK_RATE = 500.0  # Hz, above what solvers do; a reader's queue of 10 overflows beyond

Clock = Callable[[], float]


@dataclass(frozen=True)
class Outcome:
    """How a goal ended; `plan` is there unless it never got as far."""

    code: ResultCode
    message: str
    plan: Plan | None = None
    error: BaseException | None = None


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


class Job:
    """One goal: the problem, whom to tell, and whether to stop."""

    def __init__(
        self,
        problem: Problem,
        *,
        on_iteration: Callable[[Iteration], None],
        on_done: Callable[[Outcome], None],
    ) -> None:
        self.problem = problem
        self.progress = Progress(on_iteration)
        self.on_done = on_done
        self._reason: str | None = None

    def stop(self, reason: str) -> None:
        """Ask to end at the next iteration; the first reason counts."""
        if self._reason is None:
            self._reason = reason

    def is_stopped(self) -> bool:
        """Return whether it was asked to stop."""
        return self._reason is not None

    @property
    def reason(self) -> str:
        """Why it was asked to stop; empty if it was not."""
        return self._reason or ''


class PlanWorker:
    """Plans jobs in their order, one at a time."""

    def __init__(self, planner: Planner | None = None) -> None:
        self._planner = Planner() if planner is None else planner
        self._jobs: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        self._active: list[Job] = []
        self._lock = threading.Lock()
        self._idle = threading.Condition(self._lock)
        # not to be waited for: a solver in native code cannot be stopped between iterations
        self._thread = threading.Thread(target=self._run, name='plan', daemon=True)
        self._thread.start()

    @property
    def busy(self) -> bool:
        """Whether a job runs or waits."""
        with self._lock:
            return bool(self._active)

    def submit(self, job: Job, *, displace: bool = False) -> None:
        """Queue a job; with `displace`, whatever runs or waits is stopped for it."""
        with self._lock:
            if displace:
                for other in self._active:
                    other.stop('displaced by a newer goal')
            self._active.append(job)
        self._jobs.put(job)

    def stop(self, reason: str, timeout: float) -> bool:
        """Stop all jobs and wait; return whether all ended in time."""
        with self._lock:
            for job in self._active:
                job.stop(reason)
            self._jobs.put(None)
            return self._idle.wait_for(lambda: not self._active, timeout)

    def _run(self) -> None:
        while (job := self._jobs.get()) is not None:
            outcome = self._plan(job)
            with self._lock:
                self._active.remove(job)
                self._idle.notify_all()
            job.on_done(outcome)

    def _plan(self, job: Job) -> Outcome:
        if job.is_stopped():
            return Outcome(ResultCode.CANCELLED, f'{job.reason}; not begun')
        try:
            plan = self._planner.plan(
                job.problem,
                on_iteration=job.progress,
                should_stop=job.is_stopped,
            )
            job.progress.flush()
        except FlightdynError as error:
            return Outcome(error.result_code, str(error))
        except Exception as error:  # the goal ends with a code, the worker goes on
            return Outcome(ResultCode.INTERNAL, f'{type(error).__name__}: {error}', error=error)
        message = plan.report.message
        if plan.report.code == ResultCode.CANCELLED and job.is_stopped():
            message = f'{job.reason}; the last iterate is attached'
        return Outcome(plan.report.code, message, plan)


def summary(outcome: Outcome) -> dict[str, Any]:
    """Return figures of an outcome for people, as text."""
    figures: dict[str, Any] = {'last code': outcome.code.name, 'last message': outcome.message}
    if outcome.plan is not None:
        report = outcome.plan.report
        figures |= {
            'last problem': outcome.plan.trajectory.problem,
            'last iterations': report.iterations,
            'last wall time [s]': f'{report.wall_s:.3f}',
        }
    return {key: str(value) for key, value in figures.items()}
