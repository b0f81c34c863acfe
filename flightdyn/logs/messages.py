"""Messages without ROS: definitions, and what a trajectory says in them.

Inside, axes are NED and FRD and `alpha`, `beta` are in degrees; standard messages are ENU and
FLU, and every angle in a message is in radians.
"""

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .. import frames
from ..environment.geodesy import geodetic_from_ned
from ..errors import InputError
from ..resources import message_files
from ..trajectory import Columns, Trajectory, columns_of

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

Array = NDArray[np.float64]

VEHICLE_STATE = 'flightdyn_msgs/msg/VehicleState'
TRAJECTORY = 'flightdyn_msgs/msg/Trajectory'
ODOMETRY = 'nav_msgs/msg/Odometry'
NAV_SAT_FIX = 'sensor_msgs/msg/NavSatFix'

DEGREES = ('alpha', 'beta')  # in degrees in Python, as the project's names have it


@cache
def typestore() -> 'Typestore':
    """Return the definitions of the standard ROS 2 messages and of flightdyn's own."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_KILTED)
    types: dict[str, Any] = {}
    for path in message_files():
        types.update(get_types_from_msg(path.read_text('utf-8'), _own_name(path)))
    store.register(types)
    return store


def schema_text(msgtype: str) -> str:
    """Return a type's definition with those of all types in it, as MCAP wants it.

    Raises
    ------
    InputError
        If the type is not known.
    """
    store = typestore()
    if msgtype not in store.fielddefs:
        raise InputError(f'message type {msgtype} is not known')
    text, _ = store.generate_msgdef(msgtype, ros_version=2)
    for path in message_files():
        if _own_name(path) == msgtype:  # as written: the comments hold the units
            _, rule, others = text.partition('=' * 80)
            return path.read_text('utf-8') + rule + others
    return text


def _own_name(path: Path) -> str:
    return f'flightdyn_msgs/msg/{path.stem}'


def serialize(msgtype: str, message: Any) -> bytes:
    """Return a message of the typestore's class as CDR."""
    return bytes(typestore().serialize_cdr(message, msgtype))


def canonical(msgtype: str, cdr: bytes) -> bytes:
    """Return a message in CDR with zeros in the bytes that alignment leaves unused.

    ROS writes whatever was in memory there, so that equal messages differ.
    """
    store = typestore()
    return bytes(store.serialize_cdr(store.deserialize_cdr(cdr, msgtype), msgtype))


def kinematics(trajectory: Trajectory) -> Columns:
    """Return the motion of any model's trajectory in common columns.

    Returns
    -------
    mapping of name to array (n,)
        x_e y_e z_e u_e v_e w_e [m, m/s], q_w q_x q_y q_z (body to earth), p q r [rad/s], speed
        gamma track bank alpha beta [m/s, rad], airspeed [m/s], load_factor. A planar model's
        missing axes are zero; what the trajectory does not tell is NaN.
    """
    n = len(trajectory)
    zero, unknown = np.zeros(n), np.full(n, np.nan)

    def get(name: str, default: Array = zero) -> Array:
        if name not in trajectory:
            return default
        return np.radians(trajectory[name]) if name in DEGREES else trajectory[name]

    alpha, beta = get('alpha', unknown), get('beta', unknown)
    if any(name in trajectory for name in ('phi', 'theta', 'psi')):
        euler: frames.Vector = (get('phi'), get('theta'), get('psi'))
    else:  # a point mass: the body is turned from the flight path by alpha and beta
        along = frames.rotation_from_euler(get('bank'), get('gamma'), get('track'))
        r_bw = frames.matmul(
            frames.rotation_body_stability(get('alpha')),
            frames.rotation_stability_wind(get('beta')),
        )
        euler = frames.euler_from_rotation(frames.matmul(along, frames.transpose(r_bw)))
    r_eb = frames.rotation_from_euler(*euler)
    if 'u_e' in trajectory:
        velocity: frames.Vector = (get('u_e'), get('v_e'), get('w_e'))
    elif 'u_b' in trajectory:
        velocity = frames.rotate(r_eb, (get('u_b'), get('v_b'), get('w_b')))
    else:
        path = frames.rotation_from_euler(zero, get('gamma'), get('track'))
        velocity = frames.rotate(path, (get('speed'), zero, zero))
    u_e, v_e, w_e = (np.asarray(v, float) + zero for v in velocity)
    level = np.hypot(u_e, v_e)
    rates_known = any(name in trajectory for name in 'pqr')
    q_eb = np.stack(frames.quaternion_from_euler(*euler), axis=1)
    columns = {
        'x_e': get('x_e'),
        'y_e': get('y_e'),
        'z_e': get('z_e'),
        'u_e': u_e,
        'v_e': v_e,
        'w_e': w_e,
        **{f'q_{part}': q_eb[:, i] for i, part in enumerate('wxyz')},
        **{name: get(name, zero if rates_known else unknown) for name in 'pqr'},
        'speed': get('speed', np.hypot(level, w_e)),
        'gamma': get('gamma', np.arcsin(np.clip(_climb(w_e, np.hypot(level, w_e)), -1, 1))),
        'track': get('track', np.arctan2(v_e, u_e)),
        'alpha': alpha,
        'beta': beta,
    }
    for name in ('bank', 'airspeed', 'load_factor'):
        columns[name] = get(name, unknown)
    return columns


