"""A flight in three dimensions: from above, its heights, and what it did over time."""

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from .. import frames
from ..environment.surroundings import Surroundings
from ..errors import MissingExtraError
from ..trajectory import Trajectory
from .kinematics import Motion, motion_of
from .panels import panels_of, with_usual
from .plotting import (
    COLORS,
    MUTED,
    NOTHING,
    About,
    draw_columns,
    draw_track,
    label_time,
    legend_above,
    look_of,
    new_figure,
    path_unit,
    prefixed,
    put_heading,
    style,
    time_unit,
)
from .surroundings_drawing import draw_below, draw_ground

try:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import SubplotSpec
    from matplotlib.ticker import MaxNLocator
except ImportError as error:
    raise MissingExtraError('a figure', 'view') from error

Array = NDArray[np.float64]

MAX_PANELS = 6
STEEP = 0.1
"""Of a flight that climbs and sinks by more than this share of its extent, the shape is shown."""
BODY_AXES = (
    (((-0.6, 0.0, 0.0), (1.0, 0.0, 0.0)), '#333333'),
    (((0.0, -0.8, 0.0), (0.0, 0.8, 0.0)), '#333333'),
    (((0.0, 0.0, 0.0), (0.0, 0.0, -1.0)), COLORS[1]),
)
"""A rigid body in space: fore and aft, span, and up, as lines in its axes, and their colours."""
BODY_SHARE = 0.08  # of the flight's extent


def path_figure(
    trajectory: Trajectory,
    surroundings: Surroundings | None = None,
    about: About = NOTHING,
) -> Figure:
    """Return a flight from above over what stands there, its heights, and its histories.

    Parameters
    ----------
    trajectory : Trajectory
    surroundings : Surroundings or None
        Terrain, keep-outs, gates and marks, drawn under the flight.
    about : About
        Limits are dashed in the histories, arcs shaded.

    Notes
    -----
    Under the ground track stand the heights over the distance flown, with the ground below; of a
    steep flight without terrain, its shape in space, all axes alike.
    """
    motion = motion_of(trajectory)
    trajectory = with_usual(trajectory, motion)
    _, per_second = time_unit(trajectory)
    terrain = surroundings and surroundings.terrain
    steep = not terrain and np.ptp(motion.altitude) > STEEP * motion.size
    panels = panels_of(trajectory, about)[: MAX_PANELS - steep]
    if steep:
        panels = [['altitude'], *panels]
    with style():
        figure = new_figure((10.0, max(6.0, 1.0 + 1.15 * len(panels))))
        whole = figure.add_gridspec(1, 2, width_ratios=(1.15, 1))
        left, right = whole[0], whole[1]
        places = left.subgridspec(2, 1, height_ratios=(1.2, 1) if steep else (2.4, 1))
        _above(figure, figure.add_subplot(places[0]), trajectory, motion, surroundings)
        if steep:
            turns = 'theta' in trajectory.states or 'qw' in trajectory.states
            _in_space(figure, places[1], motion, turns)
        else:
            _heights(figure.add_subplot(places[1]), motion, surroundings)
        axes = list(right.subgridspec(len(panels), 1).subplots(sharex=True, squeeze=False)[:, 0])
        for ax, names in zip(axes, panels, strict=True):
            draw_columns(ax, trajectory, names, per_second, about)
        label_time(axes, trajectory)
        put_heading(figure, trajectory, about)
    return figure


def _above(
    figure: Figure,
    ax: Axes,
    trajectory: Trajectory,
    motion: Motion,
    surroundings: Surroundings | None,
) -> None:
    name = 'airspeed' if 'airspeed' in trajectory else 'speed'
    scale = draw_track(figure, ax, motion, trajectory[name], f'{name} [m/s]')
    if surroundings:
        draw_ground(ax, surroundings, scale)
        _look_at(ax, motion, surroundings, scale)
    legend_above(ax)


