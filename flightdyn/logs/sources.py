"""Position sources of a log: which there are, and the track that one of them measured.

What a topic holds is told by its schema and the fields in it, not by the topic's name. Of several
usable sources the kind decides, in the order of `kinds`. Among equals what is in a name space
`raw` comes after the same message from the name space above it, which is the estimator's, unless
that has less than half as many (mavros: `global_position/global` before
`global_position/raw/fix`); then the one with more messages, then the topic first in the alphabet.
Of MAVLink's senders autopilots come before other components, and ground stations after all.
Positions of several sources are never merged; where a position on earth comes without velocity,
that of a topic beside it that agrees is taken, see `companions`.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..environment.geodesy import GeodeticPoint
from ..errors import InputError, LogError
from . import location_fix, mavlink, mavlink_topics
from .attitudes import is_attitude, with_companion_attitude, with_mavlink_attitude
from .choosing import check_range, choose_samples, first_usable
from .companions import is_velocity, with_companion_velocity
from .decoders import decodable, decoded_columns
from .kinds import (
    LOCATION_FIXES,
    ORDER,
    OWN_ORDER,
    USABLE,
    Kind,
    fields_of,
    is_wanted,
    kind_named,
    kind_of,
)
from .mavlink_topics import Sender
from .mcap_container import McapFile, Schema
from .measurements import Measured, with_checked_velocity
from .timeline import Rows, choose_clock
from .track import Datum, Track

METADATA_NAME = 'flightdyn'
"""Name of the metadata record in flightdyn's own recordings."""

_ENU = ('pose', 'odometry')  # local positions in the axes that velocities beside them have
_WANTED = 3  # standing of what is no measurement, after that of MAVLink's ground stations
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
    sender : Sender or None
        Whose messages of the topic these are, where it holds those of several MAVLink systems.
    standing : int
        A source of less standing comes after all others, whatever its kind.
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
    sender: Sender | None = None
    standing: int = 0

    def to_dict(self) -> dict[str, Any]:
        """Return what is of use outside this program, for JSON."""
        values = asdict(self)
        for name in ('channels', 'sender', 'standing'):
            del values[name]
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
    return ranked(_with_senders(log, found), order)


def ranked(sources: Sequence[Source], order: Sequence[str] = ORDER) -> list[Source]:
    """Return sources in the order in which they are preferred, with their ranks."""
    usable = [source for source in sources if source.usable]

    def place(source: Source) -> tuple[bool, int, int, bool, int, str]:
        if not source.usable:
            return (True, 0, 0, False, 0, source.topic)
        kind, raw = order.index(source.kind), _raw_beside_fused(source, usable)
        return (False, source.standing, kind, raw, -source.messages, source.topic)

    found = sorted(sources, key=place)
    return [replace(s, rank=i if s.usable else -1) for i, s in enumerate(found)]


def _raw_beside_fused(source: Source, others: Sequence[Source]) -> bool:
    """Return whether a source is in a name space `raw` and one like it is in that above."""
    above, raw, _ = source.topic.rpartition('/raw/')
    return bool(raw) and any(
        other.schema == source.schema
        and other.topic.rpartition('/')[0] == above
        and 2 * other.messages >= source.messages
        for other in others
    )


def _with_senders(log: McapFile, found: Sequence[Source]) -> list[Source]:
    """Return the sources, and those of each MAVLink system in topics that hold several."""
    frames = [s for s in found if _may_be_mavlink(log, s, mavlink_topics.holds_frames)]
    texts = [s for s in found if _may_be_mavlink(log, s, mavlink_topics.may_hold_json)]
    senders: dict[tuple[int, ...], Counter[Sender]] = {}
    failure = ''
    try:
        for source in frames:
            senders[source.channels] = mavlink_topics.frame_senders(log, source.channels)
        by_channel = mavlink_topics.json_senders(log, [key for s in texts for key in s.channels])
        for source in texts:
            each = (by_channel.get(key, Counter()) for key in source.channels)
            senders[source.channels] = sum(each, Counter())
    except LogError as error:  # what else is in the log is told even if it is damaged
        failure = str(error)
    sources: list[Source] = []
    for source in found:
        if source in frames:
            nothing = failure or 'MAVLink without a message of position'
            sources += _split(source, senders.get(source.channels, Counter()), nothing)
        elif source in texts:
            sources += _split(source, senders.get(source.channels, Counter()), failure)
        else:
            sources.append(source)
    return sources


def _may_be_mavlink(log: McapFile, source: Source, holds: Callable[[Schema, str], bool]) -> bool:
    schema = log.schemas.get(log.channels[source.channels[0]].schema_id)
    return schema is not None and not source.kind and holds(schema, source.encoding)


