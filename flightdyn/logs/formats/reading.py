"""What every format reads: columns of one source, from them a track by the rules of MCAP logs."""

from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import LogError
from ..choosing import choose_samples
from ..mcap_columns import Columns
from ..measurements import Measured, fix_measurements, with_checked_velocity
from ..sources import Source
from ..timeline import Rows
from ..track import Datum, Track

MAX_TEXT_BYTES = 512 * 2**20
"""Largest text log that is read; an hour at 10 Hz takes 5 MB."""

MAX_LINE_BYTES = 64 * 1024

Measure = Callable[[Columns, Rows, list[str]], Measured]


@dataclass(frozen=True, kw_only=True)
class Reading:
    """One source of a log as it was read.

    Parameters
    ----------
    columns : Columns
        One row per message, line or point, also for those that cannot be read (`fault`).
    measure : callable
        What makes measurements of the columns.
    altitude_datum : str or None
        None where the measurements tell it.
    piece : int array (n,) or None
        Changes where the log itself begins a new segment.
    """

    columns: Columns
    measure: Measure = fix_measurements
    altitude_datum: Datum | None = None
    piece: NDArray[np.int64] | None = None
    warnings: list[str] = field(default_factory=list)


@dataclass(frozen=True, kw_only=True)
class OpenedLog:
    """A log whose sources are known.

    Parameters
    ----------
    format : str
        Its name, for people.
    track : callable
        Takes a source, start and end [s since its first usable sample] or None, and warnings to
        begin with; raises `NothingUsableError` if fewer than two samples can be used.
    library : str
        What wrote it, as far as it says so.
    """

    path: Path
    format: str
    sources: list[Source]
    track: 'TrackMaker'
    library: str = ''
    metadata: dict[str, str] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)


TrackMaker = Callable[[Source, float | None, float | None, list[str]], Track]


class FixTable:
    """Positions of a text log as they come, and the lines that hold none."""

    def __init__(self) -> None:
        self._time = array('q')
        self._numbers = {name: array('d') for name in ('lat', 'lon', 'altitude', 'h_std', 'v_std')}
        self._velocity, self._airspeed = array('d'), array('d')
        self._status = array('b')
        self._piece = array('q')
        self._fault = bytearray()
        self._reasons: list[str] = ['']
        self._first: dict[str, str] = {}

    def __len__(self) -> int:
        return len(self._fault)

    def add(
        self,
        time_ns: int,
        lat: float,
        lon: float,
        altitude: float,
        *,
        fix: bool = True,
        std: tuple[float, float] = (np.nan, np.nan),
        velocity: tuple[float, float, float] | None = None,
        airspeed: float = np.nan,
        piece: int = 0,
    ) -> None:
        """Take a position: Unix time [ns], degrees, metres; 1-sigma horizontal, vertical [m].

        `velocity` is over the ground: north, east, down [m/s]; `airspeed` is the true one [m/s].
        """
        self._time.append(time_ns)
        for name, value in zip(self._numbers, (lat, lon, altitude, *std), strict=True):
            self._numbers[name].append(value)
        self._velocity.extend(velocity or (np.nan,) * 3)
        self._airspeed.append(airspeed)
        self._status.append(0 if fix else -1)
        self._piece.append(piece)
        self._fault.append(0)

    def reject(self, why: str, where: str) -> None:
        """Count what cannot be read; `where` as in 'line 7'."""
        self.add(-1, np.nan, np.nan, np.nan)
        if why not in self._first:
            self._first[why] = where
            self._reasons.append(why)
        self._fault[-1] = self._reasons.index(why)

    def complaints(self) -> list[str]:
        """Return a sentence for each reason to reject."""
        return [
            f'{self._fault.count(code)} {why}, first: {self._first[why]}'
            for code, why in enumerate(self._reasons)
            if code
        ]

    def reading(self, altitude_datum: Datum, warnings: list[str]) -> Reading:
        """Return everything taken so far."""
        std = np.stack([np.array(self._numbers[name]) for name in ('h_std', 'h_std', 'v_std')], 1)
        columns = fix_columns(
            np.array(self._time, np.int64),
            *(np.array(self._numbers[name]) for name in ('lat', 'lon', 'altitude')),
            status=np.array(self._status, np.int8),
            std_enu=std,
            fault=np.frombuffer(bytes(self._fault), np.uint8),
            fault_names=tuple(self._reasons),
        )
        velocity = np.array(self._velocity).reshape(-1, 3)
        return Reading(
            columns=columns,
            measure=with_velocity(velocity, airspeed=np.array(self._airspeed)),
            altitude_datum=altitude_datum,
            piece=np.array(self._piece, np.int64),
            warnings=[*warnings, *self.complaints()],
        )


