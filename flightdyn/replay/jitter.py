"""Time stamps that are off: to a moving vehicle, noise of its positions along its way alone."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..trajectory import stretches
from .coupled import smooth_horizontal
from .manoeuvres import local_jerk_density
from .noise import estimate_noise

Array = NDArray[np.float64]

LEAST_RATIO = 1.5
"""Noise along the way less than this times that across it is as good as the same.

The levels are tried in steps of a factor of 1.8.
"""

MOVING = 3.0
"""Slower vehicles do not tell the way they go [m/s]."""

_SAME = 0.9  # of a noise level: a step lower is another
_WINDOW = 32  # samples: a glider is straight for minutes at most
_SHORTEST = 16
_STRAIGHT = 0.95  # length of the mean of unit vectors: 18 deg of scatter
_FEWEST = 96  # samples
_LEAST_SHARE = 0.2  # of the samples: less straight flight does not tell of the whole log
_REACH = 64  # samples about each that tell how bad the stamps are there
_PRIOR = 8.0  # samples as bad as usual that count with them
_MOST = 3.0  # times as bad as usual


@dataclass(frozen=True)
class Jitter:
    """White noise of the horizontal positions of a log whose time stamps are off.

    Parameters
    ----------
    across_std : float
        1-sigma of the positions themselves [m].
    time_std : float
        1-sigma of the time stamps [s].
    jerk_density : float
        Of straight flight, across the way [m^2/s^5].
    """

    across_std: float
    time_std: float
    jerk_density: float

    def position_std(self, speed: Array) -> Array:
        """Return the 1-sigma of positions along and across the way at a speed, (n, 2) [m]."""
        across = np.full(speed.size, self.across_std)
        return np.stack((np.hypot(across, self.time_std * speed), across), axis=1)


def estimate_jitter(
    time: Array,
    position: Array,
    velocity: Array,
    segment: NDArray[np.int64],
    *,
    position_std: float,
    position_std_limits: tuple[ArrayLike, ArrayLike],
) -> Jitter | None:
    """Return the noise of time stamps and positions, None if it seems the same every way.

    Parameters
    ----------
    time : array (n,)
        [s], increasing within a segment.
    position : array (n, 2)
        North, east [m]; NaN where there is none.
    velocity : array (n, 2)
        Of the smoothed motion [m/s].
    segment : int array (n,)
    position_std : float
        1-sigma of the positions if it is taken as the same every way [m]. Straight flight in
        which there is less along the way is no sample of the log.
    position_std_limits
        Least and most, as for `noise.estimate_noise`.

    Notes
    -----
    Receivers of ADS-B and FLARM stamp positions as they come in or as they go on, seconds late;
    loggers round to whole seconds. A position late by dt is off by dt times the velocity. So in
    straight flight the noise along the way is compared with that across it; on other ways of
    flight the two do not show apart.
    """
    columns: list[tuple[Array, Array, float]] = []
    for part in stretches(segment):
        for i in range(part.start, part.stop, _WINDOW):
            window = slice(i, min(i + _WINDOW, part.stop))
            if window.stop - i < _SHORTEST:
                continue
            speed = np.hypot(*velocity[window].T)
            usual = float(np.median(speed))
            way = np.mean(velocity[window] / np.maximum(speed, 1e-9)[:, None], axis=0)
            if usual < MOVING or np.hypot(*way) < _STRAIGHT:
                continue
            way /= np.hypot(*way)
            along = position[window] @ way
            across = position[window] @ np.array([-way[1], way[0]])
            columns.append((time[window], np.stack((across, across, along), axis=1), usual))
    if sum(t.size for t, _, _ in columns) < max(_LEAST_SHARE * time.size, _FEWEST):
        return None
    noise = estimate_noise(
        np.concatenate([t for t, _, _ in columns]),
        np.concatenate([place for _, place, _ in columns]),
        segment=np.repeat(np.arange(len(columns)), [t.size for t, _, _ in columns]),
        position_std_limits=position_std_limits,
    )
    across_std, along_std = float(noise.position_std[0]), float(noise.position_std[2])
    if along_std < max(LEAST_RATIO * across_std, _SAME * position_std):
        return None
    usual = float(np.median([speed for _, _, speed in columns]))
    time_std = float(np.sqrt(along_std**2 - across_std**2)) / usual
    return Jitter(across_std, time_std, float(noise.jerk_density[0]))


def smooth_jittered(
    time: Array,
    position: Array,
    velocity: Array,
    segment: NDArray[np.int64],
    *,
    jitter: Jitter,
    jerk_density: Array,
) -> tuple[Array, Array]:
    """Return the horizontal motion, of positions that are off along the way.

    Parameters
    ----------
    time : array (n,)
        [s], increasing within a segment.
    position : array (n, 3)
        North, east, down [m]; NaN where there is none.
    velocity : array (n, 2)
        As smoothed before: the way, and how fast [m/s].
    segment : int array (n,)
    jerk_density : array (3,)
        Of the log, if its noise is taken as the same every way [m^2/s^5].

    Returns
    -------
    vectors, covariance
        As `coupled.smooth_horizontal` does.

    Notes
    -----
    Stamps are worse in some parts of a log than in others, as where a receiver hardly hears the
    vehicle. So it is smoothed twice: in between, the noise of each sample is raised to what the
    residuals near it show, along the way and across it.
    """
    speed = np.hypot(*velocity.T)
    along = velocity / np.maximum(speed, 1e-9)[:, None]
    along[speed == 0] = (1.0, 0.0)
    std = jitter.position_std(speed)
    # Jitter passes for manoeuvres, and straight flight has none: the flight's own are in between.
    density = jerk_density.copy()
    density[:2] = np.sqrt(density[:2] * jitter.jerk_density)
    vectors, covariance = _smoothed(time, position, along, segment, std, density)
    std = std * local_scale(position[:, :2] - vectors[0], along, std, covariance[0])
    return _smoothed(time, position, along, segment, std, density)


def _smoothed(
    time: Array,
    position: Array,
    along: Array,
    segment: NDArray[np.int64],
    std: Array,
    jerk_density: Array,
) -> tuple[Array, Array]:
    density = local_jerk_density(
        time,
        position,
        None,
        segment,
        position_std=std[:, [0, 1, 1]],
        jerk_density=jerk_density,
        along=along,
    )[:, 0]
    vectors, covariance = np.empty((3, time.size, 2)), np.empty((3, time.size, 2, 2))
    for piece in stretches(segment):
        vectors[:, piece], covariance[:, piece] = smooth_horizontal(
            time[piece],
            position[piece, :2],
            along=along[piece],
            along_std=std[piece, 0],
            across_std=std[piece, 1],
            jerk_density=density[piece],
        )
    return vectors, covariance


def local_scale(residual: Array, along: Array, std: Array, covariance: Array) -> Array:
    """Return by how much the residuals near each sample exceed what is expected of them, (n, 2).

    Parameters
    ----------
    residual : array (n, 2)
        Measured less smoothed positions, north, east [m]; NaN where nothing was measured.
    along : array (n, 2)
        Unit vectors.
    std : array (n, 2)
        1-sigma of the measured positions along and across those [m].
    covariance : array (n, 2, 2)
        Of the smoothed positions [m^2].

    Notes
    -----
    Not below 1: where they are less, the smoothed motion may follow the noise.
    """
    scale = np.empty_like(std)
    across = np.stack((-along[:, 1], along[:, 0]), axis=1)
    for k, way in enumerate((along, across)):
        known = np.einsum('ni,nij,nj->n', way, covariance, way)
        # Less than a tenth of the noise left says that the sample stands for itself alone.
        expected = np.maximum(std[:, k] ** 2 - known, 0.1 * std[:, k] ** 2)
        ratio = np.einsum('ni,ni->n', residual, way) ** 2 / expected
        told = np.isfinite(ratio)
        total = _around(np.where(told, ratio, 0.0)) + _PRIOR
        scale[:, k] = np.sqrt(total / (_around(told.astype(float)) + _PRIOR))
    return np.clip(scale, 1.0, _MOST)


def _around(values: Array) -> Array:
    """Return the sum of the `_REACH` values about each."""
    sums = np.concatenate(([0.0], np.cumsum(values)))
    index = np.arange(values.size)
    first = np.maximum(index - _REACH // 2, 0)
    return np.asarray(sums[np.minimum(index + _REACH // 2, values.size)] - sums[first])
