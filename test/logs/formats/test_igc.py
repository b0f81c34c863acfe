"""IGC: positions to their last digit, days, validity and damage."""

from pathlib import Path

import numpy as np
import pytest
from flown_circle import CLIMB, SPEED, START_S, circle, flown_speed

from flightdyn.errors import LogError
from flightdyn.logs.any_log import describe, read_track

HEADER = 'AXCS123 test\r\nHFDTE010824\r\nHFPLTPILOTINCHARGE:A. Nother\r\n'


def b_record(second: float, lat: float, lon: float, pressure: int, gnss: int, valid='A') -> str:
    second = int(second) % 86400
    clock = f'{second // 3600:02}{second // 60 % 60:02}{second % 60:02}'

    def angle(value: float, digits: int, letters: str) -> str:
        thousandths = round(abs(value) * 60_000)
        letter = letters[int(value < 0)]
        return f'{thousandths // 60_000:0{digits}}{thousandths % 60_000:05}{letter}'

    place = angle(lat, 2, 'NS') + angle(lon, 3, 'EW')
    return f'B{clock}{place}{valid}{pressure:05}{gnss:05}'


def igc(path: Path, *lines: str, header: str = HEADER) -> Path:
    path.write_text(header + '\r\n'.join(lines) + '\r\n', encoding='latin-1')
    return path


@pytest.fixture
def circle_igc(tmp_path: Path) -> Path:
    flown = circle()
    rows = zip(flown.time, flown.lat, flown.lon, flown.altitude, strict=True)
    lines = [b_record(t, lat, lon, round(h) - 50, round(h)) for t, lat, lon, h in rows]
    return igc(tmp_path / 'circle.igc', *lines, 'LXCS comment', 'G0123456789')


def test_a_circle_is_replayed_at_its_speed(circle_igc: Path) -> None:
    speed, climb = flown_speed(circle_igc)
    # Rounded to 1.85 m and 1 m a second: smoothing leaves some percent.
    assert speed == pytest.approx(SPEED, rel=0.03)
    assert climb == pytest.approx(CLIMB, abs=0.1)


def test_times_places_and_datum_are_those_of_the_file(circle_igc: Path) -> None:
    track = read_track(circle_igc)
    flown = circle()
    assert track.time_ns[0] == START_S * 10**9
    assert (np.diff(track.time_ns) == 10**9).all()
    half_digit = 0.5 / 60_000 * 1.001
    np.testing.assert_allclose(track.lat, flown.lat, rtol=0, atol=half_digit)
    np.testing.assert_allclose(track.lon, flown.lon, rtol=0, atol=half_digit)
    assert (track.source, track.altitude_datum) == ('gnss', 'ellipsoid')
    assert any('mean sea level' in warning for warning in track.warnings)
    pressure = read_track(circle_igc, 'pressure')
    assert pressure.altitude_datum == 'baro'
    np.testing.assert_array_equal(pressure.altitude, track.altitude - 50)


def test_south_and_west_are_negative_and_minutes_are_whole(tmp_path: Path) -> None:
    lines = [f'B11000{s}3330123S07045600WA0100001100' for s in range(3)]
    track = read_track(igc(tmp_path / 'andes.igc', *lines))
    assert track.lat[0] == pytest.approx(-(33 + 30.123 / 60), abs=1e-12)
    assert track.lon[0] == pytest.approx(-(70 + 45.600 / 60), abs=1e-12)
    assert track.altitude[0] == 1100


def test_digits_that_the_i_record_adds_are_read(tmp_path: Path) -> None:
    header = HEADER + 'I043638FXA3940LAD4142LOD4343TDS\r\n'
    lines = [f'B1100003330123N00945600EA0100001100012{45}{67}{tenth}' for tenth in range(3)]
    track = read_track(igc(tmp_path / 'fine.igc', *lines, header=header))
    assert track.lat[0] == pytest.approx(33 + 30.12345 / 60, abs=1e-12)
    assert track.lon[0] == pytest.approx(9 + 45.60067 / 60, abs=1e-12)
    assert np.diff(track.time_ns).tolist() == [10**8, 10**8]


