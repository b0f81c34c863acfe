"""ROS bags: ROS 1 (.bag), ROS 2 folders and .db3 files.

They hold the same messages as an MCAP, so each kind of bag is made to look like an open MCAP
file, and everything else is as there.
"""

import bz2
import struct
from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from ...errors import LogError
from ..mcap_container import MAX_CHUNK_BYTES, Channel, McapFile, MessageBatch, Schema
from ..sources import Source, list_sources, track_of
from ..track import Track
from .reading import OpenedLog

if TYPE_CHECKING:
    from rosbags.interfaces import Connection

NAME = 'ROS bag'

_ROS1, _SQLITE = b'#ROSBAG V', b'SQLite format 3\0'
_MAX_METADATA_BYTES = 16 * 2**20
_BATCH_MESSAGES, _BATCH_BYTES = 4096, 16 * 2**20
_PART = 2**32  # channel ids of the parts of a folder are this far apart


def recognises(head: bytes, path: Path) -> bool:
    """Return whether a path is a bag that begins like this."""
    if path.is_dir():
        return (path / 'metadata.yaml').is_file()
    return head.startswith((_ROS1, _SQLITE))


def open_log(path: Path) -> OpenedLog:
    """Open a bag and list its topics.

    Raises
    ------
    LogError
        If it cannot be read, or has no index.
    """
    with _open(path) as bag:
        known = list_sources(bag)
        warnings, library = list(bag.warnings), bag.library

    def track(source: Source, start: float | None, end: float | None, notes: list[str]) -> Track:
        with _open(path) as bag:
            return track_of(bag, source, start, end, notes)

    return OpenedLog(
        path=path,
        format=library,
        sources=known,
        track=track,
        library='',
        warnings=warnings,
    )


def _open(path: Path) -> '_Bag':
    if path.is_dir():
        return _folder(path)
    with path.open('rb') as stream:
        ros1 = stream.read(len(_ROS1)) == _ROS1
    return _RosbagsBag(path, ros1)


class _Bag(McapFile):
    """Looks like an open MCAP file; the constructor does not call that of the base."""

    def __init__(self, path: Path, library: str) -> None:
        self.path, self.library, self.profile = path, library, ''
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.message_counts: dict[int, int] = {}
        self.metadata: list[tuple[str, dict[str, str]]] = []
        self.warnings: list[str] = []
        self.size = 0

    def schema_id(self, name: str, encoding: str, data: bytes) -> int:
        """Return the id of a schema, the same for the same schema."""
        for known in self.schemas.values():
            if (known.name, known.encoding, known.data) == (name, encoding, data):
                return known.id
        number = len(self.schemas) + 1
        self.schemas[number] = Schema(number, name, encoding, data)
        return number


class _RosbagsBag(_Bag):
    """A .bag or .db3 file, through rosbags."""

    def __init__(self, path: Path, ros1: bool) -> None:
        super().__init__(path, 'ROS 1 bag' if ros1 else 'ROS 2 bag (sqlite3)')
        self.size = path.stat().st_size
        self._faults = _faults()
        self._reader: Any
        try:
            if ros1:
                from rosbags.rosbag1 import Reader as Ros1Reader

                self._reader = Ros1Reader(path)
                self._reader.open()
                _bound_chunks(self._reader)
            else:
                from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

                self._reader = Sqlite3Reader(path)
                self._reader.open()
        except self._faults as fault:
            raise self._error(fault) from None
        if not ros1 and _journal_size(path):
            self.warnings.append(
                'the recorder did not close the bag: its last messages may be missing'
            )
        encodings = ('ros1msg', 'ros1') if ros1 else ('ros2msg', 'cdr')
        self._connections: dict[int, Connection] = {}
        for number, connection in enumerate(self._reader.connections, 1):
            self._connections[number] = connection
            schema_encoding, encoding = encodings
            if not ros1:
                encoding = connection.ext.serialization_format
                if connection.msgdef.format.name == 'IDL':
                    schema_encoding = 'ros2idl'
            data = connection.msgdef.data.encode()
            schema = self.schema_id(connection.msgtype, schema_encoding, data)
            self.channels[number] = Channel(number, schema, connection.topic, encoding)
            self.message_counts[number] = connection.msgcount

    def close(self) -> None:
        """Let go of the file."""
        self._reader.close()

    def batches(self, channel_ids: Collection[int]) -> Iterator[MessageBatch]:
        """Yield the messages of some channels in the order in which they were recorded."""
        for number in sorted(channel_ids):
            payloads: list[bytes] = []
            times: list[int] = []
            size = 0
            try:
                for _, ns, payload in self._reader.messages([self._connections[number]]):
                    payloads.append(payload)
                    times.append(ns)
                    size += len(payload)
                    if len(payloads) == _BATCH_MESSAGES or size > _BATCH_BYTES:
                        yield _batch(number, payloads, times)
                        payloads, times, size = [], [], 0
            except self._faults as fault:
                raise self._error(fault) from None
            if payloads:
                yield _batch(number, payloads, times)

    def _error(self, fault: BaseException) -> LogError:
        text = (str(fault).splitlines() or [''])[0] or type(fault).__name__
        if 'not indexed' in text:
            text = "the bag has no index (the recorder was killed): run 'rosbag reindex' first"
        return LogError(f'{self.path}: the {self.library} cannot be read: {text[:300]}')


