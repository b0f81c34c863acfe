"""A flight in a vertical plane, from the side: its profile, its states, and its energy."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ..environment.atmosphere import G0
from ..errors import InputError, MissingExtraError
from ..trajectory import Trajectory
from .kinematics import Motion, motion_of
from .panels import panels_of, with_usual
from .plotting import (
    COLORS,
    MUTED,
    NOTHING,
    About,
    color_path,
    draw_columns,
    label_time,
    legend_above,
    mark_ends,
    new_figure,
    path_unit,
    prefixed,
    put_heading,
    style,
    time_unit,
)
from .quantities import unit_of

try:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
except ImportError as error:
    raise MissingExtraError('a figure', 'view') from error

Array = NDArray[np.float64]

MAX_PANELS = 5
TRUE_UNTIL = 4.0  # times as long as high: a profile as flat as that is drawn in true proportion


def profile_figure(
    trajectory: Trajectory,
    about: About = NOTHING,
    *,
    marked: Mapping[str, float] | None = None,
) -> Figure:
    """Return a flight from the side, coloured by airspeed, above its states and its energy.

    Parameters
    ----------
    trajectory : Trajectory
    about : About
        Limits are dashed in the histories.
    marked : mapping of column name to value, optional
        More dashed lines in the histories, in the column's own unit.

    Raises
    ------
    InputError
        If a marked column is not drawn.

    Notes
    -----
    Heights are drawn larger than distances where a flight is flat, and the figure says how much.
    The energy height, h + V^2 / (2 g) [m] with V the airspeed and g = 9.80665 m/s^2, tells what a
    glide spends: it never rises.
    """
    motion = motion_of(trajectory)
    trajectory = with_usual(trajectory, motion)
    _, per_second = time_unit(trajectory)
    panels = panels_of(trajectory, about)[:MAX_PANELS]
    marked = marked or {}
    columns = [name for names in panels for name in names]
    lost = [name for name in marked if name not in columns]
    if lost:
        raise InputError(f'nothing to mark {", ".join(lost)} in: drawn are {", ".join(columns)}')
    energy = energy_height(trajectory)
    with style():
        figure = new_figure((8.5, 4.2 + 1.05 * len(panels)))
        scene, audit, *histories = figure.subplots(
            2 + len(panels), 1, height_ratios=(2.6, 1.3, *(1 for _ in panels))
        )
        flat = _side(figure, scene, trajectory, motion)
        _audit(audit, motion, energy, per_second)
        for ax, names in zip(histories, panels, strict=True):
            draw_columns(ax, trajectory, names, per_second, about)
            for name in names:
                if name in marked:
                    at = marked[name] * unit_of(name)[1]
                    ax.axhline(at, color=MUTED, ls=(0, (1, 2)), lw=1.1)
        label_time([audit, *histories], trajectory)
        said = [_glide(motion, energy)]
        if flat is not None:
            put_heading(figure, trajectory, about, *said, 'heights drawn larger than distances')
            figure.draw_without_rendering()  # lays the axes out below a heading as long as this
            larger = float(f'{_stretch(scene, flat):.2g}')
            words = f'heights drawn {larger:g} times as large as distances'
            put_heading(figure, trajectory, about, *said, words)
        else:
            put_heading(figure, trajectory, about, *said)
    return figure


def energy_height(trajectory: Trajectory) -> Array:
    """Return altitude and kinetic energy together as a height [m] (n,).

    Of the airspeed if it is known, else of the speed; `trajectory` has an `altitude`.
    """
    fast = trajectory['airspeed' if 'airspeed' in trajectory else 'speed']
    height: Array = trajectory['altitude'] + fast**2 / (2 * G0)
    return height


def _side(figure: Figure, ax: Axes, trajectory: Trajectory, motion: Motion) -> float | None:
    """Draw the profile.

    Returns
    -------
    float or None
        How many times as large as a distance a height of as many units of the axes is; None if
        the profile is drawn in true proportion.
    """
    name = 'airspeed' if 'airspeed' in trajectory else 'speed'
    unit, scale = path_unit(float(np.ptp(motion.position[:, 0])))
    shown, factor = prefixed('m', float(np.abs(motion.altitude).max()))
    x, altitude = motion.position[:, 0] * scale, motion.altitude * factor
    lines = color_path(ax, x, altitude, trajectory[name], motion.segments)
    mark_ends(ax, x, altitude)
    ax.set(xlabel=f'x_e [{unit}]', ylabel=f'altitude [{shown}]')
    figure.colorbar(lines, ax=ax, label=f'{name} [m/s]', pad=0.01)
    legend_above(ax)
    if unit == shown and np.ptp(x) < TRUE_UNTIL * np.ptp(altitude):
        ax.set_aspect('equal', adjustable='datalim')
        return None
    return factor / scale


def _stretch(ax: Axes, ratio: float) -> float:
    """Return how many times as large as distances heights are drawn, `ratio` as of `_side`."""
    (x0, y0), (x1, y1) = ax.transData.transform([(0, 0), (1, 1)])
    return float((y1 - y0) / (x1 - x0) * ratio)


def _audit(ax: Axes, motion: Motion, energy: Array, per_second: float) -> None:
    shown, factor = prefixed('m', float(np.abs(energy).max()))
    time, height, total = motion.time * per_second, motion.altitude * factor, energy * factor
    for i, part in enumerate(motion.segments):
        names = ('energy height', 'altitude', 'V^2 / (2 g)') if i == 0 else (None, None, None)
        ax.fill_between(
            time[part], height[part], total[part], color=COLORS[4], alpha=0.3, lw=0,
            label=names[2],
        )  # fmt: skip
        ax.plot(time[part], total[part], color=COLORS[0], label=names[0])
        ax.plot(time[part], height[part], color=COLORS[2], ls='--', label=names[1])
    ax.set_ylabel(f'height\n[{shown}]')
    legend_above(ax)


def _glide(motion: Motion, energy: Array) -> str:
    """Return in words how far a flight without power went on its energy."""
    gone = float(motion.position[-1, 0] - motion.position[0, 0])
    spent = float(energy[0] - energy[-1])
    rise = max(float(np.diff(energy[part]).max(initial=0)) for part in motion.segments)
    if not gone > 0 or not spent > 0 or rise > 1e-3 * spent:
        return ''
    return f'{gone / 1e3:.4g} km on {spent:.4g} m of energy height, {gone / spent:.3g} to 1'