@pytest.mark.parametrize(
    ('where', 'digits', 'speed'), [('3638', '108', 30.0), ('3640', '10854', 30.15)]
)
def test_an_airspeed_in_the_i_record_is_read(
    tmp_path: Path, where: str, digits: str, speed: float
) -> None:
    header = HEADER + f'I01{where}TAS\r\n'
    lines = [f'B11000{s}3330123N00945600EA0100001100{digits}' for s in range(3)]
    lines[1] = lines[1][:35] + '-' * len(digits)
    track = read_track(igc(tmp_path / 'tas.igc', *lines, header=header))
    assert len(track) == 3
    np.testing.assert_allclose(track.airspeed, [speed, np.nan, speed])


def test_a_flight_through_midnight_goes_on(tmp_path: Path) -> None:
    lines = [b_record(86397 + i, 48, 9 + 1e-3 * i, 900, 950) for i in range(6)]
    track = read_track(igc(tmp_path / 'night.igc', *lines))
    assert (np.diff(track.time_ns) == 10**9).all()
    assert track.segment.max() == 0


@pytest.mark.parametrize('line', ['HFDTE010824', 'HFDTEDATE:010824,02', 'HFDTEDATE: 010824'])
def test_every_way_to_write_the_date(tmp_path: Path, line: str) -> None:
    lines = [b_record(START_S + i, 48, 9, 900, 950) for i in range(3)]
    path = igc(tmp_path / 'date.igc', *lines, header=f'AXXX\r\n{line}\r\n')
    assert read_track(path).time_ns[0] == START_S * 10**9


def test_without_a_date_the_time_of_day_is_kept_with_a_warning(tmp_path: Path) -> None:
    lines = [b_record(3600 + i, 48, 9, 900, 950) for i in range(3)]
    track = read_track(igc(tmp_path / 'nodate.igc', *lines, header='AXXX\r\n'))
    assert track.time_ns[0] == 3600 * 10**9
    assert any('no date' in warning for warning in track.warnings)


def test_invalid_and_damaged_records_are_dropped_and_counted(tmp_path: Path) -> None:
    lines = [b_record(START_S + i, 48, 9 + 1e-3 * i, 900, 950) for i in range(8)]
    lines[2] = lines[2].replace('EA', 'EV')
    lines[4] = lines[4][:20]
    lines[5] = 'B9999' + lines[5][5:]
    track = read_track(igc(tmp_path / 'bad.igc', *lines))
    assert track.dropped == {'no fix': 1, 'not a whole B record': 2}
    assert (len(track), track.messages) == (5, 8)
    assert any('first: line 8' in warning for warning in track.warnings)


def test_a_recorder_without_gnss_altitude_falls_back_on_pressure(tmp_path: Path) -> None:
    lines = [b_record(START_S + i, 48, 9, 900 + i, 0) for i in range(5)]
    track = read_track(igc(tmp_path / 'baro.igc', *lines))
    assert (track.source, track.altitude_datum) == ('pressure', 'baro')


def test_a_geoid_datum_is_named(tmp_path: Path) -> None:
    lines = [b_record(START_S + i, 48, 9, 900, 950) for i in range(3)]
    header = HEADER + 'HFALGALTGPS:GEO\r\nHFDTM001GPSDATUM:NAD27\r\n'
    track = read_track(igc(tmp_path / 'geo.igc', *lines, header=header))
    assert track.altitude_datum == 'msl'
    assert any('NAD27' in warning for warning in track.warnings)


def test_a_file_without_positions_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LogError, match='no B records'):
        read_track(igc(tmp_path / 'empty.igc'))
    lines = [b_record(START_S + i, 48, 9, 900, 950, 'V') for i in range(3)]
    with pytest.raises(LogError, match='3 no fix'):
        read_track(igc(tmp_path / 'void.igc', *lines))


def test_info_lists_both_altitudes(circle_igc: Path) -> None:
    info = describe(circle_igc)
    assert info.format == 'IGC'
    assert [(s.topic, s.usable, s.messages) for s in info.sources] == [
        ('gnss', True, 120),
        ('pressure', True, 120),
    ]


@pytest.mark.parametrize('cut', [0, 1, 3, 40, 200, 1001])
def test_no_cut_is_a_traceback(circle_igc: Path, cut: int) -> None:
    circle_igc.write_bytes(circle_igc.read_bytes()[:cut])
    message = ''
    try:
        assert len(read_track(circle_igc)) > 2
    except LogError as error:
        message = str(error)
    assert len(message.splitlines()) <= 1
