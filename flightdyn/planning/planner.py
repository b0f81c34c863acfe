"""From a problem to a verified plan."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ResultCode
from ..trajectory import Trajectory
from .guess import guess_columns, guess_duration
from .problem import Problem
from .solver import OnIteration, Solution, Solver
from .transcription import Mesh, MultipleShooting, Point, structure
from .verify import Verification, overshoots, step_error, verify

Array = NDArray[np.float64]

MAX_NAMED = 3  # conflicting constraints in a message
WORTH_NAMING = 0.2  # of the worst violation, in scaled terms
MAX_SUBSTEPS = 16
ADDING_UP = 0.1  # share of the tolerance that one interval may take: errors of all add up
MAX_CACHED = 16


@dataclass(frozen=True, kw_only=True)
class PlanReport:
    """How a plan came about and what it is worth; times in seconds."""

    code: ResultCode
    converged: bool
    verified: bool
    status: str
    message: str
    objective: float
    final_time: float
    iterations: int
    wall_s: float
    build_s: float
    nodes: int
    transcription: str
    verification: dict[str, float]
    constraint_violation: float
    warnings: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Plan:
    """A trajectory and its report; unless `report.verified`, it is only the last iterate."""

    trajectory: Trajectory
    report: PlanReport
    wind_ned: tuple[float, ...] = (0.0, 0.0, 0.0)


class Planner:
    """Plans problems, from any thread; programmes are built once for each structure and kept."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._built: dict[str, tuple[MultipleShooting, Solver]] = {}

    def plan(
        self,
        problem: Problem,
        *,
        on_iteration: OnIteration | None = None,
        should_stop: Callable[[], bool] | None = None,
    ) -> Plan:
        """Return the verified plan, or the last iterate with the reason why it is not one.

        RK4 substeps are as many as the guess needs; they are doubled and the problem solved again
        from where it stands until the plan's error, flown again, is under the tolerance.

        Parameters
        ----------
        on_iteration : function of an Iteration
            Called after each iteration, in the calling thread.
        should_stop : function returning a bool
            Asked after each iteration; True cancels.
        """
        started = time.perf_counter()
        build_s, iterations = 0.0, 0
        guess: Point | None = None
        substeps = _first_substeps(problem)
        while True:
            mesh = Mesh(problem.nodes, substeps, problem.control_interpolation)
            before = time.perf_counter()
            shooting, solver = self._build(problem, mesh)
            build_s += time.perf_counter() - before
            scale = shooting.scale(problem)
            lower, upper = shooting.bounds(problem, scale)
            solution = solver.solve(
                np.clip(shooting.pack(guess or shooting.guess(problem), scale), lower, upper),
                lower,
                upper,
                shooting.parameters(problem, scale),
                max_wall_time=problem.max_wall_time - (time.perf_counter() - started),
                on_iteration=_in_units(on_iteration, shooting, scale),
                should_stop=should_stop,
            )
            iterations += solution.iterations
            guess = shooting.unpack(solution.variables, scale)
            verification = None
            if solution.code == ResultCode.SUCCESS:
                verification = verify(
                    shooting.stage,
                    mesh,
                    guess,
                    tuple(problem.wind_ned),
                    shooting.costs,
                    shooting.objective(solution.variables, problem, scale),
                )
                if verification.worst > problem.tolerance and substeps < MAX_SUBSTEPS:
                    substeps *= 2
                    continue
            report = _report(
                problem,
                shooting,
                solution,
                scale,
                verification,
                iterations=iterations,
                build_s=build_s,
                wall_s=time.perf_counter() - started,
            )
            return Plan(
                _trajectory(problem, shooting, guess), report, tuple(map(float, problem.wind_ned))
            )

    def _build(self, problem: Problem, mesh: Mesh) -> tuple[MultipleShooting, Solver]:
        stage = problem.stage
        built = structure(problem, stage)
        key = repr((problem.vehicle, built, mesh))
        with self._lock:
            if key not in self._built:
                shooting = MultipleShooting(stage, mesh, built)
                while len(self._built) >= MAX_CACHED:
                    self._built.pop(next(iter(self._built)))
                self._built[key] = (shooting, Solver(shooting.programme, shooting.derivatives))
            return self._built[key]


def _first_substeps(problem: Problem) -> int:
    """Return how many substeps an interval needs if the plan is like its guess."""
    n = problem.nodes
    nodes = np.linspace(0, 1, n + 1)
    stage, wind = problem.stage, tuple(problem.wind_ned)
    substeps = 1
    while substeps < MAX_SUBSTEPS:
        mesh = Mesh(n, substeps, problem.control_interpolation)
        point = Point(
            guess_columns(problem, stage.states, nodes),
            guess_columns(problem, stage.controls, nodes[: mesh.control_nodes]),
            guess_duration(problem),
        )
        if step_error(stage, mesh, point, wind) <= ADDING_UP * problem.tolerance:
            return substeps
        substeps *= 2
    return 1  # no number of them helps a guess like this


