"""What all figures share: colours, style, headings, paths, and columns over time on one axis."""

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import MissingExtraError
from ..trajectory import Trajectory
from .kinematics import Motion
from .quantities import unit_of

try:
    import matplotlib as mpl
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure
    from matplotlib.ticker import MultipleLocator
except ImportError as error:
    raise MissingExtraError('a figure', 'view') from error

Array = NDArray[np.float64]
Limits = Mapping[str, tuple[float, float]]

# Okabe and Ito's colours: told apart by the colour-blind, and in grey by their order.
COLORS = ('#0072b2', '#d55e00', '#009e73', '#cc79a7', '#e69f00', '#56b4e9', '#000000')
ALARM = '#d55e00'
MUTED = '#666666'
LINES = ('-', '--', ':', '-.')
"""Told apart in grey, too, as colours are not."""
COLOR_MAP = 'viridis'
LONG = 1200.0  # s: flights beyond are shown in minutes
MAX_DRAWN = 20_000  # samples of a path or history: more are not seen, and make vector files heavy
STEADY = 1e-3  # of its value: what varies by less is drawn as steady as it is
MANY = 2_000  # samples: a history of more is drawn in a fine line
_PREFIXES = {
    'kg': ((1e4, 1e-3, 't'),),
    **{
        unit: ((1e9, 1e-9, f'G{unit}'), (1e6, 1e-6, f'M{unit}'), (1e4, 1e-3, f'k{unit}'))
        for unit in ('N', 'W', 'J', 'Pa')
    },
    'm': ((1e4, 1e-3, 'km'),),
}
"""Units for values from so much on: the factor, and what they are then called."""
_STYLE = {
    'font.size': 9.0,
    'axes.grid': True,
    'axes.axisbelow': True,
    'grid.color': '#dddddd',
    'grid.linewidth': 0.6,
    'axes.edgecolor': '#888888',
    'axes.spines.top': False,
    'axes.spines.right': False,
    'axes.titlesize': 9.0,
    'legend.fontsize': 8.0,
    'legend.frameon': False,
    'lines.linewidth': 1.4,
    'axes.formatter.useoffset': False,
    'svg.hashsalt': 'flightdyn',  # the same figure makes the same file
}


def new_figure(size: tuple[float, float]) -> Figure:
    """Return an empty figure of a size [inches] that needs no screen."""
    figure = Figure(figsize=size, layout='constrained')
    FigureCanvasAgg(figure)
    return figure


@contextmanager
def style() -> Iterator[None]:
    """Draw figures in the project's style inside the block."""
    with mpl.rc_context(_STYLE):
        yield


def look_of(i: int) -> dict[str, Any]:
    """Return colour and kind of the i-th line of several, counted from 0."""
    return {'color': COLORS[i % len(COLORS)], 'ls': LINES[i % len(LINES)]}


@dataclass(frozen=True, kw_only=True)
class About:
    """What is known of a flight besides the flight itself.

    Parameters
    ----------
    document : mapping
        What the .json file of the plan, simulation or replay says.
    limits : mapping of column name to (lowest, highest)
        In the columns' own units; infinite where there is none. Drawn dashed.
    """

    document: Mapping[str, Any] = field(default_factory=dict)
    limits: Limits = field(default_factory=dict)

    @property
    def arcs(self) -> Sequence[Mapping[str, Any]]:
        """Where a plan's controls are at their limits, see `planning.report.PlanReport`."""
        return self.document.get('arcs') or ()


NOTHING = About()


def put_heading(figure: Figure, trajectory: Trajectory, about: About, *more: str) -> None:
    """Write above a figure what flew, what came of it and how it was verified.

    A plan that was not verified is headed in another colour.
    """
    document = about.document
    failed = document.get('verified') is False
    lines = [*_facts(trajectory, document), *(text for text in more if text)]
    width = int(13 * figure.get_size_inches()[0])
    below = textwrap.wrap('; '.join(lines), width)
    title = '\n'.join([_name_of(trajectory, document), *below])
    figure.suptitle(title, fontsize=9.5, color=ALARM if failed else '#000000')


def _name_of(trajectory: Trajectory, document: Mapping[str, Any]) -> str:
    if 'file' in document:
        log = PurePath(str(document['file'])).name
        return f'{log} ({trajectory.vehicle})' if trajectory.vehicle else log
    what = trajectory.problem or PurePath(str(document.get('scenario', ''))).stem
    if what and trajectory.vehicle:
        return f'{what} ({trajectory.vehicle})'
    return what or trajectory.vehicle or trajectory.model or 'trajectory'


