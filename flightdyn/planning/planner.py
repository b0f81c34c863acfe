"""From a problem to a verified plan."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ResultCode
from . import conditions
from .layout import Layout
from .mesh import ORDERS, Mesh, Method
from .problem import MAX_NODES, Problem
from .programme import Attempt, Programmes
from .report import Plan, PlanReport, message_of, trajectory_of
from .samples import Path, between, path
from .solver import Multipliers, OnIteration
from .verify import Verification, compare, overshoots, refly

Array = NDArray[np.float64]

MAX_SUBSTEPS = 16
MAX_PARTS = 4  # that an interval is cut into at a time
MAX_REFINEMENTS = 8
MAX_KEPT = 32  # programmes


@dataclass(frozen=True)
class Checked:
    """An attempt, what it means over time, and what came of flying it again."""

    attempt: Attempt
    way: Path
    states: Array
    misses: Array
    verification: Verification | None


class Planner:
    """Plans problems, from any number of threads; programmes are built once and kept."""

    def __init__(self) -> None:
        self._programmes = Programmes(MAX_KEPT)

    def plan(
        self,
        problem: Problem,
        *,
        near: Plan | None = None,
        on_iteration: OnIteration | None = None,
        should_stop: Callable[[], bool] | None = None,
    ) -> Plan:
        """Return the verified plan, or the last iterate with the reason why it is not one.

        The mesh is refined, and the problem solved again from where it stands, until the plan,
        flown again, is within the tolerance: intervals are cut where they are off, or, in
        multiple shooting, all get twice the substeps.

        Parameters
        ----------
        near : Plan
            Of a problem that differs in values alone (boundary values, bounds, wind): the solve
            starts from its solution, multipliers included. Otherwise it depends on nothing but
            the problem.
        on_iteration : function of an Iteration
            Called after each iteration, in the calling thread.
        should_stop : function returning a bool
            Asked after each iteration; True cancels.
        """
        run = Run(self._programmes, problem, on_iteration, should_stop)
        found = run.solve(first_mesh(problem), near=near)
        return run.finish(run.refined(found))


class Run:
    """One request on its way: what it has taken so far, and its solves."""

    def __init__(
        self,
        programmes: Programmes,
        problem: Problem,
        on_iteration: OnIteration | None = None,
        should_stop: Callable[[], bool] | None = None,
    ) -> None:
        self.problem, self.programmes = problem, programmes
        self.on_iteration, self.should_stop = on_iteration, should_stop
        self.started = time.perf_counter()
        self.build_s, self.iterations = 0.0, 0
        self.remedies: list[str] = []

    @property
    def left(self) -> float:
        """Wall time that is left [s]."""
        return self.problem.max_wall_time - (time.perf_counter() - self.started)

    def solve(
        self,
        mesh: Mesh,
        start: Array | None = None,
        *,
        near: Plan | None = None,
        strategy: str = 'monotone',
        multipliers: Multipliers | None = None,
        problem: Problem | None = None,
    ) -> Checked:
        """Return what a solve on a mesh gives, flown again if it converged."""
        problem = problem or self.problem
        structure = conditions.structure(problem, mesh)
        if near is not None and near.attempt is not None:
            same = near.attempt.structure.mesh.cuts
            again = conditions.structure(problem, replace(near.attempt.structure.mesh, cuts=same))
            if again == near.attempt.structure:
                structure, start = again, near.attempt.values
                strategy, multipliers = 'warm', near.attempt.solution.multipliers
        before = time.perf_counter()
        with self.programmes.borrow(repr(problem.vehicle), problem.stage, structure) as programme:
            self.build_s += time.perf_counter() - before
            attempt = programme.solve(
                problem,
                start,
                max_wall_time=self.left,
                strategy=strategy,
                multipliers=multipliers,
                on_iteration=self.on_iteration,
                should_stop=self.should_stop,
            )
            self.iterations += attempt.solution.iterations
            return self._check(problem, attempt, programme.transcription)

    def _check(self, problem: Problem, attempt: Attempt, transcription: Any) -> Checked:
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
        if not self.problem.refine:
            return found
        for _ in range(MAX_REFINEMENTS):
            verification = found.verification
            if verification is None or verification.worst <= self.problem.tolerance:
                return found
            mesh = finer(found, self.problem.tolerance)
            if mesh is None:
                return found
            start = resampled(
                found.attempt,
                Layout(
                    self.problem.stage.states,
                    self.problem.stage.controls,
                    found.attempt.layout.integrals.size,
                    conditions.structure(self.problem, mesh),
                ),
            )
            again = self.solve(mesh, start, strategy='near')
            if again.verification is None:
                return found if again.attempt.solution.code == ResultCode.INFEASIBLE else again
            found = again
        return found

    def finish(self, found: Checked) -> Plan:
        """Return the plan."""
        problem, attempt, verification = self.problem, found.attempt, found.verification
        code = attempt.solution.code
        verified = verification is not None and verification.worst <= problem.tolerance
        if code == ResultCode.SUCCESS and not verified:
            code = ResultCode.NOT_VERIFIED
        trajectory = trajectory_of(problem, found.way, found.states)
        report = PlanReport(
            code=code,
            converged=attempt.solution.code == ResultCode.SUCCESS,
            verified=verified,
            status=attempt.solution.status,
            message=message_of(code, problem, attempt, verification),
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
            remedies=self.remedies,
        )
        return Plan(trajectory, report, tuple(map(float, problem.wind_ned)), attempt=attempt)

    def _warnings(self, found: Checked, trajectory: Any) -> list[str]:
        if found.verification is None:
            return []
        said = []
        if found.attempt.solution.status == 'Solved_To_Acceptable_Level':
            said.append('solved to a looser tolerance than asked for')
        edges = np.concatenate(
            [[0.0], np.cumsum(found.attempt.values[found.attempt.layout.durations])]
        )
        for leg in range(len(self.problem.legs)):
            inside = (trajectory.time >= edges[leg]) & (trajectory.time <= edges[leg + 1])
            columns = {name: v[inside] for name, v in trajectory.columns.items()}
            said += overshoots(
                trajectory.time[inside], columns, self.problem.bounded(leg), self.problem.tolerance
            )
        return said


def _objective_error(
    attempt: Attempt, transcription: Any, way: Path, flown: Array
) -> tuple[float, float]:
    """Return how far an objective's integrals are off, in its terms, and what they amount to."""
    layout, costs = attempt.layout, transcription.costs
    values = attempt.values
    ends = np.concatenate(
        [
            values[layout.nodes[:, 0]],
            values[layout.steering[:, 0, 0]],
            values[layout.nodes[:, -1]],
            values[layout.steering[:, -1, -1]],
            values[layout.durations],
        ]
    )
    sums = flown[-costs.count :, -1]
    found, none = (
        float(costs.cost(np.concatenate([ends, each]), way.wind))
        for each in (sums, np.zeros_like(sums))
    )
    return abs(found - attempt.objective), abs(found - none) or 1.0


