"""Makes docs/gallery.md and its pictures: python tools/gallery.py [PICTURE...]

Without names all pictures are made. Each is what a command writes, in small.
"""

import argparse
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from flightdyn.planning.problem_file import load_problem
from flightdyn.resources import list_configs
from flightdyn.simulation.scenario import load_scenario

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / 'docs'
FOLDER = DOCS / 'pictures'
WIDTH = 800  # pixels
QUALITY = 65  # of WebP: a third of what PNG takes, and text stays clean
MAX_BYTES = 60_000
LOGS = {
    'discus2_thermal': 'Fifteen minutes of a glider, by its logger: a glide, a thermal, a glide',
    'px4_zurich_px4msgs': 'A multicopter whose motor fails, as PX4 recorded it',
    'px4_chicago_resets': 'A fixed wing whose estimator was reset over and over: gaps stay gaps',
}
HEAD = """# Gallery

Each picture is what the command below it writes, of data that this repository has. `make gallery`
makes them all anew.
"""


@dataclass(frozen=True)
class Picture:
    """A picture, what it shows, and the commands that write NAME.png, run in a scratch folder."""

    name: str
    section: str
    caption: str
    commands: tuple[str, ...]

    @property
    def file(self) -> str:
        """Name of its file."""
        return f'{self.name}.webp'


def pictures() -> list[Picture]:
    """Return all there are: each problem, each scenario, studies, and logs of the tests."""
    found = [
        Picture(
            name,
            'Plans',
            load_problem(name).description,
            (f'flightdyn plan {name} -o {name}.png',),
        )
        for name in list_configs('problems')
    ]
    found += [
        Picture(
            name, 'Simulations', load_scenario(name).description,
            (f'flightdyn sim {name} -o {name}.png',),
        )
        for name in list_configs('scenarios')
    ]  # fmt: skip
    found += [
        Picture(
            'flip_flown', 'Simulations', 'The planned flip against its flight by the simulation',
            (
                'flightdyn plan quadcopter_flip -o flip.json',
                'flightdyn sim flip.json -o flip_flown.png',
            ),
        ),
        *(
            Picture(name, 'Studies', caption, (f'python examples/{example}.py -o .',))
            for name, example, caption in (
                ('cessna152_polar', 'cessna152_polar',
                 'Lift, drag and their ratio, clean and with what the geometry leaves out'),
                ('turnback_wind', 'cessna152_turnback',
                 'On how little height a Cessna 152 turns back to its runway, in which wind'),
                ('turnback_10', 'cessna152_turnback',
                 'The ways round in a wind of 10 m/s'),
                ('mesh_refinement', 'mesh_refinement',
                 'How far plans are off when they are flown again, by mesh and method'),
                ('solver_history', 'mesh_refinement',
                 'A solver on its way to a plan, on finer and finer meshes'),
            )
        ),
        *(
            Picture(
                name, 'Replays', caption,
                (f'flightdyn replay test/data/{name}.mcap -o {name}.png',),
            )
            for name, caption in LOGS.items()
        ),
        Picture(
            'discus2_recording', 'Recordings', 'The glider in its thermal, as a recording opens',
            (
                'flightdyn view test/data/discus2_thermal.mcap --time 250 '
                '--shot discus2_recording.png',
            ),
        ),
        Picture(
            'turnback_recording', 'Recordings', 'The turn back in space, coloured by speed',
            (
                'flightdyn plan cessna152_turnback -o turnback.json',
                'flightdyn view turnback.json --view Overview --time 8 '
                '--shot turnback_recording.png',
            ),
        ),
    ]  # fmt: skip
    return found


def main(arguments: Sequence[str]) -> None:
    """Make the pictures that are named, or all, and the page that shows them."""
    every = pictures()
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('picture', nargs='*', help=f'of {", ".join(p.name for p in every)}')
    wanted = parser.parse_args(arguments).picture or [p.name for p in every]
    unknown = set(wanted) - {p.name for p in every}
    if unknown:
        parser.error(f'no picture {", ".join(sorted(unknown))}')
    FOLDER.mkdir(exist_ok=True)
    done: dict[tuple[str, ...], Path] = {}
    failed = []
    with tempfile.TemporaryDirectory() as scratch:
        for picture in every:
            if picture.name not in wanted:
                continue
            if picture.commands not in done:
                print(picture.name, file=sys.stderr)
                done[picture.commands] = folder = Path(scratch) / picture.name
                folder.mkdir()
                failed += [said for command in picture.commands if (said := run(command, folder))]
            made = done[picture.commands] / f'{picture.name}.png'
            if made.is_file():
                shrink(made, FOLDER / picture.file)
    kept = {p.file for p in every}
    for path in FOLDER.iterdir():
        if path.name not in kept:
            path.unlink()
    (DOCS / 'gallery.md').write_text(page(every), encoding='utf-8')
    if failed:
        sys.exit('\n'.join(failed))


def run(command: str, folder: Path) -> str:
    """Run a command of the page, with this checkout's files, in a folder; return what failed."""
    program, *rest = shlex.split(command)
    start = ['-m', 'flightdyn'] if program == 'flightdyn' else []
    rest = [str(ROOT / each) if (ROOT / each).is_file() else each for each in rest]
    done = subprocess.run(
        [sys.executable, *start, *rest], cwd=folder, capture_output=True, text=True, check=False
    )
    return f'{command}: exit code {done.returncode}\n{done.stderr}' if done.returncode else ''


def shrink(path: Path, small: Path) -> None:
    """Write a picture in the page's width."""
    from PIL import Image

    whole = Image.open(path).convert('RGB')
    height = round(whole.height * WIDTH / whole.width)
    sized = whole.resize((WIDTH, height), Image.Resampling.LANCZOS)
    sized.save(small, 'WEBP', quality=QUALITY, method=6)
    if small.stat().st_size > MAX_BYTES:
        sys.exit(f'{small} has {small.stat().st_size} bytes, more than {MAX_BYTES}')


def page(every: Sequence[Picture]) -> str:
    """Return the page of those pictures that are there."""
    text, section = [HEAD], ''
    for picture in every:
        if not (FOLDER / picture.file).is_file():
            continue
        if picture.section != section:
            section = picture.section
            text.append(f'## {section}\n')
        commands = '\n'.join(picture.commands)
        text.append(
            f'**{picture.caption}**\n\n![{picture.caption}](pictures/{picture.file})\n\n'
            f'```sh\n{commands}\n```\n'
        )
    return '\n'.join(text)


if __name__ == '__main__':
    main(sys.argv[1:])
