"""Recordings, read back from the file."""

import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

rr = pytest.importorskip('rerun')
pytest.importorskip('pyarrow')

from flights import flip, soaring  # noqa: E402
from recordings import read, rows  # noqa: E402

from flightdyn.errors import InputError  # noqa: E402
from flightdyn.trajectory import Trajectory  # noqa: E402
from flightdyn.viewing import scenery  # noqa: E402
from flightdyn.viewing.blueprint import playback_speed  # noqa: E402
from flightdyn.viewing.events import Event  # noqa: E402
from flightdyn.viewing.kinematics import motion_of  # noqa: E402
from flightdyn.viewing.rerun_view import save_rrd  # noqa: E402


@pytest.fixture(autouse=True)
def strict():
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)


def floats_of(value):
    """Yield the floats in nested lists."""
    if isinstance(value, list):
        for item in value:
            yield from floats_of(item)
    elif isinstance(value, float):
        yield value


@pytest.fixture(scope='module')
def flown(tmp_path_factory):
    path = tmp_path_factory.mktemp('rrd') / 'flip.rrd'
    flight, plan = flip(160, wobble=0.05), flip(80)
    events = [Event(0.2, 'committed', 'WARN')]
    report = {'solver': {'status': 'ok', 'iterations': np.int64(41)}, 'objective': 0.8}
    save_rrd(path, flight, planned=plan, name='a flip', events=events, properties=report)
    return flight, plan, read(path)


def test_vehicle_moves_with_position_and_full_attitude(flown):
    flight, _, data = flown
    vehicle = data['/world/vehicle']
    at = np.array(rows(vehicle, 'translation')).reshape(-1, 3)
    motion = motion_of(flight)
    np.testing.assert_allclose(at, motion.position, atol=1e-6)  # the file has float32
    xyzw = np.array(rows(vehicle, 'quaternion')).reshape(-1, 4)
    np.testing.assert_allclose(xyzw[:, [3, 0, 1, 2]], motion.attitude, atol=1e-6)
    elapsed_ns = np.array(vehicle['flight_time'])
    np.testing.assert_allclose(elapsed_ns, flight.time * 1e9, atol=1)
    # the plan, too, is drawn at the flight's times
    assert len(rows(data['/world/planned_vehicle'], 'translation')) == len(flight)


def test_world_is_shown_with_down_down(flown):
    *_, data = flown
    (axes,) = rows(data['/world'], 'xyz')
    assert np.ravel(axes).tolist() == [5, 3, 2]  # forward, right, down in Rerun's numbering


def test_properties_name_and_events_are_kept(flown):
    *_, data = flown
    run, figures = data['/__properties/run'], data['/__properties/flight']
    assert rows(run, 'solver_iterations') == [[41]]
    assert rows(run, 'objective') == [[0.8]]
    assert rows(figures, 'vehicle') == [['quadcopter']]
    assert rows(figures, 'distance_m')[0][0] == pytest.approx(1.46, abs=0.1)
    assert rows(data['/__properties'], 'name') == [['a flip']]
    texts = [row[0] for row in rows(data['/events'], 'text')]
    assert 'committed' in texts
    assert any(text.startswith('farthest from the plan') for text in texts)


def test_plots_have_units_steps_and_the_plan(flown):
    flight, _, data = flown
    assert '/map/position' not in data  # a flip in a room is on no map
    theta = np.ravel(rows(data['/plots/angles/flown'], 'scalars'))
    np.testing.assert_allclose(theta, np.degrees(flight['theta']))
    controls = data['/plots/controls/flown']
    assert rows(controls, 'names') == [['thrust_left', 'thrust_right']]
    assert len(rows(controls, 'interpolation_mode')) == 1
    both = np.array(rows(controls, 'scalars'))
    np.testing.assert_allclose(both[:, 1], flight['thrust_right'])
    apart = np.ravel(rows(data['/plots/deviation/flown'], 'scalars'))
    assert 0.01 < apart.max() < 0.1
    assert '/plots/altitude/planned' in data


def test_nothing_in_a_recording_is_nan(flown):
    *_, data = flown
    for entity, columns in data.items():
        for name, values in columns.items():
            assert not any(np.isnan(value) for value in floats_of(values)), (entity, name)


