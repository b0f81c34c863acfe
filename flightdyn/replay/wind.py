"""Wind out of the motion over the ground: from turns, or from a recorded airspeed.

Over a full turn the velocity over the ground goes round the wind: whatever the airspeed was, if it
stayed the same, one wind explains all of the turn. Where the airspeed was recorded, every course
tells the wind along it.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..trajectory import stretches

Array = NDArray[np.float64]
Method = Literal['circling', 'airspeed']

LEAST_AIRSPEED = 3.0
"""Slower than this over the ground, or through the air, a sample says nothing of wind [m/s]."""

SLOWEST_TURN = np.radians(3.0)
"""A turn is one where the course changes by this at least [rad/s]: a standard rate turn."""

CHANGE = 0.2
"""1-sigma by which a wind changes along the flight, grows with the root of the time [m/s/s^0.5].

1.5 m/s a minute, 3 m/s in four: what a climb of a few hundred metres or an hour's flight meets.
"""

BLOCK_S = 60.0
"""With a recorded airspeed, a wind every so many seconds."""

_MOST_BLOCKS = 400
_LEAST_STD = 0.5  # m/s; an airspeed is no steadier, nor better known
_MOST_SCATTER = 0.2  # of the airspeed; a turn whose airspeed changed by more tells no wind
_INDEPENDENT = 4.0  # errors in a turn: a pilot's airspeed wanders, it is not drawn anew each time
_INDEPENDENT_S = 15.0  # between errors of a recorded airspeed, which wander too
_ROUNDS = 12


@dataclass(frozen=True)
class WindEstimate:
    """The wind along a flight.

    Parameters
    ----------
    north, east : array (n,)
        Where the air moves to at the vehicle [m/s].
    std : array (n,)
        1-sigma of each of them [m/s].
    blocks : int
        Turns, or stretches with an airspeed, that told it.
    method : 'circling' or 'airspeed'
    """

    north: Array
    east: Array
    std: Array
    blocks: int
    method: Method


@dataclass(frozen=True)
class _Block:
    """Samples to which one wind belongs; `airspeed` is their horizontal one, None if unknown."""

    time: float
    velocity: Array
    airspeed: Array | None
    independent: float


def estimate_wind(
    time: Array,
    velocity: Array,
    segment: NDArray[np.int64],
    airspeed: Array | None = None,
) -> WindEstimate | None:
    """Return the wind along a flight, None if nothing tells it.

    Parameters
    ----------
    time : array (n,)
        [s], not decreasing within a segment.
    velocity : array (n, 3)
        Over the ground, north, east, down at the vehicle [m/s].
    segment : int array (n,)
    airspeed : array (n,), optional
        True airspeed [m/s], NaN where there is none. Omitted: the wind is told by turns.

    Notes
    -----
    Each block of samples has one wind; from block to block it changes at random, by `CHANGE`.
    That chain and the airspeeds are solved together by Gauss-Newton; the scatter of the airspeeds
    within a block says how far each block is to be believed. The air is taken to move
    horizontally.

    References
    ----------
    .. [1] Kasa, "A circle fitting procedure and its error analysis", IEEE Trans. Instrum. Meas.
       25(1), 1976, for the start.
    """
    size = time.size
    if velocity.shape != (size, 3) or segment.shape != (size,):
        raise InputError(
            f'wind: velocity {velocity.shape}, segment {segment.shape}, time ({size},)'
        )
    if airspeed is None:
        blocks = _turns(time, velocity, segment)
    else:
        blocks = _stretches(time, velocity, segment, airspeed)
    blocks.sort(key=lambda block: block.time)  # a clock set back puts later ones first
    start = _circle(blocks) if blocks else None
    if start is None:
        return None
    winds = np.tile(start, (len(blocks), 1))
    times = np.array([block.time for block in blocks])
    for _ in range(_ROUNDS):
        step, covariance = _improved(blocks, times, winds)
        winds = winds + step
        if np.abs(step).max() < 1e-4:
            break
    if not np.isfinite(winds).all():
        return None
    variance = np.einsum('kii->k', covariance) / 2
    # Between two blocks the wind may be off the line by what a bridge between them allows.
    after = np.clip(np.searchsorted(times, time), 0, times.size - 1)
    before = np.maximum(after - 1, 0)
    gap = np.maximum(times[after] - times[before], 1e-9)
    share = np.clip((time - times[before]) / gap, 0.0, 1.0)
    outside = np.maximum(times[0] - time, 0.0) + np.maximum(time - times[-1], 0.0)
    wander = CHANGE**2 * (share * (1 - share) * gap + outside)
    return WindEstimate(
        north=np.interp(time, times, winds[:, 0]),
        east=np.interp(time, times, winds[:, 1]),
        std=np.sqrt(np.interp(time, times, variance) + wander),
        blocks=len(blocks),
        method='circling' if airspeed is None else 'airspeed',
    )


def _turns(time: Array, velocity: Array, segment: NDArray[np.int64]) -> list[_Block]:
    """Return full turns, of a course that goes on changing to the same side."""
    blocks = []
    ground = np.hypot(velocity[:, 0], velocity[:, 1])
    for part in stretches(segment):
        t = time[part]
        if t.size < 8 or t[-1] <= t[0]:
            continue
        course = np.unwrap(np.arctan2(velocity[part, 1], velocity[part, 0]))
        moving = ground[part] > LEAST_AIRSPEED
        rate = np.gradient(course, np.maximum.accumulate(t + 1e-9 * np.arange(t.size)))
        side = np.where(moving & (np.abs(rate) > SLOWEST_TURN / 2), np.sign(rate), 0.0)
        edges = np.flatnonzero(np.diff(side, prepend=np.nan, append=np.nan) != 0)
        for first, last in pairwise(edges):
            turned = abs(course[last - 1] - course[first])
            number = int(turned // (2 * np.pi))
            lasting = t[last - 1] - t[first]
            if side[first] == 0 or number == 0 or turned < SLOWEST_TURN * lasting:
                continue
            marks = course[first] + side[first] * turned * np.arange(number + 1) / number
            order = side[first] * course[first:last]
            cuts = first + np.searchsorted(order, side[first] * marks)
            for a, b in pairwise(cuts):
                if b - a >= 6:
                    own = velocity[part][a:b]
                    blocks.append(_Block(float(t[a:b].mean()), own, None, _INDEPENDENT))
    return _steady(blocks)


def _steady(blocks: list[_Block]) -> list[_Block]:
    """Return the turns that one wind and one airspeed explain."""
    kept = []
    for block in blocks:
        wind = _circle([block])
        if wind is None:
            continue
        radius = np.hypot(block.velocity[:, 0] - wind[0], block.velocity[:, 1] - wind[1])
        mean = float(radius.mean())
        if mean > LEAST_AIRSPEED and float(radius.std()) < _MOST_SCATTER * mean:
            kept.append(block)
    step = max(1, -(-len(kept) // _MOST_BLOCKS))
    return kept[::step]


def _stretches(
    time: Array, velocity: Array, segment: NDArray[np.int64], airspeed: Array
) -> list[_Block]:
    """Return stretches of `BLOCK_S` with a recorded airspeed in flight."""
    ground = np.hypot(velocity[:, 0], velocity[:, 1])
    with np.errstate(invalid='ignore'):
        across = airspeed**2 - velocity[:, 2] ** 2
        usable = (ground > LEAST_AIRSPEED) & (across > LEAST_AIRSPEED**2)
    length = max(BLOCK_S, float(np.ptp(time)) / _MOST_BLOCKS)
    label = np.floor((time - time.min()) / length)
    blocks = []
    for part in stretches(segment):
        for number in np.unique(label[part]):
            own = part.start + np.flatnonzero((label[part] == number) & usable[part])
            if own.size < 3:
                continue
            lasting = float(np.ptp(time[own]))
            blocks.append(
                _Block(
                    float(time[own].mean()),
                    velocity[own],
                    np.sqrt(across[own]),
                    1.0 + lasting / _INDEPENDENT_S,
                )
            )
    return blocks


def _circle(blocks: list[_Block]) -> Array | None:
    """Return the wind (2,) that suits all blocks, by least squares linear in it and its square."""
    rows, values = [], []
    for block in blocks:
        v = block.velocity[:, :2]
        square = (v**2).sum(axis=1) - (0.0 if block.airspeed is None else block.airspeed**2)
        # |v|^2 - V^2 = 2 v.w - |w|^2: the constant, and an airspeed unknown, are fitted with it.
        rows.append(2 * (v - v.mean(axis=0)))
        values.append(square - square.mean())
    matrix, right = np.concatenate(rows), np.concatenate(values)
    information = matrix.T @ matrix
    if np.linalg.eigvalsh(information)[0] < 1e-3 * np.linalg.eigvalsh(information)[1]:
        return None  # one course only: the wind across it does not show
    return np.asarray(np.linalg.solve(information, matrix.T @ right))


def _improved(blocks: list[_Block], times: Array, winds: Array) -> tuple[Array, Array]:
    """Return a Gauss-Newton step (k, 2) and the covariance of each wind (k, 2, 2)."""
    number = len(blocks)
    own = np.zeros((number, 2, 2))
    right = np.zeros((number, 2))
    for k, block in enumerate(blocks):
        through = block.velocity[:, :2] - winds[k]
        size = np.maximum(np.hypot(through[:, 0], through[:, 1]), 1e-3)
        slope = through / size[:, None]
        residual = size - (size.mean() if block.airspeed is None else block.airspeed)
        if block.airspeed is None:
            slope = slope - slope.mean(axis=0)
        spread = max(float(np.mean(residual**2)), _LEAST_STD**2)
        weight = min(block.independent / size.size, 1.0) / spread
        own[k] = weight * slope.T @ slope
        right[k] = weight * slope.T @ residual
    held = 1 / (CHANGE**2 * np.maximum(np.diff(times), 1.0))
    apart = held[:, None] * np.diff(winds, axis=0)
    right[:-1] += apart
    right[1:] -= apart
    own[:-1] += held[:, None, None] * np.eye(2)
    own[1:] += held[:, None, None] * np.eye(2)
    return _chain(own, held, right)


def _chain(own: Array, held: Array, right: Array) -> tuple[Array, Array]:
    """Return the solution (k, 2) and the blocks (k, 2, 2) of the inverse of a chain.

    Block tridiagonal: `own` (k, 2, 2) on the diagonal, -`held` (k - 1,) times unity beside it.
    """
    number = own.shape[0]
    inverse = np.empty_like(own)
    passed = right.copy()
    inverse[0] = np.linalg.inv(own[0])
    for k in range(1, number):
        inverse[k] = np.linalg.inv(own[k] - held[k - 1] ** 2 * inverse[k - 1])
        passed[k] += held[k - 1] * inverse[k - 1] @ passed[k - 1]
    solution, covariance = np.empty_like(right), inverse.copy()
    solution[-1] = inverse[-1] @ passed[-1]
    for k in range(number - 2, -1, -1):
        solution[k] = inverse[k] @ (passed[k] + held[k] * solution[k + 1])
        covariance[k] += held[k] ** 2 * inverse[k] @ covariance[k + 1] @ inverse[k]
    return solution, covariance
