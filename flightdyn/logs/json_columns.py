"""Columns from messages in JSON, whose schema is a JSON schema (`jsonschema`).

References
----------
.. [1] JSON Schema, *properties* and *items*, https://json-schema.org
"""

import json
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import LogError
from . import json5
from .mcap_container import Schema

FAULTS = ('', 'not as its schema says')

DAMAGE = (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError)
"""What reading raises where a text is not what the schema says."""

# A JSON schema does not tell how long an array is, nor integers from other numbers for sure.
_LENGTHS = {
    'position_covariance': 9,
    'orientation_covariance': 9,
    'covariance': 36,
    'q': 4,
    'q_eb': 4,
}
_TEXTS = ('frame_id', 'child_frame_id', 'sentence')
_BITS = ('flags', 'valid', 'gnss_fix_ok')
# Times are called otherwise in ROS 1, in ROS 2 and by Foxglove.
_OTHER_NAMES = {'sec': ('secs',), 'nanosec': ('nsecs', 'nsec')}
_SAME_NAME = {other: name for name, others in _OTHER_NAMES.items() for other in others}
_DEEPEST = 8


def field_names(schema: Schema) -> set[str]:
    """Return the dotted names of the values that a schema describes.

    Raises
    ------
    LogError
        If it is no JSON schema.
    """
    try:
        return set(_leaves(json.loads(schema.data or b'{}'), ''))
    except DAMAGE:
        raise LogError(f'schema {schema.name} is no JSON schema') from None


def _leaves(described: Any, above: str) -> Iterator[str]:
    inner = described.get('properties')
    if not inner or above.count('.') > _DEEPEST:
        yield above.removesuffix('.')
        return
    for name, what in inner.items():
        yield from _leaves(what, f'{above}{_SAME_NAME.get(name, name)}.')


class JsonDecoder:
    """Turns messages into columns, as `cdr.CdrDecoder` does.

    Parameters
    ----------
    schema : Schema
        A JSON schema.
    fields : sequence of str
        Dotted names.

    Raises
    ------
    LogError
        If a field is not described.
    """

    def __init__(self, schema: Schema, fields: Sequence[str]) -> None:
        known = field_names(schema)
        missing = [name for name in fields if name not in known]
        if missing:
            shown = ', '.join(sorted(known)[:40])
            raise LogError(f'{schema.name} has no field {", ".join(missing)}; it has {shown}')
        self._fields = tuple(fields)

    def empty(self, size: int) -> dict[str, NDArray[Any]]:
        """Return columns of `size` rows."""
        return {name: _column(name.rpartition('.')[2], size) for name in self._fields}

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
                said = json5.loads(data[begin:stop].tobytes())
                for name in self._fields:
                    into[name][row] = _converted(_find(said, name), into[name])
            except DAMAGE:
                fault[row] = 1
        return fault


def _column(name: str, size: int) -> NDArray[Any]:
    if name in _TEXTS:
        return np.full(size, None, object)
    if name in _LENGTHS:
        return np.zeros((size, _LENGTHS[name]))
    return np.zeros(size, np.int64 if name in _BITS else np.float64)


def _find(said: Any, name: str) -> Any:
    for part in name.split('.'):
        others = (part, *_OTHER_NAMES.get(part, ()))
        said = said[next((other for other in others if other in said), part)]
    return said


def _converted(value: Any, column: NDArray[Any]) -> Any:
    if column.dtype == object:
        return str(value)
    if column.ndim == 1:
        return float('nan') if value is None else value
    numbers = [float('nan') if each is None else float(each) for each in value]
    if len(numbers) != column.shape[1]:
        raise ValueError(f'{len(numbers)} numbers, not {column.shape[1]}')
    return numbers
