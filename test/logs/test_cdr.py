"""Columns against rosbags, message by message."""

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from log_making import STORE, fixes, nav_sat_fix
from numpy.testing import assert_array_equal
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from flightdyn.errors import LogError
from flightdyn.logs.cdr import FAULTS, CdrDecoder, flatten
from flightdyn.logs.definitions import builtin_definitions, parse_definitions
from flightdyn.logs.mcap_columns import read_columns
from flightdyn.logs.mcap_container import McapFile, Schema

FIX = 'sensor_msgs/msg/NavSatFix'
FIX_FIELDS = (
    'header.stamp.sec',
    'header.stamp.nanosec',
    'header.frame_id',
    'status.status',
    'status.service',
    'latitude',
    'longitude',
    'altitude',
    'position_covariance',
    'position_covariance_type',
)


def decode(decoder: CdrDecoder, payloads: list[bytes]) -> tuple[dict[str, Any], Any]:
    """Decode payloads that lie behind one another with odd bytes between them."""
    ends = np.cumsum([len(p) + 3 for p in payloads]) - 3 if payloads else np.zeros(0, int)
    starts = ends - np.array([len(p) for p in payloads], int)
    data = np.frombuffer(b'\xff\xfe\xfd'.join(payloads), np.uint8)
    columns = decoder.empty(len(payloads))
    return columns, decoder.decode(data, starts, ends, columns)


def value(message: Any, name: str) -> Any:
    for part in name.split('.'):
        message = message[int(part)] if part.isdigit() else getattr(message, part)
    return message


def same(got: Any, expected: Any) -> bool:
    if isinstance(expected, list) and any(isinstance(each, dict) for each in got):
        return len(got) == len(expected) and all(
            same(inner, value(message, name))
            for element, message in zip(got, expected, strict=True)
            for name, inner in element.items()
        )
    if isinstance(expected, str | list):
        return bool(got == expected)
    return np.asarray(got).tobytes() == np.asarray(expected, np.asarray(got).dtype).tobytes()


def test_glider_log_bit_equal_to_rosbags(glider_log: Path) -> None:
    with McapFile(glider_log) as log:
        columns = read_columns(log, [1], FIX_FIELDS)
        payloads = [
            b.data[i:j].tobytes()
            for b in log.batches([1])
            for i, j in zip(b.start, b.end, strict=True)
        ]
    assert not columns.fault.any()
    for row, payload in enumerate(payloads):
        message = STORE.deserialize_cdr(payload, FIX)
        for name in FIX_FIELDS:
            assert same(columns[name][row], value(message, name)), (row, name)


NUMBERS = {
    'bool': st.booleans(),
    'byte': st.integers(0, 127),  # an octet in ROS 2, signed in rosbags
    'char': st.integers(0, 255),
    'int8': st.integers(-128, 127),
    'uint16': st.integers(0, 2**16 - 1),
    'int32': st.integers(-(2**31), 2**31 - 1),
    'uint32': st.integers(0, 2**32 - 1),
    'int64': st.integers(-(2**63), 2**63 - 1),
    'uint64': st.integers(0, 2**64 - 1),
    'float32': st.floats(width=32),
    'float64': st.floats(),
}
DTYPES = {'bool': 'bool', 'byte': 'uint8', 'char': 'uint8'}
_count = itertools.count()


@st.composite
def definition(draw: st.DrawFn, depth: int = 2) -> list[tuple[str, Any, str, int]]:
    """Fields as (name, type or nested fields, kind, size)."""
    fields = []
    for i in range(draw(st.integers(1, 5))):
        kind = draw(st.sampled_from(['scalar', 'scalar', 'array', 'sequence']))
        choices = [st.sampled_from([*NUMBERS, 'string'])]
        if depth:
            choices.append(definition(depth=depth - 1))  # type: ignore[arg-type]
        fields.append((f'f{i}', draw(st.one_of(choices)), kind, draw(st.integers(1, 3))))
    return fields


def register(fields: list[tuple[str, Any, str, int]], types: dict[str, str]) -> str:
    name = f'pkg/msg/T{next(_count)}'
    lines = []
    for field, type_, kind, size in fields:
        text = type_ if isinstance(type_, str) else register(type_, types)
        lines.append(
            text + {'scalar': '', 'array': f'[{size}]', 'sequence': '[]'}[kind] + f' {field}'
        )
    types[name] = '\n'.join(lines)
    return name


