"""Initial guesses: storyboards, a trajectory, or straight lines between what is known.

States that a storyboard does not name follow from those that it does: the rates that make them
move as told. A guess that fits together takes half the iterations, and more guesses end well.
"""

import math
from functools import cached_property

import casadi as cas
import numpy as np
from numpy.typing import NDArray

from .problem import UNBOUNDED, Bounds, Problem

Array = NDArray[np.float64]

POINTS = 41  # of a phase, at which states that follow are worked out
STEPS = 6  # of Gauss and Newton
NUDGE = 1e-6  # of a state's size: for differences
NOTHING = 1e-6  # singular values below this part of the largest: what nothing tells stays


class Guess:
    """A problem's first guess of states, controls and durations.

    Parameters
    ----------
    problem : Problem
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._found: dict[int, dict[str, Array]] = {}

    @cached_property
    def durations(self) -> Array:
        """Of each phase (phases,) [s], within its bounds."""
        legs = self._problem.legs
        guess = np.array([leg.duration_guess for leg in legs])
        if self._problem.guess_trajectory is not None:
            guess *= self._problem.guess_trajectory.duration / guess.sum()
        lower, upper = np.array([leg.duration for leg in legs]).T
        durations: Array = np.clip(guess, lower, upper)
        return durations

    def named(self, leg: int) -> list[str]:
        """Return the states that a storyboard names, or the trajectory has."""
        given = {*self._problem.legs[leg].guess, *self._problem.guess}
        if self._problem.guess_trajectory is not None:
            given |= set(self._problem.guess_trajectory.columns)
        return [name for name in self._problem.stage.states if name in given]

    def columns(self, names: tuple[str, ...], leg: int, fractions: Array) -> Array:
        """Return states or controls (len(names), n) at fractions 0..1 of a phase."""
        follow = self._follow(leg)
        at = np.linspace(0, 1, POINTS)
        columns = [
            np.interp(fractions, at, follow[name])
            if name in follow
            else self._told(name, leg, fractions)
            for name in names
        ]
        return np.array(columns).reshape(len(names), -1)

    def _told(self, name: str, leg: int, fractions: Array) -> Array:
        problem, durations = self._problem, self.durations
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

    def _follow(self, leg: int) -> dict[str, Array]:
        """Return the states that follow from those named, at equal steps of a phase."""
        if leg not in self._found:
            self._found[leg] = self._following(leg)
        return self._found[leg]

    def _following(self, leg: int) -> dict[str, Array]:
        problem, stage = self._problem, self._problem.stage
        leading = self.named(leg)
        rows = [stage.states.index(name) for name in leading]
        others = [row for row in range(len(stage.states)) if row not in rows]
        # those that the leading ones' rates depend on
        pattern = np.array(cas.DM(stage.function.jac_sparsity(0, 0), 1).full() != 0)
        others = [row for row in others if pattern[rows, row].any()]
        if not rows or not others:
            return {}
        at = np.linspace(0, 1, POINTS)
        told = x = np.array([self._told(name, leg, at) for name in stage.states])
        u = np.array([self._told(name, leg, at) for name in stage.controls])
        u = u.reshape(len(stage.controls), POINTS)
        elapsed = (self.durations[:leg].sum() + at * self.durations[leg]).reshape(1, -1)
        wind = np.repeat(np.array([problem.wind_ned], dtype=float).T, POINTS, axis=1)
        p = np.vstack([wind, elapsed])
        wanted = np.gradient(x[rows], elapsed[0], axis=1)
        sizes = np.maximum(np.abs(wanted).max(axis=1, keepdims=True), 1e-9)
        limits = np.array([problem.limits(stage.states[row], leg) for row in others])

        mapped = stage.function.map(POINTS)

        def misses(states: Array) -> Array:
            rates = mapped(states, u, p)[0].full()[rows]
            found: Array = np.nan_to_num((rates - wanted) / sizes, nan=1e6)
            return found

        off = misses(x)
        for _ in range(STEPS):
            slopes = np.empty((POINTS, len(rows), len(others)))
            for j, row in enumerate(others):
                nudged, step = x.copy(), NUDGE * np.maximum(np.abs(x[row]), 1.0)
                nudged[row] += step
                slopes[:, :, j] = ((misses(nudged) - off) / step).T
            # the least change that does it
            change = np.einsum('kij,jk->ik', np.linalg.pinv(slopes, rcond=NOTHING), off)
            then = x.copy()
            then[others] = np.clip(x[others] - change, limits[:, :1], limits[:, 1:])
            off_then = misses(then)
            better = (off_then**2).sum(axis=0) < (off**2).sum(axis=0)
            if not better.any():
                break
            x = np.where(better, then, x)
            off = np.where(better, off_then, off)
        # less is rounding, not motion
        moved = np.abs(x - told) > NUDGE * np.maximum(np.abs(told), 1.0)
        return {stage.states[row]: x[row] for row in others if moved[row].any()}


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
