"""Gusty air for the simulator: Dryden turbulence on top of the mean wind."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..environment.turbulence import DrydenGusts
from ..errors import InputError

Array = NDArray[np.float64]

GUST_STEP = 0.01  # s; the gusts' shortest waves, of some metres, take a fast vehicle several steps


@dataclass(frozen=True)
class Gusts:
    """How gusty it is; the same seed makes the same flight.

    Parameters
    ----------
    severity : str
        'none', 'light', 'moderate' or 'severe', as `environment.turbulence.DrydenGusts` has it.
    seed : int
        From 0.
    wind_at_20_ft : float, optional
        Mean wind 20 ft above the ground [m/s], instead of the severity's.

    Raises
    ------
    InputError
        If the severity is unknown, or a number out of range.
    """

    severity: str = 'moderate'
    seed: int = 0
    wind_at_20_ft: float | None = None

    def __post_init__(self) -> None:
        if self.seed < 0:
            raise InputError(f'the seed of gusts must be 0 or more, got {self.seed}')
        self.start()

    def start(self) -> DrydenGusts:
        """Return the gusts from their beginning."""
        return DrydenGusts(self.severity, wind_at_20_ft=self.wind_at_20_ft, seed=self.seed)


def gust_earth(
    gusts: DrydenGusts, dt: float, velocity_earth: Array, wind_earth: Array, height: float
) -> Array:
    """Return the gust's velocity after a time step, earth axes [m/s], shape (3,).

    Along and across are along and across the mean wind at any height, or the track where there
    is no wind: aloft, where the standard takes body axes, intensities are alike in all of them.

    Parameters
    ----------
    velocity_earth, wind_earth : arrays (3,)
        Inertial velocity and mean wind [m/s].
    height : float
        Above the origin of the earth axes [m].
    """
    airspeed = float(np.linalg.norm(velocity_earth - wind_earth))
    u, v, w = gusts.advance(dt, airspeed, height)
    north, east = (wind_earth if np.any(wind_earth[:2]) else velocity_earth)[:2]
    length = math.hypot(north, east)
    north, east = (north / length, east / length) if length else (1.0, 0.0)
    return np.array([u * north - v * east, u * east + v * north, w])
