"""Velocity beside a fix: which topic, at which time, in which axes, when it is believed."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_making import START_NS, STORE, Message, nav_sat_fix, stamp
from numpy.testing import assert_allclose
from test_sources import ODOMETRY, odometry

from flightdyn.logs import read_track

Write = Callable[..., Path]
FIX = 'sensor_msgs/msg/NavSatFix'
TWIST = 'geometry_msgs/msg/TwistStamped'
COVARIANCE = 'geometry_msgs/msg/TwistWithCovarianceStamped'

SPEED, RATE, CLIMB = 12.0, 0.2, 2.0  # a climbing turn: m/s, rad/s, m/s
METRES_PER_DEGREE = 111_200.0  # at 48 N, to 0.1 %


def moment(t: float) -> tuple[np.ndarray, np.ndarray]:
    """Position east, north, up [m] and velocity of the turn."""
    radius, angle = SPEED / RATE, RATE * t
    position = np.array([radius * (1 - np.cos(angle)), radius * np.sin(angle), CLIMB * t])
    return position, np.array([SPEED * np.sin(angle), SPEED * np.cos(angle), CLIMB])


def fixes(topic: str = '/gps/fix', number: int = 40, **options: Any) -> list[Message]:
    messages = []
    for i in range(number):
        (east, north, up), _ = moment(0.5 * i)
        lat = 48 + north / METRES_PER_DEGREE
        lon = 9 + east / (METRES_PER_DEGREE * np.cos(np.radians(48)) * 1.0037)
        ns = START_NS + i * 500_000_000
        messages.append((topic, ns, nav_sat_fix(ns, lat, lon, 500 + up, **options)))
    return messages


def twist(ns: int, linear: Any) -> bytes:
    message = STORE.types[TWIST](stamp(ns, 'base_link'), _twist(linear))
    return bytes(STORE.serialize_cdr(message, TWIST))


def _twist(linear: Any) -> Any:
    vector = STORE.types['geometry_msgs/msg/Vector3']
    return STORE.types['geometry_msgs/msg/Twist'](vector(*linear), vector(0.0, 0.0, 0.0))


def velocities(
    topic: str = '/gps/vel', scale: Any = (1, 1, 1), step: float = 0.1, shift: float = 0.03
) -> list[Message]:
    """Faster than the fixes and at other times."""
    messages = []
    for i in range(round(20 / step)):
        t = i * step + shift
        ns = START_NS + round(t * 1e9)
        messages.append((topic, ns, twist(ns, moment(t)[1] * scale)))
    return messages


def expected(number: int) -> np.ndarray:
    return np.array([moment(0.5 * i)[1][[1, 0, 2]] * (1, 1, -1) for i in range(number)])


def test_velocity_is_interpolated_at_the_fixes(write_log: Write) -> None:
    path = write_log(fixes() + velocities(), {'/gps/fix': FIX, '/gps/vel': TWIST})
    track = read_track(path)
    assert track.warnings == ['velocity is that of /gps/vel']
    assert track.velocity_ned is not None
    # acceleration of the turn: SPEED RATE^2 step^2 / 8 within a step; none before the first sample
    assert_allclose(track.velocity_ned[1:], expected(40)[1:], rtol=0, atol=1e-3)


def test_a_velocity_at_the_same_times_needs_no_neighbours(write_log: Write) -> None:
    messages = velocities(step=0.5, shift=0.0)
    path = write_log(fixes() + messages, {'/gps/fix': FIX, '/gps/vel': TWIST})
    assert_allclose(read_track(path).velocity_ned, expected(40), rtol=0, atol=1e-9)


def test_velocity_is_not_interpolated_across_a_gap(write_log: Write) -> None:
    kept = [m for m in velocities() if not 5e9 < m[1] - START_NS < 9e9]
    path = write_log(fixes() + kept, {'/gps/fix': FIX, '/gps/vel': TWIST})
    velocity = read_track(path).velocity_ned
    assert velocity is not None
    t = np.arange(40) * 0.5
    assert np.isnan(velocity[(t > 5.1) & (t < 8.9)]).all()
    assert np.isfinite(velocity[(t < 5) | (t > 9.1)]).all()


@pytest.mark.parametrize(
    ('scale', 'text'),
    [
        ((1, 1, 0), 'has no vertical part'),  # as mavros gives the receiver's
        ((-1, 1, 1), 'contradicts its positions'),
        ((3, 3, 3), 'contradicts its positions'),
        ((0, 0, 0), 'contradicts its positions'),
    ],
)
def test_a_velocity_that_disagrees_is_left_out(write_log: Write, scale: Any, text: str) -> None:
    path = write_log(fixes() + velocities(scale=scale), {'/gps/fix': FIX, '/gps/vel': TWIST})
    track = read_track(path)
    assert track.velocity_ned is None
    (warning,) = track.warnings
    assert warning.startswith('/gps/vel is not used as velocity')
    assert text in warning


def test_a_vertical_part_counted_downwards_is_turned_round(write_log: Write) -> None:
    path = write_log(fixes() + velocities(scale=(1, 1, -1)), {'/gps/fix': FIX, '/gps/vel': TWIST})
    track = read_track(path)
    assert track.velocity_ned is not None
    assert_allclose(track.velocity_ned[1:], expected(40)[1:], rtol=0, atol=1e-3)
    assert 'its vertical part counted downwards' in track.warnings[0]


def test_the_twist_of_mavros_is_over_the_ground_with_z_down(write_log: Write) -> None:
    messages = []
    for i in range(40):
        ns = START_NS + i * 500_000_000
        position, velocity = moment(0.5 * i)
        quaternion = (0.0, 0.0, np.sin(0.3), np.cos(0.3))  # some heading
        data = odometry(ns, tuple(position), quaternion, tuple(velocity * (1, 1, -1)))
        messages.append(('/mavros/global_position/local', ns, data))
    fix = '/mavros/global_position/global'
    path = write_log(fixes(fix) + messages, {fix: FIX, '/mavros/global_position/local': ODOMETRY})
    track = read_track(path)
    assert track.source == fix
    assert_allclose(track.velocity_ned, expected(40), rtol=0, atol=1e-9)
    assert 'counted downwards' in track.warnings[-1]


def test_the_nearest_name_space_comes_first(write_log: Write) -> None:
    fix = '/uav/mavros/global_position/raw/fix'
    far, near = '/uav/mavros/local_position/velocity_local', '/uav/mavros/global_position/raw/vel'
    messages = fixes(fix) + velocities(far) + velocities(near, step=0.25)
    assert read_track(write_log(messages, {fix: FIX, far: TWIST, near: TWIST})).warnings == [
        f'velocity is that of {near}'
    ]
    messages = fixes(fix) + velocities(far) + velocities(near, scale=(1, 1, 0))
    path = write_log(messages, {fix: FIX, far: TWIST, near: TWIST}, name='raw.mcap')
    assert read_track(path).warnings == [
        f'{near} is not used as velocity: it has no vertical part',
        f'velocity is that of {far}',
    ]


@pytest.mark.parametrize(
    'topic', ['/other/vel', '/vel', '/gps/cmd_vel', '/gps/setpoint_velocity/cmd']
)
def test_other_vehicles_and_set_points_are_not_asked(write_log: Write, topic: str) -> None:
    track = read_track(write_log(fixes() + velocities(topic), {'/gps/fix': FIX, topic: TWIST}))
    assert (track.velocity_ned, track.warnings) == (None, [])


def test_topics_in_no_name_space_belong_together(write_log: Write) -> None:
    path = write_log(fixes('/fix') + velocities('/vel'), {'/fix': FIX, '/vel': TWIST})
    assert read_track(path).velocity_ned is not None


def test_a_velocity_for_a_small_part_is_none(write_log: Write) -> None:
    part = [m for m in velocities() if m[1] - START_NS < 6e9]
    track = read_track(write_log(fixes() + part, {'/gps/fix': FIX, '/gps/vel': TWIST}))
    assert track.velocity_ned is None


def test_recorded_times_are_compared_where_stamps_are_not_set(write_log: Write) -> None:
    unset = [
        (t, ns, nav_sat_fix(0, 48 + moment((ns - START_NS) * 1e-9)[0][1] / METRES_PER_DEGREE))
        for t, ns, _ in fixes()
    ]
    shifted = [
        ('/gps/vel', ns, twist(ns + 10**15, moment((ns - START_NS) * 1e-9)[1] * (0, 1, 0)))
        for _, ns, _ in velocities()
    ]
    track = read_track(write_log(unset + shifted, {'/gps/fix': FIX, '/gps/vel': TWIST}))
    assert track.warnings[-1] == 'velocity is that of /gps/vel'
    assert track.velocity_ned is not None
    assert_allclose(track.velocity_ned[1:, 0], expected(40)[1:, 0], rtol=0, atol=1e-3)


def test_a_twist_with_covariance_serves_too(write_log: Write) -> None:
    types = STORE.types
    messages = []
    for i in range(40):
        ns = START_NS + i * 500_000_000
        inner = types['geometry_msgs/msg/TwistWithCovariance'](
            _twist(moment(0.5 * i)[1]), np.zeros(36)
        )
        data = STORE.serialize_cdr(types[COVARIANCE](stamp(ns), inner), COVARIANCE)
        messages.append(('/gps/fix_velocity', ns, bytes(data)))
    path = write_log(fixes() + messages, {'/gps/fix': FIX, '/gps/fix_velocity': COVARIANCE})
    assert_allclose(read_track(path).velocity_ned, expected(40), rtol=0, atol=1e-9)


def test_level_flight_needs_no_vertical_part(write_log: Write) -> None:
    level = [
        (t, ns, nav_sat_fix(ns, 48 + 20 * i / METRES_PER_DEGREE, 9.0, 500 + 0.1 * (-1) ** i))
        for i, (t, ns, _) in enumerate(fixes(number=20))
    ]
    moving = [(m[0], m[1], twist(m[1], (0.0, 40.0, 0.0))) for m in velocities()]
    track = read_track(write_log(level + moving, {'/gps/fix': FIX, '/gps/vel': TWIST}))
    assert track.velocity_ned is not None
