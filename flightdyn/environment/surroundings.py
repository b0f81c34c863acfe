"""What stands around a flight: terrain, volumes to keep out of, gates, marks on the ground.

Positions are x_e (north) and y_e (east) [m] from the origin of the earth axes; heights are
altitudes above it [m].
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

Array = NDArray[np.float64]
Point = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Terrain:
    """Heights of the ground on a rectangular grid.

    Parameters
    ----------
    x, y : array (n,), (m,)
        North and east of the grid's lines [m], increasing.
    height : array (n, m)
        Of the ground [m].

    Raises
    ------
    InputError
        If the shapes do not fit, the lines do not increase or a value is not finite.
    """

    x: Array
    y: Array
    height: Array

    def __post_init__(self) -> None:
        for name in ('x', 'y', 'height'):
            value = np.asarray(getattr(self, name), dtype=np.float64)
            if not np.isfinite(value).all():
                bad = np.argwhere(~np.isfinite(value))[0].tolist()
                raise InputError(f'terrain: {name} at {bad} is not a finite number')
            object.__setattr__(self, name, value)
        for name in ('x', 'y'):
            line = getattr(self, name)
            if line.ndim != 1 or line.size < 2 or not (np.diff(line) > 0).all():
                raise InputError(f'terrain: {name} must be two or more increasing numbers')
        if self.height.shape != (self.x.size, self.y.size):
            raise InputError(
                f'terrain: height has shape {self.height.shape}, expected one value for each x '
                f'and y: {(self.x.size, self.y.size)}'
            )


@dataclass(frozen=True, kw_only=True)
class Cylinder:
    """An upright cylinder to keep out of.

    Parameters
    ----------
    name : str
    centre : x_e, y_e [m]
    radius : float [m]
    bottom, top : float
        Altitudes it reaches from and to [m].
    """

    name: str
    centre: Point
    radius: float
    bottom: float = -math.inf
    top: float = math.inf


@dataclass(frozen=True, kw_only=True)
class Polygon:
    """An upright prism to keep out of.

    Parameters
    ----------
    name : str
    corners : sequence of x_e, y_e [m]
        In order, either way round, not closed.
    bottom, top : float
        Altitudes it reaches from and to [m].
    """

    name: str
    corners: Sequence[Point]
    bottom: float = -math.inf
    top: float = math.inf


@dataclass(frozen=True, kw_only=True)
class Gate:
    """An upright rectangle to fly through.

    Parameters
    ----------
    name : str
    centre : x_e, y_e, altitude [m]
    heading : float
        Of the way through it, clockwise from north [rad].
    width, height : float
        Of the opening [m].
    """

    name: str
    centre: tuple[float, float, float]
    heading: float
    width: float
    height: float


@dataclass(frozen=True, kw_only=True)
class Mark:
    """A named place, such as an airfield or who listens on the ground.

    Parameters
    ----------
    name : str
    place : x_e, y_e, altitude [m]
    radius : float
        Of a circle to draw round it [m], or 0.
    """

    name: str
    place: tuple[float, float, float]
    radius: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Surroundings:
    """All that stands around a flight."""

    terrain: Terrain | None = None
    keep_out: Sequence[Cylinder | Polygon] = ()
    gates: Sequence[Gate] = ()
    marks: Sequence[Mark] = ()
