"""WGS84 positions and the local north-east-down tangent plane.

pymap3d is imported where it is used, which keeps `import flightdyn` light.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GeodeticPoint:
    """A point by WGS84 latitude, longitude [deg] and altitude [m].

    Altitude is above the ellipsoid unless whoever made the point says otherwise.

    Raises
    ------
    InputError
        If latitude is outside +-90, longitude outside +-180 or a value is not finite.
    """

    lat: float
    lon: float
    altitude: float = 0.0

    def __post_init__(self) -> None:
        if not (np.isfinite([self.lat, self.lon, self.altitude]).all()):
            raise InputError(f'{self} is not finite')
        if not (-90 <= self.lat <= 90 and -180 <= self.lon <= 180):
            raise InputError(f'{self}: latitude must be within 90, longitude within 180 degrees')


def ned_from_geodetic(
    lat: ArrayLike, lon: ArrayLike, altitude: ArrayLike, origin: GeodeticPoint
) -> tuple[Array, Array, Array]:
    """Return x_e, y_e, z_e [m] in the tangent plane at the origin; lat, lon in degrees."""
    import pymap3d

    x, y, z = pymap3d.geodetic2ned(lat, lon, altitude, origin.lat, origin.lon, origin.altitude)
    return np.asarray(x), np.asarray(y), np.asarray(z)


def geodetic_from_ned(
    x_e: ArrayLike, y_e: ArrayLike, z_e: ArrayLike, origin: GeodeticPoint
) -> tuple[Array, Array, Array]:
    """Return lat, lon [deg] and altitude [m] of a point in the tangent plane at the origin."""
    import pymap3d

    lat, lon, altitude = pymap3d.ned2geodetic(
        np.asarray(x_e, float),
        np.asarray(y_e, float),
        np.asarray(z_e, float),
        origin.lat,
        origin.lon,
        origin.altitude,
    )
    return np.asarray(lat), np.asarray(lon), np.asarray(altitude)
