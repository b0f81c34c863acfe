"""What happened during a flight, and the figures that sum it up."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Literal

import numpy as np

from ..errors import InputError
from ..trajectory import Trajectory
from .kinematics import Motion

Level = Literal['DEBUG', 'INFO', 'WARN', 'ERROR']
MAX_GAP_EVENTS = 200
TICK = 1e-6  # s after the last sample of a stretch, its lane ends


@dataclass(frozen=True)
class Event:
    """Something that happened at a time [s] of the flight.

    Raises
    ------
    InputError
        If the time is not finite.
    """

    time: float
    text: str
    level: Level = 'INFO'

    def __post_init__(self) -> None:
        if not np.isfinite(self.time):
            raise InputError(f'event {self.text!r} has time {self.time}')


@dataclass(frozen=True)
class Lane:
    """States that follow each other, such as phases: each holds until the next.

    Raises
    ------
    InputError
        If there are not as many times as states, or times do not increase.
    """

    name: str
    times: tuple[float, ...]
    states: tuple[str | None, ...]

    def __post_init__(self) -> None:
        if len(self.times) != len(self.states) or not (np.diff(self.times) > 0).all():
            raise InputError(f'lane {self.name!r}: needs one increasing time for each state')


def flight_lanes(motion: Motion) -> list[Lane]:
    """Return the lanes that can be read off any motion: its unbroken stretches, if several."""
    parts = motion.segments
    if not 1 < len(parts) <= MAX_GAP_EVENTS:
        return []
    changes: dict[float, str | None] = {}
    for number, part in enumerate(parts, start=1):
        changes[float(motion.time[part.start])] = f'segment {number}'
        changes[float(motion.time[part.stop - 1]) + TICK] = None
    ordered = sorted(changes)
    return [Lane('segment', tuple(ordered), tuple(changes[t] for t in ordered))]


def _figure(value: float, digits: int) -> str:
    """Return a number to some digits; what rounds to nothing is 0, never -0 or 1e-17."""
    if abs(value) >= 10**digits:
        return f'{value:.0f}'
    return f'{value:.{digits}g}' if abs(value) >= 5e-4 else '0'


def flight_events(
    motion: Motion, deviation: tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]] | None = None
) -> list[Event]:
    """Return the events that can be read off any motion: ends, extremes and gaps.

    Parameters
    ----------
    motion : Motion
    deviation : (times, distances) or None
        Distance from the plan [m] at times [s].
    """
    time = motion.time

    def height(i: int) -> str:
        return f'{_figure(motion.altitude[i], 4)} m'

    def pace(i: int) -> str:
        return f'{_figure(motion.speed[i], 3)} m/s'

    top, fast = int(np.argmax(motion.altitude)), int(np.argmax(motion.speed))
    events = [
        Event(float(time[0]), f'start at {height(0)}, {pace(0)}'),
        Event(float(time[top]), f'highest point, {height(top)}'),
        Event(float(time[fast]), f'greatest speed, {pace(fast)}'),
        Event(float(time[-1]), f'end at {height(-1)}, {pace(-1)}'),
    ]
    if deviation is not None and deviation[0].size:
        most = int(np.argmax(deviation[1]))
        events.append(
            Event(float(deviation[0][most]), f'farthest from the plan, {deviation[1][most]:.3g} m')
        )
    gaps = [
        (float(time[a.stop - 1]), float(time[b.start] - time[a.stop - 1]))
        for a, b in zip(motion.segments[:-1], motion.segments[1:], strict=True)
    ]
    gaps.sort(key=lambda gap: -abs(gap[1]))
    for start, length in gaps[:MAX_GAP_EVENTS]:
        text = f'no data for {length:.3g} s' if length > 0 else f'clock back by {-length:.3g} s'
        events.append(Event(start, text, 'WARN'))
    if len(gaps) > MAX_GAP_EVENTS:
        events.append(
            Event(float(time[0]), f'{len(gaps)} gaps, the longest {MAX_GAP_EVENTS} listed', 'WARN')
        )
    return sorted(events, key=lambda event: event.time)


def flight_figures(trajectory: Trajectory, motion: Motion) -> dict[str, str | float | int]:
    """Return the figures that describe a run, by names that carry their unit."""
    figures: dict[str, str | float | int] = {
        'vehicle': trajectory.vehicle,
        'problem': trajectory.problem,
        'model': trajectory.model,
        'samples': len(trajectory),
        'segments': len(motion.segments),
        'duration_s': trajectory.duration,
        'distance_m': float(motion.arc_length[-1]),
        'min_speed_m_s': float(motion.speed.min()),
        'max_speed_m_s': float(motion.speed.max()),
        'min_altitude_m': float(motion.altitude.min()),
        'max_altitude_m': float(motion.altitude.max()),
    }
    if trajectory.start_ns:
        figures['start_utc'] = datetime.fromtimestamp(
            trajectory.start_ns / 1e9 + float(trajectory.time[0]), UTC
        ).isoformat(timespec='milliseconds')
    return {name: value for name, value in figures.items() if value != ''}


def summary_markdown(
    title: str, figures: dict[str, str | float | int], notes: Sequence[str] = ()
) -> str:
    """Return figures and notes as a Markdown page."""
    rows = [
        f'| {name} | {f"{value:.6g}" if isinstance(value, float) else value} |'
        for name, value in figures.items()
    ]
    lines = [f'# {title}', '', '| | |', '|---|---|', *rows, '']
    return '\n'.join([*lines, *(f'- {note}' for note in notes)])


def flat(properties: Mapping[str, Any], prefix: str = '') -> dict[str, Any]:
    """Return nested properties as one level of names with values a recording can hold."""
    found: dict[str, Any] = {}
    for name, value in properties.items():
        key = f'{prefix}{name}'
        if isinstance(value, Mapping):
            found.update(flat(value, f'{key}_'))
        elif value is None:
            continue
        elif isinstance(value, bool | int | float | str):
            found[key] = value
        elif isinstance(value, np.generic):
            found[key] = value.item()
        else:
            found[key] = json.dumps(value, default=str)
    return found
