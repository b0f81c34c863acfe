"""Terrain, volumes to keep out of, gates and marks in the 3D view and on the map."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..environment.geodesy import GeodeticPoint, geodetic_from_ned
from ..environment.surroundings import Cylinder, Gate, Mark, Polygon, Surroundings, Terrain
from ..errors import MissingExtraError
from .archetypes import path_part

try:
    import rerun as rr
except ImportError as error:
    raise MissingExtraError('a Rerun recording', 'view') from error

Array = NDArray[np.float64]

MAX_GRID = 400  # lines of terrain either way: more than a screen shows
CIRCLE = 48
KEEP_OUT = (230, 60, 50)
GATE = (255, 210, 60)
MARK = (240, 240, 245)

# Meadow, scrub, rock, snow: hypsometric tints, dark enough for a bright path before them.
_TINTS = np.array(
    [(34, 62, 48), (52, 82, 50), (96, 92, 58), (108, 88, 70), (150, 142, 138)], float
)
_LIGHT = np.array([0.35, -0.45, -0.82])  # from the north-west above, as on maps


def log_surroundings(
    rec: rr.RecordingStream,
    surroundings: Surroundings,
    *,
    reach: tuple[float, float],
    origin: GeodeticPoint | None,
) -> str:
    """Log all that stands around a flight; return a note that tells what the colours mean.

    Parameters
    ----------
    reach : (lowest, highest) altitude [m]
        That volumes without end are drawn to.
    origin : GeodeticPoint or None
        Of the earth axes; with it keep-outs, gates and marks are on the map, too.
    """
    note = ''
    if surroundings.terrain is not None:
        note = _log_terrain(rec, surroundings.terrain)
    for volume in surroundings.keep_out:
        _log_volume(rec, volume, reach)
    for gate in surroundings.gates:
        _log_gate(rec, gate)
    if surroundings.marks:
        _log_marks(rec, surroundings.marks)
    if origin is not None:
        _log_on_map(rec, surroundings, origin)
    return note


def _log_terrain(rec: rr.RecordingStream, terrain: Terrain) -> str:
    x, y, height = _thinned(terrain)
    low, high = float(height.min()), float(height.max())
    slope_x, slope_y = np.gradient(height, x, y)
    # outward normals point up, which is -z
    normal = np.stack([-slope_x, -slope_y, np.ones_like(height)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    up = normal * (1.0, 1.0, -1.0)
    light = np.clip(up @ _LIGHT, 0, 1) * 0.8 + 0.5
    step = contour_step(high - low)
    share = (height - low) / max(high - low, 1e-9) * (len(_TINTS) - 1)
    tint = np.stack([np.interp(share, np.arange(len(_TINTS)), _TINTS[:, i]) for i in range(3)], -1)
    # every second band between contours is a shade lighter: heights can be counted
    band = 1.0 + 0.10 * (np.floor(height / step) % 2)
    colors = np.clip(tint * (light * band)[..., None], 0, 255).astype(np.uint8)
    grid_x, grid_y = np.meshgrid(x, y, indexing='ij')
    vertices = np.stack([grid_x, grid_y, -height], axis=-1).reshape(-1, 3)
    n, m = height.shape
    a = (np.arange(n - 1)[:, None] * m + np.arange(m - 1)).ravel()
    triangles = np.concatenate(
        [np.stack([a, a + m, a + 1], 1), np.stack([a + 1, a + m, a + m + 1], 1)]
    )
    mesh = rr.Mesh3D(
        vertex_positions=vertices.astype(np.float32),
        vertex_normals=up.reshape(-1, 3).astype(np.float32),
        triangle_indices=triangles.astype(np.uint32),
        vertex_colors=colors.reshape(-1, 3),
    )
    rec.log('world/ground/terrain', mesh, static=True)
    return f'terrain from {low:.4g} to {high:.4g} m; its shade changes every {step:g} m'


def _thinned(terrain: Terrain) -> tuple[Array, Array, Array]:
    """Return x, y and heights on at most `MAX_GRID` lines either way, the edges among them."""
    picks = [
        np.unique(np.linspace(0, line.size - 1, min(line.size, MAX_GRID)).round().astype(int))
        for line in (terrain.x, terrain.y)
    ]
    return terrain.x[picks[0]], terrain.y[picks[1]], terrain.height[np.ix_(*picks)]


def contour_step(span: float) -> float:
    """Return a round height [m] that a span has about ten of."""
    rough = max(span, 1e-6) / 10
    power = 10.0 ** np.floor(np.log10(rough))
    return float(min((m * power for m in (1, 2, 5, 10)), key=lambda s: abs(np.log(s / rough))))


def outline(volume: Cylinder | Polygon) -> Array:
    """Return the corners of a volume seen from above (n, 2): x_e, y_e [m]."""
    if isinstance(volume, Polygon):
        return np.array(volume.corners, float)
    angle = np.linspace(0, 2 * np.pi, CIRCLE, endpoint=False)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    return np.array(volume.centre) + volume.radius * ring


def _log_volume(
    rec: rr.RecordingStream, volume: Cylinder | Polygon, reach: tuple[float, float]
) -> None:
    bottom = volume.bottom if np.isfinite(volume.bottom) else min(reach[0], volume.top)
    top = volume.top if np.isfinite(volume.top) else max(reach[1], bottom)
    ring = outline(volume)
    n = len(ring)
    low, high = (np.column_stack([ring, np.full(n, -h)]) for h in (bottom, top))
    k = np.arange(n)
    after = (k + 1) % n
    walls = [np.stack([k, after, k + n], 1), np.stack([after, after + n, k + n], 1)]
    mesh = rr.Mesh3D(
        vertex_positions=np.concatenate([low, high]),
        triangle_indices=np.concatenate(walls),
        vertex_colors=[KEEP_OUT] * (2 * n),
        albedo_factor=[255, 255, 255, 70],
    )
    entity = f'world/keep_out/{path_part(volume.name)}'
    rec.log(entity, mesh, static=True)
    edges = rr.LineStrips3D(
        [np.concatenate([low, low[:1]]), np.concatenate([high, high[:1]])],
        colors=[KEEP_OUT],
        radii=rr.Radius.ui_points(1.2),
    )
    rec.log(f'{entity}/edges', edges, static=True)
    middle = high.mean(axis=0)
    label = rr.Points3D([middle], labels=[volume.name], colors=[KEEP_OUT], radii=[0.0])
    rec.log(f'{entity}/name', label, static=True)


def _log_gate(rec: rr.RecordingStream, gate: Gate) -> None:
    x, y, altitude = gate.centre
    centre = np.array([x, y, -altitude])
    across = np.array([-np.sin(gate.heading), np.cos(gate.heading), 0.0]) * gate.width / 2
    up = np.array([0.0, 0.0, -gate.height / 2])
    corners = np.array(
        [centre + i * across + j * up for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    )
    frame = rr.LineStrips3D(
        [np.concatenate([corners, corners[:1]])],
        colors=[GATE],
        radii=[0.02 * max(gate.width, gate.height)],
        labels=[gate.name],
    )
    rec.log(f'world/gates/{path_part(gate.name)}', frame, static=True)


def _log_marks(rec: rr.RecordingStream, marks: Sequence[Mark]) -> None:
    places = [(m.place[0], m.place[1], -m.place[2]) for m in marks]
    points = rr.Points3D(
        places,
        labels=[m.name for m in marks],
        show_labels=True,
        colors=[MARK],
        radii=rr.Radius.ui_points(5.0),
    )
    rec.log('world/marks', points, static=True)
    angle = np.linspace(0, 2 * np.pi, CIRCLE + 1)
    rings = [
        np.column_stack(
            [
                m.place[0] + m.radius * np.cos(angle),
                m.place[1] + m.radius * np.sin(angle),
                np.full(angle.size, -m.place[2]),
            ]
        )
        for m in marks
        if m.radius > 0
    ]
    if rings:
        circles = rr.LineStrips3D(rings, colors=[MARK], radii=rr.Radius.ui_points(1.0))
        rec.log('world/marks/circles', circles, static=True)


def _log_on_map(
    rec: rr.RecordingStream, surroundings: Surroundings, origin: GeodeticPoint
) -> None:
    def placed(points: Array) -> Array:
        lat, lon, _ = geodetic_from_ned(points[:, 0], points[:, 1], 0.0, origin)
        return np.column_stack([lat, lon])

    rings = [outline(volume) for volume in surroundings.keep_out]
    if rings:
        lines = [placed(np.concatenate([ring, ring[:1]])) for ring in rings]
        drawn = rr.GeoLineStrings(lat_lon=lines, colors=[KEEP_OUT], radii=rr.Radius.ui_points(1.5))
        rec.log('map/keep_out', drawn, static=True)
    for entity, color, places in (
        ('map/gates', GATE, [gate.centre[:2] for gate in surroundings.gates]),
        ('map/marks', MARK, [mark.place[:2] for mark in surroundings.marks]),
    ):
        if places:
            points = rr.GeoPoints(
                lat_lon=placed(np.array(places, float)),
                colors=[color],
                radii=rr.Radius.ui_points(5.0),
            )
            rec.log(entity, points, static=True)
