"""Initial guesses: a storyboard, a trajectory, or straight lines between the ends."""

import math

import numpy as np
from numpy.typing import NDArray

from .problem import Problem

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
        values = np.interp(fractions, [0, 1], _ends(problem, name))
    return np.clip(values, *problem.limits(name))


def _ends(problem: Problem, name: str) -> tuple[float, float]:
    """Return guesses at both ends; where only one is bounded, the other is the same."""
    limits = problem.limits(name)
    rest = dict(zip(problem.stage.states, problem.stage.rest, strict=True))
    middle = _middle(limits, rest.get(name, 0.0))
    first = problem.initial.get(name, problem.final.get(name, limits))
    last = problem.final.get(name, first)
    return _middle(first, middle), _middle(last, middle)


def _middle(bounds: tuple[float, float], default: float) -> float:
    lower, upper = bounds
    if math.isinf(lower) and math.isinf(upper):
        return default
    if math.isinf(lower) or math.isinf(upper):
        return upper if math.isinf(lower) else lower
    return (lower + upper) / 2