def method_of(problem: Problem) -> Method:
    """Return the transcription that a problem asks for, or that suits it."""
    if problem.transcription != 'auto':
        return problem.transcription
    return 'multiple_shooting' if problem.control_interpolation == 'previous' else 'radau'


def first_mesh(problem: Problem) -> Mesh:
    """Return the mesh that a problem is first solved on."""
    return Mesh.of(
        [leg.nodes for leg in problem.legs],
        method_of(problem),
        problem.control_interpolation,
        spacing=problem.spacing,
    )


def finer(found: Checked, tolerance: float) -> Mesh | None:
    """Return a mesh with shorter steps where a plan is off; None if it cannot be finer."""
    mesh = found.attempt.structure.mesh
    assert found.verification is not None
    if mesh.shooting:
        substeps = 2 * mesh.substeps
        return replace(mesh, substeps=substeps) if substeps <= MAX_SUBSTEPS else None
    # how far each interval is off by itself; flown in a row these add up, or grow
    each = np.abs(found.misses) / found.way.ranges[:, None]
    local = np.zeros(mesh.intervals)
    np.maximum.at(local, found.way.interval, np.nan_to_num(each.max(axis=0), nan=1.0))
    growth = max(found.verification.worst / max(local.sum(), 1e-300), 1.0)
    wanted = 0.5 * tolerance / (growth * mesh.intervals)
    order = ORDERS[mesh.method] + 1
    parts = np.ceil((local / wanted) ** (1 / order))
    parts = np.clip(np.nan_to_num(parts, nan=MAX_PARTS), 1, MAX_PARTS).astype(int)
    if parts.max() == 1:
        parts[int(np.argmax(local))] = 2
    return mesh.split(parts.tolist()) if parts.sum() <= MAX_NODES else None


def resampled(attempt: Attempt, layout: Layout) -> Array:
    """Return an attempt's variables (SI) at the places of another layout of the same phases."""
    old, mesh = attempt.layout, layout.mesh
    values = np.zeros(layout.size)
    values[layout.durations] = attempt.values[old.durations]
    values[layout.total] = attempt.values[old.total]
    values[layout.integrals] = attempt.values[old.integrals]

    def places(of: Mesh, positions: Array) -> Array:
        at = of.phase + of.begin + positions[:, None] * of.length
        return at.ravel(order='F')

    inner = np.concatenate([[0.0], old.mesh.points[:-1]])
    at = np.concatenate([places(old.mesh, inner), [len(mesh.cuts)]])
    states = np.concatenate([old.nodes[:, None, :-1], old.inside], axis=1)
    states = np.column_stack([states.reshape(states.shape[0], -1, order='F'), old.nodes[:, -1]])
    steering = old.steering.reshape(old.steering.shape[0], -1, order='F')
    steered_at = places(old.mesh, old.mesh.control_positions)

    def fill(variables: Any, positions: Array, known: Any, known_at: Array) -> None:
        where = places(mesh, positions)
        for row in range(known.shape[0]):
            column = np.interp(where, known_at, attempt.values[known[row]])
            values[variables[row].ravel(order='F')] = column

    fill(layout.inside, mesh.points[:-1], states, at)
    fill(layout.nodes[:, None, :-1], np.zeros(1), states, at)
    fill(layout.nodes[:, None, 1:], np.ones(1), states, at)
    fill(layout.steering, mesh.control_positions, steering, steered_at)
    outputs = {
        name: [v for v, each in zip(old.outputs, old.bounded, strict=True) if each.name == name]
        for name in {each.name for each in old.bounded}
    }
    for variable, each in zip(layout.outputs, layout.bounded, strict=True):
        known = outputs.get(each.name, [])
        there = [old.fraction(v) for v in known]
        column = [attempt.values[v] for v in known]
        mine = each.phase + mesh.begin[each.interval] + each.position * mesh.length[each.interval]
        order = np.argsort([a[0] + a[1] for a in there if a is not None])
        times = np.array([a[0] + a[1] for a in there if a is not None])[order]
        values[variable] = np.interp(mine, times, np.array(column)[order]) if known else 0.0
    return values
