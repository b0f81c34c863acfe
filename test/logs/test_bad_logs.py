"""Broken logs at the command line: the right exit code, one clear line, bounded memory and time.

Every file is made here, out of a sound one with one thing wrong.
"""

import contextlib
import json
import resource
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from log_making import NO_INDEX, START_NS, Message, fixes, nav_sat_fix
from mcap.writer import CompressionType

from flightdyn.cli import main
from flightdyn.errors import LogError
from flightdyn.logs.any_log import describe, read_track

Write = Callable[..., Path]

FIX = 'sensor_msgs/msg/NavSatFix'
GOOD = fixes(40)
MAGIC = b'\x89MCAP0\r\n'


def record(opcode: int, content: bytes) -> bytes:
    return struct.pack('<BQ', opcode, len(content)) + content


def text(value: str | bytes) -> bytes:
    raw = value.encode() if isinstance(value, str) else value
    return struct.pack('<I', len(raw)) + raw


def schema(
    name: str = FIX, encoding: str = 'ros2msg', definition: str = '', id_: int = 1
) -> bytes:
    return record(3, struct.pack('<H', id_) + text(name) + text(encoding) + text(definition))


def channel(schema_id: int = 1, encoding: str = 'cdr', topic: str = '/fix') -> bytes:
    head = struct.pack('<HH', 1, schema_id)
    return record(4, head + text(topic) + text(encoding) + struct.pack('<I', 0))


def messages(which: Iterable[Message] = GOOD) -> bytes:
    return b''.join(
        record(5, struct.pack('<HIQQ', 1, 0, ns, ns) + payload) for _, ns, payload in which
    )


def chunk(
    content: bytes,
    *,
    compression: str = 'zstd',
    size: int | None = None,
    crc: int | None = None,
    not_packed: bool = False,
) -> bytes:
    packed = zstandard.compress(content) if compression == 'zstd' else content
    if not_packed:
        packed = content
    head = struct.pack(
        '<QQQI',
        START_NS,
        START_NS,
        len(content) if size is None else size,
        zlib.crc32(content) if crc is None else crc,
    )
    return record(6, head + text(compression) + struct.pack('<Q', len(packed)) + packed)


def mcap(*records: bytes) -> bytes:
    """Return a file without summary."""
    footer = record(2, struct.pack('<QQI', 0, 0, 0))
    header = record(1, text('ros2') + text('test'))
    return b''.join([MAGIC, header, *records, record(15, bytes(4)), footer, MAGIC])


def fix_chunk(**options: Any) -> bytes:
    return chunk(schema() + channel() + messages(), **options)


HOPELESS: dict[str, tuple[bytes, str]] = {
    'empty': (b'', 'empty'),
    'magic only': (MAGIC, 'byte 8'),
    'ROS 1 bag by another name': (b'#ROSBAG V2.0\n' + bytes(80), 'ROS 1 bag'),
    'later version': (b'\x89MCAP9' + mcap()[6:], 'unsupported MCAP version'),
    'no messages': (mcap(schema(), channel()), 'no messages'),
    'unknown compression': (
        mcap(fix_chunk(compression='brotli')),
        "compression 'brotli' is not supported",
    ),
    'compression of control characters': (
        mcap(fix_chunk(compression='\x1b[2J' + 1000 * 'z')),
        "z'... is not supported",
    ),
    'size of 2**60': (mcap(fix_chunk(size=2**60)), 'claims to unpack to 1152921504606846976'),
    'size too small': (mcap(fix_chunk(size=100)), 'more than the 100 bytes'),
    'size too large': (mcap(fix_chunk(size=10**6)), '1000000 were announced'),
    'wrong CRC': (mcap(fix_chunk(crc=1)), 'CRC'),
    'not zstd': (mcap(fix_chunk(not_packed=True)), 'does not unpack'),
    'record of 2**62': (
        mcap(fix_chunk(), struct.pack('<BQ', 6, 2**62) + bytes(40)),
        'claims 4611686018427387904',
    ),
    'record of 2**62 in a chunk': (
        mcap(chunk(schema() + channel() + struct.pack('<BQ', 5, 2**62) + bytes(40))),
        'inside the chunk',
    ),
    'no schema': (mcap(channel(0), messages()), '/fix .*has no schema'),
    'schema 7 of none': (mcap(schema(), channel(7), messages()), 'schema id 7'),
    'schema of nonsense': (mcap(schema(definition='float64 [x'), channel(), messages()), '/fix'),
    'other encoding': (
        mcap(schema('foxglove.LocationFix', 'capnproto'), channel(1, 'capnproto'), messages()),
        "encoding 'capnproto'",
    ),
    'message of no channel': (mcap(schema(), messages()), 'channel 1'),
    'one message': (mcap(schema(), channel(), messages(GOOD[:1])), '1 usable of 1'),
    'no fix': (mcap(schema(), channel(), messages(fixes(9, status=-1))), r'9 no fix'),
    'one time': (
        mcap(schema(), channel(), messages([('/fix', 5, nav_sat_fix(5))] * 9)),
        'at least two at different times',
    ),
    'all too short': (
        mcap(schema(), channel(), messages([(t, ns, d[:40]) for t, ns, d in GOOD])),
        '40 shorter than its schema',
    ),
}


