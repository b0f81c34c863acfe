"""Receivers' own messages: GPSFix, u-blox NAV-PVT in three spellings, GPSRAW, NMEA sentences."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from log_making import START_NS, Message, fixes, stamp
from numpy.testing import assert_allclose, assert_array_equal
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from flightdyn.errors import LogError
from flightdyn.logs import list_sources, nmea, read_track
from flightdyn.replay import replay_log

Write = Callable[..., Path]
FIX = 'sensor_msgs/msg/NavSatFix'
HEADER = """
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""

GPS_FIX = """std_msgs/Header header
gps_msgs/GPSStatus status
float64 latitude
float64 longitude
float64 altitude
float64 track
float64 speed
float64 climb
float64 err_speed
float64 err_climb
float64[9] position_covariance
uint8 position_covariance_type
================================================================================
MSG: gps_msgs/GPSStatus
int32[] satellite_used_prn
int16 status
"""
PVT_DATE = """uint16 year
uint8 month
uint8 day
uint8 hour
uint8 min
uint8 sec
int32 nano
"""
PVT_TAIL = """int32 lon
int32 lat
int32 height
"""
NAV_PVT = {
    'snake': (
        'ublox_msgs/msg/NavPVT',
        PVT_DATE
        + 'uint8 valid\nuint8 fix_type\nuint8 flags\n'
        + PVT_TAIL
        + 'int32 h_msl\nuint32 h_acc\nuint32 v_acc\n'
        'int32 vel_n\nint32 vel_e\nint32 vel_d\nuint32 s_acc\n',
    ),
    'camel': (
        'ublox_msgs/msg/NavPVT',
        PVT_DATE
        + 'uint8 valid\nuint8 fixType\nuint8 flags\n'
        + PVT_TAIL
        + 'int32 hMSL\nuint32 hAcc\nuint32 vAcc\n'
        'int32 velN\nint32 velE\nint32 velD\nuint32 sAcc\n',
    ),
    'ubx': (
        'ublox_ubx_msgs/msg/UBXNavPVT',
        'std_msgs/Header header\n'
        + PVT_DATE
        + 'ublox_ubx_msgs/GpsFix gps_fix\nbool gnss_fix_ok\n'
        + PVT_TAIL
        + 'int32 hmsl\nuint32 h_acc\nuint32 v_acc\n'
        'int32 vel_n\nint32 vel_e\nint32 vel_d\nuint32 s_acc\nbool invalid_llh\n'
        + '=' * 80
        + '\nMSG: ublox_ubx_msgs/GpsFix\nuint8 fix_type\n',
    ),
}
GPS_RAW = """std_msgs/Header header
uint8 fix_type
int32 lat
int32 lon
int32 alt
uint16 vel
uint16 cog
int32 alt_ellipsoid
uint32 h_acc
uint32 v_acc
"""


def recorded(write: Write, type_: str, text: str, rows: list[dict[str, Any]]) -> Path:
    """Rows of fields at one a second; what a row does not give is zero."""
    text += HEADER if 'std_msgs' in text else ''
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(text, type_))
    messages: list[Message] = []
    for i, row in enumerate(rows):
        ns = START_NS + i * 10**9
        if 'std_msgs' in text:
            row = {'header': stamp(ns), **row}
        data = bytes(store.serialize_cdr(store.types[type_](**row), type_))
        messages.append(('/gps', ns, data))
    return write(messages, {'/gps': type_}, texts={type_: text.encode()})


def gps_fix(i: int, **changes: Any) -> dict[str, Any]:
    """10 m/s to 36.87 degrees, so 8 north and 6 east, climbing at 2."""
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(GPS_FIX + HEADER, 'gps_msgs/msg/GPSFix'))
    status = store.types['gps_msgs/msg/GPSStatus']
    return {
        'status': status(np.arange(i % 3, dtype=np.int32), changes.pop('status', 0)),
        'latitude': 48 + 8 * i / 111_200,
        'longitude': 9 + 6 * i / 74_680,
        'altitude': 500 + 2.0 * i,
        'track': np.degrees(np.arctan2(6, 8)),
        'speed': 10.0,
        'climb': 2.0,
        'err_speed': 0.5,
        'err_climb': 1.0,
        'position_covariance': np.diag([4.0, 9.0, 25.0]).ravel(),
        'position_covariance_type': 2,
        **changes,
    }


