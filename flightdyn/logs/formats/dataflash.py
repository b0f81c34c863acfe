"""ArduPilot's on-board logs (.bin): receivers (GPS) and the estimator's position (POS).

A log describes itself: FMT messages say how long the others are and what is in them.

References
----------
.. [1] ArduPilot, *libraries/AP_Logger/README.md* and *LogStructure.h*
"""

import mmap
from array import array
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import LogError
from ..sources import Source
from .reading import OpenedLog, Reading, fix_columns, tracks_of, with_velocity

NAME = 'ArduPilot log'

_HEAD = b'\xa3\x95'
_FMT, _FMT_SIZE = 0x80, 89
_CODES: dict[str, Any] = {
    code: kind
    for codes, kind in (
        *(('a', ('<i2', 32)), ('b', 'i1'), ('BM', 'u1'), ('hc', '<i2'), ('HC', '<u2')),
        *(('ieL', '<i4'), ('IE', '<u4'), ('q', '<i8'), ('Q', '<u8')),
        *(('f', '<f4'), ('d', '<f8'), ('g', '<f2'), ('n', 'S4'), ('N', 'S16'), ('Z', 'S64')),
    )
    for code in codes
}
_SCALES = {'c': 1e-2, 'C': 1e-2, 'e': 1e-2, 'E': 1e-2, 'L': 1e-7}
_WANTED = {'GPS': 'gnss', 'GPS2': 'gnss', 'POS': 'global'}
_PLACE = {'Lat', 'Lng', 'Alt'}
_FIX_3D = 3
_GPS_EPOCH_S = 315_964_800  # 1980-01-06
_WEEK_S = 604_800
# GPS time less UTC [s] from that Unix time on: IERS, Bulletin C.
_LEAP = (
    *((0, 14), (1_230_768_000, 15), (1_341_100_800, 16)),
    *((1_435_708_800, 17), (1_483_228_800, 18)),
)


@dataclass
class _Format:
    """A kind of message; `at` are the bytes where its messages begin."""

    name: str
    size: int
    layout: np.dtype[np.void] | None
    scales: dict[str, float]
    at: 'array[int]' = field(default_factory=lambda: array('q'))


def recognises(head: bytes, path: Path) -> bool:
    """Return whether a file begins as an on-board log does."""
    return head.startswith(_HEAD)


def open_log(path: Path) -> OpenedLog:
    """Read the positions of an on-board log.

    Raises
    ------
    LogError
        If there are none.
    """
    with path.open('rb') as stream:
        data = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
    with data:
        formats, warnings = _walk(data)
        tables = {one.name: _table(data, one) for one in formats if one.name in _WANTED}
    by_topic: dict[str, dict[str, NDArray[Any]]] = {}
    for name, table in tables.items():
        if not _PLACE.issubset(table) or not {'TimeUS', 'TimeMS'}.intersection(table):
            continue
        for number in np.unique(table['I']).tolist() if 'I' in table else [None]:
            rows = slice(None) if number is None else table['I'] == number
            topic = name if number is None else f'{name}/{number}'
            by_topic[topic] = {key: column[rows] for key, column in table.items()}
    sources = [
        Source(topic, f'dataflash.{name}', 'dataflash', _WANTED[name], table['Lat'].size, True)
        for topic, table in by_topic.items()
        for name in [topic.partition('/')[0]]
        if table['Lat'].size
    ]
    if not sources:
        found = ', '.join(sorted(one.name for one in formats)[:20]) or 'none'
        raise LogError(f'{path}: no GPS or POS in this ArduPilot log; messages: {found}')
    offset_ns = _unix_offset_ns(by_topic)
    if offset_ns is None:
        warnings.append("times count from the autopilot's start: the log does not say the date")
    return OpenedLog(
        path=path,
        format=NAME,
        sources=sources,
        track=tracks_of(
            path, lambda source: _reading(by_topic[source.topic], offset_ns or 0), warnings
        ),
        warnings=warnings,
    )


