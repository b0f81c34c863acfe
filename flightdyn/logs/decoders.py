"""One way to columns for every encoding of messages that can be read."""

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import LogError
from . import cdr, json_columns, protobuf
from .definitions import full_name, parse_definitions
from .mcap_columns import Columns, filled, make_decoder
from .mcap_container import McapFile, Schema
from .ros1 import Ros1Decoder, ros1_definitions

_FAULTS = {'protobuf': protobuf.FAULTS, 'json': json_columns.FAULTS}


class Decoder(Protocol):
    """What turns payloads into columns; see `cdr.CdrDecoder`."""

    def empty(self, size: int) -> dict[str, NDArray[Any]]:
        """Return columns of `size` rows."""

    def decode(
        self,
        data: NDArray[np.uint8],
        start: NDArray[np.int64],
        end: NDArray[np.int64],
        into: dict[str, NDArray[Any]],
    ) -> NDArray[np.uint8]:
        """Decode payloads into rows; return the fault of each."""


def decodable(schema: Schema, encoding: str) -> bool:
    """Return whether messages of a schema and encoding can be turned into columns."""
    if encoding == 'cdr':
        return True
    known = (('ros1', 'ros1msg'), ('protobuf', 'protobuf'), ('json', 'jsonschema'))
    return (encoding, schema.encoding) in known


def field_names(schema: Schema, encoding: str) -> set[str]:
    """Return the dotted names of the fields that a schema describes.

    Raises
    ------
    LogError
        If the schema cannot be parsed.
    """
    if encoding == 'protobuf':
        return set(protobuf.field_names(protobuf.message_types(schema), schema.name))
    if encoding == 'json':
        return json_columns.field_names(schema)
    definitions = ros1_definitions(schema) if encoding == 'ros1' else parse_definitions(schema)
    return {step.name for step in cdr.flatten(definitions, full_name(schema.name))}


def decoder_of(schema: Schema, encoding: str, fields: Sequence[str]) -> Decoder:
    """Return the decoder of some fields.

    Raises
    ------
    LogError
        If the schema cannot be parsed or lacks a field.
    """
    if encoding == 'protobuf':
        return protobuf.ProtobufDecoder(schema, fields)
    if encoding == 'json':
        return json_columns.JsonDecoder(schema, fields)
    return Ros1Decoder(schema, fields) if encoding == 'ros1' else make_decoder(schema, fields)


def decoded_columns(log: McapFile, channel_ids: Sequence[int], fields: Sequence[str]) -> Columns:
    """Return fields of the messages of channels that share a schema and an encoding.

    Parameters
    ----------
    log : McapFile
    channel_ids : sequence of int
    fields : sequence of str
        Dotted names, e.g. `header.stamp.sec`.

    Raises
    ------
    LogError
        If a field is not in the schema or the file is damaged.
    """
    channel = log.channels[channel_ids[0]]
    encoding = channel.message_encoding
    try:
        decoder = decoder_of(log.schemas[channel.schema_id], encoding, fields)
    except LogError as error:
        raise LogError(f'{log.path}: topic {channel.topic}: {error}') from None
    names = _FAULTS.get(encoding, cdr.FAULTS)
    return filled(log, channel_ids, decoder, names)
