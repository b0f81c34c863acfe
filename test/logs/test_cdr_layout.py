"""Messages fetched as rows are what the steps one by one, and rosbags, make of them."""

import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from log_making import START_NS, STORE, nav_sat_fix, stamp

from flightdyn.logs.cdr import FAULTS, CdrDecoder
from flightdyn.logs.cdr_layout import Layout, rows_at, text_of
from flightdyn.logs.definitions import Field, builtin_definitions

FIX, JOINTS = 'sensor_msgs/msg/NavSatFix', 'sensor_msgs/msg/JointState'
FIELDS = (
    'header.stamp.sec',
    'header.frame_id',
    'latitude',
    'position_covariance',
    'status.status',
)


def decoder() -> CdrDecoder:
    return CdrDecoder(builtin_definitions(), FIX, FIELDS)


def joined(messages: list[bytes], before: bytes = bytes(31)) -> tuple[np.ndarray, ...]:
    """Return data with the messages in it, and where each begins and ends."""
    start, end, data = [], [], b''
    for message in messages:
        data += before
        start.append(len(data))
        data += message
        end.append(len(data))
    return np.frombuffer(data, np.uint8), np.array(start), np.array(end)


message = st.builds(
    lambda lat, frame, big, cut, word: (
        (nav_sat_fix(START_NS, lat, frame=frame, little_endian=not big) + b'more')[:cut],
        word,
    ),
    lat=st.floats(-90, 90),
    frame=st.sampled_from(['gps', 'gps', 'gps', 'map', '', 'antenna', 'gp\0']),
    big=st.sampled_from([False, False, False, True]),
    cut=st.sampled_from([None, None, None, -4, 40, 3, 0]),
    word=st.sampled_from([None, None, None, b'\0\3', b'\0\7']),
)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.lists(message, max_size=30), st.sampled_from([b'', bytes(31)]))
def test_rows_are_what_the_steps_find(made: list[tuple[bytes, bytes | None]], gap: bytes) -> None:
    messages = [m if word is None or len(m) < 2 else word + m[2:] for m, word in made]
    data, start, end = joined(messages, gap)
    fast, slow = decoder(), decoder()
    found, expected = fast.empty(len(messages)), slow.empty(len(messages))
    fault = fast.decode(data, start, end, found)
    # each by itself: no row fits where nothing is in front of it
    for i, payload in enumerate(messages):
        one = np.frombuffer(payload, np.uint8)
        part = {name: column[i : i + 1] for name, column in expected.items()}
        (why,) = slow.decode(one, np.array([0]), np.array([one.size]), part)
        assert FAULTS[fault[i]] == FAULTS[why]
    for name, column in expected.items():
        sound = fault == 0
        np.testing.assert_array_equal(found[name][sound], column[sound])


def test_layout_of_a_fix() -> None:
    payload = nav_sat_fix(START_NS, 48.5, 9.0, 500.0)
    fields = decoder()._wanted
    layout = Layout.of(decoder()._steps, fields, payload)
    assert layout is not None
    assert layout.size <= len(payload)
    assert set(layout.numbers) | set(layout.texts) == set(FIELDS)
    assert layout.row.itemsize % 8 == 0  # so that numbers are aligned in every row
    data, start, end = joined([payload] * 5 + [b''])
    into = decoder().empty(6)
    assert layout.decode(data, start, end, into).tolist() == [5]
    assert into['latitude'].tolist() == [48.5] * 5 + [0]
    assert into['header.frame_id'].tolist() == ['gps'] * 5 + [None]


@pytest.mark.parametrize(
    'payload', [b'', b'\0\1', b'\0\3\0\0' + bytes(200), nav_sat_fix(START_NS)[:50]]
)
def test_no_layout_of_what_is_not_sound(payload: bytes) -> None:
    assert Layout.of(decoder()._steps, decoder()._wanted, payload) is None


def test_sequences_of_numbers_in_front_are_stepped_over() -> None:
    definitions = {
        'a/msg/A': (
            Field('values', 'uint16', 'sequence'),
            Field('after', 'float64', 'scalar'),
        )
    }
    steps = CdrDecoder(definitions, 'a/msg/A', ['after'])
    # a count, two or three values, padding up to a multiple of 8, the number
    two = struct.pack('<4xIHHd', 2, 7, 7, 1.5).replace(bytes(4), b'\0\1\0\0', 1)
    three = struct.pack('<4xIHHH6xd', 3, 7, 7, 7, 2.5).replace(bytes(4), b'\0\1\0\0', 1)
    data, start, end = joined([two, two, three, two])
    layout = Layout.of(steps._steps, steps._wanted, two)
    assert layout is not None
    into = steps.empty(4)
    assert layout.decode(data, start, end, into).tolist() == [2]
    assert into['after'].tolist() == [1.5, 1.5, 0, 1.5]
    assert steps.decode(data, start, end, into).tolist() == [0] * 4
    assert into['after'].tolist() == [1.5, 1.5, 2.5, 1.5]


def test_sequences_that_are_wanted_or_hold_strings_have_no_layout() -> None:
    values = [np.arange(2.0) for _ in range(3)]
    message = STORE.types[JOINTS](stamp(START_NS), ['a', 'bc'], *values)
    payload = bytes(STORE.serialize_cdr(message, JOINTS))
    steps = CdrDecoder(builtin_definitions(), JOINTS, ['effort'])
    assert Layout.of(steps._steps, steps._wanted, payload) is None
    into = steps.empty(1)
    data, start, end = joined([payload])
    assert steps.decode(data, start, end, into).tolist() == [0]
    np.testing.assert_array_equal(into['effort'][0], [0, 1])


def test_rows_at_any_offset() -> None:
    data = np.arange(20, dtype=np.uint8)
    rows = rows_at(data, np.array([3, 0, 12]), np.dtype([('a', 'u1'), ('b', '<u4')]))
    assert rows['a'].tolist() == [3, 0, 12]
    assert rows['b'].tolist() == [0x07060504, 0x04030201, 0x100F0E0D]
    with pytest.raises(IndexError):
        rows_at(data, np.array([18]), np.dtype([('a', '<u4')]))


def test_text_has_one_zero_at_its_end() -> None:
    assert text_of(b'gps\0') == 'gps'
    assert text_of(b'gps') == 'gps'
    assert text_of(b'\0\0') == '\0'
    assert text_of(b'\xff\0') == '�'
