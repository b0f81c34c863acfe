"""How noisy a log is and how sharply its vehicle manoeuvres, told from the log itself."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..trajectory import stretches
from . import gauss_markov as gm
from .smoother import ACCELERATION_PRIOR, VELOCITY_PRIOR

Array = NDArray[np.float64]
Groups = tuple[tuple[int, ...], ...]

MIN_STD = 1e-4
"""Noise levels below this are not told apart [m], [m/s]: far below what any receiver measures."""

POSITION_STD_GRID: Array = np.logspace(-4, 2, 7)
VELOCITY_STD_GRID: Array = np.logspace(-4, 1, 6)
JERK_DENSITY_GRID: Array = np.logspace(-4, 6, 11)

PLAUSIBLE_POSITION_STD = 5.0
"""Beyond this scatter from one sample to the next the log is faulty, not the receiver [m]."""

PLAUSIBLE_ACCELERATION_CHANGE = 45.0
"""1-sigma change of acceleration between samples beyond which the log is faulty [m/s^2]."""

_HORIZONTAL_VERTICAL: Groups = ((0, 1), (2,))
_WINDOW = 96  # samples per window: ten turns of a thermal at 1 Hz, half a flip at 200 Hz
_WINDOWS = 24
_TURNING = 0.2  # of the power; of 24 windows of scatter alone the median is 0.05
_WARM_UP = 3  # innovations that only say what was unknown at first


@dataclass(frozen=True)
class Noise:
    """White noise levels of one log, per axis.

    Parameters
    ----------
    position_std, velocity_std : array (3,)
        1-sigma of the white part [m], [m/s].
    jerk_density : array (3,)
        [m^2/s^5].
    """

    position_std: Array
    velocity_std: Array
    jerk_density: Array


def estimate_noise(
    time: Array,
    position: Array,
    velocity: Array | None = None,
    *,
    segment: NDArray[np.int64],
    position_std: ArrayLike | None = None,
    velocity_std: ArrayLike | None = None,
    jerk_density: ArrayLike | None = None,
    position_std_limits: tuple[ArrayLike, ArrayLike] = (MIN_STD, np.inf),
    velocity_std_limits: tuple[ArrayLike, ArrayLike] = (MIN_STD, np.inf),
) -> Noise:
    """Return the noise levels that make the log's innovations likeliest.

    Parameters
    ----------
    time : array (n,)
        Seconds, increasing within a segment.
    position, velocity : array (n, 3)
        [m], [m/s]; NaN where there is none.
    segment : int array (n,)
    position_std, velocity_std, jerk_density : float or array (3,), optional
        What is known already, and is not estimated.
    position_std_limits, velocity_std_limits : (least, most), each float or array (3,)
        Least: what quantisation alone makes. Most: what the log reports.

    Returns
    -------
    Noise

    Notes
    -----
    North and east share one estimate, down has its own. The likelihood is summed over windows
    spread over the log, without those in which the vehicle stays where it is: a parked receiver
    says nothing about the manoeuvres. It is maximised over a decade grid, refined twice. Of each
    noise level the likelihood is the mean over all jerk densities, window by window, as a flight
    has calm and sharp parts; the density returned is the one that suits all windows best.

    A circle sampled a few times a turn can be explained by sharp manoeuvres or by a noise as wide
    as the circle, and the likelihood alone often prefers the latter. So where the scatter goes
    round, noise beyond `PLAUSIBLE_POSITION_STD` is considered only if without it the manoeuvres
    would exceed `PLAUSIBLE_ACCELERATION_CHANGE`, as positions that jump back and forth make them.

    References
    ----------
    .. [1] Bar-Shalom, Li, Kirubarajan, *Estimation with Applications to Tracking and Navigation*,
       2001, section 11.6, innovation-based likelihood.
    """
    windows = _windows(position, segment)
    fixed = [_each_axis(value) for value in (position_std, velocity_std, jerk_density)]
    if velocity is not None and not np.isfinite(velocity).any():
        velocity = None
    limits = (position_std_limits, velocity_std_limits)
    steps = np.concatenate([np.diff(time[w]) for w in windows])
    interval = float(np.median(steps)) if steps.size else 0.0
    scattered = not _goes_round(position, windows)
    result = np.ones((3, 3))  # level, axis
    for group in _HORIZONTAL_VERTICAL:
        axes = list(group)
        data = _cut(time, position, velocity, windows, axes)
        grids = _grids(fixed, limits, velocity is not None, axes)
        plausible = _plausible(grids, interval)
        if scattered:
            best = _climb(data, [grids[0], grids[1], plausible[2]])
        else:
            best = _climb(data, [plausible[0], grids[1], grids[2]])
            if best[2] * interval > PLAUSIBLE_ACCELERATION_CHANGE**2:
                best = _climb(data, [grids[0], grids[1], plausible[2]])
        result[:, axes] = best[:, None]
    for level, known in enumerate(fixed):
        if known is not None:
            result[level] = known
    return Noise(result[0], result[1], result[2])


def _each_axis(value: ArrayLike | None) -> Array | None:
    return None if value is None else np.broadcast_to(np.asarray(value, dtype=float), 3)


def _grids(
    fixed: Sequence[Array | None],
    limits: Sequence[tuple[ArrayLike, ArrayLike]],
    has_velocity: bool,
    axes: list[int],
) -> list[Array]:
    """Return what to try for position_std, velocity_std and jerk_density on some axes."""
    grids: list[Array] = [POSITION_STD_GRID, VELOCITY_STD_GRID, JERK_DENSITY_GRID]
    for level, pair in enumerate(limits):
        least, most = (np.broadcast_to(np.asarray(x, dtype=float), 3)[axes] for x in pair)
        low = max(float(np.sqrt(np.mean(np.square(least)))), MIN_STD)
        high = max(float(np.max(most)), low)
        grids[level] = np.unique(np.clip(grids[level], low, high))
    if not has_velocity:
        grids[1] = np.ones(1)
    for level, known in enumerate(fixed):
        if known is not None:
            grids[level] = np.mean(known[axes], keepdims=True)
    return grids


def _plausible(grids: list[Array], interval: float) -> list[Array]:
    """Return what of the grids no faulty log is needed for, at least the least of each."""
    tops = (PLAUSIBLE_POSITION_STD, np.inf, PLAUSIBLE_ACCELERATION_CHANGE**2 / max(interval, 1e-9))
    return [
        np.unique(np.minimum(grid, max(float(grid[0]), top)))
        for grid, top in zip(grids, tops, strict=True)
    ]


def _windows(position: Array, segment: NDArray[np.int64]) -> list[slice]:
    """Return stretches without a gap in which the vehicle moves, at most `_WINDOWS` of them."""
    pieces = [
        slice(i, min(i + _WINDOW, part.stop))
        for part in stretches(segment)
        for i in range(part.start, part.stop, _WINDOW)
    ]
    extent = np.array([_extent(position[p]) for p in pieces])
    lengths = np.array([p.stop - p.start for p in pieces])
    keep = np.flatnonzero((extent >= 0.05 * extent.max()) & (lengths >= min(12, lengths.max())))
    if keep.size > _WINDOWS:
        keep = keep[np.linspace(0, keep.size - 1, _WINDOWS).round().astype(int)]
    return [pieces[i] for i in keep]


def _goes_round(position: Array, windows: Sequence[slice]) -> bool:
    """Return whether what looks like scatter is a circle sampled a few times a turn.

    Third differences of white scatter are negatively correlated from one to the next, as are those
    of a circle; but a circle's are turned by the same angle each time, to the same side.
    """
    turns = []
    for window in windows:
        place = position[window, 0] + 1j * position[window, 1]
        rough = np.diff(place[np.isfinite(place)], 3)
        power = float(np.sum(np.abs(rough) ** 2))
        if rough.size > 3 and power > 0:
            turns.append(abs(np.sum(rough[1:] * np.conj(rough[:-1])).imag) / power)
    return bool(turns) and float(np.median(turns)) > _TURNING


def _extent(position: Array) -> float:
    known = np.isfinite(position)
    most = np.where(known, position, -np.inf).max(axis=0)
    least = np.where(known, position, np.inf).min(axis=0)
    return float(np.maximum(most - least, 0.0).max())


@dataclass(frozen=True)
class _Data:
    """Windows side by side, (samples, windows x axes); samples past a window's end weigh 0."""

    windows: int
    dt: Array
    position: Array
    has_position: Array
    velocity: Array
    has_velocity: Array


