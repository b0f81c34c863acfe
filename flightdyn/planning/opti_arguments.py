"""Reading the arguments of `Opti`: guesses, scales, columns of nodes, nested constraints."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import casadi as cas
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..numpy import Vectorizable
from .declarations import Declaration, Place
from .infeasibility import find_row

Array = NDArray[np.float64]


def initial_values(
    guess: Vectorizable, n: int | None, lower: Any, upper: Any, logarithmic: bool
) -> tuple[Array, int]:
    """Return the initial values (n,) and n."""
    if guess is None:
        bounds = [b for b in (lower, upper) if b is not None and not isinstance(b, cas.MX)]
        low, high = (
            np.asarray(default if b is None or isinstance(b, cas.MX) else b, float)
            for b, default in ((lower, -np.inf), (upper, np.inf))
        )
        if bounds and np.isfinite(low).all() and np.isfinite(high).all():
            positive = logarithmic and (low > 0).all()
            guess = np.sqrt(low * high) if positive else (low + high) / 2
        else:
            guess = np.clip(1.0 if logarithmic else 0.0, low, high)
    values = np.asarray(guess, float)
    if values.ndim == 2 and 1 in values.shape:
        values = values.ravel()
    if values.ndim > 1 or (n is not None and (n < 1 or values.size not in (1, n))):
        raise InputError(
            f'the initial guess has shape {values.shape} for {n} variables: give a number '
            'or one value each'
        )
    if not np.isfinite(values).all():
        raise InputError(f'the initial guess must be finite, got {guess}')
    n = values.size if n is None else n
    return np.array(np.broadcast_to(values, (n,))), n


def check_bounds(lower: Any, upper: Any, place: Place) -> None:
    """Refuse numbers that leave nothing between them."""
    low, high = (
        np.asarray(default if bound is None or isinstance(bound, cas.MX) else bound, float)
        for bound, default in ((lower, -np.inf), (upper, np.inf))
    )
    try:
        crossed = (low > high).any()
    except ValueError:
        return  # their sizes are checked one by one
    if crossed:
        raise InputError(f'the lower bound {lower} is above the upper bound {upper} ({place})')


def find_declaration(
    declarations: Sequence[Declaration], index: int, what: str, full_path: bool
) -> str:
    total = sum(declaration.size for declaration in declarations)
    if not 0 <= index < total:
        raise InputError(f'there are {total} {what}, counted from 0; got {index}')
    declaration, row = find_row(declarations, index)
    return declaration.text(row, full_path=full_path)


def flattened(
    constraint: Any, path: tuple[int, ...] = ()
) -> Iterator[tuple[Any, tuple[int, ...]]]:
    if isinstance(constraint, Iterable) and not isinstance(
        constraint, cas.MX | cas.DM | np.ndarray | str
    ):
        for index, item in enumerate(constraint):
            yield from flattened(item, (*path, index))
    else:
        yield constraint, path


def check_constant(constraint: Any, declaration: Declaration) -> None:
    """Let True pass, refuse False and what is no comparison."""
    values = constraint.full() if isinstance(constraint, cas.DM) else np.asarray(constraint)
    if isinstance(constraint, cas.DM) and np.isin(values, (0.0, 1.0)).all():
        values = values.astype(bool)
    if values.dtype != bool:
        raise InputError(
            f'{declaration.text()} is not a constraint: a comparison is wanted, got {constraint!r}'
        )
    if not values.all():
        row = int(np.argmin(values.ravel()))
        raise InputError(
            f'{declaration.text()} is False whatever the variables are'
            + (f', first in row {row}' if values.size > 1 else '')
        )


def operator_of(comparison: cas.MX) -> str:
    return {cas.OP_LE: '<=', cas.OP_LT: '<=', cas.OP_EQ: '=='}[comparison.op()]


def column(values: Vectorizable, what: str) -> Vectorizable:
    """Return values as a column, DM or MX."""
    x = values if isinstance(values, cas.MX) else cas.DM(np.asarray(values, float))
    if x.shape[0] == 1:
        x = x.T
    if x.shape[1] != 1:
        raise InputError(f'{what} must be a column of nodes, got shape {x.shape}')
    return x


def scales(
    scale: Vectorizable, guess: Array, lower: Any, upper: Any, n: int, logarithmic: bool
) -> Array:
    """Return the scale of each variable, (n,)."""
    if scale is None:
        if logarithmic:
            return guess
        bounds = [
            np.abs(np.asarray(bound, float)).ravel()
            for bound in (lower, upper)
            if bound is not None and not isinstance(bound, cas.MX)
        ]
        limits = np.concatenate([*bounds, np.zeros(1)])
        size = np.abs(guess).max() or limits[np.isfinite(limits)].max() or 1.0
        return np.full(n, size)
    sizes = np.asarray(scale, float).ravel()
    if sizes.size not in (1, n) or not (np.isfinite(sizes) & (sizes > 0)).all():
        raise InputError(
            f'a scale is a positive number, or one for each of {n} variables; got {scale}'
        )
    return np.array(np.broadcast_to(sizes, (n,)))
