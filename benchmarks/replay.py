"""How fast positions are read from MCAP, against other readers and the cost of unpacking alone.

Run: python benchmarks/replay.py [--messages N] [--megabytes N]. CPU seconds, least of several.

Logs are made first. `fixes`: N NavSatFix and N TwistStamped by turns; the fixes are wanted.
`px4`: N px4_msgs VehicleLocalPosition and four times as many of another topic. `cameras`: two
cameras of 10 Hz and a receiver of 10 Hz; the images make up the size, the fixes are wanted.
Peers that are not installed are left out: `pip install 'flightdyn[bench]'`. What every reader
found is compared; `flightdyn` has to agree with rosbags bit by bit.
"""

import argparse
import struct
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import zstandard
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader

from flightdyn.logs.decoders import decoded_columns
from flightdyn.logs.mcap_columns import Columns
from flightdyn.logs.mcap_container import McapFile
from flightdyn.logs.measurements import FIX_FIELDS
from flightdyn.logs.messages import schema_text, serialize, typestore
from flightdyn.logs.sources import list_sources

START_NS = 1_700_000_000 * 10**9
FIX, TWIST = 'sensor_msgs/msg/NavSatFix', 'geometry_msgs/msg/TwistStamped'
LOCAL = 'px4_msgs/msg/VehicleLocalPosition'
LOCAL_TEXT = 'uint64 timestamp\nuint64 timestamp_sample\nbool xy_valid\nbool z_valid\n' + ''.join(
    f'float32 {name}\n' for name in 'x y z vx vy vz ax ay az heading eph epv evh evv'.split()
)
LOCAL_FIELDS = ('timestamp', 'x', 'y', 'z', 'vx', 'vy', 'vz')
IMAGE = 'uint32 height\nuint32 width\nuint8[] data\n'

Rows = NDArray[np.float64]
Stream = Iterator[tuple[str, int, bytes]]


