"""Sweeps are read strictly, and make of each case the problem that is meant."""

import math
from pathlib import Path
from typing import Any

import pytest
import yaml

from flightdyn.errors import InputError
from flightdyn.planning.sweep import Sweep
from flightdyn.planning.sweep_file import MAX_CASES, load_sweep
from flightdyn.resources import list_configs

WIND = 'wind_ned[0]'
GOOD: dict[str, Any] = {
    'problem': 'cessna152_turnback',
    'over': {
        WIND: {'from': -5, 'to': 5, 'steps': 3},
        'bank': ['30 deg', '45 deg'],
    },
    'settings': {'path.bank': ['{-bank}', '{bank}'], 'nodes': 12},
    'value': {'height': 'initial.altitude - final.altitude'},
}


def read(folder: Path, **changes: Any) -> Sweep:
    path = folder / 'sweep.yaml'
    path.write_text(yaml.safe_dump({**GOOD, **changes}, sort_keys=False))
    return load_sweep(str(path))


def test_a_grid_goes_over_every_combination(tmp_path: Path) -> None:
    sweep = read(tmp_path)
    cases = list(sweep.cases())
    assert [case.number for case in cases] == list(range(6))
    bank = [math.radians(30), math.radians(45)]
    assert [list(case.parameters.values()) for case in cases] == [
        [wind, b] for wind in (-5.0, 0.0, 5.0) for b in bank
    ]
    problem = sweep.load(cases[5])
    assert problem.wind_ned == (5.0, 0.0, 0.0)
    assert problem.path['bank'] == pytest.approx((-bank[1], bank[1]), abs=1e-15)
    assert problem.nodes == 12
    assert sweep.told(cases[5]) == {WIND: 5.0, 'bank': bank[1]}
    # one step apart along each axis, whatever the units
    assert (sweep.places[[2, 1]] - sweep.places[0]).round(12).tolist() == [[1, 0], [0, 1]]


@pytest.mark.parametrize('sampling', ['random', 'latin_hypercube'])
def test_samples_fill_ranges_and_choose_among_values(tmp_path: Path, sampling: str) -> None:
    over = {
        'initial.altitude': {'from': 100, 'to': 200},
        'vehicle': ['cessna152', 'cessna152_calibrated'],
    }
    changes = {'sampling': sampling, 'samples': 40, 'over': over, 'settings': {}}
    cases = list(read(tmp_path, **changes, seed=3).cases())
    heights = [case.parameters['initial.altitude'] for case in cases]
    assert len(set(heights)) == 40
    assert 100 <= min(heights) < 115 and 185 < max(heights) <= 200
    assert {case.parameters['vehicle'] for case in cases} == set(over['vehicle'])
    assert cases == list(read(tmp_path, **changes, seed=3).cases())
    assert cases != list(read(tmp_path, **changes, seed=4).cases())


def test_values_may_be_anything(tmp_path: Path) -> None:
    over = {
        'wind_ned': [[0, 0, 0], [5, 0, 0]],
        'nodes': [10, 20],
        'path.alpha[1]': ['10 deg', '11 deg'],
        'refine': [True, False],
    }
    sweep = read(tmp_path, over=over, settings={'objective': 'time'})
    cases = list(sweep.cases())
    problem = sweep.load(cases[-1])
    assert problem.wind_ned == (5.0, 0.0, 0.0)
    assert problem.nodes == 20
    assert problem.path['alpha'][1] == 11.0  # degrees inside, too
    assert problem.refine is False
    told = sweep.told(cases[-1])
    assert told == {'wind_ned': '[5, 0, 0]', 'nodes': 20, 'path.alpha[1]': 11.0, 'refine': 'false'}


def test_numbers_in_formulas_of_settings_keep_their_sign(tmp_path: Path) -> None:
    settings = {'objective': {'minimize': 'final.x_e*{a}**2 + {2*a}*duration'}, 'nodes': 9}
    sweep = read(tmp_path, over={'a': [-3, 2]}, settings=settings)
    first = sweep.load(next(sweep.cases()))
    assert first.objective.expression.source == 'final.x_e*(-3)**2 + (-6.0)*duration'


