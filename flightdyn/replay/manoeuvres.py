"""How sharply a vehicle manoeuvres from moment to moment: the density of its jerk over time."""

import numpy as np
from numpy.typing import NDArray

from ..trajectory import stretches
from . import gauss_markov as gm
from .noise import JERK_DENSITY_GRID
from .smoother import ACCELERATION_PRIOR, VELOCITY_PRIOR

Array = NDArray[np.float64]

BLOCK = 8
"""Samples that share one density."""

REACH = 1.0
"""So many decades about the log's own density are looked at."""

_STEP = 0.5  # decades between densities tried
_STIFFNESS = 1.5  # nats that a change by one step costs
_WINDOW = 96  # samples filtered side by side
_LEAD = 24  # more before them, in which a filter forgets what it did not know


def local_jerk_density(
    time: Array,
    position: Array,
    velocity: Array | None,
    segment: NDArray[np.int64],
    *,
    position_std: Array,
    velocity_std: Array | None = None,
    jerk_density: Array,
    along: Array | None = None,
) -> Array:
    """Return the density of the jerk from each sample to the next, (n, 3) [m^2/s^5].

    Parameters
    ----------
    time : array (n,)
        [s], not decreasing within a segment.
    position, velocity : array (n, 3)
        [m], [m/s]; NaN where there is none.
    segment : int array (n,)
    position_std, velocity_std : array (n, 3)
        1-sigma of the white noise [m], [m/s]; the latter None without a velocity.
    jerk_density : array (3,)
        That of the whole log.
    along : array (n, 2), optional
        Unit vectors north, east: `position_std` is then along these, across them and down, and
        there is no velocity. Each window is seen in the axes of its own mean direction.

    Notes
    -----
    Filters of several densities run side by side; each block of samples is as likely under one as
    its innovations are. The logarithm of the density is taken to change from block to block by
    steps of an exponential distribution. Of what that and the innovations say, before and after,
    the density is the mean, not the logarithm: a motion as likely sharp as calm has the mean of
    both variances. North and east share a density, down has its own.

    References
    ----------
    .. [1] Bar-Shalom, Li, Kirubarajan, *Estimation with Applications to Tracking and Navigation*,
       2001, section 11.6, multiple models.
    .. [2] Rabiner, "A tutorial on hidden Markov models", Proc. IEEE 77(2), 1989, forward-backward.
    """
    n = time.size
    result = np.empty((n, 3))
    rungs = np.arange(-REACH, REACH + _STEP / 2, _STEP)
    windows = [
        (max(part.start, i - _LEAD), i, min(i + _WINDOW, part.stop))
        for part in stretches(segment)
        for i in range(part.start, part.stop, _WINDOW)
    ]
    starts, firsts, ends = (np.array(column) for column in zip(*windows, strict=True))
    after = np.arange(int((ends - starts).max()))[:, None]
    index = np.minimum(starts + after, ends - 1)
    counted = (index >= firsts) & (starts + after < ends)
    # What the first samples of a segment say is what was unknown before.
    counted[:3] = False
    place = position[index]
    if along is not None:
        place[..., :2] = _turned(place[..., :2], along[index].mean(axis=0))
    dt = np.diff(time[index], axis=0, prepend=time[index[:1]])
    for axes in ((0, 1), (2,)):
        base = float(np.exp(np.mean(np.log(jerk_density[list(axes)]))))
        grid = np.clip(base * 10.0**rungs, JERK_DENSITY_GRID[0], JERK_DENSITY_GRID[-1])
        terms = np.zeros((n, grid.size))
        for axis in axes:
            columns = [(place[..., axis], position_std[index, axis])]
            if velocity is not None and velocity_std is not None:
                columns.append((velocity[index, axis], velocity_std[index, axis]))
            found = _log_likelihoods(dt, columns, grid)
            terms[index[counted]] += np.moveaxis(found, 1, 2)[counted]
        for part in stretches(segment):
            result[part, list(axes)] = _most_plausible(terms[part], np.log(grid))[:, None]
    return result


def _turned(place: Array, ways: Array) -> Array:
    """Return north, east (longest, windows, 2) as along and across each way (windows, 2)."""
    ahead, side = (ways / np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-9)).T
    north, east = place[..., 0], place[..., 1]
    return np.stack((ahead * north + side * east, ahead * east - side * north), axis=-1)


def _log_likelihoods(dt: Array, columns: list[tuple[Array, Array]], grid: Array) -> Array:
    """Return the log likelihood of each sample of one axis under each density.

    Parameters
    ----------
    dt : array (longest, windows)
        [s]
    columns : list of values and their 1-sigma, each (longest, windows)
        Of position, then of velocity; NaN where there is none.
    grid : array (m,)

    Returns
    -------
    array (longest, m, windows)
    """
    weighed: list[tuple[int, Array, Array]] = []
    for component, (z, sigma) in enumerate(columns):
        known = np.isfinite(z)
        weighed.append((component, np.where(known, z, 0.0), np.where(known, sigma**-2.0, 0.0)))
    # Offsets from each window's first position: its digits are needed.
    weighed[0] = (0, weighed[0][1] - weighed[0][1][0], weighed[0][2])
    longest, windows = dt.shape
    zero = np.zeros((grid.size, windows))
    mean: gm.Mean = (zero, zero, zero)
    cov: gm.Covariance = (
        zero + 1e8, zero, zero, zero + VELOCITY_PRIOR**2, zero, zero + ACCELERATION_PRIOR**2
    )  # fmt: skip
    found = np.zeros((longest, *zero.shape))
    for k in range(longest):
        mean, cov = gm.predict(mean, cov, dt[k], grid[:, None])
        for component, z, weight in weighed:
            w = weight[k]
            variance = cov[0 if component == 0 else 3]
            excess = 1 + w * variance
            found[k] -= (np.log(excess) + w * (z[k] - mean[component]) ** 2 / excess) / 2
            mean, cov = gm.measure(mean, cov, component, z[k], w)
    return found


def _most_plausible(terms: Array, levels: Array) -> Array:
    """Return the density at each sample of a segment, (n,), out of log likelihoods (n, m)."""
    n = terms.shape[0]
    edges = np.arange(0, n, BLOCK)
    evidence = np.add.reduceat(terms, edges, axis=0)
    steps = np.abs(np.subtract.outer(np.arange(levels.size), np.arange(levels.size)))
    move = np.exp(-_STIFFNESS * steps)
    move /= move.sum(axis=1, keepdims=True)
    likely = np.exp(evidence - evidence.max(axis=1, keepdims=True))
    forward, backward = np.empty_like(likely), np.empty_like(likely)
    belief = np.full(levels.size, 1 / levels.size)
    for k in range(edges.size):
        forward[k] = belief
        belief = (belief * likely[k]) @ move
        belief /= belief.sum()
    belief = np.full(levels.size, 1 / levels.size)
    for k in range(edges.size - 1, -1, -1):
        backward[k] = belief
        belief = move @ (belief * likely[k])
        belief /= belief.sum()
    weight = forward * likely * backward
    weight /= weight.sum(axis=1, keepdims=True)
    centres = np.minimum(edges + (BLOCK - 1) / 2, n - 1)
    return np.asarray(np.interp(np.arange(n), centres, weight @ np.exp(levels)))
