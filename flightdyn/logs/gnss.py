"""Receivers' own messages with position and velocity in one: GPSFix, u-blox NAV-PVT, GPSRAW.

References
----------
.. [1] gps_umd, *gps_msgs/GPSFix*
.. [2] u-blox, *Interface description*, UBX-NAV-PVT
.. [3] MAVLink, *common*, GPS_RAW_INT
"""

import numpy as np
from numpy.typing import NDArray

from .mcap_columns import Columns
from .measurements import (
    Array,
    Measured,
    altitude_of,
    drop_no_positions,
    fix_measurements,
    stamp_ns,
    stds_ned,
)
from .timeline import Rows

_STAMP = ('header.stamp.sec', 'header.stamp.nanosec')
GPS_FIX_FIELDS = (
    (
        *(*_STAMP, 'status.status', 'latitude', 'longitude', 'altitude', 'track', 'speed'),
        *('climb', 'position_covariance', 'position_covariance_type'),
    ),
)
GPS_FIX_OPTIONAL = ('err_speed', 'err_climb')

# ublox_msgs in ROS 1 and 2, then ublox_ubx_msgs.
_PVT = ('lat', 'lon', 'height')
NAV_PVT_FIELDS = (
    (*_PVT, 'fix_type', 'flags', 'h_msl', 'vel_n', 'vel_e', 'vel_d'),
    (*_PVT, 'fixType', 'flags', 'hMSL', 'velN', 'velE', 'velD'),
    (*_PVT, 'gps_fix.fix_type', 'gnss_fix_ok', 'hmsl', 'vel_n', 'vel_e', 'vel_d'),
)
NAV_PVT_OPTIONAL = (
    *_STAMP,
    *('year', 'month', 'day', 'hour', 'min', 'sec', 'nano', 'valid', 'valid_date', 'valid_time'),
    *('h_acc', 'v_acc', 's_acc', 'hAcc', 'vAcc', 'sAcc', 'invalid_llh'),
)

GPS_RAW_FIELDS = ((*_STAMP, 'fix_type', 'lat', 'lon', 'alt'),)
GPS_RAW_OPTIONAL = ('alt_ellipsoid', 'h_acc', 'v_acc')

_FIX_3D = 3
_FIX_COMBINED = 4  # satellites and dead reckoning


def gps_fix_measurements(columns: Columns, rows: Rows, warnings: list[str]) -> Measured:
    """Read GPSFix; its errors are of 95 % confidence, about two sigma."""
    fix = fix_measurements(columns, rows, warnings)
    speed, track = columns['speed'], np.radians(columns['track'])
    velocity = np.stack((speed * np.cos(track), speed * np.sin(track), -columns['climb']), axis=-1)
    velocity[~np.isfinite(velocity).all(axis=1)] = np.nan
    std = None
    if all(name in columns.values for name in GPS_FIX_OPTIONAL):
        std = stds_ned(columns['err_speed'] / 2, columns['err_climb'] / 2)
    if rows.used.size:
        warnings.append('GPSFix does not say what its altitude is above')
    return Measured(
        stamp=fix.stamp,
        lat=fix.lat,
        lon=fix.lon,
        altitude=fix.altitude,
        velocity_ned=velocity if np.isfinite(velocity).any() else None,
        position_std=fix.position_std,
        velocity_std=std,
        datum='unknown',
    )


def nav_pvt_measurements(columns: Columns, rows: Rows, warnings: list[str]) -> Measured:
    """Read NavPVT or UBXNavPVT: 1e-7 degrees, millimetres, millimetres per second."""
    values = columns.values

    def one_of(*names: str) -> NDArray[np.generic] | None:
        return next((values[name] for name in names if name in values), None)

    fix_type = one_of('fix_type', 'fixType', 'gps_fix.fix_type')
    assert fix_type is not None
    fixed = (fix_type == _FIX_3D) | (fix_type == _FIX_COMBINED)
    sound = values['gnss_fix_ok'] if 'gnss_fix_ok' in values else values['flags'] & 1
    rows.drop(~(fixed & sound.astype(bool)), 'no 3D fix')
    if 'invalid_llh' in values:
        rows.drop(values['invalid_llh'].astype(bool), 'position not valid')
    lat, lon = values['lat'] / 1e7, values['lon'] / 1e7
    msl = one_of('h_msl', 'hMSL', 'hmsl')
    assert msl is not None
    altitude, datum = altitude_of(values['height'] / 1e3, msl.astype(float) / 1e3, rows)
    drop_no_positions(rows, lat, lon, altitude)
    h, v, s = (one_of(f'{key}_acc', f'{key}Acc') for key in 'hvs')
    names = ('vel_n', 'vel_e', 'vel_d') if 'vel_n' in values else ('velN', 'velE', 'velD')
    return Measured(
        stamp=_nav_pvt_stamp(columns),
        lat=lat,
        lon=lon,
        altitude=altitude,
        velocity_ned=np.stack([values[name] for name in names], axis=-1) / 1e3,
        position_std=None if h is None or v is None else _millimetres(h, v),
        velocity_std=None if s is None else _millimetres(s, s),
        datum=datum,
    )


def gps_raw_measurements(columns: Columns, rows: Rows, warnings: list[str]) -> Measured:
    """Read GPSRAW: its velocity has no vertical part and is not taken."""
    rows.drop(columns['fix_type'] < _FIX_3D, 'no 3D fix')
    lat, lon = columns['lat'] / 1e7, columns['lon'] / 1e7
    values = columns.values
    ellipsoid = values['alt_ellipsoid'] / 1e3 if 'alt_ellipsoid' in values else None
    altitude, datum = altitude_of(ellipsoid, values['alt'] / 1e3, rows)
    drop_no_positions(rows, lat, lon, altitude)
    known = 'h_acc' in values and 'v_acc' in values
    return Measured(
        stamp=stamp_ns(columns, 'header.stamp'),
        lat=lat,
        lon=lon,
        altitude=altitude,
        position_std=_millimetres(values['h_acc'], values['v_acc']) if known else None,
        datum=datum,
    )


def _millimetres(horizontal: NDArray[np.generic], vertical: NDArray[np.generic]) -> Array | None:
    return stds_ned(horizontal.astype(float) / 1e3, vertical.astype(float) / 1e3)


def _nav_pvt_stamp(columns: Columns) -> NDArray[np.int64]:
    """Return the header's time if there is a header, else the UTC of the message."""
    values = columns.values
    if 'header.stamp.sec' in values:
        return stamp_ns(columns, 'header.stamp')
    parts = ('year', 'month', 'day', 'hour', 'min', 'sec', 'nano')
    if not all(name in values for name in parts):
        return np.full(len(columns), -1, np.int64)
    year, month, day, hour, minute, second, nano = (values[n].astype(np.int64) for n in parts)
    told = (year >= 1980) & (month >= 1) & (month <= 12) & (day >= 1) & (day <= 31)
    if 'valid' in values:
        told &= (values['valid'] & 3) == 3  # date and time
    months = np.where(told, (year - 1970) * 12 + month - 1, 0).astype('datetime64[M]')
    days = months.astype('datetime64[D]').astype(np.int64) + day - 1
    seconds = ((days * 24 + hour) * 60 + minute) * 60 + second
    return np.where(told, seconds * 10**9 + nano, -1)
