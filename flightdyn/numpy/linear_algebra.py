"""Norms and products of vectors and matrices."""

from typing import Any

import casadi as cas
import numpy as _np

from ..errors import InputError
from .core import Vectorizable, column, holds_symbols, shape
from .elementwise import sqrt
from .making import array, asarray
from .reductions import along


def _matrices(*values: Vectorizable) -> list[Any]:
    return [column(asarray(value)) for value in values]


def norm(x: Vectorizable, ord: Any = None, axis: int | None = None) -> Vectorizable:
    """Return the norm of a vector, or of the vectors along an axis of a matrix.

    Parameters
    ----------
    x : Vectorizable
        Without `axis` a matrix counts as one long vector (Frobenius norm).
    ord : {None, 1, 2, 'fro', inf}
        For symbols: Euclidean (None, 2 and 'fro'), sum (1) or largest (inf) of magnitudes. The
        Euclidean norm has the gradient 0 at the origin, where the plain square root has none.

    Raises
    ------
    InputError
        If symbols are given with another `ord`, or with ord 1, 2 or inf of a whole matrix.
    """
    if not holds_symbols(x):
        return _np.linalg.norm(x, ord=ord, axis=axis)
    x = array(x)
    whole_matrix = axis is None and len(shape(x)) == 2
    if ord is None or (ord == 'fro' if whole_matrix else ord == 2):
        squares = along('norm', x * x, axis, cas.sum1)
        nowhere = squares == 0
        return sqrt(squares + nowhere) - nowhere
    if ord in (1, _np.inf) and not whole_matrix:
        return along('norm', cas.fabs(x), axis, cas.sum1 if ord == 1 else cas.mmax)
    raise InputError(f'norm: ord = {ord!r} of shape {shape(x)} cannot go with CasADi symbols')


def dot(a: Vectorizable, b: Vectorizable) -> Vectorizable:
    """Return the scalar product of vectors, or the matrix product."""
    if not holds_symbols([a, b]):
        return _np.dot(a, b)
    a, b = _matrices(a, b)
    if () in (shape(a), shape(b)):
        return a * b
    product = cas.mtimes(a.T if a.shape[1] == 1 else a, b)
    # a vector from the left gives a vector, which is a column here
    return product.T if a.shape[1] == 1 else product


matmul = dot


def inner(a: Vectorizable, b: Vectorizable) -> Vectorizable:
    """Return the scalar product of vectors; of matrices, of each row with each."""
    if not holds_symbols([a, b]):
        return _np.inner(a, b)
    a, b = _matrices(a, b)
    return dot(a, b.T if b.shape[1] != 1 else b)


def outer(a: Vectorizable, b: Vectorizable) -> Vectorizable:
    """Return the matrix of the products of each element of a with each of b."""
    if not holds_symbols([a, b]):
        return _np.outer(a, b)
    a, b = (cas.vec(m.T) for m in _matrices(a, b))
    return cas.mtimes(a, b.T)


def cross(a: Vectorizable, b: Vectorizable, axis: int = -1) -> Vectorizable:
    """Return the vector product of vectors of 3, or of the rows (columns: axis 0) of matrices.

    Raises
    ------
    InputError
        If with symbols there are not 3 components along the axis.
    """
    if not holds_symbols([a, b]):
        return _np.cross(a, b, axis=axis)
    parts = []
    for m in _matrices(a, b):
        rows = m.T if m.shape[1] == 1 or axis == 0 else m
        if rows.shape[1] != 3:
            raise InputError(f'cross: expected 3 components along axis {axis}, got {shape(m)}')
        parts.append((shape(m), cas.horzsplit(rows)))
    (shape_a, (ax, ay, az)), (shape_b, (bx, by, bz)) = parts
    rows = cas.horzcat(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)
    return rows.T if shape_a == shape_b == (3,) or axis == 0 else rows


def trace(a: Vectorizable) -> Vectorizable:
    """Return the sum of the diagonal of a matrix."""
    return cas.trace(array(a)) if holds_symbols(a) else _np.trace(a)


def inv(a: Vectorizable) -> Vectorizable:
    """Return the inverse of a square matrix."""
    return cas.inv(array(a)) if holds_symbols(a) else _np.linalg.inv(a)


def det(a: Vectorizable) -> Vectorizable:
    """Return the determinant of a square matrix."""
    return cas.det(array(a)) if holds_symbols(a) else _np.linalg.det(a)


def solve(a: Vectorizable, b: Vectorizable) -> Vectorizable:
    """Return x of a x = b."""
    return cas.solve(*_matrices(a, b)) if holds_symbols([a, b]) else _np.linalg.solve(a, b)
