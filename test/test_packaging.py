"""What pip and colcon install, and what describes it."""

import os
import py_compile
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
NODES = ('planner', 'sim', 'replay', 'demo')
INTERFACES = sorted((ROOT / 'flightdyn_msgs').glob('*/*.[msa][srec][gvt]*'))


def version_of(package: Path) -> str | None:
    return ET.parse(package / 'package.xml').getroot().findtext('version')


def test_versions_agree() -> None:
    setup = re.search(r"version='([^']+)'", (ROOT / 'setup.py').read_text(encoding='utf-8'))
    assert setup is not None
    assert version_of(ROOT) == version_of(ROOT / 'flightdyn_msgs') == setup[1]


def test_every_interface_is_built() -> None:
    cmake = (ROOT / 'flightdyn_msgs/CMakeLists.txt').read_text(encoding='utf-8')
    listed = re.findall(r'^ +((?:msg|srv|action)/\w+\.\w+)$', cmake, re.MULTILINE)
    found = [f.relative_to(ROOT / 'flightdyn_msgs').as_posix() for f in INTERFACES]
    assert len(found) == 21
    assert sorted(listed) == found


@pytest.mark.parametrize('path', INTERFACES, ids=lambda path: path.name)
def test_every_field_has_a_comment(path: Path) -> None:
    for number, line in enumerate(path.read_text(encoding='utf-8').splitlines(), start=1):
        field, _, comment = line.partition('#')
        if field.strip() not in ('', '---'):
            assert re.search('[A-Za-z]{3}', comment), f'{path.name}:{number}: {line}'


def test_colcon_finds_both_packages_at_the_root() -> None:
    defaults = yaml.safe_load((ROOT / 'colcon_defaults.yaml').read_text(encoding='utf-8'))
    for verb in ('build', 'test', 'list'):
        assert defaults[verb]['paths'] == ['.', 'flightdyn_msgs']


@pytest.mark.parametrize('name', ['flightdyn', 'replay'])
def test_launch_file_compiles_and_names_real_executables(name: str, tmp_path: Path) -> None:
    # The launch package itself is no wheel; what it would look up is checked instead.
    path = ROOT / 'launch' / f'{name}.launch.py'
    py_compile.compile(str(path), cfile=str(tmp_path / 'out'), doraise=True)
    executables = re.findall(r"executable='(\w+)'", path.read_text(encoding='utf-8'))
    assert executables
    assert set(executables) <= set(NODES)


def test_install_space_is_what_ros2_expects() -> None:
    prefix = ROOT / 'install/flightdyn'
    if not prefix.is_dir():
        pytest.skip('not built with colcon')
    for node in NODES:
        assert os.access(prefix / 'lib/flightdyn' / node, os.X_OK), node
    for package in ('flightdyn', 'flightdyn_msgs'):
        share = ROOT / 'install' / package / 'share'
        assert (share / 'ament_index/resource_index/packages' / package).is_file()
        assert (share / package / 'package.xml').is_file()
    expected = [*ROOT.glob('config/**/*.yaml'), *ROOT.glob('launch/*.py')]
    for path in expected:
        assert (prefix / 'share/flightdyn' / path.relative_to(ROOT)).is_file(), path
    for path in (ROOT / 'flightdyn_msgs/msg').iterdir():
        assert (prefix / 'share/flightdyn/msg' / path.name).is_file(), path


@pytest.mark.slow  # builds a wheel: 5 s
def test_wheel_has_one_command_and_the_share_files(tmp_path: Path) -> None:
    """`sim` or `planner` on PATH would collide with other programs."""
    source = tmp_path / 'source'
    skip = shutil.ignore_patterns('.*', 'build', 'install', 'log', 'demo', 'test', '*.egg-info')
    shutil.copytree(ROOT, source, ignore=skip)
    command = [sys.executable, '-m', 'pip', 'wheel', '-q', '--no-deps', '--no-build-isolation']
    subprocess.run([*command, '-w', str(tmp_path), str(source)], check=True)
    (wheel,) = tmp_path.glob('*.whl')
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        (entry_points,) = (name for name in names if name.endswith('entry_points.txt'))
        text = archive.read(entry_points).decode()
    assert text.split() == ['[console_scripts]', 'flightdyn', '=', 'flightdyn.cli:main']
    assert not [name for name in names if '.data/scripts/' in name]
    assert not [name for name in names if name.startswith(('flightdyn_msgs/', 'test/'))]
    shared = {name.partition('.data/data/share/flightdyn/')[2] for name in names}
    for path in [*ROOT.glob('config/**/*.yaml'), *ROOT.glob('launch/*.py')]:
        assert path.relative_to(ROOT).as_posix() in shared
    assert {f'msg/{p.name}' for p in (ROOT / 'flightdyn_msgs/msg').iterdir()} <= shared
