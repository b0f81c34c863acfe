"""What holds for logs of every kind: conversion keeps them, damage is told in one line."""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flown_circle import circle
from test_bags import ros1_bag, ros2_bag
from test_dataflash import circle_log
from test_gpx import gpx, points
from test_igc import HEADER, b_record
from test_tlog import circle_frames
from test_ulog import circle_ulog

from flightdyn.cli import main
from flightdyn.errors import LogError
from flightdyn.logs.any_log import describe, read_track
from flightdyn.replay.reconstruct import reconstruct


def _igc(folder: Path) -> Path:
    flown = circle()
    rows = zip(flown.time, flown.lat, flown.lon, flown.altitude, strict=True)
    lines = [b_record(t, lat, lon, round(h), round(h)) for t, lat, lon, h in rows]
    (folder / 'log.igc').write_text(HEADER + '\n'.join(lines) + '\n')
    return folder / 'log.igc'


def _csv(folder: Path) -> Path:
    flown = circle(rate=2)
    lines = ['time,lat,lon,altitude,vn,ve,vd,hAcc,vAcc']
    for i, t in enumerate(flown.time):
        place = f'{flown.lat[i]:.8f},{flown.lon[i]:.8f},{flown.altitude[i]:.2f}'
        velocity = ','.join(f'{v:.3f}' for v in flown.velocity_ned[i])
        lines.append(f'{t:.3f},{place},{velocity},4,6')
    (folder / 'log.csv').write_text('\n'.join(lines) + '\n')
    return folder / 'log.csv'


def _written(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


LOGS: dict[str, Callable[[Path], Path]] = {
    'igc': _igc,
    'gpx': lambda folder: gpx(folder / 'log.gpx', [points(0, 20), points(20, 55)]),
    'csv': _csv,
    'bag': lambda folder: ros1_bag(folder / 'log.bag'),
    'ros2': lambda folder: ros2_bag(folder / 'log'),
    'ulg': lambda folder: circle_ulog(folder / 'log.ulg', new=False),
    'tlog': lambda folder: _written(folder / 'log.tlog', b''.join(circle_frames())),
    'bin': lambda folder: _written(folder / 'log.bin', circle_log()),
}


@pytest.mark.parametrize('kind', LOGS)
def test_replay_of_the_converted_log_is_that_of_the_log(tmp_path: Path, kind: str) -> None:
    path, output = LOGS[kind](tmp_path), tmp_path / 'out.mcap'
    assert main(['convert', str(path), str(output)]) == 0
    original, back = read_track(path), read_track(output)
    for name in ('time_ns', 'segment', 'lat', 'lon', 'altitude', 'velocity_ned'):
        # the velocity is turned to east, north, up and back, which rounds nothing
        np.testing.assert_array_equal(getattr(back, name), getattr(original, name), name)
    assert back.altitude_datum == original.altitude_datum
    before, after = reconstruct(original), reconstruct(back)
    for name in before.columns:
        # 1-sigma go through their squares
        np.testing.assert_allclose(after[name], before[name], rtol=1e-9, atol=1e-12, err_msg=name)
    assert describe(output).metadata['flightdyn']['converted_from'] == str(path)


@pytest.mark.parametrize('kind', LOGS)
def test_the_commands_take_the_log_itself(tmp_path: Path, kind: str, capsys: Any) -> None:
    path, table = LOGS[kind](tmp_path), tmp_path / 'out.csv'
    assert main(['replay', str(path), '--json', '--start', '2', '-o', str(table)]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary['file'], summary['used']) == (str(path), len(table.read_text().split()) - 1)
    assert main(['info', str(path), '--json']) == 0
    info = json.loads(capsys.readouterr().out)
    assert info['topics'][0]['topic'] == summary['source']
    assert info['format'] != 'MCAP'
    assert main(['replay', str(path), '--source', 'nothing']) == 2
    assert summary['source'] in capsys.readouterr().err


@pytest.mark.parametrize('kind', ['igc', 'gpx', 'csv', 'tlog'])
def test_damage_anywhere_is_one_line_or_a_track(tmp_path: Path, kind: str) -> None:
    path = LOGS[kind](tmp_path)
    whole = path.read_bytes()
    chance = np.random.default_rng(5)
    for _ in range(40):
        data = np.frombuffer(whole, np.uint8).copy()
        at = chance.integers(0, data.size, chance.integers(1, 30))
        data[at] = chance.integers(0, 256, at.size)
        path.write_bytes(data[: chance.integers(0, data.size)].tobytes())
        message = ''
        try:
            read_track(path)
        except LogError as error:
            message = str(error)
        assert len(message.splitlines()) <= 1


@pytest.mark.parametrize(
    ('name', 'content', 'message'),
    [
        ('empty.igc', b'', 'the file is empty'),
        ('photo.jpg', b'\xff\xd8\xff\xe0' * 9, 'not a log of a known kind: it begins with ff d8'),
        ('log.igc.gz', b'\x1f\x8b' * 9, 'a gzip file; unpack it first'),
        ('new.mcap', b'\x89MCAP1\r\n' * 9, 'unsupported MCAP version'),
    ],
)
def test_what_is_no_log_is_named(tmp_path: Path, name: str, content: bytes, message: str) -> None:
    with pytest.raises(LogError, match=message):
        read_track(_written(tmp_path / name, content))


def test_a_folder_that_is_no_bag_and_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(LogError, match='no ROS 2 bag'):
        read_track(tmp_path)
    with pytest.raises(LogError, match='No such file'):
        describe(tmp_path / 'gone.igc')


def test_a_bag_that_is_called_mcap_is_named_for_what_it_is(tmp_path: Path) -> None:
    bag = LOGS['bag'](tmp_path)
    renamed = bag.rename(tmp_path / 'log.mcap')
    with pytest.raises(LogError, match='no MCAP but ROS 1 bag, in spite of its name'):
        read_track(renamed)


@pytest.mark.parametrize('command', ['replay', 'info'])
def test_pipes_are_refused_and_not_waited_for(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    os.mkfifo(tmp_path / 'pipe')
    assert main([command, str(tmp_path / 'pipe')]) == 2
    assert 'pipe: a pipe or device, not a file' in capsys.readouterr().err


@pytest.mark.parametrize('command', ['replay', 'info', 'view'])
def test_names_that_no_file_can_have_are_told_in_one_line(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """The system refuses to look for them, which ended in a traceback."""
    assert main([command, 'a' * 300]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
