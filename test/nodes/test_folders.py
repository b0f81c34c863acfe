"""Files that clients may name, and those that they may not."""

from pathlib import Path

import pytest

from flightdyn.errors import InputError
from flightdyn.nodes.folders import file_below, folder


@pytest.fixture
def root(tmp_path: Path) -> Path:
    (tmp_path / 'logs').mkdir()
    (tmp_path / 'logs/a.mcap').touch()
    (tmp_path / 'secret').touch()
    (tmp_path / 'logs_too').mkdir()
    (tmp_path / 'logs_too/b.mcap').touch()
    (tmp_path / 'logs/out').symlink_to(tmp_path / 'secret')
    return tmp_path / 'logs'


def test_files_below_are_found_by_relative_and_absolute_names(root: Path) -> None:
    for name in ('a.mcap', './a.mcap', '../logs/a.mcap', str(root / 'a.mcap')):
        assert file_below(root, name, 'log') == root / 'a.mcap'


@pytest.mark.parametrize(
    'name', ['../secret', '/etc/passwd', 'out', '../logs_too/b.mcap', '../nothing', '~/x']
)
def test_files_elsewhere_are_refused_whether_they_exist_or_not(root: Path, name: str) -> None:
    with pytest.raises(InputError, match=r'log: .* is outside'):
        file_below(root, name, 'log')


@pytest.mark.parametrize('name', ['', 'a\0.mcap', 'b.mcap', '.'])
def test_names_of_no_file_are_refused(root: Path, name: str) -> None:
    with pytest.raises(InputError, match='log: '):
        file_below(root, name, 'log')


def test_without_a_root_every_file_is_allowed(root: Path) -> None:
    assert file_below(None, str(root / 'a.mcap'), 'log') == root / 'a.mcap'


def test_folder(root: Path) -> None:
    assert folder('', 'log_root') is None
    assert folder(str(root / '../logs'), 'log_root') == root
    with pytest.raises(InputError, match=r'parameter log_root: .*nothing is not a folder'):
        folder(str(root / 'nothing'), 'log_root')
