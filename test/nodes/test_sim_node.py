"""The simulator as a process: flies plans, keeps /clock, records, obeys."""

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
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
from flightdyn.planning.planner import Planner  # noqa: E402
from flightdyn.planning.problem_file import load_problem  # noqa: E402
from flightdyn.trajectory import Trajectory  # noqa: E402
from flightdyn_msgs.msg import SimEvent, VehicleState  # noqa: E402
from flightdyn_msgs.msg import Trajectory as TrajectoryMsg  # noqa: E402
from flightdyn_msgs.srv import Reset, SetRate, SetWind, Step  # noqa: E402

EVERY = QoSProfile(depth=5000)  # a reader that loses nothing, however slow its thread
FLIP = 'quadcopter_flip'
LATE = -signal.SIGALRM
"""Exit code where the middleware took too long to go: files are finished by then."""
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

    def settled(self) -> Any:
        """Return the last state once no more come: they may be slower than an answer."""
        count = -1
        while count != len(self.state.messages):
            count = len(self.state.messages)
            time.sleep(0.3)
        return self.state.messages[-1]


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
    before = flight.settled().time
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


def test_reset_takes_any_state(flight: Flight) -> None:
    flight.fly(hover(5.0), 0.05)
    states = {'altitude': 7.5, 'theta': 0.25, 'q': -1.0}
    answer = flight.call('reset', Reset, state_names=list(states), states=list(states.values()))
    assert answer.success
    (first,) = flight.state.wait(lambda got: [s for s in got if s.z_e == -7.5])[-1:]
    assert (first.time, first.q) == (0.0, -1.0)
    assert list(first.states) == [1.0, -7.5, 0.0, 0.0, 0.25, -1.0]
    for names, values, message in (
        (['hight'], [1.0], "no state 'hight'"),
        (['q'], [float('nan')], 'must be finite'),
        (['q'], [], '1 state_names and 0 states'),
    ):
        refused = flight.call('reset', Reset, state_names=names, states=values)
        assert not refused.success
        assert message in refused.message


def test_wind_is_set_in_flight(flight: Flight) -> None:
    flight.fly(hover(30.0), 0.05)
    assert flight.call('set_wind', SetWind, wind_ned=[-3.0, 4.0, 0.0]).success
    windy = flight.state.wait(lambda got: got[-1].airspeed > 4.5)[-1]
    assert windy.airspeed == pytest.approx(5.0, abs=0.05)
    refused = flight.call('set_wind', SetWind, wind_ned=[0.0, 0.0, 0.0], gusts='mad')
    assert not refused.success
    assert 'severity' in refused.message


def test_events_are_published(flight: Flight) -> None:
    events = flight.session.subscribe(SimEvent, '/sim/event', EVERY)
    flight.fly(hover(0.1), 0.1)
    kinds = [event.kind for event in events.wait(lambda got: len(got) >= 2)]
    assert kinds == [SimEvent.RUN_BEGAN, SimEvent.PLAN_ENDED]
    events.clear()
    flight.plan.publish(hover(0.3, z_e=-0.01, w_b=1.0, theta=3.0))
    # upside down nothing holds it
    contact = events.wait(lambda got: [e for e in got if e.kind == SimEvent.GROUND_CONTACT])
    (contact,) = [event for event in contact if event.kind == SimEvent.GROUND_CONTACT]
    assert contact.quantity == 'altitude'
    assert 0 < contact.time < 0.3
    assert nanoseconds(contact.header.stamp) > 0


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
        assert sim.stop(signal.SIGINT) in (0, LATE)
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
    recorded = [s.time for s in read(recording)['/k/sim/state']]
    heard = [s.time for s in states.messages]
    # what was said last may still be on its way to the one who listens
    assert recorded[: len(heard)] == heard
    assert len(heard) > 0.9 * len(recorded)


@contextmanager
def flying(
    session: Session, plan: Any, namespace: str, **parameters: Any
) -> Iterator[tuple[NodeProcess, Any, Any]]:
    """Give a sim to which a plan was sent, its states and events."""
    with NodeProcess('sim', namespace=namespace, **parameters) as sim:
        states = session.subscribe(VehicleState, f'{namespace}/sim/state', EVERY)
        events = session.subscribe(SimEvent, f'{namespace}/sim/event', EVERY)
        session.publisher(TrajectoryMsg, f'{namespace}/sim/trajectory').publish(plan)
        yield sim, states, events


