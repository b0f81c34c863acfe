"""Meshes: where a plan's time is cut, and how states and controls run between the cuts."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from ..config import number
from ..errors import InputError

Array = NDArray[np.float64]
Index = NDArray[np.int64]

Method = Literal['multiple_shooting', 'radau', 'hermite_simpson', 'trapezoidal']
METHODS: tuple[str, ...] = get_args(Method)
ControlInterpolation = Literal['previous', 'linear', 'polynomial']
CONTROL_INTERPOLATIONS: tuple[str, ...] = get_args(ControlInterpolation)
Spacing = Literal['uniform', 'cosine'] | tuple[tuple[float, float], ...]
SPACINGS = ('uniform', 'cosine')

_ROOT = math.sqrt(6)
POINTS: dict[str, tuple[float, ...]] = {
    'trapezoidal': (0.0, 1.0),
    'hermite_simpson': (0.0, 0.5, 1.0),
    'radau': ((4 - _ROOT) / 10, (4 + _ROOT) / 10, 1.0),
    'multiple_shooting': (1.0,),
}
"""Where in an interval the equations of motion hold; shooting flies to its end."""

ORDERS = {'trapezoidal': 2, 'hermite_simpson': 4, 'radau': 5, 'multiple_shooting': 4}
"""Of the states' error at the nodes in the length of the intervals, for given controls."""

WORDS = {
    'trapezoidal': 'trapezoidal collocation',
    'hermite_simpson': 'Hermite-Simpson collocation',
    'radau': 'Radau collocation of order 5',
}


@dataclass(frozen=True)
class Scheme:
    """Collocation in an interval of length 1, in differential form.

    States at the points and their derivatives f satisfy D (x - x_start) = f + start f_start.

    Parameters
    ----------
    points : (s,)
        Where, without the interval's beginning.
    differences : (s, s)
        D.
    start : (s,)
        What the derivative at the beginning counts in each row; zeros if it is no point.
    at_start : bool
        Whether the beginning is a point.
    weights : (s + 1,)
        Quadrature at the beginning and the points.

    References
    ----------
    .. [1] Hairer, E., Wanner, G., *Solving Ordinary Differential Equations II*, 2nd edition,
       1996, section IV.5 (collocation; Radau IIA, Lobatto IIIA).
    """

    points: Array
    differences: Array
    start: Array
    at_start: bool
    weights: Array


def scheme(method: str) -> Scheme:
    """Return the collocation scheme of a method's points."""
    c = np.array(POINTS[method])
    # integrals of the Lagrange polynomials, from 0 to each point and to 1
    polynomials = [
        np.polynomial.Polynomial.fromroots(np.delete(c, j)) / np.prod(c[j] - np.delete(c, j))
        for j in range(c.size)
    ]
    integrals = np.array([[p.integ()(x) for p in polynomials] for x in (*c, 1.0)])
    at_start = bool(c[0] == 0)
    inner = integrals[:-1, :][c > 0][:, c > 0]
    differences = np.linalg.inv(inner)
    start = differences @ integrals[:-1, 0][c > 0] if at_start else np.zeros(len(inner))
    weights = integrals[-1] if at_start else np.concatenate([[0.0], integrals[-1]])
    return Scheme(c[c > 0], differences, start, at_start, weights)


