"""Order in time of what a log holds: which clock, what came late or twice, where it breaks off.

References
----------
.. [1] IS-GPS-200N, 2022, section 20.3.3.3.1.1, transmission week number.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Times = NDArray[np.int64]

FIRST_LOGS = 946_684_800 * 10**9
"""2000-01-01 in Unix time [ns]: a stamp before that counts from somewhere else."""

WEEK_S = 604_800
GPS_ERA_S = 1024 * WEEK_S
"""The week number of GPS has ten bits: receivers take the wrong one of 19.6 years [1]."""

LEAP_SECONDS = (
    (1_483_228_800, 18),
    (1_435_708_800, 17),
    (1_341_100_800, 16),
    (1_230_768_000, 15),
    (1_136_073_600, 14),
    (915_148_800, 13),
)
"""GPS time less UTC [s] from Unix times on, latest first: IERS Bulletin C 52 and before."""

DAY_S = 86_400
ROLLOVER_SLACK_S = 60.0
"""A step back is that of a day or a week if the recorder agrees to so much [s]."""

LEAP_SLACK_S = 0.3
"""Stamps ahead of the recorder by the leap seconds, to within this, are GPS time [s]."""

MIN_GAP_S = 10.0
GAP_IN_MEDIANS = 10.0
"""A pause longer than both begins a new segment; nothing is drawn or smoothed across it."""

_LEAST_DELAY = 0.02  # quantile of the delays of arrival


@dataclass
class Rows:
    """Which messages are used and why the others are not.

    Parameters
    ----------
    reason : uint8 array (n,)
        0 where a message is used, else an index into `names`.
    """

    reason: NDArray[np.uint8]
    names: list[str] = field(default_factory=lambda: [''])

    def drop(self, bad: NDArray[np.bool_], why: str) -> None:
        """Drop messages that are not dropped already."""
        bad = bad & (self.reason == 0)
        if bad.any():
            if why not in self.names:
                self.names.append(why)
            self.reason[bad] = self.names.index(why)

    @property
    def used(self) -> NDArray[np.intp]:
        """Indices of the messages that are used."""
        return np.flatnonzero(self.reason == 0)

    def counts(self, among: NDArray[np.bool_]) -> dict[str, int]:
        """Return how many messages were dropped, by reason."""
        numbers = np.bincount(self.reason[among], minlength=len(self.names))
        return {
            name: int(number)
            for name, number in zip(self.names[1:], numbers[1:], strict=False)
            if number
        }


def choose_clock(stamp: Times, log_time: Times, rows: Rows, warnings: list[str]) -> Times:
    """Return the time of each message: its header's stamp where drivers fill it, else log time.

    Stamps that are wrong in a way that can be told are put right, see `_put_right`.

    Parameters
    ----------
    stamp, log_time : int array (n,)
        Nanoseconds; a stamp that makes no sense is below zero.
    rows : Rows
        Messages without a stamp are dropped if most others have one.
    warnings : list of str
        Gets a sentence if the stamps are not used, or not as they are.

    Returns
    -------
    int array (n,)
        `log_time` itself if the stamps are not used.
    """
    used = rows.used
    if used.size == 0:
        return log_time
    unset = (stamp < 0) | ((stamp == 0) & (log_time != 0))
    if unset[used].mean() > 0.5:
        warnings.append('header stamps are not set: times are those of the recorder')
        return log_time
    frozen = used.size > 1 and np.ptp(stamp[used]) == 0
    if frozen and np.ptp(log_time[used]) > 0:
        warnings.append('header stamps never change: times are those of the recorder')
        return log_time
    rows.drop(unset, 'no time stamp')
    return _put_right(stamp, log_time, rows.used, warnings)


def _put_right(
    stamp: Times, log_time: Times, used: NDArray[np.intp], warnings: list[str]
) -> Times:
    """Return stamps whose date, week, day or leap seconds are wrong, corrected.

    The recorder's clock says when it was; the stamps say better how far apart. So the one is used
    for whole eras, weeks, days and leap seconds only, or for the date of stamps that count from
    the vehicle's start.
    """
    if used.size < 2 or np.median(log_time[used]) < FIRST_LOGS:
        return stamp
    time = stamp.copy()
    time[used] = _unrolled(stamp[used], log_time[used], warnings)
    behind = int(np.median(log_time[used] - time[used]))
    if np.median(time[used]) < FIRST_LOGS and behind > GPS_ERA_S * 10**9 // 2:
        eras = round(behind / (GPS_ERA_S * 1e9))
        if abs(behind - eras * GPS_ERA_S * 10**9) > DAY_S * 10**9:
            warnings.append(
                "header stamps count from the vehicle's start: the date is the recorder's"
            )
            time[used] = steady_time(time[used], log_time[used])
            return time
    eras = round(behind / (GPS_ERA_S * 1e9))
    if eras and abs(behind - eras * GPS_ERA_S * 10**9) < DAY_S * 10**9:
        warnings.append(
            f'header stamps are {1024 * eras} weeks behind the recorder: taken as a rollover of '
            'the GPS week, and put right'
        )
        time[used] += eras * GPS_ERA_S * 10**9
    return _without_leap_seconds(time, log_time, used, warnings)


def _unrolled(stamp: Times, log_time: Times, warnings: list[str]) -> Times:
    """Return stamps without steps back by a day or a week in which the recorder saw none."""
    step, meanwhile = np.diff(stamp), np.diff(log_time)
    time = stamp.copy()
    for period, what in ((WEEK_S, 'a week'), (DAY_S, 'a day')):
        missing = step - meanwhile + period * 10**9
        rolled = (step < 0) & (np.abs(missing) < ROLLOVER_SLACK_S * 10**9)
        if rolled.any():
            warnings.append(f'header stamps jump back by {what} where no time passed: put right')
            time[1:] += np.cumsum(rolled) * period * 10**9
    return time


def _without_leap_seconds(
    time: Times, log_time: Times, used: NDArray[np.intp], warnings: list[str]
) -> Times:
    ahead = (time[used] - log_time[used]) * 1e-9
    low, middle, high = np.percentile(ahead, (10, 50, 90))
    at = float(np.median(log_time[used])) * 1e-9
    leap = next((seconds for since, seconds in LEAP_SECONDS if at >= since), 0)
    # A recorder's clock that is off by just that much, steadily, would be a coincidence.
    if leap == 0 or abs(middle - leap) > LEAP_SLACK_S or high - low > LEAP_SLACK_S:
        return time
    warnings.append(
        f'header stamps are {leap} s ahead of the recorder: taken as GPS time without leap '
        'seconds, and put right'
    )
    time = time.copy()
    time[used] -= leap * 10**9
    return time


def arrange(
    time: Times, rows: Rows, warnings: list[str]
) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
    """Return the used messages in order of time and the segment of each.

    Messages stay in the order of the file, which is the true one when a clock steps back; only
    neighbours that changed places on the way are put right. Repeated times are dropped.

    Returns
    -------
    index : int array (m,)
        Into `time`.
    segment : int array (m,)
    """
    index = rows.used
    index = _swap_late(time, index, warnings)
    repeated = np.zeros(time.size, bool)
    repeated[index[1:][time[index[1:]] == time[index[:-1]]]] = True
    rows.drop(repeated, 'repeated time')
    index = index[~repeated[index]]
    step = np.diff(time[index])
    limit = gap_limit(step * 1e-9) * 1e9
    backwards = step < 0
    if backwards.any():
        at = int(np.argmax(backwards))
        warnings.append(
            f'time steps back {int(backwards.sum())} times, first by {-step[at] * 1e-9:g} s '
            f'after message {index[at]}: each begins a new segment'
        )
    segment = np.concatenate(([0], np.cumsum(backwards | (step > limit)))).astype(np.int64)
    return index, segment[: index.size]


def gap_limit(steps: NDArray[np.float64]) -> float:
    """Return the pause that begins a new segment, for the steps of a log's time [s]."""
    forward = steps[steps > 0]
    usual = float(np.median(forward)) if forward.size else 0.0
    return max(MIN_GAP_S, GAP_IN_MEDIANS * usual)


