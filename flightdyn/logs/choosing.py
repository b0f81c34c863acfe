"""Which source of a log is read, and which of its samples: the same for logs of every kind."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, LogError
from .timeline import Rows, arrange
from .track import Track

Index = NDArray[np.int64]


class Named(Protocol):
    """What is asked of a source here."""

    @property
    def topic(self) -> str: ...

    @property
    def messages(self) -> int: ...


S = TypeVar('S', bound=Named)


class NothingUsableError(Exception):
    """A source turned out to hold too few samples that can be used."""


def check_range(start: float | None, end: float | None) -> None:
    """Raise InputError if a range of seconds is empty."""
    if start is not None and end is not None and not start < end:
        raise InputError(f'start {start:g} s must be before end {end:g} s')


def first_usable(
    path: Path | str,
    candidates: Sequence[S],
    others: Sequence[S],
    read: Callable[[S, list[str]], Track],
) -> Track:
    """Return the track of the first candidate that has one.

    Parameters
    ----------
    candidates : sequence of Source
    others : sequence of Source
        Which would have been usable too; told in the track's warnings.
    read : function of (source, warnings)
        Raises NothingUsableError where there is no track.

    Raises
    ------
    LogError
        If none has; the message says why of each.
    """
    failures: list[str] = []
    for candidate in candidates:
        notes = list(failures)
        left = [s.topic for s in others if s.topic != candidate.topic]
        if left:
            notes.append(
                f'{candidate.topic} was taken of {len(others)} usable sources; '
                f'others: {", ".join(left)}'
            )
        try:
            return read(candidate, notes)
        except NothingUsableError as nothing:
            failures.append(str(nothing))
    raise LogError(f'{path}: {"; ".join(failures)}')


def choose_samples(
    path: Path | str,
    source: Named,
    time: Index,
    rows: Rows,
    breaks: Sequence[Index | None],
    span: tuple[float | None, float | None],
    warnings: list[str],
) -> tuple[Index, Index, NDArray[np.bool_]]:
    """Return which samples make a track, their segments, and which messages are in the span.

    Parameters
    ----------
    time : int array (n,)
        ns
    rows : Rows
        Which of the samples can be used.
    breaks : int arrays (n,) or None
        Where one changes a new segment begins, beside those of time.
    span : start, end
        Seconds since the first usable sample, or None.

    Raises
    ------
    LogError
        If fewer than two usable samples are in the span asked for.
    NothingUsableError
        If fewer than two are in the log.
    """
    if rows.used.size == 0:
        raise NothingUsableError(_nothing(source, rows))
    index, segment = arrange(time, rows, warnings)
    elapsed = time - time[index[0]]  # ns, in whole numbers: the ends of the span are in it
    chosen = np.ones(time.size, bool)
    if span[0] is not None:
        chosen &= elapsed >= span[0] * 1e9
    if span[1] is not None:
        chosen &= elapsed <= span[1] * 1e9
    picked = chosen[index]
    labels = [segment, *(each[index] for each in breaks if each is not None)]
    changes = np.zeros(index.size, bool)
    for label in labels:
        changes[1:] |= label[1:] != label[:-1]
    segment = np.cumsum(changes)
    index, segment = index[picked], segment[picked]
    if index.size < 2:
        if span != (None, None):
            raise LogError(
                f'{path}: {source.topic} has {index.size} usable samples in the range asked '
                f'for; it runs from 0 s to {elapsed[rows.used].max() * 1e-9:g} s'
            )
        raise NothingUsableError(_nothing(source, rows))
    _, segment = np.unique(segment, return_inverse=True)
    return index, segment.astype(np.int64), chosen


def _nothing(source: Named, rows: Rows) -> str:
    counts = rows.counts(np.ones(rows.reason.size, bool))
    reasons = ', '.join(f'{number} {why}' for why, number in counts.items()) or 'nothing dropped'
    return (
        f'{source.topic} has {rows.used.size} usable of {source.messages} messages ({reasons}); '
        'motion needs at least two at different times'
    )