def ended(events: Any, timeout: float = 60.0) -> None:
    events.wait(lambda got: [e for e in got if e.kind == SimEvent.PLAN_ENDED], timeout=timeout)


def test_the_flip_is_tracked_by_a_heavier_quadcopter(ros: None, session: Session) -> None:
    """Promised: 5 cm and 5 degrees with 5 % of error in mass and inertia."""
    reserve = [f'path.thrust_{side}=[0.05, 0.95]' for side in ('left', 'right')]
    plan = Planner().plan(load_problem(FLIP, reserve)).trajectory
    heavier = 'mass=0.105; inertia.Iyy=0.000525'
    with flying(session, trajectory_msg(plan), '/h', vehicle_settings=heavier) as flight:
        sim, states, events = flight
        ended(events)
        last = states.wait(lambda got: got and got[-1].time >= plan.duration - 1e-9)[-1]
        sim.check()
    assert np.hypot(last.x_e - 1.0, last.z_e) < 0.05
    assert abs(last.states[4] + 2 * np.pi) < np.radians(5)


HOUR = pytest.param(3600.0, marks=[pytest.mark.slow, pytest.mark.timeout(1500)])


@pytest.mark.parametrize('seconds', [10.0, HOUR])
def test_the_same_seed_makes_the_same_recording(
    ros: None, session: Session, tmp_path: Path, seconds: float
) -> None:
    files = []
    for number, seed in enumerate((3, 3, 4)):
        path = tmp_path / f'{number}.mcap'
        parameters = {
            'real_time_factor': 0.0,
            'rate': 10.0,
            'gusts': 'light',
            'seed': seed,
            'fix_noise': [1.0, 1.0, 2.0],
            'imu_noise': [0.05, 0.002],
            'start_time': 1.7e9,
            'record_root': str(tmp_path),
            'record': path.name,
        }
        with flying(session, hover(seconds), '/same', **parameters) as flight:
            sim, _, events = flight
            ended(events, timeout=30 + seconds / 2)
            assert sim.stop(signal.SIGINT) in (
                0,
                -signal.SIGALRM,
            )  # slow teardown on a busy machine
        files.append(path.read_bytes())
        if seconds > 100 and number == 1:
            break
    assert len(files[0]) > 1000 * seconds
    assert files[0] == files[1]
    assert files[-1] != files[0] or len(files) == 2


def test_a_full_disk_ends_the_recording_and_not_the_flight(ros: None, session: Session) -> None:
    with flying(session, hover(3.0), '/full', record='/dev/full') as (sim, states, events):
        ended(events)
        kinds = [event.kind for event in events.messages]
        assert kinds.count(SimEvent.RECORDING_ENDED) == 1
        assert 'the flight goes on: /dev/full: No space left' in sim.output, sim.output
        states.wait(lambda got: got[-1].time == pytest.approx(3.0))


@pytest.mark.parametrize(
    ('record', 'message'),
    [
        ('../out.mcap', 'parameter record: ../out.mcap is outside'),
        ('/etc/out.mcap', 'parameter record: /etc/out.mcap is outside'),
        ('nowhere/out.mcap', 'there is no folder for nowhere/out.mcap'),
    ],
)
def test_recordings_stay_in_their_folder(
    ros: None, tmp_path: Path, record: str, message: str
) -> None:
    with NodeProcess('sim', record_root=str(tmp_path), record=record, namespace='/r') as sim:
        assert sim.process.wait(30) in (2, LATE)
        assert message in sim.output


def test_the_flight_goes_on_when_the_planner_dies(ros: None, session: Session) -> None:
    with (
        NodeProcess('planner', namespace='/d') as planner,
        NodeProcess('sim', namespace='/d', after_plan='hold') as sim,
    ):
        states = session.subscribe(VehicleState, '/d/sim/state', EVERY)
        assert PlannerClient(session, '/d/planner').plan(FLIP, result_timeout=30).succeeded
        states.wait(lambda got: got)
        planner.kill()
        now = states.messages[-1].time
        states.wait(lambda got: got[-1].time > now + 1.0)
        sim.check()


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