def test_geodetic_flight_has_map_dates_bands_and_cut_lines(tmp_path):
    flight = soaring()
    save_rrd(tmp_path / 'a.rrd', flight)
    data = read(tmp_path / 'a.rrd')
    at = np.array(rows(data['/map/position'], 'positions')).reshape(-1, 2)
    np.testing.assert_allclose(at[:, 0], flight['lat'])
    assert data['/world/vehicle']['utc'] == flight.unix_ns.tolist()
    variances = np.ravel(rows(data['/plots/speed/flown_speed'], 'variances'))
    np.testing.assert_allclose(variances, 0.4**2)
    # One cut after the first stretch on each plot, none of it at a sample.
    assert len(rows(data['/plots/load_factor/flown'], 'is_recursive')) == 1
    texts = [row[0] for row in rows(data['/events'], 'text')]
    assert 'no data for 121 s' in texts
    for entity in ('/world/path/flown', '/map/track/flown'):
        strips = rows(data[entity], 'strips' if 'world' in entity else 'line_strings')[0]
        scale = 1.0 if 'world' in entity else 111e3
        steps = [np.abs(np.diff(np.array(s)[:, 0])).max() * scale for s in strips]
        assert max(steps) < 60  # the gap is 720 m wide, a step at most 36 m


def test_deviation_uses_dates_when_both_have_one(tmp_path):
    flight = soaring(gap=False)
    later = Trajectory(
        time=flight.time[:400],
        states={name: values[100:500] for name, values in flight.states.items()},
        start_ns=flight.start_ns + 100 * 10**9,
        origin=flight.origin,
    )
    save_rrd(tmp_path / 'a.rrd', flight, planned=later)
    apart = np.ravel(rows(read(tmp_path / 'a.rrd')['/plots/deviation/flown'], 'scalars'))
    assert apart.size == 400
    np.testing.assert_allclose(apart, 0, atol=1e-6)


@pytest.mark.parametrize(
    'states',
    [
        {'z_e': [0.0, -5.0, -9.0], 'w_e': [0.0, -4.0, -4.0]},
        {'x_e': [0.0, 1.0, 2.0], 'u_e': [1.0, 1.0, 1.0]},
        {'x_e': [0.0, 0.0, 0.0], 'z_e': [0.0, 0.0, 0.0]},
        {'x_e': [0.0, 5.0, 9.0], 'z_e': [-9.0, -9.0, -8.0], 'speed': [5.0] * 3,
         'gamma': [0.0, -0.1, -0.2], 'alpha': [2.0, 3.0, 4.0]},
    ],
)  # fmt: skip
def test_every_kind_of_motion_can_be_shown(tmp_path, states):
    flight = Trajectory(time=np.arange(3.0), states={k: np.array(v) for k, v in states.items()})
    save_rrd(tmp_path / 'a.rrd', flight, planned=flight)
    assert (tmp_path / 'a.rrd').stat().st_size > 1000


def test_one_sample_can_be_shown(tmp_path):
    flight = Trajectory(time=np.zeros(1), states={'x_e': np.ones(1), 'theta': np.ones(1)})
    save_rrd(tmp_path / 'a.rrd', flight)
    assert (tmp_path / 'a.rrd').exists()


def test_failure_leaves_the_old_file_and_no_other(tmp_path, monkeypatch):
    path = tmp_path / 'a.rrd'
    path.write_bytes(b'old')
    monkeypatch.setattr(scenery, 'curtain', lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        save_rrd(path, flip())
    assert path.read_bytes() == b'old'
    assert [p.name for p in tmp_path.iterdir()] == ['a.rrd']
    with pytest.raises(InputError, match='no folder'):
        save_rrd(tmp_path / 'none' / 'a.rrd', flip())


def test_long_flights_are_thinned_and_say_so(tmp_path):
    save_rrd(tmp_path / 'a.rrd', soaring(2000), max_rows=500)
    data = read(tmp_path / 'a.rrd')
    assert 500 <= len(rows(data['/world/vehicle'], 'translation')) < 520
    assert 'of 2000 samples' in rows(data['/summary'], 'text')[0][0]
    assert rows(data['/__properties/flight'], 'samples') == [[2000]]


def test_play_speed_fits_the_flight():
    assert playback_speed(0.8) == 0.1
    assert playback_speed(10.0) == 1.0
    assert playback_speed(15_914.0) == 200.0


def test_recordings_pass_the_check_of_rerun_itself(tmp_path):
    save_rrd(tmp_path / 'a.rrd', soaring(), planned=soaring(300))
    program = Path(sys.executable).with_name('rerun')
    if not program.exists():
        pytest.skip('no rerun beside this Python')
    command = [program, 'rrd', 'verify', tmp_path / 'a.rrd']
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_a_million_samples_are_written_in_seconds(tmp_path):
    n = 1_000_000
    few = soaring(1000, gap=False)
    flight = replace(
        few,
        time=np.arange(n) * 0.1,
        segment=np.zeros(n, int),
        **{
            group: {name: np.resize(values, n) for name, values in getattr(few, group).items()}
            for group in ('states', 'controls', 'outputs')
        },
    )
    began = time.process_time()
    save_rrd(tmp_path / 'a.rrd', flight)
    assert time.process_time() - began < 3.0  # s of CPU time; 1.5 were measured
    assert (tmp_path / 'a.rrd').stat().st_size < 100e6
