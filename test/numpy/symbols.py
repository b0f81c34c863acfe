"""Evaluates functions of flightdyn.numpy on CasADi symbols in place of their array arguments."""

from collections.abc import Callable
from typing import Any

import casadi as cas
import numpy as np
import pytest

KINDS = [cas.SX, cas.MX]


def as_numpy(value: Any) -> Any:
    """Return a numeric CasADi matrix in the shape that it plays: column 1-D, (1, 1) scalar."""
    value = np.array(cas.DM(value))
    if value.shape[1] != 1:
        return value
    return value[0, 0] if value.shape == (1, 1) else value[:, 0]


def symbol_like(kind: Any, value: Any, name: str) -> Any:
    """Return a symbol of a kind in the shape of an array."""
    return kind.sym(name, *(*np.shape(value), 1, 1)[:2])


def on_symbols(kind: Any, function: Callable[..., Any], *arrays: Any) -> Any:
    """Return `function(*arrays)`, found by a CasADi function of symbols for the arrays."""
    symbols = [symbol_like(kind, value, f's{i}') for i, value in enumerate(arrays)]
    return as_numpy(cas.Function('f', symbols, [function(*symbols)])(*arrays))


def slopes(kind: Any, function: Callable[..., Any], *values: float) -> Any:
    """Return the gradient of a scalar function of scalars."""
    symbols = [kind.sym(f's{i}') for i in range(len(values))]
    where = cas.vertcat(*symbols)
    return as_numpy(cas.Function('f', symbols, [cas.gradient(function(*symbols), where)])(*values))


each_kind = pytest.mark.parametrize('kind', KINDS, ids=['SX', 'MX'])
