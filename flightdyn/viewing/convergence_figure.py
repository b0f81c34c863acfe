"""How a solver came to a plan."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError, MissingExtraError
from .plotting import COLORS, MUTED, legend_above, new_figure, style

try:
    from matplotlib.figure import Figure
except ImportError as error:
    raise MissingExtraError('a figure', 'view') from error

if TYPE_CHECKING:
    from ..planning.solver import Iteration

FLOOR = 1e-16  # infeasibilities that are nought have a place on a logarithmic axis


def convergence_figure(iterations: 'Sequence[Iteration]', *, title: str = '') -> Figure:
    """Return the objective and the infeasibilities over a solver's iterations.

    Parameters
    ----------
    iterations : sequence of Iteration
        As `Planner.plan` gives them to `on_iteration`. Each solve of several, such as on finer
        meshes, begins at a dotted line.

    Raises
    ------
    InputError
        If there is none.
    """
    if not iterations:
        raise InputError('no iterations to draw: the solver made none, or none were kept')
    numbers = np.array([each.number for each in iterations])
    begins = np.flatnonzero(np.diff(numbers) <= 0) + 1
    at = np.arange(numbers.size)
    objective = np.array([each.objective for each in iterations])
    primal = np.array([each.primal_infeasibility for each in iterations])
    dual = np.array([each.dual_infeasibility for each in iterations])
    with style():
        figure = new_figure((7.5, 4.6))
        cost, apart = figure.subplots(2, 1, sharex=True)
        solves = [part for part in np.split(at, begins) if part.size]
        for i, part in enumerate(solves):
            cost.plot(part, objective[part], marker='.', ms=4, color=COLORS[0])
            for j, (name, values) in enumerate((('primal', primal), ('dual', dual))):
                shown = np.maximum(np.abs(values[part]), FLOOR)
                label = f'{name} infeasibility' if i == 0 else None
                look = {'color': COLORS[j + 1], 'ls': '-' if j == 0 else '--'}
                apart.semilogy(part, shown, marker='.', ms=4, label=label, **look)
        for start in begins:
            for ax in (cost, apart):
                ax.axvline(start - 0.5, color=MUTED, ls=':', lw=0.9)
        cost.set_ylabel('objective')
        apart.set(xlabel='iteration', ylabel='scaled infeasibility [-]')
        legend_above(apart)
        solved = f'{len(solves)} solves' if len(solves) > 1 else 'one solve'
        spent = sum(iterations[part[-1]].elapsed for part in solves)
        facts = f'{numbers.size} iterations in {solved}, {spent:.3g} s'
        figure.suptitle(f'{title}\n{facts}' if title else facts, fontsize=9.5)
    return figure
