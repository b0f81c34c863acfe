"""Protobuf by descriptor: every type of number, messages in messages, damage."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from flightdyn.errors import LogError
from flightdyn.logs.mcap_container import Schema
from flightdyn.logs.protobuf import ProtobufDecoder, field_names, message_types

# FieldDescriptorProto.Type: struct's code of fixed ones
FIXED = {1: 'd', 2: 'f', 6: 'Q', 7: 'I', 15: 'i', 16: 'q'}
VARINTS = {3: (-(2**63), 2**63 - 1), 4: (0, 2**64 - 1), 5: (-(2**31), 2**31 - 1)}
VARINTS |= {8: (0, 1), 13: (0, 2**32 - 1), 14: (-(2**31), 2**31 - 1)}
ZIGZAGS = {17: (-(2**31), 2**31 - 1), 18: (-(2**63), 2**63 - 1)}


def varint(value: int) -> bytes:
    out = []
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*out, value])


def long(number: int, payload: bytes) -> bytes:
    return varint(number << 3 | 2) + varint(len(payload)) + payload


def number(key: int, value: int) -> bytes:
    return varint(key << 3) + varint(value & (2**64 - 1))


def described(name: str, key: int, type_: int, label: int = 1, type_name: str = '') -> bytes:
    told = long(6, type_name.encode()) if type_name else b''
    return long(
        2, long(1, name.encode()) + number(3, key) + number(4, label) + number(5, type_) + told
    )


def schema_of(*messages: bytes) -> Schema:
    file = long(2, b'test') + b''.join(long(4, message) for message in messages)
    return Schema(1, 'test.Root', 'protobuf', long(1, file))


def decode(schema: Schema, fields: list[str], payloads: list[bytes]) -> tuple[dict, np.ndarray]:
    decoder = ProtobufDecoder(schema, fields)
    into = decoder.empty(len(payloads))
    ends = np.cumsum([len(p) for p in payloads])
    data = np.frombuffer(b''.join(payloads), np.uint8)
    starts = np.concatenate(([0], ends[:-1]))
    return into, decoder.decode(data, starts.astype(np.int64), ends.astype(np.int64), into)


def encoded(type_: int, key: int, value: float) -> bytes:
    if type_ in FIXED:
        packed = struct.pack('<' + FIXED[type_], value)
        return varint(key << 3 | (1 if len(packed) == 8 else 5)) + packed
    assert isinstance(value, int)
    return number(key, (value << 1) ^ (value >> 63) if type_ in ZIGZAGS else value)


def values(type_: int) -> st.SearchStrategy:
    if type_ in (1, 2):
        return st.floats(width=64 if type_ == 1 else 32, allow_nan=False)
    if type_ in FIXED:
        bits = 8 * struct.calcsize('<' + FIXED[type_])
        low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if type_ > 7 else (0, 2**bits - 1)
        return st.integers(low, high)
    return st.integers(*(VARINTS | ZIGZAGS)[type_])


@given(st.data())
@pytest.mark.parametrize('type_', sorted({*FIXED, *VARINTS, *ZIGZAGS}))
def test_numbers_come_back(type_: int, data: st.DataObject) -> None:
    key = data.draw(st.integers(1, 2**20))
    value = data.draw(values(type_))
    schema = schema_of(long(1, b'Root') + described('value', key, type_))
    unknown = long(key + 1, b'whatever') + number(key + 2, 3)
    columns, fault = decode(schema, ['value'], [unknown + encoded(type_, key, value), b''])
    assert_array_equal(fault, 0)
    assert columns['value'][0] == value
    assert columns['value'][1] == 0  # proto3 does not write a zero


def test_a_message_in_a_message_and_one_defined_in_another() -> None:
    inner = long(3, long(1, b'Inner') + described('deep', 4, 1))
    root = long(1, b'Root') + described('seconds', 1, 3) + inner
    root += described('where', 2, 11, type_name='.test.Root.Inner')
    root += described('many', 3, 1, label=3) + described('text', 5, 9)
    schema = schema_of(root)
    known = ['seconds', 'where.deep', 'many']
    assert field_names(message_types(schema), 'test.Root') == known
    message = number(1, 12) + long(2, encoded(1, 4, 2.5)) + long(5, b'text')
    columns, fault = decode(schema, ['where.deep', 'seconds'], [message])
    assert (columns['where.deep'][0], columns['seconds'][0], fault[0]) == (2.5, 12, 0)
    for name in ('text', 'where', 'other'):
        with pytest.raises(LogError, match=f'has no field {name}; it has seconds, where.deep'):
            ProtobufDecoder(schema, [name])


@pytest.mark.parametrize(('type_', 'code'), [(1, 'd'), (2, 'f')])
def test_repeated_numbers_are_arrays_packed_or_not(type_: int, code: str) -> None:
    schema = schema_of(long(1, b'Root') + described('many', 3, type_, label=3))
    packed = long(3, struct.pack(f'<3{code}', 1, 2.5, -3))
    single = b''.join(encoded(type_, 3, value) for value in (1.0, 2.5, -3.0))
    columns, fault = decode(
        schema, ['many'], [packed, single, b'', long(3, b'12345'), number(3, 1)]
    )
    assert_array_equal(fault, [0, 0, 0, 1, 1])
    assert_array_equal(columns['many'][0], [1, 2.5, -3])
    assert_array_equal(columns['many'][1], [1, 2.5, -3])
    assert columns['many'][2] is None


def test_a_type_that_contains_itself_ends() -> None:
    root = long(1, b'Root') + described('next', 1, 11, type_name='.test.Root')
    schema = schema_of(root + described('value', 2, 5))
    assert 'next.next.value' in field_names(message_types(schema), 'test.Root')


def test_damaged_messages_are_marked_and_the_others_read() -> None:
    schema = schema_of(long(1, b'Root') + described('value', 1, 1))
    good = encoded(1, 1, 1.5)
    bad = [good[:-1], b'\x08\x01', b'\x80', b'\x0b', long(1, b'12345678901')]
    columns, fault = decode(schema, ['value'], [good, *bad, good])
    assert_array_equal(fault, [0, 1, 1, 1, 1, 1, 0])
    assert_array_equal(columns['value'][[0, -1]], 1.5)


@given(st.binary(max_size=60))
def test_bytes_that_are_no_descriptor_are_refused_or_lack_the_field(data: bytes) -> None:
    with pytest.raises(LogError):
        ProtobufDecoder(Schema(1, 'test.Root', 'protobuf', data), ['value'])
