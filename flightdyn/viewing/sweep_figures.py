"""Figures of sweeps: what comes of many cases, over the parameters that were varied."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, MissingExtraError
from .plotting import look_of, new_figure, style
from .quantities import unit_of

try:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm, Normalize
    from matplotlib.figure import Figure
except ImportError as error:
    raise MissingExtraError('a figure', 'view') from error

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

VERIFIED = 'verified'
"""Column that tells, if a table has it, which cases are worth anything."""

MAX_LINES = 7  # as many as there are colours
MAX_PANELS = 12
MAX_TICKS = 8
MAX_WRITTEN = 64  # cells of a map with their value written in them
FAILED_COLOR = '#d55e00'
_MAP = 'viridis'
_POINTS: dict[str, Any] = {'cmap': _MAP, 's': 18, 'edgecolors': '#333333', 'linewidths': 0.3}
_CROSSES: dict[str, Any] = {'ls': '', 'marker': 'x', 'ms': 6, 'mew': 1.6, 'zorder': 5}
_REPORTED = {
    **dict.fromkeys(('final_time', 'duration', 'wall_s', 'build_s', 'time'), 's'),
    **dict.fromkeys(('iterations', 'nodes', 'samples'), ''),
}


@dataclass(frozen=True)
class _Axis:
    """A column as it is drawn: numbers, or the places of `names` if it holds words."""

    name: str
    values: Array
    names: tuple[str, ...]
    label: str
    log: bool


def sweep_figure(
    table: Mapping[str, ArrayLike],
    over: Sequence[str],
    value: str,
    *,
    units: Mapping[str, str] | None = None,
    labels: Mapping[str, str] | None = None,
    log: Sequence[str] = (),
    title: str = '',
) -> Figure:
    """Return a value of many cases over the parameters that were varied.

    Over one parameter, a line with a marker for each case; over one and another that holds a few
    words, a line for each; over two, a map; over three, a map for each value of the third; over
    more, the value over each parameter in turn. Cases that lie on no grid are points. Cases that
    failed are crosses or hatched, never left out.

    Parameters
    ----------
    table : mapping of name to array (n,)
        A row for each case. Numbers in the project's units (angles in radians, but alpha and beta
        in degrees), or words. A case failed if its value is not a finite number, or if the table
        has a column `verified` that says so.
    over : sequence of str
        The columns that were varied, those that matter most first.
    value : str
        The column to show.
    units : mapping of name to str, optional
        Units that columns are in. Known names, such as `speed` or `final.altitude`, need none.
    labels : mapping of name to str, optional
        What to call columns, instead of their names.
    log : sequence of str
        Columns on logarithmic axes, or colours.

    Raises
    ------
    InputError
        If a column is missing, empty or of another length, a parameter is not finite, one on a
        logarithmic axis is not positive, or there is no parameter.
    """
    columns = _columns(table, over, value)
    for name in set(log) & set(columns):
        if (columns[name] <= 0).any():
            raise InputError(f'sweep: {name} is not positive everywhere: it has no logarithm')
    units, labels = units or {}, labels or {}
    failed = ~np.isfinite(columns[value].astype(float))
    if VERIFIED in table:
        failed |= ~np.asarray(table[VERIFIED]).astype(bool)
    axes = [_axis(columns[name], name, units, labels, log) for name in over]
    shown = _axis(
        np.where(failed, np.nan, columns[value].astype(float)), value, units, labels, log
    )
    with style():
        if len(axes) == 1:
            figure = _lines(axes[0], None, shown, failed)
        elif _on_grid(axes) and len(axes) == 2:
            across, lines = sorted(axes, key=lambda axis: bool(axis.names))
            few = bool(lines.names) and np.unique(lines.values).size <= MAX_LINES
            figure = (
                _lines(across, lines, shown, failed)
                if few and not across.names
                else _maps(axes[0], axes[1], None, shown, failed)
            )
        elif _on_grid(axes) and len(axes) == 3 and np.unique(axes[2].values).size <= MAX_PANELS:
            figure = _maps(axes[0], axes[1], axes[2], shown, failed)
        elif len(axes) == 2:
            figure = _plane(axes[0], axes[1], shown, failed)
        else:
            figure = _scatters(axes, shown, failed)
        lost = int(failed.sum())
        tail = f'{failed.size} cases' + (f', {lost} failed' if lost else '')
        figure.suptitle(f'{title}: {tail}' if title else tail, fontsize=10)
    return figure


def _columns(
    table: Mapping[str, ArrayLike], over: Sequence[str], value: str
) -> dict[str, NDArray[Any]]:
    if not over:
        raise InputError('a sweep needs a parameter that was varied: `over` is empty')
    missing = [name for name in (*over, value) if name not in table]
    if missing:
        raise InputError(
            f'no sweep to draw: the table lacks {", ".join(missing)}; it has {", ".join(table)}'
        )
    columns = {name: np.asarray(table[name]) for name in (*over, value)}
    if VERIFIED in table:
        columns[VERIFIED] = np.asarray(table[VERIFIED])
    size = columns[value].size
    for name, column in columns.items():
        if column.shape != (size,) or size == 0:
            raise InputError(
                f'sweep: {name} has shape {column.shape}, expected one value for each of '
                f'{size or "one or more"} cases'
            )
    if columns[value].dtype.kind not in 'biuf':
        raise InputError(f'sweep: {value} holds no numbers but {columns[value].dtype}')
    for name in over:
        column = columns[name]
        if column.dtype.kind in 'fc' and not np.isfinite(column).all():
            index = int(np.argmin(np.isfinite(column)))
            raise InputError(f'sweep: {name} is {column[index]} in case {index}')
    return {name: column for name, column in columns.items() if name != VERIFIED or name in over}


def _axis(
    column: NDArray[Any],
    name: str,
    units: Mapping[str, str],
    labels: Mapping[str, str],
    log: Sequence[str],
) -> _Axis:
    words = labels.get(name, name)
    if column.dtype.kind not in 'iuf':
        # in the order in which they come, which is that of whoever set up the sweep
        names = list(dict.fromkeys(str(word) for word in column))
        at = np.array([names.index(str(word)) for word in column], float)
        return _Axis(name, at, tuple(names), words, log=False)
    unit, factor = units.get(name), 1.0
    if unit is None:
        last = name.rpartition('.')[2]
        unit = _REPORTED.get(last)
        if unit is None:
            unit, factor = unit_of(last)
    label = f'{words} [{unit}]' if unit not in ('', '-') else words
    return _Axis(name, column * factor, (), label, name in log)


def _on_grid(axes: Sequence[_Axis]) -> bool:
    """Return whether no case stands twice, and half of what all combinations make is there."""
    cases = np.column_stack([axis.values for axis in axes])
    distinct = np.unique(cases, axis=0).shape[0]
    whole = np.prod([np.unique(axis.values).size for axis in axes])
    return bool(distinct == cases.shape[0] and 2 * distinct >= whole)


def _lines(across: _Axis, lines: _Axis | None, shown: _Axis, failed: Mask) -> Figure:
    group = np.zeros(failed.size) if lines is None else lines.values
    beside = np.unique(group).size > 2  # the legend, which then is long
    figure = new_figure((7.5 if beside else 6.0, 4.0))
    ax = figure.subplots()
    for number, key in enumerate(np.unique(group)):
        rows = np.flatnonzero(group == key)
        rows = rows[np.argsort(across.values[rows], kind='stable')]
        look = look_of(number)
        if across.names or np.unique(across.values[rows]).size < rows.size:
            look['ls'] = ''  # nothing lies between names, nor between cases at one place
        label = _words(lines, key) if lines is not None else None
        # a line ends before a failed case and begins anew after it: nothing is known between
        ax.plot(across.values[rows], shown.values[rows], marker='o', ms=4, label=label, **look)
        _crosses(ax, across.values[rows][failed[rows]], look['color'])
    ax.set(xlabel=across.label, ylabel=shown.label)
    _dress(ax, across, shown)
    handles, names = ax.get_legend_handles_labels()
    if failed.any():
        handles.append(_crosses(ax, np.empty(0), '#333333'))
        names.append('failed')
    if handles:
        place = 'outside right upper' if beside else 'outside upper left'
        figure.legend(handles, names, ncols=1 if beside else 3, loc=place)
    return figure


def _maps(x: _Axis, y: _Axis, panels: _Axis | None, shown: _Axis, failed: Mask) -> Figure:
    group = np.zeros(failed.size) if panels is None else panels.values
    keys = np.unique(group)
    columns = min(keys.size, 4)
    rows = -(-keys.size // columns)
    size = (5.6, 4.2) if keys.size == 1 else (1.2 + 2.6 * columns, 0.9 + 2.3 * rows)
    figure = new_figure(size)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    norm = _norm(shown)
    for ax, key in zip(grid.ravel(), keys, strict=False):
        inside = group == key
        _map(ax, x, y, shown, failed, inside, norm, written=keys.size == 1)
        if panels is not None:
            ax.set_title(f'{panels.label.partition(" [")[0]} {_words(panels, key)}')
    for ax in grid.ravel()[keys.size :]:
        ax.set_visible(False)
    for ax in grid[-1]:
        ax.set_xlabel(x.label)
    for ax in grid[:, 0]:
        ax.set_ylabel(y.label)
    bar = ScalarMappable(norm=norm, cmap=_MAP)
    figure.colorbar(bar, ax=grid, label=shown.label)
    if failed.any():
        hatch = grid[0, 0].fill_between(
            [], [], facecolor='white', edgecolor='#888888', hatch='////', lw=0
        )
        figure.legend([hatch], ['failed'], loc='outside upper right')
    return figure


def _map(
    ax: Axes, x: _Axis, y: _Axis, shown: _Axis, failed: Mask, inside: Mask, norm: Normalize,
    *, written: bool,
) -> None:  # fmt: skip
    """Draw one map; a combination that is no case stays white."""
    xs, ys = np.unique(x.values), np.unique(y.values)
    values = np.full((ys.size, xs.size), np.nan)
    lost = np.zeros_like(values)
    column, row = np.searchsorted(xs, x.values[inside]), np.searchsorted(ys, y.values[inside])
    values[row, column] = shown.values[inside]
    lost[row, column] = failed[inside]
    edges = _edges(xs, x.log), _edges(ys, y.log)
    ax.grid(visible=False)
    ax.pcolormesh(*edges, np.ma.masked_invalid(values), norm=norm, cmap=_MAP, rasterized=True)
    ax.pcolor(
        *edges, np.ma.masked_equal(lost, 0.0), hatch='////', facecolor='none', edgecolor='#888888',
        lw=0,
    )  # fmt: skip
    known = np.isfinite(values)
    if written and values.size <= MAX_WRITTEN:
        for i, j in np.argwhere(known):
            # dark colours are those of low values
            color = 'white' if norm(values[i, j]) < 0.6 else 'black'
            text = f'{values[i, j]:.4g}'
            ax.text(xs[j], ys[i], text, ha='center', va='center', fontsize=7, color=color)
    elif min(values.shape) > 2 and known.all() and np.ptp(values) > 0:
        contours = ax.contour(xs, ys, values, 6, colors='white', linewidths=0.8)
        ax.clabel(contours, fontsize=7)
    _dress(ax, x, y)


def _plane(x: _Axis, y: _Axis, shown: _Axis, failed: Mask) -> Figure:
    figure = new_figure((5.6, 4.2))
    ax = figure.subplots()
    kept = ~failed
    points = ax.scatter(
        x.values[kept], y.values[kept], c=shown.values[kept], norm=_norm(shown),
        **_POINTS,
    )  # fmt: skip
    (crosses,) = ax.plot(x.values[failed], y.values[failed], color=FAILED_COLOR, **_CROSSES)
    ax.set(xlabel=x.label, ylabel=y.label)
    _dress(ax, x, y)
    figure.colorbar(points, ax=ax, label=shown.label)
    if failed.any():
        figure.legend([crosses], ['failed'], loc='outside upper right')
    return figure


def _scatters(axes: Sequence[_Axis], shown: _Axis, failed: Mask) -> Figure:
    columns = 2 if len(axes) == 4 else min(len(axes), 3)
    rows = -(-len(axes) // columns)
    figure = new_figure((1.0 + 2.7 * columns, 0.8 + 2.5 * rows))
    grid = figure.subplots(rows, columns, sharey=True, squeeze=False)
    for ax, axis in zip(grid.ravel(), axes, strict=False):
        norm = _norm(shown)
        ax.scatter(axis.values, shown.values, c=shown.values, norm=norm, **_POINTS)
        _crosses(ax, axis.values[failed], FAILED_COLOR)
        ax.set_xlabel(axis.label)
        _dress(ax, axis, shown)
    for ax in grid.ravel()[len(axes) :]:
        ax.set_visible(False)
    for ax in grid[:, 0]:
        ax.set_ylabel(shown.label)
    if failed.any():
        figure.legend(
            [_crosses(grid[0, 0], np.empty(0), FAILED_COLOR)], ['failed'],
            loc='outside upper right',
        )  # fmt: skip
    return figure


def _crosses(ax: Axes, x: Array, color: str) -> Any:
    """Mark failed cases where they are, at the foot of the axes: they have no value."""
    (marks,) = ax.plot(
        x, np.full(x.size, 0.02), color=color, transform=ax.get_xaxis_transform(), **_CROSSES
    )
    return marks


def _dress(ax: Axes, x: _Axis, y: _Axis) -> None:
    """Scale the axes, and name the ticks of those that hold words."""
    if x.log:
        ax.set_xscale('log')
        at = np.unique(x.values)
        if at.size <= MAX_TICKS:  # powers of ten are rare among a few
            ax.set_xticks(at, [f'{value:g}' for value in at])
            ax.set_xticks([], minor=True)
    if y.log:
        ax.set_yscale('log')
    if x.names:
        ax.set_xticks(range(len(x.names)), x.names, rotation=20, ha='right')
    if y.names:
        ax.set_yticks(range(len(y.names)), y.names)


def _words(axis: _Axis, key: float) -> str:
    return axis.names[int(key)] if axis.names else f'{key:g}'


def _norm(shown: _Axis) -> Normalize:
    known = shown.values[np.isfinite(shown.values)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    room = 0.0 if high > low else max(abs(low), 1.0) * 1e-3
    return (LogNorm if shown.log and known.size else Normalize)(low - room, high + room)


def _edges(centres: Array, log: bool) -> Array:
    """Return the edges of cells round sorted centres; those at the ends are symmetric."""
    if log:
        edges: Array = np.exp(_edges(np.log(centres), False))
        return edges
    if centres.size == 1:
        return np.array([centres[0] - 0.5, centres[0] + 0.5])
    middle = (centres[:-1] + centres[1:]) / 2
    return np.concatenate([[2 * centres[0] - middle[0]], middle, [2 * centres[-1] - middle[-1]]])
