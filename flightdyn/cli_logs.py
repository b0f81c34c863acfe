"""The commands on flight logs: replay, info, convert, batch replay."""

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import export
from .console import Rows, busy, print_rows
from .errors import EXIT_CODES, FlightdynError, InputError, ResultCode

if TYPE_CHECKING:
    from .batch import Batch


def replay(arguments: argparse.Namespace) -> int:
    for name in arguments.output:
        _check_apart(name, arguments.log)
    return _each(arguments.log, lambda log: _replay_one(log, arguments), arguments.json)


def _replay_one(log: str, arguments: argparse.Namespace) -> tuple[dict[str, Any], Rows]:
    from .logs.any_log import is_mcap
    from .logs.recorded import read_plans
    from .replay import replay_log

    names = [_named(name, log) for name in arguments.output]
    outputs = export.check_outputs(names, export.REPLAY_FORMATS)
    replay = replay_log(
        log,
        source=arguments.source,
        start=arguments.start,
        end=arguments.end,
        wind=arguments.wind,
        flight=arguments.flight,
    )
    summary = replay.summary()
    # our own recordings hold what was meant to be flown
    plans = read_plans(log) if outputs and is_mcap(log) else []
    planned = plans[-1] if plans else None
    flight = replace(replay.trajectory, vehicle=planned.vehicle if planned else '')
    for path in outputs:
        export.write_replay(path, flight, summary, planned=planned, track=replay.track)
    rows = [
        ('source', f'{summary["source"]} ({summary["schema"]})'),
        ('used', f'{summary["used"]} of {summary["messages"]} messages'),
        *((f'  {reason}', str(n)) for reason, n in summary['dropped'].items()),
        ('clock', f"the {summary['clock']}'s"),
        ('segments', str(len(summary['segments']))),
        *_flights(summary['flights']),
        ('duration', f'{summary["duration_s"]:.6g} s'),
        ('distance', f'{summary["distance_m"] / 1e3:.6g} km'),
        ('max speed', f'{summary["max_speed"]:.4g} m/s'),
        ('max altitude', _altitude(summary)),
        *_wind(summary['wind']),
        *(('written', str(path)) for path in outputs),
    ]
    return summary, rows


def _each(
    logs: Sequence[str], do: 'Callable[[str], tuple[dict[str, Any], Rows]]', as_json: bool
) -> int:
    """Do something with each log and print what comes of it; a bad log stops no other.

    Returns
    -------
    int
        The highest exit code.
    """
    results: list[dict[str, Any]] = []
    code = 0
    for log in logs:
        try:
            with busy(log):
                result, rows = do(log)
        except FlightdynError as error:
            if len(logs) == 1:
                raise
            print(f'flightdyn: {error}', file=sys.stderr)
            code = max(code, error.exit_code)
            results.append({'file': log, 'error': str(error), 'exit_code': error.exit_code})
            continue
        for warning in result['warnings']:
            print(f'flightdyn: {log}: warning: {warning}', file=sys.stderr)
        results.append(result)
        if not as_json:
            if len(logs) > 1:
                print(f'{log}:')
            print_rows(rows)
    if as_json:
        print(json.dumps(results[0] if len(logs) == 1 else results))
    return code


def _named(name: str, log: str) -> str:
    return name.replace('{log}', Path(log).stem)


def _check_apart(name: str, logs: Sequence[str]) -> None:
    if len(logs) > 1 and '{log}' not in name:
        suffix = Path(name).suffix
        raise InputError(
            f"several logs need '{{log}}' in the output name, such as {{log}}{suffix}"
        )
    names = [_named(name, log) for log in logs]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f'several logs would be written to {twice}: their names must differ')


def _flights(found: list[dict[str, Any]]) -> list[tuple[str, str]]:
    return [
        (
            f'flight {number}',
            f'{"take-off" if flight["takeoff"] else "in flight from"} {flight["start"]:.6g} s, '
            f'{"landing" if flight["landing"] else "in flight to"} {flight["end"]:.6g} s',
        )
        for number, flight in enumerate(found, 1)
    ]


