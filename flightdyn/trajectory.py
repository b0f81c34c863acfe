"""The one currency: named states, controls and outputs over time."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from os import PathLike
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .environment.geodesy import GeodeticPoint
from .errors import InputError

Array = NDArray[np.float64]
Columns = dict[str, Array]
Interpolation = Literal['linear', 'previous']


@dataclass(frozen=True, kw_only=True)
class Trajectory:
    """States, controls and outputs of one vehicle over time; plans, flights and replays alike.

    Parameters
    ----------
    time : array (n,)
        Seconds since `start_ns`, strictly increasing within a segment.
    states, controls, outputs : mapping of name to array (n,)
        In the project's names and units (SI, radians, `alpha` and `beta` in degrees).
        A replay's geodetic position is in the outputs `lat`, `lon` [deg] and `altitude` [m].
    model : str
        Name of the Dynamics class whose states these are.
    vehicle, problem : str
        Names of what flew and why; empty if unknown.
    control_interpolation : 'linear' or 'previous'
        How controls run between samples; 'previous' holds the sample before.
    start_ns : int
        Unix time of `time` = 0 [ns]; 0 if the trajectory is not tied to a date.
    origin : GeodeticPoint or None
        Where the local NED frame's origin is.
    segment : int array (n,)
        Which unbroken stretch each sample belongs to, counted from 0; no path is drawn across a
        change. Omitted: all one segment.

    Raises
    ------
    InputError
        If shapes differ, time runs backwards within a segment, or a value is not finite.
    """

    time: Array
    states: Columns
    controls: Columns = field(default_factory=dict)
    outputs: Columns = field(default_factory=dict)
    model: str = ''
    vehicle: str = ''
    problem: str = ''
    control_interpolation: Interpolation = 'linear'
    start_ns: int = 0
    origin: GeodeticPoint | None = None
    segment: NDArray[np.int64] | None = None

    def __post_init__(self) -> None:
        time = np.asarray(self.time, dtype=float)
        if time.ndim != 1 or time.size == 0:
            raise InputError(f'trajectory time must be a non-empty 1-D array, got {time.shape}')
        object.__setattr__(self, 'time', time)
        for group in ('states', 'controls', 'outputs'):
            columns = {
                name: _column(f'{group}[{name!r}]', values, time.size)
                for name, values in getattr(self, group).items()
            }
            object.__setattr__(self, group, columns)
        segment = self.segment
        segment = (
            np.zeros(time.size, np.int64) if segment is None else np.asarray(segment, np.int64)
        )
        if segment.shape != time.shape:
            raise InputError(f'segment has shape {segment.shape}, time {time.shape}')
        object.__setattr__(self, 'segment', segment)
        if self.control_interpolation not in ('linear', 'previous'):
            raise InputError(
                f'control_interpolation {self.control_interpolation!r}: linear or previous'
            )
        backwards = (np.diff(time) <= 0) & (np.diff(segment) == 0)
        if not np.isfinite(time).all() or backwards.any():
            index = int(np.argmax(backwards)) + 1 if backwards.any() else -1
            raise InputError(f'trajectory time is not increasing at sample {index}')

    def __len__(self) -> int:
        return int(self.time.size)

    def __getitem__(self, name: str) -> Array:
        """Return a column by name, wherever it is."""
        for group in (self.states, self.controls, self.outputs):
            if name in group:
                return group[name]
        known = [*self.states, *self.controls, *self.outputs]
        raise KeyError(f'{name!r} is not in this trajectory; it has {", ".join(known)}')

    def __contains__(self, name: object) -> bool:
        return name in self.states or name in self.controls or name in self.outputs

    @property
    def columns(self) -> Columns:
        """States, controls and outputs together."""
        return {**self.states, **self.controls, **self.outputs}

    @property
    def duration(self) -> float:
        """Seconds from the first to the last sample."""
        return float(self.time[-1] - self.time[0])

    @property
    def unix_ns(self) -> NDArray[np.int64]:
        """Unix time of each sample [ns]."""
        return self.start_ns + np.round(self.time * 1e9).astype(np.int64)

    def to_rerun(self, path: 'str | PathLike[str] | None' = None, **options: Any) -> None:
        """Save the trajectory as a Rerun recording, or open it in a window.

        Parameters
        ----------
        path : path
            The .rrd file to write; a window is opened, and waited for, if there is none.
        options : see `viewing.rerun_view.save_rrd`
            Such as `planned`, `color` and `surroundings`.

        Raises
        ------
        MissingExtraError
            If rerun-sdk is not installed.
        Others as `save_rrd` and `viewing.window.open_window`.
        """
        from .viewing.drawing import Drawing

        drawing = Drawing(self, options)
        if path is None:
            drawing.show()
        else:
            drawing.save(path)

    def segments(self) -> Iterator[slice]:
        """Yield the unbroken stretches as slices."""
        assert self.segment is not None
        return stretches(self.segment)

    def between(self, start: float, end: float) -> 'Trajectory':
        """Return the samples with start <= time <= end [s].

        Raises
        ------
        InputError
            If there are none.
        """
        keep = (self.time >= start) & (self.time <= end)
        if not keep.any():
            raise InputError(
                f'no samples between {start:g} s and {end:g} s: '
                f'the trajectory runs from {self.time[0]:g} s to {self.time[-1]:g} s'
            )
        return self.take(np.flatnonzero(keep))

    def take(self, index: NDArray[np.intp]) -> 'Trajectory':
        """Return the samples of given indices, in increasing order."""
        assert self.segment is not None

        def pick(columns: Columns) -> Columns:
            return {name: values[index] for name, values in columns.items()}

        return replace(
            self,
            time=self.time[index],
            states=pick(self.states),
            controls=pick(self.controls),
            outputs=pick(self.outputs),
            segment=self.segment[index],
        )

    def control_at(self, t: ArrayLike) -> Columns:
        """Return the controls at times [s]; the ends hold beyond the ends.

        Parameters
        ----------
        t : array (m,)

        Returns
        -------
        mapping of name to array (m,)
        """
        t = np.asarray(t, dtype=float)
        if self.control_interpolation == 'linear':
            return {name: np.interp(t, self.time, u) for name, u in self.controls.items()}
        index = np.clip(np.searchsorted(self.time, t, side='right') - 1, 0, len(self) - 1)
        return {name: u[index] for name, u in self.controls.items()}

    def sample(self, name: str, t: ArrayLike) -> Array:
        """Return a column at times [s], linear between samples (controls as they run)."""
        if name in self.controls:
            return self.control_at(t)[name]
        values: Array = np.interp(np.asarray(t, dtype=float), self.time, self[name])
        return values


def _column(what: str, values: ArrayLike, size: int) -> Array:
    column = np.asarray(values, dtype=float)
    if column.shape != (size,):
        raise InputError(f'trajectory {what} has shape {column.shape}, time has ({size},)')
    if not np.isfinite(column).all():
        index = int(np.argmin(np.isfinite(column)))
        raise InputError(f'trajectory {what} is {column[index]} at sample {index}')
    return column


def stretches(segment: NDArray[np.int64]) -> Iterator[slice]:
    """Yield the slices between which a segment number changes."""
    cuts = np.flatnonzero(np.diff(segment)) + 1
    for start, stop in pairwise([0, *cuts.tolist(), segment.size]):
        yield slice(start, stop)


def columns_of(names: Sequence[str], rows: ArrayLike) -> Columns:
    """Return row-major values (n, len(names)) as named columns."""
    table = np.asarray(rows, dtype=float).reshape(-1, len(names))
    return {name: table[:, i].copy() for i, name in enumerate(names)}
