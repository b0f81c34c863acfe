"""Whole-flight plots, lanes of states, and the log of events."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import MissingExtraError
from .archetypes import Clock, line_color, send
from .events import Event, Lane
from .kinematics import Motion
from .quantities import Group, Series

try:
    import rerun as rr
except ImportError as error:
    raise MissingExtraError('a Rerun recording', 'view') from error

Array = NDArray[np.float64]


def log_lines(
    rec: rr.RecordingStream,
    group: Group,
    clock: Clock,
    motion: Motion,
    *,
    name: str = 'flown',
    planned: bool = False,
    first_color: int = 0,
) -> None:
    """Log a plot's lines: one entity for those alike, one for each with a 1-sigma band.

    Parameters
    ----------
    name : str
        Of the entity, below `plots/` and the group's key.
    planned : bool
        Draw thin and faint, without bands, and say so in the legend.
    """
    entity, suffix = f'plots/{group.key}/{name}', ' planned' if planned else ''
    plain = [(i, s) for i, s in enumerate(group.series) if s.std is None or planned]
    if plain:
        values = np.column_stack([s.values for _, s in plain])
        names = [f'{s.name}{suffix}' for _, s in plain]
        colors = [line_color(first_color + i, planned) for i, _ in plain]
        if group.key == 'track':  # dots: a line would jump across the plot at 360 degrees
            look: rr.AsComponents = rr.SeriesPoints(
                names=names, colors=colors,
                marker_sizes=[0.7] * len(plain), markers=['circle'] * len(plain),
            )  # fmt: skip
        else:
            steps = any(s.steps for _, s in plain)
            look = rr.SeriesLines(
                names=names,
                colors=colors,
                widths=[1.0 if planned else 1.5] * len(plain),
                interpolation_mode='StepAfter' if steps else None,
            )
        rec.log(entity, look, static=True)
        send(rec, entity, clock, lambda rows: rr.Scalars.columns(scalars=values[rows]))
        _log_breaks(rec, entity, clock, motion)
    for i, series in enumerate(group.series):
        if series.std is not None and not planned:
            band = f'{entity}_{series.name}'
            _log_band(rec, band, series, line_color(first_color + i), group.unit, clock)
            _log_breaks(rec, band, clock, motion)


def _log_band(
    rec: rr.RecordingStream,
    entity: str,
    series: Series,
    color: list[int],
    unit: str,
    clock: Clock,
) -> None:
    assert series.std is not None
    values, variance = series.values, series.std**2
    look = rr.Measurements.from_fields(
        names=[f'{series.name} +-1 sigma'], colors=[color], units=[unit], widths=[1.5]
    )
    rec.log(entity, look, static=True)
    send(
        rec,
        entity,
        clock,
        lambda rows: rr.Measurements.columns(values=values[rows], variances=variance[rows]),
    )


def _log_breaks(rec: rr.RecordingStream, entity: str, clock: Clock, motion: Motion) -> None:
    """Cut a plotted line after each stretch but the last: the viewer joins what is not cut."""
    if len(clock) != len(motion.time) or len(motion.segments) < 2:
        return
    last = np.array([part.stop - 1 for part in motion.segments[:-1]])
    ends = clock.take(last, later_ns=1)
    send(
        rec,
        entity,
        ends,
        lambda rows: rr.Clear.columns(is_recursive=[False] * (rows.stop - rows.start)),
    )


def log_events(rec: rr.RecordingStream, clock: Clock, events: Sequence[Event]) -> None:
    """Log events, which `clock` has the times of."""
    texts = [event.text for event in events]
    levels = [event.level for event in events]
    send(
        rec,
        'events',
        clock,
        lambda rows: rr.TextLog.columns(text=texts[rows], level=levels[rows]),
    )


def log_lane(rec: rr.RecordingStream, lane: Lane, clock: Clock) -> None:
    """Log a lane of states, one after another, which `clock` has the times of."""
    entity = f'lanes/{lane.name}'
    known = np.flatnonzero([state is not None for state in lane.states])
    states = [state for state in lane.states if state is not None]
    send(
        rec,
        entity,
        clock.take(known),
        lambda rows: rr.StateChange.columns(state=states[rows]),
    )
    unknown = np.setdiff1d(np.arange(len(clock)), known)
    send(
        rec,
        entity,
        clock.take(unknown),
        lambda rows: rr.Clear.columns(is_recursive=[False] * (rows.stop - rows.start)),
    )
