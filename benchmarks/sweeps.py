"""A sweep of 400 cases: throughput against one solve after the other, and what a kill costs.

Run: python benchmarks/sweeps.py [--sweep NAME] [--steps N] [--cold K] [--workers N] [--json].
Done are

- cold: every K-th case, each from its own guess, in one process, programmes kept between them:
  what a loop over a planner does;
- serial: all cases of the sweep one after the other in one process, near their neighbours;
- batch: the sweep on N processes, as `flightdyn batch plan` does it, Dask and files included;
- killed: the same, killed (SIGKILL, all processes at once) with half of the cases done, and
  resumed.

Checked are that both tables are the serial one's but for its times, and that what was done before
the kill was not done again. Wall times tell nothing on a machine with other work to do; processor
times, also shown, do.
"""

import argparse
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ.setdefault('OMP_NUM_THREADS', '1')

from rich import box
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from flightdyn.batch import JOURNAL, SUMMARY
from flightdyn.batch_plan import plan_job, sweep_jobs
from flightdyn.config import load_yaml
from flightdyn.planning.planner import Planner
from flightdyn.planning.sweep import Sweep
from flightdyn.planning.sweep_file import load_sweep
from flightdyn.resources import find_config
from flightdyn.tables import read_table

Row = dict[str, Any]
Step = Callable[[str], None]


def prepared(name: str, steps: int, folder: Path) -> Path:
    """Write a shipped sweep with so many steps along each parameter; return its file."""
    document = load_yaml(find_config('sweeps', name))
    for given in document['over'].values():
        given['steps'] = steps
    path = folder / 'sweep.yaml'
    path.write_text(json.dumps(document))
    return path


def cold(sweep: Sweep, every: int) -> Row:
    cases, planner = list(sweep.cases())[::every], Planner()
    planner.plan(sweep.load(cases[0]))  # what is built once counts for none
    wall, cpu = time.perf_counter(), time.process_time()
    verified = sum(planner.plan(sweep.load(case)).report.verified for case in cases)
    return _row('cold', len(cases), verified, wall, time.process_time() - cpu)


def serial(sweep: Sweep, folder: Path) -> tuple[Row, dict[str, Row]]:
    rows = {}
    (folder / 'plans').mkdir()
    wall, cpu = time.perf_counter(), time.process_time()
    for job in sweep_jobs(sweep):
        rows[job.key] = plan_job(folder / job.output, **job.arguments)
    verified = sum(row['verified'] for row in rows.values())
    return _row('serial', len(rows), verified, wall, time.process_time() - cpu), rows


