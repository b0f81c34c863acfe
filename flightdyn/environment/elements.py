"""Element by element: table columns by interval, and the items of vectorized objects."""

from bisect import bisect_right
from collections.abc import Mapping
from typing import Any

import casadi as cas
import numpy as _np
from numpy.typing import NDArray

from ..errors import InputError
from ..numpy import Vectorizable, is_symbolic

Array = NDArray[_np.float64]


class Steps:
    """Coefficients that are constant within intervals.

    Parameters
    ----------
    bounds : array (m,)
        Increasing; interval k is bounds[k - 1] <= x < bounds[k].
    table : array (rows, m + 1)
        One column an interval.
    """

    def __init__(self, bounds: Array, table: Array) -> None:
        self._bounds, self._table = bounds, table
        self._bound_list, self._columns = bounds.tolist(), table.T.tolist()
        self._first, self._rises = cas.DM(table[:, :1]), cas.DM(_np.diff(table))

    def __call__(self, x: Vectorizable) -> Any:
        """Return each row's value at `x`, in the shape of `x`.

        On CasADi expressions they are sums of comparisons, which have zero derivatives and no
        branch that could go unevaluated or become infinite.
        """
        if isinstance(x, float):  # ten times as quick as arrays, for simulation steps
            return self._columns[bisect_right(self._bound_list, x)]
        if not is_symbolic(x):
            return self._table[:, _np.searchsorted(self._bounds, x, side='right')]
        count = x.numel()
        passed = cas.repmat(cas.reshape(x, 1, count), len(self._bound_list), 1) >= cas.repmat(
            cas.DM(self._bound_list), 1, count
        )
        values = cas.repmat(self._first, 1, count) + cas.mtimes(self._rises, passed)
        return [cas.reshape(values[row, :], *x.shape) for row in range(self._table.shape[0])]


def common_length(owner: str, values: Mapping[str, Any]) -> int:
    """Return how many elements the values have; one alone counts for all.

    Raises
    ------
    InputError
        If two of them have different lengths other than 1.
    """
    lengths = {name: _length(value) for name, value in values.items()}
    several = {length for length in lengths.values() if length != 1}
    if len(several) > 1:
        told = ', '.join(f'{name} {length}' for name, length in lengths.items() if length != 1)
        raise InputError(f'{owner}: lengths differ: {told}')
    return several.pop() if several else 1


def elements(owner: str, values: Mapping[str, Any], index: Any) -> dict[str, Any]:
    """Return the values at an index, slice or index array; what has one element stays.

    Raises
    ------
    IndexError
        If the index is beyond the common length.
    InputError
        As `common_length`.
    """
    count = common_length(owner, values)
    if isinstance(index, int | _np.integer) and not -count <= index < count:
        raise IndexError(f'{owner} has {count} elements, index {index} is beyond')
    return {name: value if _length(value) == 1 else value[index] for name, value in values.items()}


def _length(value: Any) -> int:
    if is_symbolic(value):
        return int(value.numel())
    shape = getattr(value, 'shape', None)
    if shape is not None:
        return int(shape[0]) if shape else 1
    return len(value) if hasattr(value, '__len__') else 1
