"""The simulator as a process: flies plans, keeps /clock, records, obeys."""

import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ros_support import command, need_ros

need_ros()

from nav_msgs.msg import Odometry  # noqa: E402
from rclpy.qos import QoSProfile  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402
from sensor_msgs.msg import Imu, NavSatFix  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

from flightdyn.nodes.base import LATCHED, SENSOR  # noqa: E402
from flightdyn.nodes.client import PlannerClient, Session  # noqa: E402
from flightdyn.nodes.convert import nanoseconds, trajectory_msg  # noqa: E402
from flightdyn.nodes.process import NodeProcess  # noqa: E402
from flightdyn.trajectory import Trajectory  # noqa: E402
from flightdyn_msgs.msg import Trajectory as TrajectoryMsg  # noqa: E402
from flightdyn_msgs.msg import VehicleState  # noqa: E402
from flightdyn_msgs.srv import Reset, SetRate, Step  # noqa: E402

EVERY = QoSProfile(depth=5000)  # a reader that loses nothing, however slow its thread
FLIP = 'quadcopter_flip'
STATES = ('x_e', 'z_e', 'u_b', 'w_b', 'theta', 'q')
HOVER = 0.1 * 9.81 / 2  # N, of each rotor of the 0.1 kg quadcopter


def hover(duration: float, **states: float) -> Any:
    """Return a plan to stand still in the air, away from the origin."""
    names = ('thrust_left', 'thrust_right')
    states = {**dict.fromkeys(STATES, 0.0), 'x_e': 1.0, 'z_e': -2.0, **states}
    return trajectory_msg(
        Trajectory(
            time=np.array([0.0, duration]),
            states={name: np.full(2, value) for name, value in states.items()},
            controls={name: np.full(2, HOVER) for name in names},
            vehicle='quadcopter',
        )
    )


class Flight:
    """A sim process and what it publishes."""

    def __init__(self, session: Session, process: NodeProcess) -> None:
        self.session, self.process = session, process
        self.clock = session.subscribe(Clock, '/clock')
        self.state = session.subscribe(VehicleState, '/sim/state', EVERY)
        self.plan = session.publisher(TrajectoryMsg, '/sim/trajectory')

    def call(self, name: str, kind: Any = Trigger, **fields: Any) -> Any:
        return self.session.call(kind, f'/sim/{name}', kind.Request(**fields))

    def fly(self, plan: Any, until: float) -> list[Any]:
        """Send a plan and return the states of its run, up to a time."""
        self.state.clear()
        self.plan.publish(plan)
        return self.state.wait(lambda states: states and states[-1].time >= until - 1e-9)


@pytest.fixture(scope='module')
def flight(ros: None, session: Session) -> Iterator[Flight]:
    parameters = {'origin_lat': 50, 'origin_lon': 10.0, 'origin_altitude': 100.0}
    with NodeProcess('sim', command=command('sim', installed=True), **parameters) as process:
        yield Flight(session, process)
        process.check()


def times(states: list[Any]) -> list[float]:
    return [state.time for state in states]


def test_clock_shows_before_there_is_anything_to_fly(flight: Flight) -> None:
    # the first time only: whoever waits for /clock has to get on
    flight.clock.wait()
    assert not flight.state.messages


def test_plan_is_flown_in_all_its_topics(flight: Flight) -> None:
    session = flight.session
    odom = session.subscribe(Odometry, '/odom', EVERY)
    imu = session.subscribe(Imu, '/imu', SENSOR)
    fix = session.subscribe(NavSatFix, '/fix', SENSOR)
    states = flight.fly(hover(0.5), 0.5)
    assert times(states) == pytest.approx([k / 200 for k in range(101)])
    assert (times(states)[0], times(states)[-1]) == (0.0, 0.5)
    first = states[0]
    assert (first.vehicle, first.model) == ('quadcopter', 'DynamicsRigidBody2DBody')
    assert first.state_names == ['x_e', 'z_e', 'u_b', 'w_b', 'theta', 'q']
    assert list(first.controls) == pytest.approx([HOVER, HOVER], abs=1e-9)
    position = odom.wait(lambda got: len(got) >= 101)[-1].pose.pose.position
    assert (position.x, position.y, position.z) == pytest.approx((0, 1, 2), abs=1e-9)
    assert imu.wait()[-1].linear_acceleration.z == pytest.approx(9.81)
    fixes = fix.wait(lambda got: len(got) >= 5)
    assert fixes[0].latitude == pytest.approx(50 + 1 / 111_230, abs=1e-7)
    assert fixes[0].altitude == pytest.approx(102.0, abs=1e-3)
    stamps = np.array([nanoseconds(f.header.stamp) for f in fixes])
    assert np.diff(stamps) == pytest.approx(1e8)


def test_clock_and_stamps_never_go_back(flight: Flight) -> None:
    flight.fly(hover(0.1), 0.1)
    flight.fly(hover(0.1), 0.1)
    clocks = [nanoseconds(message.clock) for message in flight.clock.messages]
    assert np.diff(clocks).min() >= 0
    assert flight.call('reset', Reset).success
    states = flight.state.wait(lambda got: got[-1].time >= 0.1 and times(got).count(0.0) == 2)
    stamps = [nanoseconds(state.header.stamp) for state in states]
    assert np.diff(stamps).min() > 0