def _swap_late(time: Times, index: NDArray[np.intp], warnings: list[str]) -> NDArray[np.intp]:
    t = time[index]
    if t.size < 3:
        return index
    late = np.zeros(t.size, bool)  # sample i belongs between i - 2 and i - 1
    late[2:-1] = (t[2:-1] < t[1:-2]) & (t[2:-1] > t[:-3]) & (t[3:] > t[1:-2])
    where = np.flatnonzero(late)
    if where.size == 0:
        return index
    warnings.append(f'{where.size} messages came one late and were put in order')
    index = index.copy()
    index[where], index[where - 1] = index[where - 1], index[where].copy()
    return index


def steady_time(count: Times, arrival: Times) -> Times:
    """Return Unix times [ns] by a clock that counts evenly from some start.

    Parameters
    ----------
    count : int array (n,)
        The sender's clock [ns]; a step back by more than a second is a restart.
    arrival : int array (n,)
        When each sample arrived [ns, Unix]: too late by an unsteady delay, never too early.
        The least delay counts as none; the very least may be a clock that was set.
    """
    restarts = np.cumsum(np.diff(count, prepend=count[:1]) < -(10**9))
    offset = arrival - count
    time = arrival.copy()
    for session in np.unique(restarts):
        these = restarts == session
        apart = offset[these]
        time[these] = count[these] + apart[0] + int(np.quantile(apart - apart[0], _LEAST_DELAY))
    return time
