"""A function that a programme evaluates at many points."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import zip_longest

import casadi as cas

from .spread import MANY, can_be_spread, spread

HEAVY = 2_000_000  # operations, a few milliseconds: starting threads takes a tenth of one


@dataclass(frozen=True)
class Pointwise:
    """A function of columns, and how it is had quickest at many of them.

    Parameters
    ----------
    one : Function
    wide : Function, optional
        What `one` is, mapped over a few columns, compiled.
    """

    one: cas.Function
    wide: cas.Function | None = None

    def at(self, points: Sequence[cas.MX]) -> list[cas.MX]:
        """Return the values at n points.

        Parameters
        ----------
        points : for each input (rows, n)

        Returns
        -------
        for each output (rows, n columns)
        """
        n = points[0].size2()
        if self.wide is None:
            return list(self._interpreted(n).call(points))
        lanes = self.wide.size2_in(0) // self.one.size2_in(0)
        blocks = -(-n // lanes)
        missing = blocks * lanes - n
        filled = [cas.horzcat(p, cas.repmat(p[:, -1], 1, missing)) for p in points]
        values = self.wide.map(blocks).call(filled)
        return [
            value[:, : n * self.one.size2_out(i)] if missing else value
            for i, value in enumerate(values)
        ]

    def _interpreted(self, n: int) -> cas.Function:
        """Return the function mapped over n columns, on every core where that pays."""
        if n >= MANY and can_be_spread(self.one):
            return spread(self.one, n)
        cores = min(len(os.sched_getaffinity(0)), n)
        interpreted = self.one.is_a('SXFunction')
        if cores > 1 and interpreted and self.one.n_instructions() * n > HEAVY:
            return self.one.map(n, 'thread', cores)
        return self.one.map(n)


def pointwise(
    functions: Sequence[cas.Function], wide: Sequence[cas.Function] = ()
) -> list[Pointwise]:
    """Return functions with their wide forms, if there are any."""
    return [Pointwise(*pair) for pair in zip_longest(functions, wide)]
