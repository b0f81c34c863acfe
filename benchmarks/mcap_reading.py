"""How fast NavSatFix columns are read from an MCAP, against rosbags; CPU seconds, best of five.

Run: python benchmarks/mcap_reading.py [LOG ...]. Without a log a synthetic one is written: half of
its messages are fixes, the other half is not asked for.
"""

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer
from rosbags.highlevel import AnyReader

from flightdyn.logs.mcap_columns import read_columns
from flightdyn.logs.mcap_container import McapFile
from flightdyn.logs.measurements import FIX_FIELDS
from flightdyn.logs.messages import schema_text, serialize, typestore
from flightdyn.logs.sources import list_sources

FIX = 'sensor_msgs/msg/NavSatFix'


def write_log(path: Path, number: int, compression: CompressionType) -> None:
    """Write `number` fixes on /fix and as many on /other."""
    types = typestore().types
    rng = np.random.default_rng(1)
    with path.open('wb') as stream:
        writer = Writer(stream, compression=compression)
        writer.start(profile='ros2')
        schema = writer.register_schema(FIX, 'ros2msg', schema_text(FIX).encode())
        channels = [writer.register_channel(t, 'cdr', schema) for t in ('/fix', '/other')]
        walk = np.cumsum(rng.normal(0, 1e-6, (number, 3)), axis=0)
        for i in range(number):
            ns = 1_700_000_000 * 10**9 + i * 10**7
            header = types['std_msgs/msg/Header'](
                types['builtin_interfaces/msg/Time'](ns // 10**9, ns % 10**9), 'gps'
            )
            status = types['sensor_msgs/msg/NavSatStatus'](0, 1)
            message = types[FIX](
                header,
                status,
                48 + walk[i, 0],
                9 + walk[i, 1],
                500 + walk[i, 2],
                np.eye(3).ravel(),
                2,
            )
            data = serialize(FIX, message)
            for channel in channels:
                writer.add_message(channel, ns, data, ns)
        writer.finish()


def read_here(path: Path, topic: str) -> int:
    """Return how many fixes were read into columns."""
    with McapFile(path) as log:
        source = next(s for s in list_sources(log) if s.topic == topic)
        return len(read_columns(log, source.channels, FIX_FIELDS))


def read_with_rosbags(path: Path, topic: str) -> int:
    """Return how many fixes were deserialised one by one."""
    with AnyReader([path]) as bag:
        wanted = [c for c in bag.connections if c.topic == topic]
        rows = [
            (m.header.stamp.sec, m.latitude, m.longitude, m.altitude)
            for c, _, raw in bag.messages(wanted)
            for m in [bag.deserialize(raw, c.msgtype)]
        ]
    return len(np.array(rows))


def best(function: Callable[[], int], repeat: int = 5) -> tuple[int, float]:
    """Return what a function returned and the least CPU time it took."""
    times = []
    for _ in range(repeat):
        start = time.process_time()
        number = function()
        times.append(time.process_time() - start)
    return number, min(times)


def compare(path: Path, name: str) -> None:
    """Print messages per CPU second of both readers."""
    topic = next(s.topic for s in list_sources(path) if s.schema == FIX)
    number, here = best(lambda: read_here(path, topic))
    _, rosbags = best(lambda: read_with_rosbags(path, topic), 2)
    print(
        f'{name}: {number} fixes; flightdyn {number / here:,.0f}/s, '
        f'rosbags {number / rosbags:,.0f}/s, ratio {rosbags / here:.1f}'
    )


def main(paths: list[str]) -> None:
    """Compare on the given logs or on synthetic ones."""
    for path in paths:
        compare(Path(path), path)
    if not paths:
        with tempfile.TemporaryDirectory() as folder:
            for compression in CompressionType:
                path = Path(folder) / f'{compression.name}.mcap'
                write_log(path, 50_000, compression)
                compare(path, compression.name)


if __name__ == '__main__':
    main(sys.argv[1:])
