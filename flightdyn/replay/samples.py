"""A track's samples on the way to being smoothed: one per time, the unusable ones taken out."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..logs.nearby import interpolated
from ..logs.timeline import gap_limit
from ..logs.track import Track
from . import outliers
from .outliers import Rejected, Verdict

Array = NDArray[np.float64]

_BREAKING = 4  # looks for jumps: each shows what a shorter stretch between two hid

EARTH_RADIUS = 6_371_009.0  # m, mean radius (2 a + b) / 3 of WGS84; only for distances nearby


@dataclass(frozen=True)
class Samples:
    """A track's columns with one sample per time.

    Parameters
    ----------
    time : array (n,)
        Seconds since `start_ns`.
    geodetic : lat, lon [deg], altitude [m], each (n,), or None
    position, velocity : array (n, 3) or None
        North, east, down [m], [m/s].
    attitude : array (n, 4) or None
    airspeed : array (n,) or None
        [m/s], NaN where there is none.
    usable : bool array (n, 3)
        Whether there is a position along each axis; where not, its value is only filled in.
    """

    time: Array
    start_ns: int
    segment: NDArray[np.int64]
    geodetic: tuple[Array, Array, Array] | None
    position: Array | None
    velocity: Array | None
    attitude: Array | None
    position_std: Array | None
    velocity_std: Array | None
    usable: NDArray[np.bool_]
    airspeed: Array | None = None


def merge_repeats(track: Track) -> Samples:
    """Return the samples of a track, those of one segment and time averaged into one."""
    ns = track.time_ns
    first = np.flatnonzero(np.diff(ns, prepend=ns[0] - 1) | np.diff(track.segment, prepend=-1))
    count = np.diff(first, append=ns.size)

    def merged(values: Array | None) -> Array | None:
        if values is None:
            return None
        if first.size == ns.size:
            return np.asarray(values, dtype=float)
        known = np.isfinite(values)
        total = np.add.reduceat(np.where(known, values, 0.0), first, axis=0)
        number = np.add.reduceat(known.astype(float), first, axis=0)
        return np.asarray(np.where(number > 0, total / np.maximum(number, 1), np.nan))

    geodetic = None
    usable = np.ones((first.size, 3), bool)
    if track.lat is not None and track.lon is not None:
        height = np.full(ns.size, np.nan) if track.altitude is None else track.altitude
        # Unwrapped, longitudes can be averaged and interpolated across the date line.
        lon = merged(np.unwrap(track.lon, period=360.0))
        assert lon is not None
        lon = np.where(np.abs(lon) > 180, (lon + 180) % 360 - 180, lon)
        altitude = merged(height)
        assert altitude is not None
        if np.isfinite(altitude).any():
            usable[:, 2] = np.isfinite(altitude)
        geodetic = (_filled(merged(track.lat)), lon, _filled(altitude))
    attitude = track.attitude
    if attitude is not None:
        attitude = attitude[first + count - 1]
        attitude = _whole_attitude(ns[first], known_attitude(attitude))
    return Samples(
        time=(ns[first] - ns[0]) / 1e9,
        start_ns=int(ns[0]),
        segment=track.segment[first],
        geodetic=geodetic,
        position=merged(track.position_ned),
        velocity=merged(track.velocity_ned),
        attitude=attitude,
        position_std=merged(track.position_std),
        velocity_std=merged(track.velocity_std),
        usable=usable,
        airspeed=merged(track.airspeed),
    )


LEAST_ATTITUDE = 0.5
"""If fewer of the samples have an attitude, it is not used at all."""


def known_attitude(attitude: Array) -> Array:
    """Return unit quaternions (n, 4), NaN where there is no attitude."""
    norm = np.linalg.norm(attitude, axis=1, keepdims=True)
    with np.errstate(invalid='ignore'):
        return np.where(norm > 0, attitude / np.where(norm > 0, norm, 1.0), np.nan)


def _whole_attitude(ns: NDArray[np.int64], attitude: Array) -> Array | None:
    """Return an attitude for every sample, the blanks filled from near by; None if most are."""
    known = np.isfinite(attitude).all(axis=1)
    if known.all():
        return attitude
    if known.mean() < LEAST_ATTITUDE:
        return None
    filled = interpolated(ns, attitude, ns, turning=True)
    filled[known] = attitude[known]
    # Where none is near the last one holds, or the first.
    there = np.flatnonzero(np.isfinite(filled).all(axis=1))
    last = np.searchsorted(there, np.arange(ns.size), side='right') - 1
    return np.asarray(filled[there[np.maximum(last, 0)]])


def _filled(values: Array | None) -> Array:
    """Return values with blanks interpolated over the sample number; all blank is 0."""
    assert values is not None
    known = np.isfinite(values)
    if known.all():
        return values
    if not known.any():
        return np.zeros_like(values)
    index = np.arange(values.size)
    return np.interp(index, index[known], values[known])


def without_obvious(samples: Samples, steps: Array, rejected: Rejected) -> Samples:
    """Return samples without what needs no knowledge of the noise to be told as wrong.

    Parameters
    ----------
    steps : array (3,)
        What the last digits of the positions are worth, north, east, down [m].
    rejected : Rejected
        Is told what was taken out.
    """
    # Altitudes first: they may be good, or wrong, where the place is held.
    samples = _without_lone(samples, slice(2, 3), float(steps[2]), rejected)
    time, segment = samples.time, samples.segment
    step = float(np.hypot(steps[0], steps[1]))
    position = _nearby(samples)
    repeated = outliers.held(time, position[:, :2], segment, step)
    rejected.add(outliers.HELD, repeated, time)
    usable = samples.usable.copy()
    usable[repeated, :2] = False
    # A sample that says nothing but the place where the vehicle was before says nothing.
    same_height = np.append(False, np.diff(position[:, 2]) == 0)
    gone = repeated & ~_has_fresh_velocity(samples) & (same_height | ~usable[:, 2])
    samples = _kept(replace(samples, usable=usable), ~gone, rejected)
    samples = _without_lone(samples, slice(0, 2), step, rejected)
    samples = _broken(samples, step, rejected)
    return _without_lone(samples, slice(2, 3), float(steps[2]), rejected)


def _without_lone(samples: Samples, axes: slice, step: float, rejected: Rejected) -> Samples:
    told = np.flatnonzero(samples.usable[:, axes].all(axis=1))
    place = _nearby(samples)[told, axes]
    bad, off = outliers.lone(samples.time[told], place, samples.segment[told], step)
    verdict = Verdict.clean(samples.time.size)
    mask, distance = (
        (verdict.position, verdict.off)
        if axes.start == 0
        else (verdict.altitude, verdict.off_altitude)
    )
    mask[told], distance[told] = bad, off
    verdict.limit(outliers.MAX_LONE_SHARE, rejected)
    return without(samples, verdict, rejected)


def _broken(samples: Samples, step: float, rejected: Rejected) -> Samples:
    """Return samples split where their places jump for good, without what is between two jumps."""
    for _ in range(_BREAKING):
        told = np.flatnonzero(samples.usable[:, :2].all(axis=1))
        place = _nearby(samples)[told, :2]
        verdict = Verdict.clean(samples.time.size)
        jumps = outliers.breaks(samples.time[told], place, samples.segment[told], step)
        verdict.begins[told] = jumps
        if not verdict:
            break
        piece = np.cumsum(np.diff(samples.segment[told], prepend=-1).astype(bool) | jumps) - 1
        size = np.bincount(piece)
        starts = np.flatnonzero(np.diff(piece, prepend=-1))
        after_jump = jumps[starts]
        between = after_jump | np.append(after_jump[1:], False)
        short = between & (size < outliers.REACQUIRE)
        if not short.any():
            return without(samples, verdict, rejected)
        # What they jump back from is no place to begin: look again without it.
        verdict.begins[:] = False
        verdict.position[told] = short[piece]
        nearest = np.linalg.norm(np.diff(place, axis=0, prepend=place[:1]), axis=1)
        verdict.off[told] = np.maximum(nearest, np.append(nearest[1:], 0.0))
        verdict.limit(outliers.MAX_LONE_SHARE, rejected)
        if not verdict:
            break
        samples = without(samples, verdict, rejected)
    return samples


def without(samples: Samples, verdict: Verdict, rejected: Rejected) -> Samples:
    """Return samples without those of a verdict, split where it begins new segments."""
    time = samples.time
    altitude = verdict.altitude & samples.usable[:, 2] & ~verdict.position
    rejected.add(outliers.POSITION, verdict.position, time, verdict.off)
    rejected.add(outliers.ALTITUDE, altitude, time, verdict.off_altitude)
    rejected.add(outliers.VELOCITY, verdict.velocity & ~verdict.position, time)
    velocity = samples.velocity
    if velocity is not None:
        velocity = np.where(verdict.velocity[:, None], np.nan, velocity)
    rejected.new_segments += int(verdict.begins.sum())
    segment = samples.segment
    split = np.diff(segment, prepend=segment[:1]).astype(bool) | verdict.begins
    samples = replace(samples, velocity=velocity, segment=np.cumsum(split))
    return _kept(_without_altitudes(samples, altitude), ~verdict.position, rejected)


def _without_altitudes(samples: Samples, bad: NDArray[np.bool_]) -> Samples:
    if not bad.any():
        return samples
    usable = samples.usable.copy()
    usable[bad, 2] = False
    if samples.geodetic is None:
        return replace(samples, usable=usable)
    lat, lon, altitude = samples.geodetic
    good = usable[:, 2]
    if good.any():
        # Though it is not smoothed, a wild altitude would tilt the others in the tangent plane.
        filled = np.interp(samples.time, samples.time[good], altitude[good])
        altitude = np.where(good, altitude, filled)
    return replace(samples, usable=usable, geodetic=(lat, lon, altitude))


def _kept(samples: Samples, keep: NDArray[np.bool_], rejected: Rejected) -> Samples:
    if keep.all():
        return samples
    rejected.samples += int((~keep).sum())
    index = np.flatnonzero(keep)
    time = samples.time[index]
    segment = samples.segment[index]
    step = np.diff(time)
    bridged = (np.diff(index) > 1) & (step > gap_limit(step))
    split = np.append(False, (np.diff(segment) != 0) | bridged)

    def picked(values: Array | None) -> Array | None:
        return None if values is None else values[index]

    return Samples(
        time=time,
        start_ns=samples.start_ns,
        segment=np.cumsum(split).astype(np.int64),
        geodetic=None
        if samples.geodetic is None
        else tuple(column[index] for column in samples.geodetic),  # type: ignore[arg-type]
        position=picked(samples.position),
        velocity=picked(samples.velocity),
        attitude=picked(samples.attitude),
        position_std=picked(samples.position_std),
        velocity_std=picked(samples.velocity_std),
        usable=samples.usable[index],
        airspeed=picked(samples.airspeed),
    )


def _has_fresh_velocity(samples: Samples) -> NDArray[np.bool_]:
    velocity = samples.velocity
    if velocity is None:
        return np.zeros(samples.time.size, bool)
    changed = np.append(True, (np.diff(velocity, axis=0) != 0).any(axis=1))
    return changed & np.isfinite(velocity).all(axis=1)


def _nearby(samples: Samples) -> Array:
    """Return north, east, down (n, 3) [m] whose differences nearby are displacements."""
    if samples.geodetic is None:
        assert samples.position is not None
        return samples.position
    lat, lon, altitude = samples.geodetic
    phi = np.radians(lat)
    north = EARTH_RADIUS * phi
    turned = np.diff(np.unwrap(np.radians(lon)), prepend=np.radians(lon[0]))
    east = np.cumsum(EARTH_RADIUS * np.cos(phi) * turned)
    return np.stack((north, east, -altitude), axis=-1)
