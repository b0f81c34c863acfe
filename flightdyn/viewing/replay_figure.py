"""A flight out of a log: where it went, and what it did, with what is known of the errors."""

from datetime import UTC, datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..environment.geodesy import GeodeticPoint, ned_from_geodetic
from ..errors import MissingExtraError
from ..logs.track import Track
from ..trajectory import Trajectory
from .kinematics import Motion, motion_of
from .panels import with_usual
from .plotting import (
    ALARM,
    MUTED,
    NOTHING,
    About,
    draw_columns,
    draw_track,
    label_time,
    legend_above,
    new_figure,
    put_heading,
    style,
    time_unit,
)

try:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
except ImportError as error:
    raise MissingExtraError('a figure', 'view') from error

Array = NDArray[np.float64]

PANELS = (
    ('altitude',), ('speed', 'airspeed'), ('gamma',), ('track',), ('bank',), ('load_factor',),
)  # fmt: skip
TAIL = 0.002
"""So large a share of samples at either end of a range may lie outside the axes, if that makes
the rest three times as large; it is said how many do."""
FIRST_YEAR = 1980
SAME_NS = 1000  # a sample's time comes back from seconds to so many nanoseconds
_MARKS: dict[str, Any] = {'ls': '', 'marker': 'x', 'color': ALARM, 'zorder': 5}
_MANY = 100  # marks, which then are small


def replay_figure(
    trajectory: Trajectory, about: About = NOTHING, *, track: Track | None = None
) -> Figure:
    """Return the ground track coloured by speed, beside the histories with their 1-sigma bands.

    Parameters
    ----------
    trajectory : Trajectory
        Nothing is drawn across its gaps.
    about : About
        Its document tells of source, datum, samples dropped, and flights.
    track : Track or None
        What the log measured: positions that were left out are marked.
    """
    motion = motion_of(trajectory)
    trajectory = with_usual(trajectory, motion)
    _, per_second = time_unit(trajectory)
    panels = [[name for name in names if name in trajectory] for names in PANELS]
    panels = [names for names in panels if names]
    lost = _left_out(trajectory, track)
    with style():
        figure = new_figure((10.0, max(5.0, 1.0 + 1.05 * len(panels))))
        whole = figure.add_gridspec(1, 2, width_ratios=(1.15, 1))
        left, right = whole[0], whole[1]
        ground = figure.add_subplot(left)
        scale = draw_track(figure, ground, motion, motion.speed, 'speed [m/s]')
        axes = list(right.subgridspec(len(panels), 1).subplots(sharex=True, squeeze=False)[:, 0])
        for ax, names in zip(axes, panels, strict=True):
            draw_columns(ax, trajectory, names, per_second, about)
            if names[0] != 'track':
                _fit(ax, trajectory, names)
        datum = about.document.get('altitude_datum')
        if datum:
            axes[0].set_ylabel(f'{axes[0].get_ylabel()}, {datum}')
        _mark_flights(axes, about, per_second)
        if lost is not None:
            _mark_lost(ground, axes[0], motion, lost, scale, per_second)
        legend_above(ground)
        label_time(axes, trajectory)
        put_heading(figure, trajectory, about, _when(trajectory), _wind(about))
    return figure


def _when(trajectory: Trajectory) -> str:
    if not trajectory.start_ns:
        return ''
    start = datetime.fromtimestamp(float(trajectory.unix_ns[0]) / 1e9, UTC)
    # clocks that count from a vehicle's start say 1970: no position was recorded before GPS
    return f'from {start:%Y-%m-%d %H:%M:%S} UTC' if start.year >= FIRST_YEAR else ''


def _wind(about: About) -> str:
    wind = about.document.get('wind')
    if not wind:
        return ''
    return (
        f'wind {wind["speed"]:.3g} m/s from {wind["from_deg"]:.0f} deg, '
        f'1-sigma {wind["std"]:.2g} m/s'
    )


def _fit(ax: Axes, trajectory: Trajectory, names: list[str]) -> None:
    """Let the axes hold the values, but of wide bands and lone peaks only a part."""
    lines = np.concatenate([np.asarray(line.get_ydata(), float) for line in ax.lines])
    low, high = float(lines.min()), float(lines.max())
    inner = np.quantile(lines, (TAIL, 1 - TAIL))
    if 3 * np.ptp(inner) < high - low and np.ptp(inner) > 0:
        low, high = (float(v) for v in inner)
        beyond = int(((lines < low) | (lines > high)).sum())
        ax.text(
            1, 1.0, f'{beyond} samples beyond', ha='right', va='bottom', fontsize=7, color=MUTED,
            transform=ax.transAxes,
        )  # fmt: skip
    room = 0.08 * (high - low) or 0.1 * max(abs(high), 1e-3)
    ax.set_ylim(low - room, high + room)


def _mark_flights(axes: list[Axes], about: About, per_second: float) -> None:
    """Draw a dotted line where a flight takes off or lands."""
    for flight in about.document.get('flights') or ():
        for known, name in (('takeoff', 'start'), ('landing', 'end')):
            if flight[known]:
                for ax in axes:
                    ax.axvline(flight[name] * per_second, color=MUTED, ls=':', lw=0.9)


def _left_out(trajectory: Trajectory, track: Track | None) -> tuple[Array, Array] | None:
    """Return time [s] and north, east, altitude [m] (n, 3) of samples that were not used."""
    if track is None:
        return None
    used, at = np.unique(trajectory.unix_ns), track.time_ns
    after = np.clip(np.searchsorted(used, at), 0, used.size - 1)
    near = np.minimum(abs(used[after] - at), abs(used[np.maximum(after - 1, 0)] - at))
    lost = np.flatnonzero(near > SAME_NS)
    if not lost.size:
        return None
    time = (at[lost] - trajectory.start_ns) / 1e9
    if track.position_ned is not None:
        north, east, down = track.position_ned[lost].T
        return time, np.column_stack([north, east, -down])
    assert track.lat is not None and track.lon is not None
    origin = trajectory.origin or GeodeticPoint(float(track.lat[0]), float(track.lon[0]), 0.0)
    altitude = np.full(lost.size, np.nan) if track.altitude is None else track.altitude[lost]
    flat = np.where(np.isfinite(altitude), altitude, origin.altitude)
    north, east, _ = ned_from_geodetic(track.lat[lost], track.lon[lost], flat, origin)
    return time, np.column_stack([north, east, altitude])


def _mark_lost(
    ground: Axes,
    heights: Axes,
    motion: Motion,
    lost: tuple[Array, Array],
    scale: float,
    per_second: float,
) -> None:
    """Mark samples that were left out, those far off at the edge."""
    time, places = lost
    low, high = (edge[:2] for edge in motion.bounds)
    room = 0.1 * max(float((high - low).max()), 1e-9)
    held = np.clip(places[:, :2], low - room, high + room)
    far = int((held != places[:, :2]).any(axis=1).sum())
    label = f'{time.size} left out' + (f', {far} of them farther off' if far else '')
    look = {**_MARKS, 'ms': 3 if time.size > _MANY else 5}
    ground.plot(held[:, 1] * scale, held[:, 0] * scale, label=label, **look)
    bottom, top = heights.get_ylim()
    factor = 1e-3 if 'km' in heights.get_ylabel() else 1.0
    heights.plot(time * per_second, np.clip(places[:, 2] * factor, bottom, top), **look)
