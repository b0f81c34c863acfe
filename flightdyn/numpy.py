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


def _unary(name: str) -> Callable[[Vectorizable], Vectorizable]:
    for_numpy, for_casadi = getattr(_np, name), getattr(cas, name)

    def function(x: Vectorizable) -> Vectorizable:
        return for_casadi(x) if is_symbolic(x) else for_numpy(x)

    function.__name__ = name
    function.__doc__ = f'Return {name}(x), element by element.'
    return function


sin = _unary('sin')
cos = _unary('cos')
sqrt = _unary('sqrt')


def arctan2(y: Vectorizable, x: Vectorizable) -> Vectorizable:
    """Return the angle of the point (x, y) from the x axis [rad], element by element."""
    return cas.atan2(y, x) if is_symbolic(y, x) else _np.arctan2(y, x)


def hypot(*components: Vectorizable) -> Vectorizable:
    """Return the Euclidean norm of the components, element by element."""
    return sqrt(sum(c * c for c in components))


def degrees(x: Vectorizable) -> Vectorizable:
    """Return radians as degrees."""
    return x * (180.0 / pi)


def radians(x: Vectorizable) -> Vectorizable:
    """Return degrees as radians."""
    return x * (pi / 180.0)
