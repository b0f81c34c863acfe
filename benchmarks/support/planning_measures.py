"""What benchmarks/planning.py runs in processes of its own: each prints one JSON document.

Run: python planning_measures.py MEASURE [ARGUMENT ...]
"""

import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from flightdyn.planning.planner import Planner
from flightdyn.planning.problem import Problem
from flightdyn.planning.problem_file import load_problem
from flightdyn.planning.remedies import perturbed
from flightdyn.planning.report import Plan
from flightdyn.planning.solver import Solver

PROBLEMS = {
    'glide': 'cessna152_glide',
    'turnback': 'cessna152_turnback',
    'flip': 'quadcopter_flip',
    'rocket': 'rocket_climb',
}
AROUND = 3  # of our solves before the other's and as many after it
WARM_STARTS = 10
PEER_REPEATS = {'flip': 5, 'rocket': 5}  # those that take milliseconds
GROWTH = (25, 50, 100, 200, 400, 800, 1600)
GROWTH_TIME = 20.0  # s at most for each
REFINED = (100, 200, 400, 800, 1600)
STARTS = 10

# Where a flight stands when it is planned again: off the plan by at most so much, SI.
DISTURBANCES: dict[str, dict[str, float]] = {
    'glide': {'z_e': 10.0, 'speed': 0.5, 'gamma': 0.02},
    'turnback': {'z_e': 2.0, 'airspeed': 0.3, 'gamma': 0.02, 'track': 0.02},
    'flip': {'x_e': 0.02, 'z_e': 0.02, 'u_b': 0.05, 'w_b': 0.05, 'q': 0.05},
    'rocket': {'z_e': 10.0, 'w_e': 1.0},
}

TEXTBOOK_GLIDE = (
    *('nodes=49', 'spacing=cosine', 'transcription=trapezoidal', 'refine=false'),
    'control_interpolation=linear',
)
TEXTBOOK_FLIP = (
    *('nodes=79', 'transcription=trapezoidal', 'refine=false', 'sharpen=false'),
    'control_interpolation=linear',
)
CONVERGED_GLIDE = ('nodes=120', 'control_interpolation=polynomial', 'tolerance=1.0e-4')


class Spent:
    """Seconds of a block: by the clock and of the processor, all threads together."""

    def __init__(self) -> None:
        self.wall = self.cpu = 0.0

    @contextmanager
    def running(self) -> Iterator[None]:
        """Add what a block takes."""
        wall, cpu = time.perf_counter(), time.process_time()
        try:
            yield
        finally:
            self.wall += time.perf_counter() - wall
            self.cpu += time.process_time() - cpu


@contextmanager
def solving() -> Iterator[Spent]:
    """Measure what is spent in the solver alone, in all solves of a block."""
    found, original = Spent(), Solver.solve

    def solve(self: Solver, *args: Any, **settings: Any) -> Any:
        with found.running():
            return original(self, *args, **settings)

    Solver.solve = solve  # type: ignore[method-assign]
    try:
        yield found
    finally:
        Solver.solve = original  # type: ignore[method-assign]


def timed(make: Callable[[], Plan]) -> dict[str, Any]:
    """Return times of a request, and what came of it."""
    whole = Spent()
    with solving() as solve, whole.running():
        plan = make()
    return {
        'solve_s': solve.wall,
        'solve_cpu_s': solve.cpu,
        'whole_s': whole.wall,
        'whole_cpu_s': whole.cpu,
        'iterations': plan.report.iterations,
        'value': plan.report.objective,
        'verified': plan.report.verified,
    }


def nearby(case: str, problem: Problem, rng: np.random.Generator) -> Problem:
    """Return the problem with its start a little off."""
    start = {}
    for name, most in DISTURBANCES[case].items():
        value = problem.initial[name][0] + most * rng.uniform(-1, 1)
        start[name] = (value, value)
    return problem.with_changes(initial=start)


def speed(case: str, runs: str) -> dict[str, Any]:
    """Return times of ours, cold and warm, and of AeroSandbox between them.

    What is built the first time is there already, of both. AeroSandbox's `solve` makes its solver
    anew each time; that is what its users wait for.
    """
    import aerosandbox_problems

    planner, problem = Planner(), load_problem(PROBLEMS[case])
    plan, rng = planner.plan(problem), np.random.default_rng(1)
    planner.plan(nearby(case, problem, rng), near=plan)

    def cold() -> list[dict[str, Any]]:
        return [timed(lambda: planner.plan(problem)) for _ in range(AROUND)]

    def peer() -> dict[str, Any]:
        found = aerosandbox_problems.timed(case)
        found.pop('solution')
        return found

    if case in PEER_REPEATS:
        peer()  # what it loads the first time does not count
    pairs = []
    for _ in range(int(runs)):
        ours = cold()
        others = [peer() for _ in range(PEER_REPEATS.get(case, 1))]
        pairs.append({'ours': ours + cold(), 'peer': others})
    warm = []
    for _ in range(WARM_STARTS):
        again = nearby(case, problem, rng)
        warm.append(timed(lambda again=again: planner.plan(again, near=plan)))  # type: ignore[misc]
    requests = [
        timed(lambda: planner.plan(load_problem(PROBLEMS[case]))) for _ in range(2 * AROUND)
    ]
    return {'pairs': pairs, 'warm': warm, 'requests': requests}


def alone(case: str, runs: str) -> dict[str, Any]:
    """Return times of ours, cold, and of the very first request of the process."""
    first = timed(lambda: Planner().plan(load_problem(PROBLEMS[case])))
    planner, problem = Planner(), load_problem(PROBLEMS[case])
    planner.plan(problem)
    cold = [timed(lambda: planner.plan(problem)) for _ in range(2 * AROUND * int(runs))]
    return {'first': first, 'cold': cold}


