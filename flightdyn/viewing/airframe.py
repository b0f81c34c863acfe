"""The mesh of an aeroplane whose wings and fuselages are in its vehicle's file."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..frames import body_from_geometry
from .solids import GREEN, GREY, RED, WHITE, Color, Mesh, Part, join, loft

Array = NDArray[np.float64]

_SIDES = 12  # of a fuselage's cross section
_TIP = 0.12  # of the span, coloured
_THICKNESS = 0.12  # of the chord, where no NACA number tells

# a section's outline: chordwise place, and share of half the thickness
_OUTLINE = np.array(
    [(0.0, 0.0), (0.1, 0.8), (0.3, 1.0), (0.65, 0.62), (1.0, 0.02),
     (1.0, -0.02), (0.65, -0.4), (0.3, -0.7), (0.1, -0.65)]
)  # fmt: skip


def airframe(geometry: Mapping[str, Any]) -> Mesh:
    """Return the mesh of a geometry of kind `airplane`, see `vehicles.geometry`.

    The tips of the first wing are green to starboard and red to port. The body's origin is put
    below the quarter chord of the first wing's root, about where the centre of gravity is.
    """
    parts: list[Part] = []
    for number, each in enumerate(geometry['wings']):
        parts += _wing(each, tips=number == 0)
    for each in geometry.get('fuselages', []):
        parts += _fuselage(each)
    first = geometry['wings'][0]
    root = first['sections'][0]
    origin = np.array(first.get('origin', (0, 0, 0)), float) + np.array(root['le'], float)
    origin[0] += 0.25 * float(root['chord'])
    origin[2] = 0.0
    x, y, z = _body(-origin[None])[0].tolist()
    return join([part.shift((x, y, z)) for part in parts])


def _wing(wing: Mapping[str, Any], *, tips: bool) -> list[Part]:
    origin = np.array(wing.get('origin', (0, 0, 0)), float)
    rings = [_section(section, origin) for section in wing['sections']]
    parts: list[Part] = []
    for side in (1.0, -1.0) if wing.get('symmetric', False) else (1.0,):
        turned = [ring * (1.0, side, 1.0) for ring in rings]
        for number, (inner, outer) in enumerate(pairwise(turned)):
            pieces: list[tuple[Array, Array, Color]] = [(inner, outer, WHITE)]
            if tips and number == len(turned) - 2:
                length = np.ptp([r[:, 1].mean() for r in turned])
                panel = abs(outer[:, 1].mean() - inner[:, 1].mean())
                share = max(0.0, 1 - _TIP * length / max(panel, 1e-9))
                cut = inner + share * (outer - inner)
                color = GREEN if side > 0 else RED
                pieces = [(inner, cut, WHITE), (cut, outer, color)]
            parts += [loft([_body(a), _body(b)], color) for a, b, color in pieces]
    return parts


def _section(section: Mapping[str, Any], origin: Array) -> Array:
    """Return a wing section's outline in geometry axes (9, 3): x aft, y right, z up."""
    chord = float(section['chord'])
    digits = str(section.get('airfoil', ''))[-2:]
    thickness = int(digits) / 100 if digits.isdecimal() and int(digits) else _THICKNESS
    x = _OUTLINE[:, 0] * chord
    z = _OUTLINE[:, 1] * thickness * chord / 2
    outline: Array = np.column_stack([x, np.zeros(len(x)), z])
    outline += np.array(section['le'], float) + origin
    return outline


def _fuselage(fuselage: Mapping[str, Any]) -> list[Part]:
    origin = np.array(fuselage.get('origin', (0, 0, 0)), float)
    angle = np.linspace(0, 2 * np.pi, _SIDES, endpoint=False) + np.pi / _SIDES
    rings = []
    for section in fuselage['sections']:
        radius, power = max(float(section['radius']), 1e-3), float(section.get('shape', 2))
        # a superellipse: |y|^power + |z|^power = radius^power
        reach = (np.abs(np.cos(angle)) ** power + np.abs(np.sin(angle)) ** power) ** (-1 / power)
        y, z = radius * reach * np.cos(angle), radius * reach * np.sin(angle)
        ring = np.column_stack([np.zeros(_SIDES), y, z])
        rings.append(_body(ring + np.array(section['centre'], float) + origin))
    colors = [GREY, *[WHITE] * len(rings)]  # the nose is dark: it tells where it flies to
    return [loft([a, b], color) for (a, b), color in zip(pairwise(rings), colors, strict=False)]


def _body(points: Array) -> Array:
    x, y, z = points.T
    turned: Array = np.column_stack(body_from_geometry((x, y, z)))
    return turned
