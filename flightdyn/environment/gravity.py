"""Gravity that weakens with altitude; where it need not, dynamics use a constant."""

from ..numpy import Vectorizable
from .atmosphere import EARTH_RADIUS, G0


def inverse_square(altitude: Vectorizable, g: Vectorizable = G0) -> Vectorizable:
    """Return the acceleration of gravity [m/s^2] at a geometric altitude [m] above sea level.

    Parameters
    ----------
    altitude : Vectorizable
        Geometric, above mean sea level [m].
    g : Vectorizable
        At sea level [m/s^2].

    References
    ----------
    .. [1] *U.S. Standard Atmosphere, 1976*, NOAA-S/T 76-1562, equation (17): its radius of
       6 356 766 m and 9.80665 m/s^2 together are right at a latitude of 45.5 degrees.
    """
    ratio = EARTH_RADIUS / (EARTH_RADIUS + altitude)
    return g * ratio * ratio


def potential_inverse_square(altitude: Vectorizable, g: Vectorizable = G0) -> Vectorizable:
    """Return the potential energy per mass [J/kg], 0 at sea level, that `inverse_square` implies.

    With the default g that is G0 times the geopotential altitude.
    """
    return g * (EARTH_RADIUS * altitude / (EARTH_RADIUS + altitude))
