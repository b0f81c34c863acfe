"""From a problem to a verified plan."""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from ..errors import ResultCode
from .alternatives import best_alternative
from .problem import Problem
from .programme import Programmes
from .refinement import first_mesh, strategy_of
from .remedies import missed, perturbed, softened, without_soft
from .report import Plan
from .run import Checked, Run
from .solver import OnIteration

MAX_KEPT = 32  # programmes
MAX_OPTIMA = 8  # that several starts are followed to
SAME = 1e-3  # of the objective: optima on a first mesh that are one
OTHER_GUESSES = 2
COMPARISONS = 3
MAX_TRIED = 150  # iterations of a remedy; those that help need far fewer
WANDERING = 150  # iterations
ASTRAY = 100  # tolerances
"""What a first solve takes, or is off by when flown again, that is then compared with what other
guesses lead to: from far away it often ends in a lesser optimum, a flight wilder than needed."""
COMPARED = 'compared with other guesses'
REMEDIES = (
    'nearest flight',
    'another barrier rule',
    *(f'another guess ({number + 1})' for number in range(OTHER_GUESSES)),
)
"""What is tried in turn. The nearest flight is the one that comes as near to all conditions as it
can: if it keeps them it is where the next solve starts, else it tells which ones conflict."""


class Planner:
    """Plans problems, from any number of threads; programmes are built once and kept."""

    def __init__(self) -> None:
        self._programmes = Programmes(MAX_KEPT)

    def plan(
        self,
        problem: Problem,
        *,
        near: Plan | None = None,
        multistart: int | None = None,
        seed: int = 0,
        on_iteration: OnIteration | None = None,
        should_stop: Callable[[], bool] | None = None,
    ) -> Plan:
        """Return the verified plan, or the last iterate with the reason why it is not one.

        The mesh is refined, and the problem solved again from where it stands, until the plan,
        flown again, is within the tolerance: intervals are cut where they are off, or, in
        multiple shooting, all get twice the substeps. A bang-bang plan is planned again with its
        switches free. What is tried when a solve fails, in this order, is in `REMEDIES`.

        Limits of the vehicle's outputs that the problem does not name are looked at afterwards,
        and kept in a second solve where the first one left them.

        Of a problem with alternatives each is planned, and the best plan returned.

        The same problem and arguments give the same plan, whatever was planned before.

        Parameters
        ----------
        near : Plan
            Of a problem that differs in values alone (boundary values, bounds, wind): the solve
            starts from its solution, multipliers included.
        multistart : int
            How many guesses to start from, the problem's own first; as the problem says unless
            given. The best plan is returned, other local optima are in `Plan.others`.
        seed : int
            Of the other guesses.
        on_iteration : function of an Iteration
            Called after each iteration, in the calling thread.
        should_stop : function returning a bool
            Asked after each iteration; True cancels.
        """
        if problem.alternatives:
            return best_alternative(
                problem,
                lambda each: self.plan(
                    each,
                    near=near,
                    multistart=multistart,
                    seed=seed,
                    on_iteration=on_iteration,
                    should_stop=should_stop,
                ),
            )
        watched = on_iteration, should_stop
        started = time.perf_counter()
        full = near is not None and near.attempt is not None and not near.attempt.problem.aside
        if not problem.aside and not full:
            lean = problem.without_limits()
            if lean.aside:
                plan = self._plan(lean, near, multistart, seed, started, *watched)
                if not (plan.report.converged and lean.beyond_limits(plan.trajectory)):
                    return plan
        return self._plan(problem, near, multistart, seed, started, *watched)

    def _plan(
        self,
        problem: Problem,
        near: Plan | None,
        multistart: int | None,
        seed: int,
        started: float,
        on_iteration: OnIteration | None,
        should_stop: Callable[[], bool] | None,
    ) -> Plan:
        run = Run(self._programmes, problem, started, on_iteration, should_stop)
        found = run.near(near) if near is not None else None
        if found is not None:
            return replace(run.finish(found), near=True)
        starts = problem.multistart if multistart is None else multistart
        if starts > 1:
            optima = _local_optima(run, starts, seed)
            if optima:
                plans = [run.finish(each) for each in optima]
                return replace(plans[0], others=plans[1:])
        found = run.first()
        missing: list[dict[str, Any]] = []
        if _may_be_remedied(found):
            found, missing = _remedied(run, found, seed)
        if found.verification is not None:
            found = run.best(found) if _settled(found) else _compared(run, found, seed)
        return run.finish(found, missing)


def _may_be_remedied(found: Checked) -> bool:
    return found.attempt.solution.code in (
        ResultCode.INFEASIBLE,
        ResultCode.ITERATION_LIMIT,
        ResultCode.INTERNAL,
    )