def _cut(
    time: Array,
    position: Array,
    velocity: Array | None,
    windows: Sequence[slice],
    axes: Sequence[int],
) -> _Data:
    longest = max(w.stop - w.start for w in windows)
    shape = (longest, len(windows), len(axes))
    dt = np.zeros(shape)
    columns = {name: np.zeros(shape) for name in ('p', 'hp', 'v', 'hv')}
    for k, window in enumerate(windows):
        size = window.stop - window.start
        dt[1:size, k] = np.diff(time[window])[:, None]
        for name, values in (('p', position), ('v', velocity)):
            if values is None:
                continue
            z = values[window][:, axes]
            known = np.isfinite(z)
            if name == 'p' and known.any():
                z = z - np.nanmean(z, axis=0)
            columns[name][:size, k] = np.where(known, z, 0.0)
            columns['h' + name][:size, k] = known
    flat = {name: c.reshape(longest, -1) for name, c in columns.items()}
    dt = dt.reshape(longest, -1)
    return _Data(len(windows), dt, flat['p'], flat['hp'], flat['v'], flat['hv'])


def _climb(data: _Data, grids: list[Array]) -> Array:
    """Return the likeliest (position_std, velocity_std, jerk_density) of a grid, refined twice.

    The density is refined last: while the noise is looked for, each window has its own.
    """
    best = _likeliest(data, grids)
    for step in (0.5, 0.25):
        best = _likeliest(data, [*_near(best[:2], grids[:2], step), grids[2]])
    for step in (0.5, 0.25):
        fixed = [best[:1], best[1:2]]
        best = _likeliest(data, [*fixed, *_near(best[2:], grids[2:], step)])
    return best


