"""FlatBuffers by the binary schema (.bfbs) beside them: fields by name, without generated code.

References
----------
.. [1] FlatBuffers, *Internals* and reflection/reflection.fbs, https://flatbuffers.dev
"""

import struct
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

from ..errors import LogError
from .mcap_container import Schema

DAMAGE = (ValueError, KeyError, IndexError, struct.error, RecursionError)
"""What reading raises where bytes are not what the schema says."""

# reflection.BaseType of the numbers
_NUMBERS = {
    number: struct.Struct(f'<{letter}')
    for number, letter in enumerate('B?bBhHiIqQfd', 1)  # UType, Bool, Byte, UByte, ... Double
}
_STRING, _VECTOR, _OBJECT = 13, 14, 15
_FLOAT = 11
_UOFFSET = struct.Struct('<I')
_SOFFSET = struct.Struct('<i')
_VOFFSET = struct.Struct('<H')
_IDENTIFIER = b'BFBS'


@dataclass(frozen=True)
class _Field:
    base: int
    element: int
    index: int
    offset: int
    default: Any


@dataclass(frozen=True)
class _Object:
    name: str
    is_struct: bool
    size: int
    fields: dict[str, _Field]


class FlatbufferReader:
    """Reads messages of a schema's root table.

    Parameters
    ----------
    schema : Schema
        Its data are a reflection.Schema, its name that of a table in it.

    Raises
    ------
    LogError
        If the schema is none or does not have the table.
    """

    def __init__(self, schema: Schema) -> None:
        try:
            self._objects = _reflected(schema.data)
        except DAMAGE:
            raise LogError(
                f'schema {schema.name} is no binary schema of FlatBuffers (.bfbs)'
            ) from None
        for described in self._objects:
            if described.name == schema.name and not described.is_struct:
                self._root = described
                return
        names = ', '.join(described.name for described in self._objects[:12])
        raise LogError(f'schema {schema.name} does not define it; it has {names}')

    def has(self, path: str) -> bool:
        """Return whether the root table has a field, by dotted name."""
        described = self._root
        for name in path.split('.'):
            field = described.fields.get(name)
            if field is None:
                return False
            if 0 <= field.index < len(self._objects):
                described = self._objects[field.index]
        return True

    def read(self, message: bytes, names: Collection[str]) -> dict[str, Any]:
        """Return fields of a message, those of tables and structs in it as mappings.

        Parameters
        ----------
        message : bytes
        names : collection of str
            Fields to read, at any depth. What is not there is left out, but for numbers, which
            have a default.

        Raises
        ------
        ValueError, KeyError, IndexError, struct.error, RecursionError
            See `DAMAGE`.
        """
        return self._object(message, _at(message, 0, _UOFFSET), self._root, names)

    def _object(
        self, message: bytes, at: int, described: _Object, names: Collection[str]
    ) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for name, field in described.fields.items():
            if name not in names:
                continue
            where = at + field.offset if described.is_struct else _slot(message, at, field.offset)
            if where:
                found[name] = self._value(message, where, field, names)
            elif field.base in _NUMBERS:
                found[name] = field.default
        return found

    def _value(self, message: bytes, at: int, field: _Field, names: Collection[str]) -> Any:
        if field.base in _NUMBERS:
            return _at(message, at, _NUMBERS[field.base])
        if field.base == _STRING:
            return _text(message, at)
        if field.base == _OBJECT:
            return self._nested(message, at, field.index, names)
        if field.base != _VECTOR:
            raise ValueError(f'a field of type {field.base}')
        begin, count = _vector(message, at)
        if field.element in _NUMBERS:
            number = _NUMBERS[field.element]
            if count * number.size > len(message) - begin:
                raise ValueError('a vector is longer than its message')
            return [each[0] for each in number.iter_unpack(message[begin:][: count * number.size])]
        if field.element != _OBJECT:
            raise ValueError(f'a vector of type {field.element}')
        inner = self._objects[field.index]
        step = inner.size if inner.is_struct else 4
        return [self._nested(message, begin + i * step, field.index, names) for i in range(count)]

    def _nested(self, message: bytes, at: int, index: int, names: Collection[str]) -> Any:
        inner = self._objects[index]
        if not inner.is_struct:
            at += _at(message, at, _UOFFSET)
        return self._object(message, at, inner, names)


def _reflected(data: bytes) -> list[_Object]:
    """Return the objects of a reflection.Schema, by the slots of reflection.fbs."""
    if data[4:8] != _IDENTIFIER:
        raise ValueError('not a schema')
    root = _at(data, 0, _UOFFSET)
    objects = []
    for at in _tables(data, root, 4):
        fields = {}
        for field in _tables(data, at, 6):
            kind = _table(data, field, 6)
            base = _scalar(data, kind, 4, '<b', 0)
            whole, real = _scalar(data, field, 12, '<q', 0), _scalar(data, field, 14, '<d', 0.0)
            fields[_text(data, _required(data, field, 4))] = _Field(
                base=base,
                element=_scalar(data, kind, 6, '<b', 0),
                index=_scalar(data, kind, 8, '<i', -1),
                offset=_scalar(data, field, 10, '<H', 0),
                default=_default(base, whole, real, bool(_scalar(data, field, 26, '<B', 0))),
            )
        objects.append(
            _Object(
                name=_text(data, _required(data, at, 4)),
                is_struct=bool(_scalar(data, at, 8, '<B', 0)),
                size=_scalar(data, at, 12, '<i', 0),
                fields=fields,
            )
        )
    return objects


def _default(base: int, whole: int, real: float, optional: bool) -> Any:
    if optional:
        return None
    return real if base >= _FLOAT else whole


def _at(data: bytes, at: int, number: struct.Struct) -> Any:
    if at < 0:
        raise ValueError('an offset before the message')
    return number.unpack_from(data, at)[0]


def _slot(data: bytes, table: int, slot: int) -> int:
    """Return where a field of a table is, 0 if it is not there."""
    vtable = table - int(_at(data, table, _SOFFSET))
    if slot + 2 > int(_at(data, vtable, _VOFFSET)):
        return 0
    offset = int(_at(data, vtable + slot, _VOFFSET))
    return table + offset if offset else 0


def _required(data: bytes, table: int, slot: int) -> int:
    at = _slot(data, table, slot)
    if not at:
        raise ValueError('a required field is missing')
    return at


def _scalar(data: bytes, table: int, slot: int, code: str, default: Any) -> Any:
    at = _slot(data, table, slot)
    return _at(data, at, struct.Struct(code)) if at else default


def _table(data: bytes, table: int, slot: int) -> int:
    at = _required(data, table, slot)
    return at + int(_at(data, at, _UOFFSET))


def _vector(data: bytes, at: int) -> tuple[int, int]:
    """Return where the elements of a vector begin, and how many there are."""
    at += int(_at(data, at, _UOFFSET))
    count = int(_at(data, at, _UOFFSET))
    if count > len(data) - at:  # an element has a byte at least
        raise ValueError('a vector is longer than its message')
    return at + 4, count


def _tables(data: bytes, table: int, slot: int) -> list[int]:
    at = _slot(data, table, slot)
    if not at:
        return []
    begin, count = _vector(data, at)
    places = range(begin, begin + 4 * count, 4)
    return [place + int(_at(data, place, _UOFFSET)) for place in places]


def _text(data: bytes, at: int) -> str:
    begin, size = _vector(data, at)
    return data[begin : begin + size].decode('utf-8', 'replace')
