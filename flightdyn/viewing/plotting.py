"""What all figures share: colours, style, and columns over time on one axis."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from ..errors import MissingExtraError
from ..trajectory import Trajectory
from .quantities import unit_of

try:
    import matplotlib as mpl
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
except ImportError as error:
    raise MissingExtraError('a figure', 'view') from error

# Okabe and Ito's colours: told apart by the colour-blind, and in grey by their order.
COLORS = ('#0072b2', '#d55e00', '#009e73', '#cc79a7', '#e69f00', '#56b4e9', '#000000')
LINES = ('-', '--', ':', '-.')
"""Told apart in grey, too, as colours are not."""
LONG = 1200.0  # s: flights beyond are shown in minutes
_STYLE = {
    'font.size': 9.0,
    'axes.grid': True,
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


def title_of(trajectory: Trajectory) -> str:
    """Return what a figure is of, in words."""
    words = [trajectory.vehicle, trajectory.problem]
    return ', '.join(word for word in words if word) or trajectory.model or 'trajectory'


def time_unit(trajectory: Trajectory) -> tuple[str, float]:
    """Return the unit that a flight's time is shown in, and the factor from seconds."""
    return ('min', 1 / 60) if trajectory.duration > LONG else ('s', 1.0)


def draw_columns(
    ax: Axes, trajectory: Trajectory, names: Sequence[str], per_second: float = 1.0
) -> None:
    """Draw columns over time on one axis: held controls as steps, nothing across a gap."""
    unit = unit_of(names[0])[0]
    for number, name in enumerate(names):
        factor = unit_of(name)[1]
        values, time = trajectory[name] * factor, trajectory.time * per_second
        how: dict[str, Any] = {}
        if name in ('track', 'psi'):  # dots: a line would jump across the plot at 360 degrees
            values, how = np.mod(values, 360), {'ls': '', 'marker': '.', 'ms': 1.5}
        if name in trajectory.controls and trajectory.control_interpolation == 'previous':
            how['drawstyle'] = 'steps-post'
        color = COLORS[number % len(COLORS)]
        for i, part in enumerate(trajectory.segments()):
            label = name if i == 0 else None
            ax.plot(time[part], values[part], color=color, label=label, **how)
            if f'{name}_std' in trajectory:
                std = trajectory[f'{name}_std'][part] * factor
                low, high = values[part] - std, values[part] + std
                ax.fill_between(time[part], low, high, color=color, alpha=0.25, lw=0)
    ax.set_ylabel(f'{", ".join(names)} [{unit}]' if len(names) < 3 else f'[{unit}]')
    if len(names) > 1:
        ax.legend(ncols=min(len(names), 3), loc='best')
