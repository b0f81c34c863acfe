"""Which messages are position sources, by schema name and fields, and which are preferred.

Kinds in the order in which replay prefers them in a foreign log:

1. `gnss`: a receiver's message with position and velocity (PX4 SensorGps, u-blox NAV-PVT,
   GPSFix);
2. `fix`: NavSatFix, LocationFix, LocationFixes (with the velocity of a companion topic, if one
   agrees);
3. `global`: an estimator's position on earth, which goes wrong with the estimator (PX4
   VehicleGlobalPosition, MAVLink GLOBAL_POSITION_INT, GeoPoseStamped);
4. `gps_raw`: mavros GPSRAW, MAVLink GPS_RAW_INT and GPS2_RAW, 5. `nmea`: a receiver's message
   without vertical velocity;
6. `odometry`: Odometry, 7. `local`: PX4 VehicleLocalPosition, MAVLink LOCAL_POSITION_NED: metres
   from some origin;
8. `pose`: PoseStamped, which may be of anything, 9. `vehicle_state`: flightdyn's own.

What is wanted of a vehicle (set points, goals; told by the topic's name) comes after all that.

In flightdyn's own recordings Odometry comes first (it has velocity and attitude), then
VehicleState, then the others in the order above.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass

from ..errors import LogError
from . import gnss, location_fix, nmea, poses, px4
from .decoders import decodable, decoder_of, field_names
from .definitions import full_name
from .mcap_columns import Columns
from .mcap_container import Schema
from .measurements import (
    FIX_FIELDS,
    LOCATION_FIX_FIELDS,
    ODOMETRY_FIELDS,
    VEHICLE_STATE_FIELDS,
    Measured,
    fix_measurements,
    odometry_measurements,
    vehicle_state_measurements,
)
from .timeline import Rows

ORDER = ('gnss', 'fix', 'global', 'gps_raw', 'nmea', 'odometry', 'local', 'pose', 'vehicle_state')
OWN_ORDER = ('odometry', 'vehicle_state', *ORDER[:5], 'local', 'pose')

USABLE = (
    'sensor_msgs/NavSatFix, nav_msgs/Odometry, geographic_msgs/GeoPoseStamped, '
    'geometry_msgs/PoseStamped, flightdyn_msgs/VehicleState, gps_msgs/GPSFix, '
    'ublox_msgs/NavPVT, mavros_msgs/GPSRAW, nmea_msgs/Sentence (ROS 1 or 2), '
    'foxglove.LocationFix and LocationFixes (CDR, JSON, protobuf, flatbuffer), PX4 GPS, global '
    'and local position (px4_msgs, ulog2mcap), MAVLink (mavros_msgs/Mavlink, mavlink-server)'
)

# What PX4's translation node calls the former versions of a message.
_OLD_PX4 = re.compile(r'^px4_msgs_old/msg/(\w+?)V\d+$')

_WANTED_NOT_MEASURED = ('setpoint', 'goal', 'cmd', 'command', 'target', 'desired', 'reference')


@dataclass(frozen=True)
class Kind:
    """A kind of position source.

    Parameters
    ----------
    name : str
        One of `ORDER`.
    layouts : tuple of tuple of str
        Fields that must be there; the first of these that a schema has is read.
    measure : callable
        Turns columns into measurements, dropping rows by reason.
    optional : tuple of str
        Fields that are read where a schema has them.
    """

    name: str
    layouts: tuple[tuple[str, ...], ...]
    measure: Callable[[Columns, Rows, list[str]], Measured]
    optional: tuple[str, ...] = ()


LOCATION_FIXES = Kind('fix', (), location_fix.measurements)
"""LocationFix and LocationFixes that are no plain columns."""

_LOCATION_FIX = Kind(
    'fix', (LOCATION_FIX_FIELDS,), fix_measurements, ('velocity_x', 'velocity_y', 'velocity_z')
)
_PX4_GPS = Kind('gnss', px4.GPS_FIELDS, px4.gps_measurements, px4.GPS_OPTIONAL)
_PX4_GLOBAL = Kind('global', px4.GLOBAL_FIELDS, px4.global_measurements, px4.GLOBAL_OPTIONAL)
_PX4_LOCAL = Kind('local', px4.LOCAL_FIELDS, px4.local_measurements, px4.LOCAL_OPTIONAL)
_GPS_FIX = Kind('gnss', gnss.GPS_FIX_FIELDS, gnss.gps_fix_measurements, gnss.GPS_FIX_OPTIONAL)
_NAV_PVT = Kind('gnss', gnss.NAV_PVT_FIELDS, gnss.nav_pvt_measurements, gnss.NAV_PVT_OPTIONAL)

_POSE = Kind('pose', poses.POSE_FIELDS, poses.pose_measurements)
_GEO_POSE = Kind('global', poses.GEO_POSE_FIELDS, poses.geo_pose_measurements)

_KINDS = {
    'sensor_msgs/msg/NavSatFix': Kind('fix', (FIX_FIELDS,), fix_measurements),
    'foxglove_msgs/msg/LocationFix': _LOCATION_FIX,
    'foxglove.LocationFix': _LOCATION_FIX,
    'foxglove_msgs/msg/LocationFixes': LOCATION_FIXES,
    'foxglove.LocationFixes': LOCATION_FIXES,
    'nav_msgs/msg/Odometry': Kind('odometry', (ODOMETRY_FIELDS,), odometry_measurements),
    'flightdyn_msgs/msg/VehicleState': Kind(
        'vehicle_state', (VEHICLE_STATE_FIELDS,), vehicle_state_measurements
    ),
    'px4_msgs/msg/SensorGps': _PX4_GPS,
    'px4_msgs/msg/VehicleGpsPosition': _PX4_GPS,
    'px4_msgs/msg/VehicleGlobalPosition': _PX4_GLOBAL,
    'px4_msgs/msg/VehicleLocalPosition': _PX4_LOCAL,
    'ulog.sensor_gps': _PX4_GPS,
    'ulog.vehicle_gps_position': _PX4_GPS,
    'ulog.vehicle_global_position': _PX4_GLOBAL,
    'ulog.vehicle_local_position': _PX4_LOCAL,
    'gps_msgs/msg/GPSFix': _GPS_FIX,
    'gps_common/msg/GPSFix': _GPS_FIX,
    'ublox_msgs/msg/NavPVT': _NAV_PVT,
    'ublox_ubx_msgs/msg/UBXNavPVT': _NAV_PVT,
    'mavros_msgs/msg/GPSRAW': Kind(
        'gps_raw', gnss.GPS_RAW_FIELDS, gnss.gps_raw_measurements, gnss.GPS_RAW_OPTIONAL
    ),
    'geographic_msgs/msg/GeoPoseStamped': _GEO_POSE,
    'geographic_msgs/msg/GeoPoseWithCovarianceStamped': _GEO_POSE,
    'geometry_msgs/msg/PoseStamped': _POSE,
    'geometry_msgs/msg/PoseWithCovarianceStamped': _POSE,
    'nmea_msgs/msg/Sentence': Kind('nmea', nmea.SENTENCE_FIELDS, nmea.sentence_measurements),
}


def kind_of(schema: Schema, encoding: str) -> Kind | None:
    """Return the kind of source that messages are, None if none or if they cannot be decoded."""
    return kind_named(schema.name) if decodable(schema, encoding) else None


def kind_named(schema_name: str) -> Kind | None:
    """Return the kind of source that a schema's name stands for, None if it is none."""
    return _KINDS.get(_OLD_PX4.sub(r'px4_msgs/msg/\1', full_name(schema_name)))


def fields_of(kind: Kind, schema: Schema, encoding: str) -> tuple[str, ...]:
    """Return the fields to read of a schema.

    Raises
    ------
    LogError
        If it cannot be parsed or has none of the kind's layouts.
    """
    known = field_names(schema, encoding)
    layout = next((need for need in kind.layouts if known.issuperset(need)), None)
    if layout is None:
        decoder_of(schema, encoding, kind.layouts[0])
        raise LogError(f'{schema.name} lacks fields of a position')
    extra = (name for name in kind.optional if name in known and name not in layout)
    fields = (*layout, *extra)
    decoder_of(schema, encoding, fields)
    return fields


def is_wanted(topic: str) -> bool:
    """Return whether a topic's name says that it is wanted of a vehicle, and no measurement."""
    return any(word in topic.lower() for word in _WANTED_NOT_MEASURED)
