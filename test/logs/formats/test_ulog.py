"""ULog written byte by byte after its specification, read through pyulog."""

import struct
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flown_circle import CLIMB, SPEED, START_S, circle, flown_speed

from flightdyn import frames
from flightdyn.errors import LogError, MissingExtraError
from flightdyn.logs.any_log import describe, read_track

pytest.importorskip('pyulog')

GPS_OLD = (
    'uint64_t timestamp;uint64_t time_utc_usec;int32_t lat;int32_t lon;int32_t alt;'
    'int32_t alt_ellipsoid;float s_variance_m_s;float eph;float epv;float vel_n_m_s;'
    'float vel_e_m_s;float vel_d_m_s;bool vel_ned_valid;uint8_t fix_type;'
)
GPS_NEW = (
    GPS_OLD.replace('int32_t lat;int32_t lon;', 'double latitude_deg;double longitude_deg;')
    .replace('int32_t alt;', 'double altitude_msl_m;')
    .replace('int32_t alt_ellipsoid;', 'double altitude_ellipsoid_m;')
)
LOCAL = (
    'uint64_t timestamp;float x;float y;float z;float vx;float vy;float vz;bool xy_valid;'
    'bool z_valid;'
)
BOOT_S = START_S - 1000


def message(kind: bytes, body: bytes) -> bytes:
    return struct.pack('<Hc', len(body), kind) + body


def ulog(path: Path, formats: dict[str, str], data: list[tuple[int, bytes]]) -> Path:
    """Write a log; `data` are indices into the formats and packed messages."""
    content = b'ULog\x01\x12\x35\x01' + struct.pack('<Q', 0) + message(b'B', bytes(40))
    content += message(b'I', b'\x10char[3] sys_namePX4')
    for name, fields in formats.items():
        content += message(b'F', f'{name}:{fields}'.encode())
    for number, name in enumerate(formats):
        content += message(b'A', struct.pack('<BH', 0, number) + name.encode())
    for number, packed in data:
        content += message(b'D', struct.pack('<H', number) + packed)
    path.write_bytes(content)
    return path


def circle_ulog(path: Path, new: bool = True, fix_type: int = 3) -> Path:
    flown = circle(rate=5)
    data = []
    for i, t in enumerate(flown.time):
        place = (flown.lat[i], flown.lon[i], flown.altitude[i] - 48, flown.altitude[i])
        layout = '<QQ4d3f3f?B'
        if not new:
            layout = '<QQ4i3f3f?B'
            scales = (1e7, 1e7, 1e3, 1e3)
            place = tuple(round(p * s) for p, s in zip(place, scales, strict=True))
        us, utc = round((t - BOOT_S) * 1e6), round(t * 1e6)
        fix = fix_type if i else 1
        rest = (0.2, 1.5, 2.5, *flown.velocity_ned[i], True, fix)
        data.append((0, struct.pack(layout, us, utc, *place, *rest)))
    return ulog(path, {'vehicle_gps_position': GPS_NEW if new else GPS_OLD}, data)


@pytest.mark.parametrize('new', [True, False])
def test_a_circle_is_replayed_at_its_speed(tmp_path: Path, new: bool) -> None:
    path = circle_ulog(tmp_path / 'circle.ulg', new)
    speed, climb = flown_speed(path)
    assert speed == pytest.approx(SPEED, rel=1e-3)
    assert climb == pytest.approx(CLIMB, abs=0.01)
    track, flown = read_track(path), circle(rate=5)
    # 1e-7 degrees and milliseconds of the old layout.
    np.testing.assert_allclose(track.lat, flown.lat[1:], rtol=0, atol=1e-7)
    np.testing.assert_allclose(track.altitude, flown.altitude[1:], rtol=0, atol=1e-3)
    np.testing.assert_allclose(track.time_ns / 1e9, flown.time[1:], rtol=0, atol=1e-5)
    np.testing.assert_allclose(track.velocity_ned, flown.velocity_ned[1:], rtol=0, atol=1e-5)
    assert track.altitude_datum == 'ellipsoid'
    assert track.dropped == {'no 3D fix': 1}
    assert track.schema == 'ulog.vehicle_gps_position'