def draw_message(
    draw: st.DrawFn, store: Any, name: str, fields: list[tuple[str, Any, str, int]]
) -> Any:
    defs = dict(store.fielddefs[name][1])
    values = {}
    for field, type_, kind, size in fields:

        def one(type_: Any = type_, field: str = field) -> Any:
            if type_ == 'string':
                letters = st.characters(codec='utf-8', exclude_characters='\0')
                return draw(st.text(letters, max_size=5))
            if isinstance(type_, str):
                return draw(NUMBERS[type_])
            node = defs[field]
            inner = node[1] if isinstance(node[1], str) else node[1][0][1]
            return draw_message(draw, store, inner, type_)

        count = {'scalar': None, 'array': size}.get(kind, draw(st.integers(0, 3)))
        if count is None:
            values[field] = one()
        else:
            items = [one() for _ in range(count)]
            numeric = isinstance(type_, str) and type_ != 'string'
            values[field] = np.array(items, DTYPES.get(type_, type_)) if numeric else items
    return store.types[name](**values)


@settings(
    max_examples=40,
    deadline=None,
    suppress_health_check=list(HealthCheck),
    phases=[Phase.generate],
)
@given(data=st.data())
def test_any_definition_round_trip(data: st.DataObject) -> None:
    fields = data.draw(definition())
    types: dict[str, str] = {}
    root = register(fields, types)
    text = types.pop(root) + ''.join(f'\n{"=" * 80}\nMSG: {k}\n{v}' for k, v in types.items())
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(text, root))
    definitions = parse_definitions(Schema(1, root, 'ros2msg', text.encode()))
    names = [step.name for step in flatten(definitions, root)]
    wanted = data.draw(st.lists(st.sampled_from(names), unique=True)) if names else []
    number = data.draw(st.integers(1, 4))
    messages = [data.draw(st.composite(draw_message)(store, root, fields)) for _ in range(number)]
    payloads = [
        bytes(store.serialize_cdr(m, root, little_endian=data.draw(st.booleans())))
        for m in messages
    ]
    columns, fault = decode(CdrDecoder(definitions, root, wanted), payloads)
    assert not fault.any()
    for row, payload in enumerate(payloads):
        message = store.deserialize_cdr(payload, root)
        for name in wanted:
            assert same(columns[name][row], value(message, name)), name


@settings(max_examples=300, deadline=None)
@given(
    changes=st.lists(st.tuples(st.floats(0, 0.9999), st.integers(0, 255)), max_size=5),
    size=st.floats(0, 1.2),
    row=st.integers(0, 4),
)
def test_a_damaged_message_does_not_touch_its_neighbours(
    changes: list[tuple[float, int]], size: float, row: int
) -> None:
    payloads = [payload for _, _, payload in fixes(5)]
    bad = bytearray(payloads[row])
    for where, new in changes:
        bad[int(where * len(bad))] = new
    payloads[row] = bytes(bad + bytes(20))[: int(size * len(bad))]
    columns, fault = decode(CdrDecoder(builtin_definitions(), FIX, FIX_FIELDS), payloads)
    assert not np.delete(fault, row).any()
    for i, payload in enumerate(payloads):
        if fault[i]:
            continue
        try:
            message = STORE.deserialize_cdr(payload, FIX)
        except (SerdeError, UnicodeDecodeError):
            assert i == row  # rosbags minds trailing bytes and bytes that are no UTF-8
            continue
        for name in FIX_FIELDS:
            assert same(columns[name][i], value(message, name)), name


@pytest.mark.parametrize('word', [b'\x00\x02', b'\x00\x03', b'\x00\x08', b'\x00\x0a', b'\xff\xff'])
def test_other_encapsulations_are_not_taken_for_plain_cdr(word: bytes) -> None:
    good = nav_sat_fix(10**18)
    columns, fault = decode(
        CdrDecoder(builtin_definitions(), FIX, ['latitude']), [good, word + good[2:], good]
    )
    assert [FAULTS[code] for code in fault] == ['', 'unsupported encapsulation', '']
    assert_array_equal(columns['latitude'], [48, 0, 48])


