"""Messages and files for the tests of logs, made with rosbags and the mcap package."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from mcap.writer import IndexType
from rosbags.typesys import Stores, get_typestore

START_NS = 1_700_000_000 * 10**9
STORE = get_typestore(Stores.ROS2_KILTED)

Message = tuple[str, int, bytes]  # topic, log time, payload

NO_INDEX = {
    'index_types': IndexType.NONE,
    'repeat_channels': False,
    'repeat_schemas': False,
    'use_statistics': False,
    'use_summary_offsets': False,
}


def stamp(ns: int, frame: str = 'gps') -> Any:
    time = STORE.types['builtin_interfaces/msg/Time'](ns // 10**9, ns % 10**9)
    return STORE.types['std_msgs/msg/Header'](time, frame)


def nav_sat_fix(
    ns: int,
    lat: float = 48.0,
    lon: float = 9.0,
    altitude: float = 500.0,
    *,
    status: int = 0,
    covariance: Iterable[float] = (0.0,) * 9,
    covariance_type: int = 0,
    little_endian: bool = True,
    frame: str = 'gps',
) -> bytes:
    message = STORE.types['sensor_msgs/msg/NavSatFix'](
        header=stamp(ns, frame),
        status=STORE.types['sensor_msgs/msg/NavSatStatus'](status, 1),
        latitude=lat,
        longitude=lon,
        altitude=altitude,
        position_covariance=np.array(list(covariance), float),
        position_covariance_type=covariance_type,
    )
    return bytes(
        STORE.serialize_cdr(message, 'sensor_msgs/msg/NavSatFix', little_endian=little_endian)
    )


def fixes(number: int = 20, **options: Any) -> list[Message]:
    """A climb to the north-east at 1 Hz on /fix."""
    times = [START_NS + i * 10**9 for i in range(number)]
    return [
        ('/fix', ns, nav_sat_fix(ns, 48 + 1e-4 * i, 9 + 2e-4 * i, 500 + 3.0 * i, **options))
        for i, ns in enumerate(times)
    ]
