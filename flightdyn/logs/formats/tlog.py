"""MAVLink telemetry logs (.tlog) of ground stations: each frame behind the time of its arrival.

Only the positions are decoded, of each system and component apart. Their checksums are verified;
of other messages the framing alone is used.

References
----------
.. [1] MAVLink developer guide, https://mavlink.io/en/guide/serialization.html
"""

import mmap
import re
import struct
from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import LogError
from ..sources import Source
from ..timeline import steady_time
from .reading import OpenedLog, Reading, fix_columns, tracks_of, with_velocity

NAME = 'MAVLink telemetry log'

_V1, _V2 = 0xFE, 0xFD
_MARKER = re.compile(rb'[\xfd\xfe]')
_SIGNED = 0x01
_EPOCHS_US = (946_684_800 * 10**6, 4_102_444_800 * 10**6)  # 2000 to 2100
_MAX_SOURCES = 64


@dataclass(frozen=True)
class _Message:
    """A message with its payload in the order of the wire; `seed` is its CRC_EXTRA."""

    name: str
    seed: int
    kind: str
    layout: np.dtype[np.void]


_MESSAGES = {
    24: _Message(
        'GPS_RAW_INT',
        24,
        'gps_raw',
        np.dtype(
            [('time_usec', '<u8'), ('lat', '<i4'), ('lon', '<i4'), ('alt', '<i4')]
            + [('eph', '<u2'), ('epv', '<u2'), ('vel', '<u2'), ('cog', '<u2')]
            + [('fix_type', 'u1'), ('satellites_visible', 'u1'), ('alt_ellipsoid', '<i4')]
            + [('h_acc', '<u4'), ('v_acc', '<u4')]
        ),
    ),
    33: _Message(
        'GLOBAL_POSITION_INT',
        104,
        'global',
        np.dtype(
            [('time_boot_ms', '<u4'), ('lat', '<i4'), ('lon', '<i4'), ('alt', '<i4')]
            + [('relative_alt', '<i4'), ('vx', '<i2'), ('vy', '<i2'), ('vz', '<i2')]
            + [('hdg', '<u2')]
        ),
    ),
}


@dataclass
class _Stream:
    message: _Message
    arrival: 'array[int]' = field(default_factory=lambda: array('q'))
    payloads: bytearray = field(default_factory=bytearray)


def recognises(head: bytes, path: Path) -> bool:
    """Return whether a file that begins like this is a telemetry log."""
    if len(head) < 20 or head[8] not in (_V1, _V2):
        return False
    (time,) = struct.unpack_from('>Q', head)
    return _EPOCHS_US[0] < time < _EPOCHS_US[1] or path.suffix.lower() == '.tlog'


def open_log(path: Path) -> OpenedLog:
    """Read the positions of a telemetry log.

    Raises
    ------
    LogError
        If there are none.
    """
    streams: dict[str, _Stream] = {}
    systems: set[int] = set()
    damage = _Damage()
    with path.open('rb') as stream:
        data = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
    with data:
        for at, time, message_id, sender, payload, sound in _frames(data, damage):
            systems.add(sender[0])
            message = _MESSAGES.get(message_id)
            if message is None:
                continue
            if not sound(message.seed):
                damage.count('frames with a wrong checksum', at)
                continue
            topic = f'mavlink/{sender[0]}/{sender[1]}/{message.name}'
            if topic not in streams:
                if len(streams) == _MAX_SOURCES:
                    raise LogError(f'{path}: byte {at}: more than {_MAX_SOURCES} senders')
                streams[topic] = _Stream(message)
            size = message.layout.itemsize
            streams[topic].arrival.append(time)
            streams[topic].payloads += payload[:size].ljust(size, b'\0')
    if not streams:
        wanted = ' or '.join(message.name for message in _MESSAGES.values())
        found = ', '.join(str(system) for system in sorted(systems)) or 'none'
        raise LogError(f'{path}: no {wanted} in this telemetry log; systems in it: {found}')
    sources = [
        Source(
            topic,
            f'mavlink.{one.message.name}',
            'mavlink',
            one.message.kind,
            len(one.arrival),
            True,
        )
        for topic, one in streams.items()
    ]
    return OpenedLog(
        path=path,
        format=NAME,
        sources=sources,
        track=tracks_of(path, lambda source: _reading(streams[source.topic]), damage.warnings()),
        metadata={'systems': ' '.join(str(system) for system in sorted(systems))},
        warnings=damage.warnings(),
    )


