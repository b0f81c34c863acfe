"""The command that shows flights: in a window, in a browser, as a picture or an animation."""

import argparse
import itertools
import json
import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .console import busy, print_rows
from .errors import FlightdynError, InputError
from .export import check_outputs
from .tables import SUFFIXES as TABLES
from .trajectory import Trajectory

if TYPE_CHECKING:
    from .planning.solver import Iteration, OnIteration

RECORDING = '.rrd'
VIEWER = 'rerun+http://127.0.0.1:9876/proxy'


@dataclass(frozen=True)
class Opened:
    """A flight and what its file tells of it."""

    flight: Trajectory
    document: dict[str, Any] = field(default_factory=dict)
    planned: Trajectory | None = None


def add_arguments(sub: argparse.ArgumentParser) -> None:
    """Declare what `flightdyn view` takes."""
    sub.add_argument(
        'file',
        nargs='+',
        help='recording (.rrd), plan or simulation (.json), table (.csv, .parquet), flight log, '
        'or a folder of them',
    )
    sub.add_argument('--save', metavar='FILE', help='write the recording (.rrd)')
    sub.add_argument('--web', action='store_true', help='serve it to browsers on this machine')
    sub.add_argument('--shot', metavar='FILE', help='write a picture (.png)')
    sub.add_argument('--webp', metavar='FILE', help='write an animation (.webp)')
    sub.add_argument('--time', type=float, metavar='S', help='of the picture, from the start')
    sub.add_argument('--view', metavar='NAME', help="only this view in pictures, as 'Overview'")
    sub.add_argument('--size', default='1600x1000', metavar='WxH', help='of pictures [px]')
    sub.add_argument('--color', default='speed', metavar='QUANTITY', help='to colour the path by')
    sub.add_argument(
        '--align',
        default='time',
        metavar='EVENT',
        help='of several flights: by time, or start, end, take-off, landing, highest, lowest, '
        'fastest',
    )


def view(arguments: argparse.Namespace) -> int:
    """Run `flightdyn view`."""
    for name, suffix in ((arguments.save, RECORDING), (arguments.shot, '.png'),
                         (arguments.webp, '.webp')):  # fmt: skip
        if name is not None:
            check_outputs([name], (suffix,))
    size = _size(arguments.size)
    if arguments.time is not None and arguments.shot is None:
        raise InputError('--time is of a picture: give --shot FILE, too')
    files = _files(arguments.file)
    to_file = (arguments.save, arguments.shot, arguments.webp)
    if not any(to_file) and not arguments.web:
        _check_display()
    with ExitStack() as stack:
        recordings = _recordings(files, arguments, stack)
        if arguments.shot or arguments.webp:
            from .viewing.shot import save_animation, save_shot

            if arguments.shot:
                at = arguments.time
                save_shot(recordings, arguments.shot, at=at, view=arguments.view, size=size)
            if arguments.webp:
                smaller = (min(size[0], 960), min(size[1], 960 * size[1] // size[0]))
                save_animation(recordings, arguments.webp, view=arguments.view, size=smaller)
        written = [name for name in to_file if name]
        if arguments.json:
            print(json.dumps({'files': [str(file) for file in files], 'written': written}))
        elif written:
            print_rows([('written', name) for name in written])
        sys.stdout.flush()
        if arguments.web:
            from .viewing.window import serve

            return serve(recordings)
        if not written:
            from .viewing.window import open_window

            return open_window(recordings)
    return 0


def _recordings(files: list[Path], arguments: argparse.Namespace, stack: ExitStack) -> list[Path]:
    """Return the recordings to show, made of what are none yet."""
    recorded = [file for file in files if file.suffix == RECORDING]
    others = [file for file in files if file.suffix != RECORDING]
    if recorded and others:
        raise InputError('give either recordings (.rrd) or flights, not both')
    if recorded:
        if arguments.save:
            raise InputError(f'{recorded[0]} is a recording already: --save is of flights')
        return recorded
    if arguments.save:
        target = Path(arguments.save)
    else:
        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix='flightdyn-'))
        stem = others[0].stem if len(others) == 1 else f'{len(others)}_flights'
        target = Path(folder, f'{stem}{RECORDING}')
    opened: dict[str, Opened] = {}
    for file in others:
        with busy(str(file)):
            label = file.stem if file.stem not in opened else str(file)
            try:
                opened[label] = open_flight(file)
            except FlightdynError as error:
                if len(others) == 1:
                    raise
                print(f'flightdyn: {error}', file=sys.stderr)
    if not opened:
        raise InputError('none of the files holds a flight')
    _write(target, opened, arguments)
    return [target]