def _look_at(ax: Axes, motion: Motion, surroundings: Surroundings, scale: float) -> None:
    """Show the flight and all gates, keep-outs and marks near it, not a whole map."""
    low, high = (np.array(edge[:2]) for edge in motion.bounds)
    room = 0.15 * max(float((high - low).max()), 1e-9)
    places = [gate.centre[:2] for gate in surroundings.gates]
    places += [mark.place[:2] for mark in surroundings.marks]
    for place in places:
        at = np.array(place)
        if (np.abs(at - (low + high) / 2) < high - low + 4 * room).all():
            low, high = np.minimum(low, at), np.maximum(high, at)
    ax.set_aspect('equal', adjustable='box')
    ax.set_xlim((low[1] - room) * scale, (high[1] + room) * scale)
    ax.set_ylim((low[0] - room) * scale, (high[0] + room) * scale)


def _heights(ax: Axes, motion: Motion, surroundings: Surroundings | None) -> None:
    unit, scale = path_unit(float(motion.arc_length[-1]))
    shown, factor = prefixed('m', float(np.abs(motion.altitude).max()))
    along = motion.arc_length * scale
    for part in motion.segments:
        ax.plot(along[part], motion.altitude[part] * factor, **look_of(0))
    if surroundings:
        draw_below(ax, surroundings, motion, along, factor)
    ax.set(xlabel=f'distance flown [{unit}]', ylabel=f'altitude [{shown}]')
    ax.set_xlim(along[0], along[-1])


def _in_space(figure: Figure, place: SubplotSpec, motion: Motion, turns: bool) -> None:
    """Draw the path in space with its shadow, and how a rigid body turns; all axes alike."""
    ax = figure.add_subplot(place, projection='3d')
    unit, scale = path_unit(float(np.ptp(motion.position, axis=0).max()))
    x, y, z = motion.position[:, 1] * scale, motion.position[:, 0] * scale, motion.altitude * scale
    spans = np.array([np.ptp(each) for each in (x, y, z)])
    floor = float(z.min()) - 0.15 * float(spans.max())
    for part in motion.segments:
        ax.plot(x[part], y[part], floor, color='#bbbbbb', lw=1.2)
        ax.plot(x[part], y[part], z[part], color=look_of(0)['color'])
    shown = _evenly(motion, 11 if turns else 9)
    for k in shown:
        ax.plot([x[k]] * 2, [y[k]] * 2, [floor, z[k]], color='#bbbbbb', lw=0.7)
    if turns:
        size = BODY_SHARE * float(spans.max())
        for (sides, color), k in product(BODY_AXES, shown):
            turned = [frames.rotate(_body_to_earth(motion, k), side) for side in sides]
            north, east, down = np.array(turned).T * size
            ax.plot(x[k] + east, y[k] + north, z[k] - down, color=color, lw=1.8, zorder=5)
    ax.plot(x[:1], y[:1], z[:1], 'o', color='black', ms=4)
    ax.plot(x[-1:], y[-1:], z[-1:], 's', color='black', mfc='white', ms=4)
    ax.set_box_aspect(
        [np.ptp(edge) for edge in (ax.get_xlim(), ax.get_ylim(), ax.get_zlim())], zoom=1.05
    )
    ax.set(xlabel=f'east [{unit}]', ylabel=f'north [{unit}]', zlabel=f'altitude [{unit}]')
    ax.tick_params(labelsize=6, pad=-1, colors=MUTED)
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        axis.label.set_size(7)
        axis.set_major_locator(MaxNLocator(4))
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
    ax.view_init(elev=24, azim=-58)


def _body_to_earth(motion: Motion, k: int) -> frames.Rotation:
    w, x, y, z = motion.attitude[k]
    return frames.rotation_from_quaternion((w, x, y, z))


def _evenly(motion: Motion, count: int) -> Sequence[int]:
    """Return samples evenly along the path."""
    wanted = np.linspace(0, motion.arc_length[-1], count)
    return [int(k) for k in np.unique(np.searchsorted(motion.arc_length, wanted))]
