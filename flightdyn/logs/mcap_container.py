"""The MCAP container: records, chunks and indexes of a file; nothing of what messages mean.

A file is memory-mapped. Its index is used when there is one and it agrees with the file's own
statistics; otherwise the file is walked from front to back. Nothing that a file claims about
sizes is believed before it is compared with what is there.

References
----------
.. [1] MCAP format specification, https://mcap.dev/spec
"""

import contextlib
import mmap
import struct
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from ..errors import LogError
from .cdr_layout import ROOM, rows_at
from .mcap_records import (
    CHANNEL,
    CHUNK,
    CHUNK_INDEX,
    DATA_END,
    FOOTER,
    FOOTER_RECORD,
    HEADER,
    INDEX_ENTRY,
    MAGIC,
    MESSAGE,
    MESSAGE_HEAD,
    MESSAGE_INDEX,
    MESSAGE_INDEX_HEAD,
    METADATA,
    METADATA_INDEX,
    OTHER_FORMATS,
    RECORD,
    SCHEMA,
    STATISTICS,
    DamageError,
    RecordReader,
)
from .mcap_walking import by_channel, walk
from .unpacking import crc32, unpack

Bytes = NDArray[np.uint8]
Offsets = NDArray[np.int64]

MAX_CHUNK_BYTES = 256 * 2**20
_SHOWN = 40  # characters of a text in the file that a message shows
"""Largest unpacked chunk that is accepted; recorders write 1 to 16 MiB."""


@dataclass(frozen=True)
class Schema:
    """How the messages of some channels are laid out, as the file says it."""

    id: int
    name: str
    encoding: str
    data: bytes


@dataclass(frozen=True)
class Channel:
    """One stream of messages; `schema_id` 0 means that it has no schema."""

    id: int
    schema_id: int
    topic: str
    message_encoding: str
    metadata: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class MessageBatch:
    """Messages of one channel, in file order.

    Parameters
    ----------
    channel_id : int
    data : uint8 array
        Bytes that the payloads are in. Only valid until the next batch is asked for: the memory
        is used again.
    start, end : int array (n,)
        Where each payload begins and ends in `data`.
    log_time, publish_time : int array (n,)
        Nanoseconds since the recorder's epoch.
    """

    channel_id: int
    data: Bytes
    start: Offsets
    end: Offsets
    log_time: NDArray[np.int64]
    publish_time: NDArray[np.int64]

    def __len__(self) -> int:
        return int(self.start.size)


@dataclass
class _Block:
    """A chunk, or (length 0) messages outside chunks; `offsets` of records by channel."""

    offset: int
    length: int = 0
    offsets: dict[int, Offsets] | None = None
    index_offsets: dict[int, int] = field(default_factory=dict)


