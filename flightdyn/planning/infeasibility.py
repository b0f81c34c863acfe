"""What is wrong with an iterate: constraints that it violates, values that are not numbers."""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as cas
import numpy as np
from numpy.typing import NDArray

from .declarations import Declaration

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Infeasibility:
    """One row of a constraint or bound that an iterate does not meet."""

    declaration: Declaration
    row: int
    """Which row of the constraint as it was declared."""
    value: float
    lower: float
    upper: float

    @property
    def violation(self) -> float:
        """How far the value is outside its limits; infinite where it is not a number."""
        outside = max(self.lower - self.value, self.value - self.upper)
        return outside if np.isfinite(outside) else np.inf

    def __str__(self) -> str:
        if self.lower == self.upper:
            limits = f'must equal {self.lower:.6g}'
        else:
            limits = ' and '.join(
                f'must be {sign} {limit:.6g}'
                for sign, limit in (('>=', self.lower), ('<=', self.upper))
                if np.isfinite(limit)
            )
        return (
            f'{self.declaration.text(self.row)}: {self.value:.6g} {limits}, '
            f'off by {self.violation:.3g}'
        )


def find_row(declarations: Sequence[Declaration], index: int) -> tuple[Declaration, int]:
    """Return the declaration that a row of all rows belongs to, and the row within it."""
    ends = np.cumsum([declaration.size for declaration in declarations])
    position = int(np.searchsorted(ends, index, side='right'))
    declaration = declarations[position]
    return declaration, index - int(ends[position]) + declaration.size


def infeasibilities(
    declarations: Sequence[Declaration], g: Array, lower: Array, upper: Array, tolerance: float
) -> list[Infeasibility]:
    """Return the rows violated by more than the tolerance, the worst of each declaration first.

    The order is that of the violation over the size of the limit, so that metres and radians
    compare; further rows of the same declaration follow behind all first ones.
    """
    outside = np.maximum(lower - g, g - upper)
    limit = np.where(np.isfinite(lower), lower, np.where(np.isfinite(upper), upper, 0.0))
    relative = outside / np.maximum(1.0, np.abs(limit))
    relative[np.isnan(relative)] = np.inf
    first: dict[int, Infeasibility] = {}
    rest: list[Infeasibility] = []
    for index in np.argsort(-relative, kind='stable'):
        if not relative[index] > tolerance:
            break
        declaration, row = find_row(declarations, int(index))
        found = Infeasibility(
            declaration, row, float(g[index]), float(lower[index]), float(upper[index])
        )
        if id(declaration) in first:
            rest.append(found)
        else:
            first[id(declaration)] = found
    return [*first.values(), *rest]


def not_numbers(
    inputs: cas.MX,
    outputs: cas.MX,
    point: Array,
    other_inputs: cas.MX,
    other_values: Array,
    rows: Sequence[Declaration],
    columns: Sequence[Declaration],
) -> list[str]:
    """Return what is not finite at a point: outputs, else elements of their Jacobian.

    Parameters
    ----------
    inputs, outputs : MX (nx, 1), (ny, 1)
        Decision variables; objective and constraints.
    rows, columns : declarations of the outputs and of the inputs
    """
    values = cas.Function('values', [inputs, other_inputs], [outputs])(point, other_values)
    bad = np.flatnonzero(~np.isfinite(values.full().ravel()))
    if bad.size:
        return list(
            dict.fromkeys(
                _text(rows, index) + f' is {float(values[index])}' for index in map(int, bad)
            )
        )
    jacobian = cas.Function('jacobian', [inputs, other_inputs], [cas.jacobian(outputs, inputs)])(
        point, other_values
    )
    row, column = (np.array(index) for index in jacobian.sparsity().get_triplet())
    bad = np.flatnonzero(~np.isfinite(np.array(jacobian.nonzeros())))
    return list(
        dict.fromkeys(
            f'the derivative of {_text(rows, int(row[k]))} '
            f'by {_text(columns, int(column[k]))}, at {point[column[k]]:.6g}'
            for k in bad
        )
    )


def _text(declarations: Sequence[Declaration], index: int) -> str:
    declaration, row = find_row(declarations, index)
    return declaration.text(row)
