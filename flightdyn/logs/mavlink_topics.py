"""MAVLink in topics: frames in mavros_msgs/Mavlink, and the JSON that mavlink-server writes.

One topic holds the messages of several systems. Each sender's messages of position are a source
of their own, called `TOPIC/SYSTEM/COMPONENT/NAME` where a topic holds more than one.

References
----------
.. [1] mavros, *mavros_msgs/Mavlink*
.. [2] bluerobotics, *mavlink-server* and *BlueOS* recorder
"""

import json
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..errors import LogError
from . import json5
from .decoders import decodable, decoded_columns, field_names
from .definitions import full_name
from .json_columns import DAMAGE
from .mavlink import ATTITUDE, FIX_TYPES, MESSAGES, NAMES, Message, checksum
from .mcap_columns import Columns
from .mcap_container import McapFile, Schema

MAX_SENDERS = 64
"""More senders of positions in one topic are noise; the most frequent are kept."""

_FRAME = ('len', 'seq', 'sysid', 'compid', 'msgid', 'payload64')
_FRAME_OPTIONAL = ('magic', 'checksum', 'incompat_flags', 'compat_flags', 'framing_status')
_V2 = 0xFD
_CRC_CHECKED, _SHORT, _REFUSED = 'wrong checksum', 'payload cut short', 'refused by the receiver'
_NOT_JSON = 'not as the message is defined'
_READ = NAMES | {ATTITUDE.name: ATTITUDE}
_POSITIONS = '|'.join(NAMES)


class Sender(NamedTuple):
    """Who sends which message."""

    system: int
    component: int
    name: str

    @property
    def message(self) -> Message:
        """How the message is read."""
        return _READ[self.name]

    def __str__(self) -> str:
        return f'{self.system}/{self.component}/{self.name}'


def holds_frames(schema: Schema, encoding: str) -> bool:
    """Return whether messages are MAVLink frames that can be read."""
    if full_name(schema.name).split('/')[-1] != 'Mavlink' or not decodable(schema, encoding):
        return False
    try:
        return field_names(schema, encoding).issuperset(_FRAME)
    except LogError:
        return False


def may_hold_json(schema: Schema, encoding: str) -> bool:
    """Return whether JSON messages may be MAVLink, as far as their schema says."""
    if encoding != 'json':
        return False
    try:
        known = json.loads(schema.data)['properties']
    except DAMAGE:
        return True
    return isinstance(known, dict) and 'header' in known and 'message' in known


def frame_senders(log: McapFile, channel_ids: Sequence[int]) -> Counter[Sender]:
    """Return how many messages of position each sender has in a topic of frames.

    Raises
    ------
    LogError
        If the file is damaged.
    """
    columns = decoded_columns(log, channel_ids, ('sysid', 'compid', 'msgid'))
    heads = np.stack([columns[name] for name in ('sysid', 'compid', 'msgid')], axis=1)
    found, counts = np.unique(heads[columns.fault == 0], axis=0, return_counts=True)
    senders: Counter[Sender] = Counter()
    for (system, component, number), count in zip(found.tolist(), counts.tolist(), strict=True):
        if number in MESSAGES:
            senders[Sender(system, component, MESSAGES[number].name)] = count
    return senders


def json_senders(log: McapFile, channel_ids: Sequence[int]) -> dict[int, Counter[Sender]]:
    """Return, by channel, how many messages of position each sender has in topics of JSON.

    Raises
    ------
    LogError
        If the file is damaged.
    """
    found: dict[int, Counter[Sender]] = {}
    for channel, _, document in _documents(log, channel_ids, _POSITIONS):
        sender = _sender(document)
        if sender is not None and sender.name in NAMES:
            found.setdefault(channel, Counter())[sender] += 1
    return found


def read_columns(
    log: McapFile, channel_ids: Sequence[int], sender: Sender, warnings: list[str]
) -> Columns:
    """Return the fields of one sender's message in a topic, named and scaled as MAVLink has them.

    Raises
    ------
    LogError
        If the file is damaged.
    """
    if log.channels[channel_ids[0]].message_encoding == 'json':
        return _json_columns(log, channel_ids, sender)
    return _frame_columns(log, channel_ids, sender, warnings)


def attitude_columns(log: McapFile, channel_ids: Sequence[int], sender: Sender) -> Columns:
    """Return ATTITUDE as the sender of positions in some channels sends it, maybe in others.

    Raises
    ------
    LogError
        If the file is damaged.
    """
    channel = log.channels[channel_ids[0]]
    if channel.message_encoding == 'json':  # as a rule every message has a topic of its own
        channel_ids = [
            other.id
            for other in log.channels.values()
            if other.schema_id in log.schemas
            and may_hold_json(log.schemas[other.schema_id], other.message_encoding)
        ]
    return read_columns(log, channel_ids, sender._replace(name=ATTITUDE.name), [])