def _climb(w_e: Array, speed: Array) -> Array:
    """Return the upward part of the velocity over its length, 0 at rest."""
    up: Array = np.asarray(frames.enu_from_ned((0.0, 0.0, w_e))[2])
    return np.divide(up, speed, out=np.zeros_like(speed), where=speed > 0)


def vehicle_state_messages(trajectory: Trajectory, motion: Columns) -> Iterator[Any]:
    """Yield a VehicleState for each sample; `motion` from `kinematics`."""
    types = typestore().types
    q_eb = np.stack([motion[f'q_{part}'] for part in 'wxyz'], axis=1)
    states = _table(trajectory.states, len(trajectory))
    controls = _table(trajectory.controls, len(trajectory))
    names = [name for name in motion if not name.startswith('q_')]
    values = np.stack([motion[name] for name in names], axis=1).tolist()
    headers = _headers(trajectory.unix_ns, 'map_ned')
    for i, header in enumerate(headers):
        yield types[VEHICLE_STATE](
            header=header,
            time=float(trajectory.time[i]),
            q_eb=q_eb[i],
            vehicle=trajectory.vehicle,
            model=trajectory.model,
            state_names=list(trajectory.states),
            states=states[i],
            control_names=list(trajectory.controls),
            controls=controls[i],
            **dict(zip(names, values[i], strict=True)),
        )


def odometry_messages(trajectory: Trajectory, motion: Columns) -> Iterator[Any]:
    """Yield an Odometry for each sample: pose ENU of FLU, twist in the body; `motion` as above."""
    types = typestore().types
    point, vector = types['geometry_msgs/msg/Point'], types['geometry_msgs/msg/Vector3']
    quaternion = types['geometry_msgs/msg/Quaternion']
    pose, twist = types['geometry_msgs/msg/Pose'], types['geometry_msgs/msg/Twist']
    with_pose = types['geometry_msgs/msg/PoseWithCovariance']
    with_twist = types['geometry_msgs/msg/TwistWithCovariance']
    unknown = np.zeros(36)
    q_eb: frames.Quaternion = (motion['q_w'], motion['q_x'], motion['q_y'], motion['q_z'])
    r_be = frames.transpose(frames.rotation_from_quaternion(q_eb))
    velocity_b = frames.rotate(r_be, (motion['u_e'], motion['v_e'], motion['w_e']))
    rates: frames.Vector = (motion['p'], motion['q'], motion['r'])
    position = frames.stack(
        frames.enu_from_ned((motion['x_e'], motion['y_e'], motion['z_e']))
    ).tolist()
    attitude = np.stack(frames.ros_attitude_from_ned(q_eb), axis=1).tolist()
    linear = frames.stack(frames.flu_from_frd(velocity_b)).tolist()
    # Consumers of Odometry do not expect NaN: unknown rates are zero there.
    angular = np.nan_to_num(frames.stack(frames.flu_from_frd(rates))).tolist()
    for i, header in enumerate(_headers(trajectory.unix_ns, 'odom')):
        w, x, y, z = attitude[i]
        yield types[ODOMETRY](
            header=header,
            child_frame_id='base_link',
            pose=with_pose(pose(point(*position[i]), quaternion(x, y, z, w)), unknown),
            twist=with_twist(twist(vector(*linear[i]), vector(*angular[i])), unknown),
        )


