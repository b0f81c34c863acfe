"""A balloon that stretches freely: buoyancy, and the drag of a sphere."""

from dataclasses import dataclass
from math import pi

from ..dynamics import Dynamics
from ..environment.atmosphere import (
    PRESSURE_SEA_LEVEL,
    TEMPERATURE_SEA_LEVEL,
    Atmosphere,
    gas_constant_universal,
)
from ..numpy import Vectorizable
from .aerodynamics import Aerodynamics, Values
from .fields import Context, Fields

KEYS = ('kind', 'diameter', 'gas', 'drag_coefficient')

MOLAR_MASS = {'helium': 4.002602e-3, 'hydrogen': 2.016e-3}
"""kg/mol; standard atomic weights of IUPAC, 2021."""


@dataclass(frozen=True, kw_only=True)
class Balloon(Aerodynamics):
    """A sphere of gas at the pressure and temperature of the air around it.

    Parameters
    ----------
    diameter : float [m]
        At sea level of the standard atmosphere.
    gas : str
        One of `MOLAR_MASS`.
    drag_coefficient : float
        On the sphere's cross-section.
    gravity : float [m/s^2]
    """

    diameter: float
    gas: str = 'helium'
    drag_coefficient: float = 0.4
    gravity: float

    @property
    def added_mass(self) -> float:
        """Mass of the gas [kg]."""
        volume = pi / 6 * self.diameter**3
        amount = PRESSURE_SEA_LEVEL * volume / (gas_constant_universal * TEMPERATURE_SEA_LEVEL)
        return amount * MOLAR_MASS[self.gas]

    def volume(self, atmosphere: Atmosphere) -> Vectorizable:
        """Return the volume [m^3] in given air."""
        amount = self.added_mass / MOLAR_MASS[self.gas]
        return amount * gas_constant_universal * atmosphere.temperature() / atmosphere.pressure()

    def attach(self, dyn: Dynamics, controls: Values) -> dict[str, Vectorizable]:
        """Add buoyancy and drag; return both [N], and the radius [m], by name."""
        air = dyn.op_point.atmosphere
        volume = self.volume(air)
        radius = (0.75 / pi * volume) ** (1 / 3)
        buoyancy = volume * air.density() * self.gravity
        dyn.add_force(Fz=-buoyancy, axes='earth')
        # by components, because at rest there is no direction of the wind to push along
        per_speed = 0.5 * air.density() * dyn.airspeed * self.drag_coefficient * pi * radius**2
        u, v, w = dyn.air_velocity_earth
        dyn.add_force(-per_speed * u, -per_speed * v, -per_speed * w, axes='earth')
        return {'buoyancy': buoyancy, 'drag': per_speed * dyn.airspeed, 'radius': radius}


def read_balloon(fields: Fields, context: Context) -> Balloon:
    """Return the balloon that a vehicle's file describes.

    Raises
    ------
    InputError
        If a key is missing or wrong.
    """
    return Balloon(
        diameter=fields.positive('diameter'),
        gas=fields.choice('gas', MOLAR_MASS, 'helium'),
        drag_coefficient=fields.positive('drag_coefficient', 0.4),
        gravity=context.gravity,
    )
