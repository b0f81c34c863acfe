"""Heights between the points of a map: a function with two continuous derivatives."""

from dataclasses import dataclass
from functools import lru_cache

import casadi as cas
import numpy as _np

from .. import numpy as np
from ..numpy import Vectorizable, is_symbolic
from .surroundings import Terrain

DEGREE = 3


@dataclass(frozen=True, eq=False)
class TerrainSpline:
    """Heights of the ground as a function of place.

    Parameters
    ----------
    function : Function
        (x_e, y_e) in a column, or in each of several columns -> height.
    extent : (lower, upper) of x_e, of y_e [m]
    """

    function: cas.Function
    extent: tuple[tuple[float, float], tuple[float, float]]

    def heights(self, x_e: Vectorizable, y_e: Vectorizable) -> Vectorizable:
        """Return the height of the ground [m] at places north and east [m].

        Beyond the map it is that of the nearest point of its edge.
        """
        x, y = (np.clip(v, *ends) for v, ends in zip((x_e, y_e), self.extent, strict=True))
        if is_symbolic(x, y):
            x, y = x + 0.0 * y, y + 0.0 * x  # of one length
            return self.function(cas.horzcat(x, y).T).T
        x, y = _np.broadcast_arrays(x, y)
        found = self.function(_np.vstack([x.ravel(), y.ravel()])).full()
        return found.reshape(x.shape) if x.shape else float(found[0, 0])


@lru_cache(maxsize=16)
def spline_through(terrain: Terrain) -> TerrainSpline:
    """Return the bicubic spline through a map's points.

    At the second line from each edge the third derivative does not jump either (not-a-knot).
    Along axes of fewer than four lines it is one polynomial.
    """
    axes = [terrain.x, terrain.y]
    degrees = [min(DEGREE, axis.size - 1) for axis in axes]
    function = cas.interpolant(
        'terrain',
        'bspline',
        [axis.tolist() for axis in axes],
        terrain.height.ravel(order='F').tolist(),
        {'degree': degrees},
    )
    (x0, x1), (y0, y1) = ((float(axis[0]), float(axis[-1])) for axis in axes)
    return TerrainSpline(function, ((x0, x1), (y0, y1)))
