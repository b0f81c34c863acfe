"""What every module here needs to know: which values are CasADi's, and their shape in NumPy."""

from typing import Any

import casadi as cas
import numpy as _np

Vectorizable = Any  # float | NDArray | casadi.SX | casadi.MX; CasADi ships no types

SYMBOLIC = (cas.SX, cas.MX, cas.DM)


def is_symbolic(*values: Vectorizable) -> bool:
    """Return whether any value is a CasADi matrix."""
    return any(isinstance(value, SYMBOLIC) for value in values)


def holds_symbols(value: Any) -> bool:
    """Return whether a value is a CasADi matrix or has one within: lists, tuples, objects."""
    if isinstance(value, SYMBOLIC):
        return True
    if isinstance(value, list | tuple):
        return any(map(holds_symbols, value))
    if isinstance(value, _np.ndarray):
        return value.dtype == object and any(map(holds_symbols, value.flat))
    return False


def shape(x: Any) -> tuple[int, ...]:
    """Return the shape in NumPy's sense: a CasADi column is (n,), a (1, 1) is ()."""
    if not isinstance(x, SYMBOLIC):
        return _np.shape(x)
    rows, columns = x.shape
    if columns != 1:
        return rows, columns
    return () if rows == 1 else (rows,)


def column(x: Any) -> Any:
    """Return numbers as a CasADi matrix, a 1-D array as a column; symbols as they are."""
    return x if isinstance(x, SYMBOLIC) else cas.DM(_np.asarray(x, dtype=float))
