"""Our own recordings, read by us, by mcap-ros2-support and by rosbags; and after a kill."""

import os
import signal
import subprocess
import sys
import textwrap
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from numpy.testing import assert_allclose, assert_array_equal
from rosbags.highlevel import AnyReader

from flightdyn.environment.geodesy import GeodeticPoint
from flightdyn.errors import InputError, LogError
from flightdyn.logs.mcap_container import McapFile
from flightdyn.logs.messages import (
    NAV_SAT_FIX,
    TRAJECTORY,
    VEHICLE_STATE,
    canonical,
    kinematics,
    schema_text,
    serialize,
    trajectory_message,
    typestore,
)
from flightdyn.logs.recorded import read_flights, read_plans
from flightdyn.logs.recording import McapRecorder, write_flight_mcap
from flightdyn.logs.sources import list_sources, read_track
from flightdyn.trajectory import Trajectory

N = 201


@pytest.fixture
def climb() -> Trajectory:
    """A climbing right turn of a point mass, everything different from zero."""
    t = np.linspace(0, 10, N)
    one = np.ones(N)
    speed, gamma, track = 20 + t, 0.2 * one, 0.4 + 0.1 * t
    east = speed * np.cos(gamma) * np.sin(track)
    north = speed * np.cos(gamma) * np.cos(track)

    def way(v: np.ndarray) -> np.ndarray:
        return np.concatenate(([0], np.cumsum(0.5 * np.diff(t) * (v[1:] + v[:-1]))))

    return Trajectory(
        time=t,
        states={
            'x_e': way(north),
            'y_e': way(east),
            'z_e': -way(speed * np.sin(gamma)),
            'speed': speed,
            'gamma': gamma,
            'track': track,
        },
        controls={'alpha': 6 * one, 'bank': 0.3 * one},
        outputs={'airspeed': speed + 1, 'load_factor': 1.1 * one},
        model='DynamicsPointMass3DSpeedGammaTrack',
        vehicle='glider',
        problem='climb',
        start_ns=1_700_000_000 * 10**9 + 7,
        origin=GeodeticPoint(48.0, 9.0, 400.0),
    )


def test_flight_comes_back_as_track(climb: Trajectory, tmp_path: Path) -> None:
    path = tmp_path / 'flight.mcap'
    write_flight_mcap(climb, path)
    v = 20 + climb.time
    velocity = np.stack(
        [
            v * np.cos(0.2) * np.cos(climb['track']),
            v * np.cos(0.2) * np.sin(climb['track']),
            -v * np.sin(0.2),
        ],
        1,
    )
    position = np.stack([climb[name] for name in ('x_e', 'y_e', 'z_e')], 1)
    kinds = {s.topic: s.rank for s in list_sources(path)}
    assert kinds == {'/odom': 0, '/sim/state': 1, '/fix': 2, '/plan': -1}
    for topic in ('/odom', '/sim/state'):
        track = read_track(path, topic)
        assert_array_equal(track.time_ns, climb.unix_ns)
        assert_allclose(track.position_ned, position, atol=1e-12)
        assert_allclose(track.velocity_ned, velocity, atol=1e-12)
        assert (track.origin, track.altitude_datum) == (climb.origin, 'ellipsoid')
    fix = read_track(path, '/fix')
    assert fix.lat is not None
    assert (fix.lat[0], fix.altitude[0]) == pytest.approx((48, 400), abs=1e-6)
    assert fix.lat[-1] > 48


def test_plan_comes_back_whole(climb: Trajectory, tmp_path: Path) -> None:
    path = tmp_path / 'flight.mcap'
    write_flight_mcap(climb, path)
    (plan,) = read_plans(path)
    for group in ('states', 'controls', 'outputs'):
        assert list(getattr(plan, group)) == list(getattr(climb, group))
    for name, column in climb.columns.items():
        assert_allclose(plan[name], column, rtol=1e-14)  # alpha went through radians
    for name in ('model', 'vehicle', 'problem', 'start_ns', 'origin', 'control_interpolation'):
        assert getattr(plan, name) == getattr(climb, name)


def test_a_flown_plan_is_recorded_beside_the_flight(climb: Trajectory, tmp_path: Path) -> None:
    """What was recorded as the plan was once the flight itself."""
    path = tmp_path / 'flight.mcap'
    states = {**climb.states, 'speed': climb['speed'] + 1}
    planned = replace(climb, states=states, start_ns=0)
    write_flight_mcap(climb, path, planned)
    (plan,) = read_plans(path)
    assert_allclose(plan['speed'], climb['speed'] + 1, rtol=1e-14)
    assert plan.start_ns == climb.start_ns
    assert_allclose(read_flights(path)[0]['speed'], climb['speed'], rtol=1e-14)


