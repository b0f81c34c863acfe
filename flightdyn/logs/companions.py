"""Velocity of a fix from another topic: found by name space and time, believed when it agrees.

NavSatFix says where, not how fast; drivers put the velocity into a topic beside it. Its axes and
signs are not to be trusted: mavros leaves the vertical part of the receiver's velocity at zero and
counts that of the fused one downwards in a message that is defined as up; ArduPilot names the
body's frame and means east, north, up. So every plausible reading is compared with the positions.

References
----------
.. [1] REP 103, *Standard Units of Measure and Coordinate Conventions*
.. [2] mavlink/mavros, issues 1015 and 2054
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .. import frames
from ..errors import LogError
from .decoders import decodable, decoded_columns
from .definitions import full_name
from .kinds import is_wanted
from .mcap_container import McapFile, Schema
from .measurements import ODOMETRY_FIELDS, Array, contradiction, odometry_measurements, stamp_ns
from .nearby import interpolated
from .timeline import Rows, choose_clock
from .track import Track

_STAMP = ('header.stamp.sec', 'header.stamp.nanosec')
_TWIST = tuple(f'twist.linear.{axis}' for axis in 'xyz')
_TWIST_OF_TWO = tuple(f'twist.twist.linear.{axis}' for axis in 'xyz')
_FIELDS = {
    'geometry_msgs/msg/TwistStamped': (*_STAMP, *_TWIST),
    'geometry_msgs/msg/TwistWithCovarianceStamped': (*_STAMP, *_TWIST_OF_TWO),
    'nav_msgs/msg/Odometry': ODOMETRY_FIELDS,
}
_ODOMETRY = 'nav_msgs/msg/Odometry'

_LEAST = 10  # samples; fewer do not tell right from wrong
_MOST_TRIED = 4


@dataclass(frozen=True)
class _Candidate:
    topic: str
    schema: Schema
    channels: tuple[int, ...]


def is_velocity(schema: Schema, encoding: str) -> bool:
    """Return whether messages are a velocity and no position."""
    name = full_name(schema.name)
    return name in _FIELDS and name != _ODOMETRY and decodable(schema, encoding)


def with_companion_velocity(
    log: McapFile, track: Track, log_time: NDArray[np.int64], *, stamped: bool
) -> Track:
    """Return a track with the velocity of the nearest topic that agrees with its positions.

    Parameters
    ----------
    log : McapFile
    track : Track
        Positions without velocity, read from `log`. The topic itself is asked, too: where it is
        Odometry its velocity may have been refused for the axes that its frames name.
    log_time : int array (n,)
        When each of them was recorded [ns].
    stamped : bool
        Whether times of the track are those of headers, not of the recorder.

    Notes
    -----
    Tried in this order: topics that share more of the track's name space, those with more
    messages, the alphabet. At least half of the fixes must have a velocity at their time. What
    was taken, and what was not and why, is told in the track's warnings.
    """
    notes: list[str] = []
    for candidate in _candidates(log, track.source)[:_MOST_TRIED]:
        why = ''
        try:
            readings = list(_readings(log, candidate, track, log_time, stamped=stamped))
        except LogError as error:
            notes.append(f'{candidate.topic} is not used as velocity: {error}')
            continue
        for velocity, remark in readings:
            wrong = contradiction(track, velocity)
            if not wrong:
                notes.append(f'velocity is that of {candidate.topic}{remark}')
                return replace(track, velocity_ned=velocity, warnings=[*track.warnings, *notes])
            why = why or wrong
        if why:
            notes.append(f'{candidate.topic} is not used as velocity: it {why}')
    return replace(track, warnings=[*track.warnings, *notes])


def _candidates(log: McapFile, topic: str) -> list[_Candidate]:
    grouped: dict[tuple[str, int], list[int]] = {}
    for channel in log.channels.values():
        schema = log.schemas.get(channel.schema_id)
        if schema is None or full_name(schema.name) not in _FIELDS:
            continue
        if not decodable(schema, channel.message_encoding):
            continue
        if is_wanted(channel.topic):  # it agrees with what the vehicle did
            continue
        if shared_name_spaces(topic, channel.topic) > 0:
            grouped.setdefault((channel.topic, channel.schema_id), []).append(channel.id)
    found = [
        _Candidate(name, log.schemas[schema], tuple(ids))
        for (name, schema), ids in grouped.items()
    ]

    def place(candidate: _Candidate) -> tuple[int, int, str]:
        messages = sum(log.message_counts[key] for key in candidate.channels)
        return (-shared_name_spaces(topic, candidate.topic), -messages, candidate.topic)

    return sorted(found, key=place)


def shared_name_spaces(topic: str, other: str) -> int:
    """Return how many name spaces two topics share, the root only if neither is in another."""
    mine, its = topic.strip('/').split('/')[:-1], other.strip('/').split('/')[:-1]
    if not mine or not its:
        return 1 if mine == its else 0
    same = 0
    for a, b in zip(mine, its, strict=False):
        if a != b:
            break
        same += 1
    return same


def _readings(
    log: McapFile,
    candidate: _Candidate,
    track: Track,
    log_time: NDArray[np.int64],
    *,
    stamped: bool,
) -> Iterator[tuple[Array, str]]:
    """Yield the velocities NED that a topic may mean at the track's times, likeliest first."""
    fields: Sequence[str] = _FIELDS[full_name(candidate.schema.name)]
    columns = decoded_columns(log, candidate.channels, fields)
    rows = Rows((columns.fault != 0).astype(np.uint8), ['', 'not decoded'])
    time = choose_clock(stamp_ns(columns, 'header.stamp'), columns.log_time, rows, [])
    at = track.time_ns
    if not stamped or time is columns.log_time:
        time, at = columns.log_time, log_time
    names = _TWIST if _TWIST[0] in columns.values else _TWIST_OF_TWO
    east, north, up = (columns[name].astype(float) for name in names)
    meant: list[tuple[Array, str]] = []
    if full_name(candidate.schema.name) == _ODOMETRY:
        turned = odometry_measurements(columns, rows, []).velocity_ned
        if turned is not None:
            meant.append((turned, ''))
    enu = frames.stack(frames.ned_from_enu((east, north, up)))
    flipped = frames.stack(frames.ned_from_enu((east, north, -up)))
    meant.append((enu, ', east, north, up' if meant else ''))
    meant.append((flipped, ', its vertical part counted downwards'))
    used = rows.used
    for velocity, remark in meant:
        there = interpolated(time[used], velocity[used], at)
        sound = np.isfinite(there).all(axis=1)
        if sound.sum() >= _LEAST and sound.mean() >= 0.5:
            yield there, remark
