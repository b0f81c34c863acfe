"""The container reader against the mcap package, and against files with one thing wrong each."""

import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from log_making import NO_INDEX, fixes
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType

from flightdyn.errors import LogError
from flightdyn.logs.mcap_container import MAGIC, McapFile
from flightdyn.logs.sources import read_track

Write = Callable[..., Path]


def contents(path: Path) -> list[tuple[str, int, bytes]]:
    with McapFile(path) as log:
        found = [
            (log.channels[batch.channel_id].topic, int(time), batch.data[a:b].tobytes())
            for batch in log.batches(list(log.channels))
            for time, a, b in zip(batch.log_time, batch.start, batch.end, strict=True)
        ]
        assert sum(log.message_counts.values()) == len(found)
    return found


def with_mcap(path: Path) -> list[tuple[str, int, bytes]]:
    with path.open('rb') as stream:
        return [
            (channel.topic, message.log_time, message.data)
            for _, channel, message in make_reader(stream).iter_messages(log_time_order=False)
        ]


@pytest.mark.parametrize('compression', list(CompressionType))
@pytest.mark.parametrize(
    'options',
    [
        {},
        NO_INDEX,
        {'index_types': IndexType.CHUNK},  # chunks listed, but not what is in them
        {'repeat_channels': False},
        {'repeat_schemas': False},
        {'use_statistics': False},
        {'use_chunking': False},
        {'enable_crcs': False},
        {'enable_data_crcs': True, **NO_INDEX},
        {'chunk_size': 10**6},
    ],
)
def test_reads_what_was_written(
    write_log: Write, compression: CompressionType, options: dict[str, object]
) -> None:
    path = write_log(fixes(50), compression=compression, **options)
    assert contents(path) == fixes(50)


def test_glider_log(glider_log: Path) -> None:
    assert contents(glider_log) == with_mcap(glider_log)
    with McapFile(glider_log) as log:
        assert log.profile == 'ros2'
        assert [channel.topic for channel in log.channels.values()] == ['/fix']
        assert log.schemas[1].name == 'sensor_msgs/msg/NavSatFix'
        assert log.warnings == []


