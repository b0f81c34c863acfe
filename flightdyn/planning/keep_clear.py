"""Conditions that surroundings put on a flight, and those that cannot be kept from the outset."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import product

import numpy as np

from ..environment.clearance import clearance
from ..environment.surroundings import Gate, Surroundings
from ..environment.surroundings_outputs import TERRAIN
from ..environment.terrain_spline import spline_through
from ..errors import InputError
from .phase import Bounds

OPENING = np.linspace(-0.5, 0.5, 5)  # of a gate: where it is tried
AXES = ('x_e', 'y_e', 'z_e')


def clear_bounds(surroundings: Surroundings) -> dict[str, tuple[float, float]]:
    """Return what holds all the way: over the terrain and its map, outside of volumes."""
    found = {f'clearance_{volume.name}': (0.0, np.inf) for volume in surroundings.keep_out}
    terrain = surroundings.terrain
    if terrain is not None:
        found[TERRAIN] = (terrain.clearance, np.inf)
        for axis, line in zip(AXES, (terrain.x, terrain.y), strict=False):
            found[axis] = (float(line[0]), float(line[-1]))
    return found


def check_surroundings(
    name: str, surroundings: Surroundings, ends: Mapping[str, Bounds], path: Bounds
) -> None:
    """Refuse places that flights cannot be at.

    Parameters
    ----------
    name : str
        Of the problem.
    ends : mapping of 'initial' and 'final' to bounds
    path : Bounds

    Raises
    ------
    InputError
        If the path's bounds or an end go off the map, or an end or a whole gate lies in what is
        to be kept clear of; the message names what conflicts.
    """
    for group, given in (*ends.items(), ('path', path)):
        _check_on_map(f'{name}: {group}', surroundings, given)
    for group, given in ends.items():
        fixed = [given.get(axis, (0.0, 1.0)) for axis in AXES]
        if all(lower == upper for lower, upper in fixed):
            x, y, z = (lower for lower, _ in fixed)
            for told in _in_the_way(surroundings, x, y, -z):
                raise InputError(f'{name}: {group}: the flight {_WORDS[group]} {told}')
    for gate in surroundings.gates:
        _check_within(f'{name}: gates.{gate.name}', list(_opening(gate)), path)
        tried = [list(_in_the_way(surroundings, *place)) for place in _opening(gate)]
        if all(tried):
            middle = tried[len(tried) // 2]
            raise InputError(
                f'{name}: gates.{gate.name}: cannot be flown through: its centre lies {middle[0]}'
            )


_WORDS = {'initial': 'begins', 'final': 'ends'}


def _check_on_map(where: str, surroundings: Surroundings, given: Bounds) -> None:
    terrain = surroundings.terrain
    if terrain is None:
        return
    for axis, line in zip(AXES, (terrain.x, terrain.y), strict=False):
        for value in given.get(axis, ()):
            if np.isfinite(value) and not line[0] <= value <= line[-1]:
                raise InputError(
                    f'{where}.{axis}: {value:g} m is off the map of the terrain, which goes from '
                    f'{line[0]:g} to {line[-1]:g} m: take a larger map, or fly within it'
                )


def _check_within(where: str, opening: Sequence[tuple[float, float, float]], path: Bounds) -> None:
    for axis, values in zip(AXES, np.transpose(opening), strict=True):
        lower, upper = path.get(axis, (-np.inf, np.inf))
        told = axis
        if axis == 'z_e':
            lower, upper, told = 0.0 - upper, 0.0 - lower, 'altitude'
        if values.max() < lower or values.min() > upper:
            raise InputError(
                f'{where}: cannot be flown through: {told} in it is {values.min():g} to '
                f'{values.max():g} m, path.{told} allows {lower:g} to {upper:g} m'
            )


def _in_the_way(surroundings: Surroundings, x: float, y: float, altitude: float) -> Iterator[str]:
    """Give words for each thing that a place is too near to."""
    terrain = surroundings.terrain
    if terrain is not None:
        ground = float(spline_through(terrain).heights(x, y))
        if altitude - ground < terrain.clearance - 1e-6:
            yield (
                f'{altitude - ground:.4g} m above the terrain ({ground:.4g} m there), whose '
                f'clearance is {terrain.clearance:g} m'
            )
    for volume in surroundings.keep_out:
        inside = -float(clearance(volume, x, y, altitude))
        if inside > 1e-6:
            yield f"{inside:.4g} m inside keep_out '{volume.name}'"


def _opening(gate: Gate) -> Iterator[tuple[float, float, float]]:
    """Give places all over a gate's opening, its centre in the middle."""
    x, y, altitude = gate.centre
    for right, up in product(OPENING * gate.width, OPENING * gate.height):
        yield (
            x - right * np.sin(gate.heading),
            y + right * np.cos(gate.heading),
            altitude + up,
        )
