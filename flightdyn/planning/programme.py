"""A programme that is built once and solved for many problems of its structure."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import casadi as cas
import numpy as np
from numpy.typing import NDArray

from ..dynamics.stage import Stage
from . import conditions
from .assembly import parameters
from .guess import Guess
from .layout import Layout, Structure
from .problem import Problem
from .solver import Iteration, Multipliers, OnIteration, Solution, Solver
from .transcription import Transcription

Array = NDArray[np.float64]

NEAR = 1e-4  # of a bound, scaled: at it, as far as an interior point comes


@dataclass(frozen=True)
class Attempt:
    """A solve and what it was made of.

    Parameters
    ----------
    problem : Problem
        What was solved: in arcs, or as it was given.
    structure : Structure
    layout : Layout
    solution : Solution
        Scaled.
    values : (size,)
        The variables in SI units.
    lower, upper : (size,)
        Their bounds in SI units.
    scale : (size,)
    multipliers : Multipliers
        Of bounds and constraints in SI units, of a cost in the user's.
    subject : int array (rows,)
        The variable that each constraint is about.
    objective : float
        In the user's units and sign.
    rough : bool
        Whether it was solved to a loose tolerance only.
    """

    problem: Problem
    structure: Structure
    layout: Layout
    solution: Solution
    values: Array
    lower: Array
    upper: Array
    scale: Array
    multipliers: Multipliers
    subject: NDArray[np.int64]
    objective: float
    rough: bool = False

    def quantity(self, variable: int) -> str:
        """Return the name of what a variable is a value of."""
        return str(self.layout.kinds[variable])

    def describe_gap(self, row: int) -> str:
        """Return words for a violated constraint."""
        variable = int(self.subject[row])
        gap = float(self.solution.gaps[row] * self.scale[variable])
        name, time = self.quantity(variable), self.layout.time(variable, self.values)
        at = '' if time is None else f' at {time:.3g} s'
        if name in (*self.layout.state_names, *self.layout.control_names):
            return f'{name} does not follow the dynamics{at} (off by {abs(gap):.3g})'
        return (
            f'{name}{at} is {self.values[variable] - gap:.4g}, {abs(gap):.3g} '
            f'{"below" if gap > 0 else "above"} what it must be'
        )

    def at_bounds(self) -> dict[str, float]:
        """Return which share of its values each quantity has at a bound, those fixed left out."""
        free = self.lower < self.upper
        room = np.minimum(self.values - self.lower, self.upper - self.values) / self.scale
        near = free & (room < NEAR)
        counts: dict[str, list[int]] = {}
        for variable in np.flatnonzero(free):
            count = counts.setdefault(self.quantity(int(variable)), [0, 0])
            count[0] += int(near[variable])
            count[1] += 1
        return {name: met / total for name, (met, total) in counts.items() if met}


class Programme:
    """A programme and its solver; for one thread at a time."""

    def __init__(self, stage: Stage, structure: Structure) -> None:
        self.transcription = Transcription(stage, structure)
        self.layout, self.structure = self.transcription.layout, structure
        made = self.transcription.programme
        self._solver = Solver(made, self.transcription.derivatives)
        self._values = cas.Function('values', [made['x'], made['p']], [made['g']])

    def solve(
        self,
        problem: Problem,
        start: Array | None = None,
        *,
        max_wall_time: float,
        strategy: str = 'monotone',
        multipliers: Multipliers | None = None,
        most_iterations: int | None = None,
        on_iteration: OnIteration | None = None,
        should_stop: Callable[[], bool] | None = None,
    ) -> Attempt:
        """Return the last iterate for a problem of this structure.

        Parameters
        ----------
        start : (size,)
            Variables in SI units to start from, instead of the problem's guess.
        multipliers : Multipliers
            As an `Attempt` has them.
        """
        layout, subject = self.layout, self.transcription.subject
        lower, upper = conditions.bounds(problem, layout)
        story = Guess(problem)
        scale = conditions.scales(problem, story, layout)
        values = conditions.guess(story, layout) if start is None else start.copy()
        full = values.copy()
        full[layout.controls] = scale[layout.controls]
        for point in (values, full):
            self._follow(point, problem, scale, everything=start is None)
        values, full = np.clip(values, lower, upper), np.clip(full, lower, upper)
        sums = np.maximum(*(np.abs(point[layout.integrals]) for point in (values, full)))
        scale[layout.integrals] = np.where(sums > 0, sums, 1.0)
        given = parameters(problem.wind_ned, scale, scale[subject], 1.0)
        given[-1] = price = self._price((values, full), scale, given, lower < upper)
        sign = self.structure.objective.sign
        solution = self._solver.solve(
            values / scale,
            lower / scale,
            upper / scale,
            given,
            max_wall_time=max_wall_time,
            strategy=strategy,
            multipliers=multipliers and multipliers.scaled(scale / price, scale[subject] / price),
            most_iterations=most_iterations,
            on_iteration=_in_units(on_iteration, sign * price, scale),
            should_stop=should_stop,
        )
        return Attempt(
            problem=problem,
            structure=self.structure,
            layout=layout,
            solution=solution,
            values=solution.variables * scale,
            lower=lower,
            upper=upper,
            scale=scale,
            multipliers=solution.multipliers.scaled(price / scale, price / scale[subject]),
            subject=subject,
            objective=sign * price * solution.cost,
            rough=strategy == 'rough',
        )

    def _follow(self, values: Array, problem: Problem, scale: Array, *, everything: bool) -> None:
        """Set integrals, and bounded outputs, to what they are at given states."""
        layout, subject = self.layout, self.transcription.subject
        following = layout.integrals
        if everything:
            following = np.concatenate([following, layout.outputs])
        if following.size:
            given = parameters(problem.wind_ned, scale, scale[subject], 1.0)
            gaps = self._values(values / scale, given).full().ravel() * scale[subject]
            rows = np.isin(subject, following)
            values[subject[rows]] -= np.nan_to_num(gaps[rows])

    def _price(
        self, points: tuple[Array, ...], scale: Array, given: Array, free: NDArray[np.bool_]
    ) -> float:
        """Return the scale of the cost.

        With it a change of all variables by their scales changes the scaled cost by about 1: at
        the guess, or at full controls: where the guess is no effort, effort has no slope.
        """
        found = [0.0]
        for point in points:
            slope = self.transcription.derivatives['grad_f'](point / scale, given)[1]
            total = float(np.abs(slope.full().ravel()[free]).sum())
            found.append(total if np.isfinite(total) else 0.0)
        return max(found) or 1.0


def _in_units(on_iteration: OnIteration | None, price: float, scale: Array) -> OnIteration | None:
    """Return a function that hands the objective and the variables on in the user's units."""
    if on_iteration is None:
        return None

    def hand_on(iteration: Iteration) -> None:
        assert iteration.variables is not None
        on_iteration(
            replace(
                iteration,
                objective=iteration.objective * price,
                variables=iteration.variables * scale,
            )
        )

    return hand_on


class Programmes:
    """Programmes by structure, for any number of threads at once.

    A solver object of CasADi may not be used by two threads at once: of each structure there are
    as many programmes as were needed at a time. They share the stage's functions, which keep
    nothing from one evaluation to the next.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._lock = threading.Lock()
        self._idle: dict[tuple[str, Structure], list[Programme]] = {}

    @contextmanager
    def borrow(self, key: str, stage: Stage, structure: Structure) -> Iterator[Programme]:
        """Lend a programme; it is built if none is idle.

        Parameters
        ----------
        key : str
            Tells stages apart.
        """
        place = key, structure
        with self._lock:
            idle = self._idle.get(place)
            programme = idle.pop() if idle else None
        if programme is None:
            programme = Programme(stage, structure)
        try:
            yield programme
        finally:
            with self._lock:
                self._idle.setdefault(place, []).append(programme)
                while sum(map(len, self._idle.values())) > self._most:
                    oldest = next(iter(self._idle))
                    self._idle[oldest].pop()
                    if not self._idle[oldest]:
                        del self._idle[oldest]
