"""What the examples share: where they write, and how they tell what they found."""

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from flightdyn import Trajectory
from flightdyn.errors import MissingExtraError
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem import Problem
from flightdyn.tables import write_table


def output_folder(description: str | None) -> Path:
    """Return the folder that the command line names, made if it is not there."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument('-o', '--output', type=Path, default=Path('out'), metavar='FOLDER')
    folder: Path = parser.parse_args().output
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def plan(planner: Planner, problem: Problem) -> Trajectory:
    """Return the plan of a problem; end with the reason if there is no verified one."""
    found = planner.plan(problem)
    if not found.report.verified:
        sys.exit(f'{problem.name}: {found.report.message}')
    return found.trajectory


def tell(path: Path, found: dict[str, tuple[float, str]]) -> None:
    """Print values by name with their units, and write them as JSON."""
    for name, (value, unit) in found.items():
        print(f'{name:<46} {value:.8g} {unit}'.rstrip())
    document = {
        name: {'value': float(value), 'unit': unit} for name, (value, unit) in found.items()
    }
    path.write_text(json.dumps(document, indent=1) + '\n', encoding='utf-8')


def save(path: Path, flight: Trajectory) -> None:
    """Write a flight's columns as CSV."""
    write_table({'time': flight.time, **flight.columns}, path)


def draw(path: Path, figure: Callable[[Any], Any]) -> None:
    """Write the picture that a function makes of `flightdyn.viewing.figures`, if it can."""
    try:
        from flightdyn.viewing import figures
    except MissingExtraError as error:
        print(f'no {path.name}: {error}', file=sys.stderr)
        return
    figures.save_figure(figure(figures), path)
