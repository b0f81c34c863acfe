"""Differences, slopes and integrals of sampled functions."""

from collections.abc import Callable
from typing import Any

import casadi as cas
import numpy as _np

from ..errors import InputError
from .core import Vectorizable, column, holds_symbols, is_symbolic, shape
from .elementwise import centered_mod
from .making import asarray
from .shaping import concatenate


def diff(
    a: Vectorizable, n: int = 1, axis: int = -1, period: Vectorizable | None = None
) -> Vectorizable:
    """Return the differences of neighbours, n times over, along an axis.

    With a `period`, as 360 of degrees, the first differences are the shortest way around.
    """
    a = asarray(a)
    if n > 1:
        return diff(diff(a, 1, axis, period), n - 1, axis)
    if n == 0:
        return a
    if is_symbolic(a):
        by_rows = _axis('diff', a, axis) == 0
        steps = a[1:, :] - a[:-1, :] if by_rows else a[:, 1:] - a[:, :-1]
    else:
        steps = _np.diff(a, axis=axis)
    return steps if period is None else centered_mod(steps, period)


def gradient(
    f: Vectorizable,
    *spacing: Vectorizable,
    axis: int | None = None,
    edge_order: int = 1,
    period: Vectorizable | None = None,
) -> Vectorizable:
    """Return the slope of a sampled function at each sample, second-order accurate within.

    Parameters
    ----------
    f : Vectorizable
        Samples; with symbols or a period, a vector, or a matrix and `axis`.
    *spacing : Vectorizable
        None for samples 1 apart, a scalar step, or the coordinates of the samples; both may be
        symbols. Numbers also take all else that `numpy.gradient` does.
    edge_order : 1 or 2
        Accuracy at the two ends.
    period : Vectorizable, optional
        Samples wrap around: differences are the shortest way, as in `diff`.

    Raises
    ------
    InputError
        If with symbols or a period the arguments are others than these.

    References
    ----------
    .. [1] Quarteroni, Sacco, Saleri, *Numerical Mathematics*, 2nd edition, 2007, section 10.10.
    """
    f = asarray(f)
    if period is None and not holds_symbols([f, *spacing]):
        options: Any = {'axis': axis, 'edge_order': edge_order}
        return _np.gradient(f, *spacing, **options)
    if len(spacing) > 1 or edge_order not in (1, 2) or (axis is None and len(shape(f)) == 2):
        raise InputError(
            'gradient: symbols and periods go with one spacing, edge_order 1 or 2 and the axis of '
            f'a matrix; got {len(spacing)} spacings, edge_order {edge_order}, axis {axis}'
        )
    x = asarray(spacing[0]) if spacing else 1.0
    if is_symbolic(f, x):
        f, x = column(f), column(x)
        across = axis is not None and _axis('gradient', f, axis) == 1
        slopes = _slopes(f.T if across else f, x, edge_order, period)
        return slopes.T if across else slopes
    f = _np.moveaxis(f, -1 if axis is None else axis, 0)
    x = x if _np.ndim(x) == 0 else _np.reshape(x, (-1, *(1 for _ in f.shape[1:])))
    return _np.moveaxis(_slopes(f, x, edge_order, period), 0, -1 if axis is None else axis)


def _slopes(f: Any, x: Any, edge_order: int, period: Any) -> Any:
    """Return the slopes along axis 0: those of parabolas through three neighbours."""
    n = f.shape[0]
    if n < edge_order + 1:
        raise InputError(f'gradient: edge_order {edge_order} needs {edge_order + 1} samples')
    steps = diff(f, axis=0, period=period)
    h = diff(x, axis=0) if shape(x) else x * _np.ones(n - 1)
    if h.shape[0] != n - 1:
        raise InputError(f'gradient: {n} samples, but {h.shape[0] + 1} coordinates')
    if is_symbolic(steps, h):
        h = cas.repmat(column(h), 1, steps.shape[1])  # CasADi would not broadcast it
    elif h.ndim < steps.ndim:
        h = h.reshape(-1, *(1 for _ in steps.shape[1:]))
    secants = steps / h
    before, after = _rows(h, 0, n - 2), _rows(h, 1, n - 1)
    left, right = _rows(secants, 0, n - 2), _rows(secants, 1, n - 1)
    within = (after * left + before * right) / (before + after)
    first, last = _rows(secants, 0, 1), _rows(secants, n - 2, n - 1)
    if edge_order == 2:
        bend = (right - left) / (before + after)
        first = first - _rows(h, 0, 1) * _rows(bend, 0, 1)
        last = last + _rows(h, n - 2, n - 1) * _rows(bend, n - 3, n - 2)
    return concatenate((first, within, last) if n > 2 else (first, last))