def fix_messages(trajectory: Trajectory, lat: Array, lon: Array, alt: Array) -> Iterator[Any]:
    """Yield a NavSatFix for each sample, at latitudes and longitudes [deg], altitudes [m]."""
    types = typestore().types
    status = types['sensor_msgs/msg/NavSatStatus'](status=0, service=1)
    unknown = np.zeros(9)
    for i, header in enumerate(_headers(trajectory.unix_ns, 'gps')):
        yield types[NAV_SAT_FIX](
            header=header,
            status=status,
            latitude=float(lat[i]),
            longitude=float(lon[i]),
            altitude=float(alt[i]),
            position_covariance=unknown,
            position_covariance_type=0,
        )


def geodetic_columns(trajectory: Trajectory, motion: Columns) -> tuple[Array, Array, Array] | None:
    """Return latitudes, longitudes [deg] and altitudes [m]; None if it is nowhere on earth."""
    if all(name in trajectory for name in ('lat', 'lon', 'altitude')):
        return trajectory['lat'], trajectory['lon'], trajectory['altitude']
    if trajectory.origin is None:
        return None
    return geodetic_from_ned(motion['x_e'], motion['y_e'], motion['z_e'], trajectory.origin)


def trajectory_message(trajectory: Trajectory) -> Any:
    """Return a whole trajectory as a flightdyn_msgs/Trajectory."""
    types = typestore().types
    cls = types[TRAJECTORY]
    n = len(trajectory)
    groups: dict[str, Any] = {}
    for group in ('state', 'control', 'output'):
        columns = getattr(trajectory, f'{group}s')
        groups[f'{group}_names'] = list(columns)
        groups[f'{group}s'] = _table(columns, n).ravel()
    (header,) = _headers(np.array([trajectory.start_ns]), 'map_ned')
    return cls(
        header=header,
        problem=trajectory.problem,
        vehicle=trajectory.vehicle,
        model=trajectory.model,
        control_interpolation=int(trajectory.control_interpolation == 'previous'),
        time=trajectory.time,
        **groups,
    )


def trajectory_from_message(message: Any) -> Trajectory:
    """Return the trajectory of a flightdyn_msgs/Trajectory, of the typestore's or rclpy's class.

    Raises
    ------
    InputError
        If a table has not n rows, or a value makes no trajectory.
    """
    time = np.asarray(message.time, float)
    groups: dict[str, Any] = {}
    for group in ('state', 'control', 'output'):
        names = list(getattr(message, f'{group}_names'))
        values = np.asarray(getattr(message, f'{group}s'), float)
        if values.size != time.size * len(names):
            raise InputError(
                f'trajectory {group}s has {values.size} values for {time.size} times and '
                f'{len(names)} names'
            )
        columns = columns_of(names, values.reshape(time.size, len(names))) if names else {}
        for name in set(DEGREES).intersection(columns):
            columns[name] = np.degrees(columns[name])
        groups[f'{group}s'] = columns
    stamp = message.header.stamp
    return Trajectory(
        time=time,
        **groups,
        model=message.model,
        vehicle=message.vehicle,
        problem=message.problem,
        control_interpolation='previous' if message.control_interpolation == 1 else 'linear',
        start_ns=int(stamp.sec) * 10**9 + int(stamp.nanosec),
    )


def _table(columns: Columns, rows: int) -> Array:
    if not columns:
        return np.zeros((rows, 0))
    return np.stack(
        [np.radians(v) if name in DEGREES else v for name, v in columns.items()], axis=1
    )


def _headers(unix_ns: NDArray[np.int64], frame_id: str) -> Iterator[Any]:
    types = typestore().types
    time, header = types['builtin_interfaces/msg/Time'], types['std_msgs/msg/Header']
    for ns in unix_ns.tolist():
        yield header(time(ns // 10**9, ns % 10**9), frame_id)
