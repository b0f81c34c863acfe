"""A solved optimisation problem: the values of its variables, put into any expression."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as cas
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .declarations import Declaration
from .infeasibility import Infeasibility, infeasibilities
from .substitution import substitute

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class OptiSol:
    """An iterate of a problem of `Opti`, independent of later solves.

    Call it with anything built from the variables to get the same thing with numbers.
    """

    symbols: Sequence[cas.MX]
    """Variables, parameters and multipliers of the constraints."""
    values: Sequence[Array]
    """Their values, column by column."""
    g: Array
    lower: Array
    upper: Array
    """Constraints and their limits, (ng,)."""
    constraints: Sequence[Declaration]
    statistics: Mapping[str, Any] = field(repr=False)
    converged: bool = True
    reason: str = ''
    """Why it did not converge."""

    def __call__(self, x: Any) -> Any:
        """Return `x` with numbers in the place of expressions.

        Parameters
        ----------
        x : Any
            An expression; a list, tuple, dict, set, object array or dataclass; or any object that
            keeps its attributes in `__dict__` (Dynamics, MassProperties, Atmosphere ...), nested
            and in circles as it may be. An object is copied, the original stays symbolic.

        Returns
        -------
        Any
            A scalar expression becomes a float, a column or row a 1-D array, another matrix a
            2-D array. What holds no expression stays as it is.

        Raises
        ------
        InputError
            If an expression depends on a symbol of another problem.
        """
        return substitute(x, self._evaluate)

    value = __call__

    def _evaluate(self, expressions: list[Any]) -> list[Any]:
        if not expressions:
            return []
        numbers = {}
        if symbolic := [e for e in expressions if isinstance(e, cas.MX)]:
            f = cas.Function('values', list(self.symbols), symbolic, {'allow_free': True})
            if f.has_free():
                raise InputError(
                    f'the expression depends on {", ".join(f.get_free())}, '
                    'which the solved problem does not have'
                )
            results = f.call([cas.DM(value) for value in self.values])
            numbers = {id(e): result for e, result in zip(symbolic, results, strict=True)}
        return [_plain(numbers.get(id(e), e)) for e in expressions]

    def stats(self) -> dict[str, Any]:
        """Return the statistics of the solver: 'iter_count', 'return_status' and so on."""
        return dict(self.statistics)

    def infeasibilities(self, tol: float = 1e-3) -> list[Infeasibility]:
        """Return the rows of constraints and bounds violated by more than `tol`, worst first.

        `tol` is absolute where the limit is below 1, relative to it above.
        """
        return infeasibilities(self.constraints, self.g, self.lower, self.upper, tol)

    def show_infeasibilities(self, tol: float = 1e-3) -> None:
        """Print `infeasibilities(tol)`, one a line, with the place where each was declared."""
        found = self.infeasibilities(tol)
        print('\n'.join(map(str, found)) or f'no constraint is violated by more than {tol:g}')


def _plain(value: Any) -> Any:
    """Return a DM or constant SX as float, 1-D or 2-D array."""
    array = cas.DM(value).full()
    if array.size == 1:
        return float(array[0, 0])
    return array.ravel() if 1 in array.shape else array
