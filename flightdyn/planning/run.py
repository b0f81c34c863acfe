"""One request on its way from a problem to a plan: its solves, checks and refinements."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ResultCode
from ..trajectory import Trajectory
from . import conditions
from .arcs import arcs_of, described, find_arcs, joined, with_arcs
from .layout import Layout, Structure
from .mesh import Mesh, Method
from .problem import Problem
from .programme import Attempt, Programmes
from .refinement import finer, first_mesh, resampled, strategy_of
from .report import Plan, PlanReport, message_of, trajectory_of
from .samples import JUMP, Path, between, path
from .shooting import written_out
from .solver import Iteration, Multipliers, OnIteration
from .transcription import Transcription
from .verify import Verification, compare, overshoots, refly

Array = NDArray[np.float64]

MAX_REFINEMENTS = 8
MAX_SHARPENINGS = 4
# Between switches controls are known and the motion smooth: few long flights have least variables,
# where the model is so small that flights in many steps cost little; else a high order gets most.
INTERVALS_IN_ARC = {'multiple_shooting': 4, 'radau': 5}
SUBSTEPS_IN_ARC = 4
COARSE = 0.05  # of an objective: how far off it a plan may be that is off when flown again
MAX_WARM = 60  # iterations from an earlier plan; one that needs more is not near


@dataclass(frozen=True)
class Checked:
    """An attempt, what it means over time, and what came of flying it again."""

    attempt: Attempt
    way: Path
    states: Array
    misses: Array
    verification: Verification | None

    def within(self, tolerance: float) -> bool:
        """Return whether it converged and is, flown again, within a tolerance."""
        return self.verification is not None and self.verification.worst <= tolerance


def arc_method(problem: Problem) -> Method:
    """Return how the arcs of a bang-bang plan are transcribed."""
    small = written_out(problem.stage, SUBSTEPS_IN_ARC)
    return 'multiple_shooting' if small else 'radau'


class Run:
    """One request on its way: what it has taken so far, and its solves.

    Parameters
    ----------
    started : float
        When the request came, by `time.perf_counter` [s].
    """

    def __init__(
        self,
        programmes: Programmes,
        problem: Problem,
        started: float,
        on_iteration: OnIteration | None = None,
        should_stop: Callable[[], bool] | None = None,
    ) -> None:
        self.problem, self.programmes = problem, programmes
        self.on_iteration, self.should_stop = on_iteration, should_stop
        self.started = started
        self.build_s, self.iterations = 0.0, 0
        self.remedies: list[str] = []

    @property
    def left(self) -> float:
        """Wall time that is left [s]."""
        return self.problem.max_wall_time - (time.perf_counter() - self.started)

    def solve(
        self,
        problem: Problem,
        mesh: Mesh,
        start: Array | None = None,
        *,
        strategy: str | None = None,
        multipliers: Multipliers | None = None,
        structure: Structure | None = None,
        most_iterations: int | None = None,
    ) -> Checked:
        """Return what a solve on a mesh gives, flown again if it converged.

        Parameters
        ----------
        problem : Problem
            This run's, or one made of it.
        start : (size,)
            Variables of the mesh's layout in SI units.
        strategy : str
            One of `solver.STRATEGIES`; the mesh's own unless given.
        structure : Structure
            The problem's on the mesh, unless given.
        most_iterations : int
            Less than the solver's own limit.
        """
        structure = structure or conditions.structure(problem, mesh)
        before = time.perf_counter()
        with self.programmes.borrow(problem.physics, problem.stage, structure) as programme:
            self.build_s += time.perf_counter() - before
            attempt = programme.solve(
                problem,
                start,
                max_wall_time=self.left,
                strategy=strategy or strategy_of(problem, mesh),
                multipliers=multipliers,
                most_iterations=most_iterations,
                on_iteration=self._watched(problem, programme.layout),
                should_stop=self.should_stop,
            )
            self.iterations += attempt.solution.iterations
            return self._check(attempt, programme.transcription)

    def first(
        self, guessed: Problem | None = None, *, most_iterations: int | None = None
    ) -> Checked:
        """Return what the problem gives on its first mesh, roughly if it may be bang-bang.

        Its arcs are seen long before a solve has converged, and are planned anew.

        Parameters
        ----------
        guessed : Problem
            This run's with another guess.
        """
        problem, mesh = guessed or self.problem, first_mesh(self.problem)
        strategy = strategy_of(problem, mesh)
        if strategy == 'adaptive':
            strategy = 'quick'
        elif problem.sharpen and not problem.phases:
            strategy = 'rough'
        return self.solve(problem, mesh, strategy=strategy, most_iterations=most_iterations)

    def best(self, found: Checked) -> Checked:
        """Return the plan that a first solve leads to: with exact switches, or on a finer mesh."""
        sharp = self.sharpened(found)
        if sharp is not None:
            return sharp
        if found.attempt.rough:
            mesh = found.attempt.structure.mesh
            found = self.solve(self.problem, mesh, found.attempt.values, strategy='near')
        return self.refined(found)

    def _watched(self, problem: Problem, layout: Layout) -> OnIteration | None:
        """Return a function that hands iterations on with a way to make flights of them."""
        on_iteration = self.on_iteration
        if on_iteration is None:
            return None

        def flight_of(variables: Array) -> Trajectory:
            limits = np.array([problem.limits(name) for name in problem.stage.controls])
            way = path(layout, variables, problem.wind_ned, limits.reshape(-1, 2))
            return trajectory_of(problem, way, between(problem.stage, way)[0])

        def hand_on(iteration: Iteration) -> None:
            assert iteration.variables is not None
            made = partial(flight_of, iteration.variables)
            on_iteration(replace(iteration, trajectory=made))

        return hand_on

    def near(self, plan: Plan) -> Checked | None:
        """Return a verified solve that started from a plan's solution, if there is one."""
        if plan.attempt is None or not plan.report.verified:
            return None
        solved, problem = plan.attempt, self.problem
        if solved.layout.state_names != problem.stage.states:
            return None
        if plan.report.arcs:
            problem = with_arcs(problem, arcs_of(problem, solved), problem.nodes)
        mesh = solved.structure.mesh
        if conditions.structure(problem, mesh) != solved.structure:
            return None
        found = self.solve(
            problem,
            mesh,
            solved.values,
            strategy='warm',
            multipliers=solved.multipliers,
            most_iterations=MAX_WARM,
        )
        return found if found.within(problem.tolerance) else None

    def sharpened(self, found: Checked) -> Checked | None:
        """Return a bang-bang plan with its switches where they belong; None if it is none."""
        problem, first = self.problem, found
        if not problem.sharpen or problem.phases or found.verification is None:
            return None
        arcs = find_arcs(problem, found.attempt)
        for _ in range(MAX_SHARPENINGS):
            if arcs is None or len(arcs) < 2:
                return None
            guess = trajectory_of(problem, found.way, found.states)
            method = arc_method(problem)
            nodes = INTERVALS_IN_ARC[method] * len(arcs)
            inner = with_arcs(replace(problem, guess_trajectory=guess), arcs, nodes)
            counts = [leg.nodes for leg in inner.legs]
            mesh = Mesh.of(counts, method, 'previous', substeps=SUBSTEPS_IN_ARC)
            found = self.solve(inner, mesh, strategy='near')
            if found.verification is None:
                return None
            fewer = joined(arcs_of(problem, found.attempt))
            if len(fewer) == len(arcs):
                break
            arcs = fewer
        found = self.refined(found)
        sign = problem.objective.sign
        worse = sign * (found.attempt.objective - first.attempt.objective)
        # what a coarse mesh promises may be more than can be flown
        part = problem.tolerance if first.within(problem.tolerance) else COARSE
        allowed = part * max(abs(first.attempt.objective), 1e-300)
        return found if found.within(problem.tolerance) and worse <= allowed else None

    def _check(self, attempt: Attempt, transcription: Transcription) -> Checked:
        problem = attempt.problem
        layout, stage = attempt.layout, problem.stage
        limits = np.array([problem.limits(name) for name in stage.controls]).reshape(-1, 2)
        way = path(layout, attempt.values, problem.wind_ned, limits)
        states, misses = between(stage, way)
        verification = None
        if attempt.solution.code == ResultCode.SUCCESS:
            flying, costs = transcription.flying, transcription.costs
            start = np.concatenate([way.states[:, 0], np.zeros(costs.count)])
            flown = refly(flying, start, way, problem.tolerance)
            more = {}
            if costs.count:
                more['objective'] = _objective_error(attempt, transcription, way, flown)
            verification = compare(stage.states, way, flown, more)
        return Checked(attempt, way, states, misses, verification)

    def refined(self, found: Checked) -> Checked:
        """Return the same on a mesh on which it is within the tolerance, or the last one."""
        problem = found.attempt.problem
        if not problem.refine:
            return found
        for _ in range(MAX_REFINEMENTS):
            if found.verification is None or found.within(problem.tolerance):
                return found
            mesh = finer(
                found.attempt.structure.mesh,
                found.misses / found.way.ranges[:, None],
                found.way.interval,
                found.verification.worst,
                problem.tolerance,
            )
            if mesh is None:
                return found
            start = resampled(
                found.attempt,
                Layout(
                    problem.stage.states,
                    problem.stage.controls,
                    found.attempt.layout.integrals.size,
                    conditions.structure(problem, mesh),
                ),
            )
            again = self.solve(problem, mesh, start, strategy='near')
            if again.verification is None:
                return found if again.attempt.solution.code == ResultCode.INFEASIBLE else again
            found = again
        return found

    def finish(self, found: Checked, missing: list[dict[str, Any]] | None = None) -> Plan:
        """Return the plan.

        Parameters
        ----------
        missing : list
            Conditions that the nearest flight misses, if none keeps them all.
        """
        problem, attempt, verification = self.problem, found.attempt, found.verification
        code = attempt.solution.code
        verified = found.within(problem.tolerance)
        arced = attempt.problem.phases and not problem.phases
        arcs = arcs_of(problem, attempt) if arced else []
        if code == ResultCode.SUCCESS and not verified:
            code = ResultCode.NOT_VERIFIED
        trajectory = trajectory_of(problem, found.way, found.states)
        report = PlanReport(
            code=code,
            converged=attempt.solution.code == ResultCode.SUCCESS,
            verified=verified,
            status=attempt.solution.status,
            message=message_of(code, problem, attempt, verification, missing or []),
            objective=float(np.nan_to_num(attempt.objective)),
            final_time=float(trajectory.time[-1]),
            iterations=self.iterations,
            wall_s=time.perf_counter() - self.started,
            build_s=self.build_s,
            nodes=attempt.structure.mesh.intervals,
            transcription=str(attempt.structure.mesh),
            verification=verification.errors if verification else {},
            constraint_violation=attempt.solution.violation,
            warnings=self._warnings(found, trajectory),
            arcs=described(problem, arcs),
            phases=_phases(problem, attempt),
            remedies=self.remedies,
            missed=missing or [],
        )
        return Plan(
            trajectory,
            report,
            tuple(map(float, problem.wind_ned)),
            problem.wind,
            surroundings=problem.surroundings,
            attempt=attempt,
        )

    def _warnings(self, found: Checked, trajectory: Trajectory) -> list[str]:
        if found.verification is None:
            return []
        said = []
        if found.attempt.solution.status == 'Solved_To_Acceptable_Level':
            said.append('solved to a looser tolerance than asked for')
        edges = np.concatenate(
            [[0.0], np.cumsum(found.attempt.values[found.attempt.layout.durations])]
        )
        solved = found.attempt.problem
        # where a phase ends a sample has its last controls, and the next, a jump later, the new
        # ones; of held controls the sample there has the new ones
        held = trajectory.control_interpolation == 'previous'
        cuts = edges + JUMP * edges[-1] / 2 * (-1 if held else 1)
        cuts[0], cuts[-1] = -np.inf, np.inf
        for leg in range(len(solved.legs)):
            inside = (trajectory.time > cuts[leg]) & (trajectory.time <= cuts[leg + 1])
            columns = {name: v[inside] for name, v in trajectory.columns.items()}
            said += overshoots(
                trajectory.time[inside], columns, solved.bounded(leg), solved.tolerance
            )
        return said


def _phases(problem: Problem, attempt: Attempt) -> list[dict[str, Any]]:
    if not problem.phases:
        return []
    edges = np.concatenate([[0.0], np.cumsum(attempt.values[attempt.layout.durations])])
    return [
        {'name': name, 'start': float(start), 'end': float(end)}
        for name, start, end in zip(problem.phase_names, edges[:-1], edges[1:], strict=True)
    ]


def _objective_error(
    attempt: Attempt, transcription: Transcription, way: Path, flown: Array
) -> tuple[float, float]:
    """Return how far an objective's integrals are off, in its terms, and what they amount to."""
    layout, costs = attempt.layout, transcription.costs
    ends = attempt.values[layout.ends]
    sums = flown[-costs.count :, -1]
    found, none = (
        float(costs.cost(np.concatenate([ends, each]), way.wind))
        for each in (sums, np.zeros_like(sums))
    )
    return abs(found - attempt.objective), abs(found - none) or 1.0
