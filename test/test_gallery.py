"""The gallery shows what is shipped, with pictures that are there and small."""

import importlib.util
import re
from pathlib import Path

from flightdyn.resources import list_configs

ROOT = Path(__file__).parents[1]
SPEC = importlib.util.spec_from_file_location('gallery', ROOT / 'tools' / 'gallery.py')
assert SPEC is not None and SPEC.loader is not None
gallery = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(gallery)


def test_the_command_makes_a_picture_of_all_that_is_shipped() -> None:
    commands = {command for p in gallery.pictures() for command in p.commands}
    names = [p.name for p in gallery.pictures()]
    assert len(set(names)) == len(names)
    for name in list_configs('problems'):
        assert f'flightdyn plan {name} -o {name}.png' in commands
    for name in list_configs('scenarios'):
        assert f'flightdyn sim {name} -o {name}.png' in commands
    for command in commands:
        for path in re.findall(r'\S+/\S+', command):
            assert (ROOT / path).is_file(), command


def test_every_picture_of_the_docs_is_there_and_small() -> None:
    shown = {
        (page.parent / link).resolve()
        for page in [*(ROOT / 'docs').glob('*.md'), ROOT / 'README.md']
        for link in re.findall(r'!\[[^]]*\]\(([^)]+)\)', page.read_text(encoding='utf-8'))
        if '://' not in link
    }
    there = {path.resolve() for path in gallery.FOLDER.iterdir()}
    assert shown == there
    sizes = [path.stat().st_size for path in there]
    assert max(sizes) <= gallery.MAX_BYTES
    assert sum(sizes) < 700_000


def test_the_page_tells_the_commands_that_make_its_pictures() -> None:
    written = (ROOT / 'docs' / 'gallery.md').read_text(encoding='utf-8')
    for picture in gallery.pictures():
        if (gallery.FOLDER / picture.file).is_file():
            for text in (written, gallery.page(gallery.pictures())):
                after = text.partition(f'(pictures/{picture.file})')[2]
                assert after.split('```')[1].splitlines()[1:] == list(picture.commands)
