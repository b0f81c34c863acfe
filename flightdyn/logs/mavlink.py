"""MAVLink's messages of position: how they lie on the wire, their checksum, what they measure.

References
----------
.. [1] MAVLink developer guide, https://mavlink.io/en/guide/serialization.html
.. [2] MAVLink, *common* message set, GPS_RAW_INT, GPS2_RAW, GLOBAL_POSITION_INT,
   LOCAL_POSITION_NED
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .mcap_columns import Columns
from .measurements import Array, Measured, altitude_of, drop_no_positions, stds_ned
from .timeline import Rows, steady_time

FIX_TYPES = {
    'GPS_FIX_TYPE_NO_GPS': 0,
    'GPS_FIX_TYPE_NO_FIX': 1,
    'GPS_FIX_TYPE_2D_FIX': 2,
    'GPS_FIX_TYPE_3D_FIX': 3,
    'GPS_FIX_TYPE_DGPS': 4,
    'GPS_FIX_TYPE_RTK_FLOAT': 5,
    'GPS_FIX_TYPE_RTK_FIXED': 6,
    'GPS_FIX_TYPE_STATIC': 7,
    'GPS_FIX_TYPE_PPP': 8,
}

_FIX_3D = 3
_AUTOPILOT = 1  # MAV_COMP_ID_AUTOPILOT1
_GROUND = 250  # ground stations have ids from 255 downwards
_EPOCH_NS = 946_684_800 * 10**9  # 2000-01-01


@dataclass(frozen=True)
class Message:
    """A message with its payload in the order of the wire.

    Parameters
    ----------
    number : int
    seed : int
        CRC_EXTRA.
    kind : str
        One of `kinds.ORDER`; empty if it is no position.
    layout : dtype
    least : int
        How many of its fields every version of the message has.
    """

    number: int
    name: str
    seed: int
    kind: str
    layout: np.dtype[np.void]
    least: int
    measure: Callable[[Columns, Rows, list[str]], Measured] | None = None

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the fields."""
        return self.layout.names or ()


def checksum(data: bytes) -> int:
    """Return the CRC-16/MCRF4XX of MAVLink."""
    crc = 0xFFFF
    for byte in data:
        crc = crc >> 8 ^ _CRC[(crc ^ byte) & 0xFF]
    return crc


def _crc_table() -> tuple[int, ...]:
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = byte >> 1 ^ (0x8408 if byte & 1 else 0)
        table.append(byte)
    return tuple(table)


_CRC = _crc_table()


def standing(system: int, component: int) -> int:
    """Return the place of a sender among others: autopilots, others, ground stations."""
    if system >= _GROUND:
        return 2
    return 0 if component == _AUTOPILOT else 1


def raw_measurements(columns: Columns, rows: Rows, warnings: list[str]) -> Measured:
    """Read GPS_RAW_INT or GPS2_RAW: its velocity has no vertical part and is not taken."""
    values = columns.values
    rows.drop(values['fix_type'] < _FIX_3D, 'no 3D fix')
    lat, lon = values['lat'] / 1e7, values['lon'] / 1e7
    altitude, datum = altitude_of(values['alt_ellipsoid'] / 1e3, values['alt'] / 1e3, rows)
    drop_no_positions(rows, lat, lon, altitude)
    accuracy = [values[name].astype(float) / 1e3 for name in ('h_acc', 'v_acc')]
    return Measured(
        stamp=_stamp(columns, 'time_usec', 1000),
        lat=lat,
        lon=lon,
        altitude=altitude,
        position_std=stds_ned(*accuracy),
        datum=datum,
    )


def global_measurements(columns: Columns, rows: Rows, warnings: list[str]) -> Measured:
    """Read GLOBAL_POSITION_INT: the estimator's position above sea level, and its velocity."""
    lat, lon = columns['lat'] / 1e7, columns['lon'] / 1e7
    altitude = columns['alt'] / 1e3
    drop_no_positions(rows, lat, lon, altitude)
    return Measured(
        stamp=_stamp(columns, 'time_boot_ms', 10**6),
        lat=lat,
        lon=lon,
        altitude=altitude,
        velocity_ned=_vector(columns, 'vx', 'vy', 'vz') / 100,
        datum='msl',
    )


