"""Thermals: columns of rising air."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

from .. import numpy as np
from ..frames import Vector
from ..numpy import Vectorizable
from .wind import Summable, check_finite, check_positive


@dataclass(frozen=True)
class Thermal(Summable):
    """An upright column of rising air with a bell-shaped profile, a wind like others.

    Parameters
    ----------
    x, y : float
        Of its axis, north and east of the origin of the earth axes [m].
    updraft : float
        Speed of the air on the axis, up [m/s].
    radius : float
        Where it rises at 1/e of that [m].
    top : float
        Altitude at which it has lost half of its strength [m]; none by default.
    fade : float
        How far around its top it weakens [m]: within it to either side from 88 % to 12 %.

    Raises
    ------
    InputError
        If the radius or the fade is not positive, or a number is not finite.

    Notes
    -----
    The updraught at a distance r from the axis is updraft exp(-(r / radius)^2) and, with a top,
    (1 - tanh((altitude - top) / fade)) / 2 of that. The air around neither sinks nor flows in.

    References
    ----------
    .. [1] Wharington, *Autonomous Control of Soaring Aircraft by Reinforcement Learning*, RMIT,
       1998: the bell shape. Allen, *Updraft Model for Development of Autonomous Soaring
       Uninhabited Air Vehicles*, AIAA 2006-1510: sizes and strengths over a desert.
    """

    x: float
    y: float
    updraft: float
    radius: float
    top: float = inf
    fade: float = 50.0

    def __post_init__(self) -> None:
        check_finite(self, but='top')
        check_positive(self, 'radius', 'fade')

    def __call__(
        self, x_e: Vectorizable, y_e: Vectorizable, z_e: Vectorizable, time: Vectorizable
    ) -> Vector:
        north, east = (x_e - self.x) / self.radius, (y_e - self.y) / self.radius
        rising = self.updraft * np.exp(-(north * north + east * east))
        if self.top < inf:
            rising = rising * (0.5 - 0.5 * np.tanh((-z_e - self.top) / self.fade))
        return 0.0, 0.0, -rising
