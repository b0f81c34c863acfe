"""Messages against the library, worked by hand: all axes unequal, nothing zero."""

import math

import numpy as np
import pytest
from ros_support import need_ros

need_ros()

from flightdyn import frames  # noqa: E402
from flightdyn.environment.geodesy import GeodeticPoint  # noqa: E402
from flightdyn.errors import InputError, ResultCode  # noqa: E402
from flightdyn.nodes import convert  # noqa: E402
from flightdyn.nodes.sim_watch import Event  # noqa: E402
from flightdyn.planning.report import PlanReport  # noqa: E402
from flightdyn.trajectory import Trajectory  # noqa: E402
from flightdyn_msgs.msg import NamedBounds  # noqa: E402

NS = 1_700_000_000_123_456_789


def motion(**changes: float) -> dict[str, float]:
    """Heading east and level at (1, 2, 3) NED, moving north, east and down, turning every way."""
    values = dict.fromkeys(
        ('phi', 'theta', 'speed', 'gamma', 'track', 'bank', 'airspeed', 'load_factor'), 0.0
    )
    values |= {'x_e': 1.0, 'y_e': 2.0, 'z_e': 3.0, 'u_e': 4.0, 'v_e': 5.0, 'w_e': 6.0}
    values |= {'psi': math.pi / 2, 'p': 0.1, 'q': 0.2, 'r': 0.3, 'alpha': 90.0, 'beta': -180.0}
    return convert.motion_of({**values, **changes})


def xyz(message: object) -> tuple[float, float, float]:
    return message.x, message.y, message.z  # type: ignore[attr-defined]


def turned(q: object, v: tuple[float, float, float]) -> tuple[float, ...]:
    """Rotate by a message's quaternion: v + 2 w (q x v) + 2 q x (q x v)."""
    u = np.array(xyz(q))
    return tuple(v + 2 * q.w * np.cross(u, v) + 2 * np.cross(u, np.cross(u, v)))  # type: ignore[attr-defined]


def test_stamp() -> None:
    stamp = convert.time_msg(NS)
    assert (stamp.sec, stamp.nanosec) == (1_700_000_000, 123_456_789)
    assert convert.nanoseconds(stamp) == NS


def test_odometry_of_a_vehicle_that_heads_east() -> None:
    odom = convert.odometry_msg(motion(), NS)
    assert (odom.header.frame_id, odom.child_frame_id) == ('odom', 'base_link')
    assert xyz(odom.pose.pose.position) == (2.0, 1.0, -3.0)
    # forward is east, left is north, up is up: the FLU body lies along ENU
    q = odom.pose.pose.orientation
    assert (abs(q.w), *xyz(q)) == pytest.approx((1, 0, 0, 0), abs=1e-12)
    assert xyz(odom.twist.twist.linear) == pytest.approx((5, 4, -6), abs=1e-12)
    assert xyz(odom.twist.twist.angular) == (0.1, -0.2, -0.3)


def test_odometry_of_a_vehicle_that_rolls_pitches_and_yaws() -> None:
    phi, theta, psi = math.radians(30), math.radians(20), math.radians(10)
    odom = convert.odometry_msg(motion(phi=phi, theta=theta, psi=psi), NS)
    q = odom.pose.pose.orientation
    # the nose, by the definition of pitch and heading: north, east, up
    north = math.cos(theta) * math.cos(psi)
    east = math.cos(theta) * math.sin(psi)
    assert turned(q, (1, 0, 0)) == pytest.approx((east, north, math.sin(theta)), abs=1e-12)
    # rolled right, the left wing tip is above the right one by the sine, seen along the body
    assert turned(q, (0, 1, 0))[2] == pytest.approx(math.sin(phi) * math.cos(theta), abs=1e-12)
    assert turned(q, (0, 0, 1))[2] == pytest.approx(math.cos(phi) * math.cos(theta), abs=1e-12)
    # the twist, turned back into the map, is the velocity
    back = turned(q, xyz(odom.twist.twist.linear))
    assert back == pytest.approx((5, 4, -6), abs=1e-12)


def test_transform_is_the_pose() -> None:
    there = motion(phi=0.3, theta=0.2, psi=0.1)
    pose, transform = convert.odometry_msg(there, NS).pose.pose, convert.transform_msg(there, NS)
    assert xyz(transform.transform.translation) == xyz(pose.position)
    assert transform.transform.rotation == pose.orientation
    assert (transform.header.frame_id, transform.child_frame_id) == ('odom', 'base_link')


def test_covariance_swaps_north_and_east() -> None:
    odom = convert.odometry_msg(motion(), NS, position_std=(1.0, 2.0, 3.0))
    assert np.diag(odom.pose.covariance.reshape(6, 6)).tolist() == [4, 1, 9, 0, 0, 0]