def fix_columns(
    time_ns: NDArray[np.int64],
    lat: NDArray[np.float64],
    lon: NDArray[np.float64],
    altitude: NDArray[np.float64],
    *,
    status: NDArray[np.int8],
    std_enu: NDArray[np.float64] | None = None,
    fault: NDArray[np.uint8] | None = None,
    fault_names: tuple[str, ...] = ('',),
) -> Columns:
    """Return positions as the columns of a NavSatFix, so that they are judged alike.

    Parameters
    ----------
    time_ns : int array (n,)
        Unix time [ns]; below zero where there is none.
    status : int array (n,)
        -1 where there is no fix.
    std_enu : array (n, 3), optional
        1-sigma east, north, up [m].
    """
    n = time_ns.size
    covariance = np.zeros((n, 9))
    if std_enu is not None:
        covariance[:, ::4] = np.nan_to_num(std_enu) ** 2
    values = {
        'header.stamp.sec': np.where(time_ns < 0, -1, time_ns // 10**9),
        'header.stamp.nanosec': np.where(time_ns < 0, 0, time_ns % 10**9),
        'status.status': status,
        'latitude': lat,
        'longitude': lon,
        'altitude': altitude,
        'position_covariance': covariance,
        'position_covariance_type': np.where((covariance[:, ::4] > 0).all(axis=1), 2, 0),
    }
    fault = np.zeros(n, np.uint8) if fault is None else fault
    return Columns(time_ns, time_ns, values, fault, fault_names)


def with_velocity(
    velocity_ned: NDArray[np.float64],
    std: NDArray[np.float64] | None = None,
    airspeed: NDArray[np.float64] | None = None,
) -> Measure:
    """Return how to read fixes that come with a velocity (n, 3) [m/s] and its 1-sigma.

    `airspeed` is the true one (n,) [m/s], NaN where there is none.
    """

    def measure(columns: Columns, rows: Rows, warnings: list[str]) -> Measured:
        measured = fix_measurements(columns, rows, warnings)
        if airspeed is not None and np.isfinite(airspeed).any():
            measured = replace(measured, airspeed=airspeed)
        whole: NDArray[np.bool_] = np.asarray(np.isfinite(velocity_ned).all(axis=1))
        if not whole.any():
            return measured
        velocity = np.where(whole[:, None], velocity_ned, np.nan)
        return replace(measured, velocity_ned=velocity, velocity_std=std)

    return measure


def tracks_of(path: Path, read: Callable[[Source], Reading], warnings: list[str]) -> TrackMaker:
    """Return how to make tracks of a log of which each source can be read."""

    def track(source: Source, start: float | None, end: float | None, notes: list[str]) -> Track:
        reading = read(source)
        notes = [*warnings, *notes, *reading.warnings]
        return make_track(path, source, reading, start, end, notes)

    return track


def make_track(
    path: Path,
    source: Source,
    reading: Reading,
    start: float | None,
    end: float | None,
    warnings: list[str],
) -> Track:
    """Return what a source measured from `start` to `end`, seconds since its first usable sample.

    Raises
    ------
    LogError
        If fewer than two usable samples are in the range asked for.
    NothingUsableError
        If fewer than two are in the log.
    """
    columns = reading.columns
    rows = Rows(np.zeros(len(columns), np.uint8))
    for code, why in enumerate(columns.fault_names):
        if code:
            rows.drop(columns.fault == code, why)
    measured = reading.measure(columns, rows, warnings)
    time = measured.stamp
    rows.drop(time < 0, 'no time stamp')
    index, segment, chosen = choose_samples(
        path, source, time, rows, [reading.piece, measured.epoch], (start, end), warnings
    )
    track = Track(
        time_ns=time[index],
        segment=segment,
        origin=measured.origin,
        altitude_datum=reading.altitude_datum or measured.datum,
        file=str(path),
        source=source.topic,
        schema=source.schema,
        messages=int(chosen.sum()),
        dropped=rows.counts(chosen),
        warnings=warnings,
        **{name: column[index] for name, column in measured.columns().items()},
    )
    return with_checked_velocity(track)


def text_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the lines of a text log with their numbers, from 1, without line ends.

    Raises
    ------
    LogError
        If the file or a line is too large.
    """
    check_size(path)
    with path.open('rb') as stream:
        number = 0
        while line := stream.readline(MAX_LINE_BYTES + 1):
            number += 1
            if len(line) > MAX_LINE_BYTES:
                raise LogError(f'{path}: line {number} is longer than {MAX_LINE_BYTES} bytes')
            if number == 1:
                line = line.removeprefix(b'\xef\xbb\xbf')
            yield number, line.decode('utf-8', 'replace').rstrip('\r\n')


def check_size(path: Path) -> None:
    """Raise LogError if a text log is larger than is read."""
    size = path.stat().st_size
    if size > MAX_TEXT_BYTES:
        raise LogError(
            f'{path}: {size} bytes; text logs are read up to {MAX_TEXT_BYTES >> 20} MiB'
        )
