"""What a programme's variables say over time: states and controls, between the nodes, too."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import casadi as cas
import numpy as np
from numpy.typing import NDArray

from ..dynamics.stage import Stage
from .increments import compiled_increment
from .layout import Layout
from .mesh import Mesh, lagrange

Array = NDArray[np.float64]
Index = NDArray[np.int64]

FEWEST = 200  # samples of a plan: enough to be drawn
STRAIGHT = 1e-5  # of a control's range: how far lines between samples may be off its polynomial
MOST_PARTS = 64
JUMP = 1e-9  # of the whole duration: what a jump of a control takes


@dataclass(frozen=True)
class Path:
    """A plan in pieces over each of which controls are held or run straight.

    Parameters
    ----------
    time : (m + 1,)
    begin, end : (nu, m)
        Controls at the beginning and the end of each piece.
    wind : (3,)
    planned : int array (j,)
        At which times the programme has a state: nodes and points of its intervals.
    states : (nx, j)
        Those.
    interval : int array (j - 1,)
        Of the mesh, that each stretch between planned states lies in.
    """

    time: Array
    begin: Array
    end: Array
    wind: Array
    planned: Index
    states: Array
    interval: Index

    @cached_property
    def ranges(self) -> Array:
        """How far each state moves, at least 1 in SI units (nx,)."""
        ranges: Array = np.maximum(np.ptp(self.states, axis=1), 1.0)
        return ranges

    @property
    def held(self) -> bool:
        """Whether controls are held in each piece."""
        return bool(np.array_equal(self.begin, self.end))

    @property
    def pieces(self) -> Array:
        """What each piece is flown with: controls, time and length, wind (2 nu + 5, m)."""
        wind = np.repeat(self.wind[:, None], self.time.size - 1, axis=1)
        return np.vstack([self.begin, self.end, self.time[:-1], np.diff(self.time), wind])


def path(layout: Layout, values: Array, wind: Any, limits: Array) -> Path:
    """Return what variables in SI units mean over time.

    Controls that are polynomials in an interval are cut into straight pieces, within their
    limits (nu, 2).
    """
    mesh, n = layout.mesh, layout.mesh.intervals
    s = mesh.points.size
    durations = np.maximum(values[layout.durations], 1e-12)
    starts = np.concatenate([[0.0], np.cumsum(durations)])
    begin = starts[mesh.phase] + mesh.begin * durations[mesh.phase]
    length = mesh.length * durations[mesh.phase]
    edges = np.concatenate([[0.0], mesh.points])
    states = values[layout.reached]
    planned = np.column_stack(
        [values[layout.nodes[:, 0]], states.reshape(states.shape[0], -1, order='F')]
    )
    steering = values[layout.steering]
    parts = _parts(mesh, edges, steering, length / durations.sum())
    # each piece: the stretch that it lies in, and which of that one's pieces it is
    counts = parts.ravel(order='F')
    stretch = np.repeat(np.arange(counts.size), counts)
    lasts = np.cumsum(counts)
    number = np.arange(stretch.size) - np.repeat(lasts - counts, counts)
    interval, which = np.divmod(stretch, s)
    cuts = edges[which] + np.diff(edges)[which] * ((number + [[0], [1]]) / counts[stretch])
    run = [
        np.einsum('ps,usp->up', lagrange(mesh.control_positions, at), steering[:, :, interval])
        for at in cuts
    ]
    if mesh.curved:
        run = [np.clip(each, limits[:, :1], limits[:, 1:]) for each in run]
    starts_at = begin[interval] + cuts[0] * length[interval]
    time = np.append(starts_at, begin[-1] + length[-1])
    index = np.concatenate([[0], lasts])
    if not mesh.held:
        # between phases controls may jump: they run from one value to the other in no time
        jumps = lasts[s * mesh.edges[1:-1] - 1]
        time = np.insert(time, jumps + 1, time[jumps] + JUMP * durations.sum())
        run = [
            np.insert(run[0], jumps, run[1][:, jumps - 1], axis=1),
            np.insert(run[1], jumps, run[0][:, jumps], axis=1),
        ]
        index = index + np.searchsorted(jumps, index, side='left')
    return Path(
        time=_increasing(time),
        begin=run[0],
        end=run[1],
        wind=np.asarray(wind, float),
        planned=index,
        states=planned,
        interval=np.repeat(np.arange(n), s),
    )


def _increasing(time: Array) -> Array:
    """Return times that increase: those of an iterate far from a solution may not."""
    steps = np.maximum(np.diff(np.nan_to_num(time)), 1e-12)
    return np.concatenate([[0.0], np.cumsum(steps)]) if (np.diff(time) <= 0).any() else time


def _parts(mesh: Mesh, edges: Array, steering: Array, length: Array) -> Index:
    """Return into how many pieces each stretch of each interval is cut (s, n).

    Parameters
    ----------
    length : (n,)
        Of the intervals, as fractions of the whole.
    """
    spans = np.diff(edges)[:, None]
    parts = np.ceil(FEWEST * spans * length)
    if mesh.curved:
        # a line through a parabola's ends is off by an eighth of its second derivative
        bend = np.abs(
            np.einsum('cs,usn->ucn', _second_derivatives(mesh.control_positions), steering)
        ).max(axis=1)
        scale = np.maximum(np.ptp(steering, axis=(1, 2)), 1e-12)[:, None]
        off = np.sqrt((bend / scale).max(axis=0) / (8 * STRAIGHT))
        parts = np.maximum(parts, np.ceil(off * spans))
    counts: Index = np.clip(np.nan_to_num(parts, nan=1), 1, MOST_PARTS).astype(np.int64)
    return counts


def _second_derivatives(nodes: Array) -> Array:
    """Return what each node counts in the polynomial's second derivative at the nodes."""
    columns = []
    for j, node in enumerate(nodes):
        others = np.delete(nodes, j)
        polynomial = np.polynomial.Polynomial.fromroots(others) / np.prod(node - others)
        columns.append(polynomial.deriv(2)(nodes))
    return np.stack(columns, axis=1)