@dataclass(frozen=True)
class Mesh:
    """Intervals in each phase, and the method in each.

    Parameters
    ----------
    cuts : a tuple for each phase
        Fractions of the phase's duration from 0 to 1, ascending.
    method : str
        `multiple_shooting` (RK4 in equal substeps), or collocation: `radau`, `hermite_simpson`,
        `trapezoidal`.
    control_interpolation : 'previous', 'linear' or 'polynomial'
        Controls are held over an interval, run linearly from node to node, or are in each
        interval the polynomial through values at its nodes and the method's points.
    substeps : int
        Of multiple shooting.
    """

    cuts: tuple[tuple[float, ...], ...]
    method: Method = 'multiple_shooting'
    control_interpolation: ControlInterpolation = 'previous'
    substeps: int = 1

    @classmethod
    def of(
        cls,
        intervals: Sequence[int],
        method: Method,
        control_interpolation: ControlInterpolation,
        *,
        spacing: Spacing = 'uniform',
        substeps: int = 1,
    ) -> 'Mesh':
        """Return a mesh of so many intervals in each phase."""
        return cls(
            tuple(tuple(spaced(n, spacing).tolist()) for n in intervals),
            method,
            control_interpolation,
            substeps,
        )

    @cached_property
    def phase(self) -> Index:
        """Phase of each interval (n,)."""
        return np.repeat(np.arange(len(self.cuts)), [len(cuts) - 1 for cuts in self.cuts])

    @cached_property
    def begin(self) -> Array:
        """Where each interval begins, as a fraction of its phase (n,)."""
        return np.concatenate([cuts[:-1] for cuts in self.cuts])

    @cached_property
    def length(self) -> Array:
        """Length of each interval, as a fraction of its phase (n,)."""
        return np.concatenate([np.diff(cuts) for cuts in self.cuts])

    @cached_property
    def intervals(self) -> int:
        """Number of intervals in all phases."""
        return self.phase.size

    @cached_property
    def edges(self) -> Index:
        """Node at which each phase begins, and the last node (phases + 1,)."""
        return np.concatenate([[0], np.cumsum([len(cuts) - 1 for cuts in self.cuts])])

    @cached_property
    def shooting(self) -> bool:
        """Whether intervals are flown by RK4."""
        return self.method == 'multiple_shooting'

    @cached_property
    def held(self) -> bool:
        """Whether controls are held."""
        return self.control_interpolation == 'previous'

    @cached_property
    def curved(self) -> bool:
        """Whether controls bend inside intervals."""
        return self.control_positions.size > 2

    @cached_property
    def points(self) -> Array:
        """Points of an interval at which states are variables, the end included (s,)."""
        points = np.array(POINTS[self.method])
        return points[points > 0]

    @cached_property
    def control_values(self) -> int:
        """Number of values of a control: one an interval if held, else one a node and point.

        Where a phase ends and the next begins there are two: controls may jump.
        """
        if self.held:
            return self.intervals
        return self.intervals * (self.control_positions.size - 1) + len(self.cuts)

    @cached_property
    def control_positions(self) -> Array:
        """Positions in an interval of its control values: the beginning first."""
        if self.held:
            return np.zeros(1)
        polynomial = self.control_interpolation == 'polynomial'
        return np.concatenate([[0.0], self.points if polynomial else [1.0]])

    @cached_property
    def steered(self) -> Array:
        """What each control value of an interval counts at its beginning and points."""
        return lagrange(self.control_positions, np.concatenate([[0.0], self.points]))

    def split(self, parts: Sequence[int]) -> 'Mesh':
        """Return the mesh with each interval cut into so many equal parts."""
        cuts, first = [], 0
        for old in self.cuts:
            counts = parts[first : first + len(old) - 1]
            pieces = [
                np.linspace(a, b, count, endpoint=False)
                for a, b, count in zip(old[:-1], old[1:], counts, strict=True)
            ]
            cuts.append((*np.concatenate(pieces).tolist(), 1.0))
            first += len(old) - 1
        return Mesh(tuple(cuts), self.method, self.control_interpolation, self.substeps)

    def __str__(self) -> str:
        how = f'multiple shooting, RK4 x{self.substeps}' if self.shooting else WORDS[self.method]
        phases = f' in {len(self.cuts)} phases' if len(self.cuts) > 1 else ''
        return f'{how}, {self.control_interpolation} controls, {self.intervals} intervals{phases}'


def lagrange(nodes: Array, at: Array) -> Array:
    """Return what each node counts in the polynomial through them, at places (places, nodes)."""
    columns = []
    for j, node in enumerate(nodes):
        others = np.delete(nodes, j)
        columns.append(np.prod((at[:, None] - others) / (node - others), axis=1))
    return np.stack(columns, axis=1)


def spaced(intervals: int, spacing: Spacing) -> Array:
    """Return nodes (intervals + 1,) from 0 to 1.

    Parameters
    ----------
    spacing : 'uniform', 'cosine' (closer towards both ends), or pairs (end, weight)
        Stretches that end at fractions up to 1, and in what proportion they share the intervals.
    """
    nodes = np.linspace(0, 1, intervals + 1)
    if spacing == 'cosine':
        return (1 - np.cos(np.pi * nodes)) / 2
    if spacing == 'uniform':
        return nodes
    ends, weights = np.array([(0.0, 0.0), *spacing], float).T
    shares = np.cumsum(weights)
    graded: Array = np.interp(nodes, shares / shares[-1], ends)
    return graded


def check_spacing(value: Any, where: str) -> Spacing:
    """Return a spacing as it stands in YAML: a word, or a mapping {end: weight}.

    Raises
    ------
    InputError
        If it is neither, or ends and weights do not fit.
    """
    if value in SPACINGS:
        return value  # type: ignore[no-any-return]
    pairs = tuple(value.items()) if isinstance(value, Mapping) else value
    if not isinstance(pairs, tuple) or not pairs:
        raise InputError(
            f'{where}: must be uniform, cosine or {{end of a stretch: weight}}, got {value!r}'
        )
    ends = [0.0, *(number(end, where) for end, _ in pairs)]
    weights = [number(weight, where) for _, weight in pairs]
    if ends != sorted(set(ends)) or ends[-1] != 1 or min(weights) <= 0:
        raise InputError(
            f'{where}: ends of stretches must ascend to 1 and weights be positive, got {value!r}'
        )
    return tuple(zip(ends[1:], weights, strict=True))
