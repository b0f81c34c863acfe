"""How far each sample is off what the motion model expects of it, and when that is too far."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as cas
import numpy as np
from numpy.typing import NDArray

from . import gauss_markov as gm
from .smoother import STATE, densities, measurement, scan, split, start_state

Array = NDArray[np.float64]

GATE_SIGMAS = 5.5
"""A sample farther off than so many 1-sigma is rejected: of two axes 1 in 4e6 by chance [1]."""

SURPRISE = 15.0
"""1-sigma of a change of acceleration from one sample to the next [m/s^2].

Added to what the white jerk allows: its density is one figure for the whole log, and a
flight that is smooth for an hour may have one sharp manoeuvre.
"""

SURPRISE_TIME = 1.0
"""How long such a change lasts at most [s]; what lasts longer shows in the samples."""

_GROUPS = ((0, (0, 1)), (0, (2,)), (1, (0, 1)), (1, (2,)))  # component, axes
_EXTRA = 3 * len(_GROUPS)  # time since the last accepted, ratio, distance


@dataclass(frozen=True)
class Innovations:
    """Innovations of a gated filter; columns: horizontal position, altitude, and velocities.

    Parameters
    ----------
    ratio : array (n, 4)
        Squared innovation over its variance, scaled to one axis; 0 where nothing was measured.
    off : array (n, 4)
        Innovation [m], [m/s].
    """

    ratio: Array
    off: Array


def innovations(
    time: Array,
    position: Array,
    position_std: Array,
    velocity: Array | None,
    velocity_std: Array,
    jerk_density: Array,
) -> Innovations:
    """Return the innovations of a filter that leaves out what is beyond `GATE_SIGMAS`.

    Parameters
    ----------
    time : array (n,)
        [s], not decreasing.
    position, velocity : array (n, 3)
        [m], [m/s]; NaN where there is none.
    position_std, velocity_std : array (n, 3)
    jerk_density : array (3,)
        [m^2/s^5].

    References
    ----------
    .. [1] Bar-Shalom, Li, Kirubarajan, *Estimation with Applications to Tracking and Navigation*,
       2001, section 5.4, normalized innovation squared.
    """
    n = time.size
    dt = np.diff(time)
    z_p, w_p = measurement('position', position, position_std, n)
    blank = np.zeros((n, 3))
    z_v, w_v = blank, blank
    if velocity is not None:
        z_v, w_v = measurement('velocity', velocity, velocity_std, n)
    known = w_p > 0
    base = z_p[np.argmax(known, axis=0), np.arange(3)]
    z_p = np.where(known, z_p - base, 0.0)
    start = np.concatenate((start_state(dt, z_p, w_p, z_v, w_v).reshape(-1), np.zeros(_EXTRA)))
    q = densities(jerk_density, n)
    inputs = np.concatenate((dt[:, None], z_p[1:], w_p[1:], z_v[1:], w_v[1:], q), axis=1)
    rest = scan(_compiled, start, inputs)[:, 3 * STATE :]
    groups = len(_GROUPS)
    result = np.zeros((n, 2 * groups))
    result[1:] = rest[:, groups:]
    return Innovations(result[:, :groups], result[:, groups:])


def left_out(
    time: Array,
    position: Array,
    smoothed: Array,
    variance: Array,
    segment: NDArray[np.int64],
    position_std: Array,
) -> tuple[Array, Array]:
    """Return the squared distance of each position from what all others make of it, and it [m].

    Parameters
    ----------
    position, smoothed, variance, position_std : array (n, 3)
        Measured, smoothed with it, the variance of that, and the noise of the measured.

    Returns
    -------
    ratio : array (n, 2)
        Over its variance, scaled to one axis: horizontal, vertical; 0 where there is none.
    distance : array (n, 2)

    Notes
    -----
    What the smoother would have made without the sample follows from what it made with it:
    distance = (z - x) R / (R - P), of variance R^2 / (R - P).
    """
    noise = position_std**2
    # Less than a thousandth of the noise left means that the sample stands for itself alone.
    rest = np.maximum(noise - variance, 1e-3 * noise)
    off = np.where(np.isfinite(position), (position - smoothed) * noise / rest, 0.0)
    step = np.diff(time, prepend=time[:1])
    step[1:][np.diff(segment) != 0] = 0.0
    reach = np.maximum(step, np.append(step[1:], 0.0))
    # At an end of a segment there is a neighbour on one side only, and that says less.
    lonely = np.ones(time.size)
    edge = np.flatnonzero(np.diff(segment) != 0)
    lonely[[0, -1, *edge, *(edge + 1)]] = 2.0
    surprise = _surprise(reach, np.minimum(reach, SURPRISE_TIME))[0]
    spread = noise**2 / rest + (lonely * surprise)[:, None] ** 2
    each = off**2 / spread
    ratio = np.stack(((each[:, 0] + each[:, 1]) / _of_two_axes(), each[:, 2]), axis=1)
    return ratio, np.stack((np.hypot(off[:, 0], off[:, 1]), np.abs(off[:, 2])), axis=1)


def _surprise(dt: Any, lasting: Any) -> tuple[Any, Any]:
    """Return how far off the position [m] and the velocity [m/s] are dt after a surprise."""
    return SURPRISE * lasting * (dt - lasting / 2), SURPRISE * lasting


def _of_two_axes() -> float:
    """Return how much larger a chi-square of two axes is than of one, equally unlikely."""
    # P(chi2_2 > x) = exp(-x / 2); of one axis 5.5 sigma is 3.8e-8.
    return float(-2 * np.log(3.8e-8) / GATE_SIGMAS**2)


@cache
def _compiled(size: int) -> cas.Function:
    groups = len(_GROUPS)
    state = cas.SX.sym('state', 3 * STATE + _EXTRA)
    row = cas.SX.sym('row', 16)
    dt, q = row[0], row[-3:]
    axes = [gm.predict(*split(state, axis * STATE), dt, q[axis]) for axis in range(3)]
    waits: list[Any] = []
    ratios: list[Any] = []
    distances: list[Any] = []
    for number, (component, members) in enumerate(_GROUPS):
        wait = state[3 * STATE + number] + dt
        doubt = _surprise(wait, cas.fmin(wait, SURPRISE_TIME))[component] ** 2
        total: Any = 0.0
        away: Any = 0.0
        measured: Any = 0.0
        for axis in members:
            mean, cov = axes[axis]
            value, weight = row[1 + 6 * component + axis], row[4 + 6 * component + axis]
            step = value - mean[component]
            variance = cov[0 if component == 0 else 3] + doubt
            total += weight * step**2 / (1 + weight * variance)
            away += cas.sign(weight) * step**2
            measured += weight
        ratio = total / (_of_two_axes() if len(members) == 2 else 1.0)
        accepted = cas.if_else(ratio > GATE_SIGMAS**2, 0.0, 1.0)
        for axis in members:
            mean, cov = axes[axis]
            value, weight = row[1 + 6 * component + axis], row[4 + 6 * component + axis]
            axes[axis] = gm.measure(mean, cov, component, value, weight * accepted)
        waits.append(wait * (1 - accepted * cas.sign(measured)))
        ratios.append(ratio)
        distances.append(cas.sqrt(away))
    after = [part for mean, cov in axes for part in (*mean, *cov)]
    step_function = cas.Function(
        'gate_step',
        [state, row],
        [cas.vertcat(*after, *waits, *ratios, *distances)],
        {'cse': True},
    )
    assert 3 * groups == _EXTRA
    return step_function.mapaccum(f'gate_{size}', size)
