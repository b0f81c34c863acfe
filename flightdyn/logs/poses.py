"""Poses without velocity: PoseStamped of a local frame, GeoPoseStamped on earth.

References
----------
.. [1] REP 103, *Standard Units of Measure and Coordinate Conventions*
"""

import numpy as np
from numpy.typing import NDArray

from .. import frames
from .mcap_columns import Columns
from .measurements import Array, Measured, drop_no_positions, stamp_ns
from .timeline import Rows

_STAMP = ('header.stamp.sec', 'header.stamp.nanosec')


def _orientation(prefix: str) -> tuple[str, ...]:
    return tuple(f'{prefix}orientation.{part}' for part in 'wxyz')


def _fields(prefix: str, position: tuple[str, ...]) -> tuple[str, ...]:
    places = tuple(f'{prefix}position.{name}' for name in position)
    return (*_STAMP, 'header.frame_id', *places, *_orientation(prefix))


POSE_FIELDS = (_fields('pose.', tuple('xyz')), _fields('pose.pose.', tuple('xyz')))
GEO_POSE_FIELDS = tuple(
    _fields(prefix, ('latitude', 'longitude', 'altitude')) for prefix in ('pose.', 'pose.pose.')
)


def pose_measurements(columns: Columns, rows: Rows, warnings: list[str]) -> Measured:
    """Read PoseStamped: ENU of FLU, or NED of FRD where the frame's name ends in `_ned`."""
    prefix = _prefix(columns)
    names = columns['header.frame_id']
    known = list(dict.fromkeys(names[rows.used].tolist()))
    if len(known) > 1:
        warnings.append(f'the frames change during the log: {sorted(known)}; the first is used')
        rows.drop(names != known[0], 'another frame')
    position = _vector(columns, [f'{prefix}position.{axis}' for axis in 'xyz'])
    rows.drop(np.asarray(~np.isfinite(position).all(axis=1)), 'position not finite')
    in_ned = bool(known) and known[0].endswith('_ned')
    if not in_ned:
        x, y, z = position.T
        position = frames.stack(frames.ned_from_enu((x, y, z)))
    return Measured(
        stamp=stamp_ns(columns, 'header.stamp'),
        position_ned=position,
        attitude=attitude_of(columns, prefix, in_ned=in_ned),
    )


def geo_pose_measurements(columns: Columns, rows: Rows, warnings: list[str]) -> Measured:
    """Read GeoPoseStamped: degrees, metres above the ellipsoid, ENU of FLU."""
    prefix = _prefix(columns)
    lat, lon, altitude = (
        columns[f'{prefix}position.{name}'] for name in ('latitude', 'longitude', 'altitude')
    )
    drop_no_positions(rows, lat, lon, altitude)
    return Measured(
        stamp=stamp_ns(columns, 'header.stamp'),
        lat=lat,
        lon=lon,
        altitude=altitude,
        attitude=attitude_of(columns, prefix),
    )


def attitude_of(columns: Columns, prefix: str, *, in_ned: bool = False) -> Array | None:
    """Return q_eb (n, 4) of orientations ENU of FLU (or NED of FRD), NaN where there is none.

    None if there is none at all.
    """
    return sound_attitude(_vector(columns, _orientation(prefix)), in_ned=in_ned)


def sound_attitude(quaternion: Array, *, in_ned: bool) -> Array | None:
    """Return q_eb (n, 4) of quaternions (n, 4) w, x, y, z; as `attitude_of`."""
    attitude = quaternion
    if not in_ned:
        w, x, y, z = quaternion.T
        attitude = np.stack(frames.ned_attitude_from_ros((w, x, y, z)), axis=1)
    with np.errstate(over='ignore', invalid='ignore', divide='ignore'):
        norm = np.linalg.norm(attitude, axis=1, keepdims=True)
        attitude = np.where(np.abs(norm - 1) < 0.01, attitude / norm, np.nan)
    return attitude if np.isfinite(attitude).any() else None


def _prefix(columns: Columns) -> str:
    return 'pose.pose.' if any(n.startswith('pose.pose.') for n in columns.values) else 'pose.'


def _vector(columns: Columns, names: list[str] | tuple[str, ...]) -> NDArray[np.float64]:
    return np.stack([columns[name] for name in names], axis=-1).astype(float)
