"""Writing plans, flights and replays to files, the format by suffix."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import InputError
from .files import check_writable, written_whole
from .trajectory import Trajectory

if TYPE_CHECKING:
    from .logs.track import Track

FIGURES = ('.png', '.svg', '.pdf')
TABLES = ('.csv', '.parquet')
FLIGHT_FORMATS = ('.json', *TABLES, '.mcap', '.rrd', *FIGURES)
REPLAY_FORMATS = ('.json', *TABLES, '.rrd', *FIGURES)


def check_outputs(paths: Iterable[str | Path], formats: tuple[str, ...]) -> list[Path]:
    """Return the paths if each can be written in one of the formats.

    Raises
    ------
    InputError
        If a suffix is unknown or a folder is missing: said before any work is done.
    """
    checked = [Path(path) for path in paths]
    for path in checked:
        if path.suffix not in formats:
            known = ' '.join(formats)
            raise InputError(f"cannot write {path}: suffix '{path.suffix}', not {known}")
        check_writable(path)
    return checked


def write_flight(
    path: Path,
    flight: Trajectory,
    document: dict[str, Any],
    *,
    planned: Trajectory | None = None,
    limits: Mapping[str, tuple[float, float]] | None = None,
) -> None:
    """Write a plan or a simulated flight; `document` is what a .json file holds.

    Figures of a simulated flight show it beside what was `planned`, those of a plan show `limits`.
    Pictures and recordings show the `surroundings` that the document has.
    """
    if path.suffix == '.mcap':
        from .logs.recording import write_flight_mcap

        write_flight_mcap(flight, path, planned)
    elif path.suffix in TABLES:
        from .tables import write_table

        about = {'vehicle': flight.vehicle, 'model': flight.model}
        write_table({'time': flight.time, **flight.columns}, path, about)
    else:
        _write_view(path, flight, document, planned, limits)


def write_replay(
    path: Path,
    flight: Trajectory,
    document: dict[str, Any],
    *,
    planned: Trajectory | None = None,
    track: 'Track | None' = None,
) -> None:
    """Write a replayed flight; `document` is what a .json file holds.

    Figures mark which samples of the `track` were left out.
    """
    if path.suffix in TABLES:
        from .replay.table import write_table

        write_table(flight, path)
    else:
        _write_view(path, flight, document, planned, track=track)


def _write_view(
    path: Path,
    flight: Trajectory,
    document: dict[str, Any],
    planned: Trajectory | None,
    limits: Mapping[str, tuple[float, float]] | None = None,
    track: 'Track | None' = None,
) -> None:
    if path.suffix == '.json':
        with written_whole(path) as temporary:
            temporary.write_text(json.dumps(document, indent=1) + '\n', encoding='utf-8')
    elif path.suffix == '.rrd':
        from .viewing.rerun_view import save_rrd
        from .viewing.run_notes import run_events, run_lanes, run_properties, run_surroundings

        save_rrd(
            path,
            flight,
            planned=planned,
            name=path.stem,
            surroundings=run_surroundings(document),
            events=run_events(document, float(flight.time[0])),
            lanes=run_lanes(document),
            properties=run_properties(document),
        )
    else:
        from .viewing.figures import About, figure_for, save_figure
        from .viewing.run_notes import run_surroundings

        about = About(document=document, limits=limits or {})
        figure = figure_for(
            flight, run_surroundings(document), about=about, planned=planned, track=track
        )
        save_figure(figure, path)


def flight_document(flight: Trajectory, **more: Any) -> dict[str, Any]:
    """Return a simulated flight as what JSON can hold."""
    groups = {
        group: {name: v.tolist() for name, v in getattr(flight, group).items()}
        for group in ('states', 'controls', 'outputs')
    }
    return {
        'vehicle': flight.vehicle,
        'model': flight.model,
        **more,
        'time': flight.time.tolist(),
        **groups,
    }


def deviation(flown: Trajectory, planned: Trajectory) -> dict[str, float]:
    """Return the largest difference of each planned state, at the planned times."""
    return {
        name: float(np.abs(flown.sample(name, planned.time) - values).max())
        for name, values in planned.states.items()
    }
