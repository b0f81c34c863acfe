"""PX4's position topics: px4_msgs over DDS, and uORB names as ulog2mcap writes them.

Both have the fields of PX4's own message definitions. Those changed units more than once (the
receiver's position from 1e-7 degrees to degrees), never without new field names.

References
----------
.. [1] PX4 Autopilot, *msg/*: SensorGps, VehicleGlobalPosition, VehicleLocalPosition
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..environment.geodesy import GeodeticPoint, ned_from_geodetic
from .mcap_columns import Columns
from .measurements import Array, Measured, altitude_of, drop_no_positions, stds_ned
from .timeline import Rows

GPS_FIELDS = (
    (
        *('latitude_deg', 'longitude_deg', 'altitude_msl_m', 'altitude_ellipsoid_m'),
        *('fix_type', 'vel_n_m_s', 'vel_e_m_s', 'vel_d_m_s'),
    ),
    (
        *('lat', 'lon', 'alt', 'alt_ellipsoid'),
        *('fix_type', 'vel_n_m_s', 'vel_e_m_s', 'vel_d_m_s'),
    ),
)
GPS_OPTIONAL = ('timestamp', 'time_utc_usec', 'vel_ned_valid', 'eph', 'epv', 's_variance_m_s')
GLOBAL_FIELDS = (('lat', 'lon', 'alt'),)
GLOBAL_OPTIONAL = (
    *('timestamp', 'alt_ellipsoid', 'lat_lon_valid', 'alt_valid', 'vel_n', 'vel_e', 'vel_d'),
    *('eph', 'epv', 'lat_lon_reset_counter', 'alt_reset_counter'),
)
LOCAL_FIELDS = (('x', 'y', 'z', 'vx', 'vy', 'vz', 'xy_valid', 'z_valid'),)
LOCAL_OPTIONAL = (
    *('timestamp', 'v_xy_valid', 'v_z_valid', 'eph', 'epv', 'evh', 'evv'),
    *('xy_global', 'z_global', 'ref_lat', 'ref_lon', 'ref_alt'),
    *('xy_reset_counter', 'z_reset_counter', 'vxy_reset_counter', 'vz_reset_counter'),
)

_FIX_3D = 3
_EPOCH_NS = 946_684_800 * 10**9  # 2000-01-01; an autopilot does not run for thirty years
_RESTART_NS = 10**9


def gps_measurements(columns: Columns, rows: Rows, warnings: list[str]) -> Measured:
    """Read SensorGps or VehicleGpsPosition, in degrees and metres or 1e-7 degrees and mm."""
    if 'latitude_deg' in columns.values:
        lat, lon = columns['latitude_deg'], columns['longitude_deg']
        ellipsoid, msl = columns['altitude_ellipsoid_m'], columns['altitude_msl_m']
    else:
        lat, lon = columns['lat'] / 1e7, columns['lon'] / 1e7
        ellipsoid, msl = columns['alt_ellipsoid'] / 1e3, columns['alt'] / 1e3
    rows.drop(columns['fix_type'] < _FIX_3D, 'no 3D fix')
    altitude, datum = altitude_of(ellipsoid, msl, rows)
    drop_no_positions(rows, lat, lon, altitude)
    velocity = _vector(columns, 'vel_n_m_s', 'vel_e_m_s', 'vel_d_m_s')
    if 'vel_ned_valid' in columns.values:
        velocity[~columns['vel_ned_valid'].astype(bool)] = np.nan
    return Measured(
        stamp=_stamp(columns, warnings),
        lat=lat,
        lon=lon,
        altitude=altitude,
        velocity_ned=_known(velocity),
        position_std=_stds(columns, 'eph', 'epv'),
        velocity_std=_stds(columns, 's_variance_m_s', 's_variance_m_s'),
        datum=datum,
    )


def global_measurements(columns: Columns, rows: Rows, warnings: list[str]) -> Measured:
    """Read VehicleGlobalPosition: the estimator's position, with velocity if it is old."""
    _drop_invalid(columns, rows, ('lat_lon_valid', 'alt_valid'))
    lat, lon = columns['lat'].astype(float), columns['lon'].astype(float)
    ellipsoid = columns.values.get('alt_ellipsoid')
    altitude, datum = altitude_of(
        None if ellipsoid is None else ellipsoid.astype(float), columns['alt'].astype(float), rows
    )
    drop_no_positions(rows, lat, lon, altitude)
    moving = all(name in columns.values for name in ('vel_n', 'vel_e', 'vel_d'))
    return Measured(
        stamp=_stamp(columns, warnings),
        lat=lat,
        lon=lon,
        altitude=altitude,
        velocity_ned=_known(_vector(columns, 'vel_n', 'vel_e', 'vel_d')) if moving else None,
        position_std=_stds(columns, 'eph', 'epv'),
        datum=datum,
        epoch=_epoch(columns, rows, warnings, ('lat_lon_reset_counter', 'alt_reset_counter')),
    )


