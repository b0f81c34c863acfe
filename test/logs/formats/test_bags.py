"""ROS bags of each kind give what the same messages in an MCAP give."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_making import STORE, fixes
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_typestore

from flightdyn.errors import LogError
from flightdyn.logs.any_log import describe, read_track

FIX = 'sensor_msgs/msg/NavSatFix'
ROS1 = get_typestore(Stores.ROS1_NOETIC)


def ros1_bag(path: Path, compression: Any = None) -> Path:
    types = ROS1.types
    writer = Ros1Writer(path)
    if compression:
        writer.set_compression(compression)
    with writer:
        connection = writer.add_connection('/fix', FIX, typestore=ROS1)
        other = writer.add_connection('/chatter', 'std_msgs/msg/String', typestore=ROS1)
        for i, (_, ns, payload) in enumerate(fixes()):
            message = STORE.deserialize_cdr(payload, FIX)
            stamp = types['builtin_interfaces/msg/Time'](ns // 10**9, ns % 10**9)
            header = types['std_msgs/msg/Header'](i, stamp, 'gps')
            again = types[FIX](
                header,
                types['sensor_msgs/msg/NavSatStatus'](-1 if i == 3 else 0, 1),
                message.latitude,
                message.longitude,
                message.altitude,
                message.position_covariance,
                0,
            )
            writer.write(connection, ns, ROS1.serialize_ros1(again, FIX))
            text = types['std_msgs/msg/String']('x' * 100)
            writer.write(other, ns, ROS1.serialize_ros1(text, 'std_msgs/msg/String'))
    return path


def ros2_bag(path: Path, storage: StoragePlugin = StoragePlugin.SQLITE3, version: int = 9) -> Path:
    with Ros2Writer(path, version=version, storage_plugin=storage) as writer:
        connection = writer.add_connection('/fix', FIX, typestore=STORE)
        for _, ns, payload in fixes():
            writer.write(connection, ns, payload)
    return path


@pytest.fixture
def mcap_track(write_log: Callable[..., Path]) -> Any:
    return read_track(write_log(fixes()))


def check_same(track: Any, expected: Any, skipped: int | None = None) -> None:
    for name in ('time_ns', 'lat', 'lon', 'altitude', 'segment'):
        values = getattr(expected, name)
        values = values if skipped is None else np.delete(values, skipped)
        np.testing.assert_array_equal(getattr(track, name), values, name)
    assert track.altitude_datum == expected.altitude_datum
    assert track.schema == expected.schema


@pytest.mark.parametrize('compression', [None, 'BZ2', 'LZ4'])
def test_ros1_bag(tmp_path: Path, mcap_track: Any, compression: str | None) -> None:
    wanted = compression and Ros1Writer.CompressionFormat[compression]
    path = ros1_bag(tmp_path / 'flight.bag', wanted)
    track = read_track(path)
    check_same(track, mcap_track, skipped=3)
    assert track.dropped == {'no fix': 1}
    assert (track.file, track.source) == (str(path), '/fix')
    info = describe(path)
    assert info.format == 'ROS 1 bag'
    assert [(s.topic, s.usable, s.messages) for s in info.sources] == [
        ('/fix', True, 20),
        ('/chatter', False, 20),
    ]


@pytest.mark.parametrize('storage', list(StoragePlugin))
@pytest.mark.parametrize('version', [8, 9])
def test_ros2_folder(tmp_path: Path, mcap_track: Any, storage: Any, version: int) -> None:
    path = ros2_bag(tmp_path / 'flight', storage, version)
    check_same(read_track(path), mcap_track)
    assert describe(path).format == f'ROS 2 bag ({storage.name.lower()})'


def test_a_db3_file_alone(tmp_path: Path, mcap_track: Any) -> None:
    check_same(read_track(ros2_bag(tmp_path / 'flight') / 'flight.db3'), mcap_track)


def test_a_folder_with_several_files_is_one_log(
    tmp_path: Path, write_log: Callable[..., Path], mcap_track: Any
) -> None:
    path = ros2_bag(tmp_path / 'flight', StoragePlugin.MCAP)
    for number, part in enumerate((fixes()[:8], fixes()[8:])):
        write_log(part).rename(path / f'flight_{number}.mcap')
    about = path / 'metadata.yaml'
    names = '    - flight_0.mcap\n    - flight/flight_1.mcap\n'
    about.write_text(about.read_text().replace('    - flight.mcap\n', names))
    check_same(read_track(path), mcap_track)
    assert describe(path).messages == 20


def test_a_file_that_the_metadata_lists_outside_is_not_opened(tmp_path: Path) -> None:
    path = ros2_bag(tmp_path / 'flight')
    (path / 'flight.db3').rename(tmp_path / 'flight.db3')
    about = path / 'metadata.yaml'
    about.write_text(about.read_text().replace('- flight.db3', '- ../flight.db3'))
    with pytest.raises(LogError, match='not in the folder'):
        read_track(path)


def test_an_unknown_storage_is_named(tmp_path: Path) -> None:
    path = ros2_bag(tmp_path / 'flight')
    about = path / 'metadata.yaml'
    about.write_text(about.read_text().replace('sqlite3', 'leveldb'))
    with pytest.raises(LogError, match="'leveldb' is not supported"):
        read_track(path)


@pytest.mark.parametrize('text', ['', '[', 'a: 1', 'rosbag2_bagfile_information: 3'])
def test_bad_metadata_is_one_line(tmp_path: Path, text: str) -> None:
    (tmp_path / 'metadata.yaml').write_text(text)
    with pytest.raises(LogError) as caught:
        read_track(tmp_path)
    assert len(str(caught.value).splitlines()) == 1


def test_a_bag_whose_recorder_was_killed_says_how_to_get_an_index(tmp_path: Path) -> None:
    path = ros1_bag(tmp_path / 'flight.bag')
    data = bytearray(path.read_bytes())
    at = data.index(b'index_pos=') + len(b'index_pos=')
    data[at : at + 8] = bytes(8)
    path.write_bytes(data)
    with pytest.raises(LogError, match='rosbag reindex'):
        read_track(path)


@pytest.mark.parametrize('kind', ['bag', 'db3'])
def test_damage_anywhere_is_one_line_or_a_track(tmp_path: Path, kind: str) -> None:
    if kind == 'bag':
        path = ros1_bag(tmp_path / 'flight.bag')
    else:
        path = ros2_bag(tmp_path / 'flight') / 'flight.db3'
    whole = path.read_bytes()
    chance = np.random.default_rng(1)
    broken = [whole[: int(n)] for n in chance.integers(20, len(whole), 40)]
    for _ in range(80):
        data = np.frombuffer(whole, np.uint8).copy()
        at = chance.integers(20, data.size, 30)
        data[at] = chance.integers(0, 256, 30)
        broken.append(data.tobytes())
    refused = 0
    for data in broken:
        path.write_bytes(data)
        message = ''
        try:
            read_track(path)
        except LogError as error:
            message = str(error)
            refused += 1
        assert len(message.splitlines()) <= 1
    assert refused > 40  # every cut, and then some
