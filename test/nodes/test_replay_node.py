"""The replay node as a process: plays a glider's flight and obeys like rosbag2's player."""

import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pytest
from ros_support import DISCUS, command, need_ros

need_ros()

from builtin_interfaces.msg import Duration, Time  # noqa: E402
from lifecycle_msgs.msg import Transition  # noqa: E402
from lifecycle_msgs.srv import ChangeState  # noqa: E402
from mcap.writer import Writer  # noqa: E402
from nav_msgs.msg import Odometry, Path  # noqa: E402
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue  # noqa: E402
from rcl_interfaces.srv import SetParameters  # noqa: E402
from rclpy.qos import QoSProfile  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402
from sensor_msgs.msg import NavSatFix  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

from flightdyn.logs.messages import (  # noqa: E402
    NAV_SAT_FIX,
    fix_messages,
    schema_text,
    serialize,
)
from flightdyn.nodes.base import LATCHED, SENSOR  # noqa: E402
from flightdyn.nodes.client import Session  # noqa: E402
from flightdyn.nodes.convert import nanoseconds, time_msg  # noqa: E402
from flightdyn.nodes.process import NodeProcess  # noqa: E402
from flightdyn.replay import replay_log  # noqa: E402
from flightdyn.trajectory import Trajectory  # noqa: E402
from flightdyn_msgs.msg import PlayProgress, VehicleState  # noqa: E402
from flightdyn_msgs.srv import (  # noqa: E402
    Burst,
    GetRate,
    IsPaused,
    Load,
    Play,
    PlayNext,
    Seek,
    SeekTo,
    SetRate,
)

DEGREE = 111_200.0  # m, about; only to make positions
EVERY = QoSProfile(depth=5000)  # a reader that loses nothing, however slow its thread
PIECE = {'log': str(DISCUS), 'end': 120.0}  # two minutes at 1 Hz


