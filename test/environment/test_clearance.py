"""Clearances against distances worked out in another way, and their derivatives."""

from collections.abc import Callable
from typing import Any

import casadi as cas
import numpy as np
import pytest

from flightdyn.environment.clearance import clearance, lower_max, lower_min
from flightdyn.environment.polygons import convex_parts
from flightdyn.environment.surroundings import Cylinder, Polygon

L_SHAPE = [(0.0, 0.0), (40.0, 0.0), (40.0, 10.0), (10.0, 10.0), (10.0, 30.0), (0.0, 30.0)]
STAR = [(0.0, 10.0), (3.0, 3.0), (10.0, 0.0), (3.0, -3.0), (0.0, -10.0), (-3.0, -3.0)]
VOLUMES = [
    Cylinder(name='mast', centre=(3.0, -4.0), radius=10.0),
    Cylinder(name='tank', centre=(3.0, -4.0), radius=10.0, bottom=5.0, top=25.0),
    Polygon(name='yard', corners=L_SHAPE, top=20.0),
    Polygon(name='yard_backwards', corners=L_SHAPE[::-1], bottom=-5.0, top=20.0),
    Polygon(name='star', corners=STAR),
]


def inside(volume: Cylinder | Polygon, x: Any, y: Any, altitude: Any) -> Any:
    """Return whether places are in a volume, of a polygon by crossings of a ray."""
    if isinstance(volume, Cylinder):
        within = (x - volume.centre[0]) ** 2 + (y - volume.centre[1]) ** 2 < volume.radius**2
    else:
        within = np.zeros(x.shape, bool)
        corners = volume.corners
        for (x0, y0), (x1, y1) in zip(corners, [*corners[1:], corners[0]], strict=True):
            crosses = (y0 > y) != (y1 > y)
            with np.errstate(divide='ignore', invalid='ignore'):
                at = x0 + (y - y0) * (x1 - x0) / (y1 - y0)
            within ^= crosses & (x < at)
    return within & (altitude > volume.bottom) & (altitude < volume.top)


@pytest.mark.parametrize('volume', VOLUMES, ids=lambda volume: volume.name)
def test_nothing_inside_is_clear_and_little_outside_is_not(volume: Cylinder | Polygon) -> None:
    rng = np.random.default_rng(1)
    x, y = rng.uniform(-30, 60, (2, 20000))
    altitude = rng.uniform(-20, 50, 20000)
    clear = clearance(volume, x, y, altitude)
    within = inside(volume, x, y, altitude)
    assert within.sum() > 100
    assert (clear[within] <= 0).all()
    # rounding takes what is nearer than this to an edge: 3/16 of a fifth of 10 m at a seam
    wrong = (clear <= 0) & ~within
    assert wrong.mean() < 0.01


@pytest.mark.parametrize('volume', VOLUMES, ids=lambda volume: volume.name)
def test_clearance_is_never_more_than_the_distance(volume: Cylinder | Polygon) -> None:
    rng = np.random.default_rng(2)
    x, y = rng.uniform(-30, 60, (2, 300))
    altitude = rng.uniform(-20, 50, 300)
    clear = clearance(volume, x, y, altitude)
    # within a ball of that radius nothing is inside
    way = rng.normal(size=(3, 500))
    way /= np.linalg.norm(way, axis=0)
    for i in np.flatnonzero(clear > 0):
        ball = np.array([x[i], y[i], altitude[i]])[:, None] + 0.999 * clear[i] * way
        assert not inside(volume, *ball).any()


def test_clearance_of_faces_is_the_distance() -> None:
    tank = VOLUMES[1]
    assert clearance(tank, 3.0, 16.0, 15.0) == pytest.approx(10.0)
    assert clearance(tank, 3.0, -4.0, 32.0) == pytest.approx(7.0)
    assert clearance(tank, 3.0, -4.0, 1.0) == pytest.approx(4.0)
    yard = VOLUMES[2]
    assert clearance(yard, 25.0, -6.0, 5.0) == pytest.approx(6.0)
    assert clearance(yard, 25.0, 5.0, 26.0) == pytest.approx(6.0)
    # in the corner of the L its inner sides are as far as they are
    assert clearance(yard, 18.0, 25.0, 5.0) == pytest.approx(8.0, abs=0.5)


@pytest.mark.parametrize(('function', 'sign'), [(lower_max, 1), (lower_min, -1)])
def test_smooth_extremes_are_below_and_smooth(
    function: Callable[[Any, Any, float], Any], sign: int
) -> None:
    a = np.linspace(-3, 3, 6001)
    exact = np.maximum(a, 0) if sign > 0 else np.minimum(a, 0)
    off = exact - function(a, 0.0, 2.0)
    assert (off >= -1e-15).all()
    assert np.abs(off[np.abs(a) >= 2]).max() < 1e-15
    assert off.max() == pytest.approx(2.0 * (27 / 512 if sign > 0 else 3 / 16), rel=1e-4)
    # a jump of the second derivative would show as a difference of the size of the derivative
    second = np.diff(function(a, 0.0, 2.0), 2) / 1e-6
    assert np.abs(np.diff(second)).max() < 0.02


@pytest.mark.parametrize('volume', VOLUMES, ids=lambda volume: volume.name)
def test_derivatives_are_those_of_differences(volume: Cylinder | Polygon) -> None:
    p = cas.SX.sym('p', 3)
    value = clearance(volume, *cas.vertsplit(p))
    function = cas.Function('f', [p], [value, *cas.hessian(value, p)])
    rng = np.random.default_rng(3)
    h = 1e-5
    for at in rng.uniform(-30, 50, (20, 3)):
        _, bend, slope = (each.full() for each in function(at))
        for i in range(3):
            step = h * np.eye(3)[i]
            ahead, behind = function(at + step), function(at - step)
            # central differences of a smooth function err by h^2, and rounding by 1e-14 / h
            assert (ahead[0] - behind[0]) / (2 * h) == pytest.approx(slope[i, 0], abs=1e-6)
            rise = ((ahead[2] - behind[2]) / (2 * h)).full()[:, 0]
            np.testing.assert_allclose(rise, bend[:, i], atol=1e-5)


@pytest.mark.parametrize('corners', [L_SHAPE, L_SHAPE[::-1], STAR])
def test_convex_parts_are_convex_and_make_up_the_whole(
    corners: list[tuple[float, float]],
) -> None:
    def area(points: list[tuple[float, float]]) -> float:
        x, y = np.array(points).T
        return float(0.5 * (x * np.roll(y, -1) - np.roll(x, -1) * y).sum())

    parts = convex_parts(corners)
    assert sum(map(area, parts)) == pytest.approx(abs(area(corners)))
    for part in parts:
        sides = np.diff([*part, part[0], part[1]], axis=0)
        turns = sides[:-1, 0] * sides[1:, 1] - sides[:-1, 1] * sides[1:, 0]
        assert (turns >= 0).all()
    assert len(parts) <= len(corners) - 2