class _JoinedBag(_Bag):
    """The files of a folder, one after the other."""

    def __init__(self, path: Path, library: str, parts: list[McapFile]) -> None:
        super().__init__(path, library)
        self._parts = parts
        for number, part in enumerate(parts):
            self.size += part.size
            self.metadata += part.metadata
            self.warnings += [f'{part.path.name}: {warning}' for warning in part.warnings]
            ids = {
                known.id: self.schema_id(known.name, known.encoding, known.data)
                for known in part.schemas.values()
            }
            for channel in part.channels.values():
                here = number * _PART + channel.id
                schema = ids.get(channel.schema_id, channel.schema_id)
                self.channels[here] = replace(channel, id=here, schema_id=schema)
                self.message_counts[here] = part.message_counts[channel.id]

    def close(self) -> None:
        """Let go of all files."""
        for part in self._parts:
            part.close()

    def batches(self, channel_ids: Collection[int]) -> Iterator[MessageBatch]:
        """Yield the messages of some channels, file by file."""
        for number, part in enumerate(self._parts):
            ids = [key % _PART for key in channel_ids if key // _PART == number]
            if ids:
                for batch in part.batches(ids):
                    yield replace(batch, channel_id=number * _PART + batch.channel_id)


def _folder(path: Path) -> _Bag:
    about = _metadata(path / 'metadata.yaml')
    storage = about.get('storage_identifier')
    if storage not in ('mcap', 'sqlite3'):
        raise LogError(f'{path}: storage {storage!r:.50} is not supported; known: mcap, sqlite3')
    if about.get('compression_mode') not in (None, '', 'none', 'NONE'):
        raise LogError(f"{path}: a compressed bag; unpack it with 'ros2 bag convert' first")
    names = about.get('relative_file_paths')
    if not isinstance(names, list) or not names or not all(isinstance(n, str) for n in names):
        raise LogError(f'{path}: metadata.yaml lists no files (relative_file_paths)')
    parts: list[McapFile] = []
    try:
        for name in names:
            file = path / Path(name).name  # bags of 2019 list them with the folder
            if not file.is_file():
                raise LogError(
                    f'{path}: {Path(name).name} is in metadata.yaml but not in the folder'
                )
            parts.append(McapFile(file) if storage == 'mcap' else _RosbagsBag(file, ros1=False))
    except LogError:
        for part in parts:
            part.close()
        raise
    return _JoinedBag(path, f'ROS 2 bag ({storage})', parts)


def _metadata(path: Path) -> dict[str, Any]:
    try:
        if path.stat().st_size > _MAX_METADATA_BYTES:
            raise LogError(f'{path}: larger than {_MAX_METADATA_BYTES >> 20} MiB')
        document = yaml.safe_load(path.read_text('utf-8', 'replace'))
    except OSError as error:
        raise LogError(f'{path}: cannot be read: {error.strerror or error}') from None
    except (yaml.YAMLError, RecursionError) as error:
        raise LogError(f'{path}: no YAML: {str(error).splitlines()[0]}') from None
    about = document.get('rosbag2_bagfile_information') if isinstance(document, dict) else None
    if not isinstance(about, dict):
        raise LogError(f'{path}: no metadata of a ROS 2 bag (rosbag2_bagfile_information)')
    return about


def _batch(number: int, payloads: list[bytes], times: list[int]) -> MessageBatch:
    end = np.cumsum([len(payload) for payload in payloads]).astype(np.int64)
    time = np.array(times, np.int64)
    return MessageBatch(
        number,
        np.frombuffer(b''.join(payloads), np.uint8),
        np.concatenate(([0], end[:-1])).astype(np.int64),
        end,
        time,
        time,
    )


def _faults() -> tuple[type[BaseException], ...]:
    """Return what rosbags raises on files that are damaged, not always on purpose."""
    import apsw
    from rosbags.rosbag1 import ReaderError as Ros1Error
    from rosbags.rosbag2 import ReaderError as Ros2Error

    return (
        *(Ros1Error, Ros2Error, apsw.Error, OSError, struct.error, AssertionError, LookupError),
        *(ValueError, TypeError, AttributeError, OverflowError, EOFError, RuntimeError),
    )


def _bound_chunks(reader: Any) -> None:
    """Make chunks fail that unpack to more than is accepted in an MCAP."""
    from rosbags.rosbag1.reader import decompressors

    def bounded(make: Callable[[], Any]) -> Callable[[bytes], bytes]:
        def unpack(packed: bytes) -> bytes:
            data: bytes = make().decompress(packed, MAX_CHUNK_BYTES + 1)
            if len(data) > MAX_CHUNK_BYTES:
                raise ValueError(f'a chunk unpacks to more than {MAX_CHUNK_BYTES} bytes')
            return data

        return unpack

    import lz4.frame

    ways = {
        decompressors['bz2']: bounded(bz2.BZ2Decompressor),
        decompressors['lz4']: bounded(lz4.frame.LZ4FrameDecompressor),
    }
    reader.chunks = {
        at: chunk._replace(decompressor=ways.get(chunk.decompressor, chunk.decompressor))
        for at, chunk in reader.chunks.items()
    }


def _journal_size(path: Path) -> int:
    journal = path.with_name(path.name + '-wal')
    return journal.stat().st_size if journal.is_file() else 0
