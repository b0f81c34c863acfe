"""Initial guesses: a storyboard, a trajectory, or straight lines between the ends."""

import math

import numpy as np
from numpy.typing import NDArray

from .problem import Bounds, Problem

Array = NDArray[np.float64]


def guess_columns(problem: Problem, names: tuple[str, ...], fractions: Array) -> Array:
    """Return guessed states or controls (len(names), n) at fractions 0..1 of the duration."""
    return np.array([_guess(problem, name, fractions) for name in names]).reshape(len(names), -1)


def guess_duration(problem: Problem) -> float:
    """Return the guessed duration [s], within its bounds."""
    trajectory = problem.guess_trajectory
    guess = problem.duration_guess if trajectory is None else trajectory.duration
    return float(np.clip(guess, *problem.duration))


def _guess(problem: Problem, name: str, fractions: Array) -> Array:
    trajectory = problem.guess_trajectory
    if trajectory is not None and name in trajectory:
        times = trajectory.time[0] + fractions * trajectory.duration
        values = trajectory.sample(name, times)
    elif name in problem.guess:
        points = problem.guess[name]
        values = np.interp(fractions, np.linspace(0, 1, len(points)), points)
    else:
        middle = _middle(problem.limits(name), 0.0)
        ends = [_end(bounds, name, middle) for bounds in (problem.initial, problem.final)]
        values = np.interp(fractions, [0, 1], ends)
    return np.clip(values, *problem.limits(name))


def _end(bounds: Bounds, name: str, default: float) -> float:
    return _middle(bounds[name], default) if name in bounds else default


def _middle(bounds: tuple[float, float], default: float) -> float:
    lower, upper = bounds
    if math.isinf(lower) and math.isinf(upper):
        return default
    if math.isinf(lower) or math.isinf(upper):
        return upper if math.isinf(lower) else lower
    return (lower + upper) / 2
