"""`flightdyn view`: every kind of file, every way out, and what is refused."""

import json
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('rerun')
pytest.importorskip('pyarrow')

from recordings import read

from flightdyn import cli_view, tables
from flightdyn.cli import main
from flightdyn.planning.plan_file import KEYS

DATA = Path(__file__).parents[1] / 'data'
THERMAL = str(DATA / 'discus2_thermal.mcap')
STATES = {'x_e': [0.0, 1.0, 2.0], 'z_e': [0.0, -1.0, -1.5], 'speed': [1.0, 1.0, 1.0]}


@pytest.fixture(autouse=True)
def no_display(monkeypatch):
    monkeypatch.setattr(sys, 'platform', 'linux')
    monkeypatch.delenv('DISPLAY', raising=False)
    monkeypatch.delenv('WAYLAND_DISPLAY', raising=False)


def plan_file(path, **more):
    document = dict.fromkeys(KEYS, '')
    document |= {
        'time': [0.0, 1.0, 2.0], 'states': STATES, 'controls': {}, 'outputs': {},
        'control_interpolation': 'linear', 'iterations': 7, 'wall_s': 0.1, 'objective': 2.0,
        'arcs': [{'start': 0.0, 'end': 1.0, 'limits': {'thrust': 'upper'}},
                 {'start': 1.0, 'end': 2.0, 'limits': {}}], 'verified': True,
    }  # fmt: skip
    path.write_text(json.dumps(document | more))
    return str(path)


def saved(tmp_path, *arguments):
    """Return the recording that a call saves."""
    path = tmp_path / 'saved.rrd'
    assert main(['view', *arguments, '--save', str(path)]) == 0
    return read(path)


def test_a_plan_has_its_solver_and_arcs_on_the_timeline(tmp_path):
    data = saved(tmp_path, plan_file(tmp_path / 'a.json'), '--color', 'altitude')
    texts = [t[0] for name, rows in data['/events'].items() if name.endswith('text') for t in rows]
    assert any(text.startswith('planner: ') and '7 iterations' in text for text in texts)
    states = [row for name, rows in data['/lanes/arc'].items() if 'state' in name for row in rows]
    assert states == [['thrust upper'], ['free']]
    assert '/lanes/phase' not in data


def test_phases_of_a_plan_have_a_lane(tmp_path):
    phases = [
        {'name': 'climb', 'start': 0.0, 'end': 0.5},
        {'name': 'glide', 'start': 0.5, 'end': 2.0},
    ]
    data = saved(tmp_path, plan_file(tmp_path / 'a.json', phases=phases))
    names = [r for name, rows in data['/lanes/phase'].items() if 'state' in name for r in rows]
    assert names == [['climb'], ['glide']]
    gate = {'centre': [0, 5, 10], 'heading': 0.0, 'width': 2.0, 'height': 2.0}
    through = {'gates': {'glide': gate}}
    data = saved(tmp_path, plan_file(tmp_path / 'b.json', phases=phases, surroundings=through))
    assert '/lanes/phase' not in data  # these are the gate's, which has a lane of its own


def test_tables_and_simulations_are_flights_too(tmp_path):
    columns = {'time': np.arange(3.0), **{k: np.array(v) for k, v in STATES.items()}}
    for name in ('a.parquet', 'a.csv'):
        tables.write_table(columns, tmp_path / name, {'vehicle': 'glider'} if 'p' in name else {})
        opened = cli_view.open_flight(tmp_path / name)
        np.testing.assert_allclose(opened.flight['z_e'], STATES['z_e'])
    assert cli_view.open_flight(tmp_path / 'a.parquet').flight.vehicle == 'glider'
    document = {'scenario': 's', 'time': [0, 1, 2], 'states': STATES, 'controls': {},
                'outputs': {}, 'vehicle': 'balloon', 'model': 'x'}  # fmt: skip
    (tmp_path / 's.json').write_text(json.dumps(document))
    assert cli_view.open_flight(tmp_path / 's.json').flight.vehicle == 'balloon'