def test_unknown_rates_are_zero_in_standard_messages_only() -> None:
    unknown = motion(p=math.nan, q=math.nan, r=math.nan)
    assert xyz(convert.odometry_msg(unknown, NS).twist.twist.angular) == (0, 0, 0)
    imu = convert.imu_msg(unknown, NS, (0, 0, 0))
    assert imu.angular_velocity_covariance[0] == -1
    assert math.isnan(convert.state_msg(unknown, NS, time=0).p)


def test_imu_at_rest_feels_the_ground_push_up() -> None:
    imu = convert.imu_msg(motion(), NS, (1.0, 2.0, -9.81))
    assert xyz(imu.linear_acceleration) == (1.0, -2.0, 9.81)
    assert xyz(imu.angular_velocity) == (0.1, -0.2, -0.3)
    assert imu.header.frame_id == 'base_link'


def test_state_keeps_ned_and_turns_degrees_into_radians() -> None:
    message = convert.state_msg(
        motion(), NS, time=1.5, vehicle='v', model='m', states={'x_e': 1}, controls={'alpha': 45.0}
    )
    assert message.header.frame_id == 'map_ned'
    assert (message.x_e, message.y_e, message.z_e) == (1, 2, 3)
    assert (message.u_e, message.v_e, message.w_e) == (4, 5, 6)
    half = math.sqrt(0.5)  # a quarter turn about down
    assert message.q_eb.tolist() == pytest.approx([half, 0, 0, half])
    assert message.alpha == pytest.approx(math.pi / 2)
    assert message.beta == pytest.approx(-math.pi)
    assert (message.state_names, list(message.states)) == (['x_e'], [1.0])
    assert message.controls[0] == pytest.approx(math.pi / 4)


def test_fix_lies_north_and_above_the_origin() -> None:
    origin = GeodeticPoint(50.0, 10.0, 100.0)
    fix = convert.fix_of(motion(x_e=1000.0, y_e=0.0, z_e=-200.0), NS, origin)
    # a degree of latitude at 50 degrees is 111.23 km (WGS84)
    assert fix.latitude == pytest.approx(50 + 1 / 111.23, abs=1e-5)
    assert fix.longitude == pytest.approx(10, abs=1e-9)
    assert fix.altitude == pytest.approx(300.08, abs=0.01)  # 0.08 m: the earth is round


def test_static_transforms_take_ned_to_enu() -> None:
    odom, ned = convert.static_transform_msgs(NS)
    assert turned(odom.transform.rotation, (1, 2, 3)) == pytest.approx((1, 2, 3))
    assert turned(ned.transform.rotation, (1, 2, 3)) == pytest.approx((2, 1, -3))
    assert (ned.header.frame_id, ned.child_frame_id) == ('map', 'map_ned')


def glide() -> Trajectory:
    return Trajectory(
        time=np.array([0.0, 1.0, 2.5]),
        states={'x_e': np.array([1.0, 2, 3]), 'y_e': np.array([4.0, 5, 6])},
        controls={'alpha': np.array([0.0, 45, 90]), 'bank': np.array([0.1, 0.2, 0.3])},
        outputs={
            'beta': np.array([180.0, 0, 0]),
            'u_e': np.ones(3),
            'v_e': np.ones(3) * 2,
            'w_e': np.ones(3) * 3,
            'gamma': np.zeros(3),
            'track': np.ones(3),
        },
        model='DynamicsPointMass3DSpeedGammaTrack',
        vehicle='v',
        problem='p',
        control_interpolation='previous',
    )


def test_trajectory_message_is_row_major_and_in_radians() -> None:
    message = convert.trajectory_msg(glide(), NS)
    assert list(message.states) == [1, 4, 2, 5, 3, 6]
    assert list(message.controls) == pytest.approx([0, 0.1, math.pi / 4, 0.2, math.pi / 2, 0.3])
    assert message.outputs[0] == pytest.approx(math.pi)
    assert message.control_interpolation == message.PREVIOUS
    assert message.header.frame_id == 'map_ned'


def test_trajectory_comes_back() -> None:
    back = convert.trajectory_from_message(convert.trajectory_msg(glide(), NS))
    assert back.start_ns == NS
    assert (back.model, back.vehicle, back.problem) == (glide().model, 'v', 'p')
    assert back.control_interpolation == 'previous'
    for name, values in glide().columns.items():
        assert back[name] == pytest.approx(values, rel=1e-15), name


def test_path_is_enu_and_keeps_its_ends_when_thinned() -> None:
    path = convert.path_msg(glide(), NS, limit=2)
    assert path.header.frame_id == 'map'
    assert [xyz(pose.pose.position) for pose in path.poses] == [(4, 1, 0), (6, 3, 0)]
    assert convert.nanoseconds(path.poses[-1].header.stamp) == NS + 2_500_000_000


