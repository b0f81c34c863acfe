"""Exact derivatives of a programme made of pieces: functions of a few of its variables each.

A piece's gradient, Jacobian and Hessian are traced once with scalars, mapped over its
repetitions, and their elements put where they belong. Differentiating the whole programme instead
costs several times more an iteration.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as cas
import numpy as np
from numpy.typing import NDArray

Index = NDArray[np.int64]

HEAVY = 2_000_000  # operations, a few milliseconds: starting threads takes a tenth of one


@dataclass(frozen=True)
class Piece:
    """A function of some of a programme's variables, repeated on others.

    Parameters
    ----------
    function : Function of (z, p)
        Gives cost (1,) and constraints (m,) from variables z (nz,) and parameters, the last of
        which is the number of the repetition. A cost without elements is none.
    slope, tangent : Functions of (z, p)
        Give the cost and its gradient (1, nz), the constraints and their Jacobian (m, nz).
    curvature : Function of (z, p, lam_f, lam)
        Gives the upper half of the Hessian of lam_f cost + lam' constraints.
    gather : int array (nz, n)
        Which of the programme's variables z is in each repetition, increasing down each column.
    """

    function: cas.Function
    slope: cas.Function
    tangent: cas.Function
    curvature: cas.Function
    gather: Index

    @property
    def rows(self) -> int:
        """Number of constraints of all repetitions."""
        return int(self.function.size1_out(1) * self.gather.shape[1])

    @property
    def has_cost(self) -> bool:
        """Whether it adds to the objective."""
        return int(self.function.nnz_out(0)) > 0


def programme(pieces: Sequence[Piece], linear: Index, size: int) -> dict[str, Any]:
    """Return `x`, `p`, `f`, `g` for CasADi's nlpsol.

    Parameters
    ----------
    linear : int array (rows,)
        The variable that is taken from each constraint of the pieces.
    size : int
        Number of variables.
    """
    w, p = _symbols(pieces, size)
    cost, rows = cas.MX(0.0), []
    for piece in pieces:
        costs, values = _repeated(piece.function, piece.gather.shape[1])(*_arguments(piece, w, p))
        if piece.has_cost:
            cost += cas.sum2(costs)
        rows.append(cas.vec(values))
    return {'x': w, 'p': p, 'f': cost, 'g': cas.vertcat(*rows) - w[linear.tolist()]}


def block_derivatives(pieces: Sequence[Piece], linear: Index, size: int) -> dict[str, Any]:
    """Return `grad_f`, `jac_g` and `hess_lag` for the programme of the same arguments."""
    w, p = _symbols(pieces, size)
    lam_f, lam_g = cas.MX.sym('lam_f'), cas.MX.sym('lam_g', linear.size)
    cost, rows, first = cas.MX(0.0), [], 0
    gradient, jacobian, hessian = _Elements(), _Elements(), _Elements()
    for piece in pieces:
        m, n = piece.function.size1_out(1), piece.gather.shape[1]
        slope, tangent, curvature = piece.slope, piece.tangent, piece.curvature
        local, repeated = _arguments(piece, w, p)
        if piece.has_cost:
            costs, elements = _repeated(slope, n)(local, repeated)
            cost += cas.sum2(costs)
            _, variable, _ = _places(piece, slope.sparsity_out(1))
            gradient.add(elements, variable, np.zeros_like(variable))
        if m:
            values, elements = _repeated(tangent, n)(local, repeated)
            rows.append(cas.vec(values))
            row, variable, repetition = _places(piece, tangent.sparsity_out(1))
            jacobian.add(elements, first + row + m * repetition, variable)
        if curvature.nnz_out(0):
            multipliers = cas.reshape(lam_g[first : first + m * n], m, n)
            weights = cas.repmat(lam_f, 1, n)
            elements = _repeated(curvature, n)(local, repeated, weights, multipliers)
            row, variable, repetition = _places(piece, curvature.sparsity_out(0))
            hessian.add(elements, piece.gather[row, repetition], variable)
        first += m * n
    jacobian.add(-cas.MX.ones(linear.size), np.arange(linear.size), linear)
    g = cas.vertcat(*rows) - w[linear.tolist()]
    return {
        'grad_f': cas.Function(
            'grad_f',
            [w, p],
            [cost, cas.densify(gradient.matrix((size, 1)))],
            ['x', 'p'],
            ['f', 'grad_f_x'],
        ),
        'jac_g': cas.Function(
            'jac_g',
            [w, p],
            [g, jacobian.matrix((linear.size, size))],
            ['x', 'p'],
            ['g', 'jac_g_x'],
        ),
        'hess_lag': cas.Function(
            'hess_lag',
            [w, p, lam_f, lam_g],
            [hessian.matrix((size, size))],
            ['x', 'p', 'lam_f', 'lam_g'],
            ['triu_hess_gamma_x_x'],
        ),
    }


def _repeated(function: cas.Function, n: int) -> cas.Function:
    """Return the function mapped over n columns, on every core where that pays."""
    cores = min(len(os.sched_getaffinity(0)), n)
    if cores > 1 and function.n_instructions() * n > HEAVY:
        return function.map(n, 'thread', cores)
    return function.map(n)


def _symbols(pieces: Sequence[Piece], size: int) -> tuple[cas.MX, cas.MX]:
    return cas.MX.sym('w', size), cas.MX.sym('p', pieces[0].function.size1_in(1) - 1)


def _arguments(piece: Piece, w: cas.MX, p: cas.MX) -> tuple[cas.MX, cas.MX]:
    """Return variables and parameters of every repetition, side by side."""
    nz, n = piece.gather.shape
    local = cas.reshape(w[piece.gather.ravel(order='F').tolist()], nz, n)
    return local, cas.vertcat(cas.repmat(p, 1, n), cas.DM(range(n)).T)


def differentiated(
    function: cas.Function,
) -> tuple[cas.Function, cas.Function, cas.Function, cas.Function]:
    """Return a piece's function of scalars (SX) and its derivatives."""
    z, p = (cas.SX.sym(s, function.size1_in(i)) for i, s in enumerate('zp'))
    cost, rows = function(z, p)
    lam_f, lam = cas.SX.sym('lam_f'), cas.SX.sym('lam', rows.size1())
    lagrangian = lam_f * cost + cas.dot(lam, rows)
    return (
        function,
        cas.Function('slope', [z, p], [cost, cas.jacobian(cost, z)]),
        cas.Function('tangent', [z, p], [rows, cas.jacobian(rows, z)]),
        cas.Function('curvature', [z, p, lam_f, lam], [cas.triu(cas.hessian(lagrangian, z)[0])]),
    )


