"""Rauch-Tung-Striebel smoother of one unbroken stretch of positions and velocities."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as cas
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from . import gauss_markov as gm

Array = NDArray[np.float64]

VELOCITY_PRIOR = 1e3
"""1-sigma of a velocity of which nothing is known [m/s]."""

ACCELERATION_PRIOR = 30.0
"""1-sigma of an acceleration of which nothing is known [m/s^2]: about 3 g."""

STATE = 9
"""Numbers that describe one axis: mean 3, covariance 6."""

_CHUNKS = (16, 256)  # samples per compiled scan: small for short segments, large for speed


@dataclass(frozen=True)
class Smoothed:
    """Smoothed motion along three axes.

    Parameters
    ----------
    position, velocity, acceleration : array (n, 3)
        [m], [m/s], [m/s^2] in the axes of what was measured.
    covariance : array (n, 3, 3, 3)
        `covariance[k, axis]` is that of (position, velocity, acceleration) along the axis.
    """

    position: Array
    velocity: Array
    acceleration: Array
    covariance: Array

    @property
    def std(self) -> Array:
        """1-sigma (n, 3, 3): `std[:, axis, 0]` of position, 1 of velocity, 2 of acceleration."""
        return np.sqrt(np.diagonal(self.covariance, axis1=2, axis2=3))


def smooth(
    time: ArrayLike,
    position: ArrayLike,
    *,
    position_std: ArrayLike,
    velocity: ArrayLike | None = None,
    velocity_std: ArrayLike | None = None,
    jerk_density: ArrayLike,
) -> Smoothed:
    """Return position, velocity and acceleration given all samples, before and after.

    Parameters
    ----------
    time : array (n,)
        Seconds, never decreasing; no gap across which the motion should not be bridged.
    position : array (n, 3)
        Measured position in any inertial Cartesian axes [m]; NaN where there is none.
    position_std : float or array broadcasting to (n, 3)
        1-sigma of the white part of the measurement noise [m], above 0.
    velocity, velocity_std : array (n, 3), optional
        Measured velocity along the same axes and its 1-sigma [m/s]; NaN where there is none.
    jerk_density : float, array (3,) or (n, 3)
        Spectral density of the white jerk that drives each axis [m^2/s^5]; of an array (n, 3)
        each row holds from the sample before to its own.

    Returns
    -------
    Smoothed

    Raises
    ------
    InputError
        If shapes differ, time runs backwards or a noise level is not above 0.

    Notes
    -----
    The axes are independent. Velocity and acceleration start from zero-mean priors
    (`VELOCITY_PRIOR`, `ACCELERATION_PRIOR`), which matter only where the samples say nothing, as
    in a segment of one.

    References
    ----------
    .. [1] Sarkka, *Bayesian Filtering and Smoothing*, 2013, sections 4.3 and 8.2.
    """
    t = np.asarray(time, dtype=float)
    if t.ndim != 1 or t.size == 0:
        raise InputError(f'smoother time must be a non-empty 1-D array, got {t.shape}')
    dt = np.diff(t)
    if not np.isfinite(t).all() or (dt < 0).any():
        raise InputError(f'smoother time runs backwards at sample {int(np.argmin(dt)) + 1}')
    q = densities(jerk_density, t.size)
    z_p, w_p = measurement('position', position, position_std, t.size)
    if velocity is None:
        z_v, w_v = np.zeros((t.size, 3)), np.zeros((t.size, 3))
    else:
        std = np.nan if velocity_std is None else velocity_std
        z_v, w_v = measurement('velocity', velocity, std, t.size)

    # The position is smoothed as an offset: far from the origin its digits are needed.
    base = _first_known(z_p, w_p)
    z_p = np.where(w_p > 0, z_p - base, 0.0)
    filtered = _filter(dt, z_p, w_p, z_v, w_v, q)
    result = _backward(dt, filtered, q)
    mean, upper = result[:, :, :3], result[:, :, 3:]
    cov = upper[:, :, [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
    return Smoothed(mean[:, :, 0] + base, mean[:, :, 1], mean[:, :, 2], cov)


def measurement(what: str, values: ArrayLike, std: ArrayLike, size: int) -> tuple[Array, Array]:
    """Return finite values and their weights 1 / variance, 0 where there is no measurement."""
    z = np.asarray(values, dtype=float)
    if z.shape != (size, 3):
        raise InputError(f'{what} has shape {z.shape}, expected ({size}, 3)')
    try:
        sigma = np.broadcast_to(np.asarray(std, dtype=float), (size, 3))
    except ValueError:
        raise InputError(f'{what}_std does not broadcast to ({size}, 3)') from None
    known = np.isfinite(z)
    if not (sigma[known] > 0).all():
        raise InputError(f'{what}_std must be above 0 wherever there is a {what}')
    weight = np.zeros((size, 3))
    weight[known] = sigma[known] ** -2.0
    return np.where(known, z, 0.0), weight


def densities(jerk_density: ArrayLike, size: int) -> Array:
    """Return the jerk density of each axis from each sample to the next, (size - 1, 3)."""
    try:
        q = np.broadcast_to(np.asarray(jerk_density, float), (size, 3))
    except ValueError:
        raise InputError(f'jerk_density does not broadcast to ({size}, 3)') from None
    if not (np.isfinite(q).all() and (q > 0).all()):
        raise InputError(f'jerk_density must be above 0, got {jerk_density!r}')
    return q[1:]


def _first_known(z: Array, weight: Array) -> Array:
    first = np.argmax(weight > 0, axis=0)
    return np.asarray(z[first, np.arange(3)])


def _filter(dt: Array, z_p: Array, w_p: Array, z_v: Array, w_v: Array, q: Array) -> Array:
    """Return mean and covariance given the past, (n, 3 axes, 9)."""
    start = start_state(dt, z_p, w_p, z_v, w_v)
    inputs = np.concatenate((dt[:, None], z_p[1:], w_p[1:], z_v[1:], w_v[1:], q), axis=1)
    rest = scan(_forward, start.reshape(-1), inputs)
    return np.concatenate((start[None], rest.reshape(-1, 3, STATE)))


def start_state(dt: Array, z_p: Array, w_p: Array, z_v: Array, w_v: Array) -> Array:
    """Return mean and covariance at the first sample (3 axes, 9), as `measurement` gives it."""
    start = np.zeros((3, STATE))
    # What the first sample measured is its state: no diffuse prior to lose digits to. A position
    # first known later than the first sample can be as far off as the velocity prior carries it.
    span = 1.0 + float(dt.sum())
    known_p, known_v = w_p[0] > 0, w_v[0] > 0
    start[:, 0] = z_p[0]
    start[:, 1] = z_v[0]
    start[:, 3] = np.where(
        known_p, 1 / np.where(known_p, w_p[0], 1.0), (VELOCITY_PRIOR * span) ** 2
    )
    start[:, 6] = np.where(known_v, 1 / np.where(known_v, w_v[0], 1.0), VELOCITY_PRIOR**2)
    start[:, 8] = ACCELERATION_PRIOR**2
    return start


def _backward(dt: Array, filtered: Array, q: Array) -> Array:
    n = filtered.shape[0]
    earlier = filtered[:-1].reshape(n - 1, 3 * STATE)
    inputs = np.concatenate((dt[:, None], earlier, q), axis=1)[::-1]
    rest = scan(_backwards, filtered[-1].reshape(-1), inputs)
    return np.concatenate((rest.reshape(-1, 3, STATE)[::-1], filtered[-1:]))


def scan(compiled: Callable[[int], cas.Function], start: Array, inputs: Array) -> Array:
    """Return the state after each row of inputs, (m, state); the last chunk is padded, then cut.

    `compiled` returns the scan over so many rows, of (state, row).
    """
    m, width = inputs.shape
    if m == 0:
        return np.empty((0, start.size))
    out = np.empty((m, start.size))
    state = np.array(start)
    size = next((c for c in _CHUNKS if c >= m), _CHUNKS[-1])
    # CasADi reads and writes these arrays in place, columns first: a row here is its column.
    rows = np.zeros((size, width))
    states = np.empty((size, start.size))
    buffer: Any
    buffer, evaluate = compiled(size).buffer()
    for i, argument in enumerate((state, rows)):
        buffer.set_arg(i, argument.data)
    buffer.set_res(0, states.data)
    for done in range(0, m, size):
        count = min(size, m - done)
        rows[:count] = inputs[done : done + count]
        rows[count:] = rows[count - 1]
        evaluate()
        out[done : done + count] = states[:count]
        state[:] = states[-1]
    return out


@cache
def _forward(size: int) -> cas.Function:
    return _compiled('forward', size)


@cache
def _backwards(size: int) -> cas.Function:
    return _compiled('backward', size)


def _compiled(direction: str, size: int) -> cas.Function:
    """Return a scan over `size` samples, all three axes in one step."""
    state = cas.SX.sym('state', 3 * STATE)
    width = 16 if direction == 'forward' else 4 + 3 * STATE
    row = cas.SX.sym('row', width)
    dt, q = row[0], row[-3:]
    after: list[Any] = []
    for axis in range(3):
        mean, cov = split(state, axis * STATE)
        if direction == 'forward':
            mean, cov = gm.predict(mean, cov, dt, q[axis])
            mean, cov = gm.measure(mean, cov, 0, row[1 + axis], row[4 + axis])
            mean, cov = gm.measure(mean, cov, 1, row[7 + axis], row[10 + axis])
        else:
            earlier_mean, earlier_cov = split(row, 1 + axis * STATE)
            mean, cov = gm.smooth(earlier_mean, earlier_cov, mean, cov, dt, q[axis])
        after += [*mean, *cov]
    step = cas.Function(f'{direction}_step', [state, row], [cas.vertcat(*after)], {'cse': True})
    return step.mapaccum(f'{direction}_{size}', size)


def split(x: Any, start: int) -> tuple[gm.Mean, gm.Covariance]:
    """Return mean and covariance held in `STATE` elements of a vector."""
    p, v, a, pp, pv, pa, vv, va, aa = (x[start + i] for i in range(STATE))
    return (p, v, a), (pp, pv, pa, vv, va, aa)
