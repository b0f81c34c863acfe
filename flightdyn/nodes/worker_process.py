"""A `plan_worker` as the node sees it: calls go in, outcomes come back, whatever happens to it."""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from typing import Any

from ..errors import ResultCode
from ..planning.solver import Iteration
from ..trajectory import Trajectory
from .plan_worker import Answer, Call, Clock, Outcome, Progressed, Ready, Stop, Taken

GRACE_S = 1.0
"""How long a call may go on after it was asked to stop, or after its time; a solver stops at its
next iteration, and what does not is building or stuck."""

# not `-m`: what a module that is __main__ sends through a pipe is of classes unknown elsewhere
RUN_WORKER = 'from flightdyn.nodes.plan_worker import main; main()'


@dataclass(eq=False)
class Job:
    """A call to a worker and whom to tell.

    Parameters
    ----------
    kind, body :
        As of `plan_worker.Call`.
    on_done : function of an Outcome
        Called once, in whatever thread, with no lock held.
    on_iteration : function of an Iteration
    on_flight : function of the number of an iteration and its Trajectory, optional
        Some iterates, to look at.
    wall_time : float
        After this and `GRACE_S` the process is ended [s]; it should have stopped by itself.
    """

    kind: str
    body: Any
    on_done: Callable[[Outcome], None]
    on_iteration: Callable[[Iteration], None] = lambda _: None
    on_flight: Callable[[int, Trajectory], None] | None = None
    wall_time: float = 60.0
    reason: str = ''
    began: float | None = field(default=None, init=False)
    stopped: float | None = field(default=None, init=False)
    taken: bool = field(default=False, init=False)
    sent_again: bool = field(default=False, init=False)

    @property
    def blameless(self) -> bool:
        """Whether its process died before it read this; once, as reading can be what kills."""
        return self.began is not None and not (self.taken or self.sent_again or self.reason)


