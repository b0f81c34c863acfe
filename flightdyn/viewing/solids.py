"""Solids that low-poly vehicles are made of, in body axes (forward, right, down) and metres."""

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
BALL: Color = (150, 190, 255)
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


@dataclass(frozen=True)
class Part:
    """A convex solid: corners (m, 3), triangles (n, 3) in any winding, one colour."""

    points: Array
    triangles: NDArray[np.int64]
    color: Color

    def shift(self, by: Point) -> 'Part':
        return Part(self.points + by, self.triangles, self.color)


def join(parts: list[Part]) -> Mesh:
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


def loft(rings: list[Array], color: Color) -> Part:
    """Join rings of equally many corners and close both ends."""
    k = len(rings[0])
    triangles = []
    for i in range(len(rings) - 1):
        for j in range(k):
            a, b = i * k + j, i * k + (j + 1) % k
            triangles += [(a, b, a + k), (b, b + k, a + k)]
    for base in (0, (len(rings) - 1) * k):
        triangles += [(base, base + j, base + j + 1) for j in range(1, k - 1)]
    return Part(np.concatenate(rings), np.array(triangles), color)


def box(center: Point, size: Point, color: Color) -> Part:
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) / 2
    rings = [
        np.column_stack([np.full(4, x), corners * size[1:]]) + center
        for x in (-size[0] / 2, size[0] / 2)
    ]
    return loft(rings, color)


def bar(start: Point, end: Point | Array,
         thickness: float, color: Color) -> Part:  # fmt: skip
    a, b = np.asarray(start, float), np.asarray(end, float)
    along = (b - a) / np.linalg.norm(b - a)
    side = np.cross(along, (0, 0, 1) if abs(along[2]) < 0.9 else (1, 0, 0))
    side /= np.linalg.norm(side)
    up = np.cross(side, along)
    around = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    corners = [(side * i + up * j) * thickness / 2 for i, j in around]
    return loft([a + corners, b + corners], color)


def disc(center: Point | Array, radius: float, height: float, color: Color,
          axis: int = 2) -> Part:  # fmt: skip
    angle = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    rings = []
    for h in (-height / 2, height / 2):
        ring = np.column_stack([np.cos(angle) * radius, np.sin(angle) * radius, np.full(20, h)])
        rings.append(np.roll(ring, axis + 1, axis=1) + center)
    return loft(rings, color)


def body(stations: list[tuple[float, float]], color: Color, *, width: float = 1.0) -> Part:
    """Return a body of revolution: (x, radius) from the nose back; `width` narrows it sideways."""
    angle = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    rings = [
        np.column_stack([np.full(12, x), width * r * np.cos(angle), r * np.sin(angle)])
        for x, r in stations
    ]
    return loft(rings, color)


def wing(root: Point, tip: Point, chord_root: float,
          chord_tip: float, thickness: float, color: Color) -> Part:  # fmt: skip
    """Return a panel; `root` and `tip` are at a third of the chord, the section is a diamond."""
    section = np.array([(0.33, 0, 0), (0, 0, -0.5), (-0.67, 0, 0), (0, 0, 0.5)])
    rings = [
        np.asarray(at) + section * (chord, 0, thickness)
        for at, chord in ((root, chord_root), (tip, chord_tip))
    ]
    return loft(rings, color)


def fin(root: Point, tip: Point, chord_root: float,
         chord_tip: float, thickness: float, color: Color) -> Part:  # fmt: skip
    section = np.array([(0.33, 0, 0), (0, -0.5, 0), (-0.67, 0, 0), (0, 0.5, 0)])
    rings = [
        np.asarray(at) + section * (chord, thickness, 0)
        for at, chord in ((root, chord_root), (tip, chord_tip))
    ]
    return loft(rings, color)


@cache
def sphere() -> Mesh:
    """Return a ball of radius 1."""
    angle = np.linspace(0, np.pi, 13)
    rings = [(float(np.cos(a)), max(float(np.sin(a)), 0.01)) for a in angle]
    return join([body(rings, BALL)])
