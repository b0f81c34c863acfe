"""Between messages and the library: the only place where the two meet.

Inside, axes are NED and FRD and `alpha`, `beta` are in degrees; standard messages are ENU and FLU,
and every angle in a message is in radians. Whatever goes into a message is made a `float` first:
rclpy does not check, and a NumPy scalar or an int in a float64 field becomes garbage.
"""

import array
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, PoseStamped, TransformStamped, Vector3
from geometry_msgs.msg import Quaternion as QuaternionMsg
from nav_msgs.msg import Odometry, Path
from numpy.typing import NDArray
from sensor_msgs.msg import Imu, NavSatFix, NavSatStatus
from std_msgs.msg import Header

from flightdyn_msgs.msg import PlanReport as PlanReportMsg
from flightdyn_msgs.msg import SimEvent, VehicleState
from flightdyn_msgs.msg import Trajectory as TrajectoryMsg

from .. import frames
from ..environment.geodesy import GeodeticPoint, geodetic_from_ned
from ..errors import InputError, ResultCode
from ..logs.messages import kinematics
from ..logs.messages import trajectory_from_message as trajectory_from_message
from ..planning.report import PlanReport
from ..trajectory import Columns, Trajectory
from .sim_watch import Event

Array = NDArray[np.float64]
Motion = Mapping[str, float]
"""One instant in the names of `logs.messages.kinematics`, every angle in radians."""

DEGREES = ('alpha', 'beta')

MAP = 'map'
MAP_NED = 'map_ned'
ODOM = 'odom'
BASE_LINK = 'base_link'
GPS = 'gps'

_NS = 10**9
_UNKNOWN = -1.0  # first element of a covariance: there is no such measurement (sensor_msgs/Imu)


# Times. ------------------------------------------------------------------------------------------


