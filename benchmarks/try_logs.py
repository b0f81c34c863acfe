"""How `flightdyn replay` fares with every log of a folder, each in a limited process.

Run: python benchmarks/try_logs.py [FOLDER] [--memory MB] [--time S]. Prints a table, and beside it
what the folder's MANIFEST.json expects, if there is one: a list of objects with `file` and, where
known, `good_tool_must` (words), `messages` and `max_ground_speed_mps_recorded`.

Wrong is, with any log: to end by anything but exit code 0 or 2, without exactly one line of error
with 2, with a traceback, figures that are no numbers, messages neither used nor counted as
dropped, or beyond a limit. Exits with 1 if anything was wrong.
"""

import argparse
import json
import math
import os
import resource
import subprocess
import sys
import tempfile
import textwrap
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

DATA = Path(__file__).parents[1] / 'test' / 'data'
MAY_FAIL = 2
"""Exit code for input that cannot be used."""


@dataclass
class Trial:
    """What became of one log."""

    log: Path
    exit_code: int
    seconds: float
    megabytes: float
    told: list[str]
    summary: dict[str, Any]
    wrong: list[str] = field(default_factory=list)


def try_log(log: Path, megabytes: int, seconds: float) -> Trial:
    """Replay one log in a process that may not take more memory or time."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_DATA, (megabytes * 2**20,) * 2)

    command = [sys.executable, '-m', 'flightdyn', 'replay', str(log), '--json']
    start = time.monotonic()
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        process = subprocess.Popen(command, stdout=out, stderr=err, preexec_fn=limit)
        late = False
        while True:
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
            if pid:
                break
            if not late and time.monotonic() - start > seconds:
                late = True
                process.kill()
            time.sleep(0.01)
        process.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        err.seek(0)
        told = err.read().decode('utf-8', 'replace').strip().splitlines()
        printed = out.read()
    taken = time.monotonic() - start
    summary = json.loads(printed) if printed.strip() else {}
    trial = Trial(log, process.returncode, taken, usage.ru_maxrss / 1024, told, summary)
    if late:
        trial.wrong.append(f'took more than {seconds:g} s')
    check(trial)
    return trial


def check(trial: Trial) -> None:
    """Note what no log may lead to."""
    if trial.exit_code not in (0, MAY_FAIL):
        trial.wrong.append(f'exit code {trial.exit_code}')
    if any(line.startswith('Traceback') for line in trial.told):
        trial.wrong.append('a traceback')
    if trial.exit_code == MAY_FAIL and len(trial.told) != 1:
        trial.wrong.append(f'{len(trial.told)} lines of error')
    if trial.exit_code == 0:
        figures = [trial.summary.get(name) for name in ('duration_s', 'distance_m', 'max_speed')]
        if not all(isinstance(x, float) and math.isfinite(x) for x in figures):
            trial.wrong.append('figures that are no numbers')
        dropped = sum(trial.summary.get('dropped', {}).values())
        if not trial.summary.get('used'):
            trial.wrong.append('an empty result')
        # values left out of a message that is used otherwise are counted, too
        if trial.summary['used'] + dropped < trial.summary['messages']:
            trial.wrong.append('messages lost')


def manifest(folder: Path) -> dict[str, dict[str, Any]]:
    """Return what a folder's manifest says, by file."""
    path = folder / 'MANIFEST.json'
    if not path.is_file():
        return {}
    return {entry['file']: entry for entry in json.loads(path.read_text(encoding='utf-8'))}


def show(trial: Trial, expected: dict[str, Any]) -> None:
    """Print a trial's row, what it told, and what was expected."""
    figures = trial.summary
    used = f'{figures["used"]}/{figures["messages"]}' if figures else '-'
    speed = f'{figures["max_speed"]:.1f}' if figures else '-'
    recorded = expected.get('max_ground_speed_mps_recorded')
    if recorded is not None:
        speed += f' ({recorded:.1f})'
    print(
        f'{trial.log.name:<44} {trial.exit_code:>4} {trial.seconds:>6.2f} '
        f'{trial.megabytes:>6.0f} {used:>12} {speed:>15}  {"; ".join(trial.wrong) or "ok"}'
    )
    for line in trial.told:
        print('    ' + textwrap.shorten(line.replace(str(trial.log), 'LOG'), 160))
    if figures.get('dropped'):
        print('    dropped: ' + ', '.join(f'{n} {why}' for why, n in figures['dropped'].items()))
    if 'good_tool_must' in expected:
        print('    expected: ' + textwrap.shorten(expected['good_tool_must'], 250))


def main() -> int:
    """Try every log of a folder; return 1 if anything was wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').splitlines()[0])
    parser.add_argument('folder', type=Path, nargs='?', default=DATA, help='default: test/data')
    parser.add_argument('--memory', type=int, default=500, metavar='MB', help='default: 500')
    parser.add_argument('--time', type=float, default=60, metavar='S', help='default: 60')
    arguments = parser.parse_args()
    known = manifest(arguments.folder)
    logs = sorted(
        path
        for path in arguments.folder.iterdir()
        if path.name in known or (not known and path.suffix == '.mcap')
    )
    print(
        f'{"log":<44} {"exit":>4} {"s":>6} {"MB":>6} {"used":>12} {"m/s (recorded)":>15}  verdict'
    )
    trials = []
    for log in logs:
        trials.append(try_log(log, arguments.memory, arguments.time))
        show(trials[-1], known.get(log.name, {}))
    wrong = sum(bool(trial.wrong) for trial in trials)
    print(
        f'{len(trials)} logs, {wrong} wrong; at most {max(t.seconds for t in trials):.1f} s and '
        f'{max(t.megabytes for t in trials):.0f} MB'
        if trials
        else f'no logs in {arguments.folder}'
    )
    return 1 if wrong or not trials else 0


if __name__ == '__main__':
    sys.exit(main())
