"""Exact, sparse derivatives of a programme made of one function at many points.

Each constraint is linear but for values of a few small functions v, such as the equations of
motion, at many points each:

    g = L w - sum over blocks of M v(S w),        f = cost(S_f w) + q' w

with constant sparse L, M, S and a vector w of variables. A block's Jacobian and Hessian are those
of its function, mapped over the points; sparse products put them where they belong. Nothing is
differentiated through the whole, so that an iteration costs little more than the functions
themselves and a programme of thousands of variables is put together in milliseconds.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as cas
import numpy as np
from numpy.typing import NDArray

from .pointwise import Pointwise

Index = NDArray[np.int64]
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Elements:
    """A constant sparse matrix: rows, columns and values of its elements, sorted by row."""

    rows: Index
    columns: Index
    values: Array
    height: int

    def __post_init__(self) -> None:
        order = np.argsort(self.rows, kind='stable')
        for name in ('rows', 'columns', 'values'):
            object.__setattr__(self, name, getattr(self, name)[order])

    @cached_property
    def _starts(self) -> Index:
        return np.searchsorted(self.rows, np.arange(self.height + 1))

    def of_rows(self, rows: Index) -> tuple[Index, Index, Array]:
        """Return the elements in given rows, one row after the other.

        Returns
        -------
        which, columns, values
            Position in `rows` of the row that each element is in, its column and value.
        """
        first, count = self._starts[rows], self._starts[rows + 1] - self._starts[rows]
        which = np.repeat(np.arange(rows.size), count)
        within = np.arange(which.size) - np.repeat(np.cumsum(count) - count, count)
        element = first[which] + within
        return which, self.columns[element], self.values[element]

    @property
    def transposed(self) -> 'Elements':
        """The transpose, of a height that its rows need."""
        height = int(self.columns.max(initial=-1)) + 1
        return Elements(self.columns, self.rows, self.values, height)

    def matrix(self, width: int) -> cas.DM:
        """Return it as a CasADi matrix."""
        return _sparse(self.rows, self.columns, self.values, (self.height, width))


class Triplets:
    """Elements of a constant sparse matrix in the making; values at one place add up."""

    def __init__(self) -> None:
        self._parts: list[tuple[Index, Index, Array]] = []

    def add(self, rows: Any, columns: Any, values: Any) -> None:
        """Add values at places; the three are broadcast against each other."""
        parts = np.broadcast_arrays(rows, columns, np.asarray(values, float))
        self._parts.append(tuple(part.ravel() for part in parts))  # type: ignore[arg-type]

    def elements(self, height: int) -> Elements:
        """Return the matrix without its zeros."""
        empty = (np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0))
        parts = zip(empty, *self._parts, strict=True)
        row, column, value = (np.concatenate(part) for part in parts)
        width = int(column.max(initial=0)) + 1
        places, index = np.unique(row * width + column, return_inverse=True)
        total = np.bincount(index, value, places.size)
        kept = total != 0
        return Elements(places[kept] // width, places[kept] % width, total[kept], height)


def _sparse(rows: Any, columns: Any, values: Any, shape: tuple[int, int]) -> cas.DM:
    """Return a matrix of elements that are each at a place of their own."""
    order = np.lexsort((rows, columns))
    starts = np.searchsorted(columns[order], np.arange(shape[1] + 1))
    sparsity = cas.Sparsity(*shape, starts.tolist(), rows[order].tolist())
    return cas.DM(sparsity, values[order])


@dataclass(frozen=True)
class Block:
    """A function at n points, and what its values count in the constraints.

    Parameters
    ----------
    functions : of value, slope, bend
        Of (z (nz,), wind): v (nv,); of the same: v and its Jacobian (nv, nz); and of (z, wind,
        mu (nv,)): the Hessian (nz, nz) of mu' v.
    select : Elements (n nz, size)
        S: points, one after the other, from the programme's variables.
    weights : Elements (rows, n nv)
        M.
    """

    functions: Sequence[Pointwise]
    select: Elements
    weights: Elements

    @property
    def count(self) -> int:
        """Number of points."""
        return int(self.select.height // self.functions[0].one.size1_in(0))


@dataclass(frozen=True)
class Cost:
    """What is minimized: a function of some of the variables, and a sum of some of them.

    Parameters
    ----------
    functions : value, slope, bend
        As a Block's, of one value.
    select : Elements (nz, size)
    linear : array (size,)
        q.
    """

    functions: tuple[cas.Function, cas.Function, cas.Function]
    select: Elements
    linear: Array


def parameters(wind: Any, columns: Array, rows: Array, cost: float) -> Array:
    """Return a programme's parameters: wind (3,), scales of variables, constraints and cost."""
    return np.concatenate([np.asarray(wind, float), columns, rows, [cost]])


