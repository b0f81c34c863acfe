"""Flight dynamics: write the equations of motion once, then plan, simulate, replay and verify."""

from . import units as units
from .dynamics import Dynamics as Dynamics
from .dynamics import DynamicsPointMass1DHorizontal as DynamicsPointMass1DHorizontal
from .dynamics import DynamicsPointMass1DVertical as DynamicsPointMass1DVertical
from .dynamics import DynamicsPointMass2DCartesian as DynamicsPointMass2DCartesian
from .dynamics import DynamicsPointMass2DSpeedGamma as DynamicsPointMass2DSpeedGamma
from .dynamics import DynamicsPointMass3DCartesian as DynamicsPointMass3DCartesian
from .dynamics import DynamicsPointMass3DSpeedGammaTrack as DynamicsPointMass3DSpeedGammaTrack
from .dynamics import DynamicsRigidBody2DBody as DynamicsRigidBody2DBody
from .dynamics import DynamicsRigidBody3DBodyEuler as DynamicsRigidBody3DBodyEuler
from .dynamics import DynamicsRigidBody3DBodyQuaternion as DynamicsRigidBody3DBodyQuaternion
from .dynamics import MassProperties as MassProperties
from .dynamics import OperatingPoint as OperatingPoint
from .dynamics.mass_shapes import (
    mass_properties_from_radius_of_gyration as mass_properties_from_radius_of_gyration,
)
from .dynamics.mass_shapes import mass_properties_of_cube as mass_properties_of_cube
from .dynamics.mass_shapes import mass_properties_of_cylinder as mass_properties_of_cylinder
from .dynamics.mass_shapes import mass_properties_of_ellipsoid as mass_properties_of_ellipsoid
from .dynamics.mass_shapes import (
    mass_properties_of_rectangular_prism as mass_properties_of_rectangular_prism,
)
from .dynamics.mass_shapes import mass_properties_of_sphere as mass_properties_of_sphere
from .environment.atmosphere import Atmosphere as Atmosphere
from .environment.atmosphere import gas_constant_universal as gas_constant_universal
from .errors import FlightdynError as FlightdynError
from .planning.opti import Opti as Opti
from .planning.opti_solution import OptiSol as OptiSol
from .trajectory import Trajectory as Trajectory
