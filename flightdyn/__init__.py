"""Flight dynamics: write the equations of motion once, then plan, simulate, replay and verify."""

from .dynamics import Dynamics as Dynamics
from .dynamics import DynamicsPointMass3DSpeedGammaTrack as DynamicsPointMass3DSpeedGammaTrack
from .dynamics import DynamicsRigidBody2DBody as DynamicsRigidBody2DBody
from .dynamics import MassProperties as MassProperties
from .errors import FlightdynError as FlightdynError
from .trajectory import Trajectory as Trajectory
