"""Figures of studies: polars, glides seen from the side, several flights."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, MissingExtraError
from ..trajectory import Trajectory
from .kinematics import motion_of
from .plotting import draw_columns, look_of, new_figure, style, time_unit, title_of

try:
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure
except ImportError as error:
    raise MissingExtraError('a figure', 'view') from error

Array = NDArray[np.float64]

FAR = 5e3  # m: distances beyond are in km


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


def profile_figure(trajectory: Trajectory, *, marked: Mapping[str, float] | None = None) -> Figure:
    """Return a flight seen from the side, coloured by airspeed, above its states over time.

    Parameters
    ----------
    trajectory : Trajectory
    marked : mapping of column name to value, optional
        Dashed lines in the histories, in the column's own unit.

    Raises
    ------
    InputError
        If a marked column is not drawn.
    """
    motion = motion_of(trajectory)
    name = 'airspeed' if 'airspeed' in trajectory else 'speed'
    fast = trajectory.columns.get(name, motion.speed)
    shown, per_second = time_unit(trajectory)
    drawn = [n for n in (name, 'alpha', 'gamma') if n in trajectory]
    lost = [n for n in marked or {} if n not in drawn]
    if lost:
        raise InputError(f'nothing to mark {", ".join(lost)} in: drawn are {", ".join(drawn)}')
    scale, unit = _distance(float(np.ptp(motion.position[:, 0])))
    with style():
        figure = new_figure((8.0, 3.0 + 1.4 * len(drawn)))
        scene, *histories = figure.subplots(
            1 + len(drawn), 1, height_ratios=(2, *(1 for _ in drawn)), squeeze=False
        ).ravel()
        points = np.column_stack([motion.position[:, 0] * scale, motion.altitude])
        pieces = [
            np.stack([points[part][:-1], points[part][1:]], axis=1) for part in motion.segments
        ]
        lines = LineCollection(
            list(np.concatenate(pieces)), cmap='viridis', linewidths=2.0, capstyle='round'
        )
        lines.set_array(np.concatenate([fast[part][:-1] for part in motion.segments]))
        scene.add_collection(lines)
        scene.autoscale_view()
        scene.set(xlabel=f'x_e [{unit}]', ylabel='altitude [m]')
        figure.colorbar(lines, ax=scene, label=f'{name} [m/s]')
        for ax, column in zip(histories, drawn, strict=True):
            draw_columns(ax, trajectory, [column], per_second)
            if column in (marked or {}):
                ax.axhline((marked or {})[column], color='#666666', ls='--', lw=0.9)
            ax.set_xlim(trajectory.time[0] * per_second, trajectory.time[-1] * per_second)
            ax.tick_params(labelbottom=ax is histories[-1])
        if histories:
            histories[-1].set_xlabel(f'time [{shown}]')
        figure.suptitle(title_of(trajectory), fontsize=10)
    return figure


def tracks_figure(flights: Mapping[str, Trajectory]) -> Figure:
    """Return the ground tracks of several flights, by label, beside their altitudes over time."""
    motions = {label: motion_of(flight) for label, flight in flights.items()}
    scale, unit = _distance(
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
                high.plot(motion.time[part], motion.altitude[part], **look)
        track.set_aspect('equal', adjustable='datalim')
        track.set(xlabel=f'y_e, east [{unit}]', ylabel=f'x_e, north [{unit}]')
        high.set(xlabel='time [s]', ylabel='altitude [m]')
        high.legend()
        figure.suptitle(title_of(next(iter(flights.values()))), fontsize=10)
    return figure


def _distance(extent: float) -> tuple[float, str]:
    return (1e-3, 'km') if extent > FAR else (1.0, 'm')