@pytest.mark.parametrize('what', HOPELESS)
def test_what_cannot_be_replayed_is_one_line(
    what: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data, says = HOPELESS[what]
    path = tmp_path / 'bad.mcap'
    path.write_bytes(data)
    with pytest.raises(LogError, match=says):
        read_track(path)
    assert main(['replay', str(path), '-o', str(tmp_path / 'out.csv')]) == 2
    told = capsys.readouterr()
    assert told.out == ''
    assert str(path) in told.err
    assert len(told.err.strip().splitlines()) == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ['bad.mcap']
    assert main(['info', str(path)]) in (0, 2)
    assert 'Traceback' not in capsys.readouterr().err


def moved(*, at: int, **fix: Any) -> list[Message]:
    """The good messages, one of them at another place."""
    topic, ns, _ = GOOD[at]
    return [*GOOD[:at], (topic, ns, nav_sat_fix(ns, **fix)), *GOOD[at + 1 :]]


MENDED: dict[str, tuple[bytes, int, dict[str, int], str]] = {
    'nothing wrong': (mcap(fix_chunk()), 40, {}, ''),
    'no chunks': (mcap(schema(), channel(), messages()), 40, {}, ''),
    'two frames in a chunk': (
        mcap(
            chunk(schema() + channel()),
            chunk(messages(GOOD[:9])),
            chunk(messages(GOOD[9:]), compression='none'),
        ),
        40,
        {},
        '',
    ),
    'unknown records': (mcap(record(0x7F, b'?'), fix_chunk(), record(0x80, b'')), 40, {}, ''),
    'cut in the second chunk': (
        mcap(fix_chunk(), chunk(messages()))[:-600],
        40,
        {},
        'the recording was cut short',
    ),
    'nonsense at the end': (mcap(fix_chunk())[:-40] + bytes(99), 40, {}, 'the end of the file'),
    'short messages': (
        mcap(
            schema(),
            channel(),
            messages((t, n, d[: 40 if i % 10 == 3 else None]) for i, (t, n, d) in enumerate(GOOD)),
        ),
        36,
        {'shorter than its schema': 4},
        '',
    ),
    'NaN': (
        mcap(schema(), channel(), messages(moved(at=7, lat=float('nan')))),
        39,
        {'position not finite': 1},
        '',
    ),
    'beyond the pole': (
        mcap(schema(), channel(), messages(moved(at=7, lat=95.3))),
        39,
        {'position out of range': 1},
        '',
    ),
    'big endian': (
        mcap(schema(), channel(), messages(fixes(40, little_endian=False))),
        40,
        {},
        '',
    ),
}


@pytest.mark.parametrize('what', MENDED)
def test_what_can_be_used_is_used_and_the_rest_counted(
    what: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data, used, dropped, says = MENDED[what]
    path = tmp_path / 'log.mcap'
    path.write_bytes(data)
    assert main(['replay', str(path), '--json']) == 0
    told = capsys.readouterr()
    summary = json.loads(told.out)
    assert (summary['messages'], summary['used'], summary['dropped']) == (40, used, dropped)
    assert says in told.err
    # 1e-4 deg north and 2e-4 deg east a second at 48 deg north is 18.6 m/s, 3 m/s up
    assert summary['max_speed'] == pytest.approx(18.9, abs=0.3)


def run_limited(path: Path, megabytes: int) -> subprocess.CompletedProcess[str]:
    """Replay in a process that may not hold more than so much memory."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_DATA, (megabytes * 2**20,) * 2)

    command = [sys.executable, '-m', 'flightdyn', 'replay', str(path)]
    return subprocess.run(
        command, capture_output=True, text=True, check=False, timeout=60, preexec_fn=limit
    )


def test_bombs_are_refused_in_bounded_memory(tmp_path: Path) -> None:
    zeros = zstandard.ZstdCompressor().compressobj()
    packed = b''.join(zeros.compress(bytes(2**24)) for _ in range(128)) + zeros.flush()
    for claimed in (2**31, 2**28, 2**20):
        head = struct.pack('<QQQI', START_NS, START_NS, claimed, 0)
        bomb = record(6, head + text('zstd') + struct.pack('<Q', len(packed)) + packed)
        path = tmp_path / 'bomb.mcap'
        path.write_bytes(mcap(schema(), channel(), messages(), bomb))
        done = run_limited(path, 500)
        assert done.returncode == 2
        assert len(done.stderr.strip().splitlines()) == 1
        assert 'byte ' in done.stderr


@pytest.mark.slow
def test_many_tiny_records_take_bounded_memory(tmp_path: Path) -> None:
    """Seven million records of nothing, in 100 kB."""
    nothing = record(0x7F, b'') * (2**23 - 10**6)
    path = tmp_path / 'tiny.mcap'
    path.write_bytes(mcap(chunk(schema() + channel() + messages() + nothing)))
    assert path.stat().st_size < 10**5
    assert run_limited(path, 500).returncode == 0


FUZZ = {
    'deadline': None,
    'suppress_health_check': [HealthCheck.function_scoped_fixture],
    'derandomize': True,
}
changes_of = st.lists(
    st.tuples(st.integers(0, 2**16), st.binary(min_size=1, max_size=9)), max_size=6
)


def try_damaged(
    write_log: Write,
    tmp_path: Path,
    changes: list[tuple[int, bytes]],
    cut: float,
    indexed: bool,
    lie: int | None,
) -> None:
    """Read a log some bytes of which were changed, no CRC telling of it."""
    path = write_log(
        GOOD, compression=CompressionType.NONE, enable_crcs=False, **({} if indexed else NO_INDEX)
    )
    data = bytearray(path.read_bytes())
    for at, piece in changes:
        at %= len(data)
        data[at : at + len(piece)] = piece
    if lie is not None:  # a length of some record, where it surely is one
        at = 8
        for _ in range(lie % 30):
            if at + 9 < len(data):
                at += 9 + min(struct.unpack_from('<Q', data, at + 1)[0], len(data))
        if at + 9 < len(data):
            struct.pack_into('<Q', data, at + 1, lie)
    path = tmp_path / 'damaged.mcap'
    path.write_bytes(data[: int(cut * len(data))])
    for read in (describe, read_track):
        with contextlib.suppress(LogError):
            read(path)


arguments = {
    'changes': changes_of,
    'cut': st.just(1.0) | st.floats(0, 1),
    'indexed': st.booleans(),
    'lie': st.none() | st.integers(0, 2**64 - 1),
}


@settings(max_examples=250, **FUZZ)
@given(**arguments)
def test_damage_without_crc_is_an_error_never_a_crash(
    write_log: Write, tmp_path: Path, **damage: Any
) -> None:
    try_damaged(write_log, tmp_path, **damage)


@pytest.mark.slow
@pytest.mark.timeout(1200)
@settings(max_examples=10_000, **FUZZ)
@given(**arguments)
def test_much_damage_without_crc(write_log: Write, tmp_path: Path, **damage: Any) -> None:
    try_damaged(write_log, tmp_path, **damage)
