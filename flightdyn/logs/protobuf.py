"""Protobuf messages by the descriptor in their schema: columns of numbers, without generated code.

References
----------
.. [1] Protocol Buffers, *Encoding* and descriptor.proto, https://protobuf.dev
"""

import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import LogError
from .mcap_container import Schema

DAMAGE = (ValueError, KeyError, TypeError, OverflowError, struct.error, RecursionError)
"""What decoding raises where bytes are not what the descriptor says."""

FAULTS = ('', 'not as its schema says')

_Value = int | bytes
_MESSAGE, _REPEATED = 11, 3


def _varint_as(bits: int, *, signed: bool, zigzag: bool = False) -> Callable[[_Value], int]:
    def convert(value: _Value) -> int:
        if not isinstance(value, int):
            raise TypeError('expected a number')
        if zigzag:
            return (value >> 1) ^ -(value & 1)
        value &= (1 << bits) - 1
        return value - (1 << bits) if signed and value >> (bits - 1) else value

    return convert


def _fixed_as(code: str) -> Callable[[_Value], Any]:
    layout = struct.Struct('<' + code)

    def convert(value: _Value) -> Any:
        if not isinstance(value, bytes):
            raise TypeError('expected fixed bytes')
        return layout.unpack(value)[0]

    return convert


# FieldDescriptorProto.Type: numpy's code of the column, how a value is read
_TYPES: dict[int, tuple[str, Callable[[_Value], Any]]] = {
    1: ('f8', _fixed_as('d')),
    2: ('f4', _fixed_as('f')),
    3: ('i8', _varint_as(64, signed=True)),
    4: ('u8', _varint_as(64, signed=False)),
    5: ('i4', _varint_as(32, signed=True)),
    6: ('u8', _fixed_as('Q')),
    7: ('u4', _fixed_as('I')),
    8: ('?', _varint_as(64, signed=False)),
    13: ('u4', _varint_as(32, signed=False)),
    14: ('i4', _varint_as(32, signed=True)),
    15: ('i4', _fixed_as('i')),
    16: ('i8', _fixed_as('q')),
    17: ('i4', _varint_as(32, signed=True, zigzag=True)),
    18: ('i8', _varint_as(64, signed=True, zigzag=True)),
}

_FLOATS = {1: np.dtype('<f8'), 2: np.dtype('<f4')}  # types of which repeated fields are read


@dataclass(frozen=True)
class Field:
    """A field of a message type; `type` is FieldDescriptorProto's, 0 where it is not told."""

    name: str
    number: int
    type: int
    repeated: bool
    type_name: str


def message_types(schema: Schema) -> dict[str, tuple[Field, ...]]:
    """Return the fields of the message types in a FileDescriptorSet, by full type name.

    Raises
    ------
    LogError
        If the schema is no such set.
    """
    found: dict[str, tuple[Field, ...]] = {}
    try:
        for file in _entries(schema.data, 1):
            package = b''.join(_entries(file, 2)).decode()
            for message in _entries(file, 4):
                _add_type(found, package, message)
    except DAMAGE:
        raise LogError(f'schema {schema.name} is not a set of protobuf descriptors') from None
    return found


def _add_type(found: dict[str, tuple[Field, ...]], scope: str, message: bytes) -> None:
    name = b''.join(_entries(message, 1)).decode()
    full = f'{scope}.{name}' if scope else name
    fields = []
    for entry in _entries(message, 2):
        parts: dict[int, Any] = dict(wire(entry))
        fields.append(
            Field(
                name=parts[1].decode(),
                number=int(parts[3]),
                type=int(parts.get(5, 0)),
                repeated=parts.get(4) == _REPEATED,
                type_name=parts.get(6, b'').decode().removeprefix('.'),
            )
        )
    found[full] = tuple(fields)
    for nested in _entries(message, 3):
        _add_type(found, full, nested)


def field_names(types: dict[str, tuple[Field, ...]], name: str, above: str = '') -> list[str]:
    """Return the dotted names of a type's numbers, those of messages in it too.

    Of repeated fields these are the ones of floating-point numbers.
    """
    names = []
    for field in types.get(name, ()):
        if field.repeated:
            if field.type in _FLOATS:
                names.append(above + field.name)
            continue
        if field.type == _MESSAGE and above.count('.') < 4:  # types may contain themselves
            names += field_names(types, field.type_name, f'{above}{field.name}.')
        elif field.type in _TYPES:
            names.append(above + field.name)
    return names


