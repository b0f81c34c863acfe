"""Initial guesses: storyboards, a trajectory, or straight lines between what is known."""

import math

import numpy as np
from numpy.typing import NDArray

from .problem import UNBOUNDED, Bounds, Problem

Array = NDArray[np.float64]


def guess_durations(problem: Problem) -> Array:
    """Return the guessed duration of each phase (phases,) [s], within its bounds."""
    legs = problem.legs
    guess = np.array([leg.duration_guess for leg in legs])
    if problem.guess_trajectory is not None:
        guess *= problem.guess_trajectory.duration / guess.sum()
    lower, upper = np.array([leg.duration for leg in legs]).T
    durations: Array = np.clip(guess, lower, upper)
    return durations


def guess_columns(problem: Problem, names: tuple[str, ...], leg: int, fractions: Array) -> Array:
    """Return guessed states or controls (len(names), n) at fractions 0..1 of a phase."""
    columns = [_guess(problem, name, leg, fractions) for name in names]
    return np.array(columns).reshape(len(names), -1)


def _guess(problem: Problem, name: str, leg: int, fractions: Array) -> Array:
    durations = guess_durations(problem)
    done = durations[:leg].sum()
    overall = (done + fractions * durations[leg]) / durations.sum()
    trajectory = problem.guess_trajectory
    own = problem.legs[leg].guess
    if trajectory is not None and name in trajectory:
        values = trajectory.sample(name, trajectory.time[0] + overall * trajectory.duration)
    elif name in own:
        values = np.interp(fractions, np.linspace(0, 1, len(own[name])), own[name])
    elif name in problem.guess:
        points = problem.guess[name]
        values = np.interp(overall, np.linspace(0, 1, len(points)), points)
    else:
        values = np.interp(overall, *_known(problem, name, durations))
    return np.clip(values, *problem.limits(name, leg))


def _known(problem: Problem, name: str, durations: Array) -> tuple[list[float], list[float]]:
    """Return where, in fractions of the whole, something is known of a quantity, and what."""
    legs = problem.legs
    rest = dict(zip(problem.stage.states, problem.stage.rest, strict=True))
    edges = np.concatenate([[0.0], np.cumsum(durations)]) / durations.sum()
    where, values = [], []
    for i, edge in enumerate(edges.tolist()):
        given: list[Bounds] = [legs[i].initial] if i < len(legs) else []
        given += [legs[i - 1].final] if i else []
        bounds = [group[name] for group in given if name in group]
        if bounds:
            limits = problem.limits(name, min(i, len(legs) - 1))
            middle = _middle(limits, rest.get(name, 0.0))
            where.append(edge)
            values.append(_middle(bounds[0], middle))
    if not where:
        where, values = [0.0], [_middle(problem.limits(name), rest.get(name, 0.0))]
    return where, values


def _middle(bounds: tuple[float, float], default: float) -> float:
    lower, upper = bounds
    if bounds == UNBOUNDED:
        return default
    if math.isinf(lower) or math.isinf(upper):
        return upper if math.isinf(lower) else lower
    return (lower + upper) / 2