def _near(values: Array, grids: list[Array], step: float) -> list[Array]:
    factors = 10.0 ** np.array([-step, 0.0, step])
    return [
        np.unique(np.clip(value * factors, grid[0], grid[-1]))
        for value, grid in zip(values, grids, strict=True)
    ]


def _likeliest(data: _Data, grids: list[Array]) -> Array:
    candidates = np.stack(np.meshgrid(*grids, indexing='ij'), axis=-1).reshape(-1, 3)
    each = _log_likelihood(data, candidates)
    # The noise stays the same from window to window, the manoeuvres do not.
    shape = (-1, grids[2].size, each.shape[1])
    levels = np.logaddexp.reduce(each.reshape(shape), axis=1).sum(axis=1)
    place = int(np.argmax(levels))
    density = int(np.argmax(each.reshape(shape)[place].sum(axis=1)))
    return np.asarray(candidates[place * grids[2].size + density])


def _log_likelihood(data: _Data, candidates: Array) -> Array:
    """Return the log likelihood of each window's innovations, candidates (m, 3): (m, windows)."""
    sigma_p, sigma_v, q = (candidates[:, i, None] for i in range(3))
    w_p, w_v = sigma_p**-2.0, sigma_v**-2.0
    shape = (candidates.shape[0], data.dt.shape[1])
    total = np.zeros(shape)
    zero = np.zeros(shape)
    mean: gm.Mean = (zero, zero, zero)
    cov: gm.Covariance = (
        zero + 1e8, zero, zero, zero + VELOCITY_PRIOR**2, zero, zero + ACCELERATION_PRIOR**2
    )  # fmt: skip
    has_v = bool(data.has_velocity.any())
    for k in range(data.dt.shape[0]):
        mean, cov = gm.predict(mean, cov, data.dt[k], q)
        for component, z, known, weight in (
            (0, data.position[k], data.has_position[k], w_p),
            (1, data.velocity[k], data.has_velocity[k], w_v),
        ):
            if component == 1 and not has_v:
                continue
            if k >= _WARM_UP:
                spread = cov[0 if component == 0 else 3] + 1 / weight
                total -= known * (np.log(spread) + (z - mean[component]) ** 2 / spread)
            mean, cov = gm.measure(mean, cov, component, z, weight * known)
    return np.asarray(total.reshape(shape[0], data.windows, -1).sum(axis=2) / 2)
