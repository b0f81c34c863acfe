"""Problems with alternatives: each is planned, the best is returned, and all are told."""

import json
from pathlib import Path
from typing import Any

import pytest
import yaml

from flightdyn.cli import main
from flightdyn.errors import InputError, ResultCode
from flightdyn.planning.plan_file import plan_document
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem import Problem
from flightdyn.planning.problem_file import load_problem

# thrust straight up on a mass: the longer flight is the better one
DOCUMENT: dict[str, Any] = {
    'vehicle': 'rocket',
    'objective': {'minimize': 'initial.mass - final.mass'},
    'duration': 20,
    'initial': {'altitude': 0, 'w_e': 0, 'mass': 500.0e3},
    'guess': {'altitude': [0, 4000], 'w_e': [0, -400], 'mass': [500.0e3, 400.0e3], 'thrust': 8e6},
    'nodes': 10,
    'alternatives': {
        'high': {'final': {'altitude': 6000}},
        'low': {'final': {'altitude': 3000}},
        'middle': {'final': {'altitude': 4000}, 'nodes': 12},
    },
}


def problem(folder: Path, **more: Any) -> Problem:
    (folder / 'choice.yaml').write_text(yaml.safe_dump({**DOCUMENT, **more}, sort_keys=False))
    return load_problem(str(folder / 'choice.yaml'))


def test_the_best_is_returned_and_each_is_told(tmp_path: Path) -> None:
    choice = problem(tmp_path)
    plan = Planner().plan(choice)
    assert plan.report.verified and plan.report.message.startswith('low: ')
    assert -plan.trajectory['z_e'][-1] == pytest.approx(3000, abs=0.01)
    assert [each.name for each in plan.alternatives] == ['low', 'middle', 'high']
    used = [each.objective for each in plan.alternatives]
    assert used == sorted(used) and used[0] == plan.report.objective
    alone = Planner().plan(choice.alternatives[2][1])
    assert plan.alternatives[1].objective == pytest.approx(alone.report.objective, rel=1e-9)
    document = json.loads(json.dumps(plan_document(plan)))
    assert [each['name'] for each in document['alternatives']] == ['low', 'middle', 'high']


def test_conditions_add_up_name_by_name(tmp_path: Path) -> None:
    choice = problem(tmp_path, final={'w_e': -300})
    for _, each in choice.alternatives:
        assert each.final['w_e'] == (-300, -300) and 'z_e' in each.final
    changed = choice.with_changes(initial={'mass': (450e3, 450e3)})
    assert all(each.initial['mass'] == (450e3, 450e3) for _, each in changed.alternatives)


def test_what_cannot_be_reached_comes_last(tmp_path: Path) -> None:
    never = {'final': {'altitude': 3000}, 'path': {'altitude': [0, 2000]}}
    with pytest.raises(InputError, match=r'final.*outside.*\(in alternatives\.never\)'):
        problem(tmp_path, alternatives={'never': never})
    slow = {'final': {'altitude': 3000}, 'path': {'w_e': [-100, 0]}}
    plan = Planner().plan(
        problem(tmp_path, alternatives={'slow': slow, 'low': DOCUMENT['alternatives']['low']})
    )
    assert plan.report.verified
    assert [(each.name, each.verified) for each in plan.alternatives] == [
        ('low', True),
        ('slow', False),
    ]
    assert 'w_e' in plan.alternatives[1].message or 'z_e' in plan.alternatives[1].message


def test_a_cancelled_one_is_the_last(tmp_path: Path) -> None:
    plan = Planner().plan(problem(tmp_path), should_stop=lambda: True)
    assert plan.report.code == ResultCode.CANCELLED
    assert len(plan.alternatives) == 1


def test_they_are_refused_where_they_do_not_compare(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="unknown 'vehicle'"):
        problem(tmp_path, alternatives={'other': {'vehicle': 'quadcopter'}})
    with pytest.raises(InputError, match='expected names'):
        problem(tmp_path, alternatives=[1])
    far = {'final': {'altitude': 3000}, 'objective': {'maximize': 'final.mass'}}
    with pytest.raises(InputError, match='minimized or maximized'):
        problem(tmp_path, alternatives={**DOCUMENT['alternatives'], 'far': far})


def test_the_command_line_lists_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    problem(tmp_path)
    assert main(['plan', str(tmp_path / 'choice.yaml')]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if 'alternative' in line]
    assert [line.split()[1] for line in lines] == ['low', 'middle', 'high']