def test_xcdr2_aligns_doubles_to_four_bytes() -> None:
    text = 'uint32 a\nfloat64 b\nuint8 c\nfloat64 d'
    definitions = parse_definitions(Schema(1, 'pkg/msg/Two', 'ros2msg', text.encode()))
    payload = (
        b'\x00\x07\x00\x00'
        + np.uint32(7).tobytes()
        + np.float64(1.5).tobytes()
        + b'\x09\x00\x00\x00'
        + np.float64(-2.5).tobytes()
    )
    columns, fault = decode(
        CdrDecoder(definitions, 'pkg/msg/Two', ['a', 'b', 'c', 'd']), [payload]
    )
    assert not fault.any()
    assert [columns[name][0] for name in 'abcd'] == [7, 1.5, 9, -2.5]


def test_empty_string_without_terminator() -> None:
    definitions = parse_definitions(Schema(1, 'p/msg/S', 'ros2msg', b'string s\nuint8 n'))
    columns, fault = decode(
        CdrDecoder(definitions, 'p/msg/S', ['s', 'n']),
        [b'\0\1\0\0\0\0\0\0\5', b'\0\1\0\0\1\0\0\0\0\6'],
    )
    assert not fault.any()
    assert columns['s'].tolist() == ['', '']
    assert columns['n'].tolist() == [5, 6]


def test_a_claimed_length_does_not_hang_or_allocate() -> None:
    definitions = parse_definitions(
        Schema(1, 'p/msg/L', 'ros2msg', b'string[] s\nfloat64[] v\nuint8 n')
    )
    huge = b'\0\1\0\0' + b'\xff\xff\xff\x7f' + bytes(100)
    _, fault = decode(CdrDecoder(definitions, 'p/msg/L', ['s', 'v', 'n']), [huge])
    assert FAULTS[fault[0]] == 'a length beyond its end'


@pytest.mark.parametrize(
    ('schema', 'fields', 'says'),
    [
        (Schema(1, 'p/msg/A', 'ros2msg', b'uint8 a'), ['b'], 'has no field b; it has a'),
        (Schema(1, 'p/msg/A', 'ros2msg', b'Missing a'), ['a'], 'is used but not defined'),
        (Schema(1, 'p/msg/A', 'ros2msg', b'p/A a'), ['a'], 'contains itself'),
        (Schema(1, 'p/msg/A', 'ros2msg', b'uint8 a\n!? = '), ['a'], 'cannot be parsed'),
        (Schema(1, 'p/msg/A', 'ros2msg', b''), ['a'], 'no text'),
        (Schema(1, 'p/msg/A', 'protobuf', b'uint8 a'), ['a'], 'not in ROS 2'),
        (Schema(1, 'p/msg/A', 'ros2msg', b'wstring a'), ['a'], 'wstring is used but not defined'),
    ],
)
def test_definitions_that_cannot_be_used(schema: Schema, fields: list[str], says: str) -> None:
    with pytest.raises(LogError, match=says):
        CdrDecoder(parse_definitions(schema), schema.name, fields)


def test_a_schema_is_known_by_its_id_not_its_name(write_log: Callable[..., Path]) -> None:
    types = {'/fix': FIX}
    other = b'float64 longitude\nfloat64 latitude'
    swapped = b'\0\1\0\0' + np.array([9.0, 48.0]).tobytes()
    path = write_log([('/fix', 1, swapped)], types, texts={FIX: other})
    with McapFile(path) as log:
        columns = read_columns(log, [1], ['latitude', 'longitude'])
    assert columns['latitude'][0] == 48
    assert columns['longitude'][0] == 9


def test_counts_that_promise_more_messages_than_there_are_add_no_rows(glider_log: Path) -> None:
    """Rows that were never filled used to look like sound messages with zeros and None."""
    with McapFile(glider_log) as log:
        whole = read_columns(log, [1], FIX_FIELDS)
        log.message_counts[1] += 7
        columns = read_columns(log, [1], FIX_FIELDS)
    assert len(columns) == len(whole) == 900
    assert_array_equal(columns['latitude'], whole['latitude'])
    assert None not in columns['header.frame_id']
