"""Arrays from lists, and rows of points: ends and fill values may be CasADi symbols."""

from collections.abc import Callable
from typing import Any

import casadi as cas
import numpy as _np

from ..errors import InputError
from .core import SYMBOLIC, Vectorizable, column, holds_symbols, is_symbolic, shape


def array(values: Any, dtype: Any = None) -> Vectorizable:
    """Return a list as an array; with CasADi symbols within, as a CasADi matrix.

    Parameters
    ----------
    values : list of scalars, or of lists or vectors of one length
        Scalars make a column; lists and vectors become the rows of a matrix, as in NumPy.
    dtype : NumPy type, optional
        For numbers only.

    Raises
    ------
    InputError
        If symbols are nested deeper than a matrix or in rows of unequal length.
    """
    if isinstance(values, SYMBOLIC):
        return values
    if not holds_symbols(values):
        return _np.array(values, dtype=dtype)
    if isinstance(values, _np.ndarray):
        values = values.tolist()
    rows = [column(array(value)) for value in values]
    shapes = {shape(row) for row in rows}
    if shapes == {()}:
        return cas.vertcat(*rows)
    if len(shapes) != 1 or len(next(iter(shapes))) != 1:
        raise InputError(
            'array: rows with CasADi symbols must be scalars or vectors of one length, got shapes '
            f'{[shape(row) for row in rows]}'
        )
    return cas.horzcat(*rows).T


def asarray(values: Any, dtype: Any = None) -> Vectorizable:
    """Return `array(values)` without copying what is one already."""
    if dtype is None and isinstance(values, (*SYMBOLIC, _np.ndarray)):
        return values
    return array(values) if holds_symbols(values) else _np.asarray(values, dtype=dtype)


def _between(start: Vectorizable, stop: Vectorizable, way: Any) -> Vectorizable:
    """Return the points at fractions `way` from start to stop; both ends are exact."""
    start, stop = asarray(start), asarray(stop)
    if is_symbolic(start, stop):
        # vectors at the ends make one column each, as in NumPy
        start, stop = column(start), column(stop)
        return cas.mtimes(1.0 - way, start.T) + cas.mtimes(way, stop.T)
    way = way.reshape(-1, *(1 for _ in _np.broadcast_shapes(start.shape, stop.shape)))
    return start * (1.0 - way) + stop * way


def linspace(
    start: Vectorizable = 0.0, stop: Vectorizable = 1.0, num: int = 50, **options: Any
) -> Vectorizable:
    """Return `num` evenly spaced points from start to stop; the ends may be symbols, and exact.

    Options (`endpoint`, `retstep`, `dtype`, `axis`) are NumPy's, for numbers only.
    """
    if not is_symbolic(start, stop):
        return _np.linspace(start, stop, num, **options)
    if options:
        raise InputError(f'linspace: {", ".join(options)} cannot go with CasADi symbols')
    return _between(start, stop, _np.linspace(0.0, 1.0, num))


def cosspace(start: Vectorizable = 0.0, stop: Vectorizable = 1.0, num: int = 50) -> Vectorizable:
    """Return `num` points from start to stop that lie dense at both ends; the ends are exact.

    The fraction of the way is (1 - cos(pi s))/2 of evenly spaced s: Chebyshev-Gauss-Lobatto
    points. Use it for times where a motion begins and ends in a hurry.
    """
    return _between(start, stop, _np.sin(_np.linspace(0.0, _np.pi / 2, num)) ** 2)


def sinspace(
    start: Vectorizable = 0.0,
    stop: Vectorizable = 1.0,
    num: int = 50,
    reverse_spacing: bool = False,
) -> Vectorizable:
    """Return `num` points from start to stop, dense at the start; `reverse_spacing`: at the stop.

    The fraction of the way is 1 - cos(pi s/2) of evenly spaced s; the ends are exact.
    """
    way = 2.0 * _np.sin(_np.linspace(0.0, _np.pi / 4, num)) ** 2
    way[-1:] = 1.0 if num > 1 else way[-1:]
    return _between(start, stop, 1.0 - way[::-1] if reverse_spacing else way)


def logspace(
    start: Vectorizable = 0.0, stop: Vectorizable = 1.0, num: int = 50, **options: Any
) -> Vectorizable:
    """Return `num` points from 10**start to 10**stop, evenly spaced in the logarithm."""
    if not is_symbolic(start, stop):
        return _np.logspace(start, stop, num, **options)
    return 10.0 ** linspace(start, stop, num, **options)


def geomspace(
    start: Vectorizable = 1.0, stop: Vectorizable = 10.0, num: int = 50, **options: Any
) -> Vectorizable:
    """Return `num` points from start to stop, each the same multiple of the one before.

    Symbolic ends must be positive scalars.
    """
    if not is_symbolic(start, stop):
        return _np.geomspace(start, stop, num, **options)
    way = linspace(0.0, 1.0, num, **options)
    return column(start) ** (1.0 - way) * column(stop) ** way


def full(size: int | tuple[int, ...], fill_value: Vectorizable, dtype: Any = None) -> Vectorizable:
    """Return an array of the shape `size` (of one or two dimensions for symbols), all alike."""
    if not is_symbolic(fill_value):
        return _np.full(size, fill_value, dtype=dtype)
    return cas.repmat(fill_value, *((size,) if isinstance(size, int) else size))


def _like(name: str) -> Callable[..., Vectorizable]:
    for_numpy, value = getattr(_np, f'{name}_like'), {'ones': 1.0}.get(name, 0.0)

    def function(a: Vectorizable, **options: Any) -> Vectorizable:
        if not isinstance(a, SYMBOLIC):
            return for_numpy(a, **options)
        # of the same CasADi type, so that expressions can be assigned to its elements
        return type(a)(cas.DM(_np.full(a.shape, value)))

    function.__name__ = function.__qualname__ = f'{name}_like'
    function.__doc__ = f'Return {name} in the shape of `a`, of CasADi type if `a` is.'
    return function


zeros_like = _like('zeros')
ones_like = _like('ones')
empty_like = _like('empty')


def full_like(a: Vectorizable, fill_value: Vectorizable, **options: Any) -> Vectorizable:
    """Return an array in the shape of `a`, all alike."""
    if is_symbolic(a, fill_value):
        return full(shape(a), fill_value) if is_symbolic(fill_value) else ones_like(a) * fill_value
    return _np.full_like(a, fill_value, **options)


def length(x: Vectorizable) -> int:
    """Return the number of elements along the first axis; 1 of a scalar."""
    return ([*shape(asarray(x)), 1])[0]
