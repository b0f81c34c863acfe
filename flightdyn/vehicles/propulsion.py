"""Rotors and rockets: thrust from controls, and what it uses up."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import inf
from typing import Any

from ..dynamics import Dynamics, MassProperties
from ..environment.atmosphere import G0
from ..errors import InputError
from ..frames import cross
from ..numpy import Vectorizable
from .aerodynamics import Values
from .fields import Fields

Bounds = Mapping[str, tuple[float, float]]
Triple = tuple[float, float, float]

ROCKET_KEYS = (
    *('kind', 'thrust', 'specific_impulse', 'weight_acceleration', 'control', 'state'),
    *('propellant', 'direction', 'axes', 'position'),
)
MASS_STATES = ('mass', 'fuel')
"""Names of extra states that are the vehicle's mass, or a mass on board."""
_INERTIA = ('Ixx', 'Iyy', 'Izz', 'Ixy', 'Iyz', 'Ixz')


@dataclass(frozen=True)
class Mount:
    """Where thrust acts and which way.

    Parameters
    ----------
    direction : x, y, z
        Unit vector of the thrust.
    axes : str
        Of the direction: 'body', or 'earth' for vehicles that have no attitude.
    position : x, y, z [m]
        From the centre of gravity, body axes.
    """

    direction: Triple = (1.0, 0.0, 0.0)
    axes: str = 'body'
    position: Triple = (0.0, 0.0, 0.0)

    def push(self, dyn: Dynamics, thrust: Vectorizable, torque: Vectorizable = 0.0) -> None:
        """Add a thrust [N], and to rigid bodies its moment and a torque [N m] about it."""
        force = (
            self.direction[0] * thrust,
            self.direction[1] * thrust,
            self.direction[2] * thrust,
        )
        dyn.add_force(*force, axes=self.axes)
        if hasattr(dyn, 'add_moment'):
            dyn.add_moment(*cross(self.position, dyn.convert_axes(*force, self.axes, 'body')))
            dyn.add_moment(*(axis * torque for axis in self.direction), axes=self.axes)


MOUNT_KEYS = ('direction', 'axes', 'position')


FORWARD = Mount()


def read_mount(fields: Fields) -> Mount:
    """Return where thrust acts, by default forward at the centre of gravity."""
    return Mount(
        direction=fields.unit_vector('direction', [1.0, 0.0, 0.0]),
        axes=fields.choice('axes', ('body', 'earth'), 'body'),
        position=fields.vector('position', [0.0, 0.0, 0.0]),
    )


@dataclass(frozen=True)
class Rotor:
    """A rotor: where it pushes, which way, how hard it can.

    Parameters
    ----------
    position : x, y, z [m]
        From the centre of gravity, body axes.
    direction : x, y, z
        Unit vector of its thrust, body axes; up is (0, 0, -1).
    thrust : lower, upper [N]
    torque : float [m]
        Moment that the air's reaction puts on the vehicle about `direction`, over the thrust:
        positive for a rotor that itself turns the other way.
    """

    position: Triple
    direction: Triple
    thrust: tuple[float, float]
    torque: float = 0.0

    def push(self, dyn: Dynamics, thrust: Vectorizable) -> None:
        """Add a thrust [N], and to rigid bodies its moment and reaction."""
        mount = Mount(direction=self.direction, position=self.position)
        mount.push(dyn, thrust, self.torque * thrust if self.torque else 0.0)


def read_rotor(value: Any, where: str) -> Rotor:
    """Return the rotor that a mapping describes."""
    fields = Fields(value, ('position', 'direction', 'thrust', 'torque'), where)
    for key in ('position', 'direction', 'thrust'):
        fields.need(key)
    return Rotor(
        position=fields.vector('position'),
        direction=fields.unit_vector('direction'),
        thrust=fields.bounds('thrust'),
        torque=fields.number('torque', 0.0),
    )


