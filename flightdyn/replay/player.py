"""A play clock over the samples of a recording: which are due, and when is the next."""

import time as _time
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError

_ROUNDING = 1e-9
"""Due early by this [s]: whoever slept for `next_due` finds the sample due, whatever rounding."""


class Player:
    """Plays sample indices in order against a monotonic clock.

    It knows nothing of what the samples are: whoever owns it calls `advance`, publishes the
    samples of the range it returns, and sleeps for `next_due`. Commands have the names of
    rosbag2's player.

    Parameters
    ----------
    times : array (n,)
        Seconds of each sample. Never decreasing, but for a clock set back between segments:
        samples are played in their order, and a step back takes no time.
    rate : float
        Play seconds per wall second.
    loop : bool
        Start again after the last sample, one median sample interval later.
    max_gap : float, optional
        Longer pauses between samples are shortened to this [s]. Default: played in full.
    paused : bool
        Start paused.
    clock : callable
        Returns monotonic seconds.

    Raises
    ------
    InputError
        If there are no samples, a time is not finite, or the rate or the gap is not above 0.
    """

    def __init__(
        self,
        times: ArrayLike,
        *,
        rate: float = 1.0,
        loop: bool = False,
        max_gap: float | None = None,
        paused: bool = False,
        clock: Callable[[], float] = _time.monotonic,
    ) -> None:
        self._times = np.array(times, dtype=float)
        if self._times.ndim != 1 or self._times.size == 0:
            raise InputError('nothing to play: no samples')
        if not np.isfinite(self._times).all():
            raise InputError('a sample time to play is not finite')
        if max_gap is not None and not max_gap > 0:
            raise InputError(f'max_gap must be above 0 s, got {max_gap}')
        steps = np.maximum(np.diff(self._times), 0.0)
        if max_gap is not None:
            steps = np.minimum(steps, max_gap)
        self._play = np.concatenate(([0.0], np.cumsum(steps)))
        positive = steps[steps > 0]
        self._between_loops = float(np.median(positive)) if positive.size else 1.0
        self._clock = clock
        self._rate = _checked_rate(rate)
        self._paused = paused
        self._stopped = False
        self._next = 0
        self._at = 0.0  # play position at the wall time `_since`
        self._since = clock()
        self.loop = loop
        self.jumps = 0
        """How often play time jumped (`seek`, a loop); whoever filters the samples starts anew."""

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
        return self._stopped or (self._next >= len(self) and not self.loop)

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
        """Play at another rate from now on.

        Raises
        ------
        InputError
            If the rate is not above 0.
        """
        checked = _checked_rate(rate)
        self._rebase()
        self._rate = checked

    def seek(self, time: float) -> None:
        """Go to a time of the samples [s]: the next sample is the first at or after it.

        Times before the first and after the last sample mean those. Seeking neither pauses nor
        resumes, but it undoes `stop`.

        Raises
        ------
        InputError
            If the time is not finite.
        """
        if not np.isfinite(time):
            raise InputError(f'cannot seek {time}')
        time = float(np.clip(time, self._times[0], self._times.max()))
        index = int(np.argmax(self._times >= time))
        ahead = self._times[index] - time
        if index:
            ahead = min(ahead, self._play[index] - self._play[index - 1])
        self._next = index
        self._at = float(self._play[index] - ahead)
        self._since = self._clock()
        self._stopped = False
        self.jumps += 1

    def stop(self) -> None:
        """End playing: nothing comes any more until `seek`."""
        self._rebase()
        self._stopped = True

    def play_next(self) -> range:
        """Return the next sample at once, while paused; empty if playing or at the end."""
        return self.burst(1)

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
        if not self._paused or self._stopped:
            return range(self._next, self._next)
        if self._next >= len(self) and self.loop:
            self._rewind(float(self._play[-1]) + self._between_loops)
        end = len(self) if n == 0 else min(self._next + n, len(self))
        due = range(self._next, end)
        if due:
            self._next = end
            self._at = float(self._play[end - 1])
        return due

    def advance(self, now: float | None = None) -> range:
        """Return the indices of the samples that have come due since the last call.

        Parameters
        ----------
        now : float, optional
            The clock's reading, if it is known already.

        Returns
        -------
        range
            Never runs over the end of a loop: what is due of the next round comes next time.
        """
        if self._paused or self._stopped:
            return range(self._next, self._next)
        now = self._clock() if now is None else now
        position = self._position(now) + _ROUNDING
        if self._next >= len(self) and self.loop:
            again = float(self._play[-1]) + self._between_loops
            if position >= again:
                position = self._rewind(again, now) + _ROUNDING
        end = int(np.searchsorted(self._play, position, side='right'))
        due = range(self._next, max(end, self._next))
        self._next = due.stop
        return due

    def next_due(self, now: float | None = None) -> float | None:
        """Return wall seconds until the next sample, 0 if it is due; None if none will come."""
        if self._paused or self.is_finished:
            return None
        if self._next < len(self):
            due = float(self._play[self._next])
        else:
            due = float(self._play[-1]) + self._between_loops
        position = self._position(self._clock() if now is None else now)
        return max(due - position, 0.0) / self._rate

    def _position(self, now: float) -> float:
        if self._paused or self._stopped:
            return self._at
        return self._at + (now - self._since) * self._rate

    def _rebase(self, now: float | None = None) -> None:
        now = self._clock() if now is None else now
        self._at = self._position(now)
        self._since = now

    def _rewind(self, again: float, now: float | None = None) -> float:
        """Start the next round, whose first sample is due at the play position `again`."""
        self._rebase(now)
        # A loop left alone for long begins its next round now rather than play many at once.
        late = min(self._at - again, self._between_loops)
        self._at = max(late, 0.0)
        self._next = 0
        self.jumps += 1
        return self._at


def _checked_rate(rate: float) -> float:
    if not (np.isfinite(rate) and rate > 0):
        raise InputError(f'rate must be above 0, got {rate}')
    return float(rate)
