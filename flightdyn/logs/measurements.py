"""From decoded messages to measured position, velocity and attitude in flightdyn's own axes."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import frames
from ..environment.geodesy import GeodeticPoint
from .mcap_columns import Columns
from .timeline import Rows
from .track import Datum, Track

Array = NDArray[np.float64]

_STAMP = ('header.stamp.sec', 'header.stamp.nanosec')
FIX_FIELDS = (
    *_STAMP,
    'status.status',
    'latitude',
    'longitude',
    'altitude',
    'position_covariance',
    'position_covariance_type',
)
LOCATION_FIX_FIELDS = (
    'timestamp.sec',
    'timestamp.nanosec',
    'latitude',
    'longitude',
    'altitude',
    'position_covariance',
    'position_covariance_type',
)
_POSE, _TWIST = 'pose.pose.', 'twist.twist.linear.'
ODOMETRY_FIELDS = (
    *_STAMP,
    'header.frame_id',
    'child_frame_id',
    *(f'{_POSE}position.{axis}' for axis in 'xyz'),
    *(f'{_POSE}orientation.{axis}' for axis in 'wxyz'),
    'pose.covariance',
    *(_TWIST + axis for axis in 'xyz'),
    'twist.covariance',
)
VEHICLE_STATE_FIELDS = (*_STAMP, 'x_e', 'y_e', 'z_e', 'u_e', 'v_e', 'w_e', 'q_eb')

_WORLD_FRAMES = ('map', 'odom', 'world', 'earth', 'map_ned', 'odom_ned')
_NO_COLUMNS = ('stamp', 'datum', 'origin', 'epoch')
_CHECK_WINDOW_S = 2.0
_VERTICAL_SPEED = 0.5  # m/s; less may be the noise of altitudes

WGS84_A = 6378137.0  # m, NIMA TR8350.2, 2000
WGS84_E2 = 6.69437999014e-3  # first eccentricity squared, as above


@dataclass(frozen=True, kw_only=True)
class Measured:
    """Columns of a source, one row per message; names and units as in `Track`.

    Parameters
    ----------
    stamp : int array (n,)
        Time in the message [ns], below zero where it makes no sense.
    datum : str, optional
        What altitudes, or those of the origin, are above; omitted: the ellipsoid.
    origin : GeodeticPoint, optional
        Origin of local positions, if the messages say it.
    epoch : int array (n,), optional
        Where this changes, the position was set anew: nothing is smoothed across that.
    """

    stamp: NDArray[np.int64]
    lat: Array | None = None
    lon: Array | None = None
    altitude: Array | None = None
    position_ned: Array | None = None
    velocity_ned: Array | None = None
    attitude: Array | None = None
    airspeed: Array | None = None
    position_std: Array | None = None
    velocity_std: Array | None = None
    datum: Datum = 'ellipsoid'
    origin: GeodeticPoint | None = None
    epoch: NDArray[np.int64] | None = None

    def columns(self) -> dict[str, Any]:
        """Return the columns that a track takes."""
        return {
            f.name: getattr(self, f.name)
            for f in fields(self)
            if f.name not in _NO_COLUMNS and getattr(self, f.name) is not None
        }


def with_checked_velocity(track: Track) -> Track:
    """Return the track without its velocity if its positions contradict that.

    A velocity is in whatever axes its publisher thought right; mavros, for one, gives velocities
    over the ground, with z down, in what should be body axes; others leave it zero.
    """
    if track.velocity_ned is None:
        return track
    wrong = contradiction(track, track.velocity_ned)
    if not wrong:
        return track
    warning = f'the velocity in {track.source} {wrong} and is not used'
    return replace(
        track, velocity_ned=None, velocity_std=None, warnings=[*track.warnings, warning]
    )


def stamp_ns(columns: Columns, prefix: str) -> NDArray[np.int64]:
    """Return the stamps [ns]; -1 where seconds or nanoseconds are out of range."""
    sec = columns[f'{prefix}.sec'].astype(np.int64)
    nanosec = columns[f'{prefix}.nanosec'].astype(np.int64)
    return np.where((sec >= 0) & (nanosec < 10**9), sec * 10**9 + nanosec, -1)


def fix_measurements(columns: Columns, rows: Rows, warnings: list[str]) -> Measured:
    """Read NavSatFix or LocationFix; positions that are none are dropped."""
    lat, lon, altitude = (columns[name] for name in ('latitude', 'longitude', 'altitude'))
    if 'status.status' in columns.values:
        rows.drop(columns['status.status'] < 0, 'no fix')
    drop_no_positions(rows, lat, lon, altitude)
    covariance = columns['position_covariance'].reshape(-1, 3, 3)
    std = _std(_swap_covariance(covariance, frames.ned_from_enu))
    std[columns['position_covariance_type'] == 0] = np.nan
    prefix = 'header.stamp' if 'header.stamp.sec' in columns.values else 'timestamp'
    velocity = None
    if 'velocity_x' in columns.values:
        enu = _vector(columns, [f'velocity_{axis}' for axis in 'xyz'])
        velocity = _apply(frames.ned_from_enu, enu)
        velocity[~np.isfinite(velocity).all(axis=1)] = np.nan
    return Measured(
        stamp=stamp_ns(columns, prefix),
        lat=lat,
        lon=lon,
        altitude=altitude,
        velocity_ned=velocity if velocity is not None and np.isfinite(velocity).any() else None,
        position_std=std if np.isfinite(std).any() else None,
    )


def odometry_measurements(columns: Columns, rows: Rows, warnings: list[str]) -> Measured:
    """Read Odometry: pose ENU of FLU (NED of FRD if the frame says so), twist in the child."""
    names = set(columns['header.frame_id'][columns.fault == 0])
    children = set(columns['child_frame_id'][columns.fault == 0])
    if len(names) > 1 or len(children) > 1:
        warnings.append(
            f'the frames change during the log: {sorted(names)}, {sorted(children)}; '
            'the first pair is used'
        )
    frame, child = _first(columns, 'header.frame_id'), _first(columns, 'child_frame_id')
    rows.drop(
        (columns['header.frame_id'] != frame) | (columns['child_frame_id'] != child),
        'another frame',
    )
    position = _vector(columns, [f'{_POSE}position.{axis}' for axis in 'xyz'])
    quaternion = _vector(columns, [f'{_POSE}orientation.{axis}' for axis in 'wxyz'])
    twist = _vector(columns, [_TWIST + axis for axis in 'xyz'])
    _drop_not_finite(rows, position)

    in_ned = frame.endswith('_ned')
    if in_ned:
        position_ned, attitude = position, quaternion
        world = twist
    else:
        position_ned = _apply(frames.ned_from_enu, position)
        attitude = np.stack(frames.ned_attitude_from_ros(_parts4(quaternion)), axis=1)
        world = _apply(frames.ned_from_enu, twist)
    norm = np.linalg.norm(attitude, axis=1)
    with np.errstate(invalid='ignore', divide='ignore'):
        attitude = np.where(np.abs(norm - 1)[:, None] < 0.01, attitude / norm[:, None], np.nan)
    # Columns of r: the child's axes in NED. FLU is FRD with two axes turned round.
    r = _matrix(frames.rotation_from_quaternion(_parts4(attitude)))
    if not (in_ned or child.endswith('_frd')):
        r = r @ _matrix(tuple(zip(*(frames.frd_from_flu(u) for u in _UNIT), strict=True)))
    body = np.einsum('nij,nj->ni', r, twist)
    twist_covariance = columns['twist.covariance'].reshape(-1, 6, 6)[:, :3, :3]
    pose_covariance = columns['pose.covariance'].reshape(-1, 6, 6)[:, :3, :3]
    swap = (lambda v: v) if in_ned else frames.ned_from_enu
    if child in _WORLD_FRAMES or child == frame:
        velocity, velocity_std = world, _std(_swap_covariance(twist_covariance, swap))
    else:
        velocity = body
        velocity_std = _std(r @ twist_covariance @ r.transpose(0, 2, 1))
    position_std = _std(_swap_covariance(pose_covariance, swap))
    return Measured(
        stamp=stamp_ns(columns, 'header.stamp'),
        position_ned=position_ned,
        velocity_ned=velocity if np.isfinite(velocity).any() else None,
        attitude=attitude if np.isfinite(attitude).any() else None,
        position_std=position_std if np.isfinite(position_std).any() else None,
        velocity_std=velocity_std if np.isfinite(velocity_std).any() else None,
    )


def vehicle_state_measurements(columns: Columns, rows: Rows, warnings: list[str]) -> Measured:
    """Read flightdyn's own VehicleState: already NED and FRD."""
    position = _vector(columns, ['x_e', 'y_e', 'z_e'])
    velocity = _vector(columns, ['u_e', 'v_e', 'w_e'])
    _drop_not_finite(rows, position)
    attitude = columns['q_eb'].astype(float)
    return Measured(
        stamp=stamp_ns(columns, 'header.stamp'),
        position_ned=position,
        velocity_ned=velocity if np.isfinite(velocity).any() else None,
        attitude=attitude if np.isfinite(attitude).any() else None,
    )


