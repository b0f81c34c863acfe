"""Logs of every kind that can be read; the kind is told by the file's first bytes."""

import os
from dataclasses import replace
from pathlib import Path
from types import ModuleType

from ..errors import LogError
from .choosing import check_range, first_usable
from .formats import bags, dataflash, gpx, igc, phone_csv, tlog, ulog
from .formats.reading import OpenedLog
from .info import LogInfo, log_info
from .mcap_container import McapFile
from .mcap_records import MAGIC, OTHER_FORMATS
from .provenance import converted_topics, with_motion, with_provenance
from .sources import METADATA_NAME, Source, ranked
from .sources import read_track as read_mcap_track
from .track import Track

READABLE = (
    'MCAP, ROS 1 bag, ROS 2 bag (folder, .db3), PX4 .ulg, ArduPilot .bin, MAVLink .tlog, IGC, '
    'GPX, CSV'
)

_FORMATS: tuple[ModuleType, ...] = (bags, ulog, dataflash, tlog, igc, gpx, phone_csv)
_HEAD_BYTES = 8192
_MAGIC = MAGIC[:5]  # of any version: what is wrong with it the reader says


def read_track(
    path: str | Path,
    source: str | None = None,
    start: float | None = None,
    end: float | None = None,
) -> Track:
    """Return what the best position source of a log measured, or a chosen one.

    Parameters
    ----------
    path : path
    source : str, optional
        As `describe` lists them; omitted: the first that has usable samples.
    start, end : float, optional
        Seconds since the source's first usable sample.

    Raises
    ------
    LogError
        If the file is damaged or of an unknown kind, has no (such) usable source, or fewer than
        two usable samples.
    MissingExtraError
        If a package is needed for this kind of file and is not installed.
    """
    check_range(start, end)
    log = open_log(Path(path))
    if log is None:
        return _read_mcap(Path(path), source, start, end)
    return track_of(log, source, start, end)


def track_of(
    log: OpenedLog,
    source: str | None = None,
    start: float | None = None,
    end: float | None = None,
) -> Track:
    """Return what a source of an opened log measured; as `read_track`."""
    path = log.path
    usable = [s for s in log.sources if s.usable]
    candidates = usable
    if source is not None:
        candidates = [s for s in log.sources if s.topic == source]
        if not candidates:
            raise LogError(f"{path}: no source '{source}'. Sources: {_listed(log.sources)}")
        if not candidates[0].usable:
            raise LogError(f'{path}: {source} cannot be used: {candidates[0].note}')
    if not candidates:
        raise LogError(f'{path}: no usable position source. There are: {_listed(log.sources)}')
    return first_usable(
        path,
        candidates,
        usable if source is None else [],
        lambda candidate, notes: log.track(candidate, start, end, notes),
    )


def _read_mcap(path: Path, source: str | None, start: float | None, end: float | None) -> Track:
    # Our recorder puts its metadata in front; a large foreign file need not be opened twice.
    if b'converted_from' not in _head(path):
        return read_mcap_track(path, source, start, end)
    with McapFile(path) as mcap:
        own = mcap.metadata_record(METADATA_NAME)
    topics = converted_topics(own) if source is None else ()
    if not topics:
        return with_provenance(read_mcap_track(path, source, start, end), own)
    place, *motion = (read_mcap_track(path, topic, start, end) for topic in topics)
    return with_provenance(with_motion(place, *motion), own)


def describe(path: str | Path) -> LogInfo:
    """Return what is in a log.

    Raises
    ------
    LogError, MissingExtraError
        As `read_track`.
    """
    path = Path(path)
    log = open_log(path)
    if log is None:
        return log_info(path)
    return LogInfo(
        file=str(path),
        size=_size(path),
        profile='',
        library=log.library,
        messages=sum(source.messages for source in log.sources),
        sources=log.sources,
        metadata={log.format.lower(): log.metadata} if log.metadata else {},
        warnings=log.warnings,
        format=log.format,
    )


def is_mcap(path: str | Path) -> bool:
    """Return whether a file begins as an MCAP does."""
    return not os.path.isdir(path) and _head(Path(path)).startswith(_MAGIC)


def open_log(path: Path) -> OpenedLog | None:
    """Return a log with its sources, the preferred one first; None for an MCAP file.

    Raises
    ------
    LogError, MissingExtraError
        As `read_track`.
    """
    head = b'' if os.path.isdir(path) else _head(path)
    if head.startswith(_MAGIC):
        return None
    for kind in _FORMATS:
        if kind.recognises(head, path):
            try:
                log: OpenedLog = kind.open_log(path)
            except OSError as error:
                raise LogError(f'{path}: cannot be read: {error.strerror or error}') from None
            if path.suffix.lower() == '.mcap':
                raise LogError(
                    f'{path}: no MCAP but {log.format}, in spite of its name: rename it, then '
                    'it can be replayed, or written as MCAP by `flightdyn convert`'
                )
            return replace(log, sources=_ranked(log.sources))
    raise LogError(f'{path}: {_unknown(head, path)}; readable: {READABLE}')


def _head(path: Path) -> bytes:
    try:
        if path.exists() and not path.is_file():  # a pipe would be waited for, and read but once
            raise LogError(f'{path}: a pipe or device, not a file: save what comes from it first')
        with path.open('rb') as stream:
            return stream.read(_HEAD_BYTES)
    except OSError as error:
        raise LogError(f'{path}: cannot be read: {error.strerror or error}') from None


def _unknown(head: bytes, path: Path) -> str:
    if path.is_dir():
        return 'a folder that is no ROS 2 bag (it has no metadata.yaml)'
    if not head:
        return 'the file is empty (0 bytes)'
    for magic, name in OTHER_FORMATS.items():
        if head.startswith(magic):
            return f'not a flight log but {name}'
    return f'not a log of a known kind: it begins with {head[:8].hex(" ")}'


def _ranked(sources: list[Source]) -> list[Source]:
    return sources if any(source.rank >= 0 for source in sources) else ranked(sources)


def _listed(sources: list[Source]) -> str:
    shown = [f'{s.topic} ({s.note or s.schema})' for s in sources[:12]]
    if len(sources) > 12:
        shown.append(f'and {len(sources) - 12} more')
    return ', '.join(shown) or 'none'


def _size(path: Path) -> int:
    if path.is_dir():
        return sum(part.stat().st_size for part in path.iterdir() if part.is_file())
    return path.stat().st_size
