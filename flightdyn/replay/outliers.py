"""Samples that the rest of a log contradicts: positions held, jumps away and back, new starts.

Held positions and lone excursions are found first, from the samples alone, so that they do not
pass for noise; what is left is judged by the motion model, with the noise known. A sample is
judged against its neighbours on both sides: a step after which the log goes on is no outlier but
the beginning of a new segment.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..trajectory import stretches
from .gate import GATE_SIGMAS, SURPRISE_TIME, innovations, left_out
from .noise import MIN_STD, Noise

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

REACQUIRE = 5
"""So many samples in a row that contradict what came before begin a new segment."""

MAX_LONE_SHARE = 0.2
"""If more of the samples lie off the line of their neighbours, none is left out for that [1]."""

MAX_GATE_SHARE = 0.02
"""If the motion model contradicts more of the samples, it is the model that is wrong [1]."""

COARSE_ACCELERATION = 200.0
"""A vehicle leaves the line of its neighbours by less than this makes in a second [m/s^2]."""

GATE_JERK = 100.0
"""Least density of the jerk that the filter is told of: 10 m/s^2 more or less each second."""

_MANY = 20
_COARSE_SCATTERS = 10.0  # of the log's own departures from the line: not yet knowing its noise
_CATCH_UP = 0.4  # of the usual speed: below this a vehicle at one place has slowed down
_ONWARD = 0.5  # of the way: less is going to and fro
_COARSEST_DIGIT = 1.0  # m, unless the digits are known to be coarser
_HELD_STEPS = 8.0  # of the digits: a jump shorter than this may be one digit's change
_BEFORE = ((-2, -1), (-3, -1), (-3, -2))
_AFTER = ((1, 2), (1, 3), (2, 3))
_LONGER = 4  # times as far to look
_SHORTEST_REACH = 16
_NEIGHBOURS = ((-2, -1), (1, 2), (-1, 1), (-2, 2), (-3, 3), (2, 3), (-3, -2))

HELD = 'held position'
POSITION = 'position outlier'
ALTITUDE = 'altitude outlier'
VELOCITY = 'velocity outlier'

NOTABLE_SHARE = 0.05
"""A share of samples left out that a warning remarks on [1]."""

_SENTENCES = {
    HELD: '{} positions repeat one that the vehicle had left and were not used',
    POSITION: '{} positions contradict the motion and were left out',
    ALTITUDE: '{} altitudes contradict the motion and were not used',
    VELOCITY: '{} velocities contradict the motion and were not used',
}


@dataclass
class Rejected:
    """What was not used of the samples, and why.

    Parameters
    ----------
    counts : dict of reason to number
        Of `ALTITUDE` and `VELOCITY` the rest of the sample is used.
    samples : int
        How many are left out altogether.
    new_segments : int
        Segments that begin where the positions jump for good.
    refused : dict of reason to share
        What would have been rejected of so many samples that it was not.
    worst : dict of reason to (distance [m], time [s])
    """

    counts: dict[str, int] = field(default_factory=dict)
    samples: int = 0
    new_segments: int = 0
    refused: dict[str, float] = field(default_factory=dict)
    worst: dict[str, tuple[float, float]] = field(default_factory=dict)

    def add(self, reason: str, bad: Mask, time: Array, off: Array | None = None) -> None:
        """Count samples, and keep the time of the worst."""
        if not bad.any():
            return
        self.counts[reason] = self.counts.get(reason, 0) + int(bad.sum())
        if off is None:
            return
        k = int(np.argmax(np.where(bad, off, -1.0)))
        if off[k] > self.worst.get(reason, (0.0, 0.0))[0]:
            self.worst[reason] = (float(off[k]), float(time[k]))

    def warnings(self, of: int) -> list[str]:
        """Return what a user should know, for a log of so many samples."""
        found = [_SENTENCES[reason].format(n) for reason, n in self.counts.items()]
        for i, reason in enumerate(self.counts):
            if reason in self.worst:
                off, at = self.worst[reason]
                found[i] += f', the worst by {off:.4g} m at {at:.6g} s'
            share = self.counts[reason] / of
            if share > NOTABLE_SHARE:
                found[i] += f': {share:.1%} of all, the log is not to be trusted much'
        if self.new_segments:
            found.append(
                f'the positions jump {self.new_segments} times to stay: each begins a new segment'
            )
        found += [
            f'{share:.1%} of all samples would be rejected as {reason}: no more are'
            for reason, share in self.refused.items()
        ]
        return found


@dataclass
class Verdict:
    """Which samples are bad (n,), and where new segments begin (n,).

    `off` and `off_altitude` are by how much a position or an altitude is out of line [m].
    """

    position: Mask
    altitude: Mask
    velocity: Mask
    begins: Mask
    off: Array
    off_altitude: Array

    @classmethod
    def clean(cls, size: int) -> 'Verdict':
        """Return one that finds nothing."""
        return cls(
            position=np.zeros(size, bool),
            altitude=np.zeros(size, bool),
            velocity=np.zeros(size, bool),
            begins=np.zeros(size, bool),
            off=np.zeros(size),
            off_altitude=np.zeros(size),
        )

    def limit(self, most: float, known: Rejected) -> None:
        """Take back what is said of a kind of measurement if it is said of too many.

        What was rejected before counts; what was once refused stays so.
        """
        for reason, mask in self._masks().items():
            if not mask.any() or not self.is_too_much(reason, known, most):
                continue
            share = self._number(reason, known) / (mask.size + known.samples)
            mask[:] = False
            if reason == POSITION:
                self.begins[:] = False
            known.refused.setdefault(reason, share)

    def is_too_much(self, reason: str, known: Rejected, most: float = MAX_GATE_SHARE) -> bool:
        """Return whether `limit` would take back what is said of a kind of measurement."""
        if reason in known.refused:
            return True
        size = self.position.size
        number = self._number(reason, known)
        # Where there is enough else to go by, one or two are an exception at any length.
        few = number <= 2 and size >= _MANY
        return number > most * (size + known.samples) and not few

    def _masks(self) -> dict[str, Mask]:
        return {POSITION: self.position, ALTITUDE: self.altitude, VELOCITY: self.velocity}

    def _number(self, reason: str, known: Rejected) -> int:
        return int(np.count_nonzero(self._masks()[reason])) + known.counts.get(reason, 0)

    def __bool__(self) -> bool:
        found = (self.position, self.altitude, self.velocity, self.begins)
        return any(bool(mask.any()) for mask in found)


def held(time: Array, place: Array, segment: NDArray[np.int64], step: float) -> Mask:
    """Return which samples repeat a place that the vehicle had left.

    Parameters
    ----------
    time : array (n,)
        [s], not decreasing within a segment.
    place : array (n, k)
        [m]
    segment : int array (n,)
    step : float
        What the last digit of the places is worth [m].

    Notes
    -----
    A parked vehicle repeats its place too. Of a moving one whose place was held, the jump that
    follows makes up for the time of the hold: from the first to the last it has moved about as
    fast as before and after.
    """
    repeats = np.zeros(time.size, bool)
    change = np.abs(np.diff(place, axis=0))
    repeats[1:] = (change == 0).all(axis=1) & (np.diff(segment) == 0)
    found = np.zeros(time.size, bool)
    if not repeats.any() or not change.any():
        return found
    apart = [np.diff(np.unique(column)) for column in place.T]
    # Of who moves all the time no two places are a digit apart: then it cannot be seen.
    digits = [float(a[a > MIN_STD].min(initial=_COARSEST_DIGIT)) for a in apart]
    shortest = _HELD_STEPS * max(step, *digits)
    for piece in stretches(segment):
        first = np.flatnonzero(~repeats[piece]) + piece.start
        if first.size < 3 or first.size == piece.stop - piece.start:
            continue
        moved = np.linalg.norm(np.diff(place[first], axis=0), axis=1)
        speed = moved / np.maximum(np.diff(time[first]), 1e-9)
        usual = _median_around(speed, 1)
        # Three before or three after, whichever is faster: it may start or stop here.
        usual = np.fmax(np.append(usual[:1], usual[:-1]), np.append(usual[1:], usual[-1:]))
        made_up = (speed >= _CATCH_UP * usual) & (moved >= shortest)
        # A receiver at rest jitters to and fro; who moves gets somewhere.
        k = np.arange(moved.size)
        before, after = np.maximum(k - 1, 0), np.minimum(k + 2, moved.size)
        path = np.concatenate(([0.0], np.cumsum(moved)))
        net = np.linalg.norm(place[first[after]] - place[first[before]], axis=1)
        made_up &= net >= _ONWARD * (path[after] - path[before])
        owner = np.searchsorted(first, np.arange(piece.start, piece.stop), side='right') - 1
        # What comes after the last change cannot be told: the vehicle may have stopped.
        found[piece] = repeats[piece] & np.append(made_up, False)[owner]
    return found


def lone(time: Array, place: Array, segment: NDArray[np.int64], step: float) -> tuple[Mask, Array]:
    """Return which samples lie off every line through their neighbours, and how far [m].

    Parameters
    ----------
    place : array (n, k)
        [m]
    step : float
        What the last digit is worth [m].

    Notes
    -----
    Seven pairs of the three samples before and after each give a line; the nearest counts. One
    bad neighbour spoils three of them at most, and a step for good none on either side of it.
    """
    off, gap, number = _off_lines(time, place, segment, _NEIGHBOURS)
    known = number >= 2
    off = np.where(known, off, 0.0)
    return known & (off > _coarse_limit(off[known], gap, step)), off


def breaks(time: Array, place: Array, segment: NDArray[np.int64], step: float) -> Mask:
    """Return before which samples the places jump: off the lines of both sides.

    Parameters
    ----------
    time, place, segment, step
        As for `lone`, without what that finds.
    """
    ahead, gap, number = _off_lines(time, place, segment, _BEFORE)
    back, _, number_back = _off_lines(time, place, segment, _AFTER)
    both = np.zeros(time.size)
    known = (number[1:] > 0) & (number_back[:-1] > 0) & (segment[1:] == segment[:-1])
    both[1:][known] = np.minimum(ahead[1:], back[:-1])[known]
    return np.asarray(both > _coarse_limit(both[1:][known], gap, step))


def _off_lines(
    time: Array,
    place: Array,
    segment: NDArray[np.int64],
    pairs: tuple[tuple[int, int], ...],
) -> tuple[Array, Array, NDArray[np.int64]]:
    """Return the distance from the nearest line, the time to the nearest sample, and how many."""
    n = time.size
    off, gap = np.full(n, np.inf), np.full(n, np.inf)
    number = np.zeros(n, np.int64)
    index = np.arange(n)
    for a, b in pairs:
        i, j = index + a, index + b
        inside = (i >= 0) & (j < n)
        i, j = np.where(inside, i, 0), np.where(inside, j, 0)
        inside &= (segment[i] == segment) & (segment[j] == segment) & (time[j] > time[i])
        share = (time - time[i]) / np.where(inside, time[j] - time[i], 1.0)
        line = place[i] + share[:, None] * (place[j] - place[i])
        off = np.where(inside, np.fmin(off, np.linalg.norm(place - line, axis=1)), off)
        nearest = np.minimum(np.abs(time - time[i]), np.abs(time - time[j]))
        gap = np.where(inside, np.fmin(gap, nearest), gap)
        number += inside
    return off, gap, number


def _coarse_limit(off: Array, gap: Array, step: float) -> Array:
    """Return the distance from a line [m] that no motion explains, gap [s] after a sample."""
    scatter = 1.4826 * float(np.median(off)) if off.size else 0.0
    lasting = np.minimum(gap, SURPRISE_TIME)
    with np.errstate(invalid='ignore'):
        swerve = COARSE_ACCELERATION * lasting * (2 * gap - lasting)
    return np.asarray(_COARSE_SCATTERS * max(scatter, step) + swerve)


def judge(
    time: Array,
    position: Array,
    velocity: Array | None,
    segment: NDArray[np.int64],
    *,
    position_std: Array,
    velocity_std: Array,
    noise: Noise,
    known: Rejected,
) -> Verdict:
    """Return which samples the motion model contradicts.

    Parameters
    ----------
    time : array (n,)
        [s], not decreasing within a segment.
    position, velocity : array (n, 3)
        [m], [m/s]; NaN where there is none.
    position_std, velocity_std : array (n, 3)
        1-sigma of the white noise.
    known : Rejected
        What was rejected before; is told what was refused.

    Notes
    -----
    The filter runs forward, rejects what is more than `GATE_SIGMAS` off what it expects, and
    expects less the longer it rejects. After `REACQUIRE` rejections of the position in a row it
    begins anew with the first of them.
    """
    verdict = Verdict.clean(time.size)
    for piece in stretches(segment):
        _judge_stretch(
            time, position, velocity, position_std, velocity_std, noise, piece, verdict, known
        )
    verdict.limit(MAX_GATE_SHARE, known)
    return verdict


def _judge_stretch(
    time: Array,
    position: Array,
    velocity: Array | None,
    position_std: Array,
    velocity_std: Array,
    noise: Noise,
    piece: slice,
    verdict: Verdict,
    known: Rejected,
) -> None:
    start = piece.start
    usual = float(np.median(np.diff(time[piece]))) if piece.stop - start > 1 else 0.0
    jerk_density = np.maximum(noise.jerk_density, _least_jerk(usual))
    reach = piece.stop - start
    while start < piece.stop:
        part = slice(start, min(start + reach, piece.stop))
        found = innovations(
            time[part],
            position[part],
            position_std[part],
            None if velocity is None else velocity[part],
            velocity_std[part],
            jerk_density,
        )
        bad = found.ratio > GATE_SIGMAS**2
        measured = np.isfinite(position[part])
        # Of what will be refused, being too many, no beginning is looked for.
        jump = step = None
        if not verdict.is_too_much(POSITION, known):
            jump = _first_run(bad[:, 0], measured[:, 0])
        # Altitudes that step to another level do not break the flight: they are taken as they are.
        if not verdict.is_too_much(ALTITUDE, known):
            step = _first_run(bad[:, 1], measured[:, 2])
        if jump is None and step is None and part.stop < piece.stop:
            reach *= _LONGER
            continue
        size = min(x for x in (jump, step, part.stop - start) if x is not None)
        # Where one beginning follows upon another, to look at all that is left after each would
        # take the square of the samples: look a few times as far as the last one was.
        reach = max(_LONGER * size, _SHORTEST_REACH)
        if jump is not None and size == jump and size < REACQUIRE:
            # Too few before it to be believed: it may be the first that was off.
            verdict.position[start] = True
            verdict.off[start] = found.off[size, 0]
            start += 1
            continue
        taken = slice(start, start + size)
        verdict.position[taken] = bad[:size, 0]
        verdict.altitude[taken] = bad[:size, 1]
        verdict.velocity[taken] = bad[:size, 2:].any(axis=1)
        verdict.off[taken] = found.off[:size, 0]
        verdict.off_altitude[taken] = found.off[:size, 1]
        start += size
        if jump is not None and size == jump:
            verdict.begins[start] = True


def _least_jerk(interval: float) -> float:
    """Return the jerk density [m^2/s^5] to expect, however smooth most of the log is.

    A filter that learnt from hours of cruise lags behind the turn at their end, and would blame
    the samples. From one sample to the next this adds half a metre at most.
    """
    return GATE_JERK * min(1.0, (0.5 / max(interval, 1e-9)) ** 5)


def _first_run(bad: Mask, measured: Mask) -> int | None:
    """Return where the first of `REACQUIRE` measured in a row that are bad begins."""
    if np.count_nonzero(bad) < REACQUIRE:
        return None
    where = np.flatnonzero(measured)
    runs = np.lib.stride_tricks.sliding_window_view(bad[where], REACQUIRE).all(axis=1)
    return int(where[np.argmax(runs)]) if runs.any() else None


def judge_smoothed(
    time: Array,
    position: Array,
    smoothed: Array,
    variance: Array,
    segment: NDArray[np.int64],
    *,
    position_std: Array,
    known: Rejected,
) -> Verdict:
    """Return which positions all the others contradict, those after them too.

    Parameters
    ----------
    position, smoothed : array (n, 3)
        [m]
    variance : array (n, 3)
        Of the smoothed position [m^2].
    known : Rejected
        As for `judge`.

    Notes
    -----
    Of neighbours that fail only the worst does: it has drawn the others off.
    """
    verdict = Verdict.clean(time.size)
    ratio, off = left_out(time, position, smoothed, variance, segment, position_std)
    for column, mask in ((0, verdict.position), (1, verdict.altitude)):
        values, distances = ratio[:, column], off[:, column]
        worst = values >= _maximum_around(values, REACQUIRE)
        # If all around are off, it is the smoothed motion that is.
        alone = _median_around(distances, REACQUIRE) < 0.5 * distances
        mask[:] = (values > GATE_SIGMAS**2) & worst & alone
    verdict.limit(MAX_GATE_SHARE, known)
    verdict.off[:], verdict.off_altitude[:] = off[:, 0], off[:, 1]
    return verdict


def _median_around(values: Array, reach: int) -> Array:
    padded = np.pad(values, reach, mode='reflect' if values.size > reach else 'edge')
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1)
    return np.asarray(np.median(windows, axis=1))


def _maximum_around(values: Array, reach: int) -> Array:
    padded = np.pad(values, reach, constant_values=-np.inf)
    return np.asarray(np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1).max(axis=1))
