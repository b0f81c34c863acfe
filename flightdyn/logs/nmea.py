"""NMEA 0183 sentences in nmea_msgs/Sentence: GGA for position and altitude, RMC for the date.

Without any GGA, RMC tells the position, and there is no altitude.

References
----------
.. [1] NMEA 0183, sentences GGA and RMC
"""

from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from .mcap_columns import Columns
from .measurements import Measured, drop_no_positions, stamp_ns
from .timeline import Rows

SENTENCE_FIELDS = (('header.stamp.sec', 'header.stamp.nanosec', 'sentence'),)

_DAY_NS = 86400 * 10**9
_QUALITY_ESTIMATED = 6  # dead reckoning; 7 manual input and 8 simulator are no fixes either


def sentence_measurements(columns: Columns, rows: Rows, warnings: list[str]) -> Measured:
    """Read GGA sentences; their time of day gets its date from RMC, else from the recorder.

    Where there is no GGA at all RMC tells the position, and the altitude is unknown. RMC tells
    speed and course but no vertical speed: no velocity is taken from it.
    """
    sentences = [
        _parts(str(columns['sentence'][row]).strip()) if columns.fault[row] == 0 else None
        for row in range(len(columns))
    ]
    kinds = [parts[0][2:] if parts else '' for parts in sentences]
    wanted = 'GGA' if 'GGA' in kinds or 'RMC' not in kinds else 'RMC'
    lat, lon, altitude = (np.full(len(columns), np.nan) for _ in range(3))
    of_day = np.full(len(columns), -1, np.int64)
    dates = np.full(len(columns), -1, np.int64)
    no_fix, broken = (np.zeros(len(columns), bool) for _ in range(2))
    on_ellipsoid = np.zeros(len(columns), bool)
    for row, parts in enumerate(sentences):
        if parts is None:
            continue
        try:
            if kinds[row] == 'RMC' and parts[2] == 'A':
                of_day[row], dates[row] = _time_of_day(parts[1]), _date(parts[9])
            if kinds[row] != wanted:
                continue
            if wanted == 'RMC':
                no_fix[row] = parts[2] != 'A'
                place = parts[3:7]
            else:
                no_fix[row] = not 0 < int(parts[6] or 0) < _QUALITY_ESTIMATED
                place = parts[2:6]
            if no_fix[row]:
                continue
            lat[row] = _degrees(place[0], 2, place[1] == 'S')
            lon[row] = _degrees(place[2], 3, place[3] == 'W')
            if wanted == 'RMC':
                continue
            altitude[row] = float(parts[9] or 'nan')
            if parts[11]:
                altitude[row] += float(parts[11])
                on_ellipsoid[row] = True
            of_day[row] = _time_of_day(parts[1])
        except (ValueError, IndexError):
            broken[row] = True
    is_none = np.array([parts is None for parts in sentences], bool)
    rows.drop(is_none & (columns.fault == 0), 'no NMEA sentence or wrong checksum')
    rows.drop(~is_none & (np.array(kinds) != wanted), 'another NMEA sentence')
    rows.drop(broken, 'not an NMEA position')
    rows.drop(no_fix, 'no fix')
    if wanted == 'RMC':
        drop_no_positions(rows, lat, lon, np.zeros_like(altitude))
        warnings.append('positions are those of RMC, as there is no GGA: the altitude is unknown')
        stamp = _stamp(columns, of_day, dates)
        return Measured(stamp=stamp, lat=lat, lon=lon, altitude=altitude, datum='unknown')
    used = rows.used
    datum_known = bool(on_ellipsoid[used].mean() > 0.5) if used.size else True
    rows.drop(on_ellipsoid != datum_known, 'another altitude datum')
    drop_no_positions(rows, lat, lon, altitude)
    return Measured(
        stamp=_stamp(columns, of_day, dates),
        lat=lat,
        lon=lon,
        altitude=altitude,
        datum='ellipsoid' if datum_known else 'msl',
    )


def _parts(text: str) -> list[str] | None:
    """Return the fields of a sentence, None if it is none or its checksum is wrong."""
    if not text.startswith('$'):
        return None
    body, star, given = text[1:].partition('*')
    if star:
        total = 0
        for letter in body.encode():
            total ^= letter
        if given.strip().upper() != f'{total:02X}':
            return None
    return body.split(',')


def _degrees(text: str, digits: int, negative: bool) -> float:
    value = int(text[:digits]) + float(text[digits:]) / 60
    return -value if negative else value


def _time_of_day(text: str) -> int:
    seconds, _, fraction = text[4:].partition('.')
    whole = (int(text[:2]) * 60 + int(text[2:4])) * 60 + int(seconds)
    return whole * 10**9 + int(f'{fraction:0<9}'[:9])


def _date(text: str) -> int:
    """Return midnight of ddmmyy [ns]; receivers that are older than 1980 do not exist."""
    year = int(text[4:6])
    year += 1900 if year >= 80 else 2000
    day = datetime(year, int(text[2:4]), int(text[:2]), tzinfo=UTC)
    return int(day.timestamp()) * 10**9


def _stamp(
    columns: Columns, of_day: NDArray[np.int64], dates: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return UTC of the rows with a time of day, -1 for the others.

    Days are counted where the time of day falls back by more than half a day. The last RMC tells
    the date of the count; without any, the times of arrival do.
    """
    stamp = np.full(of_day.size, -1, np.int64)
    timed = np.flatnonzero(of_day >= 0)
    if timed.size == 0:
        return stamp
    time = of_day[timed]
    days = np.cumsum(np.diff(time, prepend=time[:1]) < -_DAY_NS // 2) * _DAY_NS
    told = np.flatnonzero(dates[timed] >= 0)
    if told.size:
        last = told[np.clip(np.searchsorted(told, np.arange(timed.size), 'right') - 1, 0, None)]
        first_day = (dates[timed] - days)[last]
    else:
        header = stamp_ns(columns, 'header.stamp')[timed]
        arrived = np.where(header > 0, header, columns.log_time[timed])
        first_day = np.round(np.median((arrived - days - time) / _DAY_NS)) * _DAY_NS
    stamp[timed] = np.asarray(first_day, np.int64) + days + time
    return stamp
