"""What a converted recording keeps of its log that its messages cannot say."""

import json
from dataclasses import replace

import numpy as np

from .track import Datum, Track

FIX_TOPIC, ODOMETRY_TOPIC = '/fix', '/odom'

_MAX_BREAKS = 10_000
_DATUMS: dict[str, Datum] = {
    name: name for name in ('ellipsoid', 'msl', 'baro', 'local', 'unknown')
}


def provenance(track: Track, format_name: str) -> dict[str, str]:
    """Return entries of the recording's metadata record: where a track came from.

    `altitude_datum` is that of the fixes, which the message itself defines as the ellipsoid;
    `segment_starts` are the times [ns] at which the log began anew.
    """
    geodetic = [FIX_TOPIC] if track.velocity_ned is None else [FIX_TOPIC, ODOMETRY_TOPIC]
    breaks = track.time_ns[np.flatnonzero(np.diff(track.segment)) + 1]
    return {
        'converted_from': track.file,
        'converted_format': format_name,
        'converted_source': track.source,
        'converted_schema': track.schema,
        'converted_dropped': json.dumps(track.dropped),
        'converted_to': ' '.join([ODOMETRY_TOPIC] if track.lat is None else geodetic),
        'altitude_datum': track.altitude_datum,
        'segment_starts': ' '.join(str(ns) for ns in breaks[:_MAX_BREAKS].tolist()),
    }


def converted_topics(own: dict[str, str]) -> list[str]:
    """Return the topics that together are the track that was converted, none if that is unknown.

    Fixes hold geodetic positions as they were, to the last digit; Odometry the motion.
    """
    topics = own.get('converted_to', '').split()
    return topics if topics and set(topics) <= {FIX_TOPIC, ODOMETRY_TOPIC} else []


def with_motion(place: Track, motion: Track | None = None) -> Track:
    """Return a track with velocity and attitude of another of the same samples."""
    if motion is None or not np.array_equal(place.time_ns, motion.time_ns):
        return place
    return replace(
        place,
        velocity_ned=motion.velocity_ned,
        velocity_std=motion.velocity_std,
        attitude=motion.attitude,
        warnings=[*place.warnings, *(w for w in motion.warnings if w not in place.warnings)],
    )


def with_provenance(track: Track, own: dict[str, str]) -> Track:
    """Return the track of a converted recording with datum and segments of the log behind it."""
    datum = _DATUMS.get(own.get('altitude_datum', ''))
    if 'converted_from' not in own or datum is None:
        return track
    warnings = [*track.warnings, f'converted from {own["converted_from"]}']
    marks = [int(mark) for mark in own.get('segment_starts', '').split() if mark.isdecimal()]
    starts = np.isin(track.time_ns, marks)
    starts[1:] |= np.diff(track.segment) != 0
    starts[0] = False
    return replace(
        track,
        altitude_datum=datum,
        segment=np.cumsum(starts).astype(np.int64),
        warnings=warnings,
    )
