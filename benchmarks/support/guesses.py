"""Guesses off a problem's own, by chance but the same for the same generator."""

import numpy as np

from flightdyn.planning.guess import guess_columns
from flightdyn.planning.problem import Problem

POINTS = 5  # of each storyboard


def perturbed(problem: Problem, rng: np.random.Generator, spread: float) -> Problem:
    """Return a problem of one phase with every guessed state and control moved.

    Parameters
    ----------
    spread : float
        Standard deviation of what each point of a storyboard moves by, over the quantity's size:
        how far its guess runs, or a third of the room between its limits. The guessed duration
        is multiplied by a factor that varies as much.
    """
    stage, moved = problem.stage, {}
    for name in (*stage.states, *stage.controls):
        column = guess_columns(problem, (name,), 0, np.linspace(0, 1, POINTS))[0]
        lower, upper = problem.limits(name)
        size = np.ptp(column)
        if np.isfinite(upper - lower) and name in stage.controls:
            size = max(size, (upper - lower) / 3)
        moved[name] = tuple((column + spread * size * rng.standard_normal(POINTS)).tolist())
    duration = problem.duration_guess * float(np.exp(spread * rng.standard_normal() / 2))
    return problem.with_changes(
        guess=moved, duration_guess=float(np.clip(duration, *problem.duration))
    )
