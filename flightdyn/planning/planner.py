"""From a problem to a verified plan."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..errors import ResultCode
from ..trajectory import Trajectory
from .problem import Problem
from .solver import OnIteration, Solution, Solver
from .transcription import Mesh, MultipleShooting, Point
from .verify import Verification, verify

FIRST_SUBSTEPS = 1
MAX_SUBSTEPS = 16
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

        RK4 substeps are doubled and the problem solved again from where it stands until the
        plan's error, flown again, is under the problem's tolerance.

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
        substeps = FIRST_SUBSTEPS
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
                on_iteration=on_iteration,
                should_stop=should_stop,
            )
            iterations += solution.iterations
            guess = shooting.unpack(solution.variables, scale)
            verification = None
            if solution.code == ResultCode.SUCCESS:
                verification = verify(shooting.stage, mesh, guess, tuple(problem.wind_ned))
                if verification.worst > problem.tolerance and substeps < MAX_SUBSTEPS:
                    substeps *= 2
                    continue
            report = _report(
                problem,
                shooting,
                solution,
                guess,
                verification,
                iterations=iterations,
                build_s=build_s,
                wall_s=time.perf_counter() - started,
            )
            return Plan(
                _trajectory(problem, shooting, guess), report, tuple(map(float, problem.wind_ned))
            )

    def _build(self, problem: Problem, mesh: Mesh) -> tuple[MultipleShooting, Solver]:
        key = repr((problem.vehicle, problem.objective, mesh))
        with self._lock:
            if key not in self._built:
                shooting = MultipleShooting(problem.vehicle.model().stage(), mesh)
                while len(self._built) >= MAX_CACHED:
                    self._built.pop(next(iter(self._built)))
                self._built[key] = (shooting, Solver(shooting.programme, shooting.derivatives))
            return self._built[key]


def _report(
    problem: Problem,
    shooting: MultipleShooting,
    solution: Solution,
    point: Point,
    verification: Verification | None,
    **numbers: Any,
) -> PlanReport:
    code = solution.code
    verified = verification is not None and verification.worst <= problem.tolerance
    if code == ResultCode.SUCCESS and not verified:
        code = ResultCode.NOT_VERIFIED
    return PlanReport(
        code=code,
        converged=solution.code == ResultCode.SUCCESS,
        verified=verified,
        status=solution.status,
        message=_message(code, problem, shooting, solution, verification),
        objective=point.duration,
        final_time=point.duration,
        nodes=problem.nodes,
        transcription=str(shooting.mesh),
        verification=verification.errors if verification else {},
        constraint_violation=solution.violation,
        warnings=(
            ['solved to a looser tolerance than asked for']
            if solution.status == 'Solved_To_Acceptable_Level'
            else []
        ),
        **numbers,
    )


def _message(
    code: ResultCode,
    problem: Problem,
    shooting: MultipleShooting,
    solution: Solution,
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
    worst = int(np.argmax(np.abs(solution.gaps)))
    gap = shooting.describe_gap(worst, shooting.scale(problem), float(solution.gaps[worst]))
    advice = {
        ResultCode.INFEASIBLE: 'loosen bounds or duration, or give a better guess',
        ResultCode.ITERATION_LIMIT: 'give a better guess',
        ResultCode.BAD_REQUEST: 'free some of the fixed values',
    }.get(code, 'try another guess or number of nodes')
    return f'{solution.status}: {gap}; {advice}'


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
