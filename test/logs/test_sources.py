"""Tracks out of logs: what is chosen, what is dropped and why, axes and clocks."""

import json
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from log_making import START_NS, STORE, Message, fixes, nav_sat_fix, stamp
from numpy.testing import assert_allclose, assert_array_equal

from flightdyn.errors import InputError, LogError
from flightdyn.logs import list_sources, log_info, read_track

Write = Callable[..., Path]
ODOMETRY = 'nav_msgs/msg/Odometry'
FIX = 'sensor_msgs/msg/NavSatFix'


def test_glider_log_holds_what_was_cut(glider_log: Path) -> None:
    track = read_track(glider_log)
    truth = np.load(glider_log.with_suffix('.truth.npz'))
    assert_array_equal(track.time_ns, truth['t_unix_ns'])
    # The messages carry nine decimals at most; 1e-8 degrees is a millimetre.
    assert_allclose(track.lat, truth['lat'], atol=1e-8)
    assert_allclose(track.lon, truth['lon'], atol=1e-8)
    assert_allclose(track.altitude, truth['alt'], atol=1e-3)
    assert (track.source, track.schema, track.messages) == ('/fix', FIX, 900)
    assert (track.altitude_datum, track.dropped, track.warnings) == ('ellipsoid', {}, [])
    assert set(track.segment) == {0}


def test_unusable_fixes_are_dropped_by_reason(write_log: Write) -> None:
    nan = float('nan')
    bad = {
        3: nav_sat_fix(START_NS + 3 * 10**9, status=-1),
        4: nav_sat_fix(START_NS + 4 * 10**9, lat=nan, lon=nan),
        5: nav_sat_fix(START_NS + 5 * 10**9, lat=95.0),
        6: nav_sat_fix(START_NS + 6 * 10**9, lon=200.5),
        7: nav_sat_fix(START_NS + 7 * 10**9, altitude=nan),
        8: nav_sat_fix(START_NS + 8 * 10**9, lat=0.0, lon=0.0),
        9: nav_sat_fix(START_NS + 9 * 10**9)[:40],
    }
    messages = [(t, ns, bad.get(i, data)) for i, (t, ns, data) in enumerate(fixes(20))]
    track = read_track(write_log(messages))
    assert track.messages == 20
    assert track.dropped == {
        'no fix': 1,
        'position not finite': 1,
        'position out of range': 2,
        'no altitude': 1,
        'position 0 N 0 E': 1,
        'shorter than its schema': 1,
    }
    assert len(track) == 13
    assert track.lat is not None
    assert np.isfinite(track.lat).all()


def test_no_valid_fix_says_so(write_log: Write) -> None:
    with pytest.raises(LogError, match=r'/fix has 0 usable of 20 messages \(20 no fix\)'):
        read_track(write_log(fixes(20, status=-1)))


@pytest.mark.parametrize('number', [0, 1])
def test_one_position_is_no_motion(write_log: Write, number: int) -> None:
    with pytest.raises(LogError, match=r'at least two|has no messages'):
        read_track(write_log(fixes(number)))


def test_one_time_for_all_is_no_time(write_log: Write) -> None:
    messages = [('/fix', START_NS, nav_sat_fix(START_NS, 48 + i * 1e-4)) for i in range(9)]
    with pytest.raises(LogError, match='8 repeated time'):
        read_track(write_log(messages))


def test_big_endian_is_read_like_little_endian(write_log: Write) -> None:
    little = read_track(write_log(fixes(9)))
    big = read_track(write_log(fixes(9, little_endian=False), name='big.mcap'))
    for name in ('time_ns', 'lat', 'lon', 'altitude'):
        assert_array_equal(getattr(big, name), getattr(little, name))


def test_schema_without_text_takes_the_standard_definition(write_log: Write) -> None:
    track = read_track(write_log(fixes(9), texts={FIX: b''}))
    assert len(track) == 9
    assert 'the standard definition was used' in track.warnings[0]


def test_covariance_becomes_north_east_down_sigma(write_log: Write) -> None:
    covariance = (4.0, 0.1, 0, 0.1, 9.0, 0, 0, 0, 25.0)  # east, north, up
    track = read_track(write_log(fixes(9, covariance=covariance, covariance_type=2)))
    assert track.position_std is not None
    assert_allclose(track.position_std, np.tile([3.0, 2.0, 5.0], (9, 1)))
    unknown = read_track(write_log(fixes(9, covariance=covariance, covariance_type=0)))
    assert unknown.position_std is None


