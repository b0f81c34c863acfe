"""Flights within a replay: from take-off to landing, told from the motion alone."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..trajectory import Trajectory, stretches

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

REST_SPEED = 1.5
"""Slower than this, or than twice its 1-sigma, a vehicle may be standing [m/s]."""

REST_S = 10.0
"""A rest lasts at least so long [s]."""

HOVER_S = 300.0
"""A rest above the ground on both sides, if shorter, is a hover [s]."""

LIFTED = 3.0
"""A vehicle this far above where it stood, or four 1-sigmas of its height, has taken off [m]."""

FLOWN = 6.0
"""A vehicle that was never so far above the ground has not flown [m]."""

AIRBORNE_SPEED = 30.0
"""A log that begins or ends at such a speed does so in flight [m/s]."""

GLIDED = 50.0
"""Nor has one that came down by less, at `SINK` or more: launched from a hill [m]."""

SINK = 0.5
"""Mean vertical speed of who glides: roads and taxiways are flatter [m/s]."""

UNSEEN_S = 600.0
"""A gap may hide a landing and a take-off if it is longer [s]."""

_CLIMB = 0.3  # m/s; before it leaves the ground a vehicle climbs no faster


@dataclass(frozen=True)
class Flight:
    """One flight, in seconds of the trajectory's time.

    Parameters
    ----------
    start, end : float
        First and last sample in the air.
    takeoff, landing : bool
        Whether the log holds the take-off and the landing, or begins, ends in flight.
    """

    start: float
    end: float
    takeoff: bool
    landing: bool


def find_flights(flown: Trajectory) -> list[Flight]:
    """Return the flights of a replayed trajectory, in order.

    Parameters
    ----------
    flown : Trajectory
        As `reconstruct` returns it.

    Notes
    -----
    The vehicle is on the ground where it stands for `REST_S` and, unless it does so for
    `HOVER_S`, has not come up from below and gone down again. Between two such rests it has
    flown if it was `FLOWN` above the higher of both, or glided down from one to the other. A gap
    in the log does not end a flight, unless in more than `UNSEEN_S` the vehicle made less than
    half the way it would have at its speed; nor does touching down without coming to rest.
    """
    height = flown['altitude'] if 'altitude' in flown else -flown['z_e']
    rests = _rests(flown, height)
    # What is before the first rest and after the last is a piece too.
    marks = sorted([(0, 0), *rests, *_stops_unseen(flown), (len(flown), len(flown))])
    found = []
    for (a, first), (last, b) in pairwise(marks):
        flight = _flight(flown, height, first, last, rested=a < first, rests=last < b)
        if flight is not None:
            found.append(flight)
    return found


def _rests(flown: Trajectory, height: Array) -> list[tuple[int, int]]:
    """Return the first index of each rest on the ground and the one after its last."""
    limit = np.maximum(REST_SPEED, 2 * flown['speed_std']) if 'speed_std' in flown else REST_SPEED
    still = (flown['speed'] < limit) & (flown['speed'] < 0.2 * max(float(flown['speed'].max()), 1))
    still &= np.abs(flown['w_e']) < REST_SPEED if 'w_e' in flown else True
    assert flown.segment is not None
    rests = []
    for part in stretches(flown.segment):
        edges = part.start + np.flatnonzero(
            np.diff(still[part].astype(int), prepend=0, append=0) != 0
        )
        for a, b in zip(edges[::2], edges[1::2], strict=True):
            if flown.time[b - 1] - flown.time[a] >= REST_S:
                rests.append((int(a), int(b)))
    grounded = []
    for a, b in rests:
        level = float(np.median(height[a:b])) - _margin(flown, a, b)
        came_up = a > 0 and height[:a].min() < level
        goes_down = b < height.size and height[b:].min() < level
        lasted = flown.time[b - 1] - flown.time[a]
        if not (came_up and goes_down) or lasted >= HOVER_S:
            grounded.append((a, b))
    return grounded


def _stops_unseen(flown: Trajectory) -> list[tuple[int, int]]:
    """Return, twice each, before which samples a gap is too long for the way made in it."""
    gap = np.diff(flown.time)
    way = np.hypot(np.diff(flown['x_e']), np.diff(flown['y_e']))
    speed = flown['speed']
    slower = way < 0.5 * gap * np.minimum(speed[1:], speed[:-1])
    return [(int(k), int(k)) for k in 1 + np.flatnonzero((gap > UNSEEN_S) & slower)]


def _margin(flown: Trajectory, a: int, b: int) -> float:
    std = float(np.median(flown['z_e_std'][a:b])) if 'z_e_std' in flown else 0.0
    return max(LIFTED, 4 * std)


def _flight(
    flown: Trajectory, height: Array, first: int, last: int, *, rested: bool, rests: bool
) -> Flight | None:
    """Return the flight within samples that follow one rest and lead to the next."""
    if last - first < 2:
        return None
    speed, own = flown['speed'][first:last], height[first:last]
    margin = _margin(flown, first, last)
    # Slow and without a rest it may hover: if the other end is at rest lower down, it does.
    takeoff = rested or bool(speed[0] < AIRBORNE_SPEED)
    takeoff &= rested or not rests or bool(own[0] < own[-1] + margin)
    landing = rests or bool(speed[-1] < AIRBORNE_SPEED)
    landing &= rests or not rested or bool(own[-1] < own[0] + margin)
    ground = [float(h) for h, seen in ((own[0], takeoff), (own[-1], landing)) if seen]
    glided = np.ptp(own) > GLIDED and np.ptp(own) > SINK * (
        flown.time[last - 1] - flown.time[first]
    )
    if ground and own.max() < max(ground) + max(FLOWN, 2 * margin) and not glided:
        return None
    climb = -flown['w_e'][first:last] if 'w_e' in flown else np.gradient(own)
    begin = _leaves(own, climb, margin) if takeoff else 0
    end = own.size - 1 - _leaves(own[::-1], -climb[::-1], margin) if landing else own.size - 1
    if end <= begin:
        return None
    time = flown.time[first:last]
    return Flight(float(time[begin]), float(time[end]), takeoff, landing)


def _leaves(height: Array, climb: Array, margin: float) -> int:
    """Return the last sample on the ground, of heights that begin there."""
    up = int(np.argmax(height > height[0] + margin))
    level = np.flatnonzero(climb[: up + 1] <= _CLIMB)
    return int(level[-1]) if level.size else 0
