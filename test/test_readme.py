"""Every command and every piece of code in README.md works, or is checked as far as it can be."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
README = ROOT / 'README.md'
TEXT = README.read_text(encoding='utf-8')


def blocks(language: str) -> list[str]:
    return re.findall(rf'^```{language}\n(.*?)^```', TEXT, re.MULTILINE | re.DOTALL)


COMMANDS = [line for block in blocks('sh') for line in block.splitlines()]


def commands(*start: str) -> list[list[str]]:
    return [c for c in map(shlex.split, COMMANDS) if tuple(c[: len(start)]) == start]


def test_every_command_is_checked_below() -> None:
    known = {
        'make',
        'flightdyn',
        'rerun',
        'ros2 launch',
        'ros2 action',
        'colcon',
        '. install/setup.bash',
    }
    for command in COMMANDS:
        words = command.split()
        assert {words[0], ' '.join(words[:2])} & known, command


def test_two_commands_set_up() -> None:
    assert [' '.join(c) for c in commands('make')] == ['make demo', 'make test']
    makefile = (ROOT / 'Makefile').read_text(encoding='utf-8')
    for _, target in commands('make'):
        assert re.search(rf'^{target}: setup ', makefile, re.MULTILINE)


@pytest.mark.parametrize('code', blocks('python'))
def test_python(code: str, tmp_path: Path) -> None:
    subprocess.run([sys.executable, '-c', code], cwd=tmp_path, check=True)


def test_command_line(tmp_path: Path) -> None:
    (tmp_path / 'test').symlink_to(ROOT / 'test')
    for command in commands('flightdyn'):
        run = 'import sys; from flightdyn.cli import main; sys.exit(main())'
        subprocess.run([sys.executable, '-c', run, *command[1:]], cwd=tmp_path, check=True)
        if '-o' in command:
            for name in command[command.index('-o') + 1 :]:
                assert (tmp_path / name).stat().st_size > 0
    for _, recording in commands('rerun'):  # the viewer needs a screen
        assert (tmp_path / recording).is_file()


# `ros2` is not among the wheels, so what it would look up is checked instead.


@pytest.mark.parametrize(
    'page', [README, *sorted((ROOT / 'docs').glob('*.md'))], ids=lambda page: page.name
)
def test_pages_are_whole(page: Path) -> None:
    """A merge once left its marks in the README, and links may outlive what they lead to."""
    text = page.read_text(encoding='utf-8')
    assert not re.search(r'^(<{7}|={7}|>{7})( |$)', text, re.MULTILINE)
    for link in re.findall(r'\]\(([^)#\s]+)', text):
        assert '://' in link or (page.parent / link).exists(), link


def test_launch_files_and_their_arguments_exist() -> None:
    for _, _, package, file, *arguments in commands('ros2', 'launch'):
        assert package == 'flightdyn'
        text = (ROOT / 'launch' / file).read_text(encoding='utf-8')
        for argument in arguments:
            name = re.escape(argument.partition(':=')[0])
            assert re.search(rf"DeclareLaunchArgument\(\s*'{name}'", text)


def test_goal_is_a_valid_one() -> None:
    for _, _, verb, name, type_, goal in commands('ros2', 'action'):
        assert (verb, name) == ('send_goal', '/planner/plan_trajectory')
        definition = (ROOT / f'{type_}.action').read_text(encoding='utf-8')
        fields = re.findall(r'^\S+ (\w+) +#', definition.partition('---')[0], re.MULTILINE)
        values = yaml.safe_load(goal)
        assert set(values) <= set(fields)
        assert (ROOT / 'config/problems' / f'{values["problem"]}.yaml').is_file()


def test_packages_are_found_in_a_workspace(tmp_path: Path) -> None:
    colcon = shutil.which('colcon')
    if colcon is None:
        pytest.skip('no colcon')
    (tmp_path / 'src').mkdir()
    (tmp_path / 'src/flightdyn').symlink_to(ROOT)
    for command in commands('colcon', 'build'):
        lister = [colcon, '--log-base', '/dev/null', 'list', '--names-only', *command[2:]]
        done = subprocess.run(lister, cwd=tmp_path, check=True, capture_output=True, text=True)
        assert sorted(done.stdout.split()) == ['flightdyn', 'flightdyn_msgs']
