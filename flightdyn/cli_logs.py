"""The commands on flight logs: replay, info, convert."""

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from . import export
from .console import Rows, busy, print_rows
from .errors import FlightdynError, InputError


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
