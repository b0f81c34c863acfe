"""Who sets the controls of a vehicle in flight: a trajectory's controls, or a controller."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..dynamics.stage import Stage
from ..trajectory import Trajectory
from .inputs import check_controls

Array = NDArray[np.float64]


class Steering(Protocol):
    """Sets the controls of a flight from its time and state.

    A simulator asks in the order of time, and integrates between one break and the next.
    """

    def begin(self, time: float) -> None:
        """Forget what was before: a flight begins at a time [s]."""

    def breaks(self, begin: float, end: float) -> Array:
        """Return times [s] inside an interval where controls jump, bend or are decided anew."""

    def over(self, begin: float, end: float, x: Array) -> tuple[Array, Array]:
        """Return the controls (nu,) at both ends of an interval without a break inside.

        x is the state (nx,) at its begin.
        """

    def now(self, time: float, x: Array) -> Array:
        """Return the controls (nu,) that act from a time on, where the state is x."""


class OpenLoop:
    """A trajectory's controls by its own time, whatever the vehicle does; the ends hold.

    Raises
    ------
    InputError
        If the trajectory lacks a control of the stage.
    """

    def __init__(self, stage: Stage, controls: Trajectory) -> None:
        check_controls(stage, controls.controls, exact=False)
        self.time = controls.time
        self._u = np.array([controls.controls[name] for name in stage.controls])
        self._u = self._u.reshape(-1, self.time.size)
        self._held = controls.control_interpolation == 'previous'

    def begin(self, time: float) -> None:
        """Nothing is remembered."""

    def breaks(self, begin: float, end: float) -> Array:
        """Return the trajectory's samples inside the interval."""
        first = np.searchsorted(self.time, begin, side='right')
        return self.time[first : np.searchsorted(self.time, end, side='left')]

    def over(self, begin: float, end: float, x: Array | None = None) -> tuple[Array, Array]:
        """Return the controls at both ends of an interval without a sample inside."""
        if self._held:
            u = self.now((begin + end) / 2)
            return u, u
        return self.now(begin), self.now(end)

    def now(self, time: float, x: Array | None = None) -> Array:
        """Return the controls at a time; at a jump, those after it."""
        last = self.time.size - 1
        k = int(np.searchsorted(self.time, time, side='right')) - 1
        if k < 0 or k >= last or self._held:
            at_end: Array = self._u[:, min(max(k, 0), last)]
            return at_end
        fraction = (time - self.time[k]) / (self.time[k + 1] - self.time[k])
        between: Array = self._u[:, k] + (self._u[:, k + 1] - self._u[:, k]) * fraction
        return between
