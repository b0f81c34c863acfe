"""Columns of a flight over time, those alike on one axis."""

from collections.abc import Sequence

from ..errors import InputError, MissingExtraError
from ..trajectory import Trajectory
from .kinematics import motion_of
from .panels import draw_panels, related, with_usual
from .plotting import (
    NOTHING,
    About,
    put_heading,
    style,
)

try:
    from matplotlib.figure import Figure
except ImportError as error:
    raise MissingExtraError('a figure', 'view') from error


def history_figure(
    trajectory: Trajectory, names: Sequence[str] | None = None, about: About = NOTHING
) -> Figure:
    """Return columns over time, those alike on one axis, each with its unit.

    Parameters
    ----------
    trajectory : Trajectory
    names : sequence of str or None
        Columns to draw; the states and controls if None, the altitude instead of z_e. There are
        `altitude` and `speed` where the trajectory has none.
    about : About
        Limits are dashed, arcs shaded.

    Raises
    ------
    InputError
        If a name is not in the trajectory.
    """
    flight = with_usual(trajectory, motion_of(trajectory))
    every = [*trajectory.states, *trajectory.controls]
    chosen = ['altitude' if n == 'z_e' else n for n in every] if names is None else list(names)
    unknown = [name for name in chosen if name not in flight]
    if unknown or not chosen:
        raise InputError(
            f'nothing to draw of {", ".join(unknown) or "no columns"}: the trajectory has '
            f'{", ".join(flight.columns)}'
        )
    with style():
        figure = draw_panels(flight, related(flight, chosen), about)
        put_heading(figure, trajectory, about)
    return figure