def test_flight_comes_back_with_states_and_controls(climb: Trajectory, tmp_path: Path) -> None:
    path = tmp_path / 'flight.mcap'
    write_flight_mcap(climb, path)
    (flight,) = read_flights(path)
    assert list(flight.states) == list(climb.states)
    assert list(flight.controls) == list(climb.controls)
    for name in (*climb.states, *climb.controls):
        assert_allclose(flight[name], climb[name], rtol=1e-14)
    assert_allclose(flight.time, climb.time)
    assert (flight.start_ns, flight.origin) == (climb.start_ns, climb.origin)


def test_attitude_past_the_vertical_is_the_models_own(tmp_path: Path) -> None:
    flip = Trajectory(
        time=[0.0, 0.5, 1.0],
        states={'x_e': [0, 1, 2], 'z_e': [0, 0, 0], 'theta': [0, -3.0, -6.0]},
        model='DynamicsRigidBody2DBody',
    )
    path = tmp_path / 'flip.mcap'
    write_flight_mcap(flip, path)
    (flight,) = read_flights(path)
    assert flight['theta'].tolist() == [0, -3.0, -6.0]
    assert 'phi' not in flight


def test_a_log_without_flights_says_so() -> None:
    with pytest.raises(LogError, match='no flightdyn_msgs/msg/VehicleState'):
        read_flights(Path(__file__).parents[1] / 'data' / 'discus2_thermal.mcap')


def test_angles_in_messages_are_radians(climb: Trajectory) -> None:
    message = trajectory_message(climb)
    assert message.controls.reshape(N, 2)[0] == pytest.approx([np.radians(6), 0.3])


def test_body_of_a_point_mass_is_pitched_up_by_alpha(climb: Trajectory) -> None:
    level = Trajectory(
        time=[0.0, 1.0],
        states={'x_e': [0, 0], 'speed': [10, 10], 'gamma': [0.1, 0.1], 'track': [0, 0]},
        controls={'alpha': [np.degrees(0.05)] * 2},
    )
    motion = kinematics(level)
    assert_allclose(motion['q_y'], np.sin(0.15 / 2))
    assert np.isnan(motion['airspeed']).all()  # not told: NaN, not zero
    assert (motion['y_e'] == 0).all()


def test_rigid_body_velocity_is_turned_to_earth() -> None:
    motion = kinematics(
        Trajectory(
            time=[0.0, 1.0],
            states={'x_e': [0, 0], 'z_e': [0, 0], 'u_b': [3, 3], 'w_b': [1, 1], 'q': [0.1, 0.1]}
            | {'theta': [np.pi / 2] * 2},
        )
    )
    # Nose straight up: forward is up, and the body's down points north.
    assert_allclose(motion['w_e'], -3, atol=1e-12)
    assert_allclose(motion['u_e'], 1, atol=1e-12)
    assert_allclose(motion['gamma'], np.arctan2(3, 1))
    assert (motion['p'] == 0).all()


def test_others_read_our_recording(climb: Trajectory, tmp_path: Path) -> None:
    path = tmp_path / 'flight.mcap'
    write_flight_mcap(climb, path)
    last = {}
    with path.open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == 'ros2'
        (metadata,) = reader.iter_metadata()
        assert metadata.name == 'flightdyn'
        assert metadata.metadata['vehicle'] == 'glider'
        counts: Counter[str] = Counter()
        for _, channel, message, decoded in reader.iter_decoded_messages():
            counts[channel.topic] += 1
            last[channel.topic] = decoded
            assert message.sequence == counts[channel.topic]
            (qos,) = yaml.safe_load(channel.metadata['offered_qos_profiles'])
            assert qos['durability'] == (
                'transient_local' if channel.topic == '/plan' else 'volatile'
            )
    assert counts == {'/plan': 1, '/sim/state': N, '/odom': N, '/fix': N}
    assert last['/sim/state'].alpha == pytest.approx(np.radians(6))
    assert last['/odom'].pose.pose.position.y == pytest.approx(climb['x_e'][-1])
    assert last['/odom'].twist.twist.linear.x == pytest.approx(30 * np.cos(np.radians(6)))
    with AnyReader([path]) as bag:
        for connection, _, raw in bag.messages():
            bag.deserialize(raw, connection.msgtype)
        assert {c.topic: c.msgcount for c in bag.connections} == counts


