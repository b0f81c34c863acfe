"""foxglove.LocationFix in JSON or protobuf, message by message.

References
----------
.. [1] Foxglove schemas, LocationFix, https://docs.foxglove.dev/docs/sdk/schemas/location-fix
"""

import json
import struct
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..errors import LogError
from .mcap_columns import Columns
from .mcap_container import McapFile, Schema
from .protobuf import DAMAGE, message_types, wire

_FAULTS = ('', 'not a LocationFix')
_NAME = 'foxglove.LocationFix'
_TYPES = {'UNKNOWN': 0, 'APPROXIMATED': 1, 'DIAGONAL_KNOWN': 2, 'KNOWN': 3}
_FIELDS = (
    'timestamp',
    'latitude',
    'longitude',
    'altitude',
    'position_covariance',
    'position_covariance_type',
)

_Row = tuple[int, int, float, float, float, Sequence[float], int]


def readable(schema: Schema, encoding: str) -> bool:
    """Return whether messages of a schema and encoding can be read here."""
    if schema.name != _NAME:
        return False
    return encoding == 'json' or (encoding == 'protobuf' and schema.encoding == 'protobuf')


def read_columns(log: McapFile, channel_ids: Sequence[int]) -> Columns:
    """Return the columns of LocationFix messages, named as in the ROS 2 definition.

    Raises
    ------
    LogError
        If the schema does not say how to read them or the file is damaged.
    """
    channel = log.channels[channel_ids[0]]
    schema = log.schemas[channel.schema_id]
    parse: Callable[[bytes], _Row]
    if channel.message_encoding == 'json':
        parse = _parse_json
    else:
        numbers = _field_numbers(schema)
        if numbers is None:
            raise LogError(f'{log.path}: topic {channel.topic}: its protobuf schema lacks {_NAME}')

        def parse(message: bytes) -> _Row:
            return _parse_protobuf(message, numbers)

    size = sum(log.message_counts[key] for key in channel_ids)
    values: dict[str, Any] = {
        'timestamp.sec': np.zeros(size, np.int64),
        'timestamp.nanosec': np.zeros(size, np.int64),
        'latitude': np.zeros(size),
        'longitude': np.zeros(size),
        'altitude': np.zeros(size),
        'position_covariance': np.zeros((size, 9)),
        'position_covariance_type': np.zeros(size, np.uint8),
    }
    columns = list(values.values())
    log_time, publish_time = np.zeros(size, np.int64), np.zeros(size, np.int64)
    fault = np.zeros(size, np.uint8)
    row = 0
    for batch in log.batches(channel_ids):
        rows = slice(row, row + len(batch))
        log_time[rows], publish_time[rows] = batch.log_time, batch.publish_time
        for start, end in zip(batch.start.tolist(), batch.end.tolist(), strict=True):
            try:
                parts = parse(batch.data[start:end].tobytes())
                for column, part in zip(columns, parts, strict=True):
                    column[row] = part
            except DAMAGE:
                fault[row] = 1
            row += 1
    return Columns(log_time, publish_time, values, fault, _FAULTS)


def _parse_json(message: bytes) -> _Row:
    fix = json.loads(message)
    stamp = fix.get('timestamp') or {}
    kind = fix.get('position_covariance_type', 0)
    return (
        stamp.get('sec', 0),
        stamp.get('nsec', stamp.get('nanosec', 0)),
        _number(fix['latitude']),
        _number(fix['longitude']),
        _number(fix.get('altitude')),
        fix.get('position_covariance') or [0.0] * 9,
        _TYPES.get(kind, 0) if isinstance(kind, str) else kind,
    )


def _number(value: Any) -> float:
    return float('nan') if value is None else float(value)


def _field_numbers(schema: Schema) -> dict[int, str] | None:
    """Return LocationFix's field names by number, None if it is not described."""
    try:
        described = message_types(schema).get(_NAME, ())
    except LogError:
        return None
    found = {field.number: field.name for field in described}
    return found if {'latitude', 'longitude'} <= set(found.values()) else None


def _parse_protobuf(message: bytes, numbers: dict[int, str]) -> _Row:
    fix: dict[str, Any] = dict.fromkeys(_FIELDS)  # a zero is not written: proto3
    covariance: list[float] = []
    for number, value in wire(message):
        name = numbers.get(number, '')
        if name == 'position_covariance' and isinstance(value, bytes):
            covariance.extend(struct.unpack(f'<{len(value) // 8}d', value))
        elif name in fix:
            fix[name] = value
    stamp = dict(wire(fix['timestamp'])) if fix['timestamp'] else {}
    return (
        int(stamp.get(1, 0)),
        int(stamp.get(2, 0)),
        _double(fix['latitude']),
        _double(fix['longitude']),
        _double(fix['altitude']),
        covariance or [0.0] * 9,
        fix['position_covariance_type'] or 0,
    )


def _double(value: bytes | None) -> float:
    return 0.0 if value is None else float(struct.unpack('<d', value)[0])
