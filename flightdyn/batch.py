"""Many independent jobs on Dask: a result file each, and one table that tells of all of them.

A job either leaves its whole result or none. What is done is written down at once, so that a run
that was broken off goes on where it was, and a second run does what is missing or has changed.
"""

import fcntl
import json
import logging
import os
import shutil
import time
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path, PurePosixPath
from types import TracebackType
from typing import Any, TextIO

from .errors import FlightdynError, InputError, MissingExtraError, ResultCode
from .files import written_whole

Row = dict[str, Any]

SUMMARY = 'summary.parquet'
JOURNAL = 'batch.jsonl'
_PARTIAL = '.partial'
_CONNECT_S = 10

# Ctrl-C goes to every process of a terminal; the one that hands out the jobs ends the others.
_PRELOAD = 'import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)'


@dataclass(frozen=True)
class Job:
    """One piece of work.

    Parameters
    ----------
    key : str
        Tells it from the others, in this and in later runs.
    output : str
        Its result file, relative to the batch's folder.
    arguments : mapping
        What the batch's function is called with, besides the file to write.
    fingerprint : str
        Changes when the result would; then the job is done again.
    columns : mapping
        What the summary says of the job itself.
    group : str
        Jobs of a group are done by one process, one after the other, as far as that leaves none
        idle: they have use for what it keeps. Each may be done anywhere nevertheless.
    """

    key: str
    output: str
    arguments: Mapping[str, Any]
    fingerprint: str
    columns: Mapping[str, Any] = field(default_factory=dict)
    group: str = ''


