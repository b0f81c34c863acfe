"""What launch files ask for, seen through stand-ins for launch and launch_ros: no wheels exist."""

import re
import runpy
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
DEMOS = sorted(path.stem for path in (ROOT / 'config/demos').glob('*.yaml'))

# What the launch files use of these packages, as documented for ROS 2 Humble to Kilted.
NAMES = {
    'launch': ('LaunchDescription',),
    'launch.actions': ('DeclareLaunchArgument', 'ExecuteProcess'),
    'launch.conditions': ('IfCondition',),
    'launch.substitutions': ('LaunchConfiguration', 'PathJoinSubstitution', 'PythonExpression'),
    'launch_ros': (),
    'launch_ros.actions': ('Node',),
    'launch_ros.parameter_descriptions': ('ParameterValue',),
    'launch_ros.substitutions': ('FindPackageShare',),
}


class Stand:
    """Remembers what it was made of."""

    def __init__(self, *given: Any, **named: Any) -> None:
        self.given, self.named = given, named


def described(name: str, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Return the entities of a launch file."""
    for module, members in NAMES.items():
        stand = ModuleType(module)
        for member in members:
            setattr(stand, member, type(member, (Stand,), {}))
        monkeypatch.setitem(sys.modules, module, stand)
    found = runpy.run_path(str(ROOT / f'launch/{name}.launch.py'))['generate_launch_description']()
    return list(found.given[0])


def kind(entity: Any) -> str:
    return type(entity).__name__


def text_of(substitution: Any, arguments: dict[str, str]) -> str:
    """Return what a substitution becomes."""
    if isinstance(substitution, str):
        return substitution
    if kind(substitution) == 'LaunchConfiguration':
        return arguments[substitution.given[0]]
    if kind(substitution) == 'FindPackageShare':
        return str(ROOT)
    parts = [text_of(part, arguments) for part in substitution.given[0]]
    if kind(substitution) == 'PathJoinSubstitution':
        return str(Path(*parts))
    assert kind(substitution) == 'PythonExpression'
    quoted = re.fullmatch(r"'([^']*)'( == '([^']*)')?", ''.join(parts))
    assert quoted is not None
    return quoted[1] if quoted[2] is None else str(quoted[1] == quoted[3])


def declared(entities: list[Any]) -> dict[str, str]:
    """Return the arguments and their defaults."""
    arguments: dict[str, str] = {}
    for entity in entities:
        if kind(entity) == 'DeclareLaunchArgument':
            assert re.search('[a-z]{2}', entity.named['description'])
            default = entity.named.get('default_value')
            name = entity.given[0]
            arguments[name] = '/a.mcap' if default is None else text_of(default, arguments)
    return arguments


def parameters_of(file: Path, node: str) -> set[str]:
    sections = yaml.safe_load(file.read_text(encoding='utf-8'))
    wanted = [sections[name] for name in ('/**', f'/**/{node}') if name in sections]
    return {key for section in wanted for key in section['ros__parameters']}


@pytest.mark.parametrize('name', ['flightdyn', 'replay'])
def test_nodes_get_parameters_that_they_have(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    entities = described(name, monkeypatch)
    arguments = declared(entities)
    nodes = [entity for entity in entities if kind(entity) == 'Node']
    assert nodes
    for node in nodes:
        own = node.named['executable']
        known = parameters_of(ROOT / f'config/{own}.yaml', own)
        assert text_of(node.named['namespace'], arguments) == ''
        *files, last = node.named['parameters']
        assert set(last) <= known, own
        for value in last.values():
            assert value.given[0].given[0] in arguments
            assert value.named['value_type'] in (str, float, bool)
        for file in files:
            assert parameters_of(Path(text_of(file, arguments)), own) <= known


@pytest.mark.parametrize('demo', DEMOS)
def test_demos_are_offered_and_set_what_there_is(
    demo: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    entities = described('flightdyn', monkeypatch)
    (choices,) = (
        entity.named['choices']
        for entity in entities
        if kind(entity) == 'DeclareLaunchArgument' and entity.given[0] == 'demo'
    )
    assert sorted(choices) == DEMOS
    arguments = {**declared(entities), 'demo': demo}
    for node in (entity for entity in entities if kind(entity) == 'Node'):
        own = node.named['executable']
        file = Path(text_of(node.named['parameters'][1], arguments))
        assert file == ROOT / f'config/demos/{demo}.yaml'
        known = parameters_of(ROOT / f'config/{own}.yaml', own)
        assert parameters_of(file, own) <= known | {'use_sim_time'}
    (goal,) = (entity for entity in entities if kind(entity) == 'ExecuteProcess')
    assert text_of(goal.named['condition'].given[0], arguments) == str(demo == 'flip')
    problem = yaml.safe_load(goal.named['cmd'][-1])['problem']
    assert (ROOT / f'config/problems/{problem}.yaml').is_file()
