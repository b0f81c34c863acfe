"""Functions given by points and by coefficients."""

from functools import reduce
from typing import Any

import casadi as cas
import numpy as _np

from ..errors import InputError
from .core import Vectorizable, column, holds_symbols, is_symbolic, shape
from .elementwise import clip, mod, where
from .making import asarray


def interp(
    x: Vectorizable,
    xp: Vectorizable,
    fp: Vectorizable,
    left: Vectorizable | None = None,
    right: Vectorizable | None = None,
    period: float | None = None,
) -> Vectorizable:
    """Return the values at x of the straight lines through the points (xp, fp).

    Parameters
    ----------
    x : Vectorizable
        Any shape.
    xp, fp : Vectorizable
        Vectors of one length, xp ascending; both may hold symbols.
    left, right : Vectorizable, optional
        Values below and above xp; by default those at its ends.
    period : float, optional
        The points repeat; then xp are numbers, in any order, and left and right do not count.

    The slope jumps at the points, which solvers of optimal control do not like: fit a spline
    where accuracy matters. Symbolic x over a table of n points costs n terms.

    Raises
    ------
    InputError
        If, with symbols, xp and fp differ in length, or periodic or numeric xp are unfit.
    """
    if not holds_symbols([x, xp, fp, left, right]):
        return _np.interp(x, xp, fp, left=left, right=right, period=period)
    x, xp, fp = (asarray(value) for value in (x, xp, fp))
    if len(shape(xp)) != 1 or shape(xp) != shape(fp):
        raise InputError(f'interp: xp and fp of shapes {shape(xp)} and {shape(fp)} do not match')
    if period is not None:
        x, xp, fp, left, right = *_unrolled(x, xp, fp, period), None, None
    elif not is_symbolic(xp) and not _np.all(_np.diff(xp) >= 0):
        raise InputError('interp: xp must ascend')
    fp = column(fp) if is_symbolic(fp) else fp
    result: Any = fp[0]
    for i in range(xp.shape[0] - 1):
        width = xp[i + 1] - xp[i]
        # each interval adds its rise as far as x has come in it
        way = clip(x - xp[i], 0.0, width) / width if is_symbolic(width) or width else x > xp[i]
        result = result + (fp[i + 1] - fp[i]) * way
    result = result + 0.0 * x if xp.shape[0] == 1 else result
    result = result if left is None else where(x < xp[0], left, result)
    return result if right is None else where(x > xp[-1], right, result)


def _unrolled(x: Any, xp: Any, fp: Any, period: float) -> tuple[Any, Any, Any]:
    """Return x within a period from 0, and points that reach past both ends of it."""
    if is_symbolic(xp) or not period:
        raise InputError(f'interp: a period needs numeric xp and must not be 0, got {period!r}')
    period = abs(period)
    order = _np.argsort(xp % period)
    xp, fp = (xp % period)[order], fp[order.tolist() if is_symbolic(fp) else order]
    xp = _np.concatenate((xp[-1:] - period, xp, xp[:1] + period))
    ends = (fp[-1], fp, fp[0])
    fp = cas.vertcat(*ends) if is_symbolic(fp) else _np.hstack(ends)
    return mod(x, period), xp, fp


def polyval(p: Vectorizable, x: Vectorizable) -> Vectorizable:
    """Return the polynomial with coefficients p, of the highest power first, at x."""
    if not holds_symbols([p, x]):
        return _np.polyval(p, x)
    p, x = asarray(p), asarray(x)
    coefficients = cas.vertsplit(p) if is_symbolic(p) else list(p)
    return reduce(lambda value, c: value * x + c, coefficients, 0.0 * x)