def test_the_attitude_of_the_estimator_is_taken(tmp_path: Path) -> None:
    flown = circle(rate=5)
    yaw = np.arctan2(flown.velocity_ned[:, 1], flown.velocity_ned[:, 0])
    data = []
    for i, t in enumerate(flown.time):
        us = round((t - BOOT_S) * 1e6)
        place = (flown.lat[i], flown.lon[i], flown.altitude[i] - 48, flown.altitude[i])
        rest = (0.2, 1.5, 2.5, *flown.velocity_ned[i], True, 3)
        data.append((0, struct.pack('<QQ4d3f3f?B', us, round(t * 1e6), *place, *rest)))
        q = (*np.array(frames.quaternion_from_euler(0.3, -0.1, yaw[i])), 7)
        data.append((1, struct.pack('<Q4fB', us, *q[:4], q[4])))
    formats = {
        'vehicle_gps_position': GPS_NEW,
        'vehicle_attitude': 'uint64_t timestamp;float[4] q;uint8_t quat_reset_counter;',
    }
    track = read_track(ulog(tmp_path / 'attitude.ulg', formats, data))
    assert track.warnings[-1] == 'attitude is that of vehicle_attitude'
    angles = frames.euler_from_rotation(frames.rotation_from_quaternion(tuple(track.attitude.T)))
    # the quaternions are in single precision
    np.testing.assert_allclose(angles[0], 0.3, rtol=0, atol=1e-6)
    np.testing.assert_allclose(angles[1], -0.1, rtol=0, atol=1e-6)
    difference = (angles[2] - yaw + np.pi) % (2 * np.pi) - np.pi
    np.testing.assert_allclose(difference, 0, rtol=0, atol=1e-6)


def test_local_position_takes_its_date_from_the_receiver(tmp_path: Path) -> None:
    data = []
    for i in range(30):
        us = i * 100_000
        data.append((0, struct.pack('<Q6f??', us, i, 2 * i, -3 * i, 10, 20, -30, True, i > 4)))
    path = ulog(tmp_path / 'local.ulg', {'vehicle_local_position': LOCAL}, data)
    track = read_track(path)
    assert (track.altitude_datum, track.dropped) == ('local', {'position not valid': 5})
    np.testing.assert_array_equal(track.position_ned[0], [5, 10, -15])
    assert track.time_ns[0] == 500_000_000
    gps = struct.pack('<QQ4i3f3f?B', 0, START_S * 10**6, 1, 1, 1, 1, *[0] * 6, True, 3)
    formats = {'vehicle_local_position': LOCAL, 'vehicle_gps_position': GPS_OLD}
    ulog(path, formats, [*data, (1, gps)])
    assert read_track(path, 'vehicle_local_position').time_ns[0] == START_S * 10**9 + 500_000_000


def test_info_lists_the_topics(tmp_path: Path) -> None:
    info = describe(circle_ulog(tmp_path / 'circle.ulg'))
    assert (info.format, info.library) == ('PX4 ULog', 'PX4')
    assert [(s.topic, s.kind, s.messages) for s in info.sources] == [
        ('vehicle_gps_position', 'gnss', 600)
    ]


def test_a_log_without_a_fix_or_without_positions_says_so(tmp_path: Path) -> None:
    with pytest.raises(LogError, match='600 no 3D fix'):
        read_track(circle_ulog(tmp_path / 'none.ulg', fix_type=2))
    with pytest.raises(LogError, match='has none of sensor_gps'):
        read_track(ulog(tmp_path / 'other.ulg', {'battery': 'uint64_t timestamp;'}, []))


@pytest.mark.filterwarnings('ignore:overflow')  # numbers of any size come out
def test_damage_anywhere_is_one_line_or_a_track(tmp_path: Path, capsys: Any) -> None:
    path = circle_ulog(tmp_path / 'circle.ulg')
    whole = path.read_bytes()
    chance = np.random.default_rng(2)
    for round_ in range(60):
        data = np.frombuffer(whole, np.uint8).copy()
        at = chance.integers(8, 2000 if round_ % 2 else data.size, 20)
        data[at] = chance.integers(0, 256, 20)
        path.write_bytes(data[: chance.integers(30, data.size)].tobytes())
        message_ = ''
        try:
            read_track(path)
        except LogError as error:
            message_ = str(error)
        assert len(message_.splitlines()) <= 1
    assert capsys.readouterr().out == ''


def test_without_pyulog_the_extra_is_named(tmp_path: Path, monkeypatch: Any) -> None:
    path = circle_ulog(tmp_path / 'circle.ulg')
    monkeypatch.setitem(sys.modules, 'pyulog', None)
    with pytest.raises(MissingExtraError, match=r'flightdyn\[ulog\]'):
        read_track(path)
