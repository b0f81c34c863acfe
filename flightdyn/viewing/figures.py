"""Figures of plans, simulations and flights, drawn without a screen."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, MissingExtraError
from ..files import written_whole
from ..trajectory import Trajectory
from .flip_figure import flip_figure as flip_figure
from .kinematics import Motion, motion_of, pose_at
from .plotting import COLORS, draw_columns, new_figure, style, time_unit, title_of
from .quantities import unit_of
from .scenery import speed_range
from .study_figures import polar_figure as polar_figure
from .study_figures import profile_figure as profile_figure
from .study_figures import tracks_figure as tracks_figure
from .sweep_figures import sweep_figure as sweep_figure

try:
    from matplotlib.axes import Axes
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure
except ImportError as error:
    raise MissingExtraError('a figure', 'view') from error

Array = NDArray[np.float64]

SUFFIXES = ('.png', '.svg', '.pdf')
_RELATED = (
    ('x_e', 'y_e'), ('z_e', 'altitude'), ('u_e', 'v_e', 'w_e'), ('u_b', 'v_b', 'w_b'),
    ('speed', 'airspeed'), ('gamma', 'theta', 'alpha', 'beta'), ('bank', 'phi'),
    ('track', 'psi'), ('qw', 'qx', 'qy', 'qz'), ('p', 'q', 'r'),
)  # fmt: skip


def figure_for(
    trajectory: Trajectory,
    *,
    planned: Trajectory | None = None,
    replayed: Trajectory | None = None,
) -> Figure:
    """Return the figure that shows most of a trajectory.

    A comparison if there is a plan to compare with; a quadcopter's flip; the ground track of a
    flight with a date, a place on earth or turns; the side view of one in a vertical plane; else
    the history of states and controls.
    """
    if planned is not None:
        return comparison_figure(planned, trajectory, replayed)
    if 'theta' in trajectory and 'thrust_left' in trajectory and 'x_e' in trajectory:
        return flip_figure(trajectory)
    if trajectory.start_ns or 'lat' in trajectory or 'track' in trajectory.states:
        return ground_track_figure(trajectory)
    if 'gamma' in trajectory.states:
        return profile_figure(trajectory)
    return history_figure(trajectory)


def save_figure(figure: Figure, path: str | os.PathLike[str], *, dpi: float = 150.0) -> None:
    """Write a figure as PNG, SVG or PDF by the path's suffix; never half a file.

    Raises
    ------
    InputError
        If the suffix is none of them, or there is no such folder.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f'cannot draw {path}: a figure ends in {", ".join(SUFFIXES)}')
    with written_whole(path) as temporary:
        figure.savefig(temporary, format=suffix[1:], dpi=dpi)


