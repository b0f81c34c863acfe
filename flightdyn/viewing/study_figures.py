"""Figures of studies: polars, and several flights."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, MissingExtraError
from ..trajectory import Trajectory
from .kinematics import motion_of
from .plotting import NOTHING, look_of, new_figure, path_unit, put_heading, style

try:
    from matplotlib.figure import Figure
except ImportError as error:
    raise MissingExtraError('a figure', 'view') from error

Array = NDArray[np.float64]


def polar_figure(polars: Mapping[str, Mapping[str, ArrayLike]], *, title: str = '') -> Figure:
    """Return lift, drag and their ratio over the angle of attack, the best ratio marked.

    Parameters
    ----------
    polars : mapping of label to columns
        Each with alpha [deg], CL and CD, shape (n,).

    Raises
    ------
    InputError
        If a column is missing.
    """
    with style():
        figure = new_figure((9.5, 3.2))
        lift, drag, glide = figure.subplots(1, 3)
        for i, (label, columns) in enumerate(polars.items()):
            missing = [name for name in ('alpha', 'CL', 'CD') if name not in columns]
            if missing:
                raise InputError(f'no polar of {label}: it lacks {", ".join(missing)}')
            alpha, cl, cd = (np.asarray(columns[name], float) for name in ('alpha', 'CL', 'CD'))
            look = look_of(i)
            lift.plot(alpha, cl, label=label, **look)
            drag.plot(alpha, cd, **look)
            glide.plot(alpha, cl / cd, **look)
            best = int(np.argmax(cl / cd))
            glide.plot(alpha[best], cl[best] / cd[best], 'o', color=look['color'], ms=5)
            words = f'{cl[best] / cd[best]:.1f} at {alpha[best]:.1f} deg'
            at = (alpha[best], cl[best] / cd[best])
            glide.annotate(words, at, (0, 7), textcoords='offset points', ha='center')
        for ax, label in ((lift, 'CL [-]'), (drag, 'CD [-]'), (glide, 'CL/CD [-]')):
            ax.set(xlabel='alpha [deg]', ylabel=label)
        glide.margins(y=0.12)
        if len(polars) > 1:
            lift.legend()
        figure.suptitle(title or ', '.join(polars), fontsize=10)
    return figure


def tracks_figure(flights: Mapping[str, Trajectory]) -> Figure:
    """Return the ground tracks of several flights, by label, beside their altitudes over time."""
    motions = {label: motion_of(flight) for label, flight in flights.items()}
    unit, scale = path_unit(
        max(float(np.ptp(m.position[:, :2], 0).max()) for m in motions.values())
    )
    with style():
        figure = new_figure((9.0, 4.2))
        track, high = figure.subplots(1, 2)
        for i, (label, motion) in enumerate(motions.items()):
            for j, part in enumerate(motion.segments):
                look = look_of(i) | {'label': label if j == 0 else None}
                east, north = motion.position[part, 1] * scale, motion.position[part, 0] * scale
                track.plot(east, north, **look)
                track.plot(east[0], north[0], 'o', color='black', ms=4, zorder=4)
                track.plot(east[-1], north[-1], 's', color='black', mfc='white', ms=4, zorder=4)
                high.plot(motion.time[part], motion.altitude[part], **look)
        track.set_aspect('equal', adjustable='datalim')
        track.set(xlabel=f'y_e, east [{unit}]', ylabel=f'x_e, north [{unit}]')
        high.set(xlabel='time [s]', ylabel='altitude [m]')
        figure.legend(*high.get_legend_handles_labels(), loc='outside lower center', ncols=4)
        put_heading(figure, next(iter(flights.values())), NOTHING)
    return figure
