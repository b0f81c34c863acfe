"""Plans and what is said of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..environment.surroundings import NOTHING, Surroundings
from ..environment.wind import Wind
from ..errors import ResultCode
from ..trajectory import Trajectory
from .alternatives import Alternative
from .problem import Problem
from .programme import Attempt
from .samples import Path
from .verify import Verification

Array = NDArray[np.float64]

MAX_NAMED = 3  # conflicting constraints in a message
WORTH_NAMING = 0.2  # of the worst violation, in scaled terms


@dataclass(frozen=True, kw_only=True)
class PlanReport:
    """How a plan came about and what it is worth; times in seconds.

    Parameters
    ----------
    arcs : list of {'start', 'end', 'limits': {control: 'lower' or 'upper'}}
        Where controls are at their limits, if the plan consists of such arcs.
    phases : list of {'name', 'start', 'end'}
        Of the problem, with their times [s]; empty for a flight in one.
    remedies : list of str
        What was tried, beyond a plain solve, to get there.
    missed : list of {'quantity', 'time', 'value', 'bound', 'amount'}
        Conditions that the nearest flight misses, where none keeps them all.
    """

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
    arcs: list[dict[str, Any]] = field(default_factory=list)
    phases: list[dict[str, Any]] = field(default_factory=list)
    remedies: list[str] = field(default_factory=list)
    missed: list[dict[str, Any]] = field(default_factory=list)


@dataclass(frozen=True)
class Plan:
    """A trajectory and its report; unless `report.verified`, it is only the last iterate.

    Parameters
    ----------
    trajectory : Trajectory
        Controls between its samples are as flown: held, or straight.
    wind_ned : x, y, z [m/s]
    wind : Wind or None
    surroundings : Surroundings
        As the problem has them.
    others : list of Plan
        Other local optima that were found, if they were asked for, best first.
    near : bool
        Whether its solve started from another plan.
    alternatives : list of Alternative
        What came of each of the problem's alternatives, this plan's first; empty if it has none.
    """

    trajectory: Trajectory
    report: PlanReport
    wind_ned: tuple[float, ...] = (0.0, 0.0, 0.0)
    wind: Wind | None = None
    surroundings: Surroundings = NOTHING
    others: list['Plan'] = field(default_factory=list)
    near: bool = False
    alternatives: list[Alternative] = field(default_factory=list)
    attempt: Attempt | None = field(default=None, repr=False, compare=False)


def trajectory_of(problem: Problem, way: Path, states: Array) -> Trajectory:
    """Return a path as a trajectory.

    Parameters
    ----------
    states : (nx, m + 1)
        At all times of the path.
    """
    stage = problem.stage
    # an unconverged iterate may hold anything, but what is handed out is numbers
    states = np.nan_to_num(states)
    controls = np.nan_to_num(np.column_stack([way.begin, way.end[:, -1]]))
    n = way.time.size
    parameters = np.vstack([np.repeat(way.wind[:, None], n, axis=1), way.time])
    outputs = np.nan_to_num(stage.function.map(n)(states, controls, parameters)[1].full())
    return Trajectory(
        time=way.time,
        states=dict(zip(stage.states, states, strict=True)),
        controls=dict(zip(stage.controls, controls, strict=True)),
        outputs=dict(zip(stage.outputs, outputs, strict=True)),
        model=problem.vehicle.model_name,
        vehicle=problem.vehicle.name,
        problem=problem.name,
        control_interpolation='previous' if way.held else 'linear',
    )


def message_of(
    code: ResultCode,
    problem: Problem,
    attempt: Attempt,
    verification: Verification | None,
    missing: Sequence[Mapping[str, Any]] = (),
) -> str:
    """Return what happened in one sentence and, after a failure, what to change."""
    nodes = attempt.structure.mesh.intervals
    if code == ResultCode.SUCCESS and verification is not None:
        return (
            f'solved and verified: flown again, {verification.worst_state} is off by '
            f'{verification.errors[verification.worst_state]:.2g}'
        )
    if code == ResultCode.NOT_VERIFIED and verification is not None:
        return (
            f'solved, but flown again {verification.worst_state} is off by '
            f'{verification.errors[verification.worst_state]:.3g}: raise nodes (now {nodes})'
        )
    if code == ResultCode.CANCELLED:
        return 'cancelled; the last iterate is attached'
    if code == ResultCode.TIME_LIMIT:
        return (
            f'stopped after max_wall_time = {problem.max_wall_time:g} s; '
            'allow more, or lower nodes'
        )
    status = attempt.solution.status
    if status == 'Invalid_Number_Detected':
        return (
            f'{status}: the model gives values that are not numbers; keep the guess and the path '
            'bounds away from where it is singular'
        )
    if missing:
        return f'{status}: no flight was found that keeps all conditions; in the nearest one ' + (
            f'{in_words(missing)}; loosen these, or give a better guess'
        )
    gap = _conflict(attempt) + _in_force(attempt)
    advice = {
        ResultCode.INFEASIBLE: 'loosen bounds or duration, or give a better guess',
        ResultCode.ITERATION_LIMIT: 'give a better guess',
        ResultCode.BAD_REQUEST: 'free some of the fixed values',
    }.get(code, 'try another guess or number of nodes')
    return f'{status}: {gap}; {advice}'


def in_words(missing: Sequence[Mapping[str, Any]]) -> str:
    """Return in words which conditions are missed, and by how much."""
    parts = []
    for each in missing[:MAX_NAMED]:
        at = '' if each['time'] is None else f' at {each["time"]:.3g} s'
        side = 'below' if each['value'] < each['bound'] else 'above'
        parts.append(
            f'{each["quantity"]}{at} is {each["value"]:.4g}, '
            f'{each["amount"]:.3g} {side} {each["bound"]:.4g}'
        )
    return '; '.join(parts)


def _conflict(attempt: Attempt) -> str:
    """Return words for the most violated constraints, one for each quantity."""
    gaps = np.abs(np.nan_to_num(attempt.solution.gaps))
    found: dict[str, str] = {}
    for row in np.argsort(-gaps, kind='stable'):
        if found and (len(found) == MAX_NAMED or gaps[row] < WORTH_NAMING * gaps.max()):
            break
        name = attempt.quantity(int(attempt.subject[row]))
        if name not in found:
            found[name] = attempt.describe_gap(int(row))
    return '; '.join(found.values())


def _in_force(attempt: Attempt) -> str:
    """Return words for the bounds that an infeasible point lies at most."""
    if attempt.solution.code != ResultCode.INFEASIBLE:
        return ''
    met = attempt.at_bounds()
    most = sorted(met, key=lambda name: -met[name])[:MAX_NAMED]
    return f'; at their bounds: {", ".join(most)}' if most else ''