def batch(path: Path, folder: Path, workers: int) -> Row:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    wall = time.perf_counter()
    figures = json.loads(
        subprocess.run(_command(path, folder, workers), stdout=subprocess.PIPE).stdout
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    row = _row('batch', figures['cases'], figures['done'], wall, cpu)
    return row | {'largest_process_mb': after.ru_maxrss / 1024}


def killed(path: Path, folder: Path, workers: int, half: int) -> Row:
    """Break a run off with half of the cases done; return how many the next one did."""
    process = subprocess.Popen(
        _command(path, folder, workers), stdout=subprocess.DEVNULL, start_new_session=True
    )
    journal = folder / JOURNAL
    while process.poll() is None and not (journal.exists() and _lines(journal) >= half):
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    done = _lines(journal)
    times = {each: each.stat().st_mtime_ns for each in (folder / 'plans').iterdir()}
    wall = time.perf_counter()
    again = json.loads(
        subprocess.run(_command(path, folder, workers), stdout=subprocess.PIPE).stdout
    )
    touched = sum(each.stat().st_mtime_ns != at for each, at in times.items())
    return {
        'what': 'killed and resumed', 'done_before': done, 'kept': again['kept'],
        'done_after': again['done'], 'done_twice': touched, 'wall_s': time.perf_counter() - wall,
    }  # fmt: skip


def differences(rows: dict[str, Row], folder: Path) -> int:
    """Return how many cells of a table but its times are not the serial run's, bit for bit."""
    table = read_table(folder / SUMMARY)[0]
    count = 0
    for number, key in enumerate(table['key']):
        for name, value in rows[key].items():
            if name in table and name not in ('wall_s', 'warnings'):
                found = table[name][number]
                count += not (found == value or (value is None and found != found))
    return count


def _command(path: Path, folder: Path, workers: int) -> list[str]:
    command = [
        sys.executable,
        '-m',
        'flightdyn',
        'batch',
        'plan',
        str(path),
        '-o',
        str(folder),
    ]
    return [*command, '--workers', str(workers), '--json']


def _lines(path: Path) -> int:
    return path.read_text(encoding='utf-8').count('\n')


def _row(what: str, cases: int, verified: int, since: float, cpu: float) -> Row:
    wall = time.perf_counter() - since
    return {'what': what, 'cases': cases, 'verified': verified, 'wall_s': wall, 'cpu_s': cpu}


def run(name: str, steps: int, every: int, workers: int, step: Step) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        path = prepared(name, steps, folder)
        sweep = load_sweep(str(path))
        step('cold')
        rows = [cold(sweep, every)]
        step('serial')
        (folder / 'serial').mkdir()
        row, results = serial(sweep, folder / 'serial')
        rows.append(row)
        step('batch')
        rows.append(batch(path, folder / 'batch', workers))
        step('killed')
        resumed = killed(path, folder / 'killed', workers, sweep.samples // 2)
        each = {row['what']: row['wall_s'] / row['cases'] for row in rows}
        each_cpu = {row['what']: row['cpu_s'] / row['cases'] for row in rows}
        starts = [row['start'] for row in results.values()]
        return {
            'sweep': name,
            'runs': rows,
            'near': starts.count('near') / len(starts),
            'ratio': each['cold'] / each['batch'],
            'cpu_ratio': each_cpu['cold'] / each_cpu['batch'],
            'cores_used': rows[2]['cpu_s'] / rows[2]['wall_s'],
            'resumed': resumed,
            'differ': {
                'batch': differences(results, folder / 'batch'),
                'killed': differences(results, folder / 'killed'),
            },
        }


def show(found: dict[str, Any]) -> Table:
    table = Table(title=f'{found["sweep"]}', box=box.SIMPLE)
    for column in (
        '',
        'cases',
        'well',
        'wall [s]',
        'cpu [s]',
        'wall a case [ms]',
        'cpu a case [ms]',
    ):
        table.add_column(column, justify='left' if not column else 'right')
    for row in found['runs']:
        times = (row['wall_s'], row['cpu_s'])
        table.add_row(
            row['what'], str(row['cases']), str(row['verified']), *(f'{t:.1f}' for t in times),
            *(f'{1e3 * t / row["cases"]:.0f}' for t in times),
        )  # fmt: skip
    return table


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--sweep', default='cessna152_glide_range', help='one over two ranges')
    parser.add_argument('--steps', type=int, default=20, help='along each parameter')
    parser.add_argument('--cold', type=int, default=4, metavar='K', help='every K-th case')
    parser.add_argument('--workers', type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument('--json', action='store_true')
    arguments = parser.parse_args()
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task('', total=4)

        def step(text: str) -> None:
            progress.update(task, description=text, advance=1)

        found = run(arguments.sweep, arguments.steps, arguments.cold, arguments.workers, step)
    resumed, differ = found['resumed'], found['differ']
    met = not any(differ.values()) and resumed['done_twice'] == 0
    met = met and resumed['kept'] == resumed['done_before']
    if arguments.json:
        print(json.dumps(found | {'met': met}))
    else:
        out = Console()
        out.print(show(found))
        out.print(
            f'{100 * found["near"]:.0f} % started near a neighbour. Batch over cold: '
            f'{found["ratio"]:.2f} times the throughput, {found["cpu_ratio"]:.2f} by processor '
            f'time; {found["cores_used"]:.2f} of {arguments.workers} cores used; largest process '
            f'{found["runs"][2]["largest_process_mb"]:.0f} MB.\n'
            f'Killed with {resumed["done_before"]} done: {resumed["kept"]} kept, '
            f'{resumed["done_after"]} done after, {resumed["done_twice"]} twice. '
            f'Cells that differ from the serial run: {differ["batch"]}, '
            f'after the kill {differ["killed"]}.'
        )
    return 0 if met else 1


if __name__ == '__main__':
    sys.exit(main())