def test_definitions_are_complete_and_keep_their_comments() -> None:
    text = schema_text(VEHICLE_STATE)
    assert 'm/s' in text
    assert '\nMSG: std_msgs/Header\n' in text
    assert '\nMSG: builtin_interfaces/Time\n' in text
    assert TRAJECTORY in typestore().types
    with pytest.raises(InputError, match='not known'):
        schema_text('no_msgs/msg/Such')


def test_metadata_is_at_the_beginning(tmp_path: Path) -> None:
    path = tmp_path / 'empty.mcap'
    with McapRecorder(path, {'vehicle': 'v'}):
        assert b'vehicle' in path.read_bytes()  # on disk before any message
    with McapFile(path) as log:
        assert log.metadata_record('flightdyn') == {'vehicle': 'v'}
        assert log.warnings == []


def test_wrong_requests_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='no folder'):
        McapRecorder(tmp_path / 'none' / 'x.mcap')
    with pytest.raises(InputError, match='cannot record'):
        McapRecorder(tmp_path)
    with McapRecorder(tmp_path / 'x.mcap') as recorder:
        recorder.write('/a', 'std_msgs/msg/Empty', b'\0\1\0\0\0', 1)
        with pytest.raises(InputError, match='is recorded as'):
            recorder.write('/a', 'std_msgs/msg/Bool', b'\0\1\0\0\0', 1)
        with pytest.raises(InputError, match='not known'):
            recorder.write('/b', 'std_msgs/msg/Nothing', b'\0\1\0\0\0', 1)
        with pytest.raises(InputError, match='before 1970'):
            recorder.write('/a', 'std_msgs/msg/Empty', b'\0\1\0\0\0', -1)
    with pytest.raises(InputError, match='finished'):
        recorder.write('/a', 'std_msgs/msg/Empty', b'\0\1\0\0\0', 1)
    recorder.finish()
    with McapFile(tmp_path / 'x.mcap') as log:
        assert log.message_counts == {1: 1}


@pytest.mark.skipif(not Path('/dev/full').exists(), reason='needs /dev/full')
def test_a_full_disk_is_told_at_once() -> None:
    with pytest.raises(OSError, match='No space left'):
        McapRecorder('/dev/full')


def test_equal_messages_are_equal_in_the_bytes_that_alignment_leaves_unused() -> None:
    """ROS serialises into memory that is not cleared; two recordings of a flight then differ."""
    store = typestore()
    kinds = store.types
    stamp = kinds['builtin_interfaces/msg/Time'](1, 2)
    header = kinds['std_msgs/msg/Header'](stamp, 'gps')  # 4 bytes of text, then 4 to a double
    status = kinds['sensor_msgs/msg/NavSatStatus'](0, 1)
    fix = kinds[NAV_SAT_FIX](header, status, 50.0, 10.0, 100.0, np.zeros(9), 0)
    clean = serialize(NAV_SAT_FIX, fix)
    dirty = bytearray(clean)
    # encapsulation 4, stamp 8, length 4, text 4, then the status, and after it a hole of 1
    assert clean[20:24] == bytes([0, 0, 1, 0])
    dirty[21] = 0xAB
    assert bytes(dirty) != clean
    assert canonical(NAV_SAT_FIX, bytes(dirty)) == clean
    assert canonical(NAV_SAT_FIX, clean) == clean


@pytest.mark.skipif(os.name != 'posix', reason='SIGKILL')
def test_a_killed_recorder_leaves_a_readable_file(tmp_path: Path) -> None:
    path = tmp_path / 'killed.mcap'
    program = textwrap.dedent(
        """
        import sys, time
        from flightdyn.logs.recording import McapRecorder, write_flight_mcap
        recorder = McapRecorder(sys.argv[1], {'vehicle': 'v'})
        for i in range(10**6):
            data = bytes([0, 1, 0, 0]) + i.to_bytes(8, 'little')
            recorder.write('/a', 'std_msgs/msg/Int64', data, i * 5_000_000)
            if i == 200:
                print('going', flush=True)
            time.sleep(0.005)
        """
    )
    process = subprocess.Popen(
        [sys.executable, '-c', program, str(path)],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)},
    )
    assert process.stdout is not None
    assert process.stdout.readline() == 'going\n'  # a good second of messages
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()
    with McapFile(path) as log:
        assert 'cut short' in log.warnings[0]
        assert log.metadata_record('flightdyn') == {'vehicle': 'v'}
        # At most what belongs to the last half second is missing: 100 of 200.
        assert log.message_counts[1] >= 90
