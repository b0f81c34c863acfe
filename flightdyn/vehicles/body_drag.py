"""Drag along body axes: of bodies and rotors that fly in any direction, such as multirotors."""

from dataclasses import dataclass

from .. import numpy as np
from ..dynamics import Dynamics
from ..dynamics.rigid_body import RigidBody
from ..errors import InputError
from ..numpy import Vectorizable
from .aerodynamics import Aerodynamics, Values
from .fields import Context, Fields

KEYS = ('kind', 'linear', 'areas')

Triple = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class BodyDrag(Aerodynamics):
    """Drag along each body axis against the velocity through the air along it.

    Parameters
    ----------
    linear : x, y, z [N s/m]
        Force over velocity: of rotors, whose blades meet more air on the side that advances.
    areas : x, y, z [m^2]
        Drag areas: force over dynamic pressure at the whole airspeed, shared out by the
        velocity's direction.

    References
    ----------
    .. [1] Faessler, Franchi, Scaramuzza, "Differential flatness of quadrotor dynamics subject to
       rotor drag for accurate tracking of high-speed trajectories", IEEE Robotics and Automation
       Letters 3 (2), 2018 (the linear part).
    """

    linear: Triple = (0.0, 0.0, 0.0)
    areas: Triple = (0.0, 0.0, 0.0)

    def attach(self, dyn: Dynamics, controls: Values) -> dict[str, Vectorizable]:
        """Add the drag; return its size [N] by name."""
        if isinstance(dyn, RigidBody):
            velocity = dyn.air_velocity_body
        else:
            velocity = dyn.convert_axes(*dyn.air_velocity_earth, 'earth', 'body')
        half = 0.0
        if any(self.areas):
            half = 0.5 * dyn.op_point.atmosphere.density() * dyn.airspeed
        x, y, z = (
            -(linear + half * area) * v
            for linear, area, v in zip(self.linear, self.areas, velocity, strict=True)
        )
        dyn.add_force(x, y, z, axes='body')
        return {'drag': np.hypot(x, y, z)}


def read_body_drag(fields: Fields, context: Context) -> BodyDrag:
    """Return the drag that a vehicle's file describes.

    Raises
    ------
    InputError
        If neither key is there, or a number is negative.
    """
    if 'linear' not in fields and 'areas' not in fields:
        raise InputError(f"{fields.where}: give 'linear', 'areas' or both")
    found = {key: fields.vector(key, [0.0, 0.0, 0.0]) for key in ('linear', 'areas')}
    for key, values in found.items():
        if min(values) < 0:
            raise InputError(f'{fields.at(key)}: must not be negative, got {list(values)}')
    return BodyDrag(**found)