def test_only_chunks_with_wanted_messages_are_unpacked(
    write_log: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    messages = [(f'/{name}', ns, data) for name in 'ab' for _, ns, data in fixes(40)]
    path = write_log(messages, dict.fromkeys(('/a', '/b'), 'sensor_msgs/msg/NavSatFix'))
    unpacked: list[int] = []
    original = McapFile._unpack_chunk

    def counting(log: McapFile, block: object) -> object:
        unpacked.append(1)
        return original(log, block)  # type: ignore[arg-type]

    monkeypatch.setattr(McapFile, '_unpack_chunk', counting)
    with McapFile(path) as log:
        chunks = len(log._blocks)
        assert sum(len(batch) for batch in log.batches([2])) == 40
    assert len(unpacked) <= chunks // 2 + 1


def test_order_within_a_channel_is_that_of_the_file(write_log: Write) -> None:
    messages = fixes(30)
    shuffled = messages[15:] + messages[:15]  # as if the clock stepped back
    path = write_log(shuffled, chunk_size=10**6)
    assert [time for _, time, _ in contents(path)] == [time for _, time, _ in shuffled]


@pytest.mark.parametrize('part', [0.3, 0.6, 0.9, 0.999])
def test_truncated_file_yields_what_comes_before(write_log: Write, part: float) -> None:
    path = write_log(fixes(100))
    whole = path.read_bytes()
    before = contents(path)
    path.write_bytes(whole[: int(part * len(whole))])
    with McapFile(path) as log:
        (warning,) = log.warnings
    found = contents(path)
    assert found == before[: len(found)]
    assert len(found) >= 0.6 * part * 100
    if len(found) == len(before):
        assert 'its messages are complete' in warning
    else:
        assert 'cut short' in warning
        assert 'byte ' in warning


def test_zeros_at_the_end_are_a_cut(write_log: Write) -> None:
    path = write_log(fixes(100))
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2] + bytes(len(whole) // 2))
    with McapFile(path) as log:
        assert 'cut short' in log.warnings[0]
        assert 0 < sum(log.message_counts.values()) < 100


@pytest.mark.parametrize(
    ('start', 'says'),
    [
        (b'', 'empty'),
        (b'#ROSBAG V2.0\n' + bytes(50), 'ROS 1 bag'),
        (b'SQLite format 3\0' + bytes(50), 'sqlite3'),
        (b'ULog\x01\x12\x35\x01' + bytes(50), 'ULog'),
        (b'\x89MCAP9\r\n' + bytes(50), 'unsupported MCAP version'),
        (b'nonsense' * 10, 'not an MCAP'),
        (MAGIC, 'byte 8'),
        (MAGIC + struct.pack('<BQ', 1, 2**62), 'byte 8.*claims 4611686018427387904'),
        (MAGIC + struct.pack('<BQII', 4, 8, 0, 0), 'expected a header'),
    ],
)
def test_not_an_mcap(tmp_path: Path, start: bytes, says: str) -> None:
    path = tmp_path / 'wrong.mcap'
    path.write_bytes(start)
    with pytest.raises(LogError, match=says) as caught:
        McapFile(path)
    assert str(path) in str(caught.value)


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(LogError, match='No such file'):
        McapFile(tmp_path / 'none.mcap')
    with pytest.raises(LogError, match='directory'):
        McapFile(tmp_path)


@pytest.mark.parametrize('options', [{}, NO_INDEX])
def test_damaged_chunk_is_refused(write_log: Write, options: dict[str, object]) -> None:
    path = write_log(fixes(50), compression=CompressionType.NONE, **options)
    data = bytearray(path.read_bytes())
    at = data.find(struct.pack('<d', 48 + 1e-4 * 30))
    data[at + 6] ^= 1
    path.write_bytes(data)
    with pytest.raises(LogError, match=r'byte \d+: the chunk is damaged: CRC'):
        contents(path)


def test_damaged_summary_falls_back_to_the_whole_file(write_log: Write) -> None:
    path = write_log(fixes(50))
    data = bytearray(path.read_bytes())
    data[-60] ^= 1
    path.write_bytes(data)
    with McapFile(path) as log:
        assert 'the index is damaged' in log.warnings[0]
    assert len(contents(path)) == 50


@pytest.mark.parametrize('wrong', [1, 2**32, 2**63])  # off by so much, modulo 2**64
def test_wrong_message_index_is_not_believed(write_log: Write, wrong: int) -> None:
    path = write_log(fixes(50), chunk_size=10**6)
    data = bytearray(path.read_bytes())
    record = data.find(struct.pack('<BQHI', 7, 6 + 50 * 16, 1, 50 * 16))
    assert record > 0
    entry = record + 9 + 6 + 16 * 10
    offset = struct.unpack_from('<Q', data, entry + 8)[0]
    struct.pack_into('<Q', data, entry + 8, offset + wrong)
    path.write_bytes(data)
    assert len(contents(path)) == 50


def change_chunk(path: Path, change: Callable[[bytearray, int], None]) -> None:
    """Change the first chunk record; `change` gets the file and where the record begins."""
    data = bytearray(path.read_bytes())
    at = 8
    while data[at] != 6:
        at += 9 + struct.unpack_from('<Q', data, at + 1)[0]
    change(data, at)
    path.write_bytes(data)


@pytest.mark.parametrize('options', [{}, NO_INDEX])
@pytest.mark.parametrize('size', [2**60, 2**32, 600 * 2**20, 1, 0])
def test_announced_size_is_not_believed(
    write_log: Write, size: int, options: dict[str, object]
) -> None:
    path = write_log(fixes(50), **options)
    change_chunk(path, lambda data, at: struct.pack_into('<Q', data, at + 9 + 16, size))
    with pytest.raises(LogError, match=r'byte \d+'):
        contents(path)


def test_unknown_compression(write_log: Write) -> None:
    path = write_log(fixes(50), **NO_INDEX)

    def change(data: bytearray, at: int) -> None:
        where = data.index(b'zstd', at)
        data[where : where + 4] = b'brot'

    change_chunk(path, change)
    with pytest.raises(LogError, match="compression 'brot' is not supported"):
        contents(path)


def test_record_longer_than_the_file(write_log: Write) -> None:
    for options in ({}, NO_INDEX):
        path = write_log(fixes(50), **options)
        change_chunk(path, lambda data, at: struct.pack_into('<Q', data, at + 1, 2**62))
        with pytest.raises(LogError, match=r'byte \d+.*claims 4611686018427387904'):
            contents(path)


def test_data_section_crc_is_checked_when_the_file_is_walked(write_log: Write) -> None:
    path = write_log(fixes(10), use_chunking=False, enable_data_crcs=True)
    data = bytearray(path.read_bytes())
    data[data.find(struct.pack('<d', 48 + 1e-4 * 3)) + 6] ^= 1
    path.write_bytes(data)
    with pytest.raises(LogError, match='data section does not match its CRC'):
        contents(path)


def test_batches_stay_within_a_memory_limit(write_log: Write) -> None:
    path = write_log(fixes(50), chunk_size=10**6)
    with (
        McapFile(path, max_chunk_bytes=1000) as log,
        pytest.raises(LogError, match='at most 1000'),
    ):
        list(log.batches([1]))


@settings(
    max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    changes=st.lists(
        st.tuples(st.floats(0, 0.999999), st.integers(0, 255)), min_size=1, max_size=6
    ),
    cut=st.floats(0.05, 1),
    fix_crc=st.booleans(),
)
def test_damage_is_an_error_or_a_warning_never_a_crash(
    glider_log: Path,
    tmp_path: Path,
    changes: list[tuple[float, int]],
    cut: float,
    fix_crc: bool,
) -> None:
    data = bytearray(glider_log.read_bytes())
    if fix_crc:  # the index is at the end: damage that alone, its CRC right again
        start = struct.unpack_from('<Q', data, len(data) - 28)[0]
        for where, value in changes:
            data[start + int(where * (len(data) - 28 - start))] = value
        stop = len(data) - 12
        struct.pack_into('<I', data, stop, zlib.crc32(data[start:stop]))
    else:
        for where, value in changes:
            data[int(where * len(data))] = value
        del data[int(cut * len(data)) :]
    path = tmp_path / 'damaged.mcap'
    path.write_bytes(data)
    try:
        track = read_track(path)
    except LogError:
        return
    assert track.lat is not None
    assert np.isfinite(track.lat).all()
