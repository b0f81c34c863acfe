"""Long logs: the first samples at once, all of them when they are reconstructed."""

from dataclasses import dataclass

import numpy as np

from ..logs.track import Track
from .report import Replay, replay_track

AT_ONCE = 30_000
"""A log of no more samples is reconstructed as a whole: it takes a second at most."""

FIRST = 8_000
"""So many samples of a longer one are shown before the rest is known."""

AHEAD = 500
"""So many more are reconstructed with them: a smoothed sample depends on those that follow."""


@dataclass(frozen=True)
class Opened:
    """A log that was read, and as much of its motion as is known yet.

    Parameters
    ----------
    track : Track
        All samples.
    known : Replay
        Of the whole log, or of its first `FIRST` samples and the `AHEAD` that follow, without
        these.
    complete : bool
        Whether it is of the whole log.
    """

    track: Track
    known: Replay
    complete: bool

    def whole(self) -> Replay:
        """Return the motion of the whole log; some 30 us a sample."""
        return self.known if self.complete else replay_track(self.track)

    @property
    def end(self) -> float:
        """The latest time of any sample [s], as the trajectory counts it."""
        return float(int(self.track.time_ns.max()) - int(self.track.time_ns[0])) / 1e9


def open_track(track: Track, *, whole: bool = False) -> Opened:
    """Return a log that was read, as soon as its first samples can be shown.

    Parameters
    ----------
    track : Track
    whole : bool
        Reconstruct all of it at once, however long that takes.

    Notes
    -----
    What is known first is what `replay_log` makes of a log that ends after those samples: the
    noise and the manoeuvres are estimated from them alone, and they are judged without those
    that follow. Where a flight goes on as it began, the two differ by a fraction of the 1-sigma.
    """
    if whole or len(track) <= AT_ONCE:
        return Opened(track, replay_track(track), complete=True)
    known = replay_track(track.first(FIRST + AHEAD))
    trajectory = known.trajectory
    shown = trajectory.take(np.arange(max(len(trajectory) - AHEAD, 1)))
    return Opened(track, Replay(known.track, shown, known.rejected), False)
