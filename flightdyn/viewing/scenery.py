"""Static geometry of a 3D scene: coloured path, curtain, ground, ghosts and cameras."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..trajectory import Trajectory
from .coloring import BINS, Coloring, color_map
from .kinematics import Motion

Array = NDArray[np.float64]
Colors = NDArray[np.uint8]

MAX_PATH_POINTS = 50_000
MAX_PATH_STRIPS = 1_000  # the viewer's time to the first picture grows with strips, not points
MAX_CURTAIN_POINTS = 6_000
MAX_TUBE_POINTS = 20_000
TUBE_SIDES = 8
EARTH_RADIUS = 6_371_000.0  # m, mean
SCENE_SHARE = 0.04  # a vehicle drawn this large against the scene can be seen and read
FIELD_OF_VIEW = np.radians(55.0)  # the viewer's own, vertical
HILLY = 62.0  # deg above the horizon


def drawn_samples(motion: Motion, budget: int) -> list[NDArray[np.intp]]:
    """Return which samples to draw, one index array for each unbroken stretch.

    All of them if they are within the budget; else the first in each `length / budget` metres of
    path, so that no vertex is spent on standing still. A stretch's ends always stay.
    """
    if len(motion.time) <= budget:
        return [np.arange(part.start, part.stop) for part in motion.segments]
    step = max(float(motion.arc_length[-1]), 1e-9) / budget
    cell = np.floor(motion.arc_length / step)
    parts = []
    for part in motion.segments:
        inside = cell[part]
        keep = np.flatnonzero(np.diff(inside, prepend=-1.0) > 0)
        parts.append(part.start + np.union1d(keep, [0, inside.size - 1]).astype(np.intp))
    return parts


@dataclass(frozen=True)
class Strip:
    """A stretch of path in one colour, as sample indices."""

    index: NDArray[np.intp]
    color: tuple[int, int, int]


def colored_strips(
    motion: Motion, coloring: Coloring, *, budget: int = MAX_PATH_POINTS
) -> list[Strip]:
    """Return the path as strips of one colour each; none crosses a gap.

    Strips meet in a shared sample. Values are averaged over short runs before they are binned, or
    noise would cut the path into confetti.
    """
    parts = [part for part in drawn_samples(motion, budget) if part.size > 1]
    total = sum(part.size for part in parts)
    run = max(1, -(-total // MAX_PATH_STRIPS))
    palette = color_map(np.linspace(0, 1, BINS))
    strips = []
    for part in parts:
        starts = np.arange(0, part.size - 1, run)
        share = np.add.reduceat(coloring.share[part[:-1]], starts)
        share /= np.diff(np.append(starts, part.size - 1))
        level = np.round(share * (BINS - 1)).astype(int)
        first = np.flatnonzero(np.diff(level, prepend=-1))
        bounds = np.append(starts[first], part.size - 1)
        for k, (a, b) in enumerate(pairwise(bounds)):
            red, green, blue = palette[level[first[k]]].tolist()
            strips.append(Strip(part[a : b + 1], (red, green, blue)))
    return strips


def ground_altitude(trajectory: Trajectory, motion: Motion) -> float:
    """Return the altitude [m] the curtain falls to.

    The lowest point of a flight that has a date or a place on earth; for a simulation or plan
    z_e = 0, or its lowest point if that is lower.
    """
    lowest = float(motion.altitude.min())
    real = trajectory.start_ns != 0 or 'lat' in trajectory
    return lowest if real else min(0.0, lowest)


def curtain(
    motion: Motion, coloring: Coloring, ground: float
) -> tuple[Array, NDArray[np.uint32], Colors]:
    """Return vertices (n, 3), triangles (m, 3) and colours (n, 3) from the path to the ground.

    The foot is `altitude - ground` below the path, which on long flights follows the round earth
    away from the tangent plane.
    """
    vertices, triangles, colors, base = [], [], [], 0
    for part in drawn_samples(motion, MAX_CURTAIN_POINTS):
        top = motion.position[part]
        foot = top.copy()
        foot[:, 2] += np.maximum(motion.altitude[part] - ground, 0)
        vertices.append(np.stack([top, foot], axis=1).reshape(-1, 3))
        colors.append(np.repeat(color_map(coloring.share[part]), 2, axis=0))
        a = base + 2 * np.arange(part.size - 1)
        triangles.append(
            np.stack([np.stack([a, a + 1, a + 2], 1), np.stack([a + 1, a + 3, a + 2], 1)], axis=1)
        )
        base += 2 * part.size
    return (
        np.concatenate(vertices),
        np.concatenate(triangles).reshape(-1, 3).astype(np.uint32),
        np.concatenate(colors),
    )


def tube(motion: Motion) -> tuple[Array, NDArray[np.uint32]] | None:
    """Return vertices (n, 3) and triangles (m, 3) of a tube one sigma wide about the path.

    Level across the path it is as wide as the larger of the level 1-sigmas, upright as high as
    that of z_e. None without 1-sigmas, and for a flight of so many samples that the tube's
    straight pieces would be off the path by more than they are wide.
    """
    if motion.sigma is None or len(motion.time) > MAX_TUBE_POINTS:
        return None
    vertices, triangles, base = [], [], 0
    angle = np.linspace(0, 2 * np.pi, TUBE_SIDES, endpoint=False)
    for part in motion.segments:
        n = part.stop - part.start
        if n < 2:
            continue
        turn = motion.heading[part]
        across = np.stack([-np.sin(turn), np.cos(turn), np.zeros(n)], axis=1)
        wide = motion.sigma[part, :2].max(axis=1)[:, None] * across
        high = motion.sigma[part, 2:] * np.array([0.0, 0.0, 1.0])
        ring = np.cos(angle)[:, None] * wide[:, None] + np.sin(angle)[:, None] * high[:, None]
        vertices.append((motion.position[part][:, None] + ring).reshape(-1, 3))
        k = np.arange(TUBE_SIDES)
        a = base + TUBE_SIDES * np.arange(n - 1)[:, None] + k
        b = base + TUBE_SIDES * np.arange(n - 1)[:, None] + (k + 1) % TUBE_SIDES
        sides = [[a, b, a + TUBE_SIDES], [b, b + TUBE_SIDES, a + TUBE_SIDES]]
        triangles += [np.stack(side, axis=-1).reshape(-1, 3) for side in sides]
        base += TUBE_SIDES * n
    if not vertices:
        return None
    return np.concatenate(vertices), np.concatenate(triangles).astype(np.uint32)


def nice_step(value: float) -> float:
    """Return the 1, 2 or 5 times a power of ten nearest to a positive value."""
    steps = np.outer(10.0 ** np.arange(-9, 10), (1.0, 2.0, 5.0)).ravel()
    return float(steps[np.argmin(np.abs(np.log(steps / max(value, 1e-9))))])


@dataclass(frozen=True)
class Ground:
    """A grid on the ground: lines (n, k, 3), its spacing [m], and the surface just below it."""

    lines: Array
    spacing: float
    vertices: Array
    triangles: NDArray[np.uint32]


def ground_level(motion: Motion, ground: float, *, round_earth: bool = False) -> float:
    """Return z_e at the origin [m] of a ground of some altitude [m].

    Below the lowest sample it is as far away as the altitudes say.
    """
    lowest = int(np.argmin(motion.altitude))
    x, y, z = motion.position[lowest]
    fall = (x**2 + y**2) / (2 * EARTH_RADIUS) if round_earth else 0.0
    return float(z + motion.altitude[lowest] - ground - fall)


def ground_grid(
    motion: Motion, z_e: float, *, round_earth: bool = False, around: Array | None = None
) -> Ground:
    """Return a grid under the whole flight, lines on whole multiples of a round spacing.

    Parameters
    ----------
    z_e : float
        Of the ground at the origin [m].
    round_earth : bool
        Let it fall away from the tangent plane of the local axes, so that a flight of hundreds of
        kilometres is nowhere below it.
    around : array (n, 2)
        x_e, y_e [m] of what shall have ground under it, too.
    """
    low, high = (bound[:2] for bound in motion.bounds)
    if around is not None and len(around):
        low, high = np.minimum(low, around.min(axis=0)), np.maximum(high, around.max(axis=0))
    extent = max(float((high - low).max()), 0.35 * motion.size, 1e-3)
    spacing = nice_step(extent / 9)
    margin = 0.3 * extent + 0.2 * (extent - (high - low))
    start = np.floor((low - margin) / spacing) * spacing
    stop = np.ceil((high + margin) / spacing) * spacing
    x = np.arange(start[0], stop[0] + spacing / 2, spacing)
    y = np.arange(start[1], stop[1] + spacing / 2, spacing)
    level_x, level_y = np.meshgrid(x, y, indexing='ij')
    fall = (level_x**2 + level_y**2) / (2 * EARTH_RADIUS) if round_earth else 0.0 * level_x
    points = np.stack([level_x, level_y, z_e + fall], axis=-1)
    # straight lines and faces between the grid's points, or the two would cross
    lines = [points[i] for i in range(x.size)] + [points[:, j] for j in range(y.size)]
    longest = max(x.size, y.size)
    full = [np.concatenate([line, np.repeat(line[-1:], longest - len(line), 0)]) for line in lines]
    surface = points.copy()
    surface[..., 2] += 0.002 * extent  # just under the lines, or the two fight for the same pixels
    a = (np.arange(x.size - 1)[:, None] * y.size + np.arange(y.size - 1)).ravel()
    halves = (a, a + y.size, a + 1), (a + 1, a + y.size, a + y.size + 1)
    triangles = np.concatenate([np.stack(half, axis=1) for half in halves])
    return Ground(np.array(full), spacing, surface.reshape(-1, 3), triangles.astype(np.uint32))


def ghost_samples(motion: Motion, size: float, count: int | None = None) -> NDArray[np.intp]:
    """Return samples at which to draw the vehicle, spread over time and distance alike.

    Unless a count is given there are at most 16, fewer where vehicles of this size [m] would
    overlap.
    """
    if count is None:
        count = int(np.clip(motion.arc_length[-1] / (1.1 * size), 5, 16))
    share = np.linspace(0, 1, len(motion.time))
    if motion.arc_length[-1] > 0:
        elapsed = motion.time - motion.time[0]
        by_time = elapsed / max(float(elapsed[-1]), 1e-12)
        share = 0.5 * by_time + 0.5 * motion.arc_length / motion.arc_length[-1]
    index = np.searchsorted(share, np.linspace(0, 1, count))
    return np.unique(np.clip(index, 0, len(motion.time) - 1))


@dataclass(frozen=True)
class Camera:
    """An eye and what it looks at, in earth axes [m]."""

    position: tuple[float, float, float]
    target: tuple[float, float, float]


def overview_camera(
    motion: Motion, *, ground_z: float, margin: float, aspect: float = 1.2, hilly: bool = False
) -> Camera:
    """Return the eye that sees all of the path broadside from above, start to the left.

    Parameters
    ----------
    ground_z : float
        z_e of the ground [m], kept in view.
    margin : float
        Room around the path [m], for the vehicle.
    aspect : float
        Width over height of the view.
    hilly : bool
        Whether hills may hide the path: then it is seen from higher.
    """
    pick = np.concatenate(drawn_samples(motion, 2000))
    pick = pick[:: max(1, pick.size // 4000)]
    points = motion.position[pick]
    foot = points.copy()
    foot[:, 2] = ground_z
    points = np.concatenate([points, foot])
    level = points[:, :2] - points[:, :2].mean(axis=0)
    along = np.linalg.svd(level, full_matrices=False)[2][0]
    travel = motion.position[-1, :2] - motion.position[0, :2]
    if along @ travel < 0 or (np.allclose(travel, 0) and along[0] < 0):
        along = -along
    height = np.ptp(motion.position[:, 2]) / max(motion.size, 1e-9)
    elevation = np.radians(np.interp(height, (0.02, 0.2), (42.0, 24.0)))  # flat: from higher
    if hilly:
        elevation = np.radians(HILLY)
    right = np.array([along[0], along[1], 0.0])
    back = np.array([-along[1], along[0], 0.0]) * np.cos(elevation) + (0, 0, -np.sin(elevation))
    up = np.cross(right, -back)
    center = (points.min(axis=0) + points.max(axis=0)) / 2
    view = (points - center) @ np.column_stack([right, up, back])
    center = center + _middle(view[:, 0]) * right + _middle(view[:, 1]) * up
    view = (points - center) @ np.column_stack([right, up, back])
    tan_v = 0.86 * np.tan(FIELD_OF_VIEW / 2)
    need_v = (np.abs(view[:, 1]) + margin) / tan_v + view[:, 2]
    need_h = (np.abs(view[:, 0]) + margin) / (tan_v * aspect) + view[:, 2]
    distance = float(max(need_v.max(), need_h.max(), 1e-3))
    eye = center + back * distance
    return Camera((eye[0], eye[1], eye[2]), (center[0], center[1], center[2]))


def _middle(values: Array) -> float:
    return float(values.min() + values.max()) / 2


def map_zoom(lat_lon: Array, *, width: float = 340.0, height: float = 180.0) -> float:
    """Return the web-map zoom at which a track (n, 2) [deg] fits a panel of that many pixels."""
    lat, lon = np.radians(np.clip(lat_lon[:, 0], -85, 85)), np.unwrap(lat_lon[:, 1], period=360)
    across = float(np.ptp(lon)) / 360
    down = float(np.ptp(np.arcsinh(np.tan(lat)))) / (2 * np.pi)  # Mercator
    share = max(across / width, down / height, 1e-9)
    return float(np.clip(np.log2(1 / (256 * share)), 1.0, 18.0))


def lines_on_map(lat_lon: Array, index: NDArray[np.intp]) -> list[Array]:
    """Return a strip as latitudes and longitudes, cut where it crosses the 180th meridian."""
    line = lat_lon[index]
    cuts = np.flatnonzero(np.abs(np.diff(line[:, 1])) > 180) + 1
    return [piece for piece in np.split(line, cuts) if len(piece) > 1]
