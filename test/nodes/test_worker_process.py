"""Worker processes from the node's side: killed, overdue, stopped, closed; and the queue."""

import os
import signal
import threading
from collections.abc import Iterator
from typing import Any

import pytest

from flightdyn.errors import ResultCode
from flightdyn.nodes.plan_queue import PlanQueue
from flightdyn.nodes.plan_worker import Outcome
from flightdyn.nodes.requests import PlanRequest
from flightdyn.nodes.worker_process import GRACE_S, Job, WorkerProcess, cancelled

FLIP = 'quadcopter_flip'
TIMEOUT_S = 30.0
# hundreds of iterations of some 10 ms each: time enough to cut in
LONG = PlanRequest(problem=FLIP, final={'x_e': (300.0, 300.0)}, nodes=300, most_wall_time=60.0)
SHORT = PlanRequest(problem=FLIP, most_wall_time=60.0)


class Asked:
    """A job and what has come of it."""

    def __init__(self, kind: str, body: Any, wall_time: float = 60.0) -> None:
        self.outcomes: list[Outcome] = []
        self._ended, self._heard = threading.Event(), threading.Event()
        self.job = Job(kind, body, self._end, lambda _: self._heard.set(), wall_time=wall_time)

    def _end(self, outcome: Outcome) -> None:
        self.outcomes.append(outcome)
        self._ended.set()

    def wait_for_iteration(self) -> None:
        assert self._heard.wait(TIMEOUT_S)

    def outcome(self) -> Outcome:
        assert self._ended.wait(TIMEOUT_S)
        (outcome,) = self.outcomes
        return outcome


