"""Position sources of a log: which there are, and the track that one of them measured.

What a topic holds is told by its schema and the fields in it, not by the topic's name. Of several
usable sources the kind decides, in the order of `kinds`; among equals the one with more messages,
then the topic first in the alphabet. Positions of several sources are never merged; where a
position on earth comes without velocity, that of a topic beside it that agrees is taken, see
`companions`.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..environment.geodesy import GeodeticPoint
from ..errors import InputError, LogError
from . import location_fix
from .choosing import check_range, choose_samples, first_usable
from .companions import is_velocity, with_companion_velocity
from .decoders import decodable, decoded_columns
from .kinds import (
    LOCATION_FIX,
    ORDER,
    OWN_ORDER,
    USABLE,
    Kind,
    fields_of,
    kind_named,
    kind_of,
)
from .mcap_container import McapFile, Schema
from .measurements import Measured, with_checked_velocity
from .timeline import Rows, choose_clock
from .track import Datum, Track

METADATA_NAME = 'flightdyn'
"""Name of the metadata record in flightdyn's own recordings."""

_TOPICS_SHOWN = 12  # an error is one line


@dataclass(frozen=True)
class Source:
    """A topic of a log, and what it can serve as.

    Parameters
    ----------
    topic, schema, encoding : str
        `schema` is empty if the topic has none.
    kind : str
        One of `kinds.ORDER`; empty if it is no position source.
    messages : int
    usable : bool
    rank : int
        0 for what `read_track` takes by itself; -1 if not usable.
    note : str
        Why it is not usable.
    channels : tuple of int
        Ids of its channels in the file.
    """

    topic: str
    schema: str
    encoding: str
    kind: str
    messages: int
    usable: bool
    rank: int = -1
    note: str = ''
    channels: tuple[int, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return everything but the channel ids, for JSON."""
        values = asdict(self)
        del values['channels']
        return values


def list_sources(log: McapFile | str | Path) -> list[Source]:
    """Return the topics of a log: usable position sources first, best first.

    Parameters
    ----------
    log : McapFile or path

    Raises
    ------
    LogError
        If the file cannot be read.
    """
    if not isinstance(log, McapFile):
        with McapFile(log) as opened:
            return list_sources(opened)
    grouped: dict[tuple[str, int, str], list[int]] = {}
    for channel in log.channels.values():
        key = (channel.topic, channel.schema_id, channel.message_encoding)
        grouped.setdefault(key, []).append(channel.id)
    found = [_describe(log, *key, tuple(ids)) for key, ids in grouped.items()]
    order = OWN_ORDER if log.metadata_record(METADATA_NAME) else ORDER

    def place(source: Source) -> tuple[bool, int, int, str]:
        kind = order.index(source.kind) if source.usable else len(order)
        return (not source.usable, kind, -source.messages if source.usable else 0, source.topic)

    found.sort(key=place)
    return [replace(s, rank=i if s.usable else -1) for i, s in enumerate(found)]


def _describe(
    log: McapFile, topic: str, schema_id: int, encoding: str, ids: tuple[int, ...]
) -> Source:
    messages = sum(log.message_counts[key] for key in ids)
    schema = log.schemas.get(schema_id)
    name = schema.name if schema else ''
    source = Source(topic, name, encoding, '', messages, usable=False, channels=ids)
    if schema is None:
        lacks = f'has schema id {schema_id}, which is not in the file'
        return replace(source, note=lacks if schema_id else 'has no schema')
    kind = _kind_of(schema, encoding)
    if kind is None:
        if is_velocity(schema, encoding):
            return replace(source, note='a velocity: used with a fix beside it that agrees')
        meant = kind_named(schema.name)
        if meant is None and (decodable(schema, encoding) or encoding == 'json'):
            return replace(source, note='not a position, or not readable yet')
        unreadable = f"message encoding '{encoding}' of {schema.name} is not readable yet"
        return replace(source, kind=meant.name if meant else '', note=unreadable)
    if not location_fix.readable(schema, encoding):
        try:
            fields_of(kind, schema, encoding)
        except LogError as error:
            return replace(source, kind=kind.name, note=str(error))
    if messages == 0:
        return replace(source, kind=kind.name, note='has no messages')
    return replace(source, kind=kind.name, usable=True)


def _kind_of(schema: Schema, encoding: str) -> Kind | None:
    if location_fix.readable(schema, encoding):
        return LOCATION_FIX
    return kind_of(schema, encoding)


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
        An MCAP file.
    source : str, optional
        Topic to read; omitted: the first of `list_sources` that has usable samples.
    start, end : float, optional
        Seconds since the source's first usable sample.

    Raises
    ------
    LogError
        If the file is damaged, has no (such) usable source, or fewer than two usable samples.
    """
    check_range(start, end)
    with McapFile(path) as log:
        known = list_sources(log)
        usable = [s for s in known if s.usable]
        candidates = usable if source is None else _named(log, known, source)
        if not candidates:
            raise LogError(
                f'{path}: no usable position source. Topics: {_topics(known)}. '
                f'Usable would be: {USABLE}'
            )
        return first_usable(
            path,
            candidates,
            usable if source is None else [],
            lambda candidate, notes: track_of(log, candidate, start, end, notes),
        )


def _named(log: McapFile, known: Sequence[Source], topic: str) -> list[Source]:
    named = [s for s in known if s.topic == topic]
    if not named:
        raise LogError(f"{log.path}: no topic '{topic}'. Topics: {_topics(known)}")
    usable = [s for s in named if s.usable]
    if not usable:
        raise LogError(
            f'{log.path}: topic {topic} ({named[0].schema or "no schema"}) cannot be used: '
            f'{named[0].note}. Topics: {_topics(known)}. Usable would be: {USABLE}'
        )
    return usable


def _topics(known: Sequence[Source]) -> str:
    shown = []
    for s in known[:_TOPICS_SHOWN]:
        why = f': {s.note}' if s.note and (s.kind or not s.schema) else ''
        shown.append(f'{s.topic} ({s.schema or s.encoding}{why})')
    if len(known) > _TOPICS_SHOWN:
        shown.append(f'and {len(known) - _TOPICS_SHOWN} more')
    return ', '.join(shown) or 'none'


def track_of(
    log: McapFile, source: Source, start: float | None, end: float | None, notes: list[str]
) -> Track:
    """Return what one source of a log measured; its warnings begin with the notes.

    Raises
    ------
    LogError
        If the file is damaged, or fewer than two usable samples are in the range asked for.
    NothingUsableError
        If fewer than two are in the log.
    """
    warnings = [*log.warnings, *notes]
    schema = log.schemas[log.channels[source.channels[0]].schema_id]
    kind = _kind_of(schema, source.encoding)
    assert kind is not None
    if location_fix.readable(schema, source.encoding):
        columns = location_fix.read_columns(log, source.channels)
    else:
        fields = fields_of(kind, schema, source.encoding)
        columns = decoded_columns(log, source.channels, fields)
        if not schema.data.strip():
            warnings.append(f'schema {schema.name} has no text: the standard definition was used')
    rows = Rows(np.zeros(len(columns), np.uint8))
    for code, why in enumerate(columns.fault_names):
        if code:
            rows.drop(columns.fault == code, why)
    measured = kind.measure(columns, rows, warnings)
    time = choose_clock(measured.stamp, columns.log_time, rows, warnings)
    index, segment, chosen = choose_samples(
        log.path, source, time, rows, [measured.epoch], (start, end), warnings
    )
    origin = measured.origin
    if origin is None and measured.position_ned is not None:
        origin = recorded_origin(log.metadata_record(METADATA_NAME), warnings)
    track = Track(
        time_ns=time[index],
        segment=segment,
        origin=origin,
        altitude_datum=_datum(source, measured, origin, warnings),
        clock='recorder' if time is columns.log_time else 'message',
        file=str(log.path),
        source=source.topic,
        schema=source.schema,
        messages=int(chosen.sum()),
        dropped=rows.counts(chosen),
        warnings=warnings,
        **{name: column[index] for name, column in measured.columns().items()},
    )
    track = with_checked_velocity(track)
    if track.lat is None or track.velocity_ned is not None:
        return track
    stamped = time is not columns.log_time
    return with_companion_velocity(log, track, columns.log_time[index], stamped=stamped)


def recorded_origin(own: dict[str, str], warnings: list[str]) -> GeodeticPoint | None:
    """Return the local frame's origin out of a recording's metadata, None if it has none."""
    keys = ('origin_lat', 'origin_lon', 'origin_altitude')
    if not all(key in own for key in keys):
        return None
    try:
        return GeodeticPoint(*(float(own[key]) for key in keys))
    except (ValueError, InputError) as error:
        warnings.append(f'the origin in the recording is not usable: {error}')
        return None


def _datum(
    source: Source, measured: Measured, origin: GeodeticPoint | None, warnings: list[str]
) -> Datum:
    if measured.position_ned is not None and origin is None:
        return 'local'
    # ArduPilot's DDS client puts mean sea level into NavSatFix, against the message's definition.
    if source.topic.startswith('/ap/navsat'):
        warnings.append(f'{source.topic} is ArduPilot: its altitude is above mean sea level')
        return 'msl'
    return measured.datum
