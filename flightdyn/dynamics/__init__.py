"""The Dynamics family: equations of motion that forces are attached to in any axes."""

from .base import Dynamics as Dynamics
from .mass_properties import MassProperties as MassProperties
from .point_mass import DynamicsPointMass3DSpeedGammaTrack as DynamicsPointMass3DSpeedGammaTrack
from .rigid_body import DynamicsRigidBody2DBody as DynamicsRigidBody2DBody

FAMILY: dict[str, type[Dynamics]] = {
    cls.__name__: cls for cls in (DynamicsPointMass3DSpeedGammaTrack, DynamicsRigidBody2DBody)
}
"""Every class by name, in the order users see."""