class McapFile:
    """An open MCAP file; a context manager.

    Parameters
    ----------
    path : path
    max_chunk_bytes : int
        Chunks that would unpack to more are refused.

    Attributes
    ----------
    schemas, channels : mapping of id to Schema, Channel
    message_counts : mapping of channel id to number of messages
    metadata : list of (name, mapping)
        The metadata records.
    profile, library : str
    size : int
        Bytes of the file.
    warnings : list of str
        What is wrong with the file and did not prevent reading it.

    Raises
    ------
    LogError
        If the file is missing, not an MCAP, or damaged; the message names file and byte.
    """

    def __init__(self, path: str | Path, *, max_chunk_bytes: int = MAX_CHUNK_BYTES) -> None:
        self.path = Path(path)
        self.max_chunk_bytes = max_chunk_bytes
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.message_counts: dict[int, int] = {}
        self.metadata: list[tuple[str, dict[str, str]]] = []
        self.warnings: list[str] = []
        self.profile = self.library = ''
        self._blocks: list[_Block] = []
        self._buffer: Bytes = np.empty(0, np.uint8)
        try:
            with self.path.open('rb') as stream:
                size = stream.seek(0, 2)
                if size == 0:
                    raise LogError(f'{self.path}: the file is empty (0 bytes), not an MCAP')
                self._map = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
        except OSError as error:
            raise LogError(f'{self.path}: cannot be read: {error.strerror or error}') from None
        self._data: Bytes = np.frombuffer(self._map, np.uint8)
        self.size = size
        self._closed_properly = size >= 16 and self._map[-len(MAGIC) :] == MAGIC
        self._check_magic()
        try:
            self._read_header()
            if not self._open_indexed():
                self._scan()
        except DamageError as damage:
            self._fail(damage)

    def __enter__(self) -> 'McapFile':
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the file; batches handed out before stay valid."""
        self._data = self._buffer = np.empty(0, np.uint8)
        with contextlib.suppress(BufferError):  # a batch that looks into the map closes it later
            self._map.close()

    def metadata_record(self, name: str) -> dict[str, str]:
        """Return the last metadata record of a name, empty if there is none."""
        return next((values for key, values in reversed(self.metadata) if key == name), {})

    def batches(self, channel_ids: Collection[int]) -> Iterator[MessageBatch]:
        """Yield the messages of some channels chunk by chunk, in file order within a channel.

        Only chunks that hold such messages are unpacked.

        Raises
        ------
        LogError
            If a chunk is damaged (its CRC does not match, it does not unpack) or its compression
            is not known.
        """
        wanted = set(channel_ids)
        for block in self._blocks:
            held = block.index_offsets if block.offsets is None else block.offsets
            if not wanted.intersection(held):
                continue
            try:
                yield from self._block_batches(block, wanted)
            except DamageError as damage:
                self._fail(damage)

    def _block_batches(self, block: _Block, wanted: set[int]) -> Iterator[MessageBatch]:
        data, roomy = self._unpack_chunk(block) if block.length else (self._data, self._data)
        found = self._indexed(block, wanted, data) if block.offsets is None else None
        if found is None:
            if block.offsets is None:  # the index of this chunk is wrong: look for ourselves
                block.offsets = self._walk_chunk(block, data)
            offsets = {key: block.offsets[key] for key in wanted if key in block.offsets}
            found = {key: (at, rows_at(data, at, MESSAGE_HEAD)) for key, at in offsets.items()}
        for channel_id in sorted(found):
            start, head = found[channel_id]
            yield MessageBatch(
                channel_id,
                roomy,
                start + MESSAGE_HEAD.itemsize,
                start + RECORD.size + head['length'].astype(np.int64),
                head['log_time'],
                head['publish_time'],
            )

    def _indexed(
        self, block: _Block, wanted: set[int], data: Bytes
    ) -> dict[int, tuple[Offsets, NDArray[np.void]]] | None:
        """Return offsets and heads of messages by channel from the index; None if it is wrong."""
        found: dict[int, tuple[Offsets, NDArray[np.void]]] = {}
        for channel_id in wanted.intersection(block.index_offsets):
            entries = self._message_index(block.index_offsets[channel_id], channel_id)
            offset = entries['offset'].astype(np.int64)
            if offset.size == 0:
                continue
            if offset.min() < 0 or offset.max() > data.size - MESSAGE_HEAD.itemsize:
                return None
            if (offset[1:] <= offset[:-1]).any():
                # The index is ordered by time, the file by arrival; arrival is what we promise.
                entries = entries[np.argsort(entries['offset'], kind='stable')]
                offset = entries['offset'].astype(np.int64)
                if (offset[1:] == offset[:-1]).any():
                    return None
            head = rows_at(data, offset, MESSAGE_HEAD)
            length = head['length']
            fits = (length >= 22) & (length <= (data.size - RECORD.size - offset).astype('u8'))
            right = (
                (head['opcode'] == MESSAGE)
                & (head['channel'] == channel_id)
                & (head['log_time'] == entries['log_time'])
                & fits
            )
            if not right.all():
                return None
            found[channel_id] = offset, head
        return found

    def _message_index(self, at: int, channel_id: int) -> NDArray[np.void]:
        opcode, length = self._record_at(at)
        body = at + RECORD.size
        if opcode != MESSAGE_INDEX or length < 6:
            raise DamageError(at, 'expected a message index record')
        channel, size = struct.unpack_from('<HI', self._map, body)
        if channel != channel_id or size != length - 6 or size % 16:
            raise DamageError(at, f'expected the message index of channel {channel_id}')
        return np.frombuffer(self._map, INDEX_ENTRY, size // 16, body + 6)

    def _unpack_chunk(self, block: _Block) -> tuple[Bytes, Bytes]:
        """Return a chunk's records, unpacked into memory that the next chunk uses again.

        The second array is the same and some bytes behind it: a row that ends with the last
        message may be a little longer.
        """
        at = block.offset
        opcode, length = RECORD.unpack_from(self._map, at)
        if opcode != CHUNK or length + RECORD.size != block.length:
            raise DamageError(
                at,
                f'expected a chunk of {block.length - RECORD.size} bytes as the index says, '
                f'found a record 0x{opcode:02x} that claims {length}',
            )
        reader = RecordReader(self._map, at + RECORD.size, at + block.length)
        reader.skip(16)
        size, crc = reader.u64(), reader.u32()
        compression = reader.text()
        packed_size = reader.u64()
        start = reader.at
        if start + packed_size > reader.end:
            raise DamageError(
                at,
                f'the chunk claims {packed_size} bytes of records, {reader.end - start} are there',
            )
        if compression not in ('', 'none', 'lz4', 'zstd'):
            raise LogError(
                f'{self.path}: byte {at}: chunk compression {_shortened(compression)} is not '
                'supported; known: zstd, lz4, none'
            )
        if size > self.max_chunk_bytes:
            raise LogError(
                f'{self.path}: byte {at}: a chunk of {packed_size} bytes claims to unpack to '
                f'{size} bytes; at most {self.max_chunk_bytes} are accepted'
            )
        packed = self._data[start : start + packed_size]
        if self._buffer.size < size + ROOM:
            self._buffer = np.empty(size + ROOM, np.uint8)
        try:
            data = unpack(compression, packed, self._buffer[:size])
        except ValueError as error:
            raise DamageError(at, f'the chunk does not unpack: {error}') from None
        if crc and (found := crc32(data.data)) != crc:
            raise DamageError(at, f'the chunk is damaged: CRC {found:08x}, stored {crc:08x}')
        if data is packed:
            return data, self._data[start : start + packed_size + ROOM]
        return data, self._buffer[: size + ROOM]

    def _record_at(self, at: int) -> tuple[int, int]:
        if not len(MAGIC) <= at <= self.size - RECORD.size:
            raise DamageError(at, f'no record there: the file has {self.size} bytes')
        opcode, length = RECORD.unpack_from(self._map, at)
        if length > self.size - at - RECORD.size:
            raise DamageError(
                at,
                f'record 0x{opcode:02x} claims {length} bytes, '
                f'{self.size - at - RECORD.size} are left in the file',
            )
        return opcode, length

    def _check_magic(self) -> None:
        start = bytes(self._map[:16])
        if start.startswith(MAGIC):
            return
        for magic, name in OTHER_FORMATS.items():
            if start.startswith(magic):
                raise LogError(f'{self.path}: not an MCAP but {name}')
        if start.startswith(MAGIC[:5]):
            raise LogError(
                f'{self.path}: byte 5: unsupported MCAP version {start[5:6]!r}; supported: 0'
            )
        raise LogError(
            f'{self.path}: byte 0: not an MCAP: it begins with {start[:8].hex(" ")}, '
            f'expected {MAGIC.hex(" ")}'
        )

    def _read_header(self) -> None:
        opcode, length = self._record_at(len(MAGIC))
        if opcode != HEADER:
            raise DamageError(len(MAGIC), f'expected a header record, found 0x{opcode:02x}')
        start = len(MAGIC) + RECORD.size
        reader = RecordReader(self._map, start, start + length)
        self.profile, self.library = reader.text(), reader.text()

    def _open_indexed(self) -> bool:
        """Take everything from the summary; False if there is none or it does not add up."""
        if not self._closed_properly:
            return False
        footer_at = self.size - len(MAGIC) - FOOTER_RECORD.size
        try:
            opcode, length, start, _, crc = FOOTER_RECORD.unpack_from(self._map, footer_at)
            if opcode != FOOTER or length != 20:
                raise DamageError(footer_at, 'expected the footer record')
            if start == 0:
                return False
            if not len(MAGIC) <= start <= footer_at:
                raise DamageError(footer_at, f'the footer puts the summary at byte {start}')
            stop = footer_at + FOOTER_RECORD.size - 4
            if crc and crc32(self._data[start:stop].data) != crc:
                raise DamageError(start, 'the summary does not match its CRC')
            return self._take_summary(start, footer_at)
        except DamageError as damage:
            self.warnings.append(f'the index is damaged ({damage}): the whole file was read')
            self._forget()
            return False

    def _take_summary(self, start: int, stop: int) -> bool:
        expected: dict[int, int] | None = None
        chunk_count = metadata_count = 0
        blocks: dict[int, _Block] = {}
        metadata_at: list[int] = []
        for opcode, _, at, end in walk(self._data, start, stop):
            reader = RecordReader(self._map, at, end)
            if opcode in (SCHEMA, CHANNEL):
                self._define(opcode, reader)
            elif opcode == STATISTICS:
                reader.skip(8 + 2 + 4 + 4)
                metadata_count, chunk_count = reader.u32(), reader.u32()
                reader.skip(16)
                expected = dict(reader.pairs('<HQ'))
            elif opcode == METADATA_INDEX:
                metadata_at.append(reader.u64())
            elif opcode == CHUNK_INDEX:
                reader.skip(16)
                offset, length = reader.u64(), reader.u64()
                if not len(MAGIC) <= offset <= offset + length <= start:
                    raise DamageError(at, f'the index puts a chunk at byte {offset}')
                blocks[offset] = _Block(offset, length, index_offsets=dict(reader.pairs('<HQ')))
        counts = self._count_indexed(blocks.values())
        expected = {key: n for key, n in expected.items() if n} if expected is not None else None
        complete = (
            expected == counts
            and chunk_count == len(blocks)
            and metadata_count == len(metadata_at)
            and all(key in self.channels for key in counts)
            and all(
                channel.schema_id == 0 or channel.schema_id in self.schemas
                for channel in self.channels.values()
            )
        )
        if not complete:  # chunks without index, messages outside chunks, a summary without copies
            self._forget()
            return False
        self._blocks = [blocks[offset] for offset in sorted(blocks)]
        self.message_counts = {key: counts.get(key, 0) for key in self.channels}
        for at in metadata_at:
            opcode, length = self._record_at(at)
            if opcode != METADATA:
                raise DamageError(at, 'expected a metadata record')
            self._take_metadata(RecordReader(self._map, at + 9, at + 9 + length))
        return True

    def _count_indexed(self, blocks: Iterable[_Block]) -> dict[int, int]:
        """Return how many messages of each channel the indexes of chunks list, if any."""
        pairs = [pair for block in blocks for pair in block.index_offsets.items()]
        channel, at = np.array(pairs, np.uint64).reshape(-1, 2).T
        inside = (at >= len(MAGIC)) & (at <= max(self.size - MESSAGE_INDEX_HEAD.itemsize, 0))
        if not inside.all():
            outside = int(at[np.argmin(inside)])
            raise DamageError(outside, f'no record there: the file has {self.size} bytes')
        head = rows_at(self._data, at.astype(np.int64), MESSAGE_INDEX_HEAD)
        right = (
            (head['opcode'] == MESSAGE_INDEX)
            & (head['channel'] == channel)
            & (head['length'] == head['size'].astype(np.uint64) + 6)
            & (head['length'] <= self.size - RECORD.size - at)
            & (head['size'] % INDEX_ENTRY.itemsize == 0)
        )
        if not right.all():
            wrong = int(np.argmin(right))
            raise DamageError(int(at[wrong]), f'expected the message index of {channel[wrong]}')
        counts = np.zeros(2**16, np.int64)
        np.add.at(counts, channel.astype(np.int64), head['size'] // INDEX_ENTRY.itemsize)
        return {int(key): int(counts[key]) for key in np.flatnonzero(counts)}

    def _scan(self) -> None:
        """Read the whole file from front to back."""
        loose: list[Offsets] = []
        at = len(MAGIC)
        stop = self.size - (len(MAGIC) if self._closed_properly else 0)
        ended = False
        try:
            for opcode, offsets, body, end in walk(self._data, at, stop):
                at = body - RECORD.size
                reader = RecordReader(self._map, body, end)
                if opcode == CHUNK:
                    self._flush_loose(loose)
                    block = _Block(at, end - at)
                    block.offsets = self._walk_chunk(block, self._unpack_chunk(block)[0])
                    self._blocks.append(block)
                elif opcode in (SCHEMA, CHANNEL):
                    self._define(opcode, reader)
                elif opcode == MESSAGE:
                    loose.append(offsets)
                elif opcode == METADATA:
                    self._take_metadata(reader)
                elif opcode == DATA_END:
                    crc = reader.u32()
                    if crc and crc32(self._data[:at].data) != crc:
                        raise DamageError(at, 'the data section does not match its CRC')
                    ended = True
                    break
                at = end
            if not ended:
                raise DamageError(at, 'the end of the data section is missing')
            if not self._closed_properly:
                self.warnings.append('the end of the file is missing; its messages are complete')
        except DamageError as damage:
            if self._closed_properly:
                raise
            # A recorder that was killed, or half a download: what comes before is sound.
            self.warnings.append(
                f'the recording was cut short: nothing could be read from byte {at} on '
                f'({self.size - at} of {self.size} bytes; {damage})'
            )
        self._flush_loose(loose)
        self.message_counts = dict.fromkeys(self.channels, 0)
        for block in self._blocks:
            for channel_id, held in (block.offsets or {}).items():
                if channel_id not in self.channels:
                    raise LogError(
                        f'{self.path}: byte {block.offset}: messages of channel {channel_id}, '
                        'which the file does not define'
                    )
                self.message_counts[channel_id] += held.size

    def _flush_loose(self, loose: list[Offsets]) -> None:
        if loose:
            table = by_channel(self._data, np.concatenate(loose))
            self._blocks.append(_Block(int(loose[0][0]), offsets=table))
            loose.clear()

    def _walk_chunk(self, block: _Block, data: Bytes) -> dict[int, Offsets]:
        """Return record offsets by channel of an unpacked chunk; take its definitions."""
        messages = [np.empty(0, np.int64)]
        try:
            for opcode, offsets, body, end in walk(data, 0, data.size):
                if opcode == MESSAGE:
                    messages.append(offsets)
                elif opcode in (SCHEMA, CHANNEL):
                    self._define(opcode, RecordReader(data.data, body, end))
        except DamageError as damage:
            raise DamageError(block.offset, f'inside the chunk, {damage}') from None
        return by_channel(data, np.concatenate(messages))

    def _define(self, opcode: int, reader: 'RecordReader') -> None:
        if opcode == SCHEMA:
            id_ = reader.u16()
            schema = Schema(id_, reader.text(), reader.text(), reader.blob())
            if self.schemas.setdefault(id_, schema) != schema:
                raise DamageError(reader.at, f'schema {id_} is defined twice and differently')
        else:
            id_, schema_id = reader.u16(), reader.u16()
            channel = Channel(id_, schema_id, reader.text(), reader.text(), reader.text_map())
            if self.channels.setdefault(id_, channel) != channel:
                raise DamageError(reader.at, f'channel {id_} is defined twice and differently')

    def _take_metadata(self, reader: 'RecordReader') -> None:
        self.metadata.append((reader.text(), reader.text_map()))

    def _forget(self) -> None:
        self.schemas, self.channels, self._blocks = {}, {}, []
        self.message_counts, self.metadata = {}, []

    def _fail(self, damage: DamageError) -> NoReturn:
        raise LogError(f'{self.path}: {damage}') from None


def _shortened(text: str) -> str:
    """Return a text of the file as it may be shown: damaged files hold anything, of any length."""
    return f'{text!r}' if len(text) <= _SHOWN else f'{text[:_SHOWN]!r}...'
