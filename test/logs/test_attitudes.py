"""Attitude beside positions: which topic, at which time, in which axes, when it is none."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_making import START_NS, STORE, Message, stamp
from numpy.testing import assert_allclose
from test_companions import FIX, RATE, fixes

from flightdyn import frames
from flightdyn.logs import list_sources, read_track

Write = Callable[..., Path]
IMU = 'sensor_msgs/msg/Imu'
PX4 = 'px4_msgs/msg/VehicleAttitude'
PX4_TEXT = b'uint64 timestamp\nuint64 timestamp_sample\nfloat32[4] q\nuint8 quat_reset_counter\n'
PHI, THETA = 0.4, -0.1  # rad; the turn of test_companions is to the right


def euler(t: float) -> tuple[float, float, float]:
    """Roll, pitch and yaw of the turn, which begins northwards."""
    return PHI, THETA, (RATE * t + np.pi) % (2 * np.pi) - np.pi


def quaternion(t: float, *, backwards: bool = False) -> np.ndarray:
    phi, theta, psi = euler(t)
    return np.array(frames.quaternion_from_euler(phi, theta, psi + np.pi * backwards))


def imu(t: float, orientation: Any = None, unknown: bool = False, **options: Any) -> bytes:
    types = STORE.types
    if orientation is None:
        # by hand: yaw of ROS is pi/2 - psi, its pitch is down positive, its roll is the same
        phi, theta, psi = euler(t)
        half = (
            np.array([phi, -theta, np.pi / 2 - psi + np.pi * options.get('backwards', False)]) / 2
        )
        (cr, cp, cy), (sr, sp, sy) = np.cos(half), np.sin(half)
        orientation = (
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        )
    covariance = np.zeros(9)
    covariance[0] = -1.0 if unknown else 0.0
    vector = types['geometry_msgs/msg/Vector3'](0.0, 0.0, 0.0)
    message = types[IMU](
        stamp(START_NS + round(t * 1e9), 'base_link'),
        types['geometry_msgs/msg/Quaternion'](*orientation),
        covariance,
        vector,
        np.zeros(9),
        vector,
        np.zeros(9),
    )
    return bytes(STORE.serialize_cdr(message, IMU))


def imus(topic: str = '/gps/imu', number: int = 200, **options: Any) -> list[Message]:
    times = 0.1 * np.arange(number) - 0.03
    return [(topic, START_NS + round(t * 1e9), imu(t, **options)) for t in times]


def assert_attitude(attitude: Any, t: Any) -> None:
    """Compare with the turn; interpolation over 0.1 s is right to RATE^2 0.1^2 / 8 rad."""
    got = np.array(frames.euler_from_rotation(frames.rotation_from_quaternion(tuple(attitude.T))))
    wanted = np.array([euler(each) for each in t]).T
    difference = (got - wanted + np.pi) % (2 * np.pi) - np.pi
    assert_allclose(difference, 0, atol=5e-4)


def test_an_imu_beside_a_fix_gives_the_attitude(write_log: Write) -> None:
    path = write_log(fixes() + imus(), {'/gps/fix': FIX, '/gps/imu': IMU})
    track = read_track(path)
    assert track.warnings == ['attitude is that of /gps/imu']
    assert_attitude(track.attitude, 0.5 * np.arange(40))
    (imu_source,) = [s for s in list_sources(path) if s.topic == '/gps/imu']
    assert imu_source.note == 'an attitude: used with positions beside it'


def test_px4_attitude_is_turned_by_nobody(write_log: Write) -> None:
    topic = '/gps/vehicle_attitude'
    messages = []
    for i in range(200):
        t = 0.1 * i - 0.03
        body = np.array([i, i], '<u8').tobytes() + quaternion(t).astype('<f4').tobytes() + b'\0'
        messages.append((topic, START_NS + round(t * 1e9), b'\0\1\0\0' + body))
    path = write_log(fixes() + messages, {'/gps/fix': FIX, topic: PX4}, texts={PX4: PX4_TEXT})
    track = read_track(path)
    assert track.warnings == [f'attitude is that of {topic}']
    assert_attitude(track.attitude, 0.5 * np.arange(40))


@pytest.mark.parametrize(
    'options',
    [
        {'orientation': (0.0, 0.0, 0.0, 1.0)},  # never filled
        {'orientation': (0.0, 0.0, 0.0, 0.0)},
        {'unknown': True},  # as the message defines it
        {'number': 60},  # for a small part of the flight
        {'topic': '/other/imu'},
        {'topic': '/gps/setpoint/imu'},
    ],
)
def test_what_is_no_attitude_of_the_vehicle_is_left_out(write_log: Write, options: Any) -> None:
    topic = options.get('topic', '/gps/imu')
    track = read_track(write_log(fixes() + imus(**options), {'/gps/fix': FIX, topic: IMU}))
    assert (track.attitude, track.warnings) == (None, [])


def test_a_nose_that_points_backwards_is_not_believed(write_log: Write) -> None:
    path = write_log(fixes() + imus(backwards=True), {'/gps/fix': FIX, '/gps/imu': IMU})
    track = read_track(path)
    assert track.attitude is None
    assert track.warnings == ['/gps/imu is not used as attitude: it points backwards in flight']


def test_attitude_is_not_interpolated_across_a_gap(write_log: Write) -> None:
    kept = [m for m in imus() if not 5e9 < m[1] - START_NS < 9e9]
    track = read_track(write_log(fixes() + kept, {'/gps/fix': FIX, '/gps/imu': IMU}))
    assert track.attitude is not None
    known = np.isfinite(track.attitude).all(axis=1)
    t = np.arange(40) * 0.5
    assert not known[(t > 5.1) & (t < 8.9)].any()
    assert known[(t <= 5) | (t >= 9)].all()
    inside = (t < 4.9) | (t > 9.1)  # at the edges of the gap the nearest one counts
    assert_attitude(track.attitude[inside], t[inside])
    assert track.warnings == [f'attitude is that of /gps/imu, for {known.sum()} of 40 samples']


def test_the_short_way_is_taken_between_two_signs(write_log: Write) -> None:
    messages = []
    for i, (topic, ns, _) in enumerate(imus()):
        t = 0.1 * i - 0.03
        w, x, y, z = frames.ros_attitude_from_ned(tuple(quaternion(t) * (-1) ** i))
        messages.append((topic, ns, imu(t, orientation=(x, y, z, w))))
    track = read_track(write_log(fixes() + messages, {'/gps/fix': FIX, '/gps/imu': IMU}))
    assert_attitude(track.attitude, 0.5 * np.arange(40))
