"""Solving one problem for many values of its parameters."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import casadi as cas
import numpy as np

from ..errors import InputError, NotConvergedError
from ..numpy import Vectorizable
from .opti_solution import OptiSol

if TYPE_CHECKING:
    from .opti import Opti


def sweep(
    opti: 'Opti',
    parameter_mapping: Mapping[cas.MX, Vectorizable],
    arguments: Mapping[str, Any],
    nothing: Callable[[str], OptiSol],
    *,
    follow: bool,
    report: Callable[[str], None] | None,
) -> Any:
    """Return an object array with the solution at each point of a sweep.

    Parameters
    ----------
    parameter_mapping : dict
        Values of scalar parameters, broadcast against each other.
    arguments : dict
        Of `Opti.solve`.
    nothing : function of a reason
        Gives what stands for the solution at a point that failed.
    follow : bool
        Start each solve from the last solution.
    report : function of a line
        Called after each point.
    """
    try:
        grids = np.broadcast_arrays(*(np.asarray(v, float) for v in parameter_mapping.values()))
    except ValueError as error:
        raise InputError(f'the values to sweep over have unlike shapes: {error}') from error
    solutions = np.empty(grids[0].shape if grids else (), dtype=object)
    for index in np.ndindex(solutions.shape):
        point = {p: float(grid[index]) for p, grid in zip(parameter_mapping, grids, strict=True)}
        try:
            sol = opti.solve(point, **arguments)
            if follow:
                opti.set_initial_from_sol(sol)
        except (NotConvergedError, InputError) as error:
            sol = nothing(str(error))
        solutions[index] = sol
        if report is not None:
            state = 'solved' if sol.converged else f'failed: {sol.reason.splitlines()[0]}'
            values = ', '.join(f'{value:.6g}' for value in point.values())
            report(f'{values}: {state}')
    return solutions


def values_over(solutions: Any) -> Callable[[Any], Any]:
    """Return a function that gives an expression's values over a sweep's solutions."""

    def values(x: Any) -> Any:
        each = np.array([sol(x) for sol in solutions.ravel()])
        return each.reshape(solutions.shape + each.shape[1:])

    return values
