"""Which goal is planned next, by which of several processes; no ROS."""

import threading
from collections import deque
from collections.abc import Callable, Sequence
from typing import Protocol

from .worker_process import Job, cancelled


class Worker(Protocol):
    """What the queue needs of a `WorkerProcess`."""

    on_idle: Callable[[], None]

    def submit(self, job: Job) -> None: ...
    def stop(self, job: Job, reason: str) -> None: ...
    def watch(self) -> None: ...
    def close(self) -> None: ...


class PlanQueue:
    """Gives jobs to workers in their order, to each worker one at a time."""

    def __init__(self, workers: Sequence[Worker]) -> None:
        self._workers = list(workers)
        self._waiting: deque[Job] = deque()
        self._running: dict[int, Job] = {}
        self._lock = threading.Lock()
        self._changed = threading.Condition(self._lock)
        for place, worker in enumerate(self._workers):
            worker.on_idle = lambda place=place: self._idle(place)  # type: ignore[misc]

    @property
    def waiting(self) -> int:
        """How many jobs wait."""
        with self._lock:
            return len(self._waiting)

    @property
    def running(self) -> int:
        """How many jobs are with a worker."""
        with self._lock:
            return len(self._running)

    def submit(self, job: Job, *, displace: bool = False) -> None:
        """Queue a job; with `displace`, whatever runs or waits is stopped for it."""
        if displace:
            self.stop_all('displaced by a newer goal')
        with self._lock:
            self._waiting.append(job)
        self._hand_out()

    def stop(self, job: Job, reason: str) -> None:
        """End a job that waits, or ask the worker to end it."""
        with self._lock:
            waits = job in self._waiting
            if waits:
                self._waiting.remove(job)
            place = next((p for p, each in self._running.items() if each is job), None)
        if waits:
            job.reason = reason
            job.on_done(cancelled(job, 'not begun'))
        elif place is not None:
            self._workers[place].stop(job, reason)

    def stop_all(self, reason: str) -> None:
        """Stop whatever waits or runs."""
        with self._lock:
            jobs = [*self._waiting, *self._running.values()]
        for job in jobs:
            self.stop(job, reason)

    def wait_until_idle(self, timeout: float) -> bool:
        """Return whether no job is left within a time [s]."""
        with self._lock:
            return self._changed.wait_for(lambda: not (self._waiting or self._running), timeout)

    def watch(self) -> None:
        """End workers that neither stop when asked nor keep their time; call often."""
        for worker in self._workers:
            worker.watch()

    def close(self) -> None:
        """End the workers; jobs that are left end as cancelled."""
        self.stop_all('the planner is ending')
        for worker in self._workers:
            worker.close()

    def _hand_out(self) -> None:
        while True:
            with self._lock:
                free = [p for p in range(len(self._workers)) if p not in self._running]
                if not (self._waiting and free):
                    return
                place, job = free[0], self._waiting.popleft()
                self._running[place] = job
            self._workers[place].submit(job)

    def _idle(self, place: int) -> None:
        with self._lock:
            self._running.pop(place, None)
            self._changed.notify_all()
        self._hand_out()
