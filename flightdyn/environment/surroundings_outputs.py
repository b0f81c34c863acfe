"""What stands around a flight as numbers along it: outputs of the stage, for planners to bound."""

from collections.abc import Mapping

from .. import numpy as np
from ..frames import Vector, backward, turn, turn_z
from ..numpy import Vectorizable
from .clearance import clearance
from .noise import received_level
from .surroundings import Gate, Surroundings
from .terrain_spline import spline_through

SOURCE_LEVEL = 'source_level'
"""The output of a vehicle that listeners hear: its sound pressure level at 1 m [dB]."""

TERRAIN = 'height_above_terrain'

GATE_OUTPUTS = ('along', 'aside', 'above', 'through')
"""Of each gate: place from its centre on the way through it, to its right and up [m], and speed
on the way through it [m/s]."""


def surroundings_outputs(
    surroundings: Surroundings,
    position: Vector,
    velocity: Vector,
    source_level: Vectorizable | None = None,
) -> dict[str, Vectorizable]:
    """Return what there is to know of a place about its surroundings, by name.

    Parameters
    ----------
    position : x_e, y_e, z_e [m]
    velocity : u_e, v_e, w_e [m/s]
    source_level : Vectorizable or None
        Sound pressure level at 1 m from the vehicle [dB], see `noise`.

    Returns
    -------
    height_above_terrain [m]
    clearance_NAME [m]
        Of each volume to keep out of, see `clearance.clearance`.
    NAME_along, NAME_aside, NAME_above [m], NAME_through [m/s]
        Of each gate.
    level_NAME [dB]
        Sound pressure level at each listener, if there is a source level.
    """
    x, y, z = position
    found: dict[str, Vectorizable] = {}
    if surroundings.terrain is not None:
        found[TERRAIN] = -z - spline_through(surroundings.terrain).heights(x, y)
    for volume in surroundings.keep_out:
        found[f'clearance_{volume.name}'] = clearance(volume, x, y, -z)
    for gate in surroundings.gates:
        found |= _at_gate(gate, position, velocity)
    if source_level is not None:
        for mark in surroundings.listeners:
            distance = np.hypot(x - mark.place[0], y - mark.place[1], -z - mark.place[2])
            found[f'level_{mark.name}'] = received_level(source_level, distance)
    return found


def _at_gate(gate: Gate, position: Vector, velocity: Vector) -> Mapping[str, Vectorizable]:
    x, y, altitude = gate.centre
    off = position[0] - x, position[1] - y, 0.0
    back = backward(turn(gate.heading))
    along, aside, _ = turn_z(off, back)
    through, _, _ = turn_z((velocity[0], velocity[1], 0.0), back)
    values = (along, aside, -position[2] - altitude, through)
    return {f'{gate.name}_{name}': v for name, v in zip(GATE_OUTPUTS, values, strict=True)}