class Propulsion(ABC):
    """Thrust under control."""

    @property
    @abstractmethod
    def controls(self) -> Bounds:
        """Controls with their limits, SI units."""

    @property
    def extra_states(self) -> Bounds:
        """States that are used up, with their limits, SI units."""
        return {}

    @property
    def mass_state(self) -> str | None:
        """The extra state that is a mass: 'mass' of the vehicle or 'fuel' on board, or none."""
        return next((name for name in MASS_STATES if name in self.extra_states), None)

    def mass_props(self, given: MassProperties, state: Values) -> MassProperties:
        """Return the mass properties with some used up.

        What is used up or carried has the shape of the rest: radii of gyration stay.
        """
        if self.mass_state is None:
            return given
        amount = state[self.mass_state]
        mass = amount if self.mass_state == 'mass' else given.mass + amount
        part = mass / given.mass
        inertia = {name: getattr(given, name) * part for name in _INERTIA if getattr(given, name)}
        return replace(given, mass=mass, **inertia)

    @abstractmethod
    def attach(self, dyn: Dynamics, controls: Values) -> dict[str, Vectorizable]:
        """Add the thrust; return the rates of the extra states and what else is known."""


@dataclass(frozen=True, kw_only=True)
class Rocket(Propulsion):
    """A rocket engine of constant specific impulse.

    Parameters
    ----------
    thrust : lower, upper [N]
    specific_impulse : float [s]
        Of `weight_acceleration` x mass flow per thrust.
    weight_acceleration : float [m/s^2]
        That the specific impulse is counted in.
    control : str
        'thrust' [N], or 'throttle' for a part of the largest.
    state : str
        'mass' for the vehicle's, whose file then has the one at the start, or 'fuel' for the
        propellant, whose file then has the mass without.
    propellant : float [kg]
    """

    thrust: tuple[float, float]
    specific_impulse: float
    weight_acceleration: float = G0
    control: str = 'thrust'
    state: str = 'mass'
    least: float
    most: float
    mount: Mount = FORWARD

    @property
    def controls(self) -> Bounds:
        lower, upper = self.thrust
        return {self.control: self.thrust if self.control == 'thrust' else (lower / upper, 1.0)}

    @property
    def extra_states(self) -> Bounds:
        return {self.state: (self.least, self.most)}

    def attach(self, dyn: Dynamics, controls: Values) -> dict[str, Vectorizable]:
        """Add the thrust; return it, the mass flow [kg/s] and the state's rate by name."""
        thrust = controls[self.control]
        if self.control != 'thrust':
            thrust = thrust * self.thrust[1]
        self.mount.push(dyn, thrust)
        flow = thrust / (self.specific_impulse * self.weight_acceleration)
        return {self.state: -flow, 'thrust': thrust, 'fuel_flow': flow}


def read_rocket(fields: Fields, mass: float) -> Rocket:
    """Return the rocket engine that a vehicle's file describes.

    Raises
    ------
    InputError
        If a key is missing or wrong.
    """
    thrust = fields.bounds('thrust')
    if thrust[0] < 0:
        raise InputError(f'{fields.at("thrust")}: must not be negative, got {thrust[0]:g}')
    control = fields.choice('control', ('thrust', 'throttle'), 'thrust')
    if control == 'throttle' and not 0 < thrust[1] < inf:
        raise InputError(f'{fields.at("thrust")}: a throttle needs a largest thrust')
    state = fields.choice('state', MASS_STATES, 'mass')
    propellant = fields.positive('propellant')
    if state == 'mass' and propellant >= mass:
        raise InputError(
            f'{fields.at("propellant")}: {propellant:g} kg is not below the mass, {mass:g} kg'
        )
    return Rocket(
        thrust=thrust,
        specific_impulse=fields.positive('specific_impulse'),
        weight_acceleration=fields.positive('weight_acceleration', G0),
        control=control,
        state=state,
        least=mass - propellant if state == 'mass' else 0.0,
        most=mass if state == 'mass' else propellant,
        mount=read_mount(fields),
    )