def drop_no_positions(rows: Rows, lat: Array, lon: Array, altitude: Array) -> None:
    """Drop rows whose latitude, longitude [deg] and altitude [m] are no position."""
    rows.drop(~(np.isfinite(lat) & np.isfinite(lon)), 'position not finite')
    with np.errstate(invalid='ignore'):
        rows.drop((np.abs(lat) > 90) | (np.abs(lon) > 180), 'position out of range')
    rows.drop((lat == 0) & (lon == 0), 'position 0 N 0 E')
    rows.drop(~np.isfinite(altitude), 'no altitude')


def stds_ned(horizontal: Array, vertical: Array) -> Array | None:
    """Return 1-sigma (n, 3) of horizontal and vertical ones (n,), NaN where not above zero.

    None if no row has one.
    """
    std = np.stack((horizontal, horizontal, vertical), axis=-1).astype(float)
    with np.errstate(invalid='ignore'):
        told = (np.isfinite(std) & (std > 0)).all(axis=-1, keepdims=True)
    std = np.where(told, std, np.nan)
    return std if told.any() else None


def altitude_of(ellipsoid: Array | None, msl: Array | None, rows: Rows) -> tuple[Array, Datum]:
    """Return the altitude above the ellipsoid, or above sea level if that was not filled.

    Receivers that do not know the one leave it zero or not a number throughout.
    """
    choices: tuple[tuple[Array | None, Datum], ...] = ((ellipsoid, 'ellipsoid'), (msl, 'msl'))
    for altitude, datum in choices:
        if altitude is not None:
            used = altitude[rows.used]
            if (np.isfinite(used) & (used != 0)).any():
                return altitude, datum
    given = msl if ellipsoid is None else ellipsoid
    assert given is not None
    return given, 'unknown'


