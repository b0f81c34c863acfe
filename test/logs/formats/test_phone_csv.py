"""CSV of phones: columns by name, times by size, numbers by the delimiter's habits."""

from pathlib import Path

import numpy as np
import pytest
from flown_circle import CLIMB, SPEED, START_S, circle, flown_speed

from flightdyn.errors import LogError
from flightdyn.logs.any_log import read_track


def table(path: Path, *lines: str) -> Path:
    path.write_text('\n'.join(lines) + '\n')
    return path


def test_a_circle_is_replayed_at_its_speed(tmp_path: Path) -> None:
    flown = circle(rate=2)
    lines = ['time,latitude,longitude,altitude,accuracy']
    for t, lat, lon, h in zip(flown.time, flown.lat, flown.lon, flown.altitude, strict=True):
        lines.append(f'{t:.3f},{lat:.8f},{lon:.8f},{h:.3f},4')
    speed, climb = flown_speed(table(tmp_path / 'circle.csv', *lines))
    assert speed == pytest.approx(SPEED, rel=0.002)
    assert climb == pytest.approx(CLIMB, abs=0.02)


@pytest.mark.parametrize(
    'first', ['1722510000', '1722510000.0', '1722510000000', '1722510000000000', '1.72251E+09']
    + [f'{START_S}000000000', '2024-08-01T11:00:00Z', '2024-08-01 13:00:00+02:00'],
)  # fmt: skip
def test_every_way_to_write_a_time(tmp_path: Path, first: str) -> None:
    path = table(tmp_path / 'time.csv', 'time,lat,lon,alt', f'{first},48,9,5', f'{first},48,9,5')
    with pytest.raises(LogError, match='1 repeated time'):
        read_track(path)
    second = first.replace('1722510000', '1722510001').replace(':00:00', ':00:01')
    second = second.replace('1.72251E+09', '1.722510001E+09')
    table(path, 'time,lat,lon,alt', f'{first},48,9,5', f'{second},48,9,5')
    assert read_track(path).time_ns.tolist() == [START_S * 10**9, (START_S + 1) * 10**9]


@pytest.mark.parametrize(
    ('header', 'row'),
    [
        ('Timestamp;Latitude;Longitude;Altitude (m)', '1722510000;48,5;9,25;500,5'),
        ('time\tlat\tlng\tele', '1722510000\t48.5\t9.25\t500.5'),
        ('"Time";"Latitude (°)";"Longitude (°)";"Height"', '"1722510000";48.5;9.25;500.5'),
        ('gps_time,Lat,Long,altitude_ft,provider', '1722510000,48.5,9.25,1642.060367,"a,b"'),
        ('altitude_m,longitude_deg,latitude_deg,timestamp_ms', '500.5,9.25,48.5,1722510000000'),
        ('date,time,lat,lon,alt', '2024/08/01,11:00:00,48.5,9.25,500.5'),
    ],
)
def test_every_way_to_name_and_separate(tmp_path: Path, header: str, row: str) -> None:
    later = row.replace('172251000', '172251001').replace('11:00:00', '11:00:10')
    track = read_track(table(tmp_path / 'log.csv', header, row, later))
    assert track.time_ns[0] == START_S * 10**9
    assert (track.lat[0], track.lon[0]) == (48.5, 9.25)
    assert track.altitude[0] == pytest.approx(500.5, abs=1e-6)


@pytest.mark.parametrize(
    ('name', 'datum'),
    [
        ('altitude', 'unknown'),
        ('altitude_msl', 'msl'),
        ('altitudeAboveMeanSeaLevel', 'msl'),
        ('Altitude (ellipsoid)', 'ellipsoid'),
        ('height_hae', 'ellipsoid'),
    ],
)
def test_the_datum_is_what_the_column_says(tmp_path: Path, name: str, datum: str) -> None:
    rows = [f'{START_S + i},48,9,{i}' for i in range(3)]
    track = read_track(table(tmp_path / 'd.csv', f'time,lat,lon,{name}', *rows))
    assert track.altitude_datum == datum


def test_velocity_from_speed_bearing_and_climb(tmp_path: Path) -> None:
    rows = [f'{START_S + i},48,9,500,36,30,1.5' for i in range(3)]
    header = 'time,lat,lon,alt,speed (km/h),bearing,vertical_speed'
    track = read_track(table(tmp_path / 'v.csv', header, *rows))
    np.testing.assert_allclose(track.velocity_ned[0], [10 * np.sqrt(0.75), 5, -1.5], rtol=1e-12)
    track = read_track(table(tmp_path / 'v.csv', 'time,lat,lon,alt,vn,ve,vd', *rows))
    np.testing.assert_array_equal(track.velocity_ned[0], [36, 30, 1.5])


def test_accuracy_becomes_one_sigma_of_each_axis(tmp_path: Path) -> None:
    rows = [f'{START_S + i},48,9,500,6,7' for i in range(3)]
    header = 'time,lat,lon,alt,horizontalAccuracy,verticalAccuracy'
    track = read_track(table(tmp_path / 'a.csv', header, *rows))
    np.testing.assert_allclose(track.position_std[0], [4, 4, 7])


def test_bad_lines_are_counted_with_their_numbers(tmp_path: Path) -> None:
    good = [f'{START_S + i},48,9,500' for i in range(4)]
    bad = ['x,48,9,500', f'{START_S},48', f'{START_S},4_8,9,500', f'{START_S + 9},,,']
    track = read_track(table(tmp_path / 'b.csv', 'time,lat,lon,alt', *good, '', *bad))
    assert track.dropped == {
        'with a time neither ISO 8601 nor counted since 1970': 1,
        'shorter than the header': 1,
        'where lat is no number': 1,
        'position not finite': 1,
    }
    assert any('first: line 7' in warning for warning in track.warnings)


def test_missing_columns_are_named_with_those_found(tmp_path: Path) -> None:
    path = table(tmp_path / 'm.csv', 'zeit;breite;lon;alt', '1;2;3;4')
    with pytest.raises(LogError, match=r'no column for time .*lat .*found: zeit, breite'):
        read_track(path)


def test_times_since_an_unknown_start_are_kept_with_a_warning(tmp_path: Path) -> None:
    path = table(tmp_path / 'r.csv', 'Time (s),lat,lon,alt', '0.5,48,9,5', '1.5,48,9,5')
    track = read_track(path)
    assert track.time_ns.tolist() == [5 * 10**8, 15 * 10**8]
    assert any('unknown start' in warning for warning in track.warnings)


@pytest.mark.parametrize(
    'content', [b'', b'\n\n', b'time,lat,lon,alt\n', b'\xff' * 90, b'a' * 99999]
)
def test_what_is_no_table_is_refused_in_one_line(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / 'bad.csv'
    path.write_bytes(content)
    with pytest.raises(LogError) as caught:
        read_track(path)
    assert len(str(caught.value).splitlines()) == 1