def test_range_counts_from_the_first_usable_sample(write_log: Write) -> None:
    messages = fixes(20)
    messages[0] = ('/fix', START_NS, nav_sat_fix(START_NS, status=-1))
    messages[5] = ('/fix', START_NS + 5 * 10**9, nav_sat_fix(START_NS + 5 * 10**9, status=-1))
    track = read_track(write_log(messages), start=2.0, end=6.0)
    assert_array_equal(track.time_ns - START_NS, np.array([3, 4, 6, 7]) * 10**9)
    assert (track.messages, track.dropped) == (5, {'no fix': 1})
    with pytest.raises(LogError, match='it runs from 0 s to 18 s'):
        read_track(write_log(messages), start=100)
    with pytest.raises(InputError, match='before'):
        read_track(write_log(messages), start=5, end=5)


def test_the_source_with_more_messages_is_taken_and_named(write_log: Write) -> None:
    slow = [('/a/fix', ns, data) for _, ns, data in fixes(20)[::2]]
    path = write_log(fixes(20) + slow, {'/fix': FIX, '/a/fix': FIX})
    track = read_track(path)
    assert track.source == '/fix'
    assert track.warnings == ['/fix was taken of 2 usable sources; others: /a/fix']
    chosen = read_track(path, '/a/fix')
    assert (chosen.source, len(chosen), chosen.warnings) == ('/a/fix', 10, [])
    with pytest.raises(LogError, match=r"no topic '/b'. Topics: /fix .*/a/fix"):
        read_track(path, '/b')


@pytest.mark.parametrize(('every', 'first'), [(1, 'global'), (2, 'global'), (3, 'raw/fix')])
def test_the_fused_fix_comes_before_the_raw_one(write_log: Write, every: int, first: str) -> None:
    """Of mavros' two the raw one used to be taken wherever it had a few messages more."""
    space = '/uav1/mavros/global_position'
    raw = [(f'{space}/raw/fix', ns, data) for _, ns, data in fixes(20)]
    fused = [(f'{space}/global', ns, data) for _, ns, data in fixes(20)[::every]]
    path = write_log(raw + fused, {f'{space}/raw/fix': FIX, f'{space}/global': FIX})
    assert read_track(path).source == f'{space}/{first}'
    assert read_track(path, f'{space}/raw/fix').source == f'{space}/raw/fix'


def test_raw_alone_or_of_another_vehicle_is_no_reason(write_log: Write) -> None:
    one, other = '/a/gps/raw/fix', '/b/gps/fix'
    few = [(other, ns, data) for _, ns, data in fixes(19)]
    path = write_log([(one, ns, d) for _, ns, d in fixes(20)] + few, {one: FIX, other: FIX})
    assert read_track(path).source == one


def test_a_source_without_a_fix_is_passed_over(write_log: Write) -> None:
    lost = [('/a/fix', ns, data) for _, ns, data in fixes(50, status=-1)]
    track = read_track(write_log(fixes(20) + lost, {'/fix': FIX, '/a/fix': FIX}))
    assert track.source == '/fix'
    assert '/a/fix has 0 usable of 50' in track.warnings[0]


def test_no_position_lists_what_there_is(write_log: Write) -> None:
    path = write_log([], {'/imu': 'sensor_msgs/msg/Imu'})
    with pytest.raises(LogError, match=r'Topics: /imu \(sensor_msgs/msg/Imu\).*NavSatFix'):
        read_track(path)
    with pytest.raises(LogError, match=r'topic /imu .* cannot be used'):
        read_track(path, '/imu')


def test_log_cut_before_its_first_position_says_so(write_log: Write) -> None:
    path = write_log(fixes(9))
    path.write_bytes(path.read_bytes()[:60])
    with pytest.raises(LogError, match=r'recording was cut short.*no usable position source'):
        read_track(path)


@pytest.mark.parametrize('encoding', ['ros1', 'flatbuffer', 'cbor'])
def test_other_encodings_are_listed_as_not_readable(write_log: Write, encoding: str) -> None:
    path = write_log(fixes(9), encoding=encoding)
    (source,) = list_sources(path)
    assert not source.usable
    assert encoding in source.note
    with pytest.raises(LogError, match=f"no usable position source.*encoding '{encoding}'"):
        read_track(path)