def test_logs_and_their_replays_are_the_same_flight(tmp_path):
    assert main(['replay', THERMAL, '-o', str(tmp_path / 'a.parquet')]) == 0
    log = cli_view.open_flight(Path(THERMAL))
    table = cli_view.open_flight(tmp_path / 'a.parquet')
    np.testing.assert_allclose(log.flight['speed'], table.flight['speed'])
    assert log.document['used'] == len(log.flight)


def test_a_folder_is_compared_and_a_bad_file_in_it_told(tmp_path, capsys):
    folder = tmp_path / 'in'
    folder.mkdir()
    for name in ('one', 'two'):
        plan_file(folder / f'{name}.json')
    (folder / 'bad.json').write_text('{')
    data = saved(tmp_path, str(folder), '--align', 'highest')
    assert {'/world/flights/one', '/world/flights/two'} <= data.keys()
    assert 'bad.json' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('arguments', 'said'),
    [
        (['{plan}'], 'no display'),
        (['nothing.json', '--save', '{out}'], 'no file nothing.json'),
        (['{plan}', '--save', 'a.txt'], "suffix '.txt', not .rrd"),
        (['{plan}', '--shot', 'a.jpg'], "suffix '.jpg', not .png"),
        (['{plan}', '--save', '{out}', '--color', 'sped'], "did you mean 'speed'"),
        (['{plan}', '--save', '{out}', '--align', 'start'], '--align is of several flights'),
        (['{plan}', '--save', '{out}', '--time', '1'], 'give --shot FILE'),
        (['{plan}', '{plan}', '--save', '{out}', '--color', 'alpha'], '--color is of one flight'),
        (['{plan}', '--shot', '{png}', '--size', '9x9'], 'expected such as 1600x1000'),
        (['{bad}', '--save', '{out}'], 'is not JSON'),
        (['{rrd}', '{plan}', '--save', '{out}'], 'not both'),
        (['{rrd}', '--save', '{out}'], 'is a recording already'),
        (['{empty}', '--save', '{out}'], 'nothing in the folder'),
    ],
)
def test_what_cannot_be_shown_is_one_clear_line(tmp_path, capsys, arguments, said):
    (tmp_path / 'bad.json').write_text('{')
    (tmp_path / 'a.rrd').write_bytes(b'')
    (tmp_path / 'empty').mkdir()
    names = {
        'plan': plan_file(tmp_path / 'a.json'), 'out': str(tmp_path / 'o.rrd'),
        'png': str(tmp_path / 'o.png'), 'bad': str(tmp_path / 'bad.json'),
        'rrd': str(tmp_path / 'a.rrd'), 'empty': str(tmp_path / 'empty'),
    }  # fmt: skip
    assert main(['view', *(a.format(**names) for a in arguments)]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count('\n') == 1
    assert not (tmp_path / 'o.rrd').exists()


@pytest.mark.slow
@pytest.mark.parametrize(('number', 'code'), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_browsers_on_this_machine_are_served_until_interrupted(tmp_path, number, code):
    command = [sys.executable, '-m', 'flightdyn', 'view', plan_file(tmp_path / 'a.json')]
    process = subprocess.Popen([*command, '--web'], stdout=subprocess.PIPE, text=True)
    try:
        url = process.stdout.readline().strip()
        assert url.startswith('http://127.0.0.1:')
        with urllib.request.urlopen(url, timeout=10) as page:
            assert b'rerun' in page.read().lower()
        process.send_signal(number)
        assert process.wait(15) == code
        with pytest.raises(OSError, match='refused'):  # the server is gone as well
            urllib.request.urlopen(url, timeout=5)
    finally:
        process.kill()
        process.wait()


def test_plans_can_be_watched_only_where_a_viewer_listens(capsys):
    assert main(['plan', 'quadcopter_flip', '--live', 'rerun+http://127.0.0.1:1/proxy']) == 2
    assert 'no viewer at rerun+http://127.0.0.1:1/proxy' in capsys.readouterr().err
