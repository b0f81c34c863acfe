"""foxglove.LocationFix and LocationFixes in every encoding that they are written in."""

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import flatbuffers
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from log_making import START_NS, Message
from numpy.testing import assert_allclose, assert_array_equal
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from test_sources import _long, _varint

from flightdyn.errors import LogError
from flightdyn.logs import list_sources, read_track
from flightdyn.logs.flatbuffer import DAMAGE, FlatbufferReader
from flightdyn.logs.mcap_container import Schema

Write = Callable[..., Path]
DATA = Path(__file__).parents[1] / 'data'
BFBS = (DATA / 'location_fixes.bfbs').read_bytes()
ONE, MANY = 'foxglove.LocationFix', 'foxglove.LocationFixes'

FIX_TEXT = """
builtin_interfaces/Time timestamp
string frame_id
float64 latitude
float64 longitude
float64 altitude
float64[9] position_covariance
uint8 position_covariance_type
float64 velocity_x
float64 velocity_y
float64 velocity_z
foxglove_msgs/KeyValuePair[] metadata
"""
PAIR_TEXT = 'string key\nstring value\n'
RULE = '\n' + '=' * 80 + '\n'
TIME = f'{RULE}MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n'
PAIR = f'{RULE}MSG: foxglove_msgs/KeyValuePair\n{PAIR_TEXT}'
ROS = {
    'foxglove_msgs/msg/LocationFix': FIX_TEXT + PAIR + TIME,
    'foxglove_msgs/msg/LocationFixes': 'foxglove_msgs/LocationFix[] fixes\n'
    + f'{RULE}MSG: foxglove_msgs/LocationFix\n{FIX_TEXT}{PAIR}{TIME}',
}
STORE = get_typestore(Stores.ROS2_KILTED)
STORE.register(get_types_from_msg(PAIR_TEXT, 'foxglove_msgs/msg/KeyValuePair'))
STORE.register(get_types_from_msg(FIX_TEXT, 'foxglove_msgs/msg/LocationFix'))
STORE.register(
    get_types_from_msg('foxglove_msgs/LocationFix[] fixes', 'foxglove_msgs/msg/LocationFixes')
)

VARIANCES = [4.0, 0, 0, 0, 9.0, 0, 0, 0, 25.0]


