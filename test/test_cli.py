"""The command line: results on stdout, one clear line on stderr, the right exit code."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from flightdyn.cli import main
from flightdyn.resources import list_configs

GLIDER = Path(__file__).parent / 'data' / 'discus2_thermal.mcap'
PLAN_KEYS = (
    'problem vehicle model converged verified status message objective final_time iterations '
    'wall_s build_s nodes transcription verification constraint_violation time states controls '
    'outputs'
).split()
REPLAY_KEYS = (
    'file source schema altitude_datum messages used dropped segments origin duration_s '
    'distance_m max_speed max_altitude warnings'
).split()
REPLAY_COLUMNS = (
    't segment lat lon altitude x_e y_e z_e u_e v_e w_e speed gamma track bank load_factor '
    'x_e_std y_e_std z_e_std speed_std gamma_std track_std'
).split()


@pytest.fixture(scope='module')
def plan_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp('plan') / 'plan.json'
    assert main(['plan', 'quadcopter_flip', '-o', str(path)]) == 0
    return path


def test_plan_prints_the_document_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['plan', 'quadcopter_flip', '--json', '--set', 'nodes=40']) == 0
    document = json.loads(capsys.readouterr().out)
    assert set(PLAN_KEYS) <= set(document)
    assert document['verified'] is True
    assert len(document['time']) == len(document['states']['x_e']) > 40


def test_a_tracked_flip_ends_where_planned_though_the_vehicle_is_heavier(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Promised: 5 cm and 5 degrees, if the plan keeps a reserve of thrust."""
    path = str(tmp_path / 'flip.json')
    reserve = [f'path.thrust_{side}=[0.05, 0.95]' for side in ('left', 'right')]
    settings = [word for setting in reserve for word in ('--set', setting)]
    assert main(['plan', 'quadcopter_flip', *settings, '-o', path]) == 0
    off = ['--set', 'mass=0.105', '--set', 'inertia.Iyy=0.000525']
    ends = {}
    for track in ([], ['--track']):
        capsys.readouterr()
        assert main(['sim', path, *off, *track, '--json']) == 0
        ends[bool(track)] = json.loads(capsys.readouterr().out)['final']
    assert ends[True]['x_e'] == pytest.approx(1, abs=0.05)
    assert ends[True]['z_e'] == pytest.approx(0, abs=0.05)
    assert ends[True]['theta'] == pytest.approx(-2 * np.pi, abs=np.radians(5))
    assert abs(ends[False]['z_e']) > 0.1


