"""Plans of flightdyn beside AeroSandbox's of the same problems, in the same run.

Run: python benchmarks/planning.py [--cases CASE ...] [--runs N] [--json]. Shown are

- figures: what the textbook's cases come to, on its meshes and converged;
- speed: cold, from the problem's guess, and warm, from a plan with another start; the solve alone
  and the whole request, which flies each plan again, as AeroSandbox leaves to its user. Ratios are
  of processor time: AeroSandbox's `opti.solve()`, and with stating the problem, over our solves;
- growth: what an iteration costs on more and more nodes;
- accuracy: how far shipped plans are off when flown again, and tables off what they are of.

AeroSandbox states the problems by trapezoidal collocation on the textbook's meshes, with
AeroBuildup in the loop; ours are the shipped ones as they are. Each pair of a run is three solves
of ours, one of AeroSandbox's, and three of ours again, in one process and on one thread; printed
are medians over the pairs. AeroSandbox takes a quarter of a minute for a glide or a turnback.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

CASES = ('glide', 'turnback', 'flip', 'rocket')
PARTS = ('figures', 'speed', 'growth', 'accuracy')
AERODYNAMIC = ('glide', 'turnback')
MEASURES = Path(__file__).with_name('support') / 'planning_measures.py'
ROCKET_INFIMUM = 198_686.24383320266  # kg: an impulse at the start, by the rocket equation
TURNBACK = 45.641  # m: Radau collocation with AeroBuildup itself on 60 to 150 intervals

LEAST_RATIO = {'glide': 400, 'turnback': 500, 'flip': 10, 'rocket': 2}
LEAST_RATIO_INTERPRETED = 150
MOST_WARM = {'glide': 0.025, 'turnback': 0.015}
MOST_REQUEST = {'glide': 0.150}
MOST_FIRST = 10.0  # s

Show = Callable[[Any], list[Table]]


def measure(name: str, *arguments: str, **environment: str) -> Any:
    """Return what a measure finds, on one thread in a process of its own."""
    done = subprocess.run(
        [sys.executable, '-W', 'ignore', str(MEASURES), name, *arguments],
        env={**os.environ, 'OMP_NUM_THREADS': '1', **environment},
        stdout=subprocess.PIPE,
        check=True,
    )
    return json.loads(done.stdout.splitlines()[-1])


# ---------------------------------------------------------------------- figures


def figures(cases: list[str], runs: int, step: Callable[[str], None]) -> list[dict[str, Any]]:
    """Return rows of what, value, unit, expected, met."""
    step('figures')
    rows = measure('figures')
    for row in rows:
        row['met'] = abs(row['value'] - row['expected']) <= row.pop('within')
    step('rocket on finer meshes')
    fuel = measure('rocket')
    over = [each['value'] / ROCKET_INFIMUM - 1 for each in fuel]
    for each, part in zip(fuel, over, strict=True):
        rows.append(
            {'what': f'rocket, {each["nodes"]} intervals', 'value': each['value'], 'unit': 'kg'}
            | {'expected': ROCKET_INFIMUM, 'met': each['verified'] and part >= 0}
        )
    rows[-1]['met'] = rows[-1]['met'] and over[-1] < 1e-3
    step('turnback from ten guesses')
    for each in measure('starts', 'turnback'):
        met = each['verified'] and abs(each['value'] - TURNBACK) < 0.01
        rows.append(
            {'what': f'turnback, guess {each["seed"]}', 'value': each['value'], 'unit': 'm'}
            | {'expected': TURNBACK, 'met': met, 'iterations': each['iterations']}
        )
    return rows


def show_figures(rows: list[dict[str, Any]]) -> list[Table]:
    table = _table('figures', 'found', 'expected', '')
    for row in rows:
        found, expected = (f'{row[key]:,.7g} {row["unit"]}' for key in ('value', 'expected'))
        table.add_row(row['what'], found, expected, _mark(row['met']))
    return [table]


# ---------------------------------------------------------------------- speed


def speed(cases: list[str], runs: int, step: Callable[[str], None]) -> list[dict[str, Any]]:
    """Return a row for each case: medians [s] and ratios."""
    rows = []
    for case in cases:
        step(f'speed: {case}')
        found = measure('speed', case, str(runs))
        row = {'case': case, **_ratios(found['pairs'])}
        for name, several in (('warm', found['warm']), ('request', found['requests'])):
            for key in ('solve_s', 'solve_cpu_s', 'whole_s', 'whole_cpu_s', 'iterations'):
                row[f'{name}_{key}'] = _median(several, key)
            row[f'{name}_verified'] = all(each['verified'] for each in several)
        step(f'first build: {case}')
        with tempfile.TemporaryDirectory() as empty:
            row['first_s'] = measure('alone', case, '1', XDG_CACHE_HOME=empty)['first']['whole_s']
            if case in AERODYNAMIC:
                step(f'without a compiler: {case}')
                # no programme is found on such a path, so no compiler either
                cold = measure('alone', case, str(runs), PATH=empty)['cold']
                row['interpreted_solve_cpu_s'] = _median(cold, 'solve_cpu_s')
                row['interpreted_ratio'] = row['peer_solve_cpu_s'] / row['interpreted_solve_cpu_s']
        rows.append(row)
    return rows


def _ratios(pairs: list[dict[str, Any]]) -> dict[str, Any]:
    row: dict[str, Any] = {}
    ours = [each for pair in pairs for each in pair['ours']]
    peer = [each for pair in pairs for each in pair['peer']]
    for key in ('solve_s', 'solve_cpu_s', 'whole_s', 'whole_cpu_s', 'iterations', 'value'):
        row[f'cold_{key}'] = _median(ours, key)
    for key in ('build_s', 'solve_s', 'solve_cpu_s', 'total_cpu_s', 'value'):
        row[f'peer_{key}'] = _median(peer, key)

    def ratio(theirs: str, own: str) -> float:
        return statistics.median(
            _median(pair['peer'], theirs) / _median(pair['ours'], own) for pair in pairs
        )

    row['cold_verified'] = all(each['verified'] for each in ours)
    row['ratio'] = ratio('solve_cpu_s', 'solve_cpu_s')
    row['ratio_with_statement'] = ratio('total_cpu_s', 'solve_cpu_s')
    row['ratio_of_request'] = ratio('solve_cpu_s', 'whole_cpu_s')
    return row


def show_speed(rows: list[dict[str, Any]]) -> list[Table]:
    against = _table(
        'cold, processor time',
        *('solve, ms', 'request, ms', 'AeroSandbox, ms', 'ratio', '', 'with build', 'request'),
        *('no compiler, ms', 'ratio', ''),
    )
    alone = _table(
        'flightdyn alone, by the clock',
        *('cold solve, ms', 'request', 'warm solve, ms', '(iterations)', '', 'request', ''),
        *('from YAML, ms', '', 'first ever, s', ''),
    )
    for row in rows:
        case = row['case']
        interpreted = ('-', '', '')
        if 'interpreted_ratio' in row:
            least = LEAST_RATIO_INTERPRETED
            interpreted = (
                _ms(row['interpreted_solve_cpu_s']),
                f'{row["interpreted_ratio"]:.0f}',
                _mark(row['interpreted_ratio'] >= least, f'>= {least}'),
            )
        against.add_row(
            case,
            _ms(row['cold_solve_cpu_s']),
            _ms(row['cold_whole_cpu_s']),
            _ms(row['peer_solve_cpu_s']),
            f'{row["ratio"]:.1f}',
            _mark(row['ratio'] >= LEAST_RATIO[case], f'>= {LEAST_RATIO[case]}'),
            f'{row["ratio_with_statement"]:.1f}',
            f'{row["ratio_of_request"]:.1f}',
            *interpreted,
        )
        alone.add_row(
            case,
            _ms(row['cold_solve_s']),
            _ms(row['cold_whole_s']),
            _ms(row['warm_solve_s']),
            f'{row["warm_iterations"]:.0f}',
            _limit(row['warm_solve_s'], MOST_WARM.get(case)),
            _ms(row['warm_whole_s']),
            _mark(row['warm_verified'], 'verified'),
            _ms(row['request_whole_s']),
            _limit(row['request_whole_s'], MOST_REQUEST.get(case)),
            f'{row["first_s"]:.2f}',
            _limit(row['first_s'], MOST_FIRST),
        )
    return [against, alone]


# ---------------------------------------------------------------------- growth and accuracy


def growth(cases: list[str], runs: int, step: Callable[[str], None]) -> dict[str, Any]:
    """Return rows of each case by number of nodes."""
    found = {}
    for case in cases:
        step(f'growth: {case}')
        found[case] = measure('growth', case)
    return found


def show_growth(found: dict[str, Any]) -> list[Table]:
    counts = [row['nodes'] for row in next(iter(found.values()), [])]
    table = _table('µs an iteration and node', *(f'{n} nodes' for n in counts))
    for case, rows in found.items():
        table.add_row(case, *(f'{row["iteration_and_node_s"] * 1e6:.0f}' for row in rows))
    return [table]


def accuracy(cases: list[str], runs: int, step: Callable[[str], None]) -> dict[str, Any]:
    """Return the errors of each case."""
    found = {}
    for case in cases:
        step(f'accuracy: {case}')
        found[case] = measure('accuracy', case)
    return found


def show_accuracy(found: dict[str, Any]) -> list[Table]:
    table = _table(
        'flown again', 'worst error / range', 'tolerance', '', 'CL of table', 'CD of table', 'by'
    )
    for case, each in found.items():
        worst = max(each['relative'], key=each['relative'].get)
        table.add_row(
            case,
            f'{each["relative"][worst]:.1e} ({worst})',
            f'{each["tolerance"]:.0e}',
            _mark(each['verified'], 'verified'),
            *(f'{each["table"][k]:.1e}' if 'table' in each else '-' for k in ('CL', 'CD')),
            each['transcription'],
        )
    return [table]


# ---------------------------------------------------------------------- the rest


def _median(several: list[dict[str, Any]], key: str) -> float:
    return statistics.median(each[key] for each in several)


def _table(title: str, *columns: str) -> Table:
    table = Table(box=box.SIMPLE)
    table.add_column(title)
    for column in columns:
        table.add_column(column, justify='right')
    return table


def _ms(seconds: float) -> str:
    return f'{seconds * 1e3:.1f}'


def _mark(met: bool, what: str = '') -> str:
    return f'[green]{what or "yes"}[/]' if met else f'[red]not {what or "met"}[/]'


def _limit(seconds: float, most: float | None) -> str:
    return '' if most is None else _mark(seconds <= most, f'<= {most:g} s')


RUN: dict[str, tuple[Callable[..., Any], Show]] = {
    'figures': (figures, show_figures),
    'speed': (speed, show_speed),
    'growth': (growth, show_growth),
    'accuracy': (accuracy, show_accuracy),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--cases', nargs='+', choices=CASES, default=list(CASES))
    parser.add_argument('--parts', nargs='+', choices=PARTS, default=list(PARTS))
    parser.add_argument('--runs', type=int, default=1, help='pairs of ours and AeroSandbox (1)')
    parser.add_argument('--json', action='store_true', help='print JSON instead of tables')
    options = parser.parse_args()
    results, console = {}, Console(width=150)
    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task('', total=None)
        for part in options.parts:
            results[part] = RUN[part][0](
                options.cases, options.runs, lambda what: progress.update(task, description=what)
            )
    if options.json:
        print(json.dumps(results, indent=1))
        return
    for part, found in results.items():
        for table in RUN[part][1](found):
            console.print(table)


if __name__ == '__main__':
    main()
