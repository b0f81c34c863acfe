"""Columns of numbers out of the messages of an MCAP file."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import LogError
from .cdr import FAULTS, CdrDecoder
from .definitions import full_name, parse_definitions
from .mcap_container import McapFile, Schema


@dataclass(frozen=True)
class Columns:
    """Decoded fields of the messages of one source, in file order.

    Parameters
    ----------
    log_time, publish_time : int array (n,)
        Nanoseconds.
    values : mapping of dotted field to array (n, ...)
        Zeros or None in messages that could not be decoded.
    fault : uint8 array (n,)
        0 where the message was decoded, else an index into `fault_names`.
    """

    log_time: NDArray[np.int64]
    publish_time: NDArray[np.int64]
    values: dict[str, NDArray[Any]]
    fault: NDArray[np.uint8]
    fault_names: tuple[str, ...] = FAULTS

    def __len__(self) -> int:
        return int(self.log_time.size)

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self.values[name]

    def at(self, rows: NDArray[np.int64]) -> 'Columns':
        """Return some of the rows."""
        return replace(
            self,
            log_time=self.log_time[rows],
            publish_time=self.publish_time[rows],
            values={name: column[rows] for name, column in self.values.items()},
            fault=self.fault[rows],
        )


def make_decoder(schema: Schema, fields: Sequence[str]) -> CdrDecoder:
    """Return the decoder of some fields, laid out as this schema's own text says.

    Raises
    ------
    LogError
        If the text cannot be parsed or lacks a field.
    """
    return CdrDecoder(parse_definitions(schema), full_name(schema.name), fields)


def read_columns(log: McapFile, channel_ids: Sequence[int], fields: Sequence[str]) -> Columns:
    """Return fields of the messages of channels that share a schema.

    Parameters
    ----------
    log : McapFile
    channel_ids : sequence of int
        Channels with CDR messages and the same schema.
    fields : sequence of str
        Dotted names, e.g. `header.stamp.sec`.

    Returns
    -------
    Columns
        Numbers have their own type, fixed arrays one more axis; strings and sequences are
        object arrays.

    Raises
    ------
    LogError
        If a field is not in the schema, the messages are not CDR or the file is damaged.
    """
    channels = [log.channels[key] for key in channel_ids]
    if not channels:
        raise LogError(f'{log.path}: no channel to read')
    for channel in channels:
        if channel.schema_id not in log.schemas:
            raise LogError(f'{log.path}: topic {channel.topic} has no schema')
        if channel.message_encoding != 'cdr' or channel.schema_id != channels[0].schema_id:
            raise LogError(f'{log.path}: topic {channel.topic}: expected CDR and one schema')
    try:
        decoder = make_decoder(log.schemas[channels[0].schema_id], fields)
    except LogError as error:
        raise LogError(f'{log.path}: topic {channels[0].topic}: {error}') from None
    return filled(log, channel_ids, decoder, FAULTS)


def filled(
    log: McapFile, channel_ids: Sequence[int], decoder: Any, fault_names: tuple[str, ...]
) -> Columns:
    """Return what a decoder finds in the messages of channels.

    Parameters
    ----------
    decoder : CdrDecoder, or one alike
        Has `empty(n)`, the columns of n messages, and `decode(data, start, end, columns)`, which
        fills them and returns what is wrong with each.
    fault_names : sequence of str
        What its answers mean.
    """
    size = sum(log.message_counts[key] for key in channel_ids)
    values = decoder.empty(size)
    log_time, publish_time = np.zeros(size, np.int64), np.zeros(size, np.int64)
    fault = np.zeros(size, np.uint8)
    at = 0
    for batch in log.batches(channel_ids):
        rows = slice(at, at + len(batch))
        at += len(batch)
        log_time[rows], publish_time[rows] = batch.log_time, batch.publish_time
        part = {name: column[rows] for name, column in values.items()}
        fault[rows] = decoder.decode(batch.data, batch.start, batch.end, part)
    columns = Columns(log_time, publish_time, values, fault, fault_names)
    return columns if at == size else columns.at(np.arange(at))  # damaged counts promise more
