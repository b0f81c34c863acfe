"""Low-poly vehicles made by code, in body axes (forward, right, down) and metres.

Colours tell the sides apart: red is left (port), green is right (starboard), and a quadcopter's
forward rotors are orange.
"""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from .airframe import airframe
from .kinematics import Motion
from .mesh_files import MeshFile, read_glb, read_stl
from .solids import (
    BLUE,
    DARK,
    GREEN,
    GREY,
    ORANGE,
    RED,
    WHITE,
    Mesh,
    bar,
    body,
    box,
    disc,
    fin,
    join,
    wing,
)  # fmt: skip


def mesh_for(
    vehicle: str,
    *,
    geometry: Mapping[str, Any] | None = None,
    motion: Motion | None = None,
) -> Mesh | MeshFile:
    """Return the shape to draw for a vehicle: by its geometry, its name, or how it moves.

    Parameters
    ----------
    vehicle : str
        A name that contains 'quad' or 'drone' (0.1 m between rotors), 'paraglid' (11 m span),
        'glider', 'soar' or 'discus' (15 m), 'cessna' (10.2 m), 'plane' (11 m), 'rocket' (70 m
        long) or 'balloon' (0.25 m).
    geometry : mapping
        As `vehicles.geometry` reads it.
    motion : Motion
        Of a vehicle that has neither: what hovers is a quadcopter of 0.5 m, what flies faster
        than 110 m/s an airliner of 35 m span, any other an aeroplane of 11 m; each is made to fit
        the extent of its flight.

    Raises
    ------
    InputError
        If a mesh's file is not what its suffix says.
    """
    if geometry:
        kind = geometry['kind']
        if kind == 'mesh':
            path, scale = Path(geometry['file']), float(geometry['scale'])
            return (
                read_stl(path, scale) if path.suffix.lower() == '.stl' else read_glb(path, scale)
            )
        if kind == 'airplane':
            return airframe(geometry)
        if kind == 'rocket':
            return rocket(float(geometry['length']), float(geometry['diameter']))
        if kind == 'balloon':
            return balloon(float(geometry['diameter']))
        if kind == 'quadcopter':
            return quadcopter(float(geometry['width']))
    name = vehicle.lower()
    if 'quad' in name or 'drone' in name or 'copter' in name:
        return quadcopter()
    if 'paraglid' in name:
        return paraglider()
    if 'glider' in name or 'discus' in name or 'soar' in name or 'sailplane' in name:
        return glider()
    if 'rocket' in name:
        return rocket()
    if 'balloon' in name:
        return balloon()
    if 'cessna' in name:
        return aeroplane(10.2)
    if motion is None or 'plane' in name:
        return aeroplane(11.0)
    fast = float(np.quantile(motion.speed, 0.9)) > 110.0
    shape = quadcopter(0.5) if motion.hovers else airliner() if fast else aeroplane(11.0)
    return shape.scaled(min(1.0, max(0.05 * motion.size, 0.1) / shape.size))


@cache
def quadcopter(width: float = 0.1) -> Mesh:
    """Return a quadcopter with its rotors at x_b = y_b = +-width / 2."""
    half = width / 2
    parts = [
        box((0, 0, 0), (0.7 * half, 0.44 * half, 0.2 * half), DARK),
        box((0.34 * half, 0, -0.02 * half), (0.16 * half, 0.3 * half, 0.12 * half), WHITE),
    ]
    for x in (-1, 1):
        for y in (-1, 1):
            hub = np.array([x * half, y * half, 0.0])
            parts.append(bar((0, 0, 0), hub, 0.1 * half, GREY))
            parts.append(disc(hub - [0, 0, 0.09 * half], 0.12 * half, 0.22 * half, DARK))
            color = ORANGE if x > 0 else BLUE
            parts.append(disc(hub - [0, 0, 0.22 * half], 0.62 * half, 0.03 * half, color))
    return join(parts)


@cache
def glider(span: float = 15.0) -> Mesh:
    """Return a sailplane: slender wing with dihedral, T-tail."""
    half = span / 2
    parts = [
        body(
            [(3.1, 0.02), (2.6, 0.22), (1.6, 0.36), (0.4, 0.36), (-0.8, 0.2), (-3.8, 0.09)],
            WHITE, width=0.85,
        ).shift((0, 0, 0.1)),
        body([(2.3, 0.05), (1.7, 0.2), (0.7, 0.19), (0.2, 0.05)], DARK).shift((0, 0, -0.14)),
        wing((-3.6, 0, -1.18), (-3.75, 1.25, -1.18), 0.5, 0.3, 0.05, WHITE),
        wing((-3.6, 0, -1.18), (-3.75, -1.25, -1.18), 0.5, 0.3, 0.05, WHITE),
        fin((-3.3, 0, 0.1), (-3.6, 0, -1.2), 0.85, 0.55, 0.08, WHITE),
    ]  # fmt: skip
    scale = 7.5
    for side, color in ((1, GREEN), (-1, RED)):
        inner = (0.35, 0.0, -0.12), (0.28, side * 6.4 * 1.0, -0.42)
        parts.append(wing(*inner, 0.95, 0.55, 0.13, WHITE))
        parts.append(wing(inner[1], (0.1, side * scale, -0.56), 0.55, 0.28, 0.06, color))
    return join(parts).scaled(half / scale)


