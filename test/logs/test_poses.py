"""Poses: local and on earth, their frames, their velocity from beside, and what is only wanted."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_making import START_NS, STORE, Message, fixes, stamp
from numpy.testing import assert_allclose, assert_array_equal
from test_companions import TWIST, twist

from flightdyn.logs import list_sources, read_track

Write = Callable[..., Path]
FIX = 'sensor_msgs/msg/NavSatFix'
POSE = 'geometry_msgs/msg/PoseStamped'
GEO = 'geographic_msgs/msg/GeoPoseStamped'
GEO_TEXT = """
std_msgs/Header header
geographic_msgs/GeoPose pose
================================================================================
MSG: geographic_msgs/GeoPose
geographic_msgs/GeoPoint position
geometry_msgs/Quaternion orientation
================================================================================
MSG: geographic_msgs/GeoPoint
float64 latitude
float64 longitude
float64 altitude
================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
"""
# Nose east in ENU of FLU is no rotation at all; in NED it is a yaw of 90 degrees.
EAST_ROS, EAST_NED = (0.0, 0.0, 0.0, 1.0), (np.sqrt(0.5), 0, 0, np.sqrt(0.5))


def pose(i: int, position: Any, orientation: Any = EAST_ROS, frame: str = 'map') -> bytes:
    types = STORE.types
    message = types[POSE](
        stamp(START_NS + i * 10**9, frame),
        types['geometry_msgs/msg/Pose'](
            types['geometry_msgs/msg/Point'](*position),
            types['geometry_msgs/msg/Quaternion'](*orientation),
        ),
    )
    return bytes(STORE.serialize_cdr(message, POSE))


def poses(topic: str = '/mavros/local_position/pose', **options: Any) -> list[Message]:
    """1 m/s east, 2 north, 3 up."""
    return [
        (topic, START_NS + i * 10**9, pose(i, (i, 2.0 * i, 3.0 * i), **options)) for i in range(20)
    ]


@pytest.mark.parametrize(
    ('frame', 'position', 'attitude'),
    [
        ('map', [2, 1, -3], EAST_NED),
        ('map_ned', [1, 2, 3], (1, 0, 0, 0)),
    ],
)
def test_axes_are_those_of_the_frame(
    write_log: Write, frame: str, position: Any, attitude: Any
) -> None:
    track = read_track(write_log(poses('/pose', frame=frame), {'/pose': POSE}))
    assert_array_equal(track.position_ned, np.arange(20)[:, None] * np.array(position))
    assert track.attitude is not None
    sign = np.sign(track.attitude[:, :1])
    assert_allclose(track.attitude * sign, np.tile(attitude, (20, 1)), atol=1e-15)
    assert (track.altitude_datum, track.velocity_ned) == ('local', None)


def test_velocity_is_that_of_the_topic_beside_it(write_log: Write) -> None:
    topic, beside = '/mavros/local_position/pose', '/mavros/local_position/velocity_local'
    velocities = [
        (beside, START_NS + i * 10**9, twist(START_NS + i * 10**9, (1.0, 2.0, 3.0)))
        for i in range(20)
    ]
    track = read_track(write_log(poses(topic) + velocities, {topic: POSE, beside: TWIST}))
    assert_allclose(track.velocity_ned, np.tile([2, 1, -3], (20, 1)))
    assert track.warnings == [f'velocity is that of {beside}']


@pytest.mark.parametrize('nothing', [(0.0, 0.0, 0.0, 0.0), (np.nan, 0.0, 0.0, 1.0)])
def test_an_orientation_that_nobody_filled_is_none(write_log: Write, nothing: Any) -> None:
    track = read_track(write_log(poses('/pose', orientation=nothing), {'/pose': POSE}))
    assert track.attitude is None


def test_another_frame_is_dropped(write_log: Write) -> None:
    messages = poses('/pose')
    messages[7] = ('/pose', START_NS + 7 * 10**9, pose(7, (0, 0, 0), frame='base'))
    track = read_track(write_log(messages, {'/pose': POSE}))
    assert track.dropped == {'another frame': 1}
    assert 'frames change' in track.warnings[0]


def test_a_pose_comes_after_a_fix_and_a_set_point_after_all(write_log: Write) -> None:
    wanted = '/mavros/setpoint_position/local'
    messages = poses() + poses(wanted) + poses(wanted, frame='odom') + fixes(9)
    types = {'/mavros/local_position/pose': POSE, wanted: POSE, '/fix': FIX}
    assert [s.topic for s in list_sources(write_log(messages, types))] == [
        '/fix',
        '/mavros/local_position/pose',
        wanted,
    ]


@pytest.mark.parametrize(
    ('topic', 'datum'), [('/geopose', 'ellipsoid'), ('/uav1/ap/geopose/filtered', 'msl')]
)
def test_a_pose_on_earth(write_log: Write, topic: str, datum: str) -> None:
    data = []
    for i in range(9):
        numbers = (48 + 1e-4 * i, 9.25, 500.0 + i, *EAST_ROS)
        head = pose(i, (0, 0, 0))
        body = np.array(numbers, '<f8').tobytes()
        data.append((topic, START_NS + i * 10**9, head[: -len(body)] + body))
    path = write_log(data, {topic: GEO}, texts={GEO: GEO_TEXT.encode()})
    track = read_track(path)
    assert_array_equal(track.lat, 48 + 1e-4 * np.arange(9))
    assert_array_equal(track.altitude, 500 + np.arange(9))
    assert track.attitude is not None
    assert_allclose(np.abs(track.attitude), np.tile(EAST_NED, (9, 1)), atol=1e-15)
    assert track.altitude_datum == datum
    assert list_sources(path)[0].kind == 'global'