def figures() -> list[dict[str, Any]]:
    """Return what the textbook's cases come to: rows of what, value, unit, expected, within."""
    planner, rows = Planner(), []

    def row(what: str, value: float, unit: str, expected: float, within: float) -> None:
        rows.append(
            {'what': what, 'value': value, 'unit': unit, 'expected': expected, 'within': within}
        )

    def plan(case: str, *settings: str) -> Plan:
        return planner.plan(load_problem(PROBLEMS[case], settings))

    alpha, ratio = polar()
    best = int(np.argmax(ratio))
    row('polar: best L/D', ratio[best], '', 18.67, 0.005)
    row('polar: at alpha', alpha[best], 'deg', 3.06, 0.01)
    textbook = plan('glide', *TEXTBOOK_GLIDE)
    nodes = -textbook.trajectory['z_e']
    # AeroBuildup's, found by AeroSandbox: a table of it may differ by its fit
    row("glide, textbook's mesh", textbook.report.objective, 'm', 20_927.9, 1.0)
    row('glide: zoom', float(nodes.max()) - 1000, 'm', 79.0, 0.5)
    row('glide, converged', plan('glide', *CONVERGED_GLIDE).report.objective, 'm', 20_921, 1.0)
    row('glide, as shipped', plan('glide').report.objective, 'm', 20_921, 21)
    row("flip, textbook's mesh", plan('flip', *TEXTBOOK_FLIP).report.objective, 's', 0.82577, 1e-5)
    row('flip, as shipped', plan('flip').report.objective, 's', 0.8240737, 1e-5)
    return rows


def polar() -> tuple[Any, Any]:
    """Return alpha [deg] and lift over drag of the Cessna 152 at 107 kt, sea level."""
    stage = load_problem(PROBLEMS['glide']).stage
    alpha = np.linspace(-5, 15, 2001)
    states = dict(zip(stage.states, np.zeros((len(stage.states), alpha.size)), strict=True))
    states['speed'] = np.full(alpha.size, 107 * 1852 / 3600)
    controls = [alpha if name == 'alpha' else np.zeros(alpha.size) for name in stage.controls]
    parameters = np.zeros((stage.function.size1_in(2), alpha.size))
    _, outputs = stage.function.map(alpha.size)(
        np.array(list(states.values())), np.array(controls), parameters
    )
    values = dict(zip(stage.outputs, outputs.full(), strict=True))
    return alpha, values['lift'] / values['drag']


def rocket() -> list[dict[str, Any]]:
    """Return the rocket's fuel on ever finer meshes."""
    found = []
    for nodes in REFINED:
        report = Planner().plan(load_problem(PROBLEMS['rocket'], [f'nodes={nodes}'])).report
        found.append(
            {'nodes': nodes, 'used': report.nodes, 'value': report.objective}
            | {'verified': report.verified}
        )
    return found


def starts(case: str) -> list[dict[str, Any]]:
    """Return what a problem comes to from perturbed guesses."""
    planner, problem = Planner(), load_problem(PROBLEMS[case])
    found = []
    for seed in range(STARTS):
        report = planner.plan(perturbed(problem, seed)).report
        found.append(
            {'seed': seed, 'value': report.objective, 'verified': report.verified}
            | {'iterations': report.iterations, 'message': report.message}
        )
    return found


def growth(case: str) -> list[dict[str, Any]]:
    """Return what an iteration costs, by the number of nodes; solved or not."""
    found = []
    for nodes in GROWTH:
        problem = load_problem(PROBLEMS[case], [f'nodes={nodes}']).with_changes(
            refine=False, sharpen=False, spacing='uniform', max_wall_time=GROWTH_TIME
        )
        planner = Planner()
        build = planner.plan(problem).report.build_s
        with solving() as spent:
            report = planner.plan(problem).report
        each = spent.cpu / max(report.iterations, 1)
        found.append(
            {'nodes': nodes, 'iteration_s': each, 'iteration_and_node_s': each / nodes}
            | {'iterations': report.iterations, 'build_s': build, 'code': report.code.name}
        )
    return found


def accuracy(case: str) -> dict[str, Any]:
    """Return how far a shipped plan is off when flown again, over how far its states move."""
    problem = load_problem(PROBLEMS[case])
    plan = Planner().plan(problem)
    report, flown = plan.report, plan.trajectory
    errors = {
        name: error / float(np.ptp(flown[name]))
        for name, error in report.verification.items()
        if name in flown and np.ptp(flown[name]) > 0
    }
    found = {
        'verified': report.verified,
        'tolerance': problem.tolerance,
        'errors': report.verification,
        'relative': errors,
        'transcription': report.transcription,
        'warnings': report.warnings,
    }
    if problem.vehicle.aerodynamics is not None:
        found['table'] = table_errors(flown)
    return found


def table_errors(flown: Any) -> dict[str, float]:
    """Return how far the table is off AeroBuildup along a flight, relative."""
    import aerosandbox as asb
    from aerosandbox_problems import cessna

    air = asb.OperatingPoint(
        asb.Atmosphere(-flown['z_e']), velocity=flown['airspeed'], alpha=flown['alpha']
    )
    built = asb.AeroBuildup(cessna(), air).run()
    return {
        name: float(np.abs(flown[name] / np.asarray(built[name]) - 1).max())
        for name in ('CL', 'CD')
    }


MEASURES: dict[str, Callable[..., Any]] = {
    function.__name__: function
    for function in (speed, alone, figures, rocket, starts, growth, accuracy)
}


if __name__ == '__main__':
    print(json.dumps(MEASURES[sys.argv[1]](*sys.argv[2:])))