def write_fixes(path: FilePath, number: int, rate: float) -> None:
    """Write a log of noisy fixes of a vehicle that turns slowly left and right at 30 m/s."""
    t = np.arange(number) / rate
    heading = np.cumsum(0.1 * np.sin(t / 300) + 0.02 * np.sin(t / 37)) / rate
    north, east = (30 * np.cumsum(f(heading)) / rate for f in (np.cos, np.sin))
    noise = np.random.default_rng(0).normal(0, 1, (number, 3))
    template = next(
        fix_messages(
            Trajectory(time=np.zeros(1), states={}), *(np.full(1, v) for v in (1.5, 2.5, 3.5))
        )
    )
    data = bytearray(serialize(NAV_SAT_FIX, template))
    at = [data.find(struct.pack('<d', value)) for value in (1.5, 2.5, 3.5)]
    lat = 47 + (north + noise[:, 0]) / DEGREE
    lon = 8 + (east + noise[:, 1]) / DEGREE / np.cos(np.radians(47))
    altitude = 1000 + 100 * np.sin(t / 100) + noise[:, 2]
    with path.open('wb') as file:
        writer = Writer(file)  # in chunks of 1 MB, as recorders write them
        writer.start(profile='ros2')
        definition = schema_text(NAV_SAT_FIX).encode()
        schema = writer.register_schema(NAV_SAT_FIX, 'ros2msg', definition)
        channel = writer.register_channel('/fix', 'cdr', schema)
        for i, values in enumerate(np.stack((lat, lon, altitude), axis=1).tolist()):
            ns = 1_700_000_000 * 10**9 + round(t[i] * 1e9)
            struct.pack_into('<iI', data, 4, ns // 10**9, ns % 10**9)
            for place, value in zip(at, values, strict=True):
                struct.pack_into('<d', data, place, value)
            writer.add_message(channel, ns, bytes(data), ns)
        writer.finish()


class Playback:
    """A replay process, paused at the start, and what it publishes."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.path = session.subscribe(Path, '/replay/path', LATCHED)
        self.clock = session.subscribe(Clock, '/clock', EVERY)
        self.state = session.subscribe(VehicleState, '/replay/state', EVERY)
        self.odom = session.subscribe(Odometry, '/odom', EVERY)
        self.fix = session.subscribe(NavSatFix, '/fix', SENSOR)
        self.progress = session.subscribe(PlayProgress, '/replay/progress', LATCHED)

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
        for inbox in (self.state, self.odom, self.fix, self.clock, self.progress):
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
    refused = playback.call('set_rate', SetRate, rate=0.0)
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


def test_backwards_visits_the_same_samples_and_the_clock_goes_back(playback: Playback) -> None:
    playback.seek(50.0)
    assert playback.call('set_rate', SetRate, rate=-40.0).success
    playback.call('resume')
    states = playback.state.wait(lambda got: len(got) >= 20)
    playback.call('pause')
    assert [state.time for state in states] == pytest.approx(50.0 - np.arange(len(states)))
    clocks = [nanoseconds(message.clock) for message in playback.clock.messages]
    assert np.diff(clocks).max() <= 0
    assert playback.call('set_rate', SetRate, rate=40.0).success


def test_stepping_back(playback: Playback) -> None:
    playback.seek(20.0)
    playback.call('burst', Burst, num_messages=3)
    assert playback.call('play_previous', PlayNext).success
    assert playback.call('play_previous', PlayNext).success
    states = playback.state.wait(lambda got: len(got) == 5)
    assert [state.time for state in states] == pytest.approx([20, 21, 22, 21, 20])


def test_seek_by_name_utc_and_seconds(playback: Playback) -> None:
    playback.seek(0.0)
    began = playback.stamps()[0]
    utc = np.datetime_as_string(np.datetime64(began + 25 * 10**9, 'ns'))
    for said, expected in (('30', 30.0), ('+5', 35.0), (f'{utc}Z', 25.0), ('end-20', 100.0)):
        answer = playback.call('seek_to', SeekTo, moment=said)
        assert answer.success, answer.message
        assert answer.time == pytest.approx(expected)
        progress = playback.progress.wait(lambda got: got and got[-1].time == got[-1].time)[-1]
        playback.progress.wait(lambda got, t=expected: got[-1].time == pytest.approx(t))
        assert progress.duration == pytest.approx(120.0)
    refused = playback.call('seek_to', SeekTo, moment='landing 3')
    assert not refused.success
    assert 'there is no landing 3' in refused.message


def test_progress_tells_where_it_is(playback: Playback) -> None:
    playback.seek(30.0)
    progress = playback.progress.wait(lambda got: got and got[-1].fraction == 0.25)[-1]
    assert progress.time == 30.0
    assert nanoseconds(progress.header.stamp) == playback.stamps()[30]
    assert progress.log == str(DISCUS)
    assert progress.paused
    assert progress.complete
    assert not progress.waiting


def test_play_for_a_while(playback: Playback) -> None:
    playback.seek(0.0)
    playback.call('set_rate', SetRate, rate=40.0)
    answer = playback.call(
        'play', Play, start_offset=Time(sec=10), playback_duration=Duration(sec=5)
    )
    assert answer.success, answer.message
    playback.progress.wait(lambda got: got[-1].finished)
    playback.state.wait(lambda got: len(got) == 6)
    assert [s.time for s in playback.state.messages] == pytest.approx(range(10, 16))
    beyond = playback.call('play', Play, start_offset=Time(sec=500))
    assert not beyond.success
    assert 'after the end of the log' in beyond.message
    playback.seek(0.0)
    playback.call('resume')
    again = playback.call('play', Play)
    assert not again.success
    assert 'playing already' in again.message
    playback.call('pause')


def test_load_another_log_below_the_root(playback: Playback) -> None:
    paths = len(playback.path.messages)
    playback.seek(60.0)
    answer = playback.call(
        'load', Load, log='px4_zurich_navsatfix.mcap', start_at='2', source='/fix'
    )
    assert not answer.success  # no such source: the log that was played goes on
    assert '/fix' in answer.message
    assert playback.progress.wait()[-1].log == str(DISCUS)
    answer = playback.call('load', Load, log='px4_zurich_navsatfix.mcap', start_at='2')
    assert answer.success, answer.message
    progress = playback.progress.wait(
        lambda got: got[-1].log.endswith('px4_zurich_navsatfix.mcap')
    )
    assert progress[-1].paused
    assert progress[-1].time == pytest.approx(2.0)
    playback.path.wait(lambda got: len(got) > paths)
    assert playback.call('play_next', PlayNext).success
    assert 45 < playback.fix.wait()[-1].latitude < 48  # Zurich
    for said, words in (
        ('/etc/passwd', 'is outside'),
        ('../../setup.py', 'is outside'),
        ('nope.mcap', 'there is no file'),
        ('SOURCE.md', 'SOURCE.md'),
        ('', 'not the name'),
    ):
        refused = playback.call('load', Load, log=said)
        assert not refused.success
        assert words in refused.message
    assert playback.call('load', Load, log=str(DISCUS)).success


def test_takes_another_log_when_configured_anew(ros: None, session: Session) -> None:
    other = DISCUS.with_name('px4_zurich_navsatfix.mcap')
    parameters = {**PIECE, 'autostart': False, 'clock_rate': 0.0, 'max_gap': 5.0, 'paused': True}
    with NodeProcess('replay', namespace='/w', **parameters) as process:

        def change(transition: int) -> None:
            request = ChangeState.Request(transition=Transition(id=transition))
            assert session.call(ChangeState, '/w/replay/change_state', request).success

        def set_log(log: str) -> Any:
            value = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=log)
            request = SetParameters.Request(parameters=[Parameter(name='log', value=value)])
            return session.call(SetParameters, '/w/replay/set_parameters', request).results[0]

        refused = session.call(Trigger, '/w/replay/resume')
        assert not refused.success
        assert 'ros2 lifecycle set /w/replay configure' in refused.message
        change(Transition.TRANSITION_CONFIGURE)
        change(Transition.TRANSITION_ACTIVATE)
        progress = session.subscribe(PlayProgress, '/w/replay/progress', LATCHED)
        assert progress.wait()[-1].log == str(DISCUS)
        assert not set_log(str(other)).successful
        change(Transition.TRANSITION_DEACTIVATE)
        change(Transition.TRANSITION_CLEANUP)
        assert set_log(str(other)).successful
        change(Transition.TRANSITION_CONFIGURE)
        change(Transition.TRANSITION_ACTIVATE)
        progress.wait(lambda got: got[-1].log == str(other))
        clocks = session.node.get_publishers_info_by_topic('/clock')
        assert '/w' not in [end.node_namespace for end in clocks]
        process.check()


@pytest.mark.slow  # writes and reconstructs 32,000 samples: 5 s of CPU
def test_a_long_log_begins_at_once_and_ends_as_a_replay_of_the_whole(
    ros: None, session: Session, tmp_path: FilePath
) -> None:
    """What is published after the rest is there is what `flightdyn replay` makes of the log."""
    log = tmp_path / 'long.mcap'
    write_fixes(log, 32_000, 10.0)
    expected = replay_log(log).trajectory
    with NodeProcess('replay', namespace='/long', log=str(log), paused=True) as process:
        progress = session.subscribe(PlayProgress, '/long/replay/progress', LATCHED)
        states = session.subscribe(VehicleState, '/long/replay/state', EVERY)

        def call(name: str, kind: Any, **fields: Any) -> Any:
            return session.call(kind, f'/long/replay/{name}', kind.Request(**fields))

        first = progress.wait()[0]
        assert first.duration == pytest.approx(3199.9)
        assert call('play_next', PlayNext).success
        early = states.wait()[0]
        assert abs(early.x_e - expected['x_e'][0]) < expected['x_e_std'][0]
        assert call('seek_to', SeekTo, moment='3000').success
        progress.wait(lambda got: got[-1].complete and got[-1].time == 3000.0, 60.0)
        states.clear()
        assert call('burst', Burst, num_messages=50).actually_burst == 50
        got = states.wait(lambda got: len(got) == 50)
        rows = slice(30_000, 30_050)
        for name in ('x_e', 'y_e', 'z_e', 'speed', 'gamma', 'track'):
            assert [getattr(state, name) for state in got] == expected[name][rows].tolist(), name
        process.check()


START = """
import os, sys, time, rclpy
from flightdyn.nodes.replay_node import ReplayNode
rclpy.init(args=['--ros-args', '-p', 'log:=' + sys.argv[1]])
node = ReplayNode()
node.autostart()
while not next(iter(node.diagnose())).values['published']:
    rclpy.spin_once(node)
print(node.parameters.values.log, time.process_time(), flush=True)
os._exit(0)
"""


@pytest.mark.slow  # writes 360,000 messages: 15 s of CPU
def test_ten_hours_begin_to_play_in_three_seconds(ros: None, tmp_path: FilePath) -> None:
    """Time is that of the processor: what else the machine does is not the node's affair."""
    log = tmp_path / 'ten_hours.mcap'
    write_fixes(log, 360_000, 10.0)
    command = [sys.executable, '-c', START, str(log)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    played, seconds = done.stdout.split()[-2:]
    assert played == str(log)
    assert float(seconds) < 3.0