class Batch:
    """Jobs and the folder of their results; a context manager that keeps others out of it.

    Parameters
    ----------
    folder : path
        Made if it is not there.
    jobs : sequence of Job
    function : callable
        `function(path, **arguments)` writes a job's result and returns what to tell of it: text,
        numbers, lists of those. It has to be importable by name where the job is run. A
        `FlightdynError` becomes the job's `error`, `code` and `exit_code`; such a job has no
        result, and the next run tries again. One that returns these itself is done.

    Attributes
    ----------
    rows : mapping of key to row
        What is known of each job done so far, whether it went well or not.

    Raises
    ------
    InputError
        If two jobs have a key or an output in common, or the folder cannot be written to or is in
        use by another batch.
    MissingExtraError
        If Dask or pyarrow is not installed.
    """

    def __init__(
        self, folder: str | Path, jobs: Sequence[Job], function: Callable[..., Row]
    ) -> None:
        _check_extra()
        _check_jobs(jobs)
        self.folder = Path(folder).absolute()
        self.jobs, self.function = list(jobs), function
        self.rows: dict[str, Row] = {}
        self._pending: dict[str, Job] = {}

    def __enter__(self) -> 'Batch':
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._journal: TextIO = (self.folder / JOURNAL).open('a+', encoding='utf-8')
        except OSError as error:
            raise InputError(f'cannot write to {self.folder}: {error.strerror}') from None
        try:
            fcntl.flock(self._journal, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._journal.close()
            raise InputError(f'another batch is writing to {self.folder}') from None
        self._clear()
        done = self._read_journal()
        for job in self.jobs:
            fingerprint, row = done.get(job.key, ('', {}))
            if fingerprint == job.fingerprint and (self.folder / job.output).is_file():
                self.rows[job.key] = row
            else:
                self._pending[job.key] = job
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._clear()
        self._journal.close()

    @property
    def pending(self) -> list[Job]:
        """What `run` has to do: new jobs, changed ones, and those that failed."""
        return list(self._pending.values())

    def run(
        self, *, workers: int | None = None, scheduler: str | None = None
    ) -> Generator[Row, None, None]:
        """Do the pending jobs; yield a row as each ends, well or not.

        Parameters
        ----------
        workers : int, optional
            Processes on this machine. Default: one for each core.
        scheduler : str, optional
            Address of a Dask scheduler, such as `tcp://host:8786`, to run on instead. Its workers
            need flightdyn, and the paths of logs and results to be the same there.

        Yields
        ------
        dict
            `key output exit_code code error wall_s`, the job's columns, then what the function
            returned; `output` is None of a job without a result.

        Raises
        ------
        InputError
            If there is no such scheduler.
        FlightdynError
            If the connection to it is lost.
        """
        (self.folder / SUMMARY).unlink(missing_ok=True)  # it tells of whole runs only
        if not self._pending:
            return
        from distributed import as_completed

        queue = _Queue(self.pending)
        with _client(min(workers or _cores(), len(self._pending)), scheduler) as (client, places):
            running: dict[Any, tuple[Job, str, float]] = {}
            completed = as_completed(loop=client.loop)

            def submit() -> None:
                busy = Counter(place for _, place, _ in running.values())
                # with no worker left the next one that comes takes a job
                rooms = places() or {'': 1}
                for place, room in rooms.items():
                    while busy[place] < room and (job := queue.next(place)):
                        future = client.submit(
                            run_job,
                            self.function,
                            str(self.folder),
                            job.output,
                            dict(job.arguments),
                            pure=False,
                            workers=[place] if place else None,
                            allow_other_workers=bool(place),
                        )
                        running[future] = job, place, time.monotonic()
                        busy[place] += 1
                        completed.add(future)

            submit()
            for future in completed:
                job, _, since = running.pop(future)
                row: Row = {'key': job.key, 'output': job.output, 'exit_code': 0}
                row |= {'code': ResultCode.SUCCESS.name, 'error': None}
                row |= {'wall_s': time.monotonic() - since}
                row |= flattened(job.columns) | _outcome(future)
                self._record(job, row)
                submit()
                yield row

    def write_summary(self) -> Path:
        """Write a row for each job to `SUMMARY`, in the order of the jobs; return its path."""
        path = self.folder / SUMMARY
        write_rows([self.rows[job.key] for job in self.jobs if job.key in self.rows], path)
        return path

    def _record(self, job: Job, row: Row) -> None:
        self.rows[job.key] = row
        del self._pending[job.key]
        if row['output'] is not None:
            line = {'key': job.key, 'fingerprint': job.fingerprint, 'row': row}
            self._journal.write(json.dumps(line) + '\n')
            self._journal.flush()
        else:  # of a file that has changed since it was read well
            (self.folder / job.output).unlink(missing_ok=True)

    def _read_journal(self) -> dict[str, tuple[str, Row]]:
        self._journal.seek(0)
        done = {}
        text = self._journal.read()
        for line in text.splitlines():
            try:
                entry = json.loads(line)
                done[entry['key']] = str(entry['fingerprint']), dict(entry['row'])
            except (ValueError, KeyError, TypeError):
                continue  # cut short when the machine went down: that job is done again
        if text and not text.endswith('\n'):
            self._journal.write('\n')
        return done

    def _clear(self) -> None:
        shutil.rmtree(self.folder / _PARTIAL, ignore_errors=True)


class _Queue:
    """Jobs that wait, in groups; a place that does jobs is given those of one group in turn."""

    def __init__(self, jobs: Iterable[Job]) -> None:
        groups: dict[Any, deque[Job]] = {}
        for number, job in enumerate(jobs):
            groups.setdefault(job.group or number, deque()).append(job)
        self._groups = deque(groups.values())
        self._under_way: dict[str, deque[Job]] = {}

    def next(self, place: str) -> Job | None:
        """Return the job that a place does next; None if there is none left."""
        group = self._under_way.get(place)
        if not group:
            if self._groups:
                group = self._groups.popleft()
            else:  # it lends a hand where most is left to do
                group = max(self._under_way.values(), key=len, default=None)
            if not group:
                return None
            self._under_way[place] = group
        return group.popleft()


def run_job(
    function: Callable[..., Row], folder: str, output: str, arguments: dict[str, Any]
) -> Row:
    """Call a job's function, wherever it is run; put its result in place once it is whole."""
    start = time.monotonic()
    target = Path(folder, output)
    # A folder of its own: what a killed process leaves behind is known for what it is.
    partial = Path(folder, _PARTIAL, output)
    found: Row = {}
    try:
        partial.parent.mkdir(parents=True, exist_ok=True)
        target.parent.mkdir(parents=True, exist_ok=True)
        found = function(partial, **arguments)
        os.replace(partial, target)
    except FlightdynError as error:
        found = _failed(error)
    except OSError as error:
        found = _failed(InputError(f'cannot write {target}: {error.strerror or error}'))
    return found | {'wall_s': time.monotonic() - start}


def _failed(error: FlightdynError) -> Row:
    code = error.result_code.name
    return {'output': None, 'exit_code': error.exit_code, 'code': code, 'error': str(error)}


def flattened(document: Mapping[str, Any], prefix: str = '') -> Row:
    """Return a nested mapping as one row, names joined by dots; lists stay as they are."""
    row: Row = {}
    for name, value in document.items():
        if isinstance(value, Mapping):
            row |= flattened(value, f'{prefix}{name}.')
        else:
            row[prefix + name] = value
    return row


def installed_version() -> str:
    """Return flightdyn's version, for fingerprints; empty if it runs from a checkout."""
    try:
        return version('flightdyn')
    except PackageNotFoundError:
        return ''


def write_rows(rows: Iterable[Row], path: Path) -> None:
    """Write rows as a Parquet table; what a row lacks is null."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    rows = list(rows)
    names = list(dict.fromkeys(name for row in rows for name in row))
    columns = {}
    for name in names:
        column = pa.array([row.get(name) for row in rows])
        if pa.types.is_null(column.type):
            column = column.cast(pa.string())
        elif pa.types.is_list(column.type) and pa.types.is_null(column.type.value_type):
            column = column.cast(pa.list_(pa.string()))
        columns[name] = column
    with written_whole(path) as temporary:
        pq.write_table(pa.table(columns), temporary, compression='zstd')


def _outcome(future: Any) -> Row:
    """Return what became of a job: its row, or what ended it."""
    from distributed import KilledWorker

    if future.status == 'finished':
        row: Row = future.result()
        return row
    if future.status != 'error':
        raise FlightdynError(
            'the connection to the Dask scheduler was lost; what is done is kept: run the same '
            'command again to go on'
        )
    error = future.exception()
    if isinstance(error, KilledWorker):
        text = 'the process that ran this was killed: out of memory, or by a signal'
    else:
        text = ' '.join(f'{type(error).__name__}: {error}'.split())
    return _failed(FlightdynError(text))


@contextmanager
def _client(
    workers: int, scheduler: str | None
) -> Iterator[tuple[Any, Callable[[], dict[str, int]]]]:
    """Give a Dask client, and a function that tells how many jobs each worker takes at a time."""
    import dask
    from distributed import Client, LocalCluster

    if scheduler is not None:
        try:
            client = Client(scheduler, timeout=_CONNECT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            told = ' '.join(str(error).split())
            raise InputError(f'no Dask scheduler answers at {scheduler}: {told}') from None
        with client:
            # one to do and one to go on with: a cluster may be far away
            yield client, lambda: {at: 2 * n for at, n in client.nthreads().items()}
        return
    # One job at a time in a worker, and none tried twice: whatever kills a worker is that job.
    settings = {'distributed.scheduler.allowed-failures': 0}
    with (
        dask.config.set(settings),
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            host='127.0.0.1',
            dashboard_address='127.0.0.1:0',
            silence_logs=logging.CRITICAL,
            preload=[_PRELOAD],
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        yield client, lambda: dict.fromkeys(list(cluster.scheduler.workers), 1)


def _cores() -> int:
    return (
        len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity') else os.cpu_count() or 1
    )


def _check_extra() -> None:
    try:
        import distributed  # noqa: F401
        import pyarrow  # noqa: F401
    except ImportError:
        raise MissingExtraError('batch', 'batch') from None


def _check_jobs(jobs: Sequence[Job]) -> None:
    keys: set[str] = set()
    outputs = {SUMMARY, JOURNAL}
    for job in jobs:
        output = PurePosixPath(job.output)
        if output.is_absolute() or '..' in output.parts or output.parts[0] == _PARTIAL:
            raise InputError(f'{job.key}: its result would be outside the folder: {job.output}')
        if job.key in keys or job.output in outputs:
            raise InputError(f'{job.key}: another one would be written to {job.output}, too')
        keys.add(job.key)
        outputs.add(job.output)
