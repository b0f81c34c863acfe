"""Verification: fly the planned controls again and measure how far the plan is off."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import casadi as cas
import numpy as np
from numpy.typing import NDArray

from ..dynamics.stage import Stage
from ..simulation.integrator import reintegrate, rk4_step
from .objective import Costs, with_integrals
from .transcription import Mesh, Point

Array = NDArray[np.float64]

BETWEEN = (0.25, 0.5, 0.75)  # where in an interval bounds are looked at


@dataclass(frozen=True)
class Verification:
    """Largest error of each state against the flight, and the largest one over its range.

    An objective with integrals has its error among those of the states, as `objective`.
    """

    errors: dict[str, float]
    worst: float
    worst_state: str


def verify(
    stage: Stage,
    mesh: Mesh,
    point: Point,
    wind: tuple[float, ...],
    costs: Costs | None = None,
    objective: float = 0.0,
) -> Verification:
    """Return how far the nodes, and integrals, are from the flight that starts at the first node.

    The whole plan is flown open-loop by CVODES, so errors build up as they would in the air.

    Parameters
    ----------
    costs, objective : Costs, float
        The objective's functions and its planned value, in the user's units and sign.
    """
    n = mesh.intervals
    u_begin, u_end = _controls(mesh, point)
    time = np.linspace(0, point.duration, n + 1)
    count = costs.count if costs is not None else 0
    flying = with_integrals(stage, costs.rates) if costs is not None and count else stage
    start = np.concatenate([point.states[:, 0], np.zeros(count)])
    flown = reintegrate(flying, start, time, u_begin, u_end, wind)
    errors = np.abs(flown[: len(stage.states)] - point.states).max(axis=1)
    ranges = np.maximum(np.ptp(point.states, axis=1), 1.0)
    names = stage.states
    if costs is not None and count:
        states, controls = point.states, point.controls
        ends = costs.ends(
            *(states[:, 0], controls[:, 0], states[:, -1], controls[:, -1], wind, point.duration)
        )
        weights = costs.weights(point.duration).full().ravel()
        integrals = flown[-count:]
        names = (*names, 'objective')
        errors = np.append(errors, abs(float(ends) + weights @ integrals[:, -1] - objective))
        ranges = np.append(ranges, np.abs(weights) @ np.ptp(integrals, axis=1) or 1.0)
    relative = np.nan_to_num(errors / ranges, nan=np.inf)
    worst = int(np.argmax(relative))
    return Verification(
        errors=dict(zip(names, errors.tolist(), strict=True)),
        worst=float(relative[worst]),
        worst_state=names[worst],
    )


def step_error(stage: Stage, mesh: Mesh, point: Point, wind: tuple[float, ...]) -> float:
    """Return the most that twice the substeps would change a state in any interval.

    Over the range of the state, or over 1; infinite if the model gives no numbers.
    """
    n = mesh.intervals
    step = point.duration / n
    p = np.vstack([np.repeat(np.array(wind, float)[:, None], n, axis=1), np.arange(n) * step])
    once, twice = (
        _mapped_step(stage, substeps, n)(point.states[:, :n], *_controls(mesh, point), p, step)
        for substeps in (mesh.substeps, 2 * mesh.substeps)
    )
    ranges = np.maximum(np.ptp(point.states, axis=1), 1.0)
    return float(
        np.nan_to_num(np.abs((twice - once).full()).max(axis=1) / ranges, nan=np.inf).max()
    )


def overshoots(
    stage: Stage,
    mesh: Mesh,
    point: Point,
    wind: tuple[float, ...],
    path: Mapping[str, tuple[float, float]],
    tolerance: float,
) -> list[str]:
    """Return words for each quantity that leaves its bounds between the nodes, where they hold.

    Parameters
    ----------
    path : mapping of state, control or output name to (lower, upper)
    tolerance : float
        What is not yet worth a word, over the quantity's range or 1.
    """
    if not path:
        return []
    n = mesh.intervals
    u_begin, u_end = _controls(mesh, point)
    step = point.duration / n
    x, u, times = [], [], []
    for fraction in BETWEEN:
        time = np.arange(n) * step
        p = np.vstack([np.repeat(np.array(wind, float)[:, None], n, axis=1), time])
        reached = u_begin + fraction * (u_end - u_begin)
        fly = _mapped_step(stage, mesh.substeps, n)
        x.append(fly(point.states[:, :n], u_begin, reached, p, fraction * step).full())
        u.append(reached)
        times.append(time + fraction * step)
    states, controls, time = np.hstack(x), np.hstack(u), np.concatenate(times)
    p = np.vstack([np.repeat(np.array(wind, float)[:, None], time.size, axis=1), time])
    outputs = stage.function.map(time.size)(states, controls, p)[1].full()
    names = (*stage.states, *stage.controls, *stage.outputs)
    values = dict(zip(names, np.vstack([states, controls, outputs]), strict=True))
    found = []
    for name, (lower, upper) in path.items():
        beyond = np.maximum(lower - values[name], values[name] - upper)
        worst = int(np.argmax(beyond))
        if beyond[worst] > tolerance * max(float(np.ptp(values[name])), 1.0):
            found.append(
                f'{name} is {values[name][worst]:.4g} at {time[worst]:.3g} s, between nodes: '
                f'{beyond[worst]:.2g} beyond its bounds'
            )
    return found


@lru_cache(maxsize=32)
def _mapped_step(stage: Stage, substeps: int, n: int) -> cas.Function:
    return rk4_step(stage, substeps).map(n)


def _controls(mesh: Mesh, point: Point) -> tuple[Array, Array]:
    """Return the controls at the beginning and the end of each interval."""
    begin = point.controls[:, : mesh.intervals]
    return begin, point.controls[:, 1:] if mesh.control_interpolation == 'linear' else begin
