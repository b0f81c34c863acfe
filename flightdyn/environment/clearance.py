"""How far a place is from what must not be flown into.

Clearances [m] are positive outside, 0 on the surface, and never more than the distance to it, so
that keeping a clearance keeps the distance. They take floats, arrays and CasADi symbols, and have
two continuous derivatives but on a cylinder's axis.
"""

from collections.abc import Sequence
from functools import reduce
from math import isfinite

from .. import numpy as np
from ..numpy import Vectorizable
from .polygons import Point, convex_parts
from .surroundings import Cylinder, Polygon

ROUNDING = 0.2
"""Width over which edges are rounded, as a part of a volume's smallest extent."""


def lower_max(a: Vectorizable, b: Vectorizable, width: float) -> Vectorizable:
    """Return a smooth maximum that is never above it.

    It is the maximum itself where a and b are equal, or differ by the width or more, and below it
    by 27/512 widths at most.
    """
    # |a - b| with a smooth bottom: r^2 (3 - 3 |r| + r^2) has the values and slopes of |r| at 1,
    # curvature 0 there, and is 0 at 0
    r = np.clip((a - b) / width, -1.0, 1.0)
    bend = r * r * (3.0 - 3.0 * np.abs(r) + r * r) - np.abs(r)
    return 0.5 * (a + b + np.abs(a - b) + width * bend)


def lower_min(a: Vectorizable, b: Vectorizable, width: float) -> Vectorizable:
    """Return a smooth minimum that is never above it, and below by 3/16 widths at most.

    It is the minimum itself where a and b differ by the width or more.
    """
    r = np.clip((a - b) / width, -1.0, 1.0)
    bend = 0.375 + 0.75 * r * r - 0.125 * r * r * r * r - np.abs(r)
    return 0.5 * (a + b - np.abs(a - b) - width * bend)


def clearance(
    volume: Cylinder | Polygon, x_e: Vectorizable, y_e: Vectorizable, altitude: Vectorizable
) -> Vectorizable:
    """Return how far a place [m] is outside a volume, at least.

    Above, below and beside it that is the distance to its surface; off its edges, where two
    faces meet, the larger of the distances to these.
    """
    extents = [volume.top - volume.bottom]
    if isinstance(volume, Cylinder):
        extents.append(volume.radius)
        beside = _beside_circle(volume, x_e, y_e)
    else:
        spans = [max(c) - min(c) for c in zip(*volume.corners, strict=True)]
        extents.append(min(spans))
        beside = _beside_polygon(volume.corners, x_e, y_e, ROUNDING * min(spans))
    width = ROUNDING * min(extents)
    faces = [beside]
    if isfinite(volume.top):
        faces.append(altitude - volume.top)
    if isfinite(volume.bottom):
        faces.append(volume.bottom - altitude)
    return reduce(lambda a, b: lower_max(a, b, width), faces)


def _beside_circle(volume: Cylinder, x_e: Vectorizable, y_e: Vectorizable) -> Vectorizable:
    north, east = x_e - volume.centre[0], y_e - volume.centre[1]
    return np.hypot(north, east) - volume.radius


def _beside_polygon(
    corners: Sequence[Point], x_e: Vectorizable, y_e: Vectorizable, width: float
) -> Vectorizable:
    parts = []
    for part in convex_parts(corners):
        sides = []
        for (x0, y0), (x1, y1) in zip(part, [*part[1:], part[0]], strict=True):
            length = float(np.hypot(x1 - x0, y1 - y0))
            # counterclockwise in (x, y): outside is on the right
            out = (y1 - y0) / length, (x0 - x1) / length
            sides.append((x_e - x0) * out[0] + (y_e - y0) * out[1])
        parts.append(reduce(lambda a, b: lower_max(a, b, width), sides))
    return reduce(lambda a, b: lower_min(a, b, width), parts)
