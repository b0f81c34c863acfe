"""foxglove.LocationFix and LocationFixes where they are no plain columns: message by message.

A LocationFix in CDR is decoded as other ROS messages are. LocationFixes are as many rows as there
are fixes in them, in their order; the fixes of the first frame are the track.

References
----------
.. [1] Foxglove schemas, LocationFix, https://docs.foxglove.dev/docs/sdk/schemas/location-fix
"""

import struct
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import datetime
from typing import Any

import numpy as np

from ..errors import LogError
from . import flatbuffer, json5, protobuf
from .decoders import decodable, decoded_columns, decoder_of
from .definitions import full_name
from .mcap_columns import Columns
from .mcap_container import McapFile, Schema
from .measurements import Measured, fix_measurements
from .timeline import Rows

ONE, MANY = 'LocationFix', 'LocationFixes'
NAMES = {
    f'{package}{name}' for package in ('foxglove.', 'foxglove_msgs/msg/') for name in (ONE, MANY)
}

_NOT_ONE = 'not a LocationFix'
_DAMAGE = (*protobuf.DAMAGE, AttributeError, IndexError)
_TYPES = {'UNKNOWN': 0, 'APPROXIMATED': 1, 'DIAGONAL_KNOWN': 2, 'KNOWN': 3}
_VELOCITY = ('velocity_x', 'velocity_y', 'velocity_z')
_NUMBERS = ('latitude', 'longitude', 'altitude', *_VELOCITY)
_ASKED = (
    *_NUMBERS,
    *('fixes', 'timestamp', 'sec', 'nsec', 'frame_id'),
    *('position_covariance', 'position_covariance_type'),
)

_Fix = Mapping[str, Any]
_Parser = Callable[[bytes], Sequence[_Fix]]


def readable(schema: Schema, encoding: str) -> bool:
    """Return whether messages of a schema and encoding are to be read here."""
    name = full_name(schema.name)
    if name not in NAMES:
        return False
    if encoding in ('protobuf', 'flatbuffer'):
        return schema.encoding == encoding
    return encoding == 'json' or (name.endswith(MANY) and decodable(schema, encoding))


def check(schema: Schema, encoding: str) -> None:
    """Raise LogError if a schema does not say how its messages are read."""
    if encoding in ('protobuf', 'flatbuffer'):
        _parser(schema, encoding)
    elif encoding != 'json':
        decoder_of(schema, encoding, ('fixes',))


def read_columns(log: McapFile, channel_ids: Sequence[int]) -> Columns:
    """Return the columns of the fixes, named as in the ROS 2 definition.

    Raises
    ------
    LogError
        If the schema does not say how to read them or the file is damaged.
    """
    channel = log.channels[channel_ids[0]]
    schema = log.schemas[channel.schema_id]
    table = _Table()
    if channel.message_encoding in ('json', 'protobuf', 'flatbuffer'):
        try:
            parse = _parser(schema, channel.message_encoding)
        except LogError as error:
            raise LogError(f'{log.path}: topic {channel.topic}: {error}') from None
        for time, message in _messages(log, channel_ids):
            try:
                table.add(time, parse(message))
            except _DAMAGE:
                table.reject(time)
        return table.columns(('', _NOT_ONE))
    columns = decoded_columns(log, channel_ids, ('fixes',))
    for time, fixes, fault in zip(
        columns.log_time.tolist(), columns['fixes'], columns.fault.tolist(), strict=True
    ):
        if fault:
            table.reject(time, fault)
        else:
            table.add(time, fixes)
    return table.columns(columns.fault_names)


def measurements(columns: Columns, rows: Rows, warnings: list[str]) -> Measured:
    """Read LocationFix and LocationFixes; of several frames the first."""
    frames = columns['frame_id']
    names = list(dict.fromkeys(frames[rows.used].tolist()))
    if len(names) > 1:
        others = ', '.join(repr(name) for name in names[1:4])
        warnings.append(
            f'the fixes are of {len(names)} frames: {names[0]!r} is used, not {others}'
        )
        rows.drop(frames != names[0], 'another frame')
    return fix_measurements(columns, rows, warnings)


class _Table:
    """The fixes so far, a row each."""

    def __init__(self) -> None:
        self._time = array('q')
        self._stamp = array('q')
        self._numbers = array('d')
        self._covariance = array('d')
        self._type = bytearray()
        self._fault = bytearray()
        self._frame: list[str] = []

    def add(self, time: int, fixes: Sequence[_Fix]) -> None:
        """Take the fixes of a message, all or none."""
        ready = [
            (
                (int(fix['timestamp.sec']), int(fix['timestamp.nanosec'])),
                [float(fix[name]) for name in ('latitude', 'longitude', 'altitude')]
                + [_number(fix.get(name)) for name in _VELOCITY],
                _covariance(fix['position_covariance']),
                int(fix['position_covariance_type']) & 0xFF,
                str(fix['frame_id']),
            )
            for fix in fixes
        ]
        for stamp, numbers, covariance, kind, frame in ready:
            self._time.append(time)
            self._stamp.extend(stamp if max(map(abs, stamp)) < 2**40 else (-1, 0))
            self._numbers.extend(numbers)
            self._covariance.extend(covariance)
            self._type.append(kind)
            self._fault.append(0)
            self._frame.append(frame)

    def reject(self, time: int, fault: int = 1) -> None:
        """Count a message that cannot be read."""
        self._time.append(time)
        self._stamp.extend((-1, 0))
        self._numbers.extend([np.nan] * len(_NUMBERS))
        self._covariance.extend([0.0] * 9)
        self._type.append(0)
        self._fault.append(fault)
        self._frame.append('')

    def columns(self, fault_names: tuple[str, ...]) -> Columns:
        """Return the columns of all of them."""
        time = np.array(self._time, np.int64)
        stamp = np.array(self._stamp, np.int64).reshape(-1, 2)
        numbers = np.array(self._numbers).reshape(-1, len(_NUMBERS))
        frames = np.empty(time.size, object)
        frames[:] = self._frame
        return Columns(
            time,
            time,
            {
                'timestamp.sec': stamp[:, 0],
                'timestamp.nanosec': stamp[:, 1],
                'frame_id': frames,
                **{name: numbers[:, i] for i, name in enumerate(_NUMBERS)},
                'position_covariance': np.array(self._covariance).reshape(-1, 9),
                'position_covariance_type': np.frombuffer(bytes(self._type), np.uint8),
            },
            np.frombuffer(bytes(self._fault), np.uint8),
            fault_names,
        )