def test_gps_fix_has_speed_and_course(write_log: Write) -> None:
    rows = [gps_fix(i) for i in range(20)]
    rows[3] = gps_fix(3, status=-1)
    rows[5] = gps_fix(5, climb=float('nan'))
    track = read_track(recorded(write_log, 'gps_msgs/msg/GPSFix', GPS_FIX, rows))
    assert track.dropped == {'no fix': 1}
    assert track.velocity_ned is not None
    assert np.isnan(track.velocity_ned[4]).all()
    known = np.delete(track.velocity_ned, 4, axis=0)
    assert_allclose(known, np.tile([8.0, 6.0, -2.0], (18, 1)), rtol=0, atol=1e-12)
    assert_array_equal(track.velocity_std, np.tile([0.25, 0.25, 0.5], (19, 1)))  # 95 % is 2 sigma
    assert_array_equal(track.position_std, np.tile([3.0, 2.0, 5.0], (19, 1)))
    assert track.altitude_datum == 'unknown'
    assert 'does not say what its altitude is above' in track.warnings[0]


def test_a_speed_that_nobody_filled_is_not_used(write_log: Write) -> None:
    rows = [gps_fix(i, speed=0.0, climb=0.0, track=0.0) for i in range(20)]
    track = read_track(recorded(write_log, 'gps_msgs/msg/GPSFix', GPS_FIX, rows))
    assert track.velocity_ned is None