@lru_cache(maxsize=64)
def _step(stage: Stage, substeps: int) -> cas.Function:
    """Return (x, piece) -> x at its end, by Dormand and Prince's fifth-order formula.

    References
    ----------
    .. [1] Dormand, J. R., Prince, P. J., "A family of embedded Runge-Kutta formulae",
       J. Comp. Appl. Math. 6 (1), 1980, table 2: RK5(4)7M.
    """
    nx, nu = len(stage.states), len(stage.controls)
    increment = compiled_increment(stage)
    symbol: Any = cas.SX if increment.is_a('SXFunction') else cas.MX
    x, piece = symbol.sym('x', nx), symbol.sym('piece', 2 * nu + 5)
    u0, u1, time, length, wind = cas.vertsplit(
        piece, [0, nu, 2 * nu, 2 * nu + 1, 2 * nu + 2, 2 * nu + 5]
    )
    h, end = length / substeps, x
    for k in range(substeps):
        start, increments_ = end, list[Any]()
        for c, row in zip(_C, _A, strict=True):
            inner = start
            for a, increment_ in zip(row, increments_, strict=True):
                inner = inner + a * increment_ if a else inner
            fraction = (k + c) / substeps
            w = cas.vertcat(inner, u0 + fraction * (u1 - u0), time + fraction * length, h)
            increments_.append(increment(w, wind))
        for b, increment_ in zip(_B, increments_, strict=True):
            end = end + b * increment_ if b else end
    return cas.Function('step', [x, piece], [end], {'cse': True} if symbol is cas.SX else {})


_C = (0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1)
_A = (
    (),
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
)
_B = (35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84)


@lru_cache(maxsize=64)
def _fly(stage: Stage, substeps: int, pieces: int) -> cas.Function:
    return _step(stage, substeps).mapaccum('fly', pieces)


def flown(stage: Stage, start: Array, way: Path, substeps: int) -> Array:
    """Return the states (nx, m + 1) of a path flown open-loop, fixed steps in each piece."""
    pieces = way.pieces
    states = _fly(stage, substeps, pieces.shape[1])(start, pieces).full()
    return np.column_stack([start, states])


def between(stage: Stage, way: Path) -> tuple[Array, Array]:
    """Return states (nx, m + 1) at all times, and how far each stretch misses the next state.

    Each stretch is flown from its own planned state; what it misses the next one by (nx, j - 1)
    is taken out linearly, so that the states run through all that are planned.
    """
    pieces, states = way.pieces, np.empty((way.states.shape[0], way.time.size))
    misses = np.empty((way.states.shape[0], way.planned.size - 1))
    counts = np.diff(way.planned)
    for count in np.unique(counts):
        stretches = np.flatnonzero(counts == count)
        step = _step(stage, 1).map(stretches.size)
        x = way.states[:, stretches]
        reached = [x]
        for i in range(count):
            x = step(x, pieces[:, way.planned[stretches] + i]).full()
            reached.append(x)
        miss = x - way.states[:, stretches + 1]
        misses[:, stretches] = miss
        with np.errstate(invalid='ignore'):  # what cannot be flown on ends as infinity
            for i in range(count):
                states[:, way.planned[stretches] + i] = reached[i] - miss * (i / count)
    states[:, -1] = way.states[:, -1]
    return states, misses
