"""Low-poly vehicles made by code, in body axes (forward, right, down) and metres.

Colours tell the sides apart: red is left (port), green is right (starboard), and a quadcopter's
forward rotors are orange.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Color = tuple[int, int, int]
Point = tuple[float, float, float]

WHITE: Color = (228, 231, 236)
GREY: Color = (120, 126, 136)
DARK: Color = (44, 50, 62)
RED: Color = (214, 58, 52)
GREEN: Color = (44, 168, 92)
ORANGE: Color = (240, 140, 40)
BLUE: Color = (86, 156, 232)


@dataclass(frozen=True)
class Mesh:
    """Triangles with one normal and colour each, so faces look flat.

    Parameters
    ----------
    vertices : array (3 n, 3)
        Corners, three to a triangle, body axes [m].
    normals : array (3 n, 3)
        Outward unit normals.
    colors : uint8 array (3 n, 3)
    size : float
        Greatest extent [m].
    """

    vertices: NDArray[np.float32]
    normals: NDArray[np.float32]
    colors: NDArray[np.uint8]
    size: float

    def scaled(self, factor: float) -> 'Mesh':
        """Return the mesh `factor` times as large."""
        return Mesh(
            (self.vertices * factor).astype(np.float32),
            self.normals,
            self.colors,
            self.size * factor,
        )


def mesh_for(vehicle: str, *, scene_size: float = np.inf) -> Mesh:
    """Return the shape to draw for a vehicle, by its name.

    Parameters
    ----------
    vehicle : str
        A name that contains 'quad' or 'drone' (0.1 m between rotors), 'glider' or 'discus'
        (15 m span), 'cessna' (10.2 m span), 'rocket' (70 m long) or 'balloon' (0.25 m). Any
        other is an aeroplane of 11 m span.
    scene_size : float
        Extent of the flight [m]: an aeroplane nobody named is made to fit it.
    """
    name = vehicle.lower()
    if 'quad' in name or 'drone' in name or 'copter' in name:
        return quadcopter()
    if 'glider' in name or 'discus' in name or 'sailplane' in name:
        return glider()
    if 'rocket' in name:
        return rocket()
    if 'balloon' in name:
        return balloon()
    if 'cessna' in name:
        return aeroplane(10.2)
    shape = aeroplane(11.0)
    return shape.scaled(min(1.0, max(0.05 * scene_size, 0.1) / shape.size))


@cache
def quadcopter(width: float = 0.1) -> Mesh:
    """Return a quadcopter with its rotors at x_b = y_b = +-width / 2."""
    half = width / 2
    parts = [
        _box((0, 0, 0), (0.7 * half, 0.44 * half, 0.2 * half), DARK),
        _box((0.34 * half, 0, -0.02 * half), (0.16 * half, 0.3 * half, 0.12 * half), WHITE),
    ]
    for x in (-1, 1):
        for y in (-1, 1):
            hub = np.array([x * half, y * half, 0.0])
            parts.append(_bar((0, 0, 0), hub, 0.1 * half, GREY))
            parts.append(_disc(hub - [0, 0, 0.09 * half], 0.12 * half, 0.22 * half, DARK))
            color = ORANGE if x > 0 else BLUE
            parts.append(_disc(hub - [0, 0, 0.22 * half], 0.62 * half, 0.03 * half, color))
    return _join(parts)


@cache
def glider(span: float = 15.0) -> Mesh:
    """Return a sailplane: slender wing with dihedral, T-tail."""
    half = span / 2
    parts = [
        _body(
            [(3.1, 0.02), (2.6, 0.22), (1.6, 0.36), (0.4, 0.36), (-0.8, 0.2), (-3.8, 0.09)],
            WHITE, width=0.85,
        ).shift((0, 0, 0.1)),
        _body([(2.3, 0.05), (1.7, 0.2), (0.7, 0.19), (0.2, 0.05)], DARK).shift((0, 0, -0.14)),
        _wing((-3.6, 0, -1.18), (-3.75, 1.25, -1.18), 0.5, 0.3, 0.05, WHITE),
        _wing((-3.6, 0, -1.18), (-3.75, -1.25, -1.18), 0.5, 0.3, 0.05, WHITE),
        _fin((-3.3, 0, 0.1), (-3.6, 0, -1.2), 0.85, 0.55, 0.08, WHITE),
    ]  # fmt: skip
    scale = 7.5
    for side, color in ((1, GREEN), (-1, RED)):
        inner = (0.35, 0.0, -0.12), (0.28, side * 6.4 * 1.0, -0.42)
        parts.append(_wing(*inner, 0.95, 0.55, 0.13, WHITE))
        parts.append(_wing(inner[1], (0.1, side * scale, -0.56), 0.55, 0.28, 0.06, color))
    return _join(parts).scaled(half / scale)


@cache
def aeroplane(span: float = 11.0) -> Mesh:
    """Return a high-wing single-engined aeroplane."""
    parts = [
        _body(
            [(2.3, 0.12), (2.2, 0.38), (1.2, 0.55), (-0.6, 0.58), (-2.2, 0.28), (-4.4, 0.1)],
            WHITE, width=0.85,
        ),
        _body([(1.15, 0.2), (0.7, 0.45), (-0.5, 0.45), (-1.1, 0.2)], DARK, width=0.95)
        .shift((0, 0, -0.3)),
        _disc((2.38, 0, 0), 0.95, 0.03, GREY, axis=0),
        _disc((2.45, 0, 0), 0.16, 0.25, RED, axis=0),
        _wing((-4.0, 0, -0.1), (-4.15, 1.7, -0.1), 0.95, 0.65, 0.08, WHITE),
        _wing((-4.0, 0, -0.1), (-4.15, -1.7, -0.1), 0.95, 0.65, 0.08, WHITE),
        _fin((-3.75, 0, 0.0), (-4.5, 0, -1.5), 1.2, 0.6, 0.09, WHITE),
    ]  # fmt: skip
    for side, color in ((1, GREEN), (-1, RED)):
        inner = (0.55, 0.0, -0.72), (0.5, side * 4.4, -0.84)
        parts.append(_wing(*inner, 1.6, 1.3, 0.2, WHITE))
        parts.append(_wing(inner[1], (0.45, side * 5.5, -0.88), 1.3, 1.1, 0.14, color))
        parts.append(_bar((0.3, side * 0.45, 0.35), (0.45, side * 2.3, -0.76), 0.07, GREY))
        parts.append(_bar((0.1, side * 0.4, 0.4), (0.0, side * 1.1, 0.95), 0.09, GREY))
        parts.append(_disc((0.0, side * 1.15, 0.98), 0.24, 0.14, DARK, axis=1))
    return _join(parts).scaled(span / 11.0)


@cache
def rocket(length: float = 70.0) -> Mesh:
    """Return a rocket; its nose is forward."""
    body = [(0.5, 0.001), (0.45, 0.016), (0.38, 0.026), (-0.42, 0.026), (-0.5, 0.034)]
    parts = [_body(body, WHITE), _disc((-0.25, 0, 0), 0.027, 0.04, DARK, axis=0)]
    for corner, color in (((0, 1), GREEN), ((0, -1), RED), ((1, 0), DARK), ((-1, 0), DARK)):
        tip = (-0.47, 0.085 * corner[1], 0.085 * corner[0])
        part = _wing if corner[0] == 0 else _fin
        parts.append(part((-0.42, 0, 0), tip, 0.12, 0.05, 0.006, color))
    return _join(parts).scaled(length)


@cache
def balloon(diameter: float = 0.25) -> Mesh:
    """Return a balloon: it looks the same from every side but for its red half."""
    angle = np.linspace(0, np.pi, 10)
    rings = [(float(np.cos(a)) / 2, max(float(np.sin(a)) / 2, 0.01)) for a in angle]
    mesh = _join([_body(rings[:5], RED), _body(rings[4:], WHITE)])
    return mesh.scaled(diameter)


@dataclass(frozen=True)
class _Part:
    """A convex solid: corners (m, 3), triangles (n, 3) in any winding, one colour."""

    points: Array
    triangles: NDArray[np.int64]
    color: Color

    def shift(self, by: Point) -> '_Part':
        return _Part(self.points + by, self.triangles, self.color)


def _join(parts: list[_Part]) -> Mesh:
    vertices, normals, colors = [], [], []
    for part in parts:
        faces = part.points[part.triangles]  # (n, 3, 3)
        normal = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
        length = np.linalg.norm(normal, axis=1)
        keep = length > 1e-12 * length.max()
        faces, normal = faces[keep], normal[keep] / length[keep, None]
        # Parts are convex: whatever points to the middle points inwards.
        inward = np.einsum('ij,ij->i', normal, faces.mean(axis=1) - part.points.mean(axis=0)) < 0
        faces[inward] = faces[inward][:, ::-1]
        normal[inward] *= -1
        vertices.append(faces.reshape(-1, 3))
        normals.append(np.repeat(normal, 3, axis=0))
        colors.append(np.tile(np.array(part.color, np.uint8), (3 * len(faces), 1)))
    points = np.concatenate(vertices)
    return Mesh(
        points.astype(np.float32),
        np.concatenate(normals).astype(np.float32),
        np.concatenate(colors),
        float(np.ptp(points, axis=0).max()),
    )


def _loft(rings: list[Array], color: Color) -> _Part:
    """Join rings of equally many corners and close both ends."""
    k = len(rings[0])
    triangles = []
    for i in range(len(rings) - 1):
        for j in range(k):
            a, b = i * k + j, i * k + (j + 1) % k
            triangles += [(a, b, a + k), (b, b + k, a + k)]
    for base in (0, (len(rings) - 1) * k):
        triangles += [(base, base + j, base + j + 1) for j in range(1, k - 1)]
    return _Part(np.concatenate(rings), np.array(triangles), color)


def _box(center: Point, size: Point, color: Color) -> _Part:
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) / 2
    rings = [
        np.column_stack([np.full(4, x), corners * size[1:]]) + center
        for x in (-size[0] / 2, size[0] / 2)
    ]
    return _loft(rings, color)


def _bar(start: Point, end: Point | Array,
         thickness: float, color: Color) -> _Part:  # fmt: skip
    a, b = np.asarray(start, float), np.asarray(end, float)
    along = (b - a) / np.linalg.norm(b - a)
    side = np.cross(along, (0, 0, 1) if abs(along[2]) < 0.9 else (1, 0, 0))
    side /= np.linalg.norm(side)
    up = np.cross(side, along)
    around = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    corners = [(side * i + up * j) * thickness / 2 for i, j in around]
    return _loft([a + corners, b + corners], color)


def _disc(center: Point | Array, radius: float, height: float, color: Color,
          axis: int = 2) -> _Part:  # fmt: skip
    angle = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    rings = []
    for h in (-height / 2, height / 2):
        ring = np.column_stack([np.cos(angle) * radius, np.sin(angle) * radius, np.full(20, h)])
        rings.append(np.roll(ring, axis + 1, axis=1) + center)
    return _loft(rings, color)


def _body(stations: list[tuple[float, float]], color: Color, *, width: float = 1.0) -> _Part:
    """Return a body of revolution: (x, radius) from the nose back; `width` narrows it sideways."""
    angle = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    rings = [
        np.column_stack([np.full(12, x), width * r * np.cos(angle), r * np.sin(angle)])
        for x, r in stations
    ]
    return _loft(rings, color)


def _wing(root: Point, tip: Point, chord_root: float,
          chord_tip: float, thickness: float, color: Color) -> _Part:  # fmt: skip
    """Return a panel; `root` and `tip` are at a third of the chord, the section is a diamond."""
    section = np.array([(0.33, 0, 0), (0, 0, -0.5), (-0.67, 0, 0), (0, 0, 0.5)])
    rings = [
        np.asarray(at) + section * (chord, 0, thickness)
        for at, chord in ((root, chord_root), (tip, chord_tip))
    ]
    return _loft(rings, color)


def _fin(root: Point, tip: Point, chord_root: float,
         chord_tip: float, thickness: float, color: Color) -> _Part:  # fmt: skip
    section = np.array([(0.33, 0, 0), (0, -0.5, 0), (-0.67, 0, 0), (0, 0.5, 0)])
    rings = [
        np.asarray(at) + section * (chord, thickness, 0)
        for at, chord in ((root, chord_root), (tip, chord_tip))
    ]
    return _loft(rings, color)
