"""The Dynamics family: equations of motion that forces are attached to in any axes."""

from .base import Dynamics as Dynamics
from .mass_properties import MassProperties as MassProperties
from .operating_point import OperatingPoint as OperatingPoint
from .point_mass import DynamicsPointMass1DHorizontal as DynamicsPointMass1DHorizontal
from .point_mass import DynamicsPointMass1DVertical as DynamicsPointMass1DVertical
from .point_mass import DynamicsPointMass2DCartesian as DynamicsPointMass2DCartesian
from .point_mass import DynamicsPointMass2DSpeedGamma as DynamicsPointMass2DSpeedGamma
from .point_mass import DynamicsPointMass3DCartesian as DynamicsPointMass3DCartesian
from .point_mass import DynamicsPointMass3DSpeedGammaTrack as DynamicsPointMass3DSpeedGammaTrack
from .rigid_body import DynamicsRigidBody2DBody as DynamicsRigidBody2DBody
from .rigid_body import DynamicsRigidBody3DBodyEuler as DynamicsRigidBody3DBodyEuler
from .rigid_body import DynamicsRigidBody3DBodyQuaternion as DynamicsRigidBody3DBodyQuaternion

FAMILY: dict[str, type[Dynamics]] = {
    cls.__name__: cls
    for cls in (
        DynamicsPointMass1DHorizontal,
        DynamicsPointMass1DVertical,
        DynamicsPointMass2DCartesian,
        DynamicsPointMass2DSpeedGamma,
        DynamicsPointMass3DCartesian,
        DynamicsPointMass3DSpeedGammaTrack,
        DynamicsRigidBody2DBody,
        DynamicsRigidBody3DBodyEuler,
        DynamicsRigidBody3DBodyQuaternion,
    )
}
"""Every class by name, in the order users see."""
