"""Planning on a thread: order, stopping, displacing, and how much a client hears of it."""

import threading
from typing import Any

from flightdyn.errors import InputError, ResultCode
from flightdyn.nodes.plan_worker import Job, Outcome, PlanWorker, Progress
from flightdyn.planning.solver import Iteration


def iteration(number: int) -> Iteration:
    return Iteration(number, 1.0, 2.0, 3.0, 99.0)


def test_progress_passes_first_and_last_and_thins_between() -> None:
    heard: list[Iteration] = []
    now = 100.0
    progress = Progress(heard.append, rate=64.0, clock=lambda: now)
    for number in range(10):  # four times as often as asked for; exact in binary
        progress(iteration(number))
        now += 1 / 256
    progress.flush()
    assert [item.number for item in heard] == [0, 4, 8, 9]
    assert [item.elapsed for item in heard[:2]] == [0.0, 4 / 256]


def test_last_iteration_is_not_said_twice() -> None:
    heard: list[Iteration] = []
    progress = Progress(heard.append, clock=lambda: 0.0)
    progress(iteration(0))
    progress.flush()
    progress.flush()
    assert len(heard) == 1


def test_refinement_counts_on() -> None:
    heard: list[Iteration] = []
    now = 0.0
    progress = Progress(heard.append, clock=lambda: now)
    for number in (0, 1, 2, 0, 1, 0):
        progress(iteration(number))
        now += 1.0
    assert [item.number for item in heard] == [0, 1, 2, 2, 3, 3]


class StubPlanner:
    """Runs until it is told to stop."""

    def __init__(self) -> None:
        self.began = threading.Event()
        self.order: list[Any] = []

    def plan(self, problem: Any, *, on_iteration: Any, should_stop: Any) -> Any:
        self.order.append(problem)
        self.began.set()
        if problem == 'bad':
            raise InputError('no such thing')
        if problem == 'bug':
            raise ZeroDivisionError
        wait = threading.Event()
        while not should_stop():
            wait.wait(0.001)
        raise InputError('stopped')


class Ends:
    def __init__(self) -> None:
        self.outcomes: dict[str, Outcome] = {}
        self._changed = threading.Condition()

    def job(self, problem: Any) -> Job:
        return Job(problem, on_iteration=lambda _: None, on_done=lambda o: self.put(problem, o))

    def put(self, problem: str, outcome: Outcome) -> None:
        with self._changed:
            self.outcomes[problem] = outcome
            self._changed.notify_all()

    def wait(self, problem: str) -> Outcome:
        with self._changed:
            assert self._changed.wait_for(lambda: problem in self.outcomes, 5)
        return self.outcomes[problem]


def test_errors_become_codes_and_the_worker_goes_on() -> None:
    ends, worker = Ends(), PlanWorker(StubPlanner())  # type: ignore[arg-type]
    worker.submit(ends.job('bad'))
    worker.submit(ends.job('bug'))
    assert ends.wait('bad').code == ResultCode.BAD_REQUEST
    assert ends.wait('bug').code == ResultCode.INTERNAL
    assert not worker.busy


def test_newer_goal_displaces_older_ones() -> None:
    planner, ends = StubPlanner(), Ends()
    worker = PlanWorker(planner)  # type: ignore[arg-type]
    old, waiting, new = (ends.job(name) for name in ('old', 'waiting', 'new'))
    worker.submit(old)
    assert planner.began.wait(5)
    worker.submit(waiting)
    worker.submit(new, displace=True)
    assert old.reason == waiting.reason == 'displaced by a newer goal'
    assert ends.wait('waiting').code == ResultCode.CANCELLED
    assert worker.busy
    assert worker.stop('the end', 5)
    ends.wait('new')
    assert planner.order == ['old', 'new']


def test_first_reason_to_stop_counts() -> None:
    job = Ends().job('x')
    job.stop('cancelled')
    job.stop('displaced')
    assert job.reason == 'cancelled'