class Watch:
    """A clock that the test sets."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def watch() -> Watch:
    return Watch()


class KillsItsReader:
    """Ends the process that takes it out of a pipe."""

    def __reduce__(self) -> Any:
        return exec, ('import os; os.kill(os.getpid(), 9)',)


@pytest.fixture
def worker(watch: Watch) -> Iterator[WorkerProcess]:
    worker = WorkerProcess('worker', clock=watch)
    yield worker
    worker.close()
    assert worker.pid == 0


def test_killed_in_the_middle_fails_that_job_and_the_next_succeeds(worker: WorkerProcess) -> None:
    first, second = Asked('plan', LONG), Asked('plan', SHORT)
    worker.submit(first.job)
    worker.submit(second.job)
    first.wait_for_iteration()
    pid = worker.pid
    os.kill(pid, signal.SIGKILL)
    lost = first.outcome()
    assert lost.code == ResultCode.INTERNAL
    assert 'ended by SIGKILL' in lost.message
    assert second.outcome().code == ResultCode.SUCCESS
    assert worker.pid != pid
    assert worker.restarts == 1


def test_job_sent_to_a_dead_process_is_sent_to_the_next(worker: WorkerProcess) -> None:
    first = Asked('list', None)
    worker.submit(first.job)
    assert first.outcome().code == ResultCode.SUCCESS
    for restarts in (1, 2):  # stopped, it reads nothing: killed, but not yet missed
        os.kill(worker.pid, signal.SIGSTOP)
        asked = Asked('list', None)
        worker.submit(asked.job)
        os.kill(worker.pid, signal.SIGKILL)
        assert asked.outcome().code == ResultCode.SUCCESS
        assert worker.restarts == restarts


def test_job_that_no_process_lives_to_read_is_sent_twice(worker: WorkerProcess) -> None:
    asked = Asked('plan', KillsItsReader())
    worker.submit(asked.job)
    assert 'ended by SIGKILL' in asked.outcome().message
    assert worker.restarts == 2


def test_job_stopped_before_its_process_died_is_cancelled(worker: WorkerProcess) -> None:
    first = Asked('list', None)
    worker.submit(first.job)
    first.outcome()
    os.kill(worker.pid, signal.SIGSTOP)
    asked = Asked('plan', LONG)
    worker.submit(asked.job)
    worker.stop(asked.job, 'cancelled')
    os.kill(worker.pid, signal.SIGKILL)
    assert asked.outcome().message == 'cancelled; not begun'


def test_stopping_takes_effect_at_the_next_iteration(worker: WorkerProcess) -> None:
    asked = Asked('plan', LONG)
    worker.submit(asked.job)
    asked.wait_for_iteration()
    worker.stop(asked.job, 'cancelled')
    worker.stop(asked.job, 'another reason')
    outcome = asked.outcome()
    assert outcome.code == ResultCode.CANCELLED
    assert outcome.message == 'cancelled; the last iterate is attached'
    assert outcome.trajectory is not None
    assert outcome.report is not None
    assert not outcome.report.converged
    assert worker.restarts == 0


def test_job_that_waits_is_stopped_at_once(worker: WorkerProcess) -> None:
    first, second = Asked('plan', LONG), Asked('plan', SHORT)
    worker.submit(first.job)
    worker.submit(second.job)
    worker.stop(second.job, 'cancelled')
    assert second.outcomes[0].message == 'cancelled; not begun'


def test_what_does_not_stop_is_ended(worker: WorkerProcess, watch: Watch) -> None:
    asked = Asked('plan', LONG)
    worker.submit(asked.job)
    asked.wait_for_iteration()
    os.kill(worker.pid, signal.SIGSTOP)  # as if it were in the middle of building
    worker.stop(asked.job, 'cancelled')
    worker.watch()
    assert not asked.outcomes
    watch.now += GRACE_S + 0.1
    worker.watch()
    outcome = asked.outcome()
    assert outcome.code == ResultCode.CANCELLED
    assert 'in the middle of building' in outcome.message


def test_what_does_not_keep_its_time_is_ended(worker: WorkerProcess, watch: Watch) -> None:
    asked = Asked('plan', LONG, wall_time=5.0)
    worker.submit(asked.job)
    asked.wait_for_iteration()
    os.kill(worker.pid, signal.SIGSTOP)
    watch.now += 5.0
    worker.watch()
    assert not asked.outcomes
    watch.now += GRACE_S + 0.1
    worker.watch()
    outcome = asked.outcome()
    assert outcome.code == ResultCode.TIME_LIMIT
    assert 'max_wall_time = 5 s' in outcome.message


def test_closing_ends_every_job(watch: Watch) -> None:
    worker = WorkerProcess('worker', clock=watch)
    jobs = [Asked('plan', LONG) for _ in range(3)]
    for each in jobs:
        worker.submit(each.job)
    worker.close()
    assert [each.outcome().code for each in jobs] == [ResultCode.CANCELLED] * 3


def test_process_that_cannot_start_fails_its_jobs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('sys.executable', '/bin/false')
    worker = WorkerProcess('worker')
    asked = Asked('list', None)
    worker.submit(asked.job)
    outcome = asked.outcome()
    assert outcome.code == ResultCode.INTERNAL
    assert 'no planning process could be started' in outcome.message
    worker.close()


class StubWorker:
    """Ends jobs when the test says so."""

    def __init__(self) -> None:
        self.on_idle: Any = None
        self.job: Job | None = None
        self.begun: list[Any] = []

    def submit(self, job: Job) -> None:
        assert self.job is None, 'a worker has one job at a time'
        self.job = job
        self.begun.append(job.body)

    def stop(self, job: Job, reason: str) -> None:
        assert job is self.job
        job.reason = job.reason or reason

    def end(self) -> None:
        job, self.job = self.job, None
        assert job is not None
        job.on_done(cancelled(job, 'x') if job.reason else Outcome(ResultCode.SUCCESS, ''))
        self.on_idle()

    def watch(self) -> None: ...
    def close(self) -> None: ...


def test_queue_keeps_order_and_uses_every_worker() -> None:
    workers = StubWorker(), StubWorker()
    queue = PlanQueue(workers)
    for name in 'abcd':
        queue.submit(Asked('plan', name).job)
    assert (queue.running, queue.waiting) == (2, 2)
    workers[1].end()
    workers[1].end()
    workers[0].end()
    workers[1].end()
    assert workers[0].begun == ['a']
    assert workers[1].begun == ['b', 'c', 'd']
    assert queue.wait_until_idle(0.0)


def test_newer_job_displaces_those_that_run_and_wait() -> None:
    worker = StubWorker()
    queue = PlanQueue([worker])
    old, waiting, new = (Asked('plan', name) for name in ('old', 'waiting', 'new'))
    queue.submit(old.job)
    queue.submit(waiting.job)
    queue.submit(new.job, displace=True)
    assert waiting.outcomes[0].message == 'displaced by a newer goal; not begun'
    assert not old.outcomes
    worker.end()
    assert old.outcomes[0].code == ResultCode.CANCELLED
    assert worker.begun == ['old', 'new']
    assert not queue.wait_until_idle(0.0)
    worker.end()
    assert new.outcomes[0].code == ResultCode.SUCCESS


def test_job_that_is_over_cannot_be_stopped() -> None:
    worker = StubWorker()
    queue = PlanQueue([worker])
    asked = Asked('plan', 'a')
    queue.submit(asked.job)
    worker.end()
    queue.stop(asked.job, 'cancelled')
    assert [outcome.code for outcome in asked.outcomes] == [ResultCode.SUCCESS]
