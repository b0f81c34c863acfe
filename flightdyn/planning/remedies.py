"""What is tried when a plain solve fails, and what is learned if nothing helps."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import conditions
from .guess import Guess
from .layout import Structure
from .objective import minimize
from .problem import Phase, Problem
from .programme import Attempt

Array = NDArray[np.float64]

MISSED = 1e-5  # of a quantity's scale: a condition is not kept
POINTS = 13  # of a perturbed storyboard
WAVES = 3
SWAY = 0.5  # of a quantity's scale: how far a storyboard is bent
STRETCH = 0.7  # logarithm of how much longer or shorter a flight is guessed


def softened(problem: Problem, attempt: Attempt) -> tuple[Problem, Structure]:
    """Return a problem and structure whose solution comes as near to the conditions as it can.

    Nothing else is minimized. What the vehicle can do and where it starts stay hard.
    """
    soft = conditions.soft_conditions(problem, attempt.layout, attempt.scale)
    free = replace(problem, objective=minimize('0'), sharpen=False)
    structure = conditions.structure(free, attempt.structure.mesh)
    return free, replace(structure, soft=soft)


def missed(attempt: Attempt) -> list[dict[str, Any]]:
    """Return the conditions that a softened problem's solution misses, the worst of each kind.

    Returns
    -------
    list of {'quantity', 'time', 'value', 'bound', 'amount'}
        The largest amount over its scale first; time [s] is None for durations.
    """
    layout = attempt.layout
    worst: dict[tuple[str, str], tuple[float, dict[str, Any]]] = {}
    for i, (variable, _) in enumerate(layout.structure.soft):
        value = float(attempt.values[variable])
        companion = layout.companions[i]
        lower, upper = float(attempt.lower[companion]), float(attempt.upper[companion])
        amount = max(lower - value, value - upper)
        relative = amount / attempt.scale[variable]
        if relative <= MISSED:
            continue
        name = attempt.quantity(variable)
        bound = lower if lower - value > value - upper else upper
        entry = {
            'quantity': name,
            'time': layout.time(variable, attempt.values),
            'value': value,
            'bound': bound,
            'amount': amount,
        }
        key = name, 'end' if variable in layout.nodes[:, -1] else 'path'
        if key not in worst or relative > worst[key][0]:
            worst[key] = relative, entry
    return [entry for _, entry in sorted(worst.values(), key=lambda each: -each[0])]


def without_soft(attempt: Attempt, size: int) -> Array:
    """Return a softened problem's solution as the variables (size,) of the problem itself."""
    return attempt.values[:size].copy()


def perturbed(problem: Problem, seed: int) -> Problem:
    """Return the problem with another guess: its own, bent and stretched at random.

    Controls are drawn anew within their limits. The same seed gives the same guess.
    """
    rng = np.random.default_rng([seed, 20])
    factor = float(np.exp(rng.uniform(-STRETCH, STRETCH)))
    at = np.linspace(0, 1, POINTS)
    story = Guess(problem)
    names = problem.stage.states
    storyboards: list[dict[str, tuple[float, ...]]] = []
    swing = {name: rng.uniform(-1, 1, WAVES) / np.arange(1, WAVES + 1) for name in names}
    for i in range(len(problem.legs)):
        waves = np.sin(np.pi * np.arange(1, WAVES + 1)[:, None] * at)
        board = {}
        for name in names:
            own = story.columns((name,), i, at)[0]
            size = max(float(np.abs(own).max()), float(np.ptp(own)), 1e-3)
            board[name] = tuple((own + SWAY * size * swing[name] @ waves).tolist())
        for name in problem.stage.controls:
            own = story.columns((name,), i, at)[0]
            lower, upper = problem.limits(name, i)
            if np.isfinite([lower, upper]).all():
                knots = rng.uniform(lower, upper, 4)
                own = np.interp(at, np.linspace(0, 1, 4), knots)
            board[name] = tuple(own.tolist())
        storyboards.append(board)
    durations = [
        float(np.clip(guess * factor, *leg.duration))
        for guess, leg in zip(story.durations, problem.legs, strict=True)
    ]
    if not problem.phases:
        return replace(
            problem,
            guess_trajectory=None,
            guess=storyboards[0],
            duration_guess=durations[0],
        )
    phases: list[Phase] = [
        replace(phase, guess=board, duration_guess=duration)
        for phase, board, duration in zip(problem.phases, storyboards, durations, strict=True)
    ]
    return replace(problem, guess_trajectory=None, guess={}, phases=tuple(phases))