def odometry(
    ns: int,
    position: tuple[float, ...],
    quaternion: tuple[float, ...],
    linear: tuple[float, ...],
    child: str = 'base_link',
    covariance: np.ndarray | None = None,
    frame: str = 'odom',
) -> bytes:
    types = STORE.types
    zeros = np.zeros(36)
    x, y, z, w = quaternion
    message = types[ODOMETRY](
        stamp(ns, frame),
        child,
        types['geometry_msgs/msg/PoseWithCovariance'](
            types['geometry_msgs/msg/Pose'](
                types['geometry_msgs/msg/Point'](*position),
                types['geometry_msgs/msg/Quaternion'](x, y, z, w),
            ),
            zeros if covariance is None else covariance,
        ),
        types['geometry_msgs/msg/TwistWithCovariance'](
            types['geometry_msgs/msg/Twist'](
                types['geometry_msgs/msg/Vector3'](*linear),
                types['geometry_msgs/msg/Vector3'](0.0, 0.0, 0.0),
            ),
            zeros if covariance is None else covariance,
        ),
    )
    return bytes(STORE.serialize_cdr(message, ODOMETRY))


# Facing north in ENU: yaw 90 degrees about up. Then forward is north and left is west.
NORTH = (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))


def flight(linear: tuple[float, ...], **options: object) -> list[Message]:
    """Positions that move 1 m/s east, 2 north, 3 up, facing north."""
    return [
        (
            '/odom',
            START_NS + i * 10**9,
            odometry(START_NS + i * 10**9, (i, 2.0 * i, 3.0 * i), NORTH, linear, **options),
        )
        for i in range(30)
    ]


def test_odometry_twist_is_in_the_body(write_log: Write) -> None:
    # 2 forward (north), -1 left (that is 1 east), 3 up
    covariance = np.diag([1.0, 4.0, 9.0, 0, 0, 0]).ravel()
    path = write_log(flight((2.0, -1.0, 3.0), covariance=covariance), {'/odom': ODOMETRY})
    track = read_track(path)
    i = np.arange(30.0)
    assert_allclose(track.position_ned, np.stack([2 * i, i, -3 * i], 1))
    assert_allclose(track.velocity_ned, np.tile([2, 1, -3], (30, 1)), atol=1e-12)
    assert_allclose(np.abs(track.attitude), np.tile([1, 0, 0, 0], (30, 1)), atol=1e-12)
    assert_allclose(track.position_std, np.tile([2.0, 1.0, 3.0], (30, 1)))  # north is y
    assert_allclose(track.velocity_std, np.tile([1.0, 2.0, 3.0], (30, 1)))  # forward is north
    assert (track.altitude_datum, track.origin, track.lat) == ('local', None, None)


@pytest.mark.parametrize('child', ['odom', 'map', 'world'])
def test_odometry_twist_of_a_world_frame(write_log: Write, child: str) -> None:
    path = write_log(flight((1.0, 2.0, 3.0), child=child), {'/odom': ODOMETRY})
    assert_allclose(read_track(path).velocity_ned, np.tile([2, 1, -3], (30, 1)), atol=1e-12)


def test_a_velocity_over_the_ground_with_z_down_is_turned_round(write_log: Write) -> None:
    # as mavros gives it, although the child frame is the body
    track = read_track(write_log(flight((1.0, 2.0, -3.0)), {'/odom': ODOMETRY}))
    assert_allclose(track.velocity_ned, np.tile([2, 1, -3], (30, 1)), atol=1e-12)
    assert 'contradicts its positions' in track.warnings[0]
    assert 'its vertical part counted downwards' in track.warnings[1]


def test_a_velocity_against_the_positions_is_not_used(write_log: Write) -> None:
    track = read_track(write_log(flight((-9.0, 2.0, 3.0)), {'/odom': ODOMETRY}))
    assert track.velocity_ned is None
    assert all('contradicts its positions' in warning for warning in track.warnings)


def test_odometry_in_another_frame_is_dropped(write_log: Write) -> None:
    messages = flight((2.0, -1.0, 3.0))
    messages[7] = flight((2.0, -1.0, 3.0), frame='map')[7]
    track = read_track(write_log(messages, {'/odom': ODOMETRY}))
    assert track.dropped == {'another frame': 1}
    assert 'frames change' in track.warnings[0]