def fix(i: int, lat: float = 48.0, **changes: Any) -> dict[str, Any]:
    """Northward at about 11 m/s and up at 3 m/s."""
    return {
        'timestamp': {'sec': START_NS // 10**9 + i, 'nsec': 500},
        'frame_id': 'gps',
        'latitude': lat + 1e-4 * i,
        'longitude': 9.25,
        'altitude': 500.0 + 3 * i,
        'position_covariance': VARIANCES,
        'position_covariance_type': 2,
        'velocity_x': 0.0,
        'velocity_y': 11.12,
        'velocity_z': 3.0,
        **changes,
    }


def as_json(fixes: list[dict[str, Any]], many: bool) -> bytes:
    return json.dumps({'fixes': fixes} if many else fixes[0]).encode()


def as_flatbuffer(fixes: list[dict[str, Any]], many: bool) -> bytes:
    builder = flatbuffers.Builder(64)
    tables = []
    for each in fixes:
        frame = builder.CreateString(each['frame_id'])
        builder.StartVector(8, 9, 8)
        for number in reversed(each['position_covariance']):
            builder.PrependFloat64(number)
        covariance = builder.EndVector()
        builder.StartObject(14)
        builder.Prep(4, 8)
        builder.PrependUint32(each['timestamp']['nsec'])
        builder.PrependUint32(each['timestamp']['sec'])
        builder.PrependStructSlot(0, builder.Offset(), 0)
        builder.PrependUOffsetTRelativeSlot(1, frame, 0)
        for slot, name in ((2, 'latitude'), (3, 'longitude'), (4, 'altitude')):
            builder.PrependFloat64Slot(slot, each[name], 0.0)
        builder.PrependUOffsetTRelativeSlot(5, covariance, 0)
        builder.PrependUint8Slot(6, each['position_covariance_type'], 0)
        for slot, name in ((11, 'velocity_x'), (12, 'velocity_y'), (13, 'velocity_z')):
            if each[name] is not None:
                builder.PrependFloat64Slot(slot, each[name], None)
        tables.append(builder.EndObject())
    if not many:
        builder.Finish(tables[0])
        return bytes(builder.Output())
    builder.StartVector(4, len(tables), 4)
    for table in reversed(tables):
        builder.PrependUOffsetTRelative(table)
    vector = builder.EndVector()
    builder.StartObject(1)
    builder.PrependUOffsetTRelativeSlot(0, vector, 0)
    builder.Finish(builder.EndObject())
    return bytes(builder.Output())


# The numbers that Foxglove's own proto files give, but for the velocities.
PROTO = {
    'latitude': 1,
    'longitude': 2,
    'altitude': 3,
    'position_covariance': 4,
    'position_covariance_type': 5,
    'timestamp': 6,
    'frame_id': 7,
    'velocity_x': 14,
    'velocity_y': 15,
    'velocity_z': 16,
}


def key(number: int, kind: int) -> bytes:
    return _varint(number << 3 | kind)


def as_protobuf(fixes: list[dict[str, Any]], many: bool) -> bytes:
    messages = []
    for each in fixes:
        stamp = each['timestamp']
        parts = [
            key(PROTO[name], 1) + struct.pack('<d', value)
            for name, value in each.items()
            if isinstance(value, float)
        ]
        parts.append(_long(4, struct.pack('<9d', *each['position_covariance'])))
        parts.append(key(5, 0) + _varint(each['position_covariance_type']))
        parts.append(
            _long(6, key(1, 0) + _varint(stamp['sec']) + key(2, 0) + _varint(stamp['nsec']))
        )
        parts.append(_long(7, each['frame_id'].encode()))
        messages.append(b''.join(parts))
    return b''.join(_long(1, message) for message in messages) if many else messages[0]


def descriptors() -> bytes:
    def message(name: str, fields: dict[str, int]) -> bytes:
        described = [
            _long(2, _long(1, n.encode()) + key(3, 0) + _varint(k)) for n, k in fields.items()
        ]
        return _long(4, _long(1, name.encode()) + b''.join(described))

    inner = message('LocationFix', PROTO) + message('LocationFixes', {'fixes': 1})
    return _long(1, _long(2, b'foxglove') + inner)


def as_cdr(fixes: list[dict[str, Any]], many: bool) -> bytes:
    types = STORE.types
    made = []
    for each in fixes:
        stamp = each['timestamp']
        values = {
            **each,
            'timestamp': types['builtin_interfaces/msg/Time'](stamp['sec'], stamp['nsec']),
            'position_covariance': np.array(each['position_covariance']),
            'metadata': [types['foxglove_msgs/msg/KeyValuePair']('call sign', 'D-1234')],
        }
        made.append(types['foxglove_msgs/msg/LocationFix'](**values))
    name = 'foxglove_msgs/msg/LocationFix' + ('es' if many else '')
    whole = types[name](fixes=made) if many else made[0]
    return bytes(STORE.serialize_cdr(whole, name))


ENCODINGS: dict[str, tuple[Callable[..., bytes], str, dict[str, bytes]]] = {
    'json': (as_json, 'jsonschema', {ONE: b'{}', MANY: b'{}'}),
    'flatbuffer': (as_flatbuffer, 'flatbuffer', {ONE: BFBS, MANY: BFBS}),
    'protobuf': (as_protobuf, 'protobuf', {ONE: descriptors(), MANY: descriptors()}),
    'cdr': (as_cdr, 'ros2msg', {name: text.encode() for name, text in ROS.items()}),
}


@pytest.fixture(params=list(ENCODINGS))
def write_fixes(request: Any, write_log: Write) -> Write:
    make, schema_encoding, texts = ENCODINGS[request.param]

    def write(messages: list[list[dict[str, Any]]], *, many: bool = False, **options: Any) -> Path:
        name = list(texts)[many]
        data: list[Message] = [
            ('/where', START_NS + i * 10**9, make(fixes, many)) for i, fixes in enumerate(messages)
        ]
        for i, payload in options.items():
            data[int(i[1:])] = ('/where', START_NS, payload)
        return write_log(
            data,
            {'/where': name},
            texts={name: texts[name]},
            encoding=request.param,
            schema_encoding=schema_encoding,
        )

    return write


@pytest.mark.parametrize('many', [False, True])
def test_one_fix_a_message(write_fixes: Write, many: bool) -> None:
    path = write_fixes([[fix(i)] for i in range(20)], many=many)
    track = read_track(path)
    i = np.arange(20)
    assert_array_equal(track.time_ns, START_NS + i * 10**9 + 500)
    assert_array_equal(track.lat, 48 + 1e-4 * i)
    assert_array_equal(track.altitude, 500 + 3 * i)
    assert_allclose(track.position_std, np.tile([3, 2, 5], (20, 1)))
    assert_allclose(track.velocity_ned, np.tile([11.12, 0, -3], (20, 1)))
    assert (track.dropped, track.warnings, track.altitude_datum) == ({}, [], 'ellipsoid')


def test_a_damaged_message_is_counted(write_fixes: Write) -> None:
    path = write_fixes([[fix(i)] for i in range(9)], m3=b'\xff\xff\xff\xff\0')
    track = read_track(path)
    assert len(track) == 8
    assert list(track.dropped.values()) == [1]


def test_a_message_holds_a_stretch(write_fixes: Write) -> None:
    messages = [[fix(4 * i + k) for k in range(4)] for i in range(5)]
    track = read_track(write_fixes(messages, many=True))
    assert_array_equal(track.lat, 48 + 1e-4 * np.arange(20))
    assert (track.messages, track.dropped) == (20, {})


def test_of_several_frames_the_first_is_the_track(write_fixes: Write) -> None:
    messages = [[fix(i), fix(i, 10.0, frame_id='tug')] for i in range(9)]
    track = read_track(write_fixes(messages, many=True))
    assert_array_equal(track.lat, 48 + 1e-4 * np.arange(9))
    assert track.dropped == {'another frame': 9}
    assert track.warnings == ["the fixes are of 2 frames: 'gps' is used, not 'tug'"]


def test_of_several_at_one_time_the_first_is_the_track(write_fixes: Write) -> None:
    messages = [[fix(i), fix(i, 10.0), fix(i, 20.0)] for i in range(9)]
    track = read_track(write_fixes(messages, many=True))
    assert_array_equal(track.lat, 48 + 1e-4 * np.arange(9))
    assert track.dropped == {'repeated time': 18}


@pytest.mark.parametrize('changes', [{}, {'position_covariance_type': 'DIAGONAL_KNOWN'}])
@pytest.mark.parametrize('stamp', ['2023-11-14T22:13:{:02}.0000005Z', '2023-11-14T22:13:{:02}Z'])
def test_json_as_protobuf_writes_it(write_log: Write, changes: Any, stamp: str) -> None:
    first = 20  # START_NS is 2023-11-14 22:13:20 UTC
    messages = [
        (
            '/where',
            START_NS,
            as_json([fix(i, timestamp=stamp.format(first + i), **changes)], False),
        )
        for i in range(9)
    ]
    path = write_log(
        messages, {'/where': ONE}, texts={ONE: b''}, encoding='json', schema_encoding='jsonschema'
    )
    track = read_track(path)
    expected = START_NS + np.arange(9) * 10**9 + (500 if '.' in stamp else 0)
    assert_array_equal(track.time_ns, expected)
    assert_allclose(track.position_std, np.tile([3, 2, 5], (9, 1)))


@pytest.mark.parametrize(
    ('encoding', 'schema', 'says'),
    [
        ('flatbuffer', b'', 'is no binary schema of FlatBuffers'),
        ('flatbuffer', b'table LocationFix { latitude:double; }', 'is no binary schema'),
        ('flatbuffer', BFBS[:900], 'is no binary schema'),
        (
            'flatbuffer',
            BFBS.replace(b'foxglove.LocationFix\0', b'foxglove.LocatioNFix\0'),
            'define',
        ),
        ('flatbuffer', BFBS.replace(b'latitude', b'l4titude'), 'lacks a latitude'),
        ('protobuf', b'', 'lacks foxglove.LocationFix'),
        ('protobuf', b'\xff', 'not a set of protobuf descriptors'),
    ],
)
def test_a_schema_that_does_not_tell_is_named(
    write_log: Write, encoding: str, schema: bytes, says: str
) -> None:
    messages = [('/where', START_NS + i, as_flatbuffer([fix(i)], False)) for i in range(3)]
    path = write_log(
        messages, {'/where': ONE}, texts={ONE: schema}, encoding=encoding, schema_encoding=encoding
    )
    (source,) = list_sources(path)
    assert (source.usable, source.kind) == (False, 'fix')
    assert says in source.note
    with pytest.raises(LogError, match='no usable position source'):
        read_track(path)


def test_a_ros_definition_without_fixes_is_named(write_log: Write) -> None:
    name = 'foxglove_msgs/msg/LocationFixes'
    path = write_log([('/where', START_NS, b'')], {'/where': name}, texts={name: b'uint8 many'})
    (source,) = list_sources(path)
    assert not source.usable
    assert 'has no field fixes; it has many' in source.note


def test_what_is_not_in_a_flatbuffer_has_its_default() -> None:
    reader = FlatbufferReader(Schema(1, ONE, 'flatbuffer', BFBS))
    builder = flatbuffers.Builder(0)
    builder.StartObject(14)
    builder.Finish(builder.EndObject())
    names = ('latitude', 'position_covariance_type', 'velocity_x', 'timestamp', 'frame_id')
    assert reader.read(bytes(builder.Output()), names) == {
        'latitude': 0.0,
        'position_covariance_type': 0,
        'velocity_x': None,
    }
    assert reader.has('timestamp.nsec')
    assert not reader.has('timestamp.nanosec')


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(st.floats(0, 0.9999), st.integers(0, 255)), max_size=6), st.floats(0, 1))
def test_a_damaged_flatbuffer_is_read_or_refused(
    changes: list[tuple[float, int]], kept: float
) -> None:
    for data, read in (
        (as_flatbuffer([fix(1), fix(2)], True), True),
        (BFBS, False),
    ):
        damaged = bytearray(data)
        for where, byte in changes:
            damaged[int(where * len(data))] = byte
        damaged = damaged[: max(round(kept * len(data)), 1)] if changes else damaged
        try:
            if read:
                reader = FlatbufferReader(Schema(1, MANY, 'flatbuffer', BFBS))
                reader.read(bytes(damaged), ('fixes', 'timestamp', 'sec', 'latitude', 'frame_id'))
            else:
                FlatbufferReader(Schema(1, MANY, 'flatbuffer', bytes(damaged)))
        except (*DAMAGE, LogError):
            continue
