"""NumPy-like functions that also take CasADi symbols.

One source of physics serves floats, arrays and symbols: import this module as `np` there.
"""

from collections.abc import Callable
from typing import Any

import casadi as cas
import numpy as _np
from numpy import pi as pi

Vectorizable = Any  # float | NDArray | casadi.SX | casadi.MX; CasADi ships no types

_SYMBOLIC = (cas.SX, cas.MX, cas.DM)


def is_symbolic(*values: Vectorizable) -> bool:
    """Return whether any value is a CasADi matrix."""
    return any(isinstance(value, _SYMBOLIC) for value in values)


def _unary(name: str, cas_name: str | None = None) -> Callable[[Vectorizable], Vectorizable]:
    for_numpy = getattr(_np, name)
    for_casadi = getattr(cas, cas_name or name)

    def function(x: Vectorizable) -> Vectorizable:
        return for_casadi(x) if is_symbolic(x) else for_numpy(x)

    function.__name__ = name
    function.__doc__ = f'Return {name}(x), element by element.'
    return function


def _binary(
    name: str, cas_name: str | None = None
) -> Callable[[Vectorizable, Vectorizable], Vectorizable]:
    for_numpy = getattr(_np, name)
    for_casadi = getattr(cas, cas_name or name)

    def function(a: Vectorizable, b: Vectorizable) -> Vectorizable:
        return for_casadi(a, b) if is_symbolic(a, b) else for_numpy(a, b)

    function.__name__ = name
    function.__doc__ = f'Return {name}(a, b), element by element.'
    return function


sin = _unary('sin')
cos = _unary('cos')
tan = _unary('tan')
exp = _unary('exp')
log = _unary('log')
sqrt = _unary('sqrt')
fabs = _unary('fabs')
arcsin = _unary('arcsin', 'asin')
arccos = _unary('arccos', 'acos')
arctan2 = _binary('arctan2', 'atan2')
fmax = _binary('fmax')
fmin = _binary('fmin')


def hypot(*components: Vectorizable) -> Vectorizable:
    """Return the Euclidean norm of the components, element by element."""
    return sqrt(sum(c * c for c in components))


def if_else(
    condition: Vectorizable, if_true: Vectorizable, if_false: Vectorizable
) -> Vectorizable:
    """Return `if_true` where the condition holds, else `if_false`, element by element."""
    if is_symbolic(condition, if_true, if_false):
        return cas.if_else(condition, if_true, if_false)
    return _np.where(condition, if_true, if_false)


def degrees(x: Vectorizable) -> Vectorizable:
    """Return radians as degrees."""
    return x * (180.0 / pi)


def radians(x: Vectorizable) -> Vectorizable:
    """Return degrees as radians."""
    return x * (pi / 180.0)
