"""Conversion: what replay makes of the MCAP is what it makes of the log."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from flightdyn.cli import main
from flightdyn.errors import InputError
from flightdyn.logs.any_log import read_track
from flightdyn.logs.convert import convert, write_track_mcap
from flightdyn.logs.track import Track
from flightdyn.replay.reconstruct import reconstruct


def track(n: int = 60, **more: Any) -> Track:
    """A gentle turn with every number unlike the others."""
    t = np.arange(n) * 0.5
    lat = 47.0 + 1e-4 * t + 1e-6 * t**2
    given: dict[str, Any] = {
        'time_ns': (1_700_000_000 * 10**9 + t * 1e9).astype(np.int64),
        'segment': np.zeros(n, np.int64),
        'lat': lat,
        'lon': 8.0 + 2e-4 * t,
        'altitude': 700 + 3.0 * t,
        'altitude_datum': 'msl',
        'file': 'made.up',
        'source': 'gps',
        'schema': 'test',
        'messages': n,
    }
    return Track(**(given | more))


def round_trip(original: Track, tmp_path: Path) -> Track:
    write_track_mcap(original, tmp_path / 'out.mcap', 'test')
    return read_track(tmp_path / 'out.mcap')


def test_positions_come_back_to_the_last_bit(tmp_path: Path) -> None:
    original = track()
    back = round_trip(original, tmp_path)
    for name in ('time_ns', 'segment', 'lat', 'lon', 'altitude'):
        np.testing.assert_array_equal(getattr(back, name), getattr(original, name), name)
    assert back.altitude_datum == 'msl'
    before, after = reconstruct(original), reconstruct(back)
    for name in before.columns:
        np.testing.assert_array_equal(after[name], before[name], name)


def test_segments_of_the_log_outlive_conversion_though_no_gap_shows_them(tmp_path: Path) -> None:
    segment = np.repeat([0, 1, 2], 20)
    back = round_trip(track(segment=segment), tmp_path)
    np.testing.assert_array_equal(back.segment, segment)


def test_velocity_and_its_accuracy_come_back_in_the_same_axes(tmp_path: Path) -> None:
    n = 60
    t = np.arange(n) * 0.5
    # All three unequal; moving as the positions do, or replay would refuse them.
    velocity = np.stack(
        ((1e-4 + 2e-6 * t) * 111_190, np.full(n, 2e-4 * 76_040.0), np.full(n, -3.0)), axis=1
    )
    std = np.tile([0.1, 0.2, 0.3], (n, 1))
    original = track(velocity_ned=velocity, velocity_std=std, position_std=20 * std)
    back = round_trip(original, tmp_path)
    for name in ('lat', 'lon', 'altitude'):
        np.testing.assert_array_equal(getattr(back, name), getattr(original, name), name)
    np.testing.assert_array_equal(back.velocity_ned, velocity)
    np.testing.assert_allclose(back.velocity_std, std, rtol=1e-15)
    np.testing.assert_allclose(back.position_std, 20 * std, rtol=1e-15)
    assert back.attitude is None
    before, after = reconstruct(original), reconstruct(back)
    for name in before.columns:
        np.testing.assert_allclose(after[name], before[name], rtol=1e-9, atol=1e-12, err_msg=name)
    fixes = read_track(tmp_path / 'out.mcap', '/fix')
    np.testing.assert_array_equal(fixes.lat, original.lat)
    np.testing.assert_allclose(fixes.position_std, 20 * std, rtol=1e-15)


def test_the_file_is_a_ros2_recording_that_says_where_it_came_from(tmp_path: Path) -> None:
    write_track_mcap(track(dropped={'no fix': 3}), tmp_path / 'out.mcap', 'test')
    with (tmp_path / 'out.mcap').open('rb') as stream:
        reader = make_reader(stream)
        assert reader.get_header().profile == 'ros2'
        (record,) = reader.iter_metadata()
    assert record.metadata['converted_from'] == 'made.up'
    assert json.loads(record.metadata['converted_dropped']) == {'no fix': 3}


def test_an_mcap_is_not_converted(glider_log: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match='is an MCAP already'):
        convert(glider_log, tmp_path / 'out.mcap')


def test_a_log_is_not_written_over(tmp_path: Path) -> None:
    path = tmp_path / 'flight.mcap'
    path.write_text('AXXX\nHFDTE010824\n')
    with pytest.raises(InputError, match='is the log itself'):
        convert(path, tmp_path / '.' / 'flight.mcap')


def test_nothing_is_left_where_conversion_fails(tmp_path: Path) -> None:
    log = tmp_path / 'flight.igc'
    log.write_text('AXXX\nHFDTE010824\n')
    assert main(['convert', str(log), str(tmp_path / 'out.mcap')]) == 2
    assert main(['convert', str(log), str(tmp_path / 'out.csv')]) == 2
    assert [path.name for path in tmp_path.iterdir()] == ['flight.igc']


def test_convert_then_replay_is_replay(tmp_path: Path, capsys: Any) -> None:
    log, output = tmp_path / 'flight.igc', tmp_path / 'out.mcap'
    lines = [
        f'B1100{i:02}4800{100 + i * i}N00900{200 + 3 * i}EA0090000{900 + i}' for i in range(20)
    ]
    log.write_text('\n'.join(['AXXX', 'HFDTE010824', *lines]))
    assert main(['convert', str(log), str(output), '--json']) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary['format'], summary['used'], summary['altitude_datum']) == (
        'IGC',
        20,
        'ellipsoid',
    )
    assert summary['topics'][0]['topic'] == '/fix'
    replays = []
    for path in (log, output):
        assert main(['replay', str(path), '--json']) == 0
        replays.append(json.loads(capsys.readouterr().out))
    for name in ('used', 'segments', 'distance_m', 'max_speed', 'max_altitude', 'altitude_datum'):
        assert replays[0][name] == replays[1][name], name
