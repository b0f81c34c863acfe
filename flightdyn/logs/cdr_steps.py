"""What a message consists of in the order of its bytes: numbers, strings, sequences."""

from dataclasses import dataclass, replace

from ..errors import LogError
from .definitions import Definitions

_NUMBERS = {
    'bool': 'u1',
    'byte': 'u1',
    'octet': 'u1',
    'char': 'u1',
    'int8': 'i1',
    'uint8': 'u1',
    'int16': 'i2',
    'uint16': 'u2',
    'int32': 'i4',
    'uint32': 'u4',
    'int64': 'i8',
    'uint64': 'u8',
    'float32': 'f4',
    'float64': 'f8',
}

_MAX_STEPS = 20000  # a definition that flattens into more is not one of a sensor


@dataclass(frozen=True)
class Number:
    """A number, or a fixed array of `count` numbers, of a NumPy type code."""

    name: str
    code: str
    count: int | None  # None: a scalar
    is_bool: bool = False


@dataclass(frozen=True)
class Text:
    """A string."""

    name: str


@dataclass(frozen=True)
class Sequence_:
    """As many elements as a word in front says; `steps` those of an element without `element`."""

    name: str
    element: 'Number | Text | None'  # None: structs, see steps
    steps: 'tuple[Step, ...]' = ()


Step = Number | Text | Sequence_


def flatten(definitions: Definitions, type_name: str) -> list[Step]:
    """Return the steps that decode a message type, in the order of its bytes.

    Raises
    ------
    LogError
        If a type is not defined, contains itself or cannot be laid out.
    """
    steps: list[Step] = []
    _flatten(definitions, type_name, '', steps, ())
    return steps


def _flatten(
    definitions: Definitions,
    type_name: str,
    prefix: str,
    steps: list[Step],
    above: tuple[str, ...],
) -> None:
    if type_name not in definitions:
        raise LogError(f'message type {type_name} is used but not defined')
    if type_name in above:
        raise LogError(f'message type {type_name} contains itself')
    above = (*above, type_name)
    for field in definitions[type_name]:
        name = prefix + field.name
        if len(steps) > _MAX_STEPS:
            raise LogError(f'message type {type_name} has more than {_MAX_STEPS} fields')
        base = _base_step(name, field.type)
        if field.kind == 'scalar':
            if base is not None:
                steps.append(base)
            else:
                _flatten(definitions, field.type, name + '.', steps, above)
        elif field.kind == 'array':
            if isinstance(base, Number):
                steps.append(replace(base, count=field.size))
            elif field.size > _MAX_STEPS:
                raise LogError(f'{name} has {field.size} elements: too many')
            else:
                for i in range(field.size):
                    if base is not None:
                        steps.append(Text(f'{name}.{i}'))
                    else:
                        _flatten(definitions, field.type, f'{name}.{i}.', steps, above)
        elif base is not None:
            steps.append(Sequence_(name, base))
        else:
            inner: list[Step] = []
            _flatten(definitions, field.type, '', inner, above)
            steps.append(Sequence_(name, None, tuple(inner)))


def _base_step(name: str, type_name: str) -> Number | Text | None:
    if type_name in _NUMBERS:
        return Number(name, _NUMBERS[type_name], None, type_name == 'bool')
    if type_name == 'string':
        return Text(name)
    if '/' not in type_name:
        raise LogError(f'{name} is a {type_name}, which cannot be read')
    return None
