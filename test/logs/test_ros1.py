"""ROS 1 messages in MCAP: packed fields, as a converted bag has them."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from log_making import START_NS, Message
from numpy.testing import assert_allclose, assert_array_equal
from rosbags.typesys import Stores, get_typestore

from flightdyn.logs import list_sources, read_track

Write = Callable[..., Path]
DATA = Path(__file__).parents[1] / 'data'
STORE = get_typestore(Stores.ROS1_NOETIC)
FIX = 'sensor_msgs/msg/NavSatFix'
ODOMETRY = 'nav_msgs/msg/Odometry'
ROS1: dict[str, Any] = {'encoding': 'ros1', 'schema_encoding': 'ros1msg'}


def header(ns: int, frame: str) -> Any:
    time = STORE.types['builtin_interfaces/msg/Time'](ns // 10**9, ns % 10**9)
    return STORE.types['std_msgs/msg/Header'](7, time, frame)


def fix(ns: int, i: int, frame: str = 'gps', status: int = 0) -> bytes:
    message = STORE.types[FIX](
        header(ns, frame),
        STORE.types['sensor_msgs/msg/NavSatStatus'](status, 1),
        48 + 1e-4 * i,
        9.0,
        500.0 + i,
        np.diag([4.0, 9.0, 25.0]).ravel(),
        2,
    )
    return bytes(STORE.serialize_ros1(message, FIX))


def texts(*types: str) -> dict[str, bytes]:
    return {
        t.replace('/msg/', '/'): STORE.generate_msgdef(t, ros_version=1)[0].encode() for t in types
    }


def fixes(**options: Any) -> list[Message]:
    times = [START_NS + i * 10**9 for i in range(12)]
    return [('/fix', ns + 5, fix(ns, i, **options)) for i, ns in enumerate(times)]


def test_fixes_are_read(write_log: Write) -> None:
    # Frames of different lengths put what follows at odd places.
    messages = [
        ('/fix', ns, fix(ns - 5, i, frame='g' * (i % 5), status=-(i == 3)))
        for i, (_, ns, _) in enumerate(fixes())
    ]
    messages[5] = ('/fix', messages[5][1], messages[5][2][:60])
    path = write_log(messages, {'/fix': 'sensor_msgs/NavSatFix'}, texts=texts(FIX), **ROS1)
    track = read_track(path)
    kept = np.delete(np.arange(12), [3, 5])
    assert track.dropped == {'no fix': 1, 'shorter than its schema': 1}
    assert_array_equal(track.time_ns, START_NS + kept * 10**9)
    assert_allclose(track.lat, 48 + 1e-4 * kept, rtol=0, atol=0)
    assert_array_equal(track.position_std, np.tile([3.0, 2.0, 5.0], (10, 1)))


def test_schema_without_text_has_the_header_of_ros_1(write_log: Write) -> None:
    types = {'/fix': 'sensor_msgs/NavSatFix'}
    path = write_log(fixes(), types, texts={'sensor_msgs/NavSatFix': b''}, **ROS1)
    track = read_track(path)
    assert len(track) == 12
    assert 'the standard definition was used' in track.warnings[0]


def test_odometry_with_two_strings_is_read(write_log: Write) -> None:
    types = STORE.types
    messages = []
    for i in range(12):
        ns = START_NS + i * 10**9
        message = types[ODOMETRY](
            header(ns, 'odom'),
            'odom',
            types['geometry_msgs/msg/PoseWithCovariance'](
                types['geometry_msgs/msg/Pose'](
                    types['geometry_msgs/msg/Point'](1.0 * i, 2.0 * i, 3.0 * i),
                    types['geometry_msgs/msg/Quaternion'](0.0, 0.0, 0.0, 1.0),
                ),
                np.zeros(36),
            ),
            types['geometry_msgs/msg/TwistWithCovariance'](
                types['geometry_msgs/msg/Twist'](
                    types['geometry_msgs/msg/Vector3'](1.0, 2.0, 3.0),
                    types['geometry_msgs/msg/Vector3'](0.0, 0.0, 0.0),
                ),
                np.zeros(36),
            ),
        )
        messages.append(('/odom', ns, bytes(STORE.serialize_ros1(message, ODOMETRY))))
    path = write_log(messages, {'/odom': 'nav_msgs/Odometry'}, texts=texts(ODOMETRY), **ROS1)
    track = read_track(path)
    i = np.arange(12.0)
    assert_allclose(track.position_ned, np.stack((2 * i, i, -3 * i), 1))
    assert_allclose(track.velocity_ned, np.tile([2.0, 1.0, -3.0], (12, 1)))


def test_a_real_flight_is_the_same_in_ros_1_and_2() -> None:
    old, new = (read_track(DATA / f'px4_zurich_{kind}.mcap') for kind in ('ros1', 'navsatfix'))
    truth = np.load(DATA / 'px4_zurich.truth.npz')
    for track in (old, new):
        assert_allclose(track.lat, truth['lat'], rtol=0, atol=1e-9)
        assert_allclose(track.altitude, truth['alt'], rtol=0, atol=1e-6)
        velocity = np.stack([truth[name] for name in ('vn', 've', 'vd')], axis=1)
        assert_allclose(track.velocity_ned, velocity, rtol=0, atol=1e-6)
    assert old.warnings == ['velocity is that of /gps/vel']
    assert new.warnings == ['velocity is that of /gps/fix_velocity']
    note = list_sources(DATA / 'px4_zurich_ros1.mcap')[1].note
    assert note == 'a velocity: used with a fix beside it that agrees'
