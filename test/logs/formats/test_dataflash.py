"""ArduPilot's .bin: self-described messages, GPS time, instances, damage."""

import struct
from pathlib import Path

import numpy as np
import pytest
from flown_circle import CLIMB, SPEED, START_S, circle, flown_speed

from flightdyn.errors import LogError
from flightdyn.logs.any_log import describe, read_track

FMT, GPS, POS = 0x80, 0x81, 0x82
GPS_LABELS = 'TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ'
LEAP_S = 18  # since 2017


def fmt(number: int, name: str, codes: str, labels: str, size: int) -> bytes:
    body = struct.pack('<BB4s16s64s', number, size, name.encode(), codes.encode(), labels.encode())
    return b'\xa3\x95' + bytes([FMT]) + body


def gps(boot_s: float, unix_s: float, i: int, status: int, *place: float) -> bytes:
    week, second = divmod(unix_s + LEAP_S - 315_964_800, 604_800)
    lat, lon, alt, speed, course, down = place
    ints = (round(boot_s * 1e6), i, status, round(second * 1e3), int(week), 12, 80)
    position = (round(lat * 1e7), round(lon * 1e7), round(alt * 100))
    body = struct.pack('<QBBIHBhiiifff', *ints, *position, speed, course, down)
    return b'\xa3\x95' + bytes([GPS]) + body


HEAD = (
    fmt(FMT, 'FMT', 'BBnNZ', 'Type,Length,Name,Format,Columns', 89)
    + fmt(GPS, 'GPS', 'QBBIHBcLLefff', GPS_LABELS, 3 + 43)
    + fmt(POS, 'POS', 'QLLf', 'TimeUS,Lat,Lng,Alt', 3 + 20)
)


def circle_log(first_status: int = 1) -> bytes:
    flown = circle(rate=5)
    data = HEAD
    for i, t in enumerate(flown.time):
        north, east, down = flown.velocity_ned[i]
        course = np.degrees(np.arctan2(east, north)) % 360
        place = (flown.lat[i], flown.lon[i], flown.altitude[i])
        status = 3 if i else first_status
        data += gps(t - START_S + 7, t, 0, status, *place, np.hypot(north, east), course, down)
        ints = (round((t - START_S + 7) * 1e6), round(place[0] * 1e7), round(place[1] * 1e7))
        data += b'\xa3\x95' + bytes([POS]) + struct.pack('<Qiif', *ints, place[2])
    return data


@pytest.fixture
def circle_bin(tmp_path: Path) -> Path:
    path = tmp_path / 'circle.bin'
    path.write_bytes(circle_log())
    return path


def test_a_circle_is_replayed_at_its_speed(circle_bin: Path) -> None:
    speed, climb = flown_speed(circle_bin)
    assert speed == pytest.approx(SPEED, rel=2e-3)
    assert climb == pytest.approx(CLIMB, abs=0.02)
    track, flown = read_track(circle_bin), circle(rate=5)
    assert (track.source, track.altitude_datum) == ('GPS/0', 'msl')
    assert track.dropped == {'no fix': 1}
    np.testing.assert_allclose(track.time_ns / 1e9, flown.time[1:], rtol=0, atol=1e-3)
    np.testing.assert_allclose(track.velocity_ned, flown.velocity_ned[1:], rtol=0, atol=1e-4)
    np.testing.assert_allclose(track.altitude, flown.altitude[1:], rtol=0, atol=0.0051)


def test_the_estimators_position_is_the_second_choice(circle_bin: Path) -> None:
    assert [(s.topic, s.kind, s.messages) for s in describe(circle_bin).sources] == [
        ('GPS/0', 'gnss', 600),
        ('POS', 'global', 600),
    ]
    fused = read_track(circle_bin, 'POS')
    assert fused.time_ns[0] == START_S * 10**9


def test_receivers_are_kept_apart(tmp_path: Path) -> None:
    rows = [gps(i, START_S + i, i % 2, 3, 48 + i % 2, 9, 500, 0, 0, 0) for i in range(10)]
    path = tmp_path / 'two.bin'
    path.write_bytes(HEAD + b''.join(rows))
    assert set(read_track(path, 'GPS/1').lat) == {49.0}
    assert len(read_track(path, 'GPS/0')) == 5


def test_noise_and_a_cut_are_counted_by_byte(circle_bin: Path) -> None:
    data = circle_log()
    circle_bin.write_bytes(data[: len(HEAD)] + b'\xa3\x95\xff noise' + data[len(HEAD) : -5])
    track = read_track(circle_bin)
    assert len(track) == 599
    noise = f'9 bytes that are no message, first at byte {len(HEAD)}'
    assert any(noise in warning for warning in track.warnings)
    assert any('cut short' in warning for warning in track.warnings)


def test_without_positions_the_messages_are_named(tmp_path: Path) -> None:
    path = tmp_path / 'bench.bin'
    path.write_bytes(HEAD)
    with pytest.raises(LogError, match='no GPS or POS'):
        read_track(path)


def test_damage_anywhere_is_one_line_or_a_track(circle_bin: Path) -> None:
    whole = circle_bin.read_bytes()
    chance = np.random.default_rng(4)
    for round_ in range(60):
        data = np.frombuffer(whole, np.uint8).copy()
        at = chance.integers(2, 400 if round_ % 2 else data.size, 10)
        data[at] = chance.integers(0, 256, 10)
        circle_bin.write_bytes(data[: chance.integers(30, data.size)].tobytes())
        message = ''
        try:
            read_track(circle_bin)
        except LogError as error:
            message = str(error)
        assert len(message.splitlines()) <= 1


def test_the_log_says_the_same_to_pymavlink(circle_bin: Path) -> None:
    reader = pytest.importorskip('pymavlink.DFReader')
    log = reader.DFReader_binary(str(circle_bin))
    theirs = []
    while (message := log.recv_match(type='GPS')) is not None:
        theirs.append((message._timestamp, message.Lat, message.Lng, message.Alt, message.Spd))
    log.close()
    time, lat, lon, altitude, speed = np.array(theirs)[1:].T
    track = read_track(circle_bin)
    np.testing.assert_allclose(track.time_ns / 1e9, time, rtol=0, atol=1e-3)
    np.testing.assert_allclose(track.lat, lat, rtol=0, atol=1e-12)
    np.testing.assert_allclose(track.lon, lon, rtol=0, atol=1e-12)
    np.testing.assert_allclose(track.altitude, altitude, rtol=0, atol=1e-9)
    np.testing.assert_allclose(np.hypot(*track.velocity_ned[:, :2].T), speed, rtol=1e-6)