def _reading(stream: _Stream) -> Reading:
    rows = np.frombuffer(bytes(stream.payloads), stream.message.layout)
    arrival = np.array(stream.arrival, np.int64) * 1000
    raw = stream.message.name == 'GPS_RAW_INT'
    boot = rows['time_usec'] // 1000 if raw else rows['time_boot_ms']
    std: NDArray[np.float64] | None = None
    velocity = np.full((rows.size, 3), np.nan)
    if raw:
        std = np.stack([rows[name] / 1e3 for name in ('h_acc', 'h_acc', 'v_acc')], axis=1)
        status = np.where(rows['fix_type'] < 3, -1, 0)
    else:
        velocity = np.stack([rows[name] / 100 for name in ('vx', 'vy', 'vz')], axis=1)
        status = np.zeros(rows.size)
    columns = fix_columns(
        steady_time(boot.astype(np.int64) * 10**6, arrival),
        rows['lat'] / 1e7,
        rows['lon'] / 1e7,
        rows['alt'] / 1e3,
        status=status.astype(np.int8),
        std_enu=std,
    )
    return Reading(columns=columns, measure=with_velocity(velocity), altitude_datum='msl')


class _Damage:
    """Counts what is wrong, and where it was first."""

    def __init__(self) -> None:
        self._found: dict[str, list[int]] = {}

    def count(self, what: str, at: int, number: int = 1) -> None:
        self._found.setdefault(what, [0, at])[0] += number

    def warnings(self) -> list[str]:
        return [f'{n} {what}, first at byte {at}' for what, (n, at) in self._found.items()]


_Frame = tuple[int, int, int, tuple[int, int], bytes, Callable[[int], bool]]


def _frames(data: mmap.mmap, damage: _Damage) -> Iterator[_Frame]:
    """Yield byte, arrival [us], message id, (system, component), payload and checksum test."""
    at, size = 0, len(data)
    while at + 16 <= size:
        marker, length = data[at + 8], data[at + 9]
        if marker not in (_V1, _V2):
            found = _MARKER.search(data, at + 9)
            following = found.start() - 8 if found else size
            damage.count('bytes that are no MAVLink', at, following - at)
            at = following
            continue
        head = 6 if marker == _V1 else 10
        signature = 13 if marker == _V2 and data[at + 10] & _SIGNED else 0
        begin = at + 8 + head
        end = begin + length
        if end + 2 + signature > size:
            break
        (time,) = struct.unpack_from('>Q', data, at)
        if not _EPOCHS_US[0] < time < _EPOCHS_US[1]:
            damage.count('bytes that are no MAVLink', at)
            at += 1
            continue
        if marker == _V1:
            sender, message_id = (data[at + 11], data[at + 12]), data[at + 13]
        else:
            sender = (data[at + 13], data[at + 14])
            message_id = int.from_bytes(data[at + 15 : at + 18], 'little')
        checked = data[at + 9 : end]
        (told,) = struct.unpack_from('<H', data, end)

        def sound(seed: int, checked: bytes = checked, told: int = told) -> bool:
            return checksum(checked + bytes([seed])) == told

        yield at, time, message_id, sender, data[begin:end], sound
        at = end + 2 + signature
    if at < size:
        damage.count('bytes of a frame that is cut short', at, size - at)


def checksum(data: bytes) -> int:
    """Return the CRC-16/MCRF4XX of MAVLink."""
    crc = 0xFFFF
    for byte in data:
        low = (byte ^ crc) & 0xFF
        low = (low ^ (low << 4)) & 0xFF
        crc = (crc >> 8) ^ (low << 8) ^ (low << 3) ^ (low >> 4)
    return crc
