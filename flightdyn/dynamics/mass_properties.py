"""Mass and inertia of a rigid vehicle."""

from dataclasses import dataclass

from ..numpy import Vectorizable


@dataclass(frozen=True)
class MassProperties:
    """Mass [kg] and inertia tensor about the centre of gravity in body axes [kg m^2].

    The products are tensor elements: Ixy = -sum(m x y). Point masses use the mass alone.
    """

    mass: Vectorizable
    Ixx: Vectorizable = 0.0
    Iyy: Vectorizable = 0.0
    Izz: Vectorizable = 0.0
    Ixy: Vectorizable = 0.0
    Iyz: Vectorizable = 0.0
    Ixz: Vectorizable = 0.0
