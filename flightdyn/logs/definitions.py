"""Message definitions: from the text in a log, or built in for well-known types."""

import re
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any, Literal

from ..errors import LogError

if TYPE_CHECKING:
    from .mcap_container import Schema


@dataclass(frozen=True)
class Field:
    """One field of a message; `size` counts the elements of an array."""

    name: str
    type: str
    kind: Literal['scalar', 'array', 'sequence']
    size: int = 0


_IDL_RULE = re.compile(r'^={80}\r?\nIDL: [^\n]*$', re.MULTILINE)
_IDL_DIRECTIVE = re.compile(r'^[ \t]*#.*$', re.MULTILINE)  # what is included is there anyway

Definitions = dict[str, tuple[Field, ...]]


def full_name(name: str) -> str:
    """Return `pkg/msg/Type` of `pkg/Type`, `pkg::msg::Type` or DDS's `pkg::msg::dds_::Type_`."""
    parts = name.replace('::', '/').split('/')
    if len(parts) == 4 and parts[2] == 'dds_':
        parts = [*parts[:2], parts[3].removesuffix('_')]
    return f'{parts[0]}/msg/{parts[1]}' if len(parts) == 2 else '/'.join(parts)


@lru_cache(maxsize=64)
def parse_definitions(schema: 'Schema') -> Definitions:
    """Return the definitions in a schema of CDR messages (`ros2msg`, `ros2idl`, `omgidl`).

    A schema without text, as bags recorded without definitions have them, takes the built-in
    definition of its name.

    Raises
    ------
    LogError
        If the text cannot be parsed, or is empty and the name not known.
    """
    from rosbags.typesys import get_types_from_idl, get_types_from_msg
    from rosbags.typesys.base import TypesysError

    name = full_name(schema.name)
    text = schema.data.decode('utf-8', 'replace')
    if not text.strip():
        known = builtin_definitions()
        if name not in known:
            raise LogError(f'schema {schema.name} has no text and is not a standard type')
        return known
    try:
        if schema.encoding in ('ros2idl', 'omgidl'):
            types: dict[str, Any] = {}
            for part in _IDL_RULE.split(text):
                if part.strip():
                    types |= get_types_from_idl(_IDL_DIRECTIVE.sub('', part))
        elif schema.encoding == 'ros2msg':
            types = get_types_from_msg(text, name)
        else:
            raise LogError(f'schema {schema.name} is written in {schema.encoding}, not in ROS 2')
    except (TypesysError, ValueError, KeyError, IndexError, RecursionError) as error:
        line = (str(error).splitlines() or [''])[0]
        raise LogError(f'schema {schema.name} cannot be parsed: {line}') from None
    found = _convert(types)
    if name not in found:
        raise LogError(f'schema {schema.name} does not define it; it has {", ".join(found)}')
    # Some recorders leave out what every ROS 2 installation has.
    common = {k: v for k, v in builtin_definitions().items() if k.startswith('builtin_')}
    return {**common, **found}


@cache
def builtin_definitions() -> Definitions:
    """Return the definitions of the standard ROS 2 messages."""
    from rosbags.typesys import Stores, get_typestore

    return _convert(get_typestore(Stores.ROS2_KILTED).fielddefs)


def _convert(types: dict[str, Any]) -> Definitions:
    from rosbags.interfaces import Nodetype

    def convert(name: str, node: Any) -> Field:
        kind, rest = node
        if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            (_, inner), size = rest
            type_name = inner if isinstance(inner, str) else inner[0]
            if kind == Nodetype.ARRAY:
                return Field(name, full_name(type_name), 'array', size)
            return Field(name, full_name(type_name), 'sequence')
        return Field(name, full_name(rest if kind == Nodetype.NAME else rest[0]), 'scalar')

    return {
        full_name(key): tuple(convert(name, node) for name, node in fields)
        for key, (_, fields) in types.items()
    }
