"""Verification: fly the planned controls again and measure how far the plan is off."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..dynamics.stage import Stage
from ..simulation.integrator import reintegrate
from .samples import Path, flown

Array = NDArray[np.float64]

SURE = 0.01  # of the tolerance: how far two flights of different steps may differ
MAX_SUBSTEPS = 32


@dataclass(frozen=True)
class Verification:
    """Largest error of each state against the flight, and the largest one over its range.

    An objective with integrals has its error among those of the states, as `objective`.
    """

    errors: dict[str, float]
    worst: float
    worst_state: str


def refly(stage: Stage, start: Array, way: Path, tolerance: float) -> Array:
    """Return the states (nx, m + 1) of a path flown open-loop from its first state.

    By Dormand and Prince's fifth-order formula, which no transcription uses, in ever shorter
    steps until two flights agree to a hundredth of the tolerance; by CVODES where none do, as
    for stiff models. NaN if it cannot be flown.

    Parameters
    ----------
    start : (nx,)
        The first state, of this stage: it may have more of them than the path.
    tolerance : float
        Of errors over the range of each state, see `Path.ranges`.
    """
    ranges = np.ones(start.size)
    ranges[: way.ranges.size] = way.ranges
    substeps, coarse = 2, flown(stage, start, way, 1)
    while substeps <= MAX_SUBSTEPS:
        fine = flown(stage, start, way, substeps)
        ranges[way.ranges.size :] = np.maximum(np.ptp(fine[way.ranges.size :], axis=1), 1e-300)
        change = np.abs(fine - coarse).max(axis=1) / ranges
        # halving the steps leaves a thirty-second of a smooth flight's error
        if np.all(change <= SURE * tolerance):
            return fine
        substeps, coarse = substeps * 2, fine
    return reintegrate(stage, start, way.time, way.begin, way.end, way.wind)


def compare(
    names: tuple[str, ...], way: Path, states: Array, more: Mapping[str, tuple[float, float]]
) -> Verification:
    """Return how far planned states are from flown ones.

    Parameters
    ----------
    states : (nx, m + 1)
        Flown.
    more : mapping of name to (error, range)
        What else was compared.
    """
    off = np.abs(states[: len(names), way.planned] - way.states).max(axis=1)
    errors = {**dict(zip(names, off.tolist(), strict=True)), **{k: v[0] for k, v in more.items()}}
    ranges = {**dict(zip(names, way.ranges, strict=True)), **{k: v[1] for k, v in more.items()}}
    relative = {
        name: float(np.nan_to_num(error / ranges[name], nan=np.inf, posinf=np.inf))
        for name, error in errors.items()
    }
    worst = max(relative, key=lambda name: relative[name])
    return Verification(
        errors={k: float(np.nan_to_num(v, nan=np.inf)) for k, v in errors.items()},
        worst=relative[worst],
        worst_state=worst,
    )


def overshoots(
    time: Array,
    values: Mapping[str, Array],
    limits: Mapping[str, tuple[float, float]],
    tolerance: float,
) -> list[str]:
    """Return words for each quantity that leaves its bounds between the nodes, where they hold.

    Parameters
    ----------
    time : (n,)
    values : mapping of name to array (n,)
        What is planned, between the nodes as flown from them.
    limits : mapping of name to (lower, upper)
    tolerance : float
        What is not yet worth a word, over the quantity's range or 1.
    """
    found = []
    for name, (lower, upper) in limits.items():
        column = values[name]
        beyond = np.maximum(lower - column, column - upper)
        worst = int(np.argmax(beyond))
        if beyond[worst] > tolerance * max(float(np.ptp(column)), 1.0):
            found.append(
                f'{name} is {column[worst]:.4g} at {time[worst]:.3g} s, between nodes: '
                f'{beyond[worst]:.2g} beyond its bounds'
            )
    return found