def test_gusts_on_a_plan_are_those_of_the_seed(
    plan_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ends = []
    for seed in ('1', '2', '1'):
        capsys.readouterr()
        arguments = ['--gusts', 'light', '--seed', seed, '--rate', '10', '--json']
        assert main(['sim', str(plan_path), *arguments]) == 0
        ends.append(json.loads(capsys.readouterr().out)['outputs']['airspeed'])
    assert ends[0] == ends[2] != ends[1]


def test_plan_from_several_starts_lists_the_optima(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ['--set', 'final={x_e: -0.16, z_e: -0.72, u_b: 0, w_b: 0, theta: -360 deg, q: 0}']
    arguments += ['--multistart', '4', '--seed', '0']
    assert main(['plan', 'quadcopter_flip', *arguments, '--json']) == 0
    document = json.loads(capsys.readouterr().out)
    optima = document['optima']
    assert optima[0]['objective'] == document['objective']
    assert [each['objective'] for each in optima] == sorted(each['objective'] for each in optima)
    assert len(document['arcs']) > 1
    assert main(['plan', 'quadcopter_flip', *arguments]) == 0
    assert 'optimum 2' in capsys.readouterr().out
    assert main(['plan', 'quadcopter_flip', '--multistart', '0']) == 2


def test_plan_writes_every_format(tmp_path: Path) -> None:
    names = [f'plan{suffix}' for suffix in ('.json', '.csv', '.parquet', '.mcap', '.rrd', '.png')]
    paths = [tmp_path / name for name in names]
    assert main(['plan', 'quadcopter_flip', '-o', *map(str, paths)]) == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(names)
    assert all(path.stat().st_size > 1000 for path in paths)


def test_a_plan_flown_by_sim_stays_on_it(
    plan_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(['sim', str(plan_path), '--json', '-o', str(tmp_path / 'flown.mcap')]) == 0
    document = json.loads(capsys.readouterr().out)
    assert 0 < document['deviation_from_plan']['x_e'] < 1e-3
    assert main(['info', str(tmp_path / 'flown.mcap'), '--json']) == 0
    topics = json.loads(capsys.readouterr().out)['topics']
    assert {'nav_msgs/msg/Odometry', 'flightdyn_msgs/msg/VehicleState'} <= {
        topic['schema'] for topic in topics
    }


def test_sim_of_a_scenario(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['sim', 'quadcopter_open_loop', '--rate', '50']) == 0
    assert '3.13663' in capsys.readouterr().out


def test_plan_flown_and_replayed_comes_back(plan_path: Path, tmp_path: Path) -> None:
    flown, table = tmp_path / 'flown.mcap', tmp_path / 'replayed.csv'
    assert main(['sim', str(plan_path), '--rate', '500', '-o', str(flown)]) == 0
    view = tmp_path / 'replayed.rrd'
    assert main(['replay', str(flown), '-o', str(table), str(view)]) == 0
    assert b'planned_vehicle' in view.read_bytes()  # what was meant to be flown is drawn, too
    plan = json.loads(plan_path.read_text())
    replayed = np.genfromtxt(table, delimiter=',', names=True)
    time = (replayed['t'] - replayed['t'][0]) * 1e-9
    for name in ('x_e', 'z_e'):
        at_nodes = np.interp(plan['time'], time, replayed[name])
        assert np.abs(at_nodes - plan['states'][name]).max() < 0.05, name


def test_replay_of_a_real_glider(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = tmp_path / 'glider.parquet'
    assert main(['replay', str(GLIDER), '--json', '-o', str(table)]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert set(REPLAY_KEYS) <= set(summary)
    import pyarrow.parquet as pq

    columns = pq.read_table(table)
    assert columns.column_names[: len(REPLAY_COLUMNS)] == REPLAY_COLUMNS
    for name in columns.column_names:
        assert np.isfinite(columns[name].to_numpy()).all(), name


def test_replay_with_the_wind(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / 'thermal.csv'
    assert main(['replay', str(GLIDER), '--wind', 'circling', '-o', str(path)]) == 0
    assert 'wind' in capsys.readouterr().out
    columns = path.read_text().split('\n', 1)[0].split(',')
    assert {'wind_x_e', 'wind_y_e', 'wind_std', 'airspeed', 'bank_air'} <= set(columns)


def test_replay_of_one_flight(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['replay', str(GLIDER), '--flight', '1']) == 0
    assert 'flight 1   ' in capsys.readouterr().out
    assert main(['replay', str(GLIDER), '--flight', '3']) == 2
    assert 'there is no flight 3' in capsys.readouterr().err


def test_info_tells_what_a_log_can_be_replayed_as(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['info', str(GLIDER)]) == 0
    header, row = capsys.readouterr().out.splitlines()
    assert header.split() == ['topic', 'schema', 'messages', 'replay', 'as']
    assert row.split()[:3] == ['/fix', 'sensor_msgs/msg/NavSatFix', '900']
    assert row.split()[3] != '-'


def test_start_and_end_cut_the_log(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['replay', str(GLIDER), '--json', '--start', '10', '--end', '70']) == 0
    assert json.loads(capsys.readouterr().out)['duration_s'] == pytest.approx(60, abs=1)


def test_models_lists_the_family(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['models', '--json']) == 0
    rows = {row['class']: row for row in json.loads(capsys.readouterr().out)}
    assert rows['DynamicsRigidBody2DBody']['controls'] == ['Fx_b', 'Fz_b', 'My_b']
    assert main(['models']) == 0


def test_problems_are_listed_and_bad_ones_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(['problems', '--json']) == 0
    rows = {row['problem']: row for row in json.loads(capsys.readouterr().out)}
    assert set(rows) == set(list_configs('problems'))
    assert rows['quadcopter_flip']['vehicle'] == 'quadcopter'
    assert all(row['description'] for row in rows.values())
    (tmp_path / 'problems').mkdir()
    (tmp_path / 'problems' / 'bad.yaml').write_text('vehicle: quadcopter\n')
    assert main(['problems', '--config-dir', str(tmp_path)]) == 2
    told = capsys.readouterr()
    assert "'duration' is missing" in told.err
    assert 'rocket_climb' in told.out
    assert 'bad' not in told.out


def test_vehicles_are_listed_with_the_errors_of_their_fits(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(['vehicles']) == 0
    lines = {line.split()[0]: line for line in capsys.readouterr().out.splitlines()}
    assert ' - ' in lines['quadcopter'] and 'CD 2.1e-04 rel.' in lines['cessna152']
    assert main(['vehicles', 'cessna152', '--json']) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert row['fit_errors']['CD']['samples'] == 200 and row['rates'] == {}
    assert main(['vehicles', 'rocket', 'balloon']) == 0
    assert 'states z_e w_e mass' in capsys.readouterr().out
    assert main(['vehicles', 'cesna152']) == 2
    assert 'cessna152' in capsys.readouterr().err


def test_unconverged_plan_exits_3_with_the_last_iterate_marked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / 'plan.json'
    arguments = ['--set', 'duration.upper=0.5', '--set', 'duration.guess=0.4', '-o', str(path)]
    assert main(['plan', 'quadcopter_flip', *arguments]) == 3
    assert 'no flight was found that keeps all conditions' in capsys.readouterr().err
    document = json.loads(path.read_text())
    assert document['converged'] is False
    assert document['missed'][0].keys() == {'quantity', 'time', 'value', 'bound', 'amount'}


def test_unverified_plan_exits_4(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ['--set', 'nodes=20', '--set', 'tolerance=1e-12']
    assert main(['plan', 'quadcopter_flip', *arguments]) == 4
    assert 'flown again' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (['plan', 'quadcopter_flop'], 'quadcopter_flip'),
        (['plan', 'nowhere.yaml'], 'cannot read nowhere.yaml'),
        (['plan', 'quadcopter_flip', '-o', 'plan.docx'], "suffix '.docx'"),
        (['plan', 'quadcopter_flip', '-o', 'nowhere/plan.json'], 'there is no folder nowhere'),
        (['plan', 'quadcopter_flip', '--config-dir', 'nowhere'], 'is not a folder'),
        (['sim', 'nothing'], 'quadcopter_open_loop'),
        (['sim', 'nowhere.json'], 'cannot read nowhere.json'),
        (['sim', 'quadcopter_open_loop', '--track'], 'are for plans'),
        (['sim', 'quadcopter_open_loop', '--rate', '-5'], 'must be positive'),
        (['replay', 'nowhere.mcap'], 'nowhere.mcap'),
        (['replay', str(GLIDER), '--source', '/gps'], '/fix'),
        (['replay', str(GLIDER), '--start', '90000'], 'it runs from 0 s'),
        (['replay', str(GLIDER), str(GLIDER), '-o', 'x.csv'], "'{log}'"),
        (
            ['replay', str(GLIDER), str(GLIDER), '-o', '{log}.csv'],
            'would be written to discus2_thermal.csv',
        ),
        (['convert', 'a.ulg', 'b.ulg', 'x.mcap'], "'{log}'"),
        (['info', __file__], 'MCAP'),
        (['convert', str(GLIDER), 'out.mcap'], 'is an MCAP already'),
        (['convert', str(GLIDER), 'out.csv'], "suffix '.csv', not .mcap"),
        (['convert', 'nowhere.igc', 'out.mcap'], 'nowhere.igc'),
    ],
)
def test_bad_input_is_one_line_and_code_2(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ''
    assert message in captured.err
    assert len(captured.err.strip().splitlines()) == 1


@pytest.fixture
def three_logs(tmp_path: Path) -> list[str]:
    """A log, what is none, and another log."""
    rows = '\n'.join(f'{t},{48 + 1e-5 * t},9.0,500.0' for t in range(20))
    for name in ('first.csv', 'last.csv'):
        (tmp_path / name).write_text('timestamp,latitude,longitude,altitude\n' + rows)
    (tmp_path / 'none.csv').write_bytes(b'')
    return [str(tmp_path / f'{name}.csv') for name in ('first', 'none', 'last')]


@pytest.mark.parametrize('command', ['info', 'replay', 'convert'])
def test_a_bad_log_stops_no_other(
    command: str, three_logs: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [command, *three_logs]
    if command == 'convert':
        arguments.append(f'{tmp_path}/{{log}}.mcap')
    assert main([*arguments, '--json']) == 2
    told = capsys.readouterr()
    first, none, last = json.loads(told.out)
    assert first['messages'] == last['messages'] == 20
    assert none['exit_code'] == 2
    assert f'flightdyn: {none["error"]}' in told.err.splitlines()
    assert 'none.csv' in none['error']
    assert main(arguments) == 2
    told = capsys.readouterr()
    assert [f'{log}:' in told.out for log in three_logs] == [True, False, True]
    if command == 'convert':
        assert sorted(p.name for p in tmp_path.glob('*.mcap')) == ['first.mcap', 'last.mcap']


@pytest.mark.parametrize('command', ['replay', 'convert'])
def test_interrupt_leaves_no_half_file(
    command: str, three_logs: list[str], tmp_path: Path
) -> None:
    # the signal is sent while the file is being written
    script = (
        'import os, signal, sys\n'
        'from flightdyn import cli, files\n'
        'from flightdyn.logs.recording import McapRecorder\n'
        'import flightdyn.tables as tables\n'
        'def interrupted(*arguments, **more):\n'
        f'    assert len(list(__import__("pathlib").Path({str(tmp_path)!r}).glob(".*"))) == 1\n'
        '    os.kill(os.getpid(), signal.SIGINT)\n'
        'McapRecorder.write = tables._write_parquet = interrupted\n'
        'sys.exit(cli.main(sys.argv[1:]))\n'
    )
    output = {'replay': ['-o', f'{tmp_path}/x.parquet'], 'convert': [f'{tmp_path}/x.mcap']}
    done = subprocess.run(
        [sys.executable, '-c', script, command, three_logs[0], *output[command]],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 130
    assert done.stderr == 'flightdyn: interrupted\n'
    assert sorted(p.name for p in tmp_path.iterdir()) == ['first.csv', 'last.csv', 'none.csv']


def test_interrupt_ends_planning_with_130(tmp_path: Path) -> None:
    # 5000 nodes take far longer than the test; the signal is sent once the solver iterates
    script = (
        'import os, signal, sys, threading\n'
        'from flightdyn.planning import solver\n'
        'from flightdyn.cli import main\n'
        'original = solver._Watch.__call__\n'
        'def call(self, *arguments):\n'
        '    if self.count == 3: os.kill(os.getpid(), signal.SIGINT)\n'
        '    return original(self, *arguments)\n'
        'solver._Watch.__call__ = call\n'
        f'sys.exit(main(["plan", "quadcopter_flip", "-o", "{tmp_path}/plan.json"]))\n'
    )
    done = subprocess.run(
        [sys.executable, '-c', script], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 130
    assert 'Traceback' not in done.stderr
    assert json.loads((tmp_path / 'plan.json').read_text())['converged'] is False


def test_closed_pipe_is_no_error() -> None:
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run(
        [sys.executable, '-m', 'flightdyn', 'models'],
        stdout=write,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    os.close(write)
    assert 'Traceback' not in done.stderr
    assert done.returncode != -signal.SIGPIPE
