"""What sensors add to the truth: drifting fixes, noisy gyros and accelerometers."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

Array = NDArray[np.float64]

DRIFTING = 0.8
"""Share of a fix's variance that drifts; the rest is new in each fix."""


@dataclass(frozen=True)
class FixNoise:
    """How far fixes are off.

    Parameters
    ----------
    std : north, east, down [m]
        Standard deviations; 0 is exact.
    time : float
        How long errors last [s]: those of the atmosphere and of reflections take minutes.

    Raises
    ------
    InputError
        If a number is negative or not finite, or the time is not above 0.
    """

    std: tuple[float, float, float] = (0.0, 0.0, 0.0)
    time: float = 60.0

    def __post_init__(self) -> None:
        if not all(0 <= value < math.inf for value in self.std) or not 0 < self.time < math.inf:
            raise InputError(
                f'noise of fixes: std must be three numbers from 0, got {self.std}, and the time '
                f'above 0, got {self.time}'
            )


class FixErrors:
    """Errors of fixes, one after the other: a first-order Gauss-Markov process and white noise.

    The variance of the sum is `std` squared at any rate. The same seed and the same times make
    the same errors.
    """

    def __init__(self, noise: FixNoise, seed: Sequence[int]) -> None:
        self._noise = noise
        self._random = np.random.default_rng(seed)
        self._drift = self._random.standard_normal(3)
        self._time: float | None = None

    def next(self, time: float) -> tuple[float, float, float]:
        """Return the error north, east, down [m] of a fix at a time [s], not before the last."""
        passed = 0.0 if self._time is None else time - self._time
        self._time = time
        drift, white = self._random.standard_normal((2, 3))
        decay = math.exp(-passed / self._noise.time)
        self._drift = (
            decay * self._drift + math.sqrt(-math.expm1(-2 * passed / self._noise.time)) * drift
        )
        unit = math.sqrt(DRIFTING) * self._drift + math.sqrt(1 - DRIFTING) * white
        north, east, down = (np.array(self._noise.std) * unit).tolist()
        return north, east, down


class InertialErrors:
    """White noise of an IMU's samples.

    Parameters
    ----------
    accelerometer, gyro : float
        Standard deviations of one sample [m/s^2, rad/s]; 0 is exact.
    seed : sequence of int

    Raises
    ------
    InputError
        If one is negative or not finite.
    """

    def __init__(self, accelerometer: float, gyro: float, seed: Sequence[int]) -> None:
        if not (0 <= accelerometer < math.inf and 0 <= gyro < math.inf):
            raise InputError(
                f'noise of an IMU must be from 0, got {accelerometer} m/s^2 and {gyro} rad/s'
            )
        self._std = np.repeat([accelerometer, gyro], 3)
        self._random = np.random.default_rng(seed)

    def next(self) -> tuple[Array, Array]:
        """Return the errors of acceleration [m/s^2] and angular rate [rad/s], each (3,)."""
        errors = self._std * self._random.standard_normal(6)
        return errors[:3], errors[3:]
