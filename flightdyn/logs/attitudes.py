"""Attitude of a vehicle from a topic beside its positions: Imu, VehicleAttitude, poses.

An orientation can hardly be tested by positions: a multirotor flies in any direction. What is not
used is what never changes, as drivers without orientation leave it, and what points backwards in
fast flight, as a mistaken axis makes it.

References
----------
.. [1] REP 145, *Conventions for IMU Sensor Drivers*
.. [2] PX4 Autopilot, *msg/VehicleAttitude*
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .. import frames
from ..errors import LogError
from .companions import shared_name_spaces
from .decoders import decodable, decoded_columns
from .definitions import full_name
from .kinds import is_wanted
from .mavlink_topics import Sender, attitude_columns
from .mcap_columns import Columns
from .mcap_container import McapFile
from .measurements import ODOMETRY_FIELDS, Array, displacements, stamp_ns
from .nearby import interpolated
from .poses import GEO_POSE_FIELDS, POSE_FIELDS, attitude_of, sound_attitude
from .timeline import Rows, choose_clock, steady_time
from .track import Track

_STAMP = ('header.stamp.sec', 'header.stamp.nanosec')
_ORIENTATION = tuple(f'orientation.{part}' for part in 'wxyz')
# Fields, and what stands before `orientation`; PX4's own messages have none.
_FIELDS: dict[str, tuple[tuple[str, ...], str]] = {
    'sensor_msgs/msg/Imu': ((*_STAMP, *_ORIENTATION, 'orientation_covariance'), ''),
    'geometry_msgs/msg/PoseStamped': (POSE_FIELDS[0], 'pose.'),
    'geometry_msgs/msg/PoseWithCovarianceStamped': (POSE_FIELDS[1], 'pose.pose.'),
    'geographic_msgs/msg/GeoPoseStamped': (GEO_POSE_FIELDS[0], 'pose.'),
    'nav_msgs/msg/Odometry': (ODOMETRY_FIELDS, 'pose.pose.'),
    'px4_msgs/msg/VehicleAttitude': (('q',), ''),
    'ulog.vehicle_attitude': (('q',), ''),
}
_MOST_TRIED = 4
_FAST = 5.0  # m/s; slower, the wind and the pilot decide where the nose points
_LEAST = 10  # samples; fewer do not tell right from wrong


@dataclass(frozen=True)
class _Candidate:
    topic: str
    schema: str
    channels: tuple[int, ...]


def is_attitude(schema_name: str) -> bool:
    """Return whether messages are an attitude and no position."""
    return full_name(schema_name) in (
        'sensor_msgs/msg/Imu',
        'px4_msgs/msg/VehicleAttitude',
        'ulog.vehicle_attitude',
    )


def with_companion_attitude(
    log: McapFile, track: Track, log_time: NDArray[np.int64], *, stamped: bool
) -> Track:
    """Return a track with the attitude of the nearest topic that has one at its times.

    Parameters
    ----------
    log : McapFile
    track : Track
        Positions without attitude, read from `log`.
    log_time : int array (n,)
        When each of them was recorded [ns].
    stamped : bool
        Whether times of the track are those of headers, not of the recorder.

    Notes
    -----
    Tried in the order of `companions`. At least half of the samples must have an attitude at
    their time; the others get a row of NaN. What was taken, and what was not and why, is told in
    the track's warnings.
    """
    for candidate in list(_candidates(log, track.source))[:_MOST_TRIED]:
        try:
            attitude = _attitude_at(log, candidate, track, log_time, stamped=stamped)
        except LogError as error:
            note = f'{candidate.topic} is not used as attitude: {error}'
            track = replace(track, warnings=[*track.warnings, note])
            continue
        track = _with_attitude(track, attitude, candidate.topic)
        if track.attitude is not None:
            break
    return track


def with_mavlink_attitude(
    log: McapFile, track: Track, channel_ids: Sequence[int], sender: Sender, columns: Columns
) -> Track:
    """Return a track with the attitude that the MAVLink sender of its positions sends.

    Parameters
    ----------
    columns : Columns
        The positions, a row for each sample of the track. They are matched by the sender's own
        clock: messages may arrive late.

    Raises
    ------
    LogError
        If the file is damaged.
    """
    other = attitude_columns(log, channel_ids, sender)
    sound = other.fault == 0
    count = np.concatenate((columns['time_boot_ms'], other['time_boot_ms'][sound]))
    arrival = np.concatenate((columns.log_time, other.log_time[sound]))
    order = np.argsort(arrival, kind='stable')
    time = np.empty(arrival.size, np.int64)
    time[order] = steady_time(count.astype(np.int64)[order] * 10**6, arrival[order])
    angles = (other[name][sound].astype(float) for name in ('roll', 'pitch', 'yaw'))
    measured = np.stack(frames.quaternion_from_euler(*angles), axis=1)
    attitude = interpolated(time[len(track) :], measured, time[: len(track)], turning=True)
    return _with_attitude(track, attitude, f'system {sender.system} in ATTITUDE')


def with_attitude(track: Track, time: NDArray[np.int64], attitude: Array, name: str) -> Track:
    """Return a track with an attitude q_eb (m, 4) measured at times (m,) [ns] of its clock."""
    return _with_attitude(track, interpolated(time, attitude, track.time_ns, turning=True), name)


def _with_attitude(track: Track, attitude: Array, name: str) -> Track:
    """Return the track with an attitude (n, 4), or without it and a warning if it is none."""
    known = np.isfinite(attitude).all(axis=1)
    if known.sum() < _LEAST or known.mean() < 0.5 or np.ptp(attitude[known], axis=0).max() == 0:
        return track
    if _points_backwards(track, attitude):
        note = f'{name} is not used as attitude: it points backwards in flight'
        return replace(track, warnings=[*track.warnings, note])
    part = '' if known.all() else f', for {known.sum()} of {known.size} samples'
    note = f'attitude is that of {name}{part}'
    return replace(track, attitude=attitude, warnings=[*track.warnings, note])


def _candidates(log: McapFile, topic: str) -> Iterator[_Candidate]:
    grouped: dict[tuple[str, str, int], list[int]] = {}
    for channel in log.channels.values():
        schema = log.schemas.get(channel.schema_id)
        if schema is None or full_name(schema.name) not in _FIELDS or is_wanted(channel.topic):
            continue
        if decodable(schema, channel.message_encoding):
            key = (channel.topic, full_name(schema.name), schema.id)
            grouped.setdefault(key, []).append(channel.id)
    found = [_Candidate(name, schema, tuple(ids)) for (name, schema, _), ids in grouped.items()]

    def place(candidate: _Candidate) -> tuple[int, int, str]:
        messages = sum(log.message_counts[key] for key in candidate.channels)
        return (-shared_name_spaces(topic, candidate.topic), -messages, candidate.topic)

    return (each for each in sorted(found, key=place) if place(each)[0] < 0)


def _attitude_at(
    log: McapFile,
    candidate: _Candidate,
    track: Track,
    log_time: NDArray[np.int64],
    *,
    stamped: bool,
) -> Array:
    """Return q_eb (n, 4) at the times of the track, NaN where there is none."""
    fields, prefix = _FIELDS[candidate.schema]
    columns = decoded_columns(log, candidate.channels, fields)
    rows = Rows((columns.fault != 0).astype(np.uint8), ['', 'not decoded'])
    time, at = columns.log_time, log_time
    if prefix or candidate.schema.endswith('Imu'):
        clock = choose_clock(stamp_ns(columns, 'header.stamp'), columns.log_time, rows, [])
        if stamped and clock is not columns.log_time:
            time, at = clock, track.time_ns
        attitude = _of_header(columns, prefix)
    else:
        attitude = _of_px4(columns, rows)
    if attitude is None:
        return np.full((len(track), 4), np.nan)
    return interpolated(time[rows.used], attitude[rows.used], at, turning=True)


def _of_header(columns: Columns, prefix: str) -> Array | None:
    in_ned = False
    if 'header.frame_id' in columns.values:
        frame = next((str(name) for name in columns['header.frame_id'] if name is not None), '')
        in_ned = frame.endswith('_ned')
    attitude = attitude_of(columns, prefix, in_ned=in_ned)
    if attitude is not None and 'orientation_covariance' in columns.values:
        attitude[columns['orientation_covariance'][:, 0] == -1] = np.nan  # none, by definition
    return attitude


def _of_px4(columns: Columns, rows: Rows) -> Array | None:
    """Return q_eb: w, x, y, z of FRD in NED already."""
    parts = columns['q']
    if parts.ndim == 2:
        return sound_attitude(parts.astype(float), in_ned=True)
    quaternion = np.full((len(columns), 4), np.nan)  # ulog2mcap has lists of any length
    for row in rows.used:
        if parts[row] is not None and len(parts[row]) == 4:
            quaternion[row] = parts[row]
    return sound_attitude(quaternion, in_ned=True)


def _points_backwards(track: Track, attitude: Array) -> bool:
    """Return whether the nose of an attitude (n, 4) is behind in fast flight."""
    middle, moved = displacements(track)
    w, x, y, z = attitude[middle].T
    ahead = frames.rotate(frames.rotation_from_quaternion((w, x, y, z)), (1.0, 0.0, 0.0))
    level = np.hypot(ahead[0], ahead[1])
    speed = np.hypot(moved[:, 0], moved[:, 1])
    with np.errstate(invalid='ignore', divide='ignore'):
        cosine = (ahead[0] * moved[:, 0] + ahead[1] * moved[:, 1]) / (level * speed)
        telling = (speed > _FAST) & (level > 0.5) & np.isfinite(cosine)
    return bool(telling.sum() >= _LEAST and np.median(cosine[telling]) < 0)