def _wind(found: dict[str, Any] | None) -> list[tuple[str, str]]:
    if found is None:
        return []
    text = f'{found["speed"]:.3g} m/s from {found["from_deg"]:.0f} deg, +-{found["std"]:.2g} m/s'
    return [('wind', f'{text} ({found["method"]})')]


def _altitude(summary: dict[str, Any]) -> str:
    return f'{summary["max_altitude"]:.6g} m ({summary["altitude_datum"]})'


def batch_replay(arguments: argparse.Namespace) -> int:
    from .batch import Batch
    from .batch_replay import replay_job, replay_jobs

    jobs = replay_jobs(arguments.pattern, arguments.output, source=arguments.source)
    return _run_batch(Batch(arguments.output, jobs, replay_job), 'logs', arguments)


def _run_batch(batch: 'Batch', what: str, arguments: argparse.Namespace) -> int:
    from rich.console import Console
    from rich.progress import MofNCompleteColumn, Progress, TimeRemainingColumn

    start = time.monotonic()
    console = Console(stderr=True)
    columns = (*Progress.get_default_columns()[:2], MofNCompleteColumn(), TimeRemainingColumn())
    with batch:
        kept = len(batch.rows)
        try:
            with (
                Progress(*columns, console=console, disable=not console.is_terminal) as progress,
                closing(
                    batch.run(workers=arguments.workers, scheduler=arguments.scheduler)
                ) as run,
            ):
                task = progress.add_task(what, total=len(batch.jobs), completed=kept)
                for row in run:
                    progress.advance(task)
                    if row['error'] is not None:
                        line = f'flightdyn: {row["key"]}: {row["error"]}'
                        progress.console.print(line, markup=False, highlight=False, soft_wrap=True)
        except KeyboardInterrupt:
            print(
                f'flightdyn: interrupted: {len(batch.jobs) - len(batch.pending)} of '
                f'{len(batch.jobs)} {what} are done; run the same command again to go on',
                file=sys.stderr,
            )
            return EXIT_CODES[ResultCode.CANCELLED]
        summary = batch.write_summary()
        failed = [row for row in batch.rows.values() if row['exit_code'] != 0]
    figures = {
        what: len(batch.jobs),
        'done': len(batch.jobs) - len(failed) - kept,
        'kept': kept,
        'failed': len(failed),
        'wall_s': time.monotonic() - start,
        'summary': str(summary),
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
                ('written', str(summary)),
            ]
        )
    return max((row['exit_code'] for row in failed), default=0)


def info(arguments: argparse.Namespace) -> int:
    return _each(arguments.log, _info_one, arguments.json)


def _info_one(log: str) -> tuple[dict[str, Any], Rows]:
    from .logs.any_log import describe

    info = describe(log).to_dict()
    rows = [
        (t['topic'], t['schema'], str(t['messages']), t['kind'] if t['usable'] else '-')
        for t in info['topics']
    ]
    return info, [('topic', 'schema', 'messages', 'replay as'), *rows]


def convert(arguments: argparse.Namespace) -> int:
    _check_apart(arguments.output, arguments.log)
    return _each(arguments.log, lambda log: _convert_one(log, arguments), arguments.json)


def _convert_one(log: str, arguments: argparse.Namespace) -> tuple[dict[str, Any], Rows]:
    from .logs.convert import convert

    summary = convert(log, _named(arguments.output, log), arguments.source)
    rows = [
        ('format', summary['format']),
        ('source', f'{summary["source"]} ({summary["schema"]})'),
        ('used', f'{summary["used"]} of {summary["messages"]} messages'),
        *((f'  {reason}', str(n)) for reason, n in summary['dropped'].items()),
        ('altitude', summary['altitude_datum']),
        *((t['topic'], f'{t["schema"]}, {t["messages"]}') for t in summary['topics']),
        ('written', summary['output']),
    ]
    return summary, rows