def _remedied(run: Run, first: Checked, seed: int) -> tuple[Checked, list[dict[str, Any]]]:
    """Return what a remedy gave, or the first attempt and the conditions that cannot be met."""
    problem, mesh = run.problem, first.attempt.structure.mesh
    missing: list[dict[str, Any]] = []
    nearest: Checked | None = None

    def barrier() -> Checked:
        other = 'adaptive' if strategy_of(problem, mesh) == 'monotone' else 'monotone'
        return run.solve(problem, mesh, strategy=other, most_iterations=MAX_TRIED)

    def from_nearest() -> Checked:
        nonlocal missing, nearest
        free, structure = softened(problem, first.attempt)
        nearest = run.solve(free, mesh, structure=structure)
        if nearest.verification is None:
            return nearest
        missing = missed(nearest.attempt)
        if missing:
            return nearest
        return run.solve(problem, mesh, without_soft(nearest.attempt, first.attempt.layout.size))

    def another(number: int) -> Checked:
        guessed = perturbed(problem, seed + number)
        return run.solve(guessed, mesh, most_iterations=MAX_TRIED)

    tries: tuple[Callable[[], Checked], ...] = (
        from_nearest,
        barrier,
        *(partial(another, number) for number in range(1, OTHER_GUESSES + 1)),
    )
    for name, attempt in zip(REMEDIES, tries, strict=True):
        run.remedies.append(name)
        found = attempt()
        solved = found.verification is not None and not found.attempt.structure.soft
        if solved or found.attempt.solution.code in (ResultCode.CANCELLED, ResultCode.TIME_LIMIT):
            return found, []
    if missing and nearest is not None:
        # what is handed out is a flight, if not the one asked for
        solution = replace(nearest.attempt.solution, code=ResultCode.INFEASIBLE)
        status = replace(solution, status=first.attempt.solution.status)
        flight = replace(nearest.attempt, solution=status, objective=first.attempt.objective)
        return replace(nearest, attempt=flight, verification=None), missing
    return first, []


def _settled(found: Checked) -> bool:
    """Return whether a first solve leaves no doubt, see `WANDERING`."""
    if found.verification is None or found.attempt.solution.iterations > WANDERING:
        return False
    off = found.verification.worst / found.attempt.problem.tolerance
    return found.attempt.rough or off <= ASTRAY


def _compared(run: Run, found: Checked, seed: int) -> Checked:
    """Return the better plan of what was found and of what another guess leads to directly."""
    problem, taken = run.problem, time.perf_counter() - run.started
    run.remedies.append(COMPARED)
    sign = problem.objective.sign
    for number in range(1, COMPARISONS + 1):
        if run.left < taken:
            break
        each = run.first(perturbed(problem, seed + number), most_iterations=MAX_TRIED)
        if each.attempt.solution.code in (ResultCode.CANCELLED, ResultCode.TIME_LIMIT):
            break
        if each.verification is not None and _same(each, found):
            break
        if not _settled(each):
            continue
        other = run.best(each)
        if not other.within(problem.tolerance):
            continue
        if sign * (other.attempt.objective - found.attempt.objective) > 0:
            # what a coarse mesh promises may be more than can be flown
            found = run.best(found)
            if found.within(problem.tolerance):
                return min(found, other, key=lambda each: sign * each.attempt.objective)
        return other
    return run.best(found)


def _local_optima(run: Run, starts: int, seed: int) -> list[Checked]:
    """Return the distinct plans found from several guesses, the best first."""
    problem = run.problem
    found: list[Checked] = []
    for number in range(starts):
        guessed = perturbed(problem, seed + number) if number else problem
        each = run.solve(guessed, first_mesh(problem))
        if each.attempt.solution.code in (ResultCode.CANCELLED, ResultCode.TIME_LIMIT):
            break
        if each.verification is not None:
            found.append(each)
    sign = problem.objective.sign
    best = [run.best(each) for each in _distinct(found, sign)[:MAX_OPTIMA]]
    return _distinct([each for each in best if each.within(problem.tolerance)], sign)


def _distinct(found: list[Checked], sign: float) -> list[Checked]:
    """Return those with objectives of their own, the best first."""
    distinct: list[Checked] = []
    for each in sorted(found, key=lambda each: sign * each.attempt.objective):
        if not any(_same(each, other) for other in distinct):
            distinct.append(each)
    return distinct


def _same(one: Checked, other: Checked) -> bool:
    value, other_value = one.attempt.objective, other.attempt.objective
    return abs(value - other_value) <= SAME * max(abs(value), 1e-9)
