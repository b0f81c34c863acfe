"""Records found many at a time are those found one by one."""

import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightdyn.logs.mcap_records import DamageError
from flightdyn.logs.mcap_walking import by_channel, values_at, walk


def record(opcode: int, content: bytes) -> bytes:
    return struct.pack('<BQ', opcode, len(content)) + content


def message(payload: bytes, channel: int = 1) -> bytes:
    return record(5, struct.pack('<HIQQ', channel, 0, 7, 8) + payload)


def one_by_one(data: bytes) -> tuple[list[tuple[int, int, int]], int | None]:
    """Return opcode, begin and end of each record, and where the first damaged one begins."""
    found, at = [], 0
    while at < len(data):
        if len(data) - at < 9:
            return found, at
        opcode, length = struct.unpack_from('<BQ', data, at)
        if opcode == 0 or length > len(data) - at - 9 or (opcode == 5 and length < 22):
            return found, at
        found.append((opcode, at, at + 9 + length))
        at += 9 + length
    return found, None


def walked(data: bytes) -> tuple[list[tuple[int, int, int]], int | None]:
    found: list[tuple[int, int, int]] = []
    array = np.frombuffer(data, np.uint8)
    try:
        for opcode, offsets, body, end in walk(array, 0, len(data)):
            assert body == offsets[0] + 9
            ends = [*offsets[1:].tolist(), end]
            found += [(opcode, a, b) for a, b in zip(offsets.tolist(), ends, strict=True)]
    except DamageError as damage:
        return found, damage.offset
    return found, None


# payloads that look like records are what could go wrong
payload = st.one_of(
    st.binary(max_size=60),
    st.builds(lambda n: message(bytes(n)), st.integers(0, 40)),
    st.builds(
        lambda n, m: bytes(n) + message(b'')[: m + 9], st.integers(0, 9), st.integers(0, 40)
    ),
    st.builds(lambda n: struct.pack('<BQ', 5, n) * 4, st.integers(22, 80)),
    st.just(bytes(5000)),
)
piece = st.one_of(
    st.builds(message, payload, st.integers(0, 3)),
    st.builds(lambda p, n: message(p) * n, payload, st.integers(1, 300)),
    st.builds(record, st.sampled_from([3, 4, 0x7F]), st.binary(max_size=9)),
)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.lists(piece, max_size=12), st.binary(max_size=30), st.floats(0, 1), st.booleans())
def test_walk_finds_what_is_there(
    pieces: list[bytes], damage: bytes, where: float, cut: bool
) -> None:
    data = bytearray(b''.join(pieces))
    at = int(where * len(data))
    if cut:
        del data[at:]
    else:
        data[at : at + len(damage)] = damage
    assert walked(bytes(data)) == one_by_one(bytes(data))


def test_a_payload_that_looks_like_a_message_each_time() -> None:
    """Bytes in every message that would be a record of just the right length to be reached."""
    inner = message(b'')
    data = b''.join(message(bytes(i % 3) + inner) for i in range(5000))
    assert walked(data) == one_by_one(data)


def test_walk_says_where_the_damage_is() -> None:
    data = np.frombuffer(message(b'') * 3 + record(5, bytes(21)), np.uint8)
    with pytest.raises(DamageError, match=r'byte 93: a message record is too short'):
        list(walk(data, 0, data.size))
    with pytest.raises(DamageError, match=r'byte 31: 5 bytes are too few'):
        list(walk(data, 0, 36))


def test_messages_by_channel() -> None:
    channels = [3, 1, 3, 2, 1, 3]
    data = np.frombuffer(b''.join(message(b'', key) for key in channels), np.uint8)
    offsets = np.arange(6) * 31
    found = by_channel(data, offsets)
    assert {key: part.tolist() for key, part in found.items()} == {
        1: [31, 124],
        2: [93],
        3: [0, 62, 155],
    }
    assert list(by_channel(data, offsets[:1])) == [3]
    assert by_channel(data, offsets[:0]) == {}


def test_values_wherever_they_are() -> None:
    data = np.arange(12, dtype=np.uint8)
    assert values_at(data, np.array([1, 8]), '<u4').tolist() == [0x04030201, 0x0B0A0908]
    assert values_at(data[:0], np.array([], int), '<u4').size == 0