def _facts(trajectory: Trajectory, document: Mapping[str, Any]) -> list[str]:
    if 'verified' in document:
        found = f'objective {document["objective"]:.6g}, ' if document['converged'] else ''
        warned = [f'warning: {text}' for text in document.get('warnings', ())[:1]]
        return [
            f'{found}{trajectory.duration:.4g} s: {document["message"]}',
            *_wind(document.get('wind_ned', ())),
            *warned,
        ]
    if 'dropped' in document:
        dropped = sum(document['dropped'].values())
        lost = f', {dropped} dropped' if dropped else ''
        return [
            f'{document["source"]}: {document["used"]} of {document["messages"]} samples{lost}'
        ]
    if 'deviation_from_plan' in document:
        apart = document['deviation_from_plan']
        name = max(apart, key=lambda each: apart[each], default='')
        flown = f'simulated, {len(trajectory)} samples over {_seconds(trajectory.duration)}'
        return [flown, f'{name} at most {apart[name]:.2g} off the plan'] if name else [flown]
    return []


def _wind(blows: Sequence[float]) -> list[str]:
    """Return in words a wind that is the same everywhere, if there is one."""
    if len(blows) != 3 or not any(blows):
        return []
    north, east, _ = blows
    origin = np.degrees(np.arctan2(-east, -north)) % 360
    return [f'wind {np.linalg.norm(blows):.3g} m/s from {origin:.0f} deg']


def _seconds(duration: float) -> str:
    return f'{duration / 60:.4g} min' if duration > LONG else f'{duration:.4g} s'


def time_unit(trajectory: Trajectory) -> tuple[str, float]:
    """Return the unit that a flight's time is shown in, and the factor from seconds."""
    return ('min', 1 / 60) if trajectory.duration > LONG else ('s', 1.0)


def prefixed(unit: str, greatest: float) -> tuple[str, float]:
    """Return the unit for values up to so much, such as km for 20 000 m, and the factor to it."""
    for least, factor, name in _PREFIXES.get(unit, ()):
        if greatest >= least:
            return name, factor
    return unit, 1.0


