"""Sums, means and extremes of all elements or along an axis."""

from collections.abc import Callable
from functools import reduce
from typing import Any

import casadi as cas
import numpy as _np

from ..errors import InputError
from .core import SYMBOLIC, Vectorizable, holds_symbols, shape
from .making import array

Reduction = Callable[[Any], Any]  # of a CasADi column, to a scalar


def _reduction(name: str, of_column: Reduction, what: str) -> Callable[..., Vectorizable]:
    for_numpy = getattr(_np, name)

    def function(a: Vectorizable, axis: int | None = None, **options: Any) -> Vectorizable:
        if not isinstance(a, SYMBOLIC):
            if not holds_symbols(a):
                return for_numpy(a, axis=axis, **options)
            a = array(a)
        if options:
            raise InputError(f'{name}: {", ".join(options)} cannot go with CasADi symbols')
        return along(name, a, axis, of_column)

    function.__name__ = function.__qualname__ = name
    function.__doc__ = f'Return {what} of all elements, or along an axis.'
    return function


def along(name: str, a: Any, axis: int | None, of_column: Reduction) -> Any:
    """Return a CasADi matrix reduced as a whole or along an axis, of which a column has one."""
    dimensions = len(shape(a)) or 1
    if axis is None:
        return of_column(cas.vec(a))
    if not -dimensions <= axis < dimensions:
        raise InputError(f'{name}: no axis {axis} in an array of shape {shape(a)}')
    if dimensions == 1:
        return of_column(a)
    columns = cas.horzsplit(a if axis % 2 == 0 else a.T)
    return cas.vertcat(*map(of_column, columns))


def _product(a: Any) -> Any:
    return reduce(lambda product, factor: product * factor, cas.vertsplit(a), 1.0)


def _any(a: Any) -> Any:
    return cas.sum1(a != 0) > 0


def _all(a: Any) -> Any:
    return cas.sum1(a == 0) == 0


sum = _reduction('sum', cas.sum1, 'the sum')
prod = _reduction('prod', _product, 'the product')
mean = _reduction('mean', lambda a: cas.sum1(a) / a.shape[0], 'the mean')
max = _reduction('max', cas.mmax, 'the largest')
min = _reduction('min', cas.mmin, 'the smallest')
any = _reduction('any', _any, 'whether any is true')
all = _reduction('all', _all, 'whether all are true')
amax = max
amin = min