def test_bounds_of_degrees() -> None:
    items = [
        NamedBounds(name='alpha', lower=-math.pi, upper=math.inf),
        NamedBounds(name='x_e', lower=1.0, upper=2.0),
    ]
    assert convert.bounds_from_msgs(items, 'w') == {'alpha': (-180, math.inf), 'x_e': (1, 2)}


@pytest.mark.parametrize(
    ('lower', 'upper', 'words'),
    [(2.0, 1.0, 'above'), (math.nan, 1.0, 'NaN'), (math.inf, math.inf, 'above')],
)
def test_malformed_bounds_are_refused(lower: float, upper: float, words: str) -> None:
    with pytest.raises(InputError, match=words):
        convert.bounds_from_msgs([NamedBounds(name='x', lower=lower, upper=upper)], 'w')


def test_bounds_given_twice_are_refused() -> None:
    with pytest.raises(InputError, match='twice'):
        convert.bounds_from_msgs([NamedBounds(name='x'), NamedBounds(name='x')], 'w')


@pytest.mark.parametrize(
    ('names', 'values', 'words'),
    [
        (['a', 'b'], [1.0, 2, 3], 'rows'),
        (['a', 'a'], [1.0, 2], 'twice'),
        ([], [1.0], 'without names'),
        (['a'], [math.nan], 'finite'),
    ],
)
def test_malformed_tables_are_refused(names: list[str], values: list[float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        convert.table(names, values, 'w')


def test_report() -> None:
    report = PlanReport(
        code=ResultCode.SUCCESS,
        converged=True,
        verified=True,
        status='s',
        message='m',
        objective=1,
        final_time=2,
        iterations=3,
        wall_s=4,
        build_s=5,
        nodes=6,
        transcription='t',
        verification={'x_e': 0.5, 'alpha': 180.0},
        constraint_violation=7,
        warnings=['w'],
        remedies=['r'],
    )
    message = convert.report_msg(report)
    assert message.objective == 1.0
    assert message.verification_names == ['x_e', 'alpha']
    assert list(message.verification_errors) == pytest.approx([0.5, math.pi])
    assert convert.report_from_msg(message, ResultCode.SUCCESS) == report


def test_attitude_survives_both_ways() -> None:
    q_eb = frames.quaternion_from_euler(0.1, 0.2, 0.3)
    assert frames.ned_attitude_from_ros(frames.ros_attitude_from_ned(q_eb)) == pytest.approx(q_eb)


def test_a_noisy_fix_is_off_and_says_by_how_much() -> None:
    origin = GeodeticPoint(50.0, 10.0, 100.0)
    exact = convert.fix_of(motion(), NS, origin)
    noisy = convert.fix_of(motion(), NS, origin, (10.0, -20.0, 5.0), (1.0, 2.0, 3.0))
    assert exact.position_covariance_type == exact.COVARIANCE_TYPE_UNKNOWN
    assert noisy.position_covariance_type == noisy.COVARIANCE_TYPE_DIAGONAL_KNOWN
    # east, north, up
    assert list(noisy.position_covariance) == [4.0, 0, 0, 0, 1.0, 0, 0, 0, 9.0]
    # a degree of latitude is 111.2 km there, one of longitude 71.7 km
    assert (noisy.latitude - exact.latitude) * 111_229 == pytest.approx(10.0, abs=0.01)
    assert (noisy.longitude - exact.longitude) * 71_697 == pytest.approx(-20.0, abs=0.02)
    assert noisy.altitude - exact.altitude == pytest.approx(-5.0, abs=1e-3)


def test_a_noisy_imu_says_by_how_much() -> None:
    imu = convert.imu_msg(motion(), NS, (1.0, 2.0, 3.0), (0.5, 0.1))
    assert list(imu.linear_acceleration_covariance) == [0.25, 0, 0, 0, 0.25, 0, 0, 0, 0.25]
    assert list(imu.angular_velocity_covariance)[::4] == pytest.approx([0.01] * 3)


def test_an_event_has_its_kind_and_angles_in_radians() -> None:
    event = Event('limit_left', 2.5, 'alpha of 20 is beyond the limit', 'alpha', 20.0, 15.0)
    message = convert.event_msg(event, NS)
    assert message.kind == message.LIMIT_LEFT
    assert convert.nanoseconds(message.header.stamp) == NS
    assert (message.time, message.quantity) == (2.5, 'alpha')
    assert (message.value, message.limit) == pytest.approx((math.radians(20), math.radians(15)))


@pytest.mark.parametrize(
    'kind',
    [
        *('ground_contact', 'limit_left', 'limit_kept', 'controls_timed_out', 'plan_ended'),
        *('run_began', 'diverged', 'recording_ended'),
    ],
)
def test_every_kind_of_event_has_a_number(kind: str) -> None:
    assert convert.event_msg(Event(kind, 0.0, ''), NS).kind > 0
