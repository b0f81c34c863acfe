"""Putting arrays together and their elements in another order."""

from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any

import casadi as cas
import numpy as _np

from ..errors import InputError
from .core import Vectorizable, column, holds_symbols, shape
from .making import array, asarray


def _by_index(name: str) -> Callable[..., Vectorizable]:
    """Return NumPy's function, which for symbols shuffles their indices and gathers by them."""
    for_numpy = getattr(_np, name)

    @wraps(for_numpy, assigned=('__doc__',), updated=())
    def function(a: Vectorizable, *args: Any, **kwargs: Any) -> Vectorizable:
        if not holds_symbols(a):
            return for_numpy(a, *args, **kwargs)
        a = array(a)
        rows, columns = a.shape
        # CasADi counts down the columns
        indices = _np.arange(rows * columns).reshape((rows, columns), order='F')
        return gather(a, for_numpy(indices.reshape(shape(a)), *args, **kwargs), name)

    function.__name__ = function.__qualname__ = name
    del function.__dict__['__wrapped__']
    return function


def gather(a: Vectorizable, indices: Any, name: str) -> Vectorizable:
    """Return the elements of a CasADi matrix at an array of indices, in the array's shape."""
    indices = _np.asarray(indices)
    if indices.ndim > 2:
        raise InputError(f'{name}: CasADi has matrices at most, not the shape {indices.shape}')
    flat: Any = cas.vec(a)
    return cas.reshape(flat[indices.ravel(order='F').tolist()], *((*indices.shape, 1, 1)[:2]))


reshape = _by_index('reshape')
ravel = _by_index('ravel')
transpose = _by_index('transpose')
swapaxes = _by_index('swapaxes')
squeeze = _by_index('squeeze')
atleast_1d = _by_index('atleast_1d')
expand_dims = _by_index('expand_dims')
broadcast_to = _by_index('broadcast_to')
roll = _by_index('roll')
flip = _by_index('flip')
flipud = _by_index('flipud')
fliplr = _by_index('fliplr')
rot90 = _by_index('rot90')
tile = _by_index('tile')
repeat = _by_index('repeat')
take = _by_index('take')
delete = _by_index('delete')


def _parts(arrays: Sequence[Vectorizable]) -> list[Any]:
    return [column(asarray(a)) for a in arrays]


def concatenate(arrays: Sequence[Vectorizable], axis: int | None = 0) -> Vectorizable:
    """Return arrays joined along an axis they have; CasADi scalars count as length 1.

    Raises
    ------
    InputError
        If the axis is not there, with symbols.
    """
    if not holds_symbols(list(arrays)):
        return _np.concatenate(arrays, axis=axis)
    parts = _parts(arrays)
    if axis is None:
        return cas.vertcat(*(ravel(part) for part in parts))
    dimensions = max(1, *(len(shape(part)) for part in parts))
    if not -dimensions <= axis < dimensions:
        raise InputError(f'concatenate: no axis {axis} in arrays of dimension {dimensions}')
    return cas.vertcat(*parts) if axis % dimensions == 0 else cas.horzcat(*parts)


def stack(arrays: Sequence[Vectorizable], axis: int = 0) -> Vectorizable:
    """Return scalars as a column, or vectors as the rows (columns: axis 1 or -1) of a matrix.

    Raises
    ------
    InputError
        If there are matrices with symbols among the arrays.
    """
    if not holds_symbols(list(arrays)):
        return _np.stack(arrays, axis=axis)
    rows = array(list(arrays))
    return rows.T if shape(rows) != (len(arrays),) and axis in (1, -1) else rows


def vstack(arrays: Sequence[Vectorizable]) -> Vectorizable:
    """Return arrays on top of each other: vectors and scalars are rows."""
    if not holds_symbols(list(arrays)):
        return _np.vstack(arrays)
    return cas.vertcat(*(part.T if part.shape[1] == 1 else part for part in _parts(arrays)))


def hstack(arrays: Sequence[Vectorizable]) -> Vectorizable:
    """Return arrays side by side: vectors and scalars end to end, in one vector."""
    if not holds_symbols(list(arrays)):
        return _np.hstack(arrays)
    parts = _parts(arrays)
    one_row = all(part.shape[1] == 1 for part in parts)
    return cas.vertcat(*parts) if one_row else cas.horzcat(*parts)


def append(a: Vectorizable, values: Vectorizable, axis: int | None = None) -> Vectorizable:
    """Return `a` with values at its end: of a vector, or along an axis of a matrix."""
    if not holds_symbols([a, values]):
        return _np.append(a, values, axis=axis)
    return concatenate((a, values), axis=axis)


def diag(v: Vectorizable, k: int = 0) -> Vectorizable:
    """Return the k-th diagonal of a matrix, or a matrix with that diagonal."""
    if not holds_symbols(v):
        return _np.diag(v, k)
    v = array(v)
    if len(shape(v)) == 2:
        rows, columns = v.shape
        indices = _np.arange(rows * columns).reshape((rows, columns), order='F')
        return gather(v, _np.diag(indices, k), 'diag')
    size = v.shape[0] + abs(k)
    matrix = type(v).zeros(size, size)
    for i in range(v.shape[0]):
        matrix[i + max(0, -k), i + max(0, k)] = v[i]
    return matrix