def time_msg(ns: int) -> Any:
    """Return a stamp of Unix or run time [ns]."""
    return Time(sec=int(ns // _NS), nanosec=int(ns % _NS))


def nanoseconds(stamp: Any) -> int:
    """Return a stamp as nanoseconds."""
    return int(stamp.sec) * _NS + int(stamp.nanosec)


def header(ns: int, frame_id: str) -> Any:
    return Header(stamp=time_msg(ns), frame_id=frame_id)


# Numbers. ----------------------------------------------------------------------------------------
def doubles(values: Iterable[float] | Array) -> 'array.array[float]':
    """Return values as what a float64[] field takes without a copy for each element."""
    return array.array('d', np.ascontiguousarray(values, dtype=np.float64).tobytes())


def to_message_unit(name: str, value: float) -> float:
    """Return a quantity of the library in a message's unit."""
    return math.radians(value) if name in DEGREES else float(value)


def from_message_unit(name: str, value: float) -> float:
    """Return a quantity of a message in the library's unit."""
    return math.degrees(value) if name in DEGREES else float(value)


def table(names: Sequence[str], values: Iterable[float], what: str) -> Columns:
    """Return the row-major values of a message by name, in the library's units.

    Raises
    ------
    InputError
        If names repeat, rows are not whole, or a value is not finite.
    """
    flat = np.asarray(values, dtype=float)
    if len(set(names)) != len(names):
        raise InputError(f'{what}: a name is given twice: {", ".join(names)}')
    if not names and flat.size:
        raise InputError(f'{what}: {flat.size} values without names')
    if names and flat.size % len(names):
        raise InputError(f'{what}: {flat.size} values do not fill rows of {len(names)} names')
    if not np.isfinite(flat).all():
        raise InputError(f'{what}: every value must be finite')
    rows = flat.reshape(-1, len(names)) if names else np.zeros((0, 0))
    return {
        name: np.degrees(rows[:, i]) if name in DEGREES else rows[:, i].copy()
        for i, name in enumerate(names)
    }


def flat_table(columns: Columns) -> 'array.array[float]':
    """Return columns as row-major values in messages' units."""
    if not columns:
        return array.array('d')
    return doubles(
        np.stack([np.radians(v) if k in DEGREES else v for k, v in columns.items()], axis=1)
    )


def bounds_from_msgs(items: Iterable[Any], what: str) -> dict[str, tuple[float, float]]:
    """Return NamedBounds as a mapping, in the library's units.

    Raises
    ------
    InputError
        If a name repeats, a bound is NaN, or the bounds are not in order.
    """
    result: dict[str, tuple[float, float]] = {}
    for item in items:
        lower, upper = float(item.lower), float(item.upper)
        where = f'{what}: {item.name}'
        if item.name in result:
            raise InputError(f'{where}: is given twice')
        if math.isnan(lower) or math.isnan(upper):
            raise InputError(f'{where}: a bound is NaN; -inf and inf mean none')
        if lower > upper or lower == math.inf or upper == -math.inf:
            raise InputError(f'{where}: lower bound {lower:g} is above the upper bound {upper:g}')
        result[item.name] = (
            from_message_unit(item.name, lower),
            from_message_unit(item.name, upper),
        )
    return result


# Events. -----------------------------------------------------------------------------------------
def event_msg(event: Event, ns: int) -> Any:
    """Return an event of the simulator, whose instant is `ns`."""
    return SimEvent(
        header=header(ns, MAP_NED),
        time=float(event.time),
        kind=getattr(SimEvent, event.kind.upper()),
        quantity=event.quantity,
        value=to_message_unit(event.quantity, event.value),
        limit=to_message_unit(event.quantity, event.limit),
        message=event.message,
    )


# Plans. ------------------------------------------------------------------------------------------
def trajectory_msg(trajectory: Trajectory, stamp_ns: int | None = None) -> Any:
    """Return a trajectory as a message; its time 0 is at `stamp_ns`, else at its own start."""
    message = TrajectoryMsg(
        header=header(trajectory.start_ns if stamp_ns is None else stamp_ns, MAP_NED),
        problem=trajectory.problem,
        vehicle=trajectory.vehicle,
        model=trajectory.model,
        control_interpolation=(
            TrajectoryMsg.PREVIOUS
            if trajectory.control_interpolation == 'previous'
            else TrajectoryMsg.LINEAR
        ),
        state_names=list(trajectory.states),
        control_names=list(trajectory.controls),
        output_names=list(trajectory.outputs),
    )
    message.time = doubles(trajectory.time)
    message.states = flat_table(trajectory.states)
    message.controls = flat_table(trajectory.controls)
    message.outputs = flat_table(trajectory.outputs)
    return message


def report_msg(report: PlanReport) -> Any:
    """Return a plan's report as a message."""
    message = PlanReportMsg(
        converged=bool(report.converged),
        verified=bool(report.verified),
        status=report.status,
        message=report.message,
        objective=float(report.objective),
        final_time=float(report.final_time),
        iterations=int(report.iterations),
        wall_s=float(report.wall_s),
        build_s=float(report.build_s),
        nodes=int(report.nodes),
        transcription=report.transcription,
        verification_names=list(report.verification),
        constraint_violation=float(report.constraint_violation),
        warnings=list(report.warnings),
        remedies=list(report.remedies),
    )
    message.verification_errors = doubles(
        [to_message_unit(name, error) for name, error in report.verification.items()]
    )
    return message


def report_from_msg(message: Any, code: ResultCode) -> PlanReport:
    """Return the report of a plan; the action's result has its code.

    Arcs, phases and missed conditions do not travel; the report's message tells of the latter.
    """
    return PlanReport(
        code=code,
        **{
            name: getattr(message, name)
            for name in PlanReport.__dataclass_fields__
            if name
            not in ('code', 'verification', 'warnings', 'remedies', 'arcs', 'phases', 'missed')
        },
        verification={
            name: from_message_unit(name, error)
            for name, error in zip(
                message.verification_names, message.verification_errors, strict=True
            )
        },
        warnings=list(message.warnings),
        remedies=list(message.remedies),
    )


def path_msg(trajectory: Trajectory, stamp_ns: int | None = None, *, limit: int = 10_000) -> Any:
    """Return a trajectory as poses in the map (ENU), each stamped with its own time.

    Long trajectories are thinned evenly to `limit` poses: a path is for looking at.
    """
    start = trajectory.start_ns if stamp_ns is None else stamp_ns
    n = len(trajectory)
    chosen = np.unique(np.linspace(0, n - 1, min(n, limit)).round().astype(int))
    columns = {name: values[chosen].tolist() for name, values in kinematics(trajectory).items()}
    times = (start + np.round(trajectory.time[chosen] * _NS).astype(np.int64)).tolist()
    path = Path(header=header(start, MAP))
    for i, ns in enumerate(times):
        pose = PoseStamped(header=header(ns, MAP))
        motion = {name: values[i] for name, values in columns.items()}
        pose.pose.position = _point(motion)
        pose.pose.orientation = _orientation(motion)
        path.poses.append(pose)
    return path


# One instant. ------------------------------------------------------------------------------------
def motion_of(values: Mapping[str, float]) -> dict[str, float]:
    """Return the motion of a model's states, controls and outputs at one instant."""
    q_eb = frames.quaternion_from_euler(values['phi'], values['theta'], values['psi'])
    names = ('x_e', 'y_e', 'z_e', 'u_e', 'v_e', 'w_e', 'p', 'q', 'r')
    angles = ('speed', 'gamma', 'track', 'bank', 'alpha', 'beta', 'airspeed', 'load_factor')
    motion = {name: to_message_unit(name, values[name]) for name in (*names, *angles)}
    motion.update({f'q_{part}': float(c) for part, c in zip('wxyz', q_eb, strict=True)})
    return motion


def motion_at(columns: Columns, index: int) -> dict[str, float]:
    """Return one row of `logs.messages.kinematics`."""
    return {name: float(values[index]) for name, values in columns.items()}


def state_msg(
    motion: Motion,
    ns: int,
    *,
    time: float,
    vehicle: str = '',
    model: str = '',
    states: Mapping[str, float] | None = None,
    controls: Mapping[str, float] | None = None,
) -> Any:
    """Return a VehicleState; `time` [s] since the start of the run."""
    states, controls = states or {}, controls or {}
    message = VehicleState(
        header=header(ns, MAP_NED),
        time=float(time),
        vehicle=vehicle,
        model=model,
        state_names=list(states),
        control_names=list(controls),
        **{name: value for name, value in motion.items() if not name.startswith('q_')},
    )
    message.q_eb = np.array([motion[f'q_{part}'] for part in 'wxyz'])
    message.states = doubles([to_message_unit(k, v) for k, v in states.items()])
    message.controls = doubles([to_message_unit(k, v) for k, v in controls.items()])
    return message


def odometry_msg(
    motion: Motion, ns: int, *, position_std: tuple[float, float, float] | None = None
) -> Any:
    """Return an Odometry: pose of `base_link` (FLU) in `odom` (ENU), twist in `base_link`.

    Parameters
    ----------
    position_std : north, east, down [m], optional
        1-sigma for the pose's covariance; all zero means unknown.
    """
    message = Odometry(header=header(ns, ODOM), child_frame_id=BASE_LINK)
    message.pose.pose.position = _point(motion)
    message.pose.pose.orientation = _orientation(motion)
    v_e: frames.Vector = (motion['u_e'], motion['v_e'], motion['w_e'])
    v_b = frames.rotate(_r_be(motion), v_e)
    message.twist.twist.linear = _vector(frames.flu_from_frd(v_b))
    message.twist.twist.angular = _vector(frames.flu_from_frd(_rates(motion)))
    if position_std is not None:
        # a variance has no sign: only the order of the axes changes
        for row, std in enumerate(np.abs(frames.enu_from_ned(position_std))):
            message.pose.covariance[7 * row] = float(std) ** 2
    return message


def imu_msg(
    motion: Motion,
    ns: int,
    specific_force_b: Sequence[float],
    std: tuple[float, float] = (0.0, 0.0),
) -> Any:
    """Return what an IMU at the centre of gravity measures; level and at rest: +g up.

    Parameters
    ----------
    specific_force_b : x, y, z [m/s^2]
        Acceleration less gravity, body axes (FRD).
    std : acceleration [m/s^2], angular rate [rad/s]
        1-sigma of each axis; 0 means unknown.
    """
    x, y, z = specific_force_b
    message = Imu(header=header(ns, BASE_LINK))
    message.orientation = _orientation(motion)
    message.linear_acceleration = _vector(frames.flu_from_frd((x, y, z)))
    for axis in range(3):
        message.linear_acceleration_covariance[4 * axis] = float(std[0]) ** 2
        message.angular_velocity_covariance[4 * axis] = float(std[1]) ** 2
    if any(math.isnan(motion[name]) for name in 'pqr'):
        message.angular_velocity_covariance[0] = _UNKNOWN
    message.angular_velocity = _vector(frames.flu_from_frd(_rates(motion)))
    return message


def fix_msg(
    lat: float,
    lon: float,
    altitude: float,
    ns: int,
    *,
    position_std: Sequence[float] | None = None,
) -> Any:
    """Return a NavSatFix of degrees and metres above the ellipsoid.

    Parameters
    ----------
    position_std : north, east, down [m], optional
        1-sigma for the covariance.
    """
    message = NavSatFix(header=header(ns, GPS))
    message.status.status = NavSatStatus.STATUS_FIX
    message.status.service = NavSatStatus.SERVICE_GPS
    message.latitude, message.longitude = float(lat), float(lon)
    message.altitude = float(altitude)
    message.position_covariance_type = NavSatFix.COVARIANCE_TYPE_UNKNOWN
    if position_std is not None:
        north, east, down = position_std
        # a variance has no sign: only the order of the axes changes
        for row, std in enumerate(np.abs(frames.enu_from_ned((north, east, down)))):
            message.position_covariance[4 * row] = float(std) ** 2
        message.position_covariance_type = NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN
    return message


def fix_of(
    motion: Motion,
    ns: int,
    origin: GeodeticPoint,
    error: Sequence[float] = (0.0, 0.0, 0.0),
    position_std: Sequence[float] | None = None,
) -> Any:
    """Return the NavSatFix of a position in the tangent plane at the origin.

    Parameters
    ----------
    error, position_std : north, east, down [m]
        By how much the fix is off, and 1-sigma of that.
    """
    north, east, down = (
        motion[name] + off for name, off in zip(('x_e', 'y_e', 'z_e'), error, strict=True)
    )
    lat, lon, altitude = geodetic_from_ned(north, east, down, origin)
    return fix_msg(float(lat), float(lon), float(altitude), ns, position_std=position_std)


def transform_msg(motion: Motion, ns: int) -> Any:
    """Return the transform from `odom` to `base_link`."""
    message = TransformStamped(header=header(ns, ODOM), child_frame_id=BASE_LINK)
    point = _point(motion)
    message.transform.translation = Vector3(x=point.x, y=point.y, z=point.z)
    message.transform.rotation = _orientation(motion)
    return message


def static_transform_msgs(ns: int) -> list[Any]:
    """Return the transforms that never change: `odom` on `map`, and the NED twin of `map`."""
    odom = TransformStamped(header=header(ns, MAP), child_frame_id=ODOM)
    odom.transform.rotation.w = 1.0
    ned = TransformStamped(header=header(ns, MAP), child_frame_id=MAP_NED)
    # NED to ENU is the attitude of a body along NED, without its half turn from FLU to FRD
    w, x, y, z = frames.quaternion_multiply(
        frames.ros_attitude_from_ned((1.0, 0.0, 0.0, 0.0)), (0.0, -1.0, 0.0, 0.0)
    )
    ned.transform.rotation = QuaternionMsg(w=float(w), x=float(x), y=float(y), z=float(z))
    return [odom, ned]


def _r_be(motion: Motion) -> frames.Rotation:
    return frames.transpose(frames.rotation_from_quaternion(_q_eb(motion)))


def _q_eb(motion: Motion) -> frames.Quaternion:
    return motion['q_w'], motion['q_x'], motion['q_y'], motion['q_z']


def _rates(motion: Motion) -> frames.Vector:
    # consumers of standard messages do not expect NaN: unknown rates are zero there
    p, q, r = (0.0 if math.isnan(motion[name]) else motion[name] for name in 'pqr')
    return p, q, r


def _point(motion: Motion) -> Any:
    x, y, z = frames.enu_from_ned((motion['x_e'], motion['y_e'], motion['z_e']))
    return Point(x=float(x), y=float(y), z=float(z))


def _vector(v: frames.Vector) -> Any:
    x, y, z = v
    return Vector3(x=float(x), y=float(y), z=float(z))


def _orientation(motion: Motion) -> Any:
    w, x, y, z = frames.ros_attitude_from_ned(_q_eb(motion))
    return QuaternionMsg(w=float(w), x=float(x), y=float(y), z=float(z))