def _write(target: Path, opened: dict[str, Opened], arguments: argparse.Namespace) -> None:
    if len(opened) > 1:
        from .viewing.flights_view import save_flights

        if arguments.color != 'speed':
            raise InputError('--color is of one flight: several have a colour each')
        flights = {label: each.flight for label, each in opened.items()}
        save_flights(target, flights, align=arguments.align)
        return
    from .viewing.rerun_view import save_rrd
    from .viewing.run_notes import run_events, run_lanes, run_properties, run_surroundings

    if arguments.align != 'time':
        raise InputError('--align is of several flights')
    ((label, only),) = opened.items()
    save_rrd(
        target,
        only.flight,
        planned=only.planned,
        name=label,
        color=arguments.color,
        surroundings=run_surroundings(only.document),
        events=run_events(only.document, float(only.flight.time[0])),
        lanes=run_lanes(only.document),
        properties=run_properties(only.document),
    )


@contextmanager
def live_iterations(
    url: str | None, name: str, console: 'OnIteration | None'
) -> 'Iterator[tuple[OnIteration | None, Callable[[Trajectory], None]]]':
    """Give what is called with each iteration of a solve, and with its plan.

    Parameters
    ----------
    url : str or None
        Of a running viewer that shows them; none does unless given.
    name : str
        Title of the recording.
    console : function of an Iteration, or None
        Called as well.

    Raises
    ------
    InputError
        If there is no viewer.
    """
    if url is None:
        yield console, lambda plan: None
        return
    from .viewing.live import LiveView

    with LiveView(url, name=name) as live:
        count = itertools.count()  # a problem may take several solves, each counts from 0

        def show(iteration: 'Iteration') -> None:
            if console is not None:
                console(iteration)
            if iteration.trajectory is not None:
                live.iteration(next(count), iteration.trajectory())

        yield show, live.trajectory


def open_flight(path: Path) -> Opened:
    """Return the flight in a file of any kind that the other commands write or read.

    Raises
    ------
    InputError
        If there is none in it; the message says what was expected.
    """
    if path.suffix == '.json':
        return _open_document(path)
    if path.suffix in TABLES:
        flight = _open_table(path)
        if flight is not None:
            return Opened(flight)
    from .logs.any_log import is_mcap
    from .logs.recorded import read_plans
    from .replay import replay_log

    replay = replay_log(str(path))
    plans = read_plans(str(path)) if is_mcap(str(path)) else []
    return Opened(replay.trajectory, replay.summary(), plans[-1] if plans else None)


def _open_document(path: Path) -> Opened:
    """Return the flight of a plan's or a simulation's document."""
    from .planning.plan_file import FLIGHT, KEYS, flight_of, plan_of, read_document

    document = read_document(path)
    if not isinstance(document, dict) or 'scenario' not in document:
        return Opened(*plan_of(document, path))
    flight = flight_of(document, (*FLIGHT, 'vehicle', 'model'), path, 'holds no flight')
    return Opened(flight, {k: v for k, v in document.items() if k not in KEYS})


def _open_table(path: Path) -> Trajectory | None:
    """Return the flight of a table that the other commands wrote; None if it is another's."""
    from .replay import table as replay_table
    from .tables import read_table

    columns, about = read_table(path)
    if 't' in columns and 'segment' in columns:
        return replay_table.read_table(path)
    known = {'x_e', 'y_e', 'z_e', 'altitude'} & columns.keys()
    if 'time' not in columns or not known:
        if path.suffix == '.csv':
            return None  # a phone's log, perhaps
        raise InputError(f"{path}: no flight: it has neither 't', 'segment' nor 'time', 'z_e'")
    from .dynamics import FAMILY

    model = about.get('model', '')
    states = FAMILY[model].states if model in FAMILY else tuple(columns)
    values = {name: np.asarray(v, float) for name, v in columns.items() if name != 'time'}
    return Trajectory(
        time=np.asarray(columns['time'], float),
        states={name: v for name, v in values.items() if name in states},
        outputs={name: v for name, v in values.items() if name not in states},
        model=model,
        vehicle=about.get('vehicle', ''),
    )


def _files(names: Sequence[str]) -> list[Path]:
    """Return the files named, and those in the folders named."""
    files: list[Path] = []
    for name in names:
        path = Path(name)
        if os.path.isdir(path):
            inside = sorted(p for p in path.iterdir() if p.is_file() and p.name[0] != '.')
            if not inside:
                raise InputError(f'nothing in the folder {path}')
            files += inside
        elif os.path.isfile(path):
            files.append(path)
        else:
            raise InputError(f'no file {path}')
    return files


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.partition('x')
    if not (width.isdecimal() and height.isdecimal()) or not (
        100 <= int(width) <= 8000 and 100 <= int(height) <= 8000
    ):
        raise InputError(f'--size {text}: expected such as 1600x1000, 100 to 8000 px')
    return int(width), int(height)


def _check_display() -> None:
    if sys.platform != 'linux' or os.environ.get('DISPLAY') or os.environ.get('WAYLAND_DISPLAY'):
        return
    raise InputError(
        'no display to open a window on: save the recording with --save FILE.rrd, serve it to a '
        'browser with --web, or draw it with --shot FILE.png'
    )
