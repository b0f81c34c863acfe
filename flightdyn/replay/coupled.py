"""Smoother of north and east together, of positions that are less sure one way than the other."""

from functools import cache
from typing import Any

import casadi as cas
import numpy as np
from numpy.typing import NDArray

from . import gauss_markov as gm
from .smoother import scan, start_state

Array = NDArray[np.float64]

STATE = 6
"""North and east of position, velocity, acceleration, in turn."""

_UPPER = [(i, j) for i in range(STATE) for j in range(i, STATE)]
_UPPER_OF_PLACE = [STATE + _UPPER.index(pair) for pair in ((0, 0), (0, 1), (1, 1))]
_SIZE = STATE + len(_UPPER)


def smooth_horizontal(
    time: Array,
    position: Array,
    *,
    along: Array,
    along_std: Array,
    across_std: Array,
    jerk_density: Array,
) -> tuple[Array, Array]:
    """Return the horizontal motion given all positions, before and after.

    Parameters
    ----------
    time : array (n,)
        Seconds, never decreasing; no gap across which the motion should not be bridged.
    position : array (n, 2)
        North, east [m]; NaN where there is none.
    along : array (n, 2)
        Unit vectors of the way that `along_std` holds for; `across_std` holds across it.
    along_std, across_std : array (n,)
        1-sigma of the white noise of the positions [m], above 0.
    jerk_density : array (n,)
        Of both axes, from the sample before to each [m^2/s^5].

    Returns
    -------
    vectors : array (3, n, 2)
        Position [m], velocity [m/s], acceleration [m/s^2].
    covariance : array (3, n, 2, 2)
        Of each.

    Notes
    -----
    As `smoother.smooth`, but what is measured along one axis tells of the other.
    """
    n = time.size
    known = np.asarray(np.isfinite(position).all(axis=1))
    base = position[np.argmax(known)] if known.any() else np.zeros(2)
    z = np.where(known[:, None], position - base, 0.0)
    weights = np.stack((along_std, across_std), axis=1) ** -2.0 * known[:, None]
    dt = np.diff(time)
    inputs = np.concatenate(
        (dt[:, None], z[1:], along[1:], weights[1:], jerk_density[1:, None]), axis=1
    )
    blank = np.zeros((n, 3))
    rough = np.repeat(weights.min(axis=1, keepdims=True), 3, axis=1)
    begin = start_state(dt, np.append(z, z[:, :1], axis=1), rough, blank, blank)
    filtered = np.empty((n, _SIZE))
    filtered[0] = _joined(begin)
    if known[0]:
        (c, s), (var_along, var_across) = along[0], 1 / weights[0]
        filtered[0, _UPPER_OF_PLACE] = (
            c**2 * var_along + s**2 * var_across,
            c * s * (var_along - var_across),
            s**2 * var_along + c**2 * var_across,
        )
    filtered[1:] = scan(_forward, filtered[0], inputs)
    back = np.concatenate((dt[:, None], filtered[:-1], jerk_density[1:, None]), axis=1)[::-1]
    result = np.concatenate((scan(_backward, filtered[-1], back)[::-1], filtered[-1:]))
    vectors = np.moveaxis(result[:, :STATE].reshape(n, 3, 2), 1, 0).copy()
    vectors[0] += base
    covariance = np.empty((3, n, 2, 2))
    for column, (i, j) in enumerate(_UPPER, STATE):
        if i // 2 == j // 2:
            covariance[i // 2, :, i % 2, j % 2] = result[:, column]
            covariance[i // 2, :, j % 2, i % 2] = result[:, column]
    return vectors, covariance


def _joined(axes: Array) -> Array:
    """Return one state of north and east out of one of each, (3, 9) as `start_state` has them."""
    mean = axes[:2, :3].T.reshape(-1)
    cov = np.zeros((STATE, STATE))
    for axis in range(2):
        cov[axis::2, axis::2] = axes[axis, 3:][[[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
    return np.concatenate((mean, [cov[i, j] for i, j in _UPPER]))


def _transition(dt: Any, density: Any) -> tuple[Any, Any]:
    one = cas.SX([[1, 0, 0], [0, 1, 0], [0, 0, 1]])
    one[0, 1], one[1, 2], one[0, 2] = dt, dt, dt * dt / 2
    pp, pv, pa, vv, va, aa = gm.jerk_covariance(dt, density)
    noise = cas.vertcat(cas.horzcat(pp, pv, pa), cas.horzcat(pv, vv, va), cas.horzcat(pa, va, aa))
    both = cas.SX.eye(2)
    return cas.kron(one, both), cas.kron(noise, both)


def _split(x: Any) -> tuple[Any, Any]:
    cov = cas.SX(STATE, STATE)
    for column, (i, j) in enumerate(_UPPER, STATE):
        cov[i, j] = cov[j, i] = x[column]
    return x[:STATE], cov


def _packed(mean: Any, cov: Any) -> Any:
    return cas.vertcat(mean, *[cov[i, j] for i, j in _UPPER])


@cache
def _forward(size: int) -> cas.Function:
    state, row = cas.SX.sym('state', _SIZE), cas.SX.sym('row', 8)
    dt, z, along, weights, density = row[0], row[1:3], row[3:5], row[5:7], row[7]
    mean, cov = _split(state)
    transition, noise = _transition(dt, density)
    mean = transition @ mean
    cov = transition @ cov @ transition.T + noise
    for k, way in enumerate((along, cas.vertcat(-along[1], along[0]))):
        column = cov[:, :2] @ way
        gain = weights[k] / (1 + weights[k] * (way.T @ column[:2])) * column
        mean = mean + gain * (way.T @ (z - mean[:2]))
        cov = cov - gain @ column.T
    return _scan('forward', state, row, _packed(mean, cov), size)


@cache
def _backward(size: int) -> cas.Function:
    later, row = cas.SX.sym('later', _SIZE), cas.SX.sym('row', _SIZE + 2)
    mean, cov = _split(row[1 : 1 + _SIZE])
    later_mean, later_cov = _split(later)
    transition, noise = _transition(row[0], row[1 + _SIZE])
    cross = transition @ cov
    # The gain is cov transition' predicted^-1, both of which are symmetric.
    factors = cas.ldl(cross @ transition.T + noise)
    gain = cas.ldl_solve(cross, *factors).T
    rest = cas.SX.eye(STATE) - gain @ transition
    smoothed = mean + gain @ (later_mean - transition @ mean)
    summed = rest @ cov @ rest.T + gain @ (noise + later_cov) @ gain.T
    return _scan('backward', later, row, _packed(smoothed, summed), size)


def _scan(direction: str, state: Any, row: Any, after: Any, size: int) -> cas.Function:
    step = cas.Function(f'{direction}_step', [state, row], [after], {'cse': True})
    return step.mapaccum(f'{direction}_{size}', size)
