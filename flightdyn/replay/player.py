"""A play clock over the samples of a recording: which are due, and when is the next."""

import time as _time
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError

_ROUNDING = 1e-9
"""Due early by this [s]: whoever slept for `next_due` finds the sample due, whatever rounding."""


class Player:
    """Plays sample indices in order, or backwards, against a monotonic clock.

    It knows nothing of what the samples are: whoever owns it calls `advance`, publishes the
    samples of the range it returns, and sleeps for `next_due`. Commands have the names of
    rosbag2's player.

    Parameters
    ----------
    times : array (n,)
        Seconds of each sample. Never decreasing, but for a clock set back between segments:
        samples are played in their order, and a step back takes no time.
    rate : float
        Play seconds per wall second; below 0 it plays backwards, and starts at the end.
    loop : bool
        Start again after the last sample, one median sample interval later; playing backwards,
        after the first.
    max_gap : float, optional
        Longer pauses between samples are shortened to this [s]. Default: played in full.
    paused : bool
        Start paused.
    growing : bool
        These are the first samples, and `grow` will bring all of them: meanwhile play time
        stands still at the last one known.
    clock : callable
        Returns monotonic seconds.

    Raises
    ------
    InputError
        If there are no samples, a time is not finite, the rate is 0 or the gap not above 0.

    Notes
    -----
    Each pass over a sample plays it once. Where the direction turns, the sample played last is
    not played again.
    """

    def __init__(
        self,
        times: ArrayLike,
        *,
        rate: float = 1.0,
        loop: bool = False,
        max_gap: float | None = None,
        paused: bool = False,
        growing: bool = False,
        clock: Callable[[], float] = _time.monotonic,
    ) -> None:
        if max_gap is not None and not max_gap > 0:
            raise InputError(f'max_gap must be above 0 s, got {max_gap}')
        self._max_gap = max_gap
        self._take(times)
        self._clock = clock
        self._rate = checked_rate(rate)
        self._paused = paused
        self._growing = growing
        self._stopped = False
        self._duration: float | None = None  # of `play`
        self._until: float | None = None  # the play position at which it ends
        self._awaited: float | None = None  # time to seek as soon as it is known
        self.loop = loop
        self.jumps = 0
        """How often play time jumped (`seek`, a loop); whoever filters the samples starts anew."""
        self._at = 0.0  # play position at the wall time `_since`
        self._since = clock()
        self._after, self._before = 0, -1  # what comes next, forwards and backwards
        if self._rate < 0:
            self._to_end()

    def _take(self, times: ArrayLike) -> None:
        self._times: NDArray[np.float64] = np.array(times, dtype=float)
        if self._times.ndim != 1 or self._times.size == 0:
            raise InputError('nothing to play: no samples')
        if not np.isfinite(self._times).all():
            raise InputError('a sample time to play is not finite')
        steps = np.maximum(np.diff(self._times), 0.0)
        if self._max_gap is not None:
            steps = np.minimum(steps, self._max_gap)
        self._play = np.concatenate(([0.0], np.cumsum(steps)))
        positive = steps[steps > 0]
        self._between_loops = float(np.median(positive)) if positive.size else 1.0

    def __len__(self) -> int:
        return int(self._times.size)

    @property
    def time(self) -> float:
        """Current play time, in the samples' seconds; between first and last sample."""
        position = self._position(self._clock())
        after = int(np.searchsorted(self._play, position, side='right'))
        if after >= len(self):
            return float(self._times[-1])
        # A shortened gap is entered at the recording's pace and its end is jumped over.
        last = max(after - 1, 0)
        elapsed = position - self._play[last]
        return float(self._times[last] + max(elapsed, 0.0))

    @property
    def is_finished(self) -> bool:
        """Whether nothing more will come: stopped, or at the end without a loop."""
        more = self.loop or (self._growing and self._rate > 0)
        return self._stopped or (self._at_end and self._awaited is None and not more)

    @property
    def is_waiting(self) -> bool:
        """Whether play time stands still because the samples there are not known yet."""
        more = self._at_end and (self.loop or self._rate > 0)
        return self._growing and (self._awaited is not None or more)

    @property
    def _at_end(self) -> bool:
        return self._before < 0 if self._rate < 0 else self._after >= len(self)

    def is_paused(self) -> bool:
        return self._paused

    def pause(self) -> None:
        """Hold play time; samples due before but not fetched yet stay due."""
        if not self._paused:
            self._rebase()
            self._paused = True

    def resume(self) -> None:
        """Go on from where play time was held."""
        if self._paused:
            self._since = self._clock()
            self._paused = False

    def toggle(self) -> bool:
        """Pause or resume; return whether it is now paused."""
        if self._paused:
            self.resume()
        else:
            self.pause()
        return self._paused

    def get_rate(self) -> float:
        return self._rate

    def set_rate(self, rate: float) -> None:
        """Play at another rate from now on; below 0 backwards.

        Raises
        ------
        InputError
            If the rate is 0 or not finite.
        """
        checked = checked_rate(rate)
        self._rebase()
        if checked * self._rate < 0:
            self._duration = self._until = None  # where to end lies behind now
            # Time may have passed samples that nobody fetched: they are still ahead.
            fetched = self._play[[max(self._before, 0), min(self._after, len(self) - 1)]]
            self._at = float(np.clip(self._at, *fetched))
        self._rate = checked

    def seek(self, time: float) -> None:
        """Go to a time of the samples [s]: the next sample is the first at or after it.

        Backwards it is the last at or before it. Times before the first and after the last sample
        mean those. Seeking neither pauses nor resumes, but it undoes `stop`, and what `play` was
        told of an end. A time after the samples known so far is gone to when it is known.

        Raises
        ------
        InputError
            If the time is not finite.
        """
        if not np.isfinite(time):
            raise InputError(f'cannot seek {time}')
        self.jumps += 1
        self._stopped = False
        self._duration = self._until = None
        self._since = self._clock()
        self._awaited = None
        if self._growing and time > self._times.max():
            self._awaited = time
            self._at = float(self._play[-1])
            return
        time = float(np.clip(time, self._times[0], self._times.max()))
        index = int(np.argmax(self._times >= time))
        ahead = self._times[index] - time
        if index:
            ahead = min(ahead, self._play[index] - self._play[index - 1])
        self._at = float(self._play[index] - ahead)
        self._after = index
        self._before = index if ahead == 0 else index - 1

    def play(self, start: float | None = None, duration: float | None = None) -> None:
        """Begin to play from a time, for a time.

        Parameters
        ----------
        start : float, optional
            In the samples' seconds. Default: the first sample, backwards the last.
        duration : float, optional
            Play seconds after which it ends as by `stop`. Default: play all.

        Raises
        ------
        InputError
            If it is playing already, or a number is not finite or the duration not above 0.
        """
        if not (self._paused or self.is_finished):
            raise InputError('it is playing already: pause or stop it first')
        if duration is not None and not (np.isfinite(duration) and duration > 0):
            raise InputError(f'duration must be above 0 s, got {duration}')
        if start is not None:
            self.seek(start)
        elif self._rate > 0:
            self.seek(float(self._times[0]))
        else:
            self.seek(float(self._times.max()))
            self._to_end()
        self._end_after(duration)
        self.resume()

    def stop(self) -> None:
        """End playing: nothing comes any more until `seek` or `play`."""
        self._rebase()
        self._stopped = True

    def play_next(self) -> range:
        """Return the next sample at once, while paused; empty if playing or at the end."""
        return self.burst(1)

    def play_previous(self) -> range:
        """Return the sample before the last one at once, while paused, against the direction."""
        if not self._paused or self._stopped or self._awaited is not None:
            return range(0)
        first = self._before if self._rate > 0 else self._after
        if not 0 <= first < len(self):
            return range(0)
        return self._stepped(range(first, first + 1))

    def burst(self, n: int = 0) -> range:
        """Return the next n samples at once, all that are left if 0, while paused.

        Play time moves to the last of them. Empty while playing or at the end.

        Raises
        ------
        InputError
            If n is negative.
        """
        if n < 0:
            raise InputError(f'burst of {n} samples: at least 0')
        if not self._paused or self._stopped or self._awaited is not None:
            return range(0)
        if self._at_end and self.loop and not self._growing:
            self._rewind(self._again())
        if self._rate > 0:
            end = len(self) if n == 0 else min(self._after + n, len(self))
            return self._stepped(range(self._after, end))
        end = -1 if n == 0 else max(self._before - n, -1)
        return self._stepped(range(self._before, end, -1))

    def advance(self, now: float | None = None) -> range:
        """Return the indices of the samples that have come due since the last call.

        Parameters
        ----------
        now : float, optional
            The clock's reading, if it is known already.

        Returns
        -------
        range
            Counts down when playing backwards. Never runs over the end of a loop: what is due of
            the next round comes next time.
        """
        if self._paused or self._stopped or self._awaited is not None:
            return range(0)
        now = self._clock() if now is None else now
        if self._at_end and self.loop and not self._growing:
            again = self._again()
            if (self._position(now) - again) * self._sign + _ROUNDING >= 0:
                self._rewind(again, now)
        position = self._position(now)
        if self._until is not None and (position - self._until) * self._sign >= 0:
            self._at = position = self._until
            self._stopped = True
        if self._rate > 0:
            end = int(np.searchsorted(self._play, position + _ROUNDING, side='right'))
            due = range(self._after, max(end, self._after))
        else:
            first = int(np.searchsorted(self._play, position - _ROUNDING, side='left'))
            due = range(self._before, min(first - 1, self._before), -1)
        self._mark(due)
        return due

    def next_due(self, now: float | None = None) -> float | None:
        """Return wall seconds until the next sample, 0 if it is due; None if none will come."""
        if self._paused or self.is_finished or self.is_waiting:
            return None
        now = self._clock() if now is None else now
        if self._at_end:
            due = self._again()
        else:
            due = float(self._play[self._after if self._rate > 0 else self._before])
        if self._until is not None and (due - self._until) * self._sign > 0:
            due = self._until
        return max((due - self._position(now)) / self._rate, 0.0)

    def grow(self, times: ArrayLike) -> None:
        """Replace the first samples by all of them, and go on where it is.

        Parameters
        ----------
        times : array (n,)
            As at the start. Samples may differ from those known so far: the next one played is
            the first after the one played last.

        Raises
        ------
        InputError
            As at the start.
        """
        self._rebase()
        times_before, play_before = self._times, self._play
        awaited, duration = self._awaited, self._duration
        self._growing, self._awaited = False, None
        self._take(times)
        known = max(self._after, self._before + 1)
        if not np.array_equal(self._times[:known], times_before[:known]):
            shift = float(self._times[0] - times_before[0])
            self._at -= shift
            if self._after > 0:
                edge = play_before[self._after - 1] - shift + _ROUNDING
                self._after = int(np.searchsorted(self._play, edge, side='right'))
            if self._before >= 0:
                edge = play_before[min(self._before + 1, play_before.size - 1)] - shift - _ROUNDING
                self._before = int(np.searchsorted(self._play, edge, side='left')) - 1
        if awaited is not None:
            jumps = self.jumps  # it was counted when it was asked for
            self.seek(min(awaited, float(self._times.max())))
            if self._rate < 0 and awaited == float('inf'):
                self._to_end()
            self._end_after(duration)
            self.jumps = jumps

    @property
    def _sign(self) -> float:
        return 1.0 if self._rate > 0 else -1.0

    def _end_after(self, duration: float | None) -> None:
        self._duration = duration
        if duration is not None and self._awaited is None:
            self._until = self._at + duration * self._sign

    def _to_end(self) -> None:
        if self._growing:
            self._awaited = float('inf')
            return
        self._at = float(self._play[-1])
        self._after, self._before = len(self), len(self) - 1

    def _again(self) -> float:
        """Return the play position at which the next round of a loop begins."""
        if self._rate > 0:
            return float(self._play[-1]) + self._between_loops
        return -self._between_loops

    def _stepped(self, due: range) -> range:
        self._mark(due)
        if due:
            self._at = float(self._play[due[-1]])
            if self._until is not None and (self._at - self._until) * self._sign > 0:
                self._duration = self._until = None
        return due

    def _mark(self, due: range) -> None:
        if due:
            self._after, self._before = due[-1] + 1, due[-1] - 1

    def _position(self, now: float) -> float:
        if self._paused or self._stopped or self._awaited is not None:
            return self._at
        position = self._at + (now - self._since) * self._rate
        if self.loop and not self._growing:
            return position
        return min(max(position, 0.0), float(self._play[-1]))

    def _rebase(self, now: float | None = None) -> None:
        now = self._clock() if now is None else now
        self._at = self._position(now)
        self._since = now

    def _rewind(self, again: float, now: float | None = None) -> None:
        """Start the next round, whose first sample is due at the play position `again`."""
        self._rebase(now)
        # A loop left alone for long begins its next round now rather than play many at once.
        late = min(max((self._at - again) * self._sign, 0.0), self._between_loops)
        if self._rate > 0:
            begin = 0.0
            self._after, self._before = 0, -1
        else:
            begin = float(self._play[-1])
            self._to_end()
        self._at = begin + late * self._sign
        if self._until is not None:
            self._until += begin - again
        self.jumps += 1


def checked_rate(rate: float) -> float:
    """Return a rate of playing.

    Raises
    ------
    InputError
        If it is 0 or not finite.
    """
    if not np.isfinite(rate) or rate == 0:
        raise InputError(f'rate must be a number other than 0, got {rate}; pause holds the time')
    return float(rate)