@cache
def paraglider() -> Mesh:
    """Return a paraglider of 11 m span and its pilot, the origin between them."""
    angle = np.linspace(-1.1, 1.1, 9)
    ribs = [(0.4, 6.2 * np.sin(a), 1.0 - 7.0 * np.cos(a)) for a in angle]
    chords = 2.6 * np.sqrt(1 - (angle / 1.35) ** 2)
    parts = [box((0.0, 0.0, 1.0), (0.4, 0.5, 1.1), DARK), disc((0.1, 0, 0.35), 0.14, 0.3, GREY)]
    for k in range(8):
        color = RED if k == 0 else GREEN if k == 7 else ORANGE if k % 2 else WHITE
        parts.append(wing(ribs[k], ribs[k + 1], chords[k], chords[k + 1], 0.3, color))
    for k in (1, 3, 5, 7):
        parts.append(bar((0.0, 0.0, 0.5), np.array(ribs[k]), 0.03, GREY))
    return join(parts)


@cache
def aeroplane(span: float = 11.0) -> Mesh:
    """Return a high-wing single-engined aeroplane."""
    parts = [
        body(
            [(2.3, 0.12), (2.2, 0.38), (1.2, 0.55), (-0.6, 0.58), (-2.2, 0.28), (-4.4, 0.1)],
            WHITE, width=0.85,
        ),
        body([(1.15, 0.2), (0.7, 0.45), (-0.5, 0.45), (-1.1, 0.2)], DARK, width=0.95)
        .shift((0, 0, -0.3)),
        disc((2.38, 0, 0), 0.95, 0.03, GREY, axis=0),
        disc((2.45, 0, 0), 0.16, 0.25, RED, axis=0),
        wing((-4.0, 0, -0.1), (-4.15, 1.7, -0.1), 0.95, 0.65, 0.08, WHITE),
        wing((-4.0, 0, -0.1), (-4.15, -1.7, -0.1), 0.95, 0.65, 0.08, WHITE),
        fin((-3.75, 0, 0.0), (-4.5, 0, -1.5), 1.2, 0.6, 0.09, WHITE),
    ]  # fmt: skip
    for side, color in ((1, GREEN), (-1, RED)):
        inner = (0.55, 0.0, -0.72), (0.5, side * 4.4, -0.84)
        parts.append(wing(*inner, 1.6, 1.3, 0.2, WHITE))
        parts.append(wing(inner[1], (0.45, side * 5.5, -0.88), 1.3, 1.1, 0.14, color))
        parts.append(bar((0.3, side * 0.45, 0.35), (0.45, side * 2.3, -0.76), 0.07, GREY))
        parts.append(bar((0.1, side * 0.4, 0.4), (0.0, side * 1.1, 0.95), 0.09, GREY))
        parts.append(disc((0.0, side * 1.15, 0.98), 0.24, 0.14, DARK, axis=1))
    return join(parts).scaled(span / 11.0)


@cache
def airliner() -> Mesh:
    """Return a twin-engined jet of 35 m span."""
    return airframe(
        {
            'wings': [
                {'symmetric': True, 'sections': [
                    {'le': (0, 0, -0.6), 'chord': 7.5},
                    {'le': (3.6, 6.0, -0.2), 'chord': 4.0},
                    {'le': (9.0, 17.5, 0.9), 'chord': 1.5},
                ]},
                {'symmetric': True, 'origin': (18.0, 0, 1.4), 'sections': [
                    {'le': (0, 0, 0), 'chord': 3.6}, {'le': (3.2, 6.2, 0.6), 'chord': 1.4},
                ]},
                {'origin': (16.0, 0, 1.8), 'sections': [
                    {'le': (0, 0, 0), 'chord': 5.4}, {'le': (4.6, 0.01, 5.6), 'chord': 1.9},
                ]},
            ],
            'fuselages': [
                {'sections': [
                    {'centre': (x, 0, z), 'radius': r} for x, z, r in (
                        (-14.0, -0.5, 0.1), (-12.6, -0.3, 1.2), (-10.0, 0, 1.95),
                        (11.0, 0, 1.95), (17.0, 0.6, 1.3), (22.0, 1.2, 0.3),
                    )
                ]},
                *(
                    {'origin': (0.2, side * 5.6, -1.9), 'sections': [
                        {'centre': (-1.6, 0, 0), 'radius': 0.95},
                        {'centre': (0.4, 0, 0), 'radius': 1.05},
                        {'centre': (2.6, 0, 0), 'radius': 0.6},
                    ]}
                    for side in (1, -1)
                ),
            ],
        }
    )  # fmt: skip


@cache
def rocket(length: float = 70.0, diameter: float = 3.7) -> Mesh:
    """Return a rocket; its nose is forward."""
    r = diameter / (2 * length)
    stations = [(0.5, 0.04 * r), (0.45, 0.6 * r), (0.38, r), (-0.42, r), (-0.5, 1.3 * r)]
    parts = [body(stations, WHITE), disc((-0.25, 0, 0), 1.04 * r, 0.04, DARK, axis=0)]
    for corner, color in (((0, 1), GREEN), ((0, -1), RED), ((1, 0), DARK), ((-1, 0), DARK)):
        tip = (-0.47, 3.2 * r * corner[1], 3.2 * r * corner[0])
        part = wing if corner[0] == 0 else fin
        parts.append(part((-0.42, 0, 0), tip, 0.12, 0.05, 0.006, color))
    return join(parts).scaled(length)


@cache
def balloon(diameter: float = 0.25) -> Mesh:
    """Return a balloon: it looks the same from every side but for its red half."""
    angle = np.linspace(0, np.pi, 10)
    rings = [(float(np.cos(a)) / 2, max(float(np.sin(a)) / 2, 0.01)) for a in angle]
    mesh = join([body(rings[:5], RED), body(rings[4:], WHITE)])
    return mesh.scaled(diameter)