def _rows(a: Any, start: int, stop: int) -> Any:
    return a[start:stop, :] if is_symbolic(a) else a[start:stop]


def _axis(name: str, a: Any, axis: int) -> int:
    """Return 0 or 1 for an axis of a CasADi matrix; a column has axis 0 alone."""
    dimensions = max(1, len(shape(a)))
    if not -dimensions <= axis < dimensions:
        raise InputError(f'{name}: no axis {axis} in an array of shape {shape(a)}')
    return axis % dimensions


def cumsum(a: Vectorizable, axis: int | None = None) -> Vectorizable:
    """Return the running sums, along an axis or of all elements row by row."""
    a = asarray(a)
    if not is_symbolic(a):
        return _np.cumsum(a, axis=axis)
    if axis is None:
        return cas.cumsum(cas.vec(a.T) if len(shape(a)) == 2 else a)
    return cas.cumsum(a, _axis('cumsum', a, axis))


def _strips(y: Any, x: Any, dx: Any) -> Any:
    """Return the areas under the straight lines between neighbours along axis 0."""
    h = dx if x is None else diff(x, axis=0)
    n = y.shape[0]
    if shape(h) and h.shape[0] != n - 1:
        raise InputError(f'trapezoid: {n} samples, but {h.shape[0] + 1} coordinates')
    means = 0.5 * (_rows(y, 1, n) + _rows(y, 0, n - 1))
    if is_symbolic(means, h) and shape(h):
        h = cas.repmat(column(h), 1, means.shape[1] // h.shape[1])
    elif _np.ndim(h) == 1:
        h = h.reshape(-1, *(1 for _ in means.shape[1:]))
    return means * h


def _upright(
    y: Vectorizable, x: Vectorizable | None, axis: int, name: str
) -> tuple[Any, Any, Callable[[Any], Any]]:
    """Return y and x with the axis first, and what takes y back; CasADi if either is."""
    y, x = asarray(y), None if x is None else asarray(x)
    if is_symbolic(y, x):
        y = column(y)
        if _axis(name, y, axis) == 0:
            return y, x, lambda a: a
        return y.T, x.T if x is not None and len(shape(x)) == 2 else x, lambda a: a.T
    if x is not None and x.ndim > 1:
        x = _np.moveaxis(x, axis, 0)
    return _np.moveaxis(y, axis, 0), x, lambda a: _np.moveaxis(a, 0, axis)


def trapezoid(
    y: Vectorizable, x: Vectorizable | None = None, dx: Vectorizable = 1.0, axis: int = -1
) -> Vectorizable:
    """Return the integral of y over x (or steps dx) along an axis, by the trapezoidal rule.

    AeroSandbox's function of the name `trapz` is another: it returns the means of neighbours.
    """
    y, x, _ = _upright(y, x, axis, 'trapezoid')
    strips = _strips(y, x, dx)
    return cas.sum1(strips).T if is_symbolic(strips) else strips.sum(axis=0)


trapz = trapezoid


def cumulative_trapezoid(
    y: Vectorizable,
    x: Vectorizable | None = None,
    dx: Vectorizable = 1.0,
    axis: int = -1,
    initial: float | None = None,
) -> Vectorizable:
    """Return the running integral of y over x, from the second sample on.

    `initial`, 0 as a rule, is put before them, so that there are as many values as samples.
    """
    y, x, back = _upright(y, x, axis, 'cumulative_trapezoid')
    sums = cumsum(_strips(y, x, dx), axis=0)
    if initial is not None:
        sums = concatenate((0.0 * _rows(sums, 0, 1) + initial, sums))
    return back(sums)
