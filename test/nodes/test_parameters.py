"""Parameters: the shipped files against the declarations, and what is refused."""

from dataclasses import dataclass, fields
from typing import Any

import pytest
import yaml
from ros_support import ROOT, need_ros

need_ros()

from flightdyn.errors import InputError  # noqa: E402
from flightdyn.nodes.parameters import checked, parameter  # noqa: E402
from flightdyn.nodes.planner_node import PlannerParameters  # noqa: E402
from flightdyn.nodes.replay_node import ReplayParameters  # noqa: E402
from flightdyn.nodes.sim_node import SimParameters  # noqa: E402


@pytest.mark.parametrize(
    ('name', 'kind'),
    [('planner', PlannerParameters), ('sim', SimParameters), ('replay', ReplayParameters)],
)
def test_shipped_file_names_every_parameter_with_its_default(name: str, kind: Any) -> None:
    document = yaml.safe_load((ROOT / 'config' / f'{name}.yaml').read_text(encoding='utf-8'))
    shipped = document[f'/**/{name}']['ros__parameters']
    declared = {
        item.name: list(item.default) if isinstance(item.default, tuple) else item.default
        for item in fields(kind)
    }
    assert shipped == declared
    assert [type(value) for value in shipped.values()] == [type(v) for v in declared.values()]


@dataclass(frozen=True)
class Sample:
    rate: float = parameter(1.0, 'x', lower=0.0, upper=2.0)
    word: str = parameter('a', 'x', choices=('a', 'b'))
    flag: bool = parameter(False, 'x')
    wind: tuple[float, ...] = parameter((0.0, 0.0), 'x', length=2)


FIELDS = {item.name: item for item in fields(Sample)}


def test_whole_numbers_are_numbers() -> None:
    assert checked(FIELDS['rate'], 2) == 2.0
    assert checked(FIELDS['wind'], [1, 2]) == (1.0, 2.0)


@pytest.mark.parametrize(
    ('name', 'value', 'words'),
    [
        ('rate', 3.0, '0 to 2'),
        ('rate', float('nan'), '0 to 2'),
        ('rate', True, 'a number'),
        ('rate', 'fast', 'a number'),
        ('word', 'c', 'a or b'),
        ('word', 1, 'text'),
        ('flag', 1, 'true or false'),
        ('wind', [1.0], '2 finite'),
        ('wind', [1.0, float('inf')], '2 finite'),
        ('wind', 1.0, 'array'),
    ],
)
def test_wrong_values_are_refused_with_what_is_right(name: str, value: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        checked(FIELDS[name], value)
