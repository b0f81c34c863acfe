"""What a replay publishes of each of its samples, and work that goes on beside playing."""

import threading
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, TypeVar

from numpy.typing import NDArray

from ..logs.messages import kinematics
from ..logs.track import Track
from ..replay.opening import Opened, open_track
from ..replay.report import Replay
from ..trajectory import Columns, Trajectory
from .convert import fix_msg, motion_at, odometry_msg, path_msg, state_msg, transform_msg

T = TypeVar('T')

_ONE_AT_A_TIME = threading.Lock()
"""Filters are compiled on first use, and building them is no matter for two threads."""


@dataclass(frozen=True)
class Reel:
    """A replay as far as it is known, and what is published of it.

    Parameters
    ----------
    opened : Opened
        The log.
    replay : Replay
        What is known of its motion.
    complete : bool
        Whether that is of the whole log.
    motion : mapping of name to array (n,)
        As `logs.messages.kinematics`.
    stamps : int array (n,)
        Unix time of each sample [ns].
    path : nav_msgs.msg.Path
    """

    opened: Opened
    replay: Replay
    complete: bool
    motion: Columns
    stamps: NDArray[Any]
    path: Any

    @classmethod
    def first(cls, track: Track, *, whole: bool = False) -> 'Reel':
        """Return what of a log can be shown at once, or all of it."""
        with _ONE_AT_A_TIME:
            opened = open_track(track, whole=whole)
        return cls._of(opened, opened.known, opened.complete)

    @classmethod
    def whole(cls, opened: Opened) -> 'Reel':
        """Return all of a log; of a long one it takes its time."""
        with _ONE_AT_A_TIME:
            replay = opened.whole()
        return cls._of(opened, replay, True)

    @classmethod
    def _of(cls, opened: Opened, replay: Replay, complete: bool) -> 'Reel':
        flown = replay.trajectory
        return cls(opened, replay, complete, kinematics(flown), flown.unix_ns, path_msg(flown))

    @property
    def flown(self) -> Trajectory:
        return self.replay.trajectory

    def ns(self, seconds: float) -> int:
        """Return the Unix time [ns] of a time of the trajectory."""
        return self.flown.start_ns + round(seconds * 1e9)

    def state(self, index: int) -> Any:
        """Return a sample as a VehicleState; its time counts from the log's first sample."""
        flown = self.flown
        return state_msg(
            motion_at(self.motion, index),
            int(self.stamps[index]),
            time=float(flown.time[index]),
            vehicle=flown.vehicle,
            states={name: float(v[index]) for name, v in flown.states.items()},
            controls={name: float(v[index]) for name, v in flown.controls.items()},
        )

    def odometry(self, index: int) -> Any:
        """Return a sample as an Odometry, with the variances of its position."""
        outputs = self.flown.outputs
        north, east, down = (
            float(outputs[name][index]) if name in outputs else 0.0
            for name in ('x_e_std', 'y_e_std', 'z_e_std')
        )
        return odometry_msg(
            motion_at(self.motion, index),
            int(self.stamps[index]),
            position_std=(north, east, down),
        )

    def fix(self, index: int) -> Any | None:
        """Return a sample as a NavSatFix; None if the log does not tell where on earth it is."""
        outputs = self.flown.outputs
        if 'lat' not in outputs:
            return None
        lat, lon, altitude = (float(outputs[k][index]) for k in ('lat', 'lon', 'altitude'))
        return fix_msg(lat, lon, altitude, int(self.stamps[index]))

    def transform(self, index: int) -> Any:
        """Return the transform from `odom` to `base_link` at a sample."""
        return transform_msg(motion_at(self.motion, index), int(self.stamps[index]))


def in_background(work: Callable[[], T]) -> 'Future[T]':
    """Return the future result of work on a thread that no one waits for at the end."""
    future: Future[T] = Future()

    def run() -> None:
        try:
            future.set_result(work())
        except BaseException as error:
            future.set_exception(error)

    threading.Thread(target=run, name='replay', daemon=True).start()
    return future
