"""How reliably plans come out: random problems, cancelling, many threads.

Run: python benchmarks/robustness.py [--problem NAME ...] [--cases N] [--json]. Of each problem
random ones are drawn, the same each time, see `RANGES`; a problem keeps its shipped guess. Each is
planned as it is; the best of that and of plans from several guesses is the reference.
Then plans are cancelled at several moments, and fifty are made at once in threads, which must
give what they give one by one, bit for bit.
"""

import argparse
import json
import multiprocessing
import os
import threading
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn
from rich.table import Table

from flightdyn.errors import ResultCode
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem import Problem
from flightdyn.planning.problem_file import load_problem
from flightdyn.planning.report import Plan
from flightdyn.resources import list_configs

PROBLEMS = {
    'glide': 'cessna152_glide',
    'turnback': 'cessna152_turnback',
    'flip': 'quadcopter_flip',
}

RANGES: dict[str, dict[str, tuple[float, float]]] = {
    # any cruise, up to short of the height that its table of aerodynamics ends at
    'glide': {
        'initial.altitude': (300, 2500),
        'initial.speed': (30, 70),
        'initial.gamma': (-0.15, 0.15),
        'wind.north': (-8, 8),
        'wind.down': (-0.5, 0.5),
    },
    # from height enough, to near the start and near the opposite track, not much slower
    'turnback': {
        'initial.altitude': (120, 300),
        'initial.airspeed': (28, 40),
        'initial.gamma': (-0.05, 0.12),
        'final.x_e': (-100, 100),
        'final.y_e': (-30, 30),
        'final.track': (np.pi - 0.35, np.pi + 0.35),
        'slower': (0.85, 1.0),
        'wind.north': (-5, 5),
        'wind.east': (-5, 5),
    },
    # ahead and behind, up and down, from slow flight in any direction
    'flip': {
        'initial.u_b': (-0.5, 0.5),
        'initial.w_b': (-0.5, 0.5),
        'initial.q': (-1.0, 1.0),
        'final.x_e': (-2.0, 3.0),
        'final.z_e': (-1.0, 1.0),
    },
}
"""Drawn evenly between these, SI; `slower` is the least final airspeed over the initial one."""

FLOORS = {'glide': 1.0, 'turnback': 10.0, 'flip': 0.1}
"""What a gap is measured by at least: heights lost may be next to nothing in the wind."""

GUESSES = 6  # beside a problem's own
PATIENCE = 600.0  # s, for all guesses together
CLOSE = 0.01
LEAST_VERIFIED, LEAST_CLOSE = 0.98, 0.95
MOST_LATENCY = 0.5  # s
MOMENTS = (0.0, 0.2, 0.4, 0.6, 0.8)  # of a first request, at which one is cancelled
AT_ONCE = 50


def drawn(name: str, index: int) -> Problem:
    """Return a random problem."""
    rng = np.random.default_rng([sorted(PROBLEMS).index(name), index])
    problem = load_problem(PROBLEMS[name])
    values = {key: float(rng.uniform(*limits)) for key, limits in RANGES[name].items()}

    def fixed(group: str) -> dict[str, tuple[float, float]]:
        return {
            key.removeprefix(group): (value, value)
            for key, value in values.items()
            if key.startswith(group)
        }

    final = fixed('final.')
    if 'slower' in values:
        final['airspeed'] = (values['slower'] * values['initial.airspeed'], np.inf)
    wind = tuple(values.get(f'wind.{axis}', 0.0) for axis in ('north', 'east', 'down'))
    return problem.with_changes(initial=fixed('initial.'), final=final, wind_ned=wind)


def planned(planner: Planner, problem: Problem) -> Plan:
    """Return what a user gets."""
    return planner.plan(problem)


@cache
def _planner() -> Planner:
    """The one of a worker process."""
    return Planner()


def compare(name: str, index: int) -> dict[str, Any]:
    """Return how the plan of a random problem ended, and how far it is from the best found."""
    problem, planner = drawn(name, index), _planner()
    start = time.process_time()
    report = planned(planner, problem).report
    spent = time.process_time() - start
    reference = replace(problem, max_wall_time=PATIENCE)
    several = planner.plan(reference, multistart=1 + GUESSES, seed=index)
    sign = problem.objective.sign
    reports = [report, several.report, *(other.report for other in several.others)]
    found = [sign * each.objective for each in reports if each.verified]
    best = min(found, default=np.nan)
    gap = (sign * report.objective - best) / max(abs(best), FLOORS[name])
    return {
        'problem': name,
        'index': index,
        'code': report.code.name,
        'verified': report.verified,
        'objective': report.objective,
        'best': sign * best if found else None,
        'gap': float(gap) if report.verified else None,
        'message': report.message,
        'remedies': report.remedies,
        'cpu_s': spent,
        'optima': len(found) - report.verified,
    }


def robustness(names: list[str], cases: int, step: Callable[[str], None]) -> list[dict[str, Any]]:
    """Return what came of each random problem."""
    context, found = multiprocessing.get_context('spawn'), []
    with ProcessPoolExecutor(2, mp_context=context) as pool:
        runs = [pool.submit(compare, name, i) for name in names for i in range(cases)]
        for run in as_completed(runs):
            found.append(run.result())
            step('random problems')
    return sorted(found, key=lambda each: (each['problem'], each['index']))