def local_measurements(columns: Columns, rows: Rows, warnings: list[str]) -> Measured:
    """Read VehicleLocalPosition: NED metres from where the estimator put its origin."""
    _drop_invalid(columns, rows, ('xy_valid', 'z_valid'))
    position = _vector(columns, 'x', 'y', 'z')
    rows.drop(np.asarray(~np.isfinite(position).all(axis=1)), 'position not finite')
    velocity = _vector(columns, 'vx', 'vy', 'vz')
    for name in ('v_xy_valid', 'v_z_valid'):
        if name in columns.values:
            velocity[~columns[name].astype(bool)] = np.nan
    origin = _to_one_origin(columns, rows, position)
    if origin is None and rows.used.size:
        warnings.append(
            'no GPS: the local origin is not tied to the earth, positions are metres from it'
        )
    counters = tuple(name for name in LOCAL_OPTIONAL if name.endswith('reset_counter'))
    return Measured(
        stamp=_stamp(columns, warnings),
        position_ned=position,
        velocity_ned=_known(velocity),
        position_std=_stds(columns, 'eph', 'epv'),
        velocity_std=_stds(columns, 'evh', 'evv'),
        datum='local' if origin is None else 'msl',  # ref_alt is
        origin=origin,
        epoch=_epoch(columns, rows, warnings, counters),
    )


def _to_one_origin(columns: Columns, rows: Rows, position: Array) -> GeodeticPoint | None:
    """Return the first origin; positions from later ones are moved to it, in place.

    The estimator moves its origin by millimetres or, put to another place, by kilometres.
    """
    if not all(name in columns.values for name in ('ref_lat', 'ref_lon', 'ref_alt')):
        return None
    ref = _vector(columns, 'ref_lat', 'ref_lon', 'ref_alt')
    told = np.isfinite(ref).all(axis=1) & (np.abs(ref) <= (90, 180, 1e5)).all(axis=1)
    told &= (ref[:, :2] != 0).any(axis=1)
    for name in ('xy_global', 'z_global'):
        if name in columns.values:
            told &= columns[name].astype(bool)
    used = rows.used
    if told[used].mean() < 0.5 if used.size else True:
        return None
    rows.drop(~told, 'no origin yet')
    lat, lon, alt = (float(value) for value in ref[rows.used[0]])
    origin = GeodeticPoint(lat, lon, alt)
    different, which = np.unique(ref[rows.used], axis=0, return_inverse=True)
    lats, lons, alts = different.T
    shift = np.stack(ned_from_geodetic(lats, lons, alts, origin), axis=-1)
    position[rows.used] += shift[which.ravel()]
    return origin


def _drop_invalid(columns: Columns, rows: Rows, names: tuple[str, ...]) -> None:
    for name in names:
        if name in columns.values:
            rows.drop(~columns[name].astype(bool), 'position not valid')


def _epoch(
    columns: Columns, rows: Rows, warnings: list[str], names: tuple[str, ...]
) -> NDArray[np.int64] | None:
    """Return a number that grows wherever one of the reset counters changes."""
    counters = [columns[name] for name in names if name in columns.values]
    if not counters:
        return None
    used = rows.used
    changed = np.zeros(len(columns), bool)
    for counter in counters:
        # Seen on used rows only: a message that cannot be decoded has a counter of zero.
        changed[used[1:]] |= np.diff(counter[used].astype(np.int64)) != 0
    if changed.any():
        warnings.append(
            f'the estimator set its position or velocity anew {int(changed.sum())} times: '
            'each begins a new segment'
        )
    return np.cumsum(changed)


def _stamp(columns: Columns, warnings: list[str]) -> NDArray[np.int64]:
    """Return the time of each message, Unix if the log tells it in any way.

    `timestamp` counts from the autopilot's start unless it was synchronised, and ulog2mcap leaves
    it out: there log time counts from the start. The offset to Unix time is the median of the
    recorder's clock, or else of the receiver's, less that count: arrival has an unsteady delay,
    the autopilot's clock has none. A restart has an offset of its own.
    """
    count = columns.log_time
    if 'timestamp' in columns.values:
        count = columns['timestamp'].astype(np.int64) * 1000
    # Synchronisation may come in the middle of a log: what is Unix time already stays.
    sound = (columns.fault == 0) & (count > 0) & (count < _EPOCH_NS)
    if not sound.any():
        return count
    unix, whose = columns.log_time, "recorder's"
    known = sound & (unix > _EPOCH_NS)
    if not known.any() and 'time_utc_usec' in columns.values:
        unix, whose = columns['time_utc_usec'].astype(np.int64) * 1000, "receiver's"
        known = sound & (unix > _EPOCH_NS)
    if not known.any():
        warnings.append("times count from the autopilot's start: the log does not say the date")
        return count
    if whose == "receiver's":
        warnings.append("times count from the autopilot's start: the date is the receiver's")
    at = np.flatnonzero(known)
    restarts = np.cumsum(np.diff(count[at], prepend=count[at[0]]) < -_RESTART_NS)
    stamp = np.where(count < _EPOCH_NS, -1, count)
    # Rows between two known ones belong to the session of the one before.
    session = restarts[np.clip(np.searchsorted(at, np.arange(count.size), 'right') - 1, 0, None)]
    for number in range(int(restarts[-1]) + 1):
        offset = (unix - count)[at[restarts == number]]
        # Near 1e18 ns a float has steps of 128 ns.
        middle = int(offset[0]) + int(np.median(offset - offset[0]))
        these = sound & (session == number)
        stamp[these] = count[these] + middle
    return stamp


def _vector(columns: Columns, *names: str) -> Array:
    return np.stack([columns[name] for name in names], axis=-1).astype(float)


def _known(velocity: Array) -> Array | None:
    velocity[~np.isfinite(velocity).all(axis=1)] = np.nan
    return velocity if np.isfinite(velocity).any() else None


def _stds(columns: Columns, horizontal: str, vertical: str) -> Array | None:
    values: dict[str, Any] = columns.values
    if horizontal not in values or vertical not in values:
        return None
    return stds_ned(values[horizontal], values[vertical])