def test_pause_step_resume(flight: Flight) -> None:
    flight.fly(hover(5.0), 0.05)
    assert flight.call('pause').success
    before = flight.state.messages[-1].time
    assert flight.call('step', Step, duration=0.0123).success
    end = before + 0.0123
    states = flight.state.wait(lambda got: got[-1].time >= end - 1e-9)
    assert states[-1].time == pytest.approx(end)
    refused = flight.call('step', Step, duration=-1.0)
    assert not refused.success
    assert 'duration' in refused.message
    assert flight.call('resume').success
    flight.state.wait(lambda got: got[-1].time > end + 0.05)
    assert 'pause first' in flight.call('step', Step, duration=0.1).message


def test_rate_of_time(flight: Flight) -> None:
    assert flight.call('set_rate', SetRate, rate=0.2).success
    began = time.monotonic()
    states = flight.fly(hover(0.1), 0.1)
    assert time.monotonic() - began >= 0.5
    assert len(states) == 21
    refused = flight.call('set_rate', SetRate, rate=0.0)
    assert not refused.success
    assert flight.call('set_rate', SetRate, rate=1.0).success


def test_controls_are_held(flight: Flight) -> None:
    controls = flight.session.publisher(TrajectoryMsg, '/sim/controls')
    flight.fly(hover(5.0), 0.05)
    message = TrajectoryMsg(
        time=[0.0], control_names=['thrust_left', 'thrust_right'], controls=[0.6, 0.6]
    )
    controls.publish(message)
    states = flight.state.wait(lambda got: got[-1].controls[0] == 0.6)
    then = states[-1].time
    climbing = flight.state.wait(lambda got: got[-1].time > then + 0.2)[-1]
    assert climbing.w_e < -0.3  # 2.19 m/s^2 up for 0.2 s


def test_bad_plans_are_logged_and_harm_nothing(flight: Flight) -> None:
    flight.fly(hover(30.0), 0.05)
    plan = hover(1.0)
    plan.vehicle = 'nope'
    flight.plan.publish(plan)
    plan = hover(1.0)
    plan.states = [1.0]
    flight.plan.publish(plan)
    flight.session.wait_until(lambda: 'values for' in flight.process.output, 'the log')
    assert "no vehicle 'nope'" in flight.process.output
    now = flight.state.messages[-1].time
    flight.state.wait(lambda got: got[-1].time > now)


def test_plan_flies_from_the_planner_to_within_a_centimetre(
    ros: None, session: Session, tmp_path: Path
) -> None:
    """The whole chain, by the planner's latched topic, recorded, and ended by SIGINT."""
    recording = tmp_path / 'flip.mcap'
    with (
        NodeProcess('planner', command=command('planner', installed=True), namespace='/a') as plan,
        NodeProcess('sim', namespace='/a', record=str(recording)) as sim,
    ):
        states = session.subscribe(VehicleState, '/a/sim/state', EVERY)
        outcome = PlannerClient(session, '/a/planner').plan(FLIP, result_timeout=30)
        trajectory = outcome.trajectory
        assert trajectory is not None
        end = trajectory.duration
        last = states.wait(lambda got: got and got[-1].time == end)[-1]
        assert abs(last.x_e - 1.0) < 0.01
        assert abs(last.z_e) < 0.01
        plan.check()
        assert sim.stop(signal.SIGINT) == 0
    topics = read(recording)
    assert len(topics['/a/sim/state']) == len(states.messages)
    assert topics['/a/sim/state'][-1].x_e == last.x_e
    assert len(topics['/plan']) == 1
    assert topics['/plan'][0].problem == FLIP
    assert len(topics['/a/odom']) == len(topics['/a/imu']) == len(topics['/a/sim/state'])


def test_recording_survives_sigkill(ros: None, session: Session, tmp_path: Path) -> None:
    recording = tmp_path / 'killed.mcap'
    with NodeProcess('sim', record=str(recording), namespace='/k') as sim:
        states = session.subscribe(VehicleState, '/k/sim/state', EVERY)
        publisher = session.publisher(TrajectoryMsg, '/k/planner/trajectory', LATCHED)
        publisher.publish(hover(0.3))
        states.wait(lambda got: got and got[-1].time >= 0.3)
        session.wait_until(lambda: 'end of the plan' in sim.output, 'the end of the plan')
        assert sim.kill() == -signal.SIGKILL
    topics = read(recording)
    assert [s.time for s in topics['/k/sim/state']] == [s.time for s in states.messages]


def read(path: Path) -> dict[str, list[Any]]:
    """Return the messages of a recording by topic, with a reader that is not ours."""
    from mcap.exceptions import EndOfFile
    from mcap.reader import NonSeekingReader
    from mcap_ros2.decoder import DecoderFactory

    topics: dict[str, list[Any]] = {}
    with path.open('rb') as stream:
        reader = NonSeekingReader(stream, decoder_factories=[DecoderFactory()])
        try:
            # in the order of the file: else the missing end would hide all that is there
            for _, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False):
                assert message.log_time == nanoseconds(decoded.header.stamp)
                topics.setdefault(channel.topic, []).append(decoded)
        except EndOfFile:
            pass  # a killed recorder has written no end
    return topics