def history_figure(trajectory: Trajectory, names: Sequence[str] | None = None) -> Figure:
    """Return columns over time, those alike on one axis, each with its unit.

    Parameters
    ----------
    trajectory : Trajectory
    names : sequence of str or None
        Columns to draw; the states and controls if None. `altitude` stands for -z_e where there
        is none. A column with a 1-sigma beside it
        (`speed_std` for `speed`) is drawn with its band.

    Raises
    ------
    InputError
        If a name is not in the trajectory.
    """
    chosen = list(names) if names is not None else [*trajectory.states, *trajectory.controls]
    if 'altitude' in chosen and 'altitude' not in trajectory and 'z_e' in trajectory:
        outputs = {**trajectory.outputs, 'altitude': -trajectory['z_e']}
        trajectory = replace(trajectory, outputs=outputs)
    unknown = [name for name in chosen if name not in trajectory]
    if unknown or not chosen:
        raise InputError(
            f'nothing to draw of {", ".join(unknown) or "no columns"}: the trajectory has '
            f'{", ".join(trajectory.columns)}'
        )
    panels = _panels(trajectory, chosen)
    unit, per_second = time_unit(trajectory)
    columns = 1 if len(panels) < 4 else 2
    rows = -(-len(panels) // columns)
    with style():
        figure = new_figure((4.6 * columns, 1.0 + 1.6 * rows))
        axes = figure.subplots(rows, columns, sharex=True, squeeze=False).T.ravel()
        for ax, panel in zip(axes, panels, strict=False):
            draw_columns(ax, trajectory, panel, per_second)
            if list(panel) == ['z_e']:
                ax.invert_yaxis()  # z points down, but up shall be up
        for ax in axes[len(panels) :]:
            ax.set_visible(False)
        last = [axes[min((i + 1) * rows, len(panels)) - 1] for i in range(columns)]
        for ax in last:
            ax.set_xlabel(f'time [{unit}]')
            ax.tick_params(labelbottom=True)
        figure.suptitle(title_of(trajectory), fontsize=10)
    return figure


def comparison_figure(
    planned: Trajectory, flown: Trajectory, replayed: Trajectory | None = None
) -> Figure:
    """Return a plan and what became of it: paths, altitude, speed and distance apart in time.

    Parameters
    ----------
    planned, flown : Trajectory
        Compared at equal times since each one's start, or by date if both have one.
    replayed : Trajectory or None
        What a replay of the flight's log found.
    """
    plan = motion_of(planned, origin=flown.origin)
    runs = [('planned', planned, plan), ('flown', flown, motion_of(flown))]
    if replayed is not None:
        runs.append(('replayed', replayed, motion_of(replayed, origin=flown.origin)))
    looks = {'planned': ('#666666', '--'), 'flown': (COLORS[0], '-'), 'replayed': (COLORS[1], ':')}
    with style():
        figure = new_figure((9.0, 6.0))
        path, high, apart, fast = figure.subplots(2, 2).ravel()
        sideways = float(np.ptp(plan.position[:, 1])) > 1e-3 * max(plan.size, 1e-9)
        for name, run, motion in runs:
            color, line = looks[name]
            t = run.time + _offset(flown, run)
            for i, part in enumerate(motion.segments):
                label = name if i == 0 else None
                look = {'color': color, 'ls': line, 'label': label}
                across = motion.position[part, 1] if sideways else motion.position[part, 0]
                along = motion.position[part, 0] if sideways else motion.altitude[part]
                path.plot(across, along, **look)
                high.plot(t[part], motion.altitude[part], **look)
                fast.plot(t[part], motion.speed[part], **look)
            if name == 'planned':
                continue
            then = run.time - _offset(run, planned)
            meant, _, inside = pose_at(plan, then)
            error = (motion.position - meant)[inside]
            label = 'distance' if len(runs) == 2 else name
            apart.plot(t[inside], np.linalg.norm(error, axis=1), color=color, ls=line, label=label)
            if len(runs) == 2:
                for i, axis in enumerate(('x_e', 'y_e', 'z_e')):
                    if np.abs(error[:, i]).max(initial=0) > 0:
                        apart.plot(t[inside], error[:, i], lw=0.9, label=axis, color=COLORS[i + 1])
        path.set(xlabel='y_e, east [m]' if sideways else 'x_e [m]',
                 ylabel='x_e, north [m]' if sideways else 'altitude [m]')  # fmt: skip
        path.set_aspect('equal', adjustable='datalim')
        path.legend()
        high.set(xlabel='time [s]', ylabel='altitude [m]')
        fast.set(xlabel='time [s]', ylabel='speed [m/s]')
        error_label = 'flown less planned [m]' if len(runs) == 2 else 'distance from plan [m]'
        apart.set(xlabel='time [s]', ylabel=error_label)
        apart.legend()
        figure.suptitle(title_of(flown), fontsize=10)
    return figure


def ground_track_figure(trajectory: Trajectory) -> Figure:
    """Return the ground track coloured by speed, beside altitude, speed and bank over time."""
    motion = motion_of(trajectory)
    bank = 'bank' if 'bank' in trajectory else 'phi' if 'phi' in trajectory else ''
    scale, unit = (1e-3, 'km') if np.ptp(motion.position[:, :2], axis=0).max() > 5e3 else (1, 'm')
    shown, per_second = time_unit(trajectory)
    time = motion.time * per_second
    with style():
        figure = new_figure((9.5, 4.8))
        grid = figure.add_gridspec(3 if bank else 2, 2, width_ratios=(1.25, 1))
        track = figure.add_subplot(grid[:, 0])
        lines = _speed_lines(motion, scale)
        track.add_collection(lines)
        track.autoscale_view()
        east, north = motion.position[:, 1] * scale, motion.position[:, 0] * scale
        track.plot(east[0], north[0], 'o', color='black', ms=5, label='start')
        track.plot(east[-1], north[-1], 's', color='black', mfc='white', ms=5, label='end')
        track.set_aspect('equal', adjustable='datalim')
        track.set(xlabel=f'y_e, east [{unit}]', ylabel=f'x_e, north [{unit}]')
        track.legend(loc='lower left', bbox_to_anchor=(0, 1), ncols=2)
        figure.colorbar(lines, ax=track, label='speed [m/s]', shrink=0.8)
        first = figure.add_subplot(grid[0, 1])
        _histories(first, trajectory, motion, time, motion.altitude, 'altitude', 'm')
        second = figure.add_subplot(grid[1, 1], sharex=first)
        _histories(second, trajectory, motion, time, motion.speed, 'speed', 'm/s')
        bottom = second
        if bank:
            bottom = figure.add_subplot(grid[2, 1], sharex=first)
            values = np.degrees(trajectory[bank])
            _histories(bottom, trajectory, motion, time, values, bank, 'deg')
        for ax in (first, second):
            ax.tick_params(labelbottom=ax is bottom)
        bottom.set_xlabel(f'time [{shown}]')
        figure.suptitle(title_of(trajectory), fontsize=10)
    return figure


def _panels(trajectory: Trajectory, names: list[str]) -> list[list[str]]:
    """Return names that share an axis, in the order given."""
    panels: dict[object, list[str]] = {}
    for name in names:
        key: object = next((group for group in _RELATED if name in group), None)
        if key is None:
            key = (unit_of(name)[0], name in trajectory.controls)
            if key[0] == '-':  # without a unit nothing says that two belong together
                key = name
        panels.setdefault(key, []).append(name)
    return list(panels.values())


def _offset(reference: Trajectory, other: Trajectory) -> float:
    if reference.start_ns and other.start_ns:
        return (other.start_ns - reference.start_ns) / 1e9
    return 0.0


def _speed_lines(motion: Motion, scale: float) -> LineCollection:
    """Return the ground track as lines between neighbours, none across a gap."""
    thin = max(1, len(motion.time) // 20_000)
    pieces, speeds = [], []
    for part in motion.segments:
        index = np.unique(np.append(np.arange(part.start, part.stop, thin), part.stop - 1))
        points = motion.position[index][:, [1, 0]] * scale
        pieces.append(np.stack([points[:-1], points[1:]], axis=1))
        speeds.append(motion.speed[index[:-1]])
    lines = LineCollection(
        list(np.concatenate(pieces)), cmap='viridis', linewidths=1.6, capstyle='round'
    )
    lines.set_array(np.concatenate(speeds))
    lines.set_clim(*speed_range(motion))
    return lines


def _histories(
    ax: Axes,
    trajectory: Trajectory,
    motion: Motion,
    time: Array,
    values: Array,
    name: str,
    unit: str,
) -> None:
    std_name = f'{name}_std'
    if name == 'altitude' and std_name not in trajectory:
        std_name = 'z_e_std'
    factor = unit_of(name)[1]
    for part in motion.segments:
        ax.plot(time[part], values[part], color=COLORS[0], lw=1.1)
        if std_name in trajectory:
            std = trajectory[std_name][part] * factor
            ax.fill_between(
                time[part], values[part] - std, values[part] + std, color=COLORS[0],
                alpha=0.25, lw=0,
            )  # fmt: skip
    ax.set_ylabel(f'{name} [{unit}]')