def latencies(step: Callable[[str], None]) -> list[dict[str, Any]]:
    """Return how long each shipped problem goes on after it was told to stop [s]."""
    found = []
    for name in list_configs('problems'):
        problem = load_problem(name)
        start = time.perf_counter()
        Planner().plan(problem)
        whole, times = time.perf_counter() - start, []
        for moment in MOMENTS:
            stop = threading.Event()
            with ThreadPoolExecutor(1) as pool:
                run = pool.submit(Planner().plan, problem, should_stop=stop.is_set)
                time.sleep(moment * whole)
                told = time.perf_counter()
                stop.set()
                if run.result().report.code == ResultCode.CANCELLED:
                    times.append(time.perf_counter() - told)
        found.append(
            {'problem': name, 'cancelled': len(times), 'longest_s': max(times, default=0)}
        )
        step(f'cancelling {name}')
    return found


def at_once(names: list[str], step: Callable[[str], None]) -> dict[str, Any]:
    """Return how many plans made at once in threads are those made one by one, bit for bit."""
    problems = [drawn(names[i % len(names)], 1000 + i) for i in range(AT_ONCE)]
    together = Planner()
    with ThreadPoolExecutor(AT_ONCE) as pool:
        several = list(pool.map(together.plan, problems))
    step('fifty at once')
    alone = [Planner().plan(problem) for problem in problems]
    step('one by one')
    different = [i for i, pair in enumerate(zip(several, alone, strict=True)) if not _same(*pair)]
    return {'plans': AT_ONCE, 'different': different}


def _same(one: Plan, other: Plan) -> bool:
    mine, theirs = one.trajectory.columns, other.trajectory.columns
    return (
        one.report.objective == other.report.objective
        and np.array_equal(one.trajectory.time, other.trajectory.time)
        and all(np.array_equal(mine[name], theirs[name]) for name in mine)
    )


def summary(found: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return shares for each problem."""
    rows = []
    for name in dict.fromkeys(each['problem'] for each in found):
        mine = [each for each in found if each['problem'] == name]
        close = [each['gap'] is not None and each['gap'] <= CLOSE for each in mine]
        rows.append(
            {
                'problem': name,
                'cases': len(mine),
                'verified': sum(each['verified'] for each in mine) / len(mine),
                'close': sum(close) / len(mine),
                'median_cpu_s': float(np.median([each['cpu_s'] for each in mine])),
                'longest_cpu_s': max(each['cpu_s'] for each in mine),
            }
        )
    return rows


def show(results: dict[str, Any], console: Console) -> None:
    """Print tables."""
    table = Table(box=box.SIMPLE)
    columns = ('converged, verified', '', 'within 1 % of the best', '', 'median, ms', 'longest')
    table.add_column('random problems')
    for column in ('cases', *columns):
        table.add_column(column, justify='right')
    for row in results['summary']:
        table.add_row(
            row['problem'],
            str(row['cases']),
            f'{row["verified"]:.1%}',
            _mark(row['verified'] >= LEAST_VERIFIED, f'>= {LEAST_VERIFIED:.0%}'),
            f'{row["close"]:.1%}',
            _mark(row['close'] >= LEAST_CLOSE, f'>= {LEAST_CLOSE:.0%}'),
            f'{row["median_cpu_s"] * 1e3:.0f}',
            f'{row["longest_cpu_s"] * 1e3:.0f}',
        )
    console.print(table)
    for each in results['cases']:
        where = f'{each["problem"]} {each["index"]}'
        if not each['verified']:
            others = f'other guesses lead to {each["optima"]} optima'
            console.print(f'  {where}: {each["code"]}: {each["message"]} ({others})', markup=False)
        elif each['gap'] > CLOSE:
            values = f'{each["objective"]:.5g}, best found {each["best"]:.5g}'
            console.print(f'  {where}: {each["gap"]:.1%} off: {values}', markup=False)
    table = Table(box=box.SIMPLE)
    for column in ('cancelled', 'times', 'longest, s', ''):
        table.add_column(column, justify='left' if column == 'cancelled' else 'right')
    for row in results['latency']:
        met = _mark(row['longest_s'] <= MOST_LATENCY, f'<= {MOST_LATENCY:g} s')
        table.add_row(row['problem'], str(row['cancelled']), f'{row["longest_s"]:.3f}', met)
    console.print(table)
    threads = results['threads']
    if threads is not None:
        same = threads['plans'] - len(threads['different'])
        met = _mark(not threads['different'], 'bit for bit')
        console.print(f'  {same} of {threads["plans"]} plans made at once are the same: {met}')


def _mark(met: bool, what: str) -> str:
    return f'[green]{what}[/]' if met else f'[red]not {what}[/]'


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--problem', nargs='+', choices=PROBLEMS, default=list(PROBLEMS))
    parser.add_argument('--cases', type=int, default=100, help='random problems of each (100)')
    parser.add_argument('--json', action='store_true', help='print JSON instead of tables')
    options = parser.parse_args()
    os.environ['OMP_NUM_THREADS'] = '1'  # of the worker processes
    columns = (TextColumn('{task.description}'), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        total = len(options.problem) * options.cases + len(list_configs('problems')) + 2
        task = progress.add_task('', total=total)

        def step(what: str) -> None:
            progress.update(task, description=what, advance=1)

        found = robustness(options.problem, options.cases, step)
        results = {
            'summary': summary(found),
            'cases': found,
            'latency': latencies(step),
            'threads': at_once(options.problem, step),
        }
    if options.json:
        print(json.dumps(results, indent=1))
    else:
        show(results, Console(width=140))


if __name__ == '__main__':
    main()