def _messages(log: McapFile, channel_ids: Sequence[int]) -> Iterator[tuple[int, bytes]]:
    for batch in log.batches(channel_ids):
        raw = batch.data.data
        spans = zip(batch.log_time.tolist(), batch.start.tolist(), batch.end.tolist(), strict=True)
        for time, start, end in spans:
            yield time, bytes(raw[start:end])


def _parser(schema: Schema, encoding: str) -> _Parser:
    many = schema.name.endswith(MANY)
    if encoding == 'json':
        return lambda message: _unfolded(json5.loads(message), many)
    if encoding == 'flatbuffer':
        reader = flatbuffer.FlatbufferReader(schema)
        if not all(reader.has(('fixes.' if many else '') + name) for name in _NUMBERS[:2]):
            raise LogError(f'schema {schema.name} lacks a latitude and longitude')
        return lambda message: _unfolded(reader.read(message, _ASKED), many)
    types = protobuf.message_types(schema)
    numbers = {field.number: field.name for field in types.get(f'foxglove.{ONE}', ())}
    if not {'latitude', 'longitude'} <= set(numbers.values()):
        raise LogError(f'its protobuf schema lacks foxglove.{ONE}')
    if not many:
        return lambda message: [_from_protobuf(message, numbers)]
    outer = {field.name: field.number for field in types.get(f'foxglove.{MANY}', ())}
    if 'fixes' not in outer:
        raise LogError(f'its protobuf schema lacks foxglove.{MANY}')

    def parse(message: bytes) -> list[_Fix]:
        return [
            _from_protobuf(value, numbers)
            for number, value in protobuf.wire(message)
            if number == outer['fixes'] and isinstance(value, bytes)
        ]

    return parse


def _unfolded(document: Any, many: bool) -> list[_Fix]:
    return [_from_document(fix) for fix in (document['fixes'] if many else [document])]


def _from_document(said: Mapping[str, Any]) -> _Fix:
    stamp = said.get('timestamp') or {}
    if isinstance(stamp, str):
        stamp = _from_iso(stamp)
    kind = said.get('position_covariance_type') or 0
    return {
        **{name: said.get(name) for name in _VELOCITY},
        'timestamp.sec': stamp.get('sec', 0),
        'timestamp.nanosec': stamp.get('nsec', stamp.get('nanosec', 0)),
        'latitude': _number(said['latitude']),
        'longitude': _number(said['longitude']),
        'altitude': _number(said.get('altitude')),
        'frame_id': said.get('frame_id') or '',
        'position_covariance': said.get('position_covariance') or (),
        'position_covariance_type': _TYPES.get(kind, 0) if isinstance(kind, str) else kind,
    }


def _from_iso(text: str) -> dict[str, int]:
    """Return the parts of a time as protobuf writes it in JSON: 2024-05-01T10:00:00.25Z."""
    whole, _, fraction = text.removesuffix('Z').partition('.')
    seconds = int(datetime.fromisoformat(whole + '+00:00').timestamp())
    return {'sec': seconds, 'nsec': int(f'{fraction:0<9}'[:9])}


def _number(value: Any) -> float:
    return float('nan') if value is None else float(value)


def _covariance(values: Sequence[float]) -> Sequence[float]:
    if len(values) not in (0, 9):
        raise ValueError(f'a covariance of {len(values)} numbers')
    return values if len(values) else (0.0,) * 9


def _from_protobuf(message: bytes, numbers: dict[int, str]) -> _Fix:
    # Single numbers that are zero are not written: proto3. Velocities are optional.
    fix: dict[str, Any] = {'latitude': 0.0, 'longitude': 0.0, 'altitude': 0.0}
    fix |= {'frame_id': '', 'position_covariance_type': 0}
    stamp: dict[int, Any] = {}
    covariance: list[float] = []
    for number, value in protobuf.wire(message):
        name = numbers.get(number, '')
        if name == 'position_covariance' and isinstance(value, bytes):
            covariance.extend(struct.unpack(f'<{len(value) // 8}d', value))
        elif name in _NUMBERS and isinstance(value, bytes):
            (fix[name],) = struct.unpack('<d', value)
        elif name == 'timestamp' and isinstance(value, bytes):
            stamp = dict(protobuf.wire(value))
        elif name == 'frame_id' and isinstance(value, bytes):
            fix[name] = value.decode()
        elif name == 'position_covariance_type':
            fix[name] = value
    fix['timestamp.sec'], fix['timestamp.nanosec'] = stamp.get(1, 0), stamp.get(2, 0)
    fix['position_covariance'] = covariance
    return fix