_UNIT: tuple[frames.Vector, ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def _drop_not_finite(rows: Rows, position: Array) -> None:
    rows.drop(np.asarray(~np.isfinite(position).all(axis=1)), 'position not finite')


def _vector(columns: Columns, names: Sequence[str]) -> Array:
    return np.stack([columns[name] for name in names], axis=-1).astype(float)


def _parts4(q: Array) -> frames.Quaternion:
    return q[:, 0], q[:, 1], q[:, 2], q[:, 3]


def _apply(swap: Any, v: Array) -> Array:
    stacked: Array = frames.stack(swap((v[..., 0], v[..., 1], v[..., 2])))
    return stacked


def _matrix(rotation: Any) -> Array:
    """Return a rotation of floats or of arrays (n,) as an array (3, 3) or (n, 3, 3)."""
    matrix: Array = np.stack([frames.stack(row) for row in rotation], axis=-2)
    return matrix


def _swap_covariance(covariance: Array, swap: Any) -> Array:
    """Return covariances with both indices in swapped axes."""
    once = _apply(swap, covariance).swapaxes(-1, -2)
    return _apply(swap, once)


def _std(covariance: Array) -> Array:
    """Return 1-sigma of each axis (n, 3); a row of NaN where it is not told."""
    variance = np.diagonal(covariance, axis1=-2, axis2=-1)
    told = (np.isfinite(variance) & (variance > 0)).all(axis=-1, keepdims=True)
    return np.sqrt(np.where(told, variance, np.nan))


def _first(columns: Columns, name: str) -> str:
    sound = columns[name][columns.fault == 0]
    return str(sound[0]) if sound.size else ''


def contradiction(track: Track, velocity: Array) -> str:
    """Return in what a velocity (n, 3) NED contradicts the positions, empty if in nothing.

    Displacements over about two seconds are compared with the integral of the velocity: all of
    it, and whether the vertical part is missing or has the wrong sign, which the speed of an
    aircraft would hide.
    """
    with np.errstate(over='ignore', invalid='ignore'):  # a damaged log may hold any number
        moved, meant = _displacements(track, velocity)
        return _contradiction(moved, meant)


def _contradiction(moved: Array, meant: Array) -> str:
    if moved.size == 0:
        return ''
    error = float(np.percentile(np.linalg.norm(moved - meant, axis=1), 75))
    speed = float(np.median(np.linalg.norm(moved, axis=1)))
    if error > max(1.0, 0.25 * speed):
        return f'contradicts its positions by {error:.1f} m/s'
    up, up_meant = moved[:, 2], meant[:, 2]
    if np.percentile(np.abs(up), 90) < _VERTICAL_SPEED:
        return ''
    if not up_meant.any():
        return 'has no vertical part'
    scale = np.sqrt(np.mean(up**2) * np.mean(up_meant**2))
    if np.mean(up * up_meant) < -0.5 * scale:
        return 'has a vertical part of the wrong sign'
    return ''


def _displacements(track: Track, velocity: Array) -> tuple[Array, Array]:
    """Return mean velocities (m, 3) over two seconds, out of positions and out of velocities."""
    sound = np.isfinite(velocity).all(axis=1)
    t = (track.time_ns - track.time_ns[0])[sound] * 1e-9
    position, velocity = _metres(track)[sound], velocity[sound]
    if t.size < 10:
        return np.empty((0, 3)), np.empty((0, 3))
    step = np.diff(t)[:, None]
    way = np.concatenate(
        (np.zeros((1, 3)), np.cumsum(0.5 * step * (velocity[1:] + velocity[:-1]), axis=0))
    )
    first, last = _windows(t, track.segment[sound])
    time = (t[last] - t[first])[:, None]
    return (position[last] - position[first]) / time, (way[last] - way[first]) / time


def displacements(track: Track) -> tuple[NDArray[np.intp], Array]:
    """Return samples (m,) and the mean velocities (m, 3) NED in the two seconds about each."""
    t = (track.time_ns - track.time_ns[0]) * 1e-9
    if t.size < 10:
        return np.empty(0, np.intp), np.empty((0, 3))
    position = _metres(track)
    first, last = _windows(t, track.segment)
    moved = (position[last] - position[first]) / (t[last] - t[first])[:, None]
    return (first + last) // 2, moved


def _windows(t: Array, segment: NDArray[np.int64]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the ends of windows of about two seconds in one segment."""
    usual = float(np.median(np.diff(t)))
    stride = int(np.clip(round(_CHECK_WINDOW_S / max(usual, 1e-9)), 1, t.size // 2))
    first = np.arange(t.size - stride)
    last = first + stride
    whole = (segment[last] == segment[first]) & (t[last] > t[first])
    return first[whole], last[whole]


def _metres(track: Track) -> Array:
    """Return positions north, east, down (n, 3) [m] whose differences nearby are displacements."""
    if track.position_ned is not None:
        return track.position_ned
    assert track.lat is not None and track.lon is not None
    lat, lon = np.radians(track.lat), np.unwrap(np.radians(track.lon))
    # Radii of curvature of the ellipsoid in the meridian and across it.
    flat = 1 - WGS84_E2 * np.sin(lat) ** 2
    across = WGS84_A / np.sqrt(flat)
    along = across * (1 - WGS84_E2) / flat
    north = np.cumsum(np.diff(lat, prepend=lat[:1]) * along)
    east = np.cumsum(np.diff(lon, prepend=lon[:1]) * across * np.cos(lat))
    height = np.zeros_like(lat) if track.altitude is None else track.altitude
    return np.stack((north, east, -height), axis=-1)