def test_a_fix_is_preferred_in_a_foreign_log(write_log: Write) -> None:
    messages = flight((2.0, -1.0, 3.0)) + fixes(5)
    path = write_log(messages, {'/odom': ODOMETRY, '/fix': FIX})
    assert [(s.topic, s.kind, s.rank) for s in list_sources(path)] == [
        ('/fix', 'fix', 0),
        ('/odom', 'odometry', 1),
    ]
    assert read_track(path).source == '/fix'


def location_fix_json(i: int, **changes: object) -> bytes:
    return json.dumps(
        {
            'timestamp': {'sec': START_NS // 10**9 + i, 'nsec': 500},
            'latitude': 48 + 1e-4 * i,
            'longitude': 9.0,
            'altitude': 500.0,
            'position_covariance': [4, 0, 0, 0, 9, 0, 0, 0, 25],
            'position_covariance_type': 2,
            **changes,
        }
    ).encode()


def test_location_fix_in_json(write_log: Write) -> None:
    messages = [('/gps', START_NS + i, location_fix_json(i)) for i in range(9)]
    messages[4] = ('/gps', START_NS + 4, b'{"latitude": "north"}')
    messages[5] = ('/gps', START_NS + 5, location_fix_json(5, latitude=None))
    path = write_log(
        messages,
        {'/gps': 'foxglove.LocationFix'},
        texts={'foxglove.LocationFix': b'{}'},
        encoding='json',
        schema_encoding='jsonschema',
    )
    track = read_track(path)
    assert track.dropped == {'not a LocationFix': 1, 'position not finite': 1}
    assert_array_equal(track.time_ns[:2], START_NS + np.array([0, 10**9]) + 500)
    assert track.position_std is not None
    assert_allclose(track.position_std[0], [3, 2, 5])


def field(number: int, payload: bytes) -> bytes:
    return bytes([number << 3 | 2, len(payload)]) + payload


def test_location_fix_in_protobuf(write_log: Write) -> None:
    def described(name: str, number: int) -> bytes:
        return field(2, field(1, name.encode()) + bytes([3 << 3, number]))

    message = field(1, b'LocationFix') + b''.join(
        described(name, number)
        for number, name in enumerate(
            ('latitude', 'longitude', 'altitude', 'position_covariance', 'kind', 'timestamp'), 1
        )
    )
    schema = bytes([1 << 3 | 2, *_varint(len(field(2, b'foxglove') + _long(4, message)))])
    schema += field(2, b'foxglove') + _long(4, message)
    payloads = []
    for i in range(9):
        numbers = [(1, 48 + 1e-4 * i), (2, 9.5), (3, 321.0)]
        time = bytes([1 << 3, *_varint(START_NS // 10**9 + i)])
        payloads.append(
            b''.join(bytes([n << 3 | 1]) + struct.pack('<d', v) for n, v in numbers)
            + field(6, time)
        )
    payloads[3] = payloads[3][:-1]
    name = 'foxglove.LocationFix'
    path = write_log(
        [('/gps', START_NS + i, p) for i, p in enumerate(payloads)],
        {'/gps': name},
        texts={name: schema},
        encoding='protobuf',
        schema_encoding='protobuf',
    )
    track = read_track(path)
    assert track.dropped == {'not a LocationFix': 1}
    assert_allclose(track.lat, 48 + 1e-4 * np.delete(np.arange(9), 3))
    assert_allclose(track.altitude, 321)
    assert track.time_ns[1] == START_NS + 10**9


def _varint(value: int) -> bytes:
    out = []
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*out, value])


def _long(number: int, payload: bytes) -> bytes:
    return bytes([number << 3 | 2]) + _varint(len(payload)) + payload


def test_info_is_plain_data(glider_log: Path) -> None:
    info = log_info(glider_log).to_dict()
    assert json.loads(json.dumps(info)) == info
    assert info['messages'] == 900
    (topic,) = info['topics']
    assert topic == {
        'topic': '/fix',
        'schema': FIX,
        'encoding': 'cdr',
        'kind': 'fix',
        'messages': 900,
        'usable': True,
        'rank': 0,
        'note': '',
    }


def test_track_can_be_changed(glider_log: Path) -> None:
    assert replace(read_track(glider_log), source='/x').source == '/x'
