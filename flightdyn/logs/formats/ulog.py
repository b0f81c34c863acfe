"""PX4's ULog, through pyulog: receivers and the estimator's positions.

Topics are named as ulog2mcap names them in an MCAP, and are read by the same rules.
"""

import contextlib
import io
import struct
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import LogError, MissingExtraError
from ..attitudes import with_attitude
from ..kinds import Kind, kind_of
from ..mcap_columns import Columns
from ..mcap_container import Schema
from ..poses import sound_attitude
from ..sources import Source
from ..track import Track
from .reading import OpenedLog, Reading, TrackMaker, tracks_of

NAME = 'PX4 ULog'

_MAGIC = b'ULog\x01\x12\x35'
_GPS = ('sensor_gps', 'vehicle_gps_position')
_TOPICS = (*_GPS, 'vehicle_global_position', 'vehicle_local_position')
_ATTITUDE = 'vehicle_attitude'
_INFO = ('sys_name', 'ver_hw', 'ver_sw', 'ver_sw_release')
_PLAUSIBLE_US = 946_684_800 * 10**6  # 2000-01-01
_FIX_3D = 3


def recognises(head: bytes, path: Path) -> bool:
    """Return whether a file begins as a ULog does."""
    return head.startswith(_MAGIC)


def open_log(path: Path) -> OpenedLog:
    """Read the position topics of a ULog.

    Raises
    ------
    MissingExtraError
        If pyulog is not installed.
    LogError
        If the file cannot be read or has no such topic.
    """
    log = _parse(path)
    warnings = []
    if log.file_corruption:
        warnings.append('the file is damaged; what could not be read was left out')
    if log.dropouts:
        lost = sum(dropout.duration for dropout in log.dropouts) / 1e3
        warnings.append(f'the recorder lost data {len(log.dropouts)} times, {lost:g} s in all')
    offset_us = _unix_offset_us(log.data_list)
    if offset_us:
        warnings.append("times count from the autopilot's start: the date is the receiver's")
    sources: list[Source] = []
    readings: dict[str, Callable[[], Reading]] = {}
    positions = [data for data in log.data_list if data.name != _ATTITUDE]
    for data in positions:
        schema = f'ulog.{data.name}'
        topic = f'{data.name}/{data.multi_id}' if data.multi_id else data.name
        if topic in readings:  # subscribed to anew in the middle
            topic = f'{topic}#{data.msg_id}'
        kind = kind_of(Schema(0, schema, 'protobuf', b''), 'protobuf')
        assert kind is not None
        messages = int(next(iter(data.data.values()), np.empty(0)).size)
        fields = _fields(kind, set(data.data)) if 'timestamp' in data.data else ()
        note = '' if fields else 'lacks fields of a position'
        usable = bool(fields) and messages > 0
        sources.append(Source(topic, schema, 'ulog', kind.name, messages, usable, note=note))
        readings[topic] = _reader(kind, fields, data.data, offset_us)
    if not sources:
        raise LogError(f'{path}: this ULog has none of {", ".join(_TOPICS)}')
    information = {key: str(log.msg_info_dict[key]) for key in _INFO if key in log.msg_info_dict}
    return OpenedLog(
        path=path,
        format=NAME,
        sources=sources,
        track=_with_attitudes(
            tracks_of(path, lambda source: readings[source.topic](), warnings),
            [data.data for data in log.data_list if data.name == _ATTITUDE],
            offset_us,
        ),
        library=information.get('sys_name', ''),
        metadata=information,
        warnings=warnings,
    )


def _parse(path: Path) -> Any:
    try:
        pyulog = import_module('pyulog')
    except ImportError:
        raise MissingExtraError('reading a ULog', 'ulog') from None
    try:
        # It prints its complaints, where only results may go.
        with path.open('rb') as stream, contextlib.redirect_stdout(io.StringIO()):
            return pyulog.ULog(stream, [*_TOPICS, _ATTITUDE])
    except (
        *(pyulog.core.ULogException, pyulog.core.ULogIncompatibleFlagException, struct.error),
        *(LookupError, TypeError, ValueError, AttributeError, OverflowError, RecursionError),
    ) as error:
        text = (str(error).splitlines() or [''])[0] or type(error).__name__
        raise LogError(f'{path}: the ULog cannot be read: {text[:200]}') from None


def _fields(kind: Kind, known: set[str]) -> tuple[str, ...]:
    layout = next((need for need in kind.layouts if known.issuperset(need)), ())
    return (*layout, *(name for name in kind.optional if name in known)) if layout else ()


def _reader(
    kind: Kind, fields: tuple[str, ...], data: dict[str, Any], offset_us: int
) -> Callable[[], Reading]:
    def read() -> Reading:
        values = {name: np.array(data[name]) for name in fields}
        time = (data['timestamp'].astype(np.int64) + offset_us) * 1000
        columns = Columns(time, time, values, np.zeros(time.size, np.uint8), ('',))
        return Reading(columns=columns, measure=kind.measure)

    return read


def _with_attitudes(make: TrackMaker, tables: list[dict[str, Any]], offset_us: int) -> TrackMaker:
    """Return how to make tracks that have the estimator's attitude."""
    names = ('timestamp', *(f'q[{i}]' for i in range(4)))
    told = [table for table in tables if all(name in table for name in names)]

    def track(source: Source, start: float | None, end: float | None, notes: list[str]) -> Track:
        made = make(source, start, end, notes)
        if not told:
            return made
        count, *parts = (told[0][name] for name in names)
        attitude = sound_attitude(np.stack(parts, axis=1).astype(float), in_ned=True)
        if attitude is None:
            return made
        time = (count.astype(np.int64) + offset_us) * 1000
        return with_attitude(made, time, attitude, _ATTITUDE)

    return track


def _unix_offset_us(topics: list[Any]) -> int:
    """Return Unix time less time since the autopilot's start, 0 if no receiver tells it."""
    for data in topics:
        columns = data.data
        if data.name in _GPS and {'timestamp', 'time_utc_usec', 'fix_type'} <= set(columns):
            utc = columns['time_utc_usec'].astype(np.int64)
            told = (utc > _PLAUSIBLE_US) & (columns['fix_type'] >= _FIX_3D)
            if told.any():
                return int(np.median(utc[told] - columns['timestamp'].astype(np.int64)[told]))
    return 0
