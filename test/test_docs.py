"""What docs/ shows works, and leaves out no key, problem or sweep."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from flightdyn.cli import _parser
from flightdyn.environment import surroundings_file, wind_file
from flightdyn.environment.surroundings_file import read_surroundings
from flightdyn.planning import problem_file, sweep_file
from flightdyn.planning.objective import parse_objective
from flightdyn.planning.planner import Planner
from flightdyn.planning.sweep import COLUMNS, SAMPLINGS, STARTS
from flightdyn.resources import list_configs
from flightdyn.vehicles import aero_direct, aero_polar, aero_table, body_drag, buoyancy, vehicle

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / 'docs' / 'planning.md').read_text(encoding='utf-8')
BLOCKS = re.findall(r'^```yaml\n(.*?)^```', TEXT, re.MULTILINE | re.DOTALL)


def block(key: str) -> str:
    return next(text for text in BLOCKS if key in yaml.safe_load(text))


def test_the_problem_is_planned_on_the_vehicle(tmp_path: Path) -> None:
    for folder, name, text in (
        ('vehicles', 'model_plane', block('mass')),
        ('problems', 'climb', block('vehicle')),
    ):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / f'{name}.yaml').write_text(text)
    climb = problem_file.load_problem('climb', config_dir=tmp_path)
    plan = Planner().plan(climb)
    assert plan.report.verified, plan.report.message
    assert climb.vehicle.rates['flaps'] == 0.3


def test_the_objective_is_one() -> None:
    (short,) = (text for text in BLOCKS if list(yaml.safe_load(text)) == ['objective'])
    parse_objective(yaml.safe_load(short)['objective'], 'docs')


def test_the_wind_is_one() -> None:
    (short,) = (text for text in BLOCKS if list(yaml.safe_load(text)) == ['wind'])
    wind = wind_file.read_wind(yaml.safe_load(short)['wind'], 'docs')
    assert wind is not None
    assert wind(1500.0, 0.0, -100.0, 0.0)[2] == pytest.approx(-3)
    told = set(re.findall(r'^\| `(\w+)` \|', TEXT, re.MULTILINE))
    assert set(wind_file.KEYS) <= told


def test_the_surroundings_are_read(tmp_path: Path) -> None:
    line = np.array([0.0, 1000.0])
    np.savez(tmp_path / 'ridge.npz', x=line, y=line, height=np.zeros((2, 2)))
    given = yaml.safe_load(block('keep_out'))
    found = read_surroundings(
        {key: given[key] for key in surroundings_file.KEYS}, 'docs', tmp_path
    )
    assert set(given) == {*surroundings_file.KEYS, 'origin'}
    assert len(found.keep_out) == len(found.gates) == 2 and found.listeners


@pytest.mark.parametrize(
    'keys',
    [
        *(problem_file.KEYS, vehicle.KEYS, aero_polar.KEYS, aero_table.KEYS, aero_direct.KEYS),
        *(surroundings_file.TERRAIN_KEYS, surroundings_file.KEEP_OUT_KEYS),
        *(surroundings_file.GATE_KEYS, surroundings_file.MARK_KEYS),
        *(buoyancy.KEYS, body_drag.KEYS, *(known for known, _ in vehicle.PROPULSION.values())),
        *wind_file.KEYS.values(),
    ],
)
def test_every_key_is_told(keys: tuple[str, ...]) -> None:
    told = set(re.findall(r'\w+', ' '.join(re.findall(r'`[^`\n]+`', TEXT))))
    assert set(keys) <= told


def test_the_sweep_is_one_and_every_key_of_a_sweep_is_told(tmp_path: Path) -> None:
    text = (ROOT / 'docs' / 'sweeps.md').read_text(encoding='utf-8')
    (block,) = re.findall(r'^```yaml\n(.*?)^```', text, re.MULTILINE | re.DOTALL)
    (tmp_path / 'glide.yaml').write_text(block)
    sweep = sweep_file.load_sweep(str(tmp_path / 'glide.yaml'))
    cases = list(sweep.cases())
    assert len(cases) == 9
    assert sweep.load(cases[-1]).wind_ned == (5.0, 0.0, 0.0)
    told = set(re.findall(r'\w+', ' '.join(re.findall(r'`[^`\n]+`', text))))
    keys = {*sweep_file.KEYS, *sweep_file.RANGE_KEYS, *sweep_file.PICTURE_KEYS}
    assert keys | {*sweep_file.FOOTPRINT_KEYS, *COLUMNS, *SAMPLINGS, *STARTS} <= told


PROBLEMS = (ROOT / 'docs' / 'problems.md').read_text(encoding='utf-8')


@pytest.mark.parametrize('kind', ['problems', 'sweeps'])
def test_each_shipped_problem_and_sweep_has_its_line(kind: str) -> None:
    rows = [line for line in PROBLEMS.splitlines() if line.startswith('| [`')]
    names = [row.split('`')[1] for row in rows if f'../config/{kind}/' in row]
    assert sorted(names) == sorted(list_configs(kind))
    for row in rows:
        name = row.split('`')[1]
        assert f'](../config/{kind}/{name}.yaml)' in row or f'../config/{kind}/' not in row
        if '../config/problems/' in row:
            assert f'`flightdyn plan {name} ' in row
    for picture in re.findall(r'\]\((pictures/[^)]+)\)', PROBLEMS):
        assert (ROOT / 'docs' / picture).is_file(), picture


def test_commands_of_the_page_are_of_problems() -> None:
    for command in re.findall(r'`flightdyn plan (\S+ --set [^`]+) -o', PROBLEMS):
        name, _, *settings = shlex.split(command)
        problem_file.load_problem(name, [each for each in settings if each != '--set'])


def test_a_problem_of_your_own_is_short_and_planned(tmp_path: Path) -> None:
    (block,) = re.findall(r'^```yaml\n(.*?)^```', PROBLEMS, re.MULTILINE | re.DOTALL)
    assert len(block.splitlines()) < 40
    (tmp_path / 'hop.yaml').write_text(block)
    hop = problem_file.load_problem(str(tmp_path / 'hop.yaml'), ['max_wall_time=600'])
    plan = Planner().plan(hop)
    assert plan.report.verified, plan.report.message
    assert plan.trajectory.sample('z_e', plan.trajectory.time).min() < -4 + 1e-3


def test_every_example_is_listed() -> None:
    files = {path.name for path in (ROOT / 'examples').glob('*.py')} - {'common.py'}
    assert files == set(re.findall(r'`(\w+\.py)`', TEXT.partition('## Examples')[2]))


def test_viewing_code_runs_and_commands_exist(tmp_path: Path) -> None:
    pytest.importorskip('rerun')
    text = (ROOT / 'docs' / 'viewing.md').read_text(encoding='utf-8')
    for name, run in re.findall(
        r'^```python( no-run)?\n(.*?)^```', text, re.MULTILINE | re.DOTALL
    ):
        compile(run, 'docs/viewing.md', 'exec')
        if not name:
            subprocess.run([sys.executable, '-c', run], cwd=tmp_path, check=True)
            assert len(list(tmp_path.glob('*.rrd'))) == 4
    from flightdyn.viewing import coloring, flights_view

    commands = re.findall(r'^flightdyn (.*)$', text, re.MULTILINE)
    assert len(commands) > 6
    for command in commands:
        _parser().parse_args(shlex.split(command))
    for moment in flights_view.MOMENTS:
        assert f'`{moment}`' in text or f'--align {moment}' in text
    for quantity in coloring.DERIVED:
        assert f'`{quantity}`' in text
