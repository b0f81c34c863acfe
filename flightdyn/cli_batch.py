"""The commands that do many at once: batch replay, batch plan."""

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .console import print_rows
from .errors import EXIT_CODES, ResultCode

if TYPE_CHECKING:
    from .batch import Batch

MAX_TOLD = 20  # failures, one by one; the table has them all


def add_commands(commands: Any, command: Callable[..., argparse.ArgumentParser]) -> None:
    """Add `batch` and what stands behind it to the command line's commands."""
    text = 'Do many at once, on all cores or on a Dask cluster.'
    batch = commands.add_parser('batch', help=text, description=text)
    batches = batch.add_subparsers(required=True, metavar='COMMAND')
    logs = command(
        'replay',
        batch_replay,
        'Replay many flight logs, each into a table; a second run goes on where this one ended.',
        config=False,
        among=batches,
    )
    logs.add_argument('pattern', nargs='+', help="logs, such as 'logs/**/*.mcap'")
    logs.add_argument('--source', metavar='TOPIC', help='use this topic, not the best of each log')
    plans = command(
        'plan',
        batch_plan,
        'Plan a problem over many values; a second run goes on where this one ended.',
        among=batches,
    )
    plans.add_argument('sweep', help='name in config/sweeps, or path of a .yaml file')
    for sub in (logs, plans):
        _add_options(sub)


def _add_options(sub: argparse.ArgumentParser) -> None:
    sub.add_argument(
        '-o',
        '--output',
        required=True,
        metavar='DIR',
        help='folder of the results and of the table of all, summary.parquet',
    )
    where = sub.add_mutually_exclusive_group()
    where.add_argument(
        '--workers', type=_count, metavar='N', help='processes; default: one for each core'
    )
    where.add_argument('--scheduler', metavar='ADDR', help='run on Dask, such as tcp://host:8786')


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f'{text!r} is not a number above 0')
    return int(text)


def batch_replay(arguments: argparse.Namespace) -> int:
    from .batch import Batch
    from .batch_replay import replay_job, replay_jobs

    jobs = replay_jobs(arguments.pattern, arguments.output, source=arguments.source)
    return _run_batch(Batch(arguments.output, jobs, replay_job), 'logs', arguments)


def batch_plan(arguments: argparse.Namespace) -> int:
    from .batch import Batch
    from .batch_plan import check_pictures, draw_pictures, plan_job, sweep_jobs
    from .planning.sweep_file import load_sweep

    sweep = load_sweep(arguments.sweep, arguments.config_dir)
    check_pictures(sweep)
    batch = Batch(arguments.output, sweep_jobs(sweep), plan_job)
    return _run_batch(batch, 'cases', arguments, partial(draw_pictures, sweep))


def _run_batch(
    batch: 'Batch',
    what: str,
    arguments: argparse.Namespace,
    draw: 'Callable[[Batch], Sequence[Path]] | None' = None,
) -> int:
    """Do the jobs of a batch, tell of them, and return the highest exit code.

    Parameters
    ----------
    what : str
        The jobs are called.
    draw : function of a batch
        Called when all is done; writes and returns files.
    """
    from rich.console import Console
    from rich.progress import MofNCompleteColumn, Progress, TimeRemainingColumn

    start = time.monotonic()
    console = Console(stderr=True)
    columns = (*Progress.get_default_columns()[:2], MofNCompleteColumn(), TimeRemainingColumn())
    with batch:
        kept = sum(row['exit_code'] == 0 for row in batch.rows.values())
        before, told = len(batch.rows), 0
        try:
            with (
                Progress(*columns, console=console, disable=not console.is_terminal) as progress,
                closing(
                    batch.run(workers=arguments.workers, scheduler=arguments.scheduler)
                ) as run,
            ):
                task = progress.add_task(what, total=len(batch.jobs), completed=before)
                for row in run:
                    progress.advance(task)
                    if row['error'] is not None:
                        told += 1
                        line = f'flightdyn: {row["key"]}: {row["error"]}'
                        if told == MAX_TOLD:
                            line += ' (more failures are in the table alone)'
                        if told <= MAX_TOLD:
                            progress.console.print(
                                line, markup=False, highlight=False, soft_wrap=True
                            )
        except KeyboardInterrupt:
            print(
                f'flightdyn: interrupted: {len(batch.jobs) - len(batch.pending)} of '
                f'{len(batch.jobs)} {what} are done; run the same command again to go on',
                file=sys.stderr,
            )
            return EXIT_CODES[ResultCode.CANCELLED]
        summary = batch.write_summary()
        drawn = [] if draw is None else draw(batch)
        failed = [row for row in batch.rows.values() if row['exit_code'] != 0]
    figures: dict[str, Any] = {
        what: len(batch.jobs),
        'done': len(batch.jobs) - len(failed) - kept,
        'kept': kept,
        'failed': len(failed),
        'wall_s': time.monotonic() - start,
        'summary': str(summary),
        **({} if draw is None else {'pictures': [str(path) for path in drawn]}),
    }
    if arguments.json:
        print(json.dumps(figures))
    else:
        print_rows(
            [
                (what, str(figures[what])),
                ('  done', str(figures['done'])),
                ('  done before', str(kept)),
                ('  failed', str(len(failed))),
                ('in', f'{figures["wall_s"]:.3g} s'),
                *(('written', str(path)) for path in (summary, *drawn)),
            ]
        )
    return max((row['exit_code'] for row in failed), default=0)
