"""MAVLink telemetry: frames of both versions, several systems, damage."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flown_circle import CLIMB, SPEED, START_S, circle, flown_speed

from flightdyn.errors import LogError
from flightdyn.logs.any_log import describe, read_track
from flightdyn.logs.mavlink import checksum

GLOBAL, RAW, HEARTBEAT = 33, 24, 0
SEEDS = {GLOBAL: 104, RAW: 24, HEARTBEAT: 50}


def frame(
    second: float, number: int, payload: bytes, *, system: int = 1, version: int = 2
) -> bytes:
    if version == 1:
        head = struct.pack('<BBBBBB', 0xFE, len(payload), 0, system, 1, number)
    else:
        payload = payload.rstrip(b'\0') or b'\0'
        ids = (0, system, 1, number & 0xFF, number >> 8 & 0xFF, number >> 16)
        head = struct.pack('<BBBB6B', 0xFD, len(payload), 0, 0, *ids)
    crc = checksum(head[1:] + payload + bytes([SEEDS[number]]))
    return struct.pack('>Q', round(second * 1e6)) + head + payload + struct.pack('<H', crc)


def position(boot_s: float, lat: float, lon: float, alt: float, velocity: Any) -> bytes:
    ints = (round(boot_s * 1e3), round(lat * 1e7), round(lon * 1e7), round(alt * 1e3), 0)
    return struct.pack('<Iiiii3hH', *ints, *(round(v * 100) for v in velocity), 0)


def circle_frames(version: int = 2, system: int = 1, late: Any = None) -> list[bytes]:
    flown = circle(rate=4)
    frames = []
    for i, t in enumerate(flown.time):
        place = (flown.lat[i], flown.lon[i], flown.altitude[i], flown.velocity_ned[i])
        payload = position(t - START_S + 5, *place)
        arrival = t if late is None else t + late[i]
        frames.append(frame(arrival, GLOBAL, payload, system=system, version=version))
        frames.append(frame(arrival, HEARTBEAT, bytes(9), system=255, version=version))
    return frames


@pytest.fixture
def circle_tlog(tmp_path: Path) -> Path:
    path = tmp_path / 'circle.tlog'
    path.write_bytes(b''.join(circle_frames()))
    return path


def test_checksum_of_the_published_check_value() -> None:
    assert checksum(b'123456789') == 0x6F91  # CRC-16/MCRF4XX


@pytest.mark.parametrize('version', [1, 2])
def test_a_circle_is_replayed_at_its_speed(tmp_path: Path, version: int) -> None:
    path = tmp_path / 'circle.tlog'
    path.write_bytes(b''.join(circle_frames(version)))
    speed, climb = flown_speed(path)
    assert speed == pytest.approx(SPEED, rel=2e-3)
    assert climb == pytest.approx(CLIMB, abs=0.01)
    track, flown = read_track(path), circle(rate=4)
    assert track.source == 'mavlink/1/1/GLOBAL_POSITION_INT'
    assert track.altitude_datum == 'msl'
    np.testing.assert_allclose(track.velocity_ned, flown.velocity_ned, rtol=0, atol=0.0051)


def test_late_arrival_does_not_move_samples(tmp_path: Path) -> None:
    late = np.random.default_rng(3).exponential(0.1, 480)
    path = tmp_path / 'late.tlog'
    path.write_bytes(b''.join(circle_frames(late=late)))
    track = read_track(path)
    assert (np.diff(track.time_ns) == 250_000_000).all()
    # the least delay counts as none; of 480 exponential ones a fiftieth is below 2 ms
    assert 0 <= track.time_ns[0] * 1e-9 - START_S < 0.004


def test_systems_are_kept_apart(tmp_path: Path) -> None:
    path = tmp_path / 'two.tlog'
    path.write_bytes(b''.join(circle_frames() + circle_frames(system=7)[:100]))
    assert [(s.topic, s.messages) for s in describe(path).sources] == [
        ('mavlink/1/1/GLOBAL_POSITION_INT', 480),
        ('mavlink/7/1/GLOBAL_POSITION_INT', 50),
    ]
    assert len(read_track(path, 'mavlink/7/1/GLOBAL_POSITION_INT')) == 50


def test_raw_fixes_below_three_dimensions_are_dropped(tmp_path: Path) -> None:
    frames = []
    for i in range(6):
        fix = 2 if i == 2 else 3
        numbers = (i * 10**6, 480000000 + 1000 * i, 90000000, 500_000, 120, 150, 10, 0, fix, 9)
        accuracy = struct.pack('<iII', 548_000, 1500, 2500)
        frames.append(frame(START_S + i, RAW, struct.pack('<QiiiHHHHBB', *numbers) + accuracy))
    path = tmp_path / 'raw.tlog'
    path.write_bytes(b''.join(frames))
    track = read_track(path)
    assert track.dropped == {'no 3D fix': 1}
    assert track.altitude_datum == 'ellipsoid'
    np.testing.assert_allclose(track.position_std[0], [1.5, 1.5, 2.5])
    assert track.time_ns[0] == START_S * 10**9


def test_damaged_frames_are_left_out_and_counted(circle_tlog: Path) -> None:
    data = bytearray(circle_tlog.read_bytes())
    data[30] ^= 0xFF
    circle_tlog.write_bytes(data[:-40])
    track = read_track(circle_tlog)
    assert 470 < len(track) < 480
    assert any('wrong checksum, first at byte 0' in warning for warning in track.warnings)
    assert any('cut short' in warning for warning in track.warnings)


def test_noise_between_frames_is_skipped(circle_tlog: Path) -> None:
    frames = circle_frames()
    circle_tlog.write_bytes(b''.join([*frames[:20], b'noise' * 9, *frames[20:]]))
    track = read_track(circle_tlog)
    assert len(track) == 480
    where = len(b''.join(frames[:20]))
    noise = f'45 bytes that are no MAVLink, first at byte {where}'
    assert any(noise in warning for warning in track.warnings)


def test_a_log_without_positions_says_whose_it_is(tmp_path: Path) -> None:
    path = tmp_path / 'idle.tlog'
    path.write_bytes(b''.join(frame(START_S + i, HEARTBEAT, bytes(9)) for i in range(5)))
    with pytest.raises(
        LogError, match=r'no GPS_RAW_INT or .*GLOBAL_POSITION_INT .* systems in it: 1'
    ):
        read_track(path)


def test_frames_are_those_of_pymavlink(tmp_path: Path) -> None:
    mavlink = pytest.importorskip('pymavlink.dialects.v20.ardupilotmega')
    sender = mavlink.MAVLink(None, srcSystem=3, srcComponent=1)
    frames = []
    for i in range(5):
        sent = mavlink.MAVLink_global_position_int_message(
            1000 * i, 480000000 + i, -90000000, 500_000 + i, 20_000, 100, -200, 300, 9000
        ).pack(sender)
        frames.append(struct.pack('>Q', (START_S + i) * 10**6) + sent)
        raw = mavlink.MAVLink_gps_raw_int_message(
            10**6 * i, 3, 480000000 + i, -90000000, 500_000, 1, 2, 3, 4, 5, 1, 1500, 2500, 0, 0, 0
        ).pack(sender)
        frames.append(struct.pack('>Q', (START_S + i) * 10**6) + raw)
    path = tmp_path / 'theirs.tlog'
    path.write_bytes(b''.join(frames))
    track = read_track(path, 'mavlink/3/1/GLOBAL_POSITION_INT')
    np.testing.assert_allclose(track.velocity_ned, np.tile([1, -2, 3], (5, 1)))
    np.testing.assert_allclose(track.lat, 48 + 1e-7 * np.arange(5), rtol=0, atol=1e-12)
    np.testing.assert_allclose(track.altitude, 500 + 1e-3 * np.arange(5))
    track = read_track(path, 'mavlink/3/1/GPS_RAW_INT')
    np.testing.assert_allclose(track.position_std[0], [1.5, 1.5, 2.5])
