"""PX4's topics: units by field names, clocks, resets; four recordings of one real flight."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_making import START_NS, Message
from numpy.testing import assert_allclose, assert_array_equal
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from flightdyn.environment.geodesy import GeodeticPoint, ned_from_geodetic
from flightdyn.errors import LogError
from flightdyn.logs import list_sources, read_track
from flightdyn.logs.kinds import kind_named

Write = Callable[..., Path]
DATA = Path(__file__).parents[1] / 'data'
BOOT_NS = 77 * 10**9  # the autopilot has run for this long when a log begins

NEW_GPS = """uint64 timestamp
float64 latitude_deg
float64 longitude_deg
float64 altitude_msl_m
float64 altitude_ellipsoid_m
float32 s_variance_m_s
uint8 fix_type
float32 eph
float32 epv
float32 vel_n_m_s
float32 vel_e_m_s
float32 vel_d_m_s
bool vel_ned_valid
uint64 time_utc_usec
"""
OLD_GPS = NEW_GPS.replace('float64', 'int32').replace('latitude_deg', 'lat')
OLD_GPS = OLD_GPS.replace('longitude_deg', 'lon').replace('altitude_msl_m', 'alt')
OLD_GPS = OLD_GPS.replace('altitude_ellipsoid_m', 'alt_ellipsoid')
GLOBAL = """uint64 timestamp
float64 lat
float64 lon
float32 alt
float32 alt_ellipsoid
bool lat_lon_valid
bool alt_valid
uint8 lat_lon_reset_counter
"""
LOCAL = """uint64 timestamp
bool xy_valid
bool z_valid
bool v_xy_valid
bool v_z_valid
float32 x
float32 y
float32 z
uint8 xy_reset_counter
float32 vx
float32 vy
float32 vz
bool xy_global
bool z_global
float64 ref_lat
float64 ref_lon
float32 ref_alt
"""


def recorded(
    write: Write, type_: str, text: str, rows: list[dict[str, Any]], **options: Any
) -> Path:
    """Rows of fields, one second apart; `log` is the recorder's time, else START_NS and on."""
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(text, type_))
    messages: list[Message] = []
    for i, row in enumerate(rows):
        values = dict(row)
        ns = values.pop('log', START_NS + i * 10**9)
        values.setdefault('timestamp', (BOOT_NS + i * 10**9) // 1000)
        message = store.types[type_](**values)
        messages.append(('/px4', ns, bytes(store.serialize_cdr(message, type_))))
    return write(messages, {'/px4': type_}, texts={type_: text.encode()}, **options)


def gps(i: int, **changes: Any) -> dict[str, Any]:
    """A climb to the north-east at 10 and 7 m/s, 3 m/s up."""
    return {
        'latitude_deg': 48 + i * 10 / 111194.0,
        'longitude_deg': 9 + i * 7 / 74600.0,
        'altitude_msl_m': 450 + 3.0 * i,
        'altitude_ellipsoid_m': 500 + 3.0 * i,
        's_variance_m_s': 0.25,
        'fix_type': 3,
        'eph': 1.5,
        'epv': 2.5,
        'vel_n_m_s': 10.0,
        'vel_e_m_s': 7.0,
        'vel_d_m_s': -3.0,
        'vel_ned_valid': True,
        'time_utc_usec': 0,
        **changes,
    }


def in_integers(row: dict[str, Any]) -> dict[str, Any]:
    old = {k: v for k, v in row.items() if 'tude' not in k}
    return {
        **old,
        'lat': round(row['latitude_deg'] * 1e7),
        'lon': round(row['longitude_deg'] * 1e7),
        'alt': round(row['altitude_msl_m'] * 1e3),
        'alt_ellipsoid': round(row['altitude_ellipsoid_m'] * 1e3),
    }


def test_units_are_told_by_field_names(write_log: Write) -> None:
    rows = [gps(i) for i in range(20)]
    new = read_track(recorded(write_log, 'px4_msgs/msg/SensorGps', NEW_GPS, rows))
    old_rows = [in_integers(row) for row in rows]
    old = read_track(
        recorded(write_log, 'px4_msgs/msg/SensorGps', OLD_GPS, old_rows, name='old.mcap')
    )
    assert_allclose(new.lat, [r['latitude_deg'] for r in rows], rtol=0, atol=0)
    # half a unit of 1e-7 deg and of a millimetre
    assert_allclose(old.lat, new.lat, rtol=0, atol=0.51e-7)
    assert_allclose(old.lon, new.lon, rtol=0, atol=0.51e-7)
    assert_allclose(old.altitude, new.altitude, rtol=0, atol=0.51e-3)
    for track in (new, old):
        assert track.altitude_datum == 'ellipsoid'
        assert_array_equal(track.velocity_ned, np.tile([10.0, 7.0, -3.0], (20, 1)))
        assert_array_equal(track.position_std, np.tile([1.5, 1.5, 2.5], (20, 1)))
        assert_array_equal(track.velocity_std, np.full((20, 3), 0.25))
        # the autopilot's count, put on the recorder's date
        assert_array_equal(track.time_ns, START_NS + np.arange(20) * 10**9)


def test_positions_without_a_3d_fix_are_dropped(write_log: Write) -> None:
    rows = [gps(i, fix_type=2 if i < 4 else 3) for i in range(20)]
    rows[7] = gps(7, latitude_deg=0.0, longitude_deg=0.0)
    track = read_track(recorded(write_log, 'px4_msgs/msg/SensorGps', NEW_GPS, rows))
    assert track.dropped == {'no 3D fix': 4, 'position 0 N 0 E': 1}


def test_velocity_that_is_not_valid_is_none(write_log: Write) -> None:
    rows = [gps(i, vel_ned_valid=i % 4 > 0) for i in range(20)]
    track = read_track(recorded(write_log, 'px4_msgs/msg/SensorGps', NEW_GPS, rows))
    assert track.velocity_ned is not None
    assert_array_equal(np.isfinite(track.velocity_ned[:, 0]), np.arange(20) % 4 > 0)


def test_velocity_down_as_up_is_not_used(write_log: Write) -> None:
    # 2 m/s of error hide in a limit of a quarter of the speed, the sign does not
    rows = [gps(i, vel_d_m_s=1.0, altitude_ellipsoid_m=500.0 + i) for i in range(20)]
    track = read_track(recorded(write_log, 'px4_msgs/msg/SensorGps', NEW_GPS, rows))
    assert track.velocity_ned is None
    assert any('a vertical part of the wrong sign' in text for text in track.warnings)


def test_altitude_is_above_the_sea_where_the_receiver_knows_no_other(write_log: Write) -> None:
    rows = [gps(i, altitude_ellipsoid_m=0.0) for i in range(20)]
    track = read_track(recorded(write_log, 'px4_msgs/msg/SensorGps', NEW_GPS, rows))
    assert (track.altitude_datum, track.altitude[0]) == ('msl', 450.0)  # type: ignore[index]


def test_a_synchronised_stamp_is_taken_as_it_is(write_log: Write) -> None:
    times = [(START_NS + i * 10**9 - 12345000) // 1000 for i in range(20)]
    rows = [gps(i, timestamp=times[i]) for i in range(20)]
    track = read_track(recorded(write_log, 'px4_msgs/msg/SensorGps', NEW_GPS, rows))
    assert_array_equal(track.time_ns, np.array(times) * 1000)


def test_synchronisation_in_the_middle_of_a_log_breaks_nothing(write_log: Write) -> None:
    times = [(START_NS if i >= 8 else BOOT_NS) // 1000 + i * 10**6 for i in range(20)]
    rows = [gps(i, timestamp=times[i]) for i in range(20)]
    track = read_track(recorded(write_log, 'px4_msgs/msg/SensorGps', NEW_GPS, rows))
    assert_array_equal(track.time_ns, START_NS + np.arange(20) * 10**9)
    assert set(track.segment) == {0}


def test_delays_on_the_way_do_not_enter_the_times(write_log: Write) -> None:
    delay = [0, 0, 0, 400, 0, 0, 90, 0, 0, 0, 700, 0, 0, 0, 0, 0, 0, 0, 0, 0]  # ms
    rows = [gps(i, log=START_NS + i * 10**9 + d * 10**6) for i, d in enumerate(delay)]
    track = read_track(recorded(write_log, 'px4_msgs/msg/SensorGps', NEW_GPS, rows))
    assert_array_equal(track.time_ns, START_NS + np.arange(20) * 10**9)


def test_a_restart_of_the_autopilot_keeps_the_date(write_log: Write) -> None:
    rows = [gps(i) for i in range(20)]
    for i, row in enumerate(rows):
        row['timestamp'] = (i if i < 12 else i - 11) * 10**6 + 5
    track = read_track(recorded(write_log, 'px4_msgs/msg/SensorGps', NEW_GPS, rows))
    assert_array_equal(track.time_ns, START_NS + np.arange(20) * 10**9)


def test_the_receivers_date_is_taken_where_the_recorder_has_none(write_log: Write) -> None:
    utc = [(START_NS + i * 10**9 + (-1) ** i * 1000) // 1000 for i in range(20)]
    rows = [gps(i, log=BOOT_NS + i * 10**9, time_utc_usec=utc[i]) for i in range(20)]
    track = read_track(recorded(write_log, 'px4_msgs/msg/SensorGps', NEW_GPS, rows))
    assert_allclose(track.time_ns - START_NS, np.arange(20) * 1e9, rtol=0, atol=1000)
    assert_array_equal(np.diff(track.time_ns), 10**9)
    assert any("the date is the receiver's" in text for text in track.warnings)
    nowhere = [gps(i, log=BOOT_NS + i * 10**9) for i in range(20)]
    path = recorded(write_log, 'px4_msgs/msg/SensorGps', NEW_GPS, nowhere, name='none.mcap')
    track = read_track(path)
    assert track.time_ns[0] == BOOT_NS
    assert any('does not say the date' in text for text in track.warnings)


def global_row(i: int, **changes: Any) -> dict[str, Any]:
    row = {'lat': 48 + 1e-4 * i, 'lon': 9.0, 'alt': 450.0, 'alt_ellipsoid': 498.0}
    valid = {'lat_lon_valid': True, 'alt_valid': True, 'lat_lon_reset_counter': 1}
    return {**row, **valid, **changes}


def test_global_position_begins_anew_where_the_estimator_was_reset(write_log: Write) -> None:
    rows = [global_row(i, lat_lon_reset_counter=1 + (i >= 9)) for i in range(20)]
    rows[3] = global_row(3, lat_lon_valid=False)
    track = read_track(recorded(write_log, 'px4_msgs/msg/VehicleGlobalPosition', GLOBAL, rows))
    assert track.dropped == {'position not valid': 1}
    assert_array_equal(track.segment, [0] * 8 + [1] * 11)
    assert track.altitude_datum == 'ellipsoid'
    assert any('anew 1 times' in text for text in track.warnings)


def local_row(i: int, **changes: Any) -> dict[str, Any]:
    flags = ('xy_valid', 'z_valid', 'v_xy_valid', 'v_z_valid', 'xy_global', 'z_global')
    return {
        **dict.fromkeys(flags, True),
        'x': 10.0 * i,
        'y': 7.0 * i,
        'z': -3.0 * i,
        'vx': 10.0,
        'vy': 7.0,
        'vz': -3.0,
        'xy_reset_counter': 2,
        'ref_lat': 47.0,
        'ref_lon': 8.0,
        'ref_alt': 420.0,
        **changes,
    }


VERSIONED = pytest.mark.parametrize('text', [LOCAL, 'uint32 MESSAGE_VERSION = 1\n' + LOCAL])


@VERSIONED
def test_local_position_is_metres_from_its_reference(write_log: Write, text: str) -> None:
    rows = [local_row(i) for i in range(20)]
    track = read_track(recorded(write_log, 'px4_msgs/msg/VehicleLocalPosition', text, rows))
    i = np.arange(20.0)
    assert_allclose(track.position_ned, np.stack((10 * i, 7 * i, -3 * i), 1))
    assert track.origin == GeodeticPoint(47.0, 8.0, 420.0)
    assert track.altitude_datum == 'msl'  # ref_alt is
    assert track.velocity_ned is not None


def test_local_position_before_and_between_what_is_valid(write_log: Write) -> None:
    nan = float('nan')
    rows = [local_row(i) for i in range(30)]
    for i in range(4):
        rows[i] = local_row(i, ref_lat=nan, ref_lon=nan, ref_alt=nan, xy_global=False)
    rows[0]['xy_valid'] = False
    rows[9]['z_valid'] = False
    rows[12]['v_xy_valid'] = False
    for row in rows[20:]:
        row['xy_reset_counter'] = 3
    track = read_track(recorded(write_log, 'px4_msgs/msg/VehicleLocalPosition', LOCAL, rows))
    assert track.dropped == {'position not valid': 2, 'no origin yet': 3}
    assert_array_equal(np.flatnonzero(np.diff(track.segment)), [14])  # rows 4 to 19 but one
    assert track.velocity_ned is not None
    assert np.isnan(track.velocity_ned[7]).all()


def test_an_origin_that_moves_moves_no_position(write_log: Write) -> None:
    first, second = GeodeticPoint(47.0, 8.0, 420.0), GeodeticPoint(47.001, 8.002, 425.0)
    shift = np.stack(ned_from_geodetic(second.lat, second.lon, second.altitude, first))
    rows = [local_row(i) for i in range(20)]
    for i in range(10, 20):
        x, y, z = np.array([10.0 * i, 7.0 * i, -3.0 * i]) - shift
        new = {'ref_lat': second.lat, 'ref_lon': second.lon, 'ref_alt': second.altitude}
        rows[i] = local_row(i, x=x, y=y, z=z, **new)
    track = read_track(recorded(write_log, 'px4_msgs/msg/VehicleLocalPosition', LOCAL, rows))
    i = np.arange(20.0)
    # single-precision metres
    assert_allclose(track.position_ned, np.stack((10 * i, 7 * i, -3 * i), 1), atol=1e-4)


def test_local_position_indoors_says_that_there_is_no_gps(write_log: Write) -> None:
    nan = float('nan')
    off = {'ref_lat': nan, 'ref_lon': nan, 'ref_alt': nan, 'xy_global': False}
    rows = [local_row(i, **off) for i in range(20)]
    track = read_track(recorded(write_log, 'px4_msgs/msg/VehicleLocalPosition', LOCAL, rows))
    assert (track.origin, track.altitude_datum) == (None, 'local')
    assert any('no GPS' in text for text in track.warnings)
    lost = [local_row(i, xy_valid=False) for i in range(20)]
    path = recorded(write_log, 'px4_msgs/msg/VehicleLocalPosition', LOCAL, lost, name='lost.mcap')
    with pytest.raises(LogError, match=r'0 usable of 20 messages \(20 position not valid\)'):
        read_track(path)


def test_another_message_of_px4_is_no_position(write_log: Write) -> None:
    path = recorded(write_log, 'px4_msgs/msg/SensorGps', 'uint64 timestamp\nfloat32 eph\n', [])
    (source,) = list_sources(path)
    assert not source.usable
    assert 'has no field latitude_deg' in source.note


def test_a_real_estimator_that_was_reset_jumps_between_segments_only() -> None:
    track = read_track(DATA / 'px4_chicago_resets.mcap')
    assert track.dropped == {'position not valid': 16, 'no origin yet': 15}
    assert track.position_ned is not None
    assert track.velocity_ned is not None
    dt = np.diff(track.time_ns)[:, None] * 1e-9
    meant = 0.5 * dt * (track.velocity_ned[1:] + track.velocity_ned[:-1])
    jump = np.linalg.norm(np.diff(track.position_ned, axis=0) - meant, axis=1)
    within = np.diff(track.segment) == 0
    # The resets move it by up to 74 m; corrections without a reset stay below a metre.
    assert jump[within].max() < 1.0
    assert np.sum(jump[~within] > 1.0) >= 10


@pytest.mark.parametrize('encoding', ['px4msgs', 'ulog'])
def test_px4_topics_of_a_real_flight_agree(encoding: str) -> None:
    path = DATA / f'px4_zurich_{encoding}.mcap'
    truth = np.load(DATA / 'px4_zurich.truth.npz')
    kinds = [s.kind for s in list_sources(path) if s.usable]
    assert kinds == ['gnss', 'global', 'local']
    topics = [s.topic for s in list_sources(path)]
    gnss, fused, local = (read_track(path, topic) for topic in topics[:3])
    assert len(gnss) == 179
    # ulog2mcap drops the date; the receiver's own is within its 1 ms of jitter
    assert_allclose(gnss.time_ns - truth['t_unix_ns'], 0, rtol=0, atol=1e6)
    assert_allclose(gnss.lat, truth['lat'], rtol=0, atol=1e-9)
    assert_allclose(gnss.lon, truth['lon'], rtol=0, atol=1e-9)
    assert_allclose(gnss.altitude, truth['alt'], rtol=0, atol=1e-6)
    velocity = np.stack([truth[name] for name in ('vn', 've', 'vd')], axis=1)
    assert_allclose(gnss.velocity_ned, velocity, rtol=0, atol=1e-6)
    assert (gnss.altitude_datum, gnss.dropped) == ('ellipsoid', {})
    # The estimator's position is that of the receiver, within what both claim for their sigma.
    assert local.origin is not None
    near = ned_from_geodetic(fused.lat, fused.lon, fused.altitude, local.origin)  # type: ignore
    at = (fused.time_ns - local.time_ns[0]) * 1e-9
    there = (local.time_ns - local.time_ns[0]) * 1e-9
    inside = (at > 0) & (at < there[-1])
    for axis in range(2):
        along = np.interp(at, there, local.position_ned[:, axis])  # type: ignore[index]
        gap = np.abs(along - near[axis])[inside]
        assert np.percentile(gap, 90) < 0.5  # 0.12 s of linear interpolation at up to 6 m/s


@pytest.mark.parametrize(
    ('name', 'kind'),
    [
        ('px4_msgs/msg/VehicleLocalPosition', 'local'),
        ('px4_msgs::msg::dds_::VehicleLocalPosition_', 'local'),
        ('px4_msgs_old/msg/VehicleLocalPositionV0', 'local'),
        ('px4_msgs_old/msg/VehicleGlobalPositionV1', 'global'),
        ('px4_msgs_old/msg/VehicleStatusV1', None),
    ],
)
def test_kinds_by_the_names_of_every_time(name: str, kind: str | None) -> None:
    found = kind_named(name)
    assert (found.name if found else None) == kind