def local_measurements(columns: Columns, rows: Rows, warnings: list[str]) -> Measured:
    """Read LOCAL_POSITION_NED: metres from where the estimator put its origin."""
    position = _vector(columns, 'x', 'y', 'z')
    rows.drop(np.asarray(~np.isfinite(position).all(axis=1)), 'position not finite')
    return Measured(
        stamp=_stamp(columns, 'time_boot_ms', 10**6),
        position_ned=position,
        velocity_ned=_vector(columns, 'vx', 'vy', 'vz'),
        datum='local',
    )


def _stamp(columns: Columns, name: str, unit_ns: int) -> NDArray[np.int64]:
    """Return Unix times; the sender counts from its start, if it does not know the date."""
    count = columns[name].astype(np.int64) * unit_ns
    sound = columns.fault == 0
    stamp = np.where(count > _EPOCH_NS, count, columns.log_time)
    booted = sound & (count < _EPOCH_NS)
    if booted.any() and np.ptp(count[booted]) > 0:
        stamp[booted] = steady_time(count[booted], columns.log_time[booted])
    return stamp


def _vector(columns: Columns, *names: str) -> Array:
    return np.stack([columns[name] for name in names], axis=-1).astype(float)


_EXTENSIONS = [('alt_ellipsoid', '<i4'), ('h_acc', '<u4'), ('v_acc', '<u4')]
_ANGLES = ('roll', 'pitch', 'yaw', 'rollspeed', 'pitchspeed', 'yawspeed')
_LOCAL = [('time_boot_ms', '<u4'), *((name, '<f4') for name in ('x', 'y', 'z', 'vx', 'vy', 'vz'))]

_POSITIONS = (
    Message(
        24,
        'GPS_RAW_INT',
        24,
        'gps_raw',
        np.dtype(
            [('time_usec', '<u8'), ('lat', '<i4'), ('lon', '<i4'), ('alt', '<i4')]
            + [('eph', '<u2'), ('epv', '<u2'), ('vel', '<u2'), ('cog', '<u2')]
            + [('fix_type', 'u1'), ('satellites_visible', 'u1'), *_EXTENSIONS]
        ),
        10,
        raw_measurements,
    ),
    Message(32, 'LOCAL_POSITION_NED', 185, 'local', np.dtype(_LOCAL), 7, local_measurements),
    Message(
        33,
        'GLOBAL_POSITION_INT',
        104,
        'global',
        np.dtype(
            [('time_boot_ms', '<u4'), ('lat', '<i4'), ('lon', '<i4'), ('alt', '<i4')]
            + [('relative_alt', '<i4'), ('vx', '<i2'), ('vy', '<i2'), ('vz', '<i2')]
            + [('hdg', '<u2')]
        ),
        9,
        global_measurements,
    ),
    Message(
        124,
        'GPS2_RAW',
        87,
        'gps_raw',
        np.dtype(
            [('time_usec', '<u8'), ('lat', '<i4'), ('lon', '<i4'), ('alt', '<i4')]
            + [('dgps_age', '<u4'), ('eph', '<u2'), ('epv', '<u2'), ('vel', '<u2')]
            + [('cog', '<u2'), ('fix_type', 'u1'), ('satellites_visible', 'u1')]
            + [('dgps_numch', 'u1'), ('yaw', '<u2'), *_EXTENSIONS]
        ),
        12,
        raw_measurements,
    ),
)

MESSAGES = {message.number: message for message in _POSITIONS}
"""Messages of position, by number."""

NAMES = {message.name: message for message in _POSITIONS}

ATTITUDE = Message(
    30,
    'ATTITUDE',
    39,
    '',
    np.dtype([('time_boot_ms', '<u4'), *((name, '<f4') for name in _ANGLES)]),
    7,
)