class ProtobufDecoder:
    """Turns payloads of one message type into columns, as `cdr.CdrDecoder` does.

    Parameters
    ----------
    schema : Schema
        Its data are a FileDescriptorSet, its name the message type.
    fields : sequence of str
        Dotted names as `field_names` gives them. Repeated ones become columns of arrays, None
        where a message has no element.

    Raises
    ------
    LogError
        If the type or a field is not described.
    """

    faults = FAULTS

    def __init__(self, schema: Schema, fields: Sequence[str]) -> None:
        types = message_types(schema)
        known = field_names(types, schema.name)
        missing = [name for name in fields if name not in known]
        if missing:
            raise LogError(
                f'{schema.name} has no field {", ".join(missing)}; it has {", ".join(known[:40])}'
            )
        self._codes: dict[str, str] = {}
        self._root = self._branch(types, schema.name, '', set(fields))

    def _branch(
        self, types: dict[str, tuple[Field, ...]], type_name: str, above: str, wanted: set[str]
    ) -> dict[int, Any]:
        """Return by number what to do with a field: (column, conversion) or a branch."""
        branch: dict[int, Any] = {}
        for field in types[type_name]:
            name = above + field.name
            if name in wanted and field.repeated:
                self._codes[name] = 'O'
                branch[field.number] = (name, _FLOATS[field.type])
            elif name in wanted:
                code, convert = _TYPES[field.type]
                self._codes[name] = code
                branch[field.number] = (name, convert)
            elif not field.repeated and any(w.startswith(f'{name}.') for w in wanted):
                branch[field.number] = self._branch(types, field.type_name, f'{name}.', wanted)
        return branch

    def empty(self, size: int) -> dict[str, NDArray[Any]]:
        """Return columns of `size` rows: proto3 does not write a zero, nor an empty list."""
        return {
            name: np.full(size, None) if code == 'O' else np.zeros(size, code)
            for name, code in self._codes.items()
        }

    def decode(
        self,
        data: NDArray[np.uint8],
        start: NDArray[np.int64],
        end: NDArray[np.int64],
        into: dict[str, NDArray[Any]],
    ) -> NDArray[np.uint8]:
        """Decode payloads into the rows of columns; see `cdr.CdrDecoder.decode`."""
        fault = np.zeros(start.size, np.uint8)
        for row, (begin, stop) in enumerate(zip(start.tolist(), end.tolist(), strict=True)):
            try:
                self._message(data[begin:stop].tobytes(), self._root, row, into)
            except DAMAGE:
                fault[row] = 1
        return fault

    def _message(
        self, message: bytes, branch: dict[int, Any], row: int, into: dict[str, NDArray[Any]]
    ) -> None:
        for number, value in wire(message):
            what = branch.get(number)
            if what is None:
                continue
            if isinstance(what, dict):
                if not isinstance(value, bytes):
                    raise TypeError('expected a message')
                self._message(value, what, row, into)
                continue
            name, convert = what
            if not isinstance(convert, np.dtype):
                into[name][row] = convert(value)
            elif isinstance(value, bytes):  # packed, or one element of many
                before = into[name][row]
                values = np.frombuffer(value, convert)
                into[name][row] = values if before is None else np.append(before, values)
            else:
                raise TypeError('expected fixed bytes')


def wire(message: bytes) -> Iterator[tuple[int, _Value]]:
    """Yield the number of each field and its value: an integer, or the bytes of anything else.

    Raises
    ------
    ValueError
        If the message ends in the middle of a field.
    """
    at = 0
    while at < len(message):
        key, at = _varint(message, at)
        kind = key & 7
        if kind == 0:
            value, at = _varint(message, at)
            yield key >> 3, value
            continue
        if kind == 2:
            size, at = _varint(message, at)
        elif kind in (1, 5):
            size = 8 if kind == 1 else 4
        else:
            raise ValueError(f'wire type {kind}')
        if size > len(message) - at:
            raise ValueError('a field is longer than its message')
        yield key >> 3, message[at : at + size]
        at += size


def _entries(message: bytes, number: int) -> Iterator[bytes]:
    return (v for n, v in wire(message) if n == number and isinstance(v, bytes))


def _varint(message: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        if at >= len(message) or shift > 63:
            raise ValueError('a number does not end')
        byte = message[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
        shift += 7
