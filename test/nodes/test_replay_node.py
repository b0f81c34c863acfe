"""The replay node as a process: plays a glider's flight and obeys like rosbag2's player."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from ros_support import DISCUS, command, need_ros

need_ros()

from builtin_interfaces.msg import Time  # noqa: E402
from nav_msgs.msg import Odometry, Path  # noqa: E402
from rclpy.qos import QoSProfile  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402
from sensor_msgs.msg import NavSatFix  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

from flightdyn.nodes.base import LATCHED, SENSOR  # noqa: E402
from flightdyn.nodes.client import Session  # noqa: E402
from flightdyn.nodes.convert import nanoseconds, time_msg  # noqa: E402
from flightdyn.nodes.process import NodeProcess  # noqa: E402
from flightdyn_msgs.msg import VehicleState  # noqa: E402
from flightdyn_msgs.srv import Burst, GetRate, IsPaused, PlayNext, Seek, SetRate  # noqa: E402

EVERY = QoSProfile(depth=5000)  # a reader that loses nothing, however slow its thread
PIECE = {'log': str(DISCUS), 'end': 120.0}  # two minutes at 1 Hz


class Playback:
    """A replay process, paused at the start, and what it publishes."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.path = session.subscribe(Path, '/replay/path', LATCHED)
        self.clock = session.subscribe(Clock, '/clock', EVERY)
        self.state = session.subscribe(VehicleState, '/replay/state', EVERY)
        self.odom = session.subscribe(Odometry, '/odom', EVERY)
        self.fix = session.subscribe(NavSatFix, '/fix', SENSOR)

    def call(self, name: str, kind: Any = Trigger, **fields: Any) -> Any:
        return self.session.call(kind, f'/replay/{name}', kind.Request(**fields))

    def stamps(self) -> list[int]:
        return [nanoseconds(pose.header.stamp) for pose in self.path.wait()[0].poses]

    def seek(self, seconds: float) -> None:
        """Go to a time of the piece, paused and with empty inboxes."""
        self.call('pause')
        stamp = time_msg(self.stamps()[0] + round(seconds * 1e9))
        answer = self.call('seek', Seek, time=stamp)
        assert answer.success, answer.message
        for inbox in (self.state, self.odom, self.fix, self.clock):
            inbox.clear()


@pytest.fixture(scope='module')
def playback(ros: None, session: Session) -> Iterator[Playback]:
    with NodeProcess(
        'replay', command=command('replay', installed=True), paused=True, **PIECE
    ) as process:
        yield Playback(session)
        process.check()


def test_path_is_there_from_the_start(playback: Playback) -> None:
    path = playback.path.wait()[0]
    assert path.header.frame_id == 'map'
    assert len(path.poses) == 121
    assert np.diff(playback.stamps()).tolist() == [10**9] * 120


def test_play_next_and_burst_while_paused(playback: Playback) -> None:
    playback.seek(10.0)
    assert playback.call('play_next', PlayNext).success
    assert playback.call('burst', Burst, num_messages=3).actually_burst == 3
    states = playback.state.wait(lambda got: len(got) == 4)
    assert [state.time for state in states] == pytest.approx([10, 11, 12, 13])
    playback.odom.wait(lambda got: len(got) == 4)
    assert playback.call('is_paused', IsPaused).paused


def test_topics_agree_with_each_other(playback: Playback) -> None:
    playback.seek(60.0)
    playback.call('play_next', PlayNext)
    state, odom, fix = (box.wait()[0] for box in (playback.state, playback.odom, playback.fix))
    assert state.header.stamp == odom.header.stamp == fix.header.stamp
    position = odom.pose.pose.position
    assert (position.x, position.y, position.z) == (state.y_e, state.x_e, -state.z_e)
    pose = playback.path.wait()[0].poses[60].pose
    assert pose.position == position
    assert 20 < state.speed < 60  # a Discus 2 glider, m/s
    assert odom.twist.twist.linear.x == pytest.approx(state.speed, rel=1e-2)
    assert odom.pose.covariance[0] > 0
    assert 40 < fix.latitude < 60
    assert state.state_names == ['x_e', 'y_e', 'z_e', 'speed', 'gamma', 'track']
    assert not state.model
    assert np.linalg.norm(state.q_eb) == pytest.approx(1)


def test_rate_and_monotone_clock(playback: Playback) -> None:
    playback.seek(0.0)
    assert playback.call('set_rate', SetRate, rate=40.0).success
    assert playback.call('get_rate', GetRate).rate == 40.0
    assert playback.call('resume').success
    assert not playback.call('is_paused', IsPaused).paused
    states = playback.state.wait(lambda got: len(got) >= 20)
    assert playback.call('toggle_paused').message == 'paused'
    assert [state.time for state in states] == pytest.approx(range(len(states)))
    clocks = [nanoseconds(message.clock) for message in playback.clock.messages]
    assert np.diff(clocks).min() >= 0
    assert max(clocks) >= nanoseconds(states[-1].header.stamp)
    refused = playback.call('set_rate', SetRate, rate=-1.0)
    assert not refused.success
    assert 'rate' in refused.message
    assert playback.call('get_rate', GetRate).rate == 40.0


def test_seek_back_sends_the_path_again(playback: Playback) -> None:
    playback.seek(100.0)
    before = len(playback.path.messages)
    playback.seek(5.0)
    playback.path.wait(lambda got: len(got) > before)
    playback.call('play_next', PlayNext)
    assert playback.state.wait()[0].time == pytest.approx(5.0)


def test_seek_outside_is_refused_with_the_range(playback: Playback) -> None:
    answer = playback.call('seek', Seek, time=Time(sec=5))
    assert not answer.success
    assert 'outside the log' in answer.message


def test_burst_of_all_and_stop(playback: Playback) -> None:
    playback.seek(100.0)
    assert playback.call('burst', Burst).actually_burst == 21
    assert not playback.call('play_next', PlayNext).success
    playback.seek(0.0)
    assert playback.call('stop').success
    assert not playback.call('play_next', PlayNext).success
    playback.seek(1.0)  # undoes it
    assert playback.call('play_next', PlayNext).success


def test_ends_by_itself_when_asked_to(ros: None, session: Session) -> None:
    parameters = {**PIECE, 'end': 30, 'exit_at_end': True, 'paused': True, 'rate': 30}
    with NodeProcess('replay', namespace='/e', **parameters) as process:
        states = session.subscribe(VehicleState, '/e/replay/state', EVERY)
        session.call(Trigger, '/e/replay/resume')
        states.wait(lambda got: len(got) == 31)
        assert process.process.wait(5) == 0


def test_loop_starts_again(ros: None, session: Session) -> None:
    parameters = {**PIECE, 'end': 5.0, 'loop': True, 'rate': 20.0}
    with NodeProcess('replay', namespace='/l', **parameters):
        states = session.subscribe(VehicleState, '/l/replay/state', EVERY)
        states.wait(lambda got: sum(state.time == 0.0 for state in got) >= 2)
