"""Messages of ROS 1 in MCAP, as a converted bag holds them: packed, little endian, no padding.

References
----------
.. [1] ROS wiki, *msg*, section Fields, and *Bags/Format/2.0*, http://wiki.ros.org
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import LogError
from .cdr import Bytes, CdrDecoder, Offsets, _Cursor
from .definitions import Definitions, _convert, full_name, parse_definitions
from .mcap_container import Schema


def ros1_definitions(schema: Schema) -> Definitions:
    """Return the definitions in a `ros1msg` schema; times become `sec` and `nanosec`.

    A schema without text takes the definition that ROS Noetic has of its name.

    Raises
    ------
    LogError
        If the text cannot be parsed, or is empty and the name not known.
    """
    if schema.data.strip():
        # The language of ROS 2 grew out of this one; what differs (times) the parser knows.
        return parse_definitions(replace(schema, encoding='ros2msg'))
    if full_name(schema.name) not in _noetic():
        raise LogError(f'schema {schema.name} has no text and is not a standard type')
    return _noetic()


@cache
def _noetic() -> Definitions:
    from rosbags.typesys import Stores, get_typestore

    return _convert(get_typestore(Stores.ROS1_NOETIC).fielddefs)


class Ros1Decoder(CdrDecoder):
    """`CdrDecoder` of payloads without encapsulation and alignment."""

    def __init__(self, schema: Schema, fields: Sequence[str]) -> None:
        super().__init__(ros1_definitions(schema), full_name(schema.name), fields)

    def decode(
        self, data: Bytes, start: Offsets, end: Offsets, into: dict[str, NDArray[Any]]
    ) -> NDArray[np.uint8]:
        """Decode payloads into the rows of columns; see `CdrDecoder.decode`."""
        fault = np.zeros(start.size, np.uint8)
        # Aligned to one byte, CDR's rules are those of ROS 1.
        cursor = _Cursor(data, '<', 1, np.arange(start.size), start, end - start, fault)
        cursor.run(self._steps, into)
        cursor.fetch(into)
        return fault
