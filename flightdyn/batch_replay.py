"""Replay of many logs: which files a pattern means, and what is done with each."""

import glob
import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from .batch import Job, Row, flattened, installed_version
from .errors import InputError
from .export import write_replay


def replay_jobs(
    patterns: Iterable[str], folder: str | Path, *, source: str | None = None
) -> list[Job]:
    """Return a job for each log that patterns mean.

    Parameters
    ----------
    patterns : iterable of str
        Paths; `*`, `?`, `[...]` and `**` (folders of any depth) stand for parts of names.
    folder : path
        Where results go; what is in it is no log. A log's result keeps its place below the folder
        that the patterns have in common, with `.parquet` added to the name.
    source : str, optional
        Topic to replay. Default: the best of each log.

    Raises
    ------
    InputError
        If a pattern means no file.
    """
    results = _absolute(folder)
    logs: dict[Path, None] = {}
    roots = []
    for pattern in patterns:
        found = sorted(path for path in _matching(pattern) if results not in path.parents)
        if not found:
            raise InputError(f"no log matches '{pattern}'")
        logs |= dict.fromkeys(found)
        roots.append(_fixed_part(pattern))
    root = _common(roots)
    settings = {'source': source, 'flightdyn': installed_version()}
    return [_job(path, path.relative_to(root).as_posix(), settings) for path in logs]


def replay_job(output: Path, *, file: str, source: str | None) -> Row:
    """Replay a log into a table; return what `flightdyn replay --json` says of it, flattened.

    Raises
    ------
    FlightdynError
        As `replay.replay_log`.
    """
    from .replay import replay_log

    replay = replay_log(file, source=source)
    summary = replay.summary()
    write_replay(output, replay.trajectory, summary)
    if summary['origin'] is None:  # a mapping in other logs
        del summary['origin']
    return flattened(summary)


def _matching(pattern: str) -> Iterable[Path]:
    for name in glob.iglob(pattern, recursive=True):
        path = _absolute(name)
        if not path.is_dir() or (path / 'metadata.yaml').is_file():  # a ROS 2 bag is a folder
            yield path


def _fixed_part(pattern: str) -> Path:
    """Return the folder in front of the first part of a pattern that is not meant literally."""
    folder = Path(pattern).parent
    while glob.has_magic(str(folder)):
        folder = folder.parent
    return _absolute(folder)


def _common(folders: list[Path]) -> Path:
    first, *others = folders
    while not all(first == other or first in other.parents for other in others):
        first = first.parent
    return first


def _job(log: Path, key: str, settings: dict[str, Any]) -> Job:
    parts = sorted(log.rglob('*')) if log.is_dir() else [log]
    state = [(part.stat().st_size, part.stat().st_mtime_ns) for part in parts if part.exists()]
    arguments = {'file': str(log), 'source': settings['source']}
    return Job(
        key=key,
        output=f'{key}.parquet',
        arguments=arguments,
        columns=arguments,
        fingerprint=json.dumps([str(log), state, settings]),
    )


def _absolute(path: str | Path) -> Path:
    return Path(os.path.abspath(path))  # with links: results are laid out as the user sees logs