def drawn(part: slice, total: int) -> NDArray[np.intp]:
    """Return which samples of a stretch to draw: all, or evenly fewer of a long flight's."""
    step = max(1, total // MAX_DRAWN)
    return np.unique(np.append(np.arange(part.start, part.stop, step), part.stop - 1))


def draw_columns(
    ax: Axes,
    trajectory: Trajectory,
    names: Sequence[str],
    per_second: float = 1.0,
    about: About = NOTHING,
) -> None:
    """Draw columns over time on one axis.

    Held controls are steps, limits are dashed, nothing is drawn across a gap, and a column with a
    1-sigma beside it (`speed_std` for `speed`) has its band. More than one column make a legend
    above the axes.
    """
    unit, own = unit_of(names[0])
    greatest = max(float(np.abs(trajectory[name]).max()) for name in names)
    unit, factor = prefixed(unit, greatest * own)
    factor *= own
    time = trajectory.time * per_second
    for number, name in enumerate(names):
        values, how = trajectory[name] * factor, dict[str, Any]()
        if name in ('track', 'psi'):
            values = _compass(values)
        if name in trajectory.controls and trajectory.control_interpolation == 'previous':
            how['drawstyle'] = 'steps-post'
        if len(trajectory) > MANY:
            how['lw'] = 0.7
        if len(names) > 1:
            how['ls'] = LINES[number % len(LINES)]
        color = COLORS[number % len(COLORS)]
        for i, part in enumerate(trajectory.segments()):
            index = drawn(part, len(trajectory))
            label = name if i == 0 else None
            shown = values[index]
            if name in ('track', 'psi'):  # no line across the plot from 360 degrees to 0
                shown = np.where(np.abs(np.diff(shown, append=shown[-1])) > 180, np.nan, shown)
            ax.plot(time[index], shown, color=color, label=label, **how)
            std = _std_of(trajectory, name)
            if std is not None:
                low, high = values - std * factor, values + std * factor
                ax.fill_between(
                    time[index], low[index], high[index], color=color, alpha=0.25, lw=0
                )
        if name in about.limits:
            _dash(ax, values, np.array(about.limits[name]) * factor)
        if name in ('track', 'psi') and np.ptp(values) > 180:
            ax.yaxis.set_major_locator(MultipleLocator(90 if np.ptp(values) <= 270 else 180))
    level = float(np.mean(ax.get_ylim()))
    if np.ptp(ax.get_ylim()) < STEADY * abs(level):
        ax.set_ylim(level - 0.05 * abs(level), level + 0.05 * abs(level))
    mark_arcs(ax, about, names, per_second)
    # in two lines, as histories are low
    ax.set_ylabel(f'{", ".join(names)}\n[{unit}]' if len(names) < 3 else f'[{unit}]')
    if len(names) > 1:
        legend_above(ax)


def _compass(degrees: Array) -> Array:
    """Return angles about 0 without jumps if they span no more than a turn, else 0 to 360."""
    straight = np.unwrap(degrees, period=360)
    if np.ptp(straight) > 360:
        return np.mod(degrees, 360)
    turns: Array = straight - 360 * np.floor(np.median(straight) / 360 + 0.5)
    return turns


def _std_of(trajectory: Trajectory, name: str) -> Array | None:
    for std in (f'{name}_std', *(('z_e_std',) if name == 'altitude' else ())):
        if std in trajectory:
            return trajectory[std]
    return None


def _dash(ax: Axes, values: Array, limits: Array) -> None:
    """Draw those limits that the values come near to: far ones would flatten the rest."""
    low, high = float(values.min()), float(values.max())
    room = 0.7 * (high - low)
    for limit in limits:
        if np.isfinite(limit) and low - room <= limit <= high + room:
            ax.axhline(float(limit), color=MUTED, ls=(0, (5, 4)), lw=0.9, zorder=1)


def mark_arcs(ax: Axes, about: About, names: Sequence[str], per_second: float = 1.0) -> None:
    """Shade every other arc of a bang-bang plan behind its controls."""
    arcs = [arc for arc in about.arcs if set(names) & set(arc['limits'])]
    for arc in arcs[1::2]:
        ax.axvspan(
            arc['start'] * per_second, arc['end'] * per_second, color='#eeeeee', lw=0, zorder=0
        )


def legend_above(ax: Axes) -> None:
    """Put the legend over the axes, where no data are."""
    handles, _ = ax.get_legend_handles_labels()
    tight = len(handles) > 3
    ax.legend(
        loc='lower left', bbox_to_anchor=(0, 1), borderaxespad=0.1, ncols=min(len(handles), 4),
        fontsize=7 if tight else 8, handlelength=1.6 if tight else 2.2,
        columnspacing=0.8 if tight else 1.2,
    )  # fmt: skip


def color_path(
    ax: Axes, x: Array, y: Array, values: Array, segments: Sequence[slice]
) -> LineCollection:
    """Draw a path as lines between neighbours coloured by a value, none across a gap.

    The colours span all values but 1 in 200 beyond each end.
    """
    pieces, shades = [], []
    for part in segments:
        index = drawn(part, len(x))
        points = np.column_stack([x[index], y[index]])
        pieces.append(np.stack([points[:-1], points[1:]], axis=1))
        shades.append(values[index[:-1]])
    lines = LineCollection(
        list(np.concatenate(pieces)), cmap=COLOR_MAP, linewidths=2.0, capstyle='round', zorder=3
    )
    lines.set_array(np.concatenate(shades))
    low, high = (float(v) for v in np.quantile(values, (0.005, 0.995)))
    lines.set_clim(*((low, high) if high - low > 1e-9 else (low - 0.5, low + 0.5)))
    ax.add_collection(lines)
    ax.autoscale_view()
    return lines


def mark_ends(ax: Axes, x: Array, y: Array) -> None:
    """Mark start and end of a path."""
    ax.plot(x[0], y[0], 'o', color='black', ms=5, zorder=4, label='start')
    ax.plot(x[-1], y[-1], 's', color='black', mfc='white', ms=5, zorder=4, label='end')


def label_time(axes: Sequence[Axes], trajectory: Trajectory) -> None:
    """Give histories that stand one above the other one time axis, as long as the flight."""
    unit, per_second = time_unit(trajectory)
    start, end = float(trajectory.time.min()), float(trajectory.time.max())
    for ax in axes:
        ax.set_xlim(start * per_second, end * per_second if end > start else None)
        ax.tick_params(labelbottom=ax is axes[-1])
    axes[-1].set_xlabel(f'time [{unit}]')


def path_unit(extent: float) -> tuple[str, float]:
    """Return the unit for a path of so many metres, and the factor to it."""
    return ('km', 1e-3) if extent > 5e3 else ('m', 1.0)


def draw_track(figure: Figure, ax: Axes, motion: Motion, values: Array, label: str) -> float:
    """Draw a ground track coloured by a value; return the factor from metres to its unit."""
    unit, scale = path_unit(float(np.ptp(motion.position[:, :2], axis=0).max()))
    east, north = motion.position[:, 1] * scale, motion.position[:, 0] * scale
    lines = color_path(ax, east, north, values, motion.segments)
    mark_ends(ax, east, north)
    ax.set_aspect('equal', adjustable='datalim')
    ax.set(xlabel=f'y_e, east [{unit}]', ylabel=f'x_e, north [{unit}]')
    figure.colorbar(lines, ax=ax, label=label, shrink=0.9, pad=0.02, aspect=35)
    return scale
