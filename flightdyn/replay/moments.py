"""Moments of a replay as people name them: seconds, a date and time, a take-off."""

import re
from datetime import UTC, datetime, timedelta

from ..errors import InputError
from ..trajectory import Trajectory
from .flights import find_flights

KINDS = (
    'seconds of the log (90), from now (+10, -10), a UTC time (2024-06-01T12:30:00Z), start, end, '
    'takeoff, landing, flight or segment with a number (takeoff 2), and seconds from there '
    '(takeoff+90)'
)
"""What can be said, for messages to users."""

EVENTS = ('takeoff', 'landing', 'flight')
"""Moments that are known only when the whole log is."""

_NUMBER = re.compile(r'[+-]?\d+(\.\d*)?')
_NAMED = re.compile(
    r'(?P<name>start|end|takeoff|landing|flight|segment)'
    r'(\s*(?P<number>\d+))?(\s*(?P<offset>[+-]\s*\d+(\.\d*)?))?'
)
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_MICROSECOND = timedelta(microseconds=1)


def names_event(text: str) -> bool:
    """Return whether a moment depends on when flights begin and end."""
    return text.strip().lower().startswith(EVENTS)


def moment(text: str, flown: Trajectory, *, now: float, end: float) -> float:
    """Return a moment in seconds of the trajectory's time.

    Parameters
    ----------
    text : str
        See `KINDS`. Times of day without an offset from UTC are UTC.
    flown : Trajectory
        A replay.
    now : float
        What `+10` counts from [s].
    end : float
        The last time there is [s].

    Raises
    ------
    InputError
        If it is not understood, outside the log, or there is no such flight or segment.
    """
    said = text.strip().lower()
    start = float(flown.time[0])
    if _NUMBER.fullmatch(said):
        seconds = float(said) + (now if said[0] in '+-' else 0.0)
    elif named := _NAMED.fullmatch(said):
        seconds = _named(named, flown, end)
    else:
        seconds = (_unix_ns(text) - flown.start_ns) / 1e9
    if not start <= seconds <= end:
        span = f'{start:.3f} s to {end:.3f} s'
        if flown.start_ns:
            span += f', {_utc(flown.start_ns, start)} to {_utc(flown.start_ns, end)}'
        raise InputError(f"'{text}' is {seconds:.3f} s, outside the log, which is {span}")
    return seconds


def _named(named: 're.Match[str]', flown: Trajectory, end: float) -> float:
    name, given = named['name'], named['number']
    number = int(given or 1)
    if name in ('start', 'end'):
        if given is not None:
            raise InputError(f'{name} {given}: there is one {name} only')
        seconds = end if name == 'end' else float(flown.time[0])
    elif name == 'segment':
        starts = [float(flown.time[piece.start]) for piece in flown.segments()]
        if not 1 <= number <= len(starts):
            raise InputError(f'there is no segment {number}, but {len(starts)} of them')
        seconds = starts[number - 1]
    else:
        flights = find_flights(flown)
        # A flight is known even where the log begins, or ends, in the air.
        times = {
            'takeoff': [f.start for f in flights if f.takeoff],
            'landing': [f.end for f in flights if f.landing],
            'flight': [f.start for f in flights],
        }[name]
        if not 1 <= number <= len(times):
            found = ', '.join(f'{t:.0f} s' for t in times) or 'none'
            raise InputError(f'there is no {name} {number}; found: {found}')
        seconds = times[number - 1]
    return seconds + float((named['offset'] or '0').replace(' ', ''))


def _unix_ns(text: str) -> int:
    try:
        told = datetime.fromisoformat(text.strip())
    except ValueError:
        raise InputError(f"'{text}' is no moment of a log; say {KINDS}") from None
    if told.tzinfo is None:
        told = told.replace(tzinfo=UTC)
    return (told - _EPOCH) // _MICROSECOND * 1000


def _utc(start_ns: int, seconds: float) -> str:
    told = _EPOCH + timedelta(microseconds=(start_ns + round(seconds * 1e9)) // 1000)
    return told.isoformat(timespec='milliseconds').replace('+00:00', 'Z')
