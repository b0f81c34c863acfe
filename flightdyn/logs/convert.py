"""Other flight logs as MCAP, so that ROS 2, Foxglove and flightdyn's nodes can read them."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from .. import frames
from ..environment.geodesy import GeodeticPoint, geodetic_from_ned, ned_from_geodetic
from ..errors import InputError
from ..files import written_whole
from .any_log import open_log, track_of
from .messages import NAV_SAT_FIX, ODOMETRY, serialize, typestore
from .provenance import FIX_TOPIC, ODOMETRY_TOPIC, provenance
from .recording import McapRecorder
from .track import Array, Track


def convert(path: str | Path, output: str | Path, source: str | None = None) -> dict[str, Any]:
    """Write a log's track as an MCAP recording with ROS 2 messages.

    `/fix` (sensor_msgs/NavSatFix) if it is known where on earth it is; `/odom`
    (nav_msgs/Odometry) if it has velocity or is local: ENU of the first sample's place in frame
    `map`, the velocity in the axes east, north, up at the vehicle, orientation all 0 where none
    was measured. A metadata record `flightdyn` says what was converted and the altitude's datum.

    Parameters
    ----------
    path : path
        Any log that `any_log.read_track` takes, but an MCAP.
    output : path
        Ends in `.mcap`; an existing file is replaced once all is written.
    source : str, optional
        Topic to convert. Default: the best there is.

    Returns
    -------
    dict
        `file format source schema altitude_datum messages used dropped segments start_ns end_ns
        output topics warnings`.

    Raises
    ------
    LogError
        If the log cannot be read.
    InputError
        If the output is the log itself or no `.mcap`, or cannot be written.
    """
    path, output = Path(path), Path(output)
    if output.suffix != '.mcap':
        raise InputError(f"cannot write {output}: suffix '{output.suffix}', not .mcap")
    if output.exists() and path.exists() and output.samefile(path):
        raise InputError(f'{output} is the log itself: give another name to write to')
    log = open_log(path)
    if log is None:
        raise InputError(
            f"{path} is an MCAP already: replay it as it is, or cut it with 'mcap filter'"
        )
    track = track_of(log, source)
    counts = write_track_mcap(track, output, log.format)
    return {
        'file': track.file,
        'format': log.format,
        'source': track.source,
        'schema': track.schema,
        'altitude_datum': track.altitude_datum,
        'messages': track.messages,
        'used': len(track),
        'dropped': dict(track.dropped),
        'segments': int(track.segment[-1]) + 1,
        'start_ns': int(track.time_ns[0]),
        'end_ns': int(track.time_ns[-1]),
        'output': str(output),
        'topics': counts,
        'warnings': list(track.warnings),
    }


def write_track_mcap(track: Track, output: Path, format_name: str) -> list[dict[str, Any]]:
    """Write a track as an MCAP recording; return topics, schemas and counts.

    Raises
    ------
    InputError
        If it cannot be written, or times are before 1970.
    """
    metadata = provenance(track, format_name)
    origin = track.origin
    if track.lat is not None and track.velocity_ned is not None:
        assert track.lon is not None and track.altitude is not None
        origin = GeodeticPoint(float(track.lat[0]), float(track.lon[0]), float(track.altitude[0]))
    if origin is not None:
        for name in ('lat', 'lon', 'altitude'):
            metadata[f'origin_{name}'] = repr(float(getattr(origin, name)))
    streams: list[tuple[str, str, Iterator[Any]]] = []
    if track.lat is not None or origin is not None:
        streams.append((FIX_TOPIC, NAV_SAT_FIX, _fixes(track, origin)))
    if track.position_ned is not None or track.velocity_ned is not None:
        streams.append((ODOMETRY_TOPIC, ODOMETRY, _odometry(track, origin)))
    with written_whole(output) as temporary, McapRecorder(temporary, metadata) as recorder:
        together = zip(*(messages for _, _, messages in streams), strict=True)
        for ns, messages in zip(track.time_ns.tolist(), together, strict=True):
            for (topic, msgtype, _), message in zip(streams, messages, strict=True):
                recorder.write(topic, msgtype, serialize(msgtype, message), ns)
    return [
        {'topic': topic, 'schema': msgtype, 'messages': len(track)}
        for topic, msgtype, _ in streams
    ]


def _fixes(track: Track, origin: GeodeticPoint | None) -> Iterator[Any]:
    types = typestore().types
    if track.lat is not None:
        lat, lon, altitude = track.lat, track.lon, track.altitude
    else:
        assert track.position_ned is not None and origin is not None
        x, y, z = track.position_ned.T
        lat, lon, altitude = geodetic_from_ned(x, y, z, origin)
    assert lon is not None and altitude is not None
    status = types['sensor_msgs/msg/NavSatStatus'](status=0, service=1)
    covariance = _covariance(track.position_std, len(track))
    for i, header in enumerate(_headers(track, 'gps')):
        yield types[NAV_SAT_FIX](
            header=header,
            status=status,
            latitude=float(lat[i]),
            longitude=float(lon[i]),
            altitude=float(altitude[i]),
            position_covariance=covariance[i].ravel(),
            position_covariance_type=2 if covariance[i, 0, 0] > 0 else 0,
        )


def _odometry(track: Track, origin: GeodeticPoint | None) -> Iterator[Any]:
    types = typestore().types
    point, vector = types['geometry_msgs/msg/Point'], types['geometry_msgs/msg/Vector3']
    quaternion = types['geometry_msgs/msg/Quaternion']
    pose, twist = types['geometry_msgs/msg/Pose'], types['geometry_msgs/msg/Twist']
    with_pose = types['geometry_msgs/msg/PoseWithCovariance']
    with_twist = types['geometry_msgs/msg/TwistWithCovariance']
    n = len(track)
    ned = track.position_ned
    if ned is None:
        assert track.lat is not None and track.lon is not None and track.altitude is not None
        assert origin is not None
        ned = np.stack(ned_from_geodetic(track.lat, track.lon, track.altitude, origin), axis=-1)
    position = _enu(ned).tolist()
    unknown = np.full((n, 3), np.nan)
    velocity = _enu(unknown if track.velocity_ned is None else track.velocity_ned).tolist()
    if track.attitude is None:
        attitude = np.zeros((n, 4))
    else:
        w, x, y, z = np.nan_to_num(track.attitude).T
        attitude = np.stack(frames.ros_attitude_from_ned((w, x, y, z)), axis=1)
        attitude[~np.isfinite(track.attitude).all(axis=1)] = 0
    pose_cov, twist_cov = np.zeros((n, 6, 6)), np.zeros((n, 6, 6))
    pose_cov[:, :3, :3] = _covariance(track.position_std, n)
    twist_cov[:, :3, :3] = _covariance(track.velocity_std, n)
    still = vector(0.0, 0.0, 0.0)
    for i, header in enumerate(_headers(track, 'map')):
        w, x, y, z = attitude[i].tolist()
        yield types[ODOMETRY](
            header=header,
            child_frame_id='map',  # that of the twist
            pose=with_pose(pose(point(*position[i]), quaternion(x, y, z, w)), pose_cov[i].ravel()),
            twist=with_twist(twist(vector(*velocity[i]), still), twist_cov[i].ravel()),
        )


def _enu(ned: Array) -> Array:
    stacked: Array = frames.stack(frames.enu_from_ned((ned[:, 0], ned[:, 1], ned[:, 2])))
    return stacked


def _covariance(std_ned: Array | None, n: int) -> Array:
    """Return diagonal covariances (n, 3, 3) east, north, up; zeros where unknown."""
    covariance = np.zeros((n, 3, 3))
    if std_ned is not None:
        variance = np.abs(_enu(np.nan_to_num(std_ned) ** 2))
        covariance[:, range(3), range(3)] = variance
    return covariance


def _headers(track: Track, frame_id: str) -> Iterator[Any]:
    types = typestore().types
    time, header = types['builtin_interfaces/msg/Time'], types['std_msgs/msg/Header']
    for ns in track.time_ns.tolist():
        yield header(time(ns // 10**9, ns % 10**9), frame_id)