def fixes(number: int, period_ns: int, topic: str = '/fix') -> Stream:
    """Yield topic, time and payload of fixes along a random walk."""
    types = typestore().types
    stamp = types['builtin_interfaces/msg/Time'](0, 0)
    status = types['sensor_msgs/msg/NavSatStatus'](0, 1)
    covariance = np.diag([2.25, 2.25, 6.25]).ravel()
    header = types['std_msgs/msg/Header'](stamp, 'gps')
    template = types[FIX](header, status, 1.5, 2.5, 3.5, covariance, 2)
    data = bytearray(serialize(FIX, template))
    places = [data.find(struct.pack('<d', value)) for value in (1.5, 2.5, 3.5)]
    walk = np.cumsum(np.random.default_rng(1).normal(0, 1e-5, (number, 3)), axis=0) + [48, 9, 500]
    for i, position in enumerate(walk.tolist()):
        ns = START_NS + i * period_ns
        struct.pack_into('<iI', data, 4, ns // 10**9, ns % 10**9)
        for at, value in zip(places, position, strict=True):
            struct.pack_into('<d', data, at, value)
        yield topic, ns, bytes(data)


def fixes_and_twists(number: int) -> Stream:
    """Yield fixes and twists by turns."""
    twist = bytearray(4 + 8 + 4 + 4 + 4 + 48)
    struct.pack_into('<IiiI4s', twist, 0, 0x100, 0, 0, 4, b'gps\0')
    values = np.random.default_rng(2).normal(0, 3, (number, 6)).astype('<f8')
    for (topic, ns, data), row in zip(fixes(number, 5_000_000), values, strict=True):
        yield topic, ns, data
        struct.pack_into('<iI', twist, 4, ns // 10**9, ns % 10**9)
        twist[24:] = row.tobytes()
        yield '/twist', ns, bytes(twist)


def px4(number: int) -> Stream:
    """Yield positions, and four other messages to each."""
    layout = np.dtype('<u4,<u8,<u8,?,?,V2,(14,)<f4')
    rows = np.zeros(number, layout)
    rows['f0'] = 0x100
    times = START_NS // 1000 + np.arange(number) * 10_000
    rows['f1'] = rows['f2'] = times
    rows['f3'] = rows['f4'] = True
    walk = np.random.default_rng(3).normal(0, 0.1, (number, 14))
    rows['f6'] = np.cumsum(walk, axis=0).astype('f4')
    other = np.random.default_rng(4).normal(0, 1, (4 * number, 14)).astype('<f4')
    for i, us in enumerate(times.tolist()):
        data = rows[i].tobytes()
        yield '/local', us * 1000, data
        for k in range(4):
            yield '/other', us * 1000 + k, data[:24] + other[4 * i + k].tobytes()


def cameras(megabytes: int) -> Stream:
    """Yield images of two cameras, and a fix with each pair."""
    pairs = max(megabytes // 2, 2)
    pixels = np.random.default_rng(5).integers(0, 256, 2**20, np.uint8).tobytes()
    for i, fix in enumerate(fixes(pairs, 100_000_000)):
        yield fix
        for camera in ('/left', '/right'):
            head = struct.pack('<IIII', 0x100, 1024, 1024, len(pixels))
            cut = i * 997 % len(pixels)
            yield camera, fix[1] + 1, head + pixels[cut:] + pixels[:cut]


SCHEMAS = {
    '/fix': (FIX, None),
    '/twist': (TWIST, None),
    '/local': (LOCAL, LOCAL_TEXT),
    '/other': ('px4_msgs/msg/Other', LOCAL_TEXT),
    '/left': ('bench_msgs/msg/Image', IMAGE),
    '/right': ('bench_msgs/msg/Image', IMAGE),
}


def write_log(path: Path, stream: Stream, compression: CompressionType, index: bool) -> None:
    """Write messages as a recorder would; without index if so wanted."""
    with path.open('wb') as file:
        writer = Writer(file, compression=compression)
        writer.start(profile='ros2')
        channels: dict[str, int] = {}
        for topic, ns, data in stream:
            if topic not in channels:
                name, text = SCHEMAS[topic]
                definition = (text or schema_text(name)).encode()
                schema = writer.register_schema(name, 'ros2msg', definition)
                channels[topic] = writer.register_channel(topic, 'cdr', schema)
            writer.add_message(channels[topic], ns, data, ns)
        writer.finish()
    if not index:  # as if the recorder had been killed
        data = path.read_bytes()
        start = struct.unpack_from('<Q', data, len(data) - 28)[0]
        path.write_bytes(data[: start - 13])


def unpack_only(path: Path, topic: str) -> int:
    """Unpack the chunks that hold a topic, and do nothing with them; return their bytes."""
    total = 0
    codec = zstandard.ZstdDecompressor()
    buffer = bytearray(2**20)
    with path.open('rb') as file:
        summary = make_reader(file).get_summary()
        assert summary is not None
        wanted = {key for key, c in summary.channels.items() if c.topic == topic}
        for chunk in summary.chunk_indexes:
            if not wanted.intersection(chunk.message_index_offsets):
                continue
            file.seek(chunk.chunk_start_offset + 9 + 8 + 8 + 8 + 4)
            size = struct.unpack('<I', file.read(4))[0]
            file.seek(size + 8, 1)
            packed = file.read(chunk.compressed_size)
            if len(buffer) < chunk.uncompressed_size:
                buffer = bytearray(chunk.uncompressed_size)
            if chunk.compression == 'zstd':
                view = memoryview(buffer)[: chunk.uncompressed_size]
                with codec.stream_reader(packed) as reader:
                    while view and (count := reader.readinto(view)):
                        view = view[count:]
            elif chunk.compression == 'lz4':
                import pyarrow

                pyarrow.Codec('lz4').decompress(packed, chunk.uncompressed_size)
            total += chunk.uncompressed_size
    return total


def with_flightdyn(path: Path, topic: str, fields: tuple[str, ...]) -> Columns:
    """Return the wanted fields by flightdyn's reader."""
    with McapFile(path) as log:
        source = next(s for s in list_sources(log) if s.topic == topic)
        return decoded_columns(log, source.channels, fields)


def with_rosbags(path: Path, topic: str, fields: tuple[str, ...]) -> Rows:
    """Return the same by rosbags, message by message."""
    with AnyReader([path]) as bag:
        wanted = [c for c in bag.connections if c.topic == topic]
        found = (bag.deserialize(raw, c.msgtype) for c, _, raw in bag.messages(wanted))
        return rows_of(found, fields)


def with_mcap(path: Path, topic: str, fields: tuple[str, ...], factory: Any = None) -> Rows:
    """Return the same by the mcap package and one of its ROS 2 decoders."""
    with path.open('rb') as file:
        reader = make_reader(file, decoder_factories=[factory()])
        found = (m for *_, m in reader.iter_decoded_messages(topics=[topic]))
        return rows_of(found, fields)


def with_mcap_raw(path: Path, topic: str, fields: tuple[str, ...]) -> None:
    """Go through the messages with the mcap package, none decoded."""
    with path.open('rb') as file:
        for _ in make_reader(file).iter_messages(topics=[topic]):
            pass


def picked(fields: tuple[str, ...]) -> list[str]:
    """Return the fields that readers are compared by: numbers, not strings or arrays."""
    return [name for name in fields if 'frame_id' not in name and 'covariance' not in name]


def rows_of(found: Any, fields: tuple[str, ...]) -> Rows:
    """Return the compared fields of messages."""
    paths = [name.split('.') for name in picked(fields)]
    rows = []
    for message in found:
        row = []
        for parts in paths:
            value = message
            for part in parts:
                value = getattr(value, part)
            row.append(value)
        rows.append(row)
    return np.array(rows, float)


def peers() -> dict[str, Callable[..., Rows | None]]:
    """Return the readers that are installed."""
    found: dict[str, Callable[..., Rows | None]] = {
        'rosbags': with_rosbags,
        'mcap, not decoded': with_mcap_raw,
    }
    for name in ('mcap_ros2_support_fast', 'mcap_ros2'):
        try:
            factory = __import__(f'{name}.decoder', fromlist=['DecoderFactory']).DecoderFactory
        except ImportError:
            print(f'{name} is not installed')
            continue

        def read(*arguments: Any, factory: Any = factory) -> Rows:
            return with_mcap(*arguments, factory=factory)

        found[f'mcap + {name}'] = read
    return found


def least(function: Callable[[], Any], repeat: int) -> tuple[Any, float]:
    """Return what a function returned and the least CPU time it took."""
    times = []
    for _ in range(repeat):
        start = time.process_time()
        result = function()
        times.append(time.process_time() - start)
    return result, min(times)


def compare(path: Path, name: str, topic: str, fields: tuple[str, ...], with_peers: bool) -> None:
    """Print what every reader takes for a log."""
    columns, here = least(lambda: with_flightdyn(path, topic, fields), 9)
    rows = np.stack([columns[name].astype(float) for name in picked(fields)], axis=1)
    size = path.stat().st_size / 1e6
    print(f'\n{name}: {size:.0f} MB, {len(rows)} messages wanted')
    print(f'  {"flightdyn":<30} {here:>8.4f} s {len(rows) / here / 1e6:>8.3f} M/s')
    if with_peers:
        unpacked, limit = least(lambda: unpack_only(path, topic), 9)
        rate = unpacked / 1e6 / limit
        print(
            f'  {"unpacking alone":<30} {limit:>8.4f} s {here / limit:>8.2f} times that, '
            f'{unpacked / 1e6:.0f} MB, {rate:.0f} MB/s'
        )
        for peer, read in peers().items():
            found, taken = least(lambda read=read: read(path, topic, fields), 2)  # type: ignore[misc]
            agrees = '' if found is None or np.array_equal(found, rows) else ', BUT IT DIFFERS'
            print(f'  {peer:<30} {taken:>8.4f} s {taken / here:>8.1f} times as long{agrees}')
            if agrees and peer == 'rosbags':
                sys.exit(f'flightdyn read other values than rosbags from {path}')


def main() -> None:
    """Compare the readers on every kind of log."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').splitlines()[0])
    parser.add_argument('--messages', type=int, default=100_000, help='default: 100000')
    parser.add_argument('--megabytes', type=int, default=300, help='of images; default: 300')
    arguments = parser.parse_args()
    number = arguments.messages
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'log.mcap'
        for compression in (CompressionType.ZSTD, CompressionType.LZ4, CompressionType.NONE):
            name = compression.name.lower()
            write_log(path, fixes_and_twists(number), compression, True)
            compare(path, f'fixes, {name}', '/fix', FIX_FIELDS, True)
            write_log(path, fixes_and_twists(number), compression, False)
            compare(path, f'fixes, {name}, no index', '/fix', FIX_FIELDS, False)
            write_log(path, px4(number), compression, True)
            compare(path, f'px4, {name}', '/local', LOCAL_FIELDS, compression.name == 'ZSTD')
            write_log(path, cameras(arguments.megabytes), compression, True)
            compare(path, f'cameras, {name}', '/fix', FIX_FIELDS, compression.name == 'ZSTD')


if __name__ == '__main__':
    main()
