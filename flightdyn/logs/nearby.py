"""What one topic says at the times of another."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# what is interpolated between samples no further apart, and how far the nearest one serves [ns]
_STRAIGHT = 2 * 10**9, 50 * 10**6
_TURNING = 10**9, 100 * 10**6


def interpolated(
    time: NDArray[np.int64], values: Array, wanted: NDArray[np.int64], *, turning: bool = False
) -> Array:
    """Return values (m, k) at the times wanted, NaN where no sample is near.

    Parameters
    ----------
    time : int array (n,)
        [ns], in any order.
    values : array (n, k)
        Rows with a NaN are left out.
    wanted : int array (m,)
        [ns].
    turning : bool
        Whether rows are unit quaternions: q and -q are one attitude, and the short way is gone.
    """
    bridge, near = _TURNING if turning else _STRAIGHT
    known = np.isfinite(values).all(axis=1)
    time, first = np.unique(time[known], return_index=True)
    values = values[known][first]
    if time.size == 0:
        return np.full((wanted.size, values.shape[1]), np.nan)
    after = np.clip(np.searchsorted(time, wanted), 0, time.size - 1)
    before = np.where(time[after] > wanted, np.maximum(after - 1, 0), after)
    span = time[after] - time[before]
    share = np.clip((wanted - time[before]) / np.maximum(span, 1), 0.0, 1.0)[:, None]
    ahead = values[after]
    if turning:
        same = np.sum(values[before] * ahead, axis=1, keepdims=True) >= 0
        ahead = np.where(same, 1, -1) * ahead
    between = (1 - share) * values[before] + share * ahead
    if turning:
        between /= np.linalg.norm(between, axis=1, keepdims=True)
    late = np.abs(wanted - time[before]) > np.abs(wanted - time[after])
    nearest = np.where(late, after, before)
    far = np.abs(wanted - time[nearest])
    inside = (time[before] <= wanted) & (wanted <= time[after]) & (span <= bridge)
    found = np.where(inside[:, None], between, values[nearest])
    return np.where((inside | (far <= near))[:, None], found, np.nan)