@pytest.mark.parametrize(
    ('changes', 'said'),
    [
        ({'ovre': {}}, "unknown 'ovre', did you mean 'over'"),
        ({'over': {}}, 'over: nothing is varied'),
        ({'over': 3}, 'over: expected names and values, got 3'),
        ({'over': {'a': 3}}, 'over.a: expected [values] or {from, to, steps}, got 3'),
        ({'over': {'nodes': []}}, 'over.nodes: expected one or more values'),
        ({'over': {'nodes': [5, 6, 5]}}, 'over.nodes: 5 stands there twice'),
        ({'over': {'nodes': [5, math.inf]}}, 'over.nodes: must be finite'),
        ({'over': {'nodes': {'from': 1, 'to': 2}}}, "over.nodes: 'steps' is missing"),
        ({'over': {'nodes': {'from': 1, 'till': 2}}}, "unknown 'till'"),
        ({'over': {'nodes': {'from': 2, 'to': 2, 'steps': 3}}}, 'from 2 to 2 nothing varies'),
        ({'over': {'initail.x_e': [1, 2]}}, "did you mean 'initial'"),
        ({'over': {'bnk': [1, 2]}}, 'has to stand in settings as {bnk}'),
        ({'settings': {'pth.bank': 1}}, "settings: unknown 'pth.bank', did you mean 'path'"),
        ({'settings': {'nodes': '{bnak}'}}, "unknown 'bnak', did you mean 'bank'"),
        ({'settings': {'nodes': '{1/0*bank}'}}, 'is not a finite number'),
        ({'sampling': 'sobol'}, 'sampling: must be grid or random or latin_hypercube'),
        ({'sampling': 'random'}, "'samples' is missing"),
        ({'samples': 5}, 'samples: a grid has none'),
        ({'start': 'warm'}, 'start: must be near or cold or both'),
        ({'plans': 'parquet'}, 'plans: must be .parquet or .csv'),
        ({'value': {'h': 'final.'}}, 'value.h: not a formula'),
        ({'value': {'bank': 'final.x_e'}}, "another column 'bank'"),
        ({'value': {'error': 'final.x_e'}}, "another column 'error'"),
        ({'picture': {'value': 'heigth'}}, "unknown 'heigth', did you mean 'height'"),
        ({'picture': {'over': ['bnak']}}, "picture.over: unknown 'bnak', did you mean 'bank'"),
        ({'picture': {'units': {'x': 'm'}}}, "picture.units: unknown 'x'"),
        ({'footprint': {'around': 'bnak'}}, "footprint.around: unknown 'bnak'"),
        ({'footprint': {'place': {'lat': 47}}}, "place: 'lon' is missing"),
        ({'footprint': {'place': {'lat': 91, 'lon': 0}}}, 'latitude must be within 90'),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, changes: dict[str, Any], said: str) -> None:
    if 'settings' in changes:
        changes = {'settings': {**GOOD['settings'], **changes['settings']}}
    with pytest.raises(InputError) as found:
        list(read(tmp_path, **changes).cases())
    assert said in str(found.value)
    assert 'sweep' in str(found.value)


def test_a_sweep_is_of_a_bounded_size(tmp_path: Path) -> None:
    over = {key: {'from': 0, 'to': 1, 'steps': 1000} for key in ('nodes', 'tolerance')}
    with pytest.raises(InputError, match=f'1000000 cases: at most {MAX_CASES}'):
        read(tmp_path, over=over, settings={})


def test_a_problem_beside_the_sweep(tmp_path: Path) -> None:
    (tmp_path / 'mine.yaml').write_text(
        'vehicle: quadcopter\nduration: {lower: 0.1, upper: 5, guess: 1}\n'
    )
    sweep = read(tmp_path, problem='mine.yaml', over={'nodes': [5, 6]}, settings={})
    assert sweep.load(next(sweep.cases())).name == 'mine'


def test_no_such_sweep_names_those_there_are() -> None:
    with pytest.raises(InputError, match=r"no sweep 'x'; known: .*cessna152_reach"):
        load_sweep('x')


@pytest.mark.parametrize('name', list_configs('sweeps'))
def test_a_shipped_sweep_is_described_and_all_its_cases_are_problems(name: str) -> None:
    sweep = load_sweep(name)
    assert sweep.description
    assert sweep.picture is not None or sweep.footprint is not None
    cases = list(sweep.cases())
    for case in cases[:: max(1, len(cases) // 10)]:
        sweep.load(case)