def _walk(data: mmap.mmap) -> tuple[list[_Format], list[str]]:
    """Return the formats that are used, with where their messages are, and what is wrong."""
    formats: dict[int, _Format] = {_FMT: _Format('FMT', _FMT_SIZE, None, {})}
    at, size = 0, len(data)
    skipped = 0
    first = -1
    while at + 3 <= size:
        one = formats.get(data[at + 2]) if data[at : at + 2] == _HEAD else None
        if one is None:
            following = data.find(_HEAD, at + 1)
            following = size if following < 0 else following
            first = at if first < 0 else first
            skipped += following - at
            at = following
            continue
        if at + one.size > size:
            break
        if data[at + 2] == _FMT:
            made = _format(data[at + 3 : at + _FMT_SIZE])
            known = formats.get(data[at + 3])
            if made is not None and data[at + 3] != _FMT and (known is None or not known.at):
                formats[data[at + 3]] = made
        else:
            one.at.append(at)
        at += one.size
    warnings = []
    if skipped:
        warnings.append(f'{skipped} bytes that are no message, first at byte {first}')
    if at < size:
        warnings.append(f'the file is cut short in a message at byte {at}')
    return [one for one in formats.values() if one.at], warnings


def _format(body: bytes) -> _Format | None:
    """Return what a FMT message describes, None if it makes no sense."""
    size = body[1]
    name, codes, labels = (
        body[begin:end].split(b'\0', 1)[0].decode('ascii', 'replace')
        for begin, end in ((2, 6), (6, 22), (22, 86))
    )
    if size < 3:
        return None
    names = labels.split(',') if labels else []
    layout = None
    if len(names) == len(codes) == len(set(names)) and set(codes) <= set(_CODES) and names:
        layout = np.dtype([(n, _CODES[c]) for n, c in zip(names, codes, strict=True)])
        if layout.itemsize != size - 3:
            layout = None
    scales = {n: _SCALES[c] for n, c in zip(names, codes, strict=False) if c in _SCALES}
    return _Format(name, size, layout, scales)


def _table(data: mmap.mmap, one: _Format) -> dict[str, NDArray[Any]]:
    """Return the columns of a kind of message, scaled."""
    if one.layout is None:
        return {}
    width = one.layout.itemsize
    packed = b''.join(data[at + 3 : at + 3 + width] for at in one.at)
    rows = np.frombuffer(packed, one.layout)
    return {
        name: rows[name] * one.scales[name] if name in one.scales else rows[name]
        for name in one.layout.names or ()
    }


def _reading(table: dict[str, NDArray[Any]], offset_ns: int) -> Reading:
    boot = _boot_ns(table)
    n = boot.size
    status = np.where(table['Status'] < _FIX_3D, -1, 0) if 'Status' in table else np.zeros(n)
    velocity = np.full((n, 3), np.nan)
    if {'Spd', 'GCrs', 'VZ'} <= set(table):
        course = np.radians(table['GCrs'].astype(float))
        along = table['Spd'].astype(float)
        velocity = np.stack(
            (along * np.cos(course), along * np.sin(course), table['VZ'].astype(float)), axis=1
        )
    columns = fix_columns(
        boot + offset_ns,
        *(table[name].astype(float) for name in ('Lat', 'Lng', 'Alt')),
        status=status.astype(np.int8),
    )
    return Reading(columns=columns, measure=with_velocity(velocity), altitude_datum='msl')


def _boot_ns(table: dict[str, NDArray[Any]]) -> NDArray[np.int64]:
    if 'TimeUS' in table:
        return np.asarray(table['TimeUS'].astype(np.int64) * 1000)
    return np.asarray(table['TimeMS'].astype(np.int64) * 10**6)


def _unix_offset_ns(tables: dict[str, dict[str, NDArray[Any]]]) -> int | None:
    """Return Unix time less time since the autopilot's start, None if no receiver tells it."""
    for table in tables.values():
        if not {'GMS', 'GWk', 'Status'} <= set(table):
            continue
        told = (table['GWk'] > 0) & (table['Status'] >= _FIX_3D)
        if told.any():
            gps = _GPS_EPOCH_S + table['GWk'].astype(np.int64)[told] * _WEEK_S
            leap = next(s for since, s in reversed(_LEAP) if gps[0] >= since)
            unix = (gps - leap) * 10**9 + table['GMS'].astype(np.int64)[told] * 10**6
            offset = unix - _boot_ns(table)[told]
            return int(offset[0]) + int(np.median(offset - offset[0]))
    return None