def _places(piece: Piece, block: cas.Sparsity) -> tuple[Index, Index, Index]:
    """Return row, variable and repetition of each element of the repeated blocks, in order.

    The columns of a block are the variables z.
    """
    n = piece.gather.shape[1]
    row, column = (np.array(index, dtype=np.int64) for index in block.get_triplet())
    repetition = np.repeat(np.arange(n), row.size)
    return np.tile(row, n), piece.gather[np.tile(column, n), repetition], repetition


class _Elements:
    """Elements of a sparse matrix and their places; those at one place are added up."""

    def __init__(self) -> None:
        self._values: list[cas.MX] = []
        self._rows: list[Index] = []
        self._columns: list[Index] = []

    def add(self, values: cas.MX, row: Index, column: Index) -> None:
        self._values.append(cas.vec(values).nz[:])
        self._rows.append(row)
        self._columns.append(column)

    def matrix(self, shape: tuple[int, int]) -> cas.MX:
        row, column = (
            np.concatenate([np.empty(0, np.int64), *indices])
            for indices in (self._rows, self._columns)
        )
        places, index = np.unique(column * shape[0] + row, return_inverse=True)
        sparsity = cas.Sparsity.triplet(
            *shape, (places % shape[0]).tolist(), (places // shape[0]).tolist()
        )
        total = cas.Sparsity.triplet(
            places.size, index.size, index.tolist(), np.arange(index.size).tolist()
        )
        return cas.MX(sparsity, cas.mtimes(cas.DM(total, 1), cas.vertcat(*self._values)))