class WorkerProcess:
    """Runs a worker, one job after the other, and starts another one when it dies.

    Parameters
    ----------
    name : str
        For messages.
    config_dir : str
    warm_start : bool
        Whether plans start from earlier ones of the same problem.
    """

    def __init__(
        self,
        name: str,
        config_dir: str = '',
        *,
        warm_start: bool = True,
        clock: Clock = time.monotonic,
    ) -> None:
        self.name = name
        self.restarts = 0
        self.on_idle: Callable[[], None] = lambda: None
        """Called when a job has ended, in the thread that reads from the worker."""
        self._config_dir, self._warm_start, self._clock = config_dir, warm_start, clock
        self._lock = threading.RLock()
        self._jobs: deque[Job] = deque()
        self._numbers = 0
        self._ready = self._closed = False
        self._overdue: Outcome | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._pipe: Connection | None = None
        self._start()

    @property
    def pid(self) -> int:
        """Of the process that runs now; 0 if there is none."""
        with self._lock:
            return self._process.pid if self._process else 0

    @property
    def busy(self) -> bool:
        """Whether a job runs or waits."""
        with self._lock:
            return bool(self._jobs)

    def submit(self, job: Job) -> None:
        """Queue a job."""
        with self._lock:
            self._jobs.append(job)
            if self._process is None and not self._closed:
                self._start()
            self._next()

    def stop(self, job: Job, reason: str) -> None:
        """Ask a job to end; the first reason counts."""
        with self._lock:
            if job.reason or job not in self._jobs:
                return
            job.reason, job.stopped = reason, self._clock()
            if job.began is not None:
                if self._pipe is not None:
                    with contextlib.suppress(OSError):
                        self._pipe.send(Stop(self._numbers))
                return
            self._jobs.remove(job)
        job.on_done(cancelled(job, 'not begun'))

    def watch(self) -> None:
        """End the process if its job neither stops when asked nor keeps its time; call often."""
        with self._lock:
            job = self._jobs[0] if self._jobs else None
            if job is None or job.began is None or self._process is None or self._overdue:
                return
            now = self._clock()
            if job.stopped is not None and now > job.stopped + GRACE_S:
                self._overdue = cancelled(job, 'in the middle of building or of one iteration')
            elif now > job.began + job.wall_time + GRACE_S:
                self._overdue = Outcome(
                    ResultCode.TIME_LIMIT,
                    f'stopped after max_wall_time = {job.wall_time:g} s in the middle of building '
                    'or of one iteration, there is no iterate; allow more, or lower nodes',
                )
            if self._overdue is not None:
                self._process.kill()

    def close(self) -> None:
        """End the process; jobs that are left end as cancelled."""
        with self._lock:
            self._closed = True
            process = self._process
            if self._jobs and self._overdue is None:
                self._overdue = cancelled(self._jobs[0], 'not waited for')
        if process is not None:
            process.kill()
            process.wait()
            self._reader.join(1.0)

    def _start(self) -> None:
        ours, theirs = socket.socketpair()
        # what is importable here is there, however this process was started
        env = {**os.environ, 'PYTHONPATH': os.pathsep.join(path for path in sys.path if path)}
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, '-c', RUN_WORKER, str(theirs.fileno())],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                env=env,
                process_group=0,  # a signal to the node's group is for the node: it ends this
            )
        self._pipe = Connection(ours.detach())
        self._ready, self._overdue = False, None
        self._reader = threading.Thread(
            target=self._read, args=(self._process, self._pipe), name=self.name, daemon=True
        )
        self._reader.start()

    def _next(self) -> None:
        """Send the first job, if the worker waits for one; under the lock."""
        job = self._jobs[0] if self._jobs else None
        if not self._ready or job is None or job.began is not None or self._pipe is None:
            return
        self._numbers += 1
        job.began = self._clock()
        call = Call(
            self._numbers,
            job.kind,
            job.body,
            self._config_dir,
            self._warm_start,
            with_flights=job.on_flight is not None,
        )
        with contextlib.suppress(OSError):  # it has just died: the reader will see to it
            self._pipe.send(call)

    def _read(self, process: 'subprocess.Popen[bytes]', pipe: Connection) -> None:
        with contextlib.suppress(EOFError, OSError):
            while True:
                self._take(pipe.recv())
        pipe.close()
        self._died(process.wait())

    def _take(self, message: Any) -> None:
        with self._lock:
            job = self._jobs[0] if self._jobs else None
            if isinstance(message, Ready):
                self._ready = True
                self._next()
        if job is None or job.began is None:
            return
        if isinstance(message, Taken):
            job.taken = True
        elif isinstance(message, Progressed):
            job.on_iteration(message.iteration)
            if message.flight is not None and job.on_flight is not None:
                job.on_flight(message.iteration.number, message.flight)
        elif isinstance(message, Answer):
            outcome = message.outcome
            if outcome.code == ResultCode.CANCELLED and job.reason:
                outcome = cancelled(job, 'the last iterate is attached', outcome)
            self._finish(outcome)

    def _finish(self, outcome: Outcome) -> None:
        with self._lock:
            job = self._jobs.popleft()
            self._next()
        job.on_done(outcome)
        self.on_idle()

    def _died(self, code: int) -> None:
        """Tell whoever waited, and start another process."""
        with self._lock:
            was_ready, self._ready = self._ready, False
            self._process = self._pipe = None
            said, self._overdue = self._overdue, None
            again = was_ready and not self._closed
            job = self._jobs[0] if self._jobs else None
            if again and said is None and job is not None and job.blameless:
                job.began, job.sent_again = None, True
            over = [job for job in self._jobs if job.began is not None or not again]
            for job in over:
                self._jobs.remove(job)
            if again:
                self.restarts += 1
                self._start()
        for job in over:
            job.on_done(said if said is not None else _lost(job, code))
        if over:
            self.on_idle()


def cancelled(job: Job, where: str, outcome: Outcome | None = None) -> Outcome:
    """Return how a job ended that was asked to."""
    reason = job.reason or 'the planner is ending'
    end = outcome or Outcome(ResultCode.CANCELLED, '')
    return Outcome(ResultCode.CANCELLED, f'{reason}; {where}', end.trajectory, end.report)


def _lost(job: Job, code: int) -> Outcome:
    if job.reason and not job.taken:
        return cancelled(job, 'not begun')
    if job.began is None:
        return Outcome(
            ResultCode.INTERNAL,
            f'no planning process could be started: it ended with {code}, and wrote why to the '
            "node's output",
        )
    how = f'by {signal.Signals(-code).name}' if code < 0 else f'with {code}'
    return Outcome(
        ResultCode.INTERNAL,
        f'the planning process was ended {how}, there is no iterate; if memory was short, lower '
        'nodes; the next goal gets a new process',
    )