def _report(
    problem: Problem,
    shooting: MultipleShooting,
    solution: Solution,
    scale: Array,
    verification: Verification | None,
    **numbers: Any,
) -> PlanReport:
    code = solution.code
    point = shooting.unpack(solution.variables, scale)
    verified = verification is not None and verification.worst <= problem.tolerance
    if code == ResultCode.SUCCESS and not verified:
        code = ResultCode.NOT_VERIFIED
    return PlanReport(
        code=code,
        converged=solution.code == ResultCode.SUCCESS,
        verified=verified,
        status=solution.status,
        message=_message(code, problem, shooting, solution, scale, verification),
        objective=float(np.nan_to_num(shooting.objective(solution.variables, problem, scale))),
        final_time=point.duration,
        nodes=problem.nodes,
        transcription=str(shooting.mesh),
        verification=verification.errors if verification else {},
        constraint_violation=solution.violation,
        warnings=_warnings(problem, shooting, solution, point),
        **numbers,
    )


def _warnings(
    problem: Problem, shooting: MultipleShooting, solution: Solution, point: Point
) -> list[str]:
    if solution.code != ResultCode.SUCCESS:
        return []
    loose = solution.status == 'Solved_To_Acceptable_Level'
    return (['solved to a looser tolerance than asked for'] if loose else []) + overshoots(
        shooting.stage,
        shooting.mesh,
        point,
        tuple(problem.wind_ned),
        problem.bounded,
        problem.tolerance,
    )


def _message(
    code: ResultCode,
    problem: Problem,
    shooting: MultipleShooting,
    solution: Solution,
    scale: Array,
    verification: Verification | None,
) -> str:
    if code == ResultCode.SUCCESS and verification is not None:
        return (
            f'solved and verified: flown again, {verification.worst_state} is off by '
            f'{verification.errors[verification.worst_state]:.2g}'
        )
    if code == ResultCode.NOT_VERIFIED and verification is not None:
        return (
            f'solved, but flown again {verification.worst_state} is off by '
            f'{verification.errors[verification.worst_state]:.3g}: '
            f'raise nodes (now {problem.nodes})'
        )
    if code == ResultCode.CANCELLED:
        return 'cancelled; the last iterate is attached'
    if code == ResultCode.TIME_LIMIT:
        return (
            f'stopped after max_wall_time = {problem.max_wall_time:g} s; '
            'allow more, or lower nodes'
        )
    if solution.status == 'Invalid_Number_Detected':
        return (
            f'{solution.status}: the model gives values that are not numbers; keep the guess and '
            'the path bounds away from where it is singular'
        )
    gap = _conflict(shooting, solution, scale) + _in_force(problem, shooting, solution, scale)
    advice = {
        ResultCode.INFEASIBLE: 'loosen bounds or duration, or give a better guess',
        ResultCode.ITERATION_LIMIT: 'give a better guess',
        ResultCode.BAD_REQUEST: 'free some of the fixed values',
    }.get(code, 'try another guess or number of nodes')
    return f'{solution.status}: {gap}; {advice}'


def _conflict(shooting: MultipleShooting, solution: Solution, scale: Array) -> str:
    """Return words for the most violated constraints, one for each quantity."""
    gaps = np.abs(np.nan_to_num(solution.gaps))
    found: dict[str, str] = {}
    for index in np.argsort(-gaps, kind='stable'):
        if found and (len(found) == MAX_NAMED or gaps[index] < WORTH_NAMING * gaps.max()):
            break
        name = shooting.quantity(int(shooting.subject[index]))
        if name not in found:
            found[name] = shooting.describe_gap(
                int(index), solution.variables, float(solution.gaps[index]), scale
            )
    return '; '.join(found.values())


def _in_force(
    problem: Problem, shooting: MultipleShooting, solution: Solution, scale: Array
) -> str:
    """Return words for the bounds that an infeasible point lies at most."""
    if solution.code != ResultCode.INFEASIBLE:
        return ''
    met = shooting.at_bounds(solution.variables, *shooting.bounds(problem, scale))
    most = sorted(met, key=lambda name: -met[name])[:MAX_NAMED]
    return f'; at their bounds: {", ".join(most)}' if most else ''


def _in_units(
    on_iteration: OnIteration | None, shooting: MultipleShooting, scale: Array
) -> OnIteration | None:
    """Return a function that hands the objective on in the user's units."""
    if on_iteration is None:
        return None
    return lambda iteration: on_iteration(
        replace(iteration, objective=shooting.unscaled(iteration.objective, scale))
    )


def _trajectory(problem: Problem, shooting: MultipleShooting, point: Point) -> Trajectory:
    stage, n = shooting.stage, shooting.mesh.intervals
    # an unconverged iterate may hold anything, but what is handed out is numbers
    states, controls = np.nan_to_num(point.states), np.nan_to_num(point.controls)
    if controls.shape[1] == n:
        controls = np.column_stack([controls, controls[:, -1]])
    time = np.linspace(0, point.duration, n + 1)
    wind = np.repeat(np.asarray(problem.wind_ned, float)[:, None], n + 1, axis=1)
    parameters = np.vstack([wind, time])
    outputs = np.nan_to_num(stage.function.map(n + 1)(states, controls, parameters)[1].full())
    return Trajectory(
        time=time,
        states=dict(zip(stage.states, states, strict=True)),
        controls=dict(zip(stage.controls, controls, strict=True)),
        outputs=dict(zip(stage.outputs, outputs, strict=True)),
        model=problem.vehicle.model_name,
        vehicle=problem.vehicle.name,
        problem=problem.name,
        control_interpolation=problem.control_interpolation,
    )