def _split(source: Source, senders: Counter[Sender], nothing: str) -> list[Source]:
    """Return a topic's sources, one for each sender; `nothing` is said where there is none."""
    parts = [
        replace(
            source,
            topic=f'{source.topic}/{sender}',
            kind=sender.message.kind,
            messages=count,
            usable=True,
            note='',
            sender=sender,
            standing=mavlink.standing(sender.system, sender.component),
        )
        for sender, count in senders.most_common(mavlink_topics.MAX_SENDERS)
    ]
    if not parts:
        return [replace(source, note=nothing or source.note)]
    if source.encoding == 'json' and len(parts) == 1 and parts[0].messages == source.messages:
        return [replace(parts[0], topic=source.topic)]
    note = 'MAVLink: each system and message is a source of its own'
    return [*parts, replace(source, note=note)]


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
        if is_attitude(schema.name) and decodable(schema, encoding):
            return replace(source, note='an attitude: used with positions beside it')
        meant = kind_named(schema.name)
        if meant is None and (decodable(schema, encoding) or encoding == 'json'):
            return replace(source, note='not a position')
        unreadable = f"message encoding '{encoding}' of {schema.name} cannot be read"
        return replace(source, kind=meant.name if meant else '', note=unreadable)
    try:
        if location_fix.readable(schema, encoding):
            location_fix.check(schema, encoding)
        else:
            fields_of(kind, schema, encoding)
    except LogError as error:
        return replace(source, kind=kind.name, note=str(error))
    if messages == 0:
        return replace(source, kind=kind.name, note='has no messages')
    return replace(source, kind=kind.name, usable=True, standing=_WANTED * is_wanted(topic))


def _kind_of(schema: Schema, encoding: str) -> Kind | None:
    if location_fix.readable(schema, encoding):
        return LOCATION_FIXES
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
            damage = ''.join(f'{warning}; ' for warning in log.warnings)
            raise LogError(
                f'{path}: {damage}no usable position source. Topics: {_topics(known)}. '
                f'Usable would be: {USABLE}'
            )
        return first_usable(
            path,
            candidates,
            usable if source is None else [],
            lambda candidate, notes: track_of(log, candidate, start, end, notes),
        )


def _named(log: McapFile, known: Sequence[Source], topic: str) -> list[Source]:
    named = [s for s in known if s.topic == topic or (s.sender and _holds(log, s, topic))]
    if not named:
        raise LogError(f"{log.path}: no topic '{topic}'. Topics: {_topics(known)}")
    usable = [s for s in named if s.usable]
    if not usable:
        raise LogError(
            f'{log.path}: topic {topic} ({named[0].schema or "no schema"}) cannot be used: '
            f'{named[0].note}. Topics: {_topics(known)}. Usable would be: {USABLE}'
        )
    return usable


def _holds(log: McapFile, source: Source, topic: str) -> bool:
    return any(log.channels[key].topic == topic for key in source.channels)


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
    measure = source.sender.message.measure if source.sender else kind.measure if kind else None
    assert measure is not None
    if source.sender:
        columns = mavlink_topics.read_columns(log, source.channels, source.sender, warnings)
    elif location_fix.readable(schema, source.encoding):
        columns = location_fix.read_columns(log, source.channels)
    else:
        assert kind is not None
        fields = fields_of(kind, schema, source.encoding)
        columns = decoded_columns(log, source.channels, fields)
        if not schema.data.strip():
            warnings.append(f'schema {schema.name} has no text: the standard definition was used')
    rows = Rows(np.zeros(len(columns), np.uint8))
    for code, why in enumerate(columns.fault_names):
        if code:
            rows.drop(columns.fault == code, why)
    measured = measure(columns, rows, warnings)
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
    recorded, stamped = columns.log_time[index], time is not columns.log_time
    if track.velocity_ned is None and (track.lat is not None or source.kind in _ENU):
        track = with_companion_velocity(log, track, recorded, stamped=stamped)
    if source.sender and 'time_boot_ms' in columns.values:
        rows_of_track = columns.at(index)
        track = with_mavlink_attitude(log, track, source.channels, source.sender, rows_of_track)
    if track.attitude is None:
        track = with_companion_attitude(log, track, recorded, stamped=stamped)
    return track


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
    # ArduPilot's DDS client gives mean sea level, against the definition of the messages.
    parts = source.topic.split('/')
    if 'ap' in parts and any(part in ('navsat', 'geopose') for part in parts):
        warnings.append(f'{source.topic} is ArduPilot: its altitude is above mean sea level')
        return 'msl'
    return measured.datum