def _frame_columns(
    log: McapFile, channel_ids: Sequence[int], sender: Sender, warnings: list[str]
) -> Columns:
    channel = log.channels[channel_ids[0]]
    known = field_names(log.schemas[channel.schema_id], channel.message_encoding)
    fields = (*_FRAME, *(name for name in _FRAME_OPTIONAL if name in known))
    columns = decoded_columns(log, channel_ids, fields)
    damaged = int((columns.fault != 0).sum())
    if damaged:
        warnings.append(f'{damaged} messages of {channel.topic} cannot be decoded')
    message = sender.message
    chosen = (columns['sysid'] == sender.system) & (columns['compid'] == sender.component)
    rows = np.flatnonzero(chosen & (columns['msgid'] == message.number) & (columns.fault == 0))
    table = np.zeros(rows.size, message.layout)
    fault = np.zeros(rows.size, np.uint8)
    names = ('', _REFUSED, _SHORT, _CRC_CHECKED)
    for i, row in enumerate(rows.tolist()):
        head = {name: int(columns[name][row]) for name in fields if name != 'payload64'}
        payload = columns['payload64'][row].astype('<u8').tobytes()
        fault[i] = names.index(_frame_fault(head, payload, message.seed))
        if fault[i] == 0:
            size = message.layout.itemsize
            whole = payload[: head['len']][:size].ljust(size, b'\0')
            table[i] = np.frombuffer(whole, message.layout)[0]
    return replace(
        columns,
        log_time=columns.log_time[rows],
        publish_time=columns.publish_time[rows],
        values={name: table[name] for name in message.fields},
        fault=fault,
        fault_names=names,
    )


def _frame_fault(head: dict[str, int], payload: bytes, seed: int) -> str:
    """Return what is wrong with a frame, empty if nothing is."""
    if head.get('framing_status', 1) != 1:
        return _REFUSED
    if head['len'] > len(payload):
        return _SHORT
    if 'checksum' not in head:  # of 2013: mavros passed on only what was sound
        return ''
    ids = [head['seq'], head['sysid'], head['compid']]
    if head.get('magic') == _V2:
        flags = [head['len'], head.get('incompat_flags', 0), head.get('compat_flags', 0)]
        checked = bytes([*flags, *ids]) + head['msgid'].to_bytes(4, 'little')[:3]
    else:
        checked = bytes([head['len'], *ids, head['msgid'] & 0xFF])
    checked += payload[: head['len']] + bytes([seed])
    return '' if checksum(checked) == head['checksum'] else _CRC_CHECKED


def _documents(
    log: McapFile, channel_ids: Sequence[int], names: str
) -> Iterator[tuple[int, int, Any]]:
    """Yield channel, log time and contents, None if damaged, of messages with one of the names."""
    pattern = re.compile(names.encode())
    for batch in log.batches(channel_ids):
        raw = batch.data.data
        times = batch.log_time.tolist()
        for i, (start, end) in enumerate(
            zip(batch.start.tolist(), batch.end.tolist(), strict=True)
        ):
            message = bytes(raw[start:end])
            if not pattern.search(message):
                continue
            try:
                yield batch.channel_id, times[i], json5.loads(message)
            except DAMAGE:
                yield batch.channel_id, times[i], None


def _sender(document: Any) -> Sender | None:
    try:
        head, name = document['header'], document['message']['type']
        sender = Sender(int(head['system_id']), int(head['component_id']), name)
    except DAMAGE:
        return None
    return sender if name in _READ else None


def _json_columns(log: McapFile, channel_ids: Sequence[int], sender: Sender) -> Columns:
    message = sender.message
    times: list[int] = []
    table: list[list[float]] = []
    fault: list[int] = []
    nothing = [0.0] * len(message.fields)
    for _, time, document in _documents(log, channel_ids, sender.name):
        if document is not None and _sender(document) != sender:
            continue
        times.append(time)
        try:
            table.append(_numbers(document['message'], message))
            fault.append(0)
        except DAMAGE:
            table.append(nothing)
            fault.append(1)
    values = np.array(table, float).reshape(-1, len(nothing))
    log_time = np.array(times, np.int64)
    return Columns(
        log_time,
        log_time,
        {name: values[:, i] for i, name in enumerate(message.fields)},
        np.array(fault, np.uint8),
        ('', _NOT_JSON),
    )


def _numbers(said: dict[str, Any], message: Message) -> list[float]:
    numbers = []
    for i, name in enumerate(message.fields):
        value = said[name] if i < message.least else said.get(name, 0)
        if isinstance(value, dict):  # an enumeration
            value = FIX_TYPES[value['type']]
        numbers.append(float('nan') if value is None else float(value))
    if not np.isfinite(numbers[0]):
        raise ValueError('no time')
    return numbers