def nav_pvt(spelling: str, i: int, **changes: Any) -> dict[str, Any]:
    when = datetime.fromtimestamp(START_NS // 10**9 + i, tz=UTC)
    date = dict(
        zip(('year', 'month', 'day', 'hour', 'min', 'sec'), when.timetuple()[:6], strict=True)
    )
    row = {
        **date,
        'nano': -4000,  # u-blox rounds the second
        'lat': 480000000 + round(8 * i / 111_200 * 1e7),
        'lon': 90000000 + round(6 * i / 74_680 * 1e7),
        'height': 500_000 + 2000 * i,
        'h_msl': 452_000 + 2000 * i,
        'h_acc': 1500,
        'v_acc': 2500,
        'vel_n': 8000,
        'vel_e': 6000,
        'vel_d': -2000,
        's_acc': 250,
        'valid': 7,
        'fix_type': 3,
        'flags': 1,
        **changes,
    }
    if spelling == 'camel':
        names = {'h_msl': 'hMSL', 'fix_type': 'fixType'}
        names |= {f'{k}_acc': f'{k}Acc' for k in 'hvs'} | {
            f'vel_{k}': f'vel{k.upper()}' for k in 'ned'
        }
        return {names.get(name, name): value for name, value in row.items()}
    if spelling == 'ubx':
        type_, text = NAV_PVT['ubx']
        store = get_typestore(Stores.EMPTY)
        store.register(get_types_from_msg(text + HEADER, type_))
        fix = store.types['ublox_ubx_msgs/msg/GpsFix'](row.pop('fix_type'))
        del row['valid']
        row |= {'gps_fix': fix, 'gnss_fix_ok': bool(row.pop('flags') & 1), 'invalid_llh': False}
        row['hmsl'] = row.pop('h_msl')
    return row


@pytest.mark.parametrize('spelling', list(NAV_PVT))
def test_nav_pvt_in_every_spelling(write_log: Write, spelling: str) -> None:
    rows = [nav_pvt(spelling, i) for i in range(20)]
    rows[2] = nav_pvt(spelling, 2, flags=2)
    rows[4] = nav_pvt(spelling, 4, fix_type=2)
    rows[6] = nav_pvt(spelling, 6, fix_type=5)  # time only
    type_, text = NAV_PVT[spelling]
    track = read_track(recorded(write_log, type_, text, rows))
    kept = np.delete(np.arange(20), [2, 4, 6])
    assert track.dropped == {'no 3D fix': 3}
    assert_allclose(track.altitude, 500 + 2.0 * kept)
    assert_array_equal(track.velocity_ned, np.tile([8.0, 6.0, -2.0], (17, 1)))
    assert_array_equal(track.position_std, np.tile([1.5, 1.5, 2.5], (17, 1)))
    assert_array_equal(track.velocity_std, np.full((17, 3), 0.25))
    nano = 0 if spelling == 'ubx' else -4000
    assert_array_equal(track.time_ns, START_NS + kept * 10**9 + nano)
    assert track.altitude_datum == 'ellipsoid'


def test_nav_pvt_without_a_date_takes_the_recorders(write_log: Write) -> None:
    type_, text = NAV_PVT['snake']
    rows = [nav_pvt('snake', i, valid=0) for i in range(20)]
    track = read_track(recorded(write_log, type_, text, rows))
    assert_array_equal(track.time_ns, START_NS + np.arange(20) * 10**9)


@pytest.mark.parametrize(('ellipsoid', 'datum'), [(500_000, 'ellipsoid'), (0, 'msl')])
def test_gps_raw_comes_after_a_fix(write_log: Write, ellipsoid: int, datum: str) -> None:
    rows = [
        {
            'fix_type': 3 if i else 1,
            'lat': 480000000 + 900 * i,
            'lon': 90000000,
            'alt': 452_000,
            'vel': 1000,
            'cog': 65535,
            'alt_ellipsoid': ellipsoid,
            'h_acc': 1200,
            'v_acc': 2000,
        }
        for i in range(20)
    ]
    path = recorded(write_log, 'mavros_msgs/msg/GPSRAW', GPS_RAW, rows)
    track = read_track(path)
    assert track.dropped == {'no 3D fix': 1}
    assert track.altitude_datum == datum
    assert track.altitude is not None
    assert track.altitude[0] == (500 if ellipsoid else 452)
    assert_array_equal(track.position_std, np.tile([1.2, 1.2, 2.0], (19, 1)))
    assert [s.kind for s in list_sources(path)] == ['gps_raw']


SENTENCE = 'nmea_msgs/msg/Sentence'
SENTENCE_TEXT = 'std_msgs/Header header\nstring sentence\n'


def with_sum(body: str) -> str:
    total = 0
    for letter in body.encode():
        total ^= letter
    return f'${body}*{total:02X}\r\n'


def gga(
    when: datetime, lat: str = '4807.038,N', quality: int = 1, undulation: str = '46.9'
) -> str:
    return with_sum(
        f'GPGGA,{when:%H%M%S.%f},{lat},01131.000,E,{quality},08,0.9,545.4,M,{undulation},M,,'
    )


def rmc(when: datetime, status: str = 'A', lat: str = '4807.038,N') -> str:
    return with_sum(
        f'GPRMC,{when:%H%M%S.%f},{status},{lat},01131.000,E,022.4,084.4,{when:%d%m%y},003.1,W'
    )


def sentences(write: Write, texts: list[str]) -> Path:
    rows = [{'sentence': text} for text in texts]
    return recorded(write, SENTENCE, SENTENCE_TEXT, rows)


# The recorder's clock stands at START_NS (14 November 2023), the receiver's date is another.
MIDNIGHT = datetime(2021, 3, 1, tzinfo=UTC)


def test_nmea_positions_across_midnight(write_log: Write) -> None:
    texts = [rmc(MIDNIGHT - timedelta(seconds=6))]
    for i in range(-5, 5):
        texts.append(gga(MIDNIGHT + timedelta(seconds=i, milliseconds=200), f'48{i + 7:02}.5,S'))
    texts += [rmc(MIDNIGHT + timedelta(seconds=5)), with_sum('GPGSV,1,1,00')]
    texts += ['$GPGGA,broken*00', 'nothing', gga(MIDNIGHT, quality=0), with_sum('GPGGA,1,2')]
    track = read_track(sentences(write_log, texts))
    assert track.dropped == {
        'another NMEA sentence': 3,
        'no NMEA sentence or wrong checksum': 2,
        'no fix': 1,
        'not an NMEA position': 1,
    }
    first = int(MIDNIGHT.timestamp()) * 10**9 + 200_000_000
    assert_array_equal(track.time_ns, first + np.arange(-5, 5) * 10**9)
    assert_allclose(track.lat, -(48 + (np.arange(2, 12) + 0.5) / 60), rtol=0, atol=1e-12)
    assert_allclose(track.lon, 11 + 31 / 60, rtol=0, atol=1e-12)
    assert_allclose(track.altitude, 545.4 + 46.9)
    assert track.altitude_datum == 'ellipsoid'


def test_nmea_without_a_date_takes_the_recorders_day(write_log: Write) -> None:
    arrival = datetime.fromtimestamp(START_NS // 10**9, tz=UTC)
    texts = [
        gga(arrival + timedelta(seconds=i - 3), f'48{i:02}.5,N', undulation='') for i in range(9)
    ]
    texts.insert(0, rmc(MIDNIGHT, status='V'))
    track = read_track(sentences(write_log, texts))
    assert_array_equal(track.time_ns, START_NS + (np.arange(9) - 3) * 10**9)
    assert track.altitude_datum == 'msl'


@given(st.text(st.characters(max_codepoint=127), max_size=90))
def test_any_text_is_a_sentence_or_none(text: str) -> None:
    parts = nmea._parts(text)
    assert parts is None or text.startswith('$')


def test_without_a_gga_rmc_tells_the_place_and_no_altitude(write_log: Write) -> None:
    """Such logs were refused."""
    texts = [rmc(MIDNIGHT + timedelta(seconds=i), lat=f'48{i:02}.5,S') for i in range(9)]
    path = sentences(write_log, [*texts, rmc(MIDNIGHT, status='V'), with_sum('GPVTG,084.4,T')])
    track = read_track(path)
    assert track.dropped == {'another NMEA sentence': 1, 'no fix': 1}
    assert_allclose(track.lat, -(48 + (np.arange(9) + 0.5) / 60), rtol=0, atol=1e-12)
    assert_allclose(track.lon, 11 + 31 / 60, rtol=0, atol=1e-12)
    assert_array_equal(track.time_ns, (int(MIDNIGHT.timestamp()) + np.arange(9)) * 10**9)
    assert track.altitude_datum == 'unknown'
    assert 'no GGA: the altitude is unknown' in ' '.join(track.warnings)
    replay = replay_log(path)
    assert 'no altitude in the log: taken as 0' in replay.summary()['warnings']
    assert_allclose(replay.trajectory['altitude'], 0.0, atol=1e-6)


def test_a_log_without_positions_says_what_it_has(write_log: Write) -> None:
    path = sentences(write_log, [with_sum('GPVTG,084.4,T') for i in range(9)])
    with pytest.raises(LogError, match=r'0 usable of 9 messages \(9 another NMEA sentence\)'):
        read_track(path)


def test_a_receiver_with_velocity_is_preferred_to_a_fix(write_log: Write) -> None:
    type_, text = NAV_PVT['snake']
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(text, type_))
    pvt = [
        (
            '/ublox/navpvt',
            START_NS + i * 10**9,
            bytes(store.serialize_cdr(store.types[type_](**nav_pvt('snake', i)), type_)),
        )
        for i in range(12)
    ]
    path = write_log(
        fixes(20) + pvt, {'/fix': FIX, '/ublox/navpvt': type_}, texts={type_: text.encode()}
    )
    assert [(s.topic, s.kind) for s in list_sources(path)] == [
        ('/ublox/navpvt', 'gnss'),
        ('/fix', 'fix'),
    ]
    track = read_track(path)
    assert track.warnings == ['/ublox/navpvt was taken of 2 usable sources; others: /fix']