def assemble(
    linear: Elements, blocks: Sequence[Block], cost: Cost
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return `x`, `p`, `f`, `g` for CasADi's nlpsol, and `grad_f`, `jac_g`, `hess_lag` beside.

    Variables are each over their scale; so are constraints and cost.
    """
    rows, size = linear.height, cost.linear.size
    w, p = cas.MX.sym('w', size), cas.MX.sym('p', 3 + size + rows + 1)
    wind, by_column, by_row, by_cost = cas.vertsplit(
        p, [0, 3, 3 + size, 3 + size + rows, p.size1()]
    )
    values = by_column * w
    inverse = 1 / by_row

    def at_points(block: Block | Cost, n: int) -> tuple[cas.MX, cas.MX]:
        z = cas.mtimes(block.select.matrix(size), values)
        return cas.reshape(z, -1, n), cas.repmat(wind, 1, n)

    weights = [
        block.weights.matrix(block.count * block.functions[0].one.size1_out(0)) for block in blocks
    ]
    constant = cas.mtimes(linear.matrix(size), values)

    def constrained(parts: Sequence[cas.MX]) -> cas.MX:
        total = constant
        for matrix, part in zip(weights, parts, strict=True):
            total -= cas.mtimes(matrix, cas.vec(part))
        return total * inverse

    z_cost = at_points(cost, 1)
    places = np.flatnonzero(cost.linear)
    prices = cas.DM(cost.linear[places])

    def priced(value: cas.MX) -> cas.MX:
        sums = cas.dot(prices, values[places.tolist()]) if places.size else 0
        return (value + sums) / by_cost

    g = constrained([b.functions[0].at(at_points(b, b.count))[0] for b in blocks])
    f = priced(cost.functions[0](*z_cost))

    value, slope = cost.functions[1](*z_cost)
    gradient = _Sum((size, 1))
    gradient.add_constant(places, np.zeros_like(places), cost.linear[places])
    _, element = _places(slope.sparsity(), 1)
    which, column, share = cost.select.of_rows(element)
    gradient.add(slope, which, column, np.zeros_like(column), share)
    gradient_matrix = cas.densify(gradient.matrix()) * by_column / by_cost
    grad_f = [priced(value), gradient_matrix]

    parts, jacobian = [], _Sum((rows, size))
    jacobian.add_constant(linear.rows, linear.columns, linear.values)
    for block in blocks:
        part, slopes = block.functions[1].at(at_points(block, block.count))
        parts.append(part)
        row, column = _places(block.functions[1].one.sparsity_out(1), block.count)
        jacobian.add_product(slopes, row, column, block.weights.transposed, block.select, -1.0)
    jac_g = [constrained(parts), _scaled(jacobian.matrix(), inverse, by_column)]

    lam_f, lam = cas.MX.sym('lam_f'), cas.MX.sym('lam', rows)
    pull = -lam * inverse
    hessian = _Sum((size, size))
    bends = cost.functions[2](*z_cost, lam_f / by_cost)
    row, column = _places(bends.sparsity(), 1)
    hessian.add_product(bends, row, column, cost.select, cost.select, upper=True)
    for block, matrix in zip(blocks, weights, strict=True):
        mu = cas.reshape(cas.mtimes(matrix.T, pull), -1, block.count)
        (bends,) = block.functions[2].at([*at_points(block, block.count), mu])
        row, column = _places(block.functions[2].one.sparsity_out(0), block.count)
        hessian.add_product(bends, row, column, block.select, block.select, upper=True)
    hess_lag = _scaled(hessian.matrix(), by_column, by_column)

    programme = {'x': w, 'p': p, 'f': f, 'g': g}
    derivatives = {
        'grad_f': cas.Function('grad_f', [w, p], grad_f, ['x', 'p'], ['f', 'grad_f_x']),
        'jac_g': cas.Function('jac_g', [w, p], jac_g, ['x', 'p'], ['g', 'jac_g_x']),
        'hess_lag': cas.Function(
            'hess_lag',
            [w, p, lam_f, lam],
            [hess_lag],
            ['x', 'p', 'lam_f', 'lam_g'],
            ['triu_hess_gamma_x_x'],
        ),
    }
    return programme, derivatives


class _Sum:
    """A sparse matrix whose elements are sums of elements of others, times constants."""

    def __init__(self, shape: tuple[int, int]) -> None:
        self._shape = shape
        self._sources: list[cas.MX] = []
        self._count = 0
        self._parts: list[tuple[Index, Index, Index, Array]] = []

    def add(self, source: cas.MX, which: Index, rows: Any, columns: Any, share: Array) -> None:
        """Add elements of a source, by their number, at places."""
        self._sources.append(cas.vec(source).nz[:])
        self._parts.append((self._count + which, rows, columns, share))
        self._count += source.nnz()

    def add_constant(self, rows: Index, columns: Index, values: Array) -> None:
        """Add numbers at places."""
        self.add(cas.MX.ones(1), np.zeros_like(rows), rows, columns, values)

    def add_product(
        self,
        source: cas.MX,
        rows: Index,
        columns: Index,
        left: Elements,
        right: Elements,
        sign: float = 1.0,
        *,
        upper: bool = False,
    ) -> None:
        """Add left' X right, X having the source's elements at places; the upper half alone."""
        row, column, value, which = _product(rows, columns, left, right)
        kept = row <= column if upper else np.ones(row.size, bool)
        self.add(source, which[kept], row[kept], column[kept], sign * value[kept])

    def matrix(self) -> cas.MX:
        """Return the matrix."""
        which, row, column, share = (
            np.concatenate(part) for part in zip(*self._parts, strict=True)
        )
        places, index = np.unique(column * self._shape[0] + row, return_inverse=True)
        row, column = places % self._shape[0], places // self._shape[0]
        starts = np.searchsorted(column, np.arange(self._shape[1] + 1))
        sparsity = cas.Sparsity(*self._shape, starts.tolist(), row.tolist())
        # what an element gets from one source may come in several parts
        pairs, place = np.unique(which * places.size + index, return_inverse=True)
        shares = np.bincount(place, share, pairs.size)
        total = _sparse(
            pairs % places.size, pairs // places.size, shares, (places.size, self._count)
        )
        return cas.MX(sparsity, cas.mtimes(total, cas.vertcat(*self._sources)))


def _product(
    rows: Index, columns: Index, left: Elements, right: Elements
) -> tuple[Index, Index, Array, Index]:
    """Return the elements of left' X right, X having elements (numbered) at rows and columns.

    Returns
    -------
    row, column, value, which
        Elements at one place are not added up.
    """
    in_range = rows < left.height
    numbers = np.flatnonzero(in_range)
    one, row, share = left.of_rows(rows[numbers])
    which = numbers[one]
    two, column, other = right.of_rows(columns[which])
    return row[two], column, share[two] * other, which[two]


def _places(block: cas.Sparsity, n: int) -> tuple[Index, Index]:
    """Return row and column of the elements of n blocks, one after the other on a diagonal."""
    row, column = (np.array(index, dtype=np.int64) for index in block.get_triplet())
    k = np.arange(n)[:, None]
    return (row + k * block.size1()).ravel(), (column + k * block.size2()).ravel()


def differentiated(function: cas.Function) -> tuple[cas.Function, cas.Function, cas.Function]:
    """Return a Block's functions from that of (z, wind), a function of scalars (SX)."""
    z, wind = (cas.SX.sym(s, function.size1_in(i)) for i, s in enumerate(('z', 'wind')))
    v = cas.densify(function(z, wind))
    mu = cas.SX.sym('mu', v.size1())
    name, options = function.name(), {'cse': True}
    return (
        cas.Function(name, [z, wind], [v], options),
        cas.Function(f'{name}_slope', [z, wind], [v, cas.jacobian(v, z)], options),
        cas.Function(f'{name}_bend', [z, wind, mu], [cas.hessian(cas.dot(mu, v), z)[0]], options),
    )


def _scaled(matrix: cas.MX, rows: cas.MX, columns: cas.MX) -> cas.MX:
    """Return the matrix with its rows and columns multiplied."""
    row, column = matrix.sparsity().get_triplet()
    return cas.MX(matrix.sparsity(), matrix.nz[:] * rows[row] * columns[column])
