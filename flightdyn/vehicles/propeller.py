"""Fixed-pitch propellers on piston engines and electric motors."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import pi
from typing import NamedTuple

from .. import numpy as np
from ..config import whole_number
from ..dynamics import Dynamics
from ..environment.atmosphere import DENSITY_SEA_LEVEL
from ..environment.noise import propeller_level
from ..errors import InputError
from ..numpy import Vectorizable
from .aerodynamics import Values
from .fields import Fields
from .propulsion import FORWARD, Bounds, Mount, Propulsion, Triple, read_mount

KEYS = (
    *('kind', 'diameter', 'thrust_coefficients', 'power_coefficients', 'efficiency', 'engine'),
    *('sense', 'direction', 'axes', 'position', 'blades'),
)
ENGINE_KEYS = ('kind', 'power', 'rotation', 'consumption', 'efficiency', 'fuel', 'charge')

_LEAST_FLOW = 0.1  # m/s, of air through a propeller at rest: a finite slope at no power
_LEAST_POWER = 1.0  # W, below which a propeller gets no quieter
_NEWTON_STEPS = 5  # to 1e-12 of the flow, from anywhere that the start can be


class Turning(NamedTuple):
    """What a propeller does: thrust [N], shaft power [W], and speed [rev/s] if it is known."""

    thrust: Vectorizable
    power: Vectorizable
    rotation: Vectorizable | None


class Propeller(ABC):
    """Thrust from shaft power."""

    diameter: float

    @abstractmethod
    def turn(
        self, power: Vectorizable, rated: float, airspeed: Vectorizable, density: Vectorizable
    ) -> Turning:
        """Return what the propeller does on an engine.

        Parameters
        ----------
        power : Vectorizable [W]
            Of the engine at the speed `rated` [rev/s], at which it has the torque that it has at
            every speed.
        airspeed : Vectorizable [m/s]
        density : Vectorizable [kg/m^3]
        """


@dataclass(frozen=True, kw_only=True)
class ActuatorDisc(Propeller):
    """An ideal propeller that takes all power at any speed.

    Parameters
    ----------
    diameter : float [m]
    efficiency : float
        Beside the induced loss.
    """

    diameter: float
    efficiency: float

    def turn(
        self, power: Vectorizable, rated: float, airspeed: Vectorizable, density: Vectorizable
    ) -> Turning:
        """Return the thrust.

        Power is thrust times the flow through the disc, airspeed + w, and thrust is
        2 density area w (airspeed + w): a cubic in the flow, solved by Newton's method from above.

        References
        ----------
        .. [1] McCormick, *Aerodynamics, Aeronautics, and Flight Mechanics*, 2nd edition, 1995,
           chapter 6 (momentum theory of propellers).
        """
        used = self.efficiency * power
        cube = used / (0.5 * pi * self.diameter**2 * density)
        speed = airspeed + _LEAST_FLOW
        flow = speed + np.power(cube + _LEAST_FLOW**3, 1 / 3)
        for _ in range(_NEWTON_STEPS):
            excess = flow * flow * (flow - speed) - cube
            flow = flow - excess / (flow * (3.0 * flow - 2.0 * speed))
        return Turning(used / flow, power, None)


@dataclass(frozen=True, kw_only=True)
class MeasuredPropeller(Propeller):
    """A propeller by its coefficients, quadratic in the advance ratio J = airspeed/(n diameter).

    Parameters
    ----------
    diameter : float [m]
    thrust, power : coefficients of 1, J, J^2
        Of thrust over density n^2 diameter^4 and of power over density n^3 diameter^5.
    """

    diameter: float
    thrust: Triple
    power: Triple

    def turn(
        self, power: Vectorizable, rated: float, airspeed: Vectorizable, density: Vectorizable
    ) -> Turning:
        """Return what the propeller does at the speed at which it takes the engine's torque."""
        n = self._rotation(power / (2 * pi * rated), airspeed, density)
        c0, c1, c2 = self.thrust
        tip = n * self.diameter
        square = c0 * tip * tip + c1 * tip * airspeed + c2 * airspeed * airspeed
        return Turning(density * self.diameter**2 * square, power * n / rated, n)

    def _rotation(
        self, torque: Vectorizable, airspeed: Vectorizable, density: Vectorizable
    ) -> Vectorizable:
        """Solve density n^2 diameter^5 C_P(J) = 2 pi torque, quadratic in n, for the faster n."""
        c0, c1, c2 = self.power
        forward = airspeed / self.diameter
        half = 0.5 * c1 * forward
        rest = c2 * forward * forward - 2 * pi * torque / (density * self.diameter**5)
        square = half * half - c0 * rest
        # a root of 0 has no slope, one of less is none: where the engine would hold the propeller
        least = (c0 * _LEAST_FLOW / self.diameter) ** 2
        return (np.sqrt(0.5 * (square + np.hypot(square, least))) - half) / c0


@dataclass(frozen=True, kw_only=True)
class Engine:
    """A piston engine or an electric motor.

    Parameters
    ----------
    kind : 'piston' or 'electric'
    power : float [W]
        The largest, at sea level and at the speed `rotation`.
    rotation : float [rev/s]
    use : float
        Fuel [kg] of a piston engine, or electric energy [J], per shaft energy [J].
    """

    kind: str
    power: float
    rotation: float
    use: float

    def part(self, density: Vectorizable) -> Vectorizable:
        """Return the largest power in air of a density [kg/m^3] as a part of that at sea level.

        References
        ----------
        .. [1] Gagg, Farrar, *Altitude Performance of Aircraft Engines Equipped with Gear-Driven
           Superchargers*, SAE Transactions 29, 1934: 1.132 density ratio - 0.132.
        """
        return 1.0 if self.kind == 'electric' else 1.132 * density / DENSITY_SEA_LEVEL - 0.132


@dataclass(frozen=True, kw_only=True)
class PropellerDrive(Propulsion):
    """A propeller on an engine whose torque (or power, of a disc) follows the throttle.

    Parameters
    ----------
    propeller : Propeller
    engine : Engine
    stored : float or None
        Fuel [kg] or battery charge [J] when full, an extra state `fuel` or `charge`; None for one
        that is not counted. The mass in the vehicle's file is without the fuel.
    blades : int or None
        Of the propeller, for its noise at 1 m, the output `source_level` [dB]; None for no noise.
    sense : float
        -1, 0 or 1: what torque the engine puts on the vehicle about the thrust, 0 to leave it out.
    """

    propeller: Propeller
    engine: Engine
    stored: float | None = None
    blades: int | None = None
    sense: float = 0.0
    mount: Mount = FORWARD

    @property
    def controls(self) -> Bounds:
        return {'throttle': (0.0, 1.0)}

    @property
    def extra_states(self) -> Bounds:
        if self.stored is None:
            return {}
        return {'fuel' if self.engine.kind == 'piston' else 'charge': (0.0, self.stored)}

    def attach(self, dyn: Dynamics, controls: Values) -> dict[str, Vectorizable]:
        """Add the thrust; return it, the power [W], and what is used [kg/s] or [W], by name."""
        air = dyn.op_point
        density = air.atmosphere.density()
        engine = self.engine
        full = controls['throttle'] * engine.part(density) * engine.power
        thrust, power, rotation = self.propeller.turn(full, engine.rotation, air.velocity, density)
        self.mount.push(dyn, thrust, self.sense * full / (2 * pi * engine.rotation))
        use = power * engine.use
        rates = dict.fromkeys(self.extra_states, -use)
        drawn = 'fuel_flow' if engine.kind == 'piston' else 'power_drawn'
        more = {} if rotation is None else {'rotation': rotation}
        if self.blades is not None:
            turning = engine.rotation if rotation is None else rotation
            tip_mach = pi * self.propeller.diameter * turning / air.atmosphere.speed_of_sound()
            more['source_level'] = propeller_level(
                np.fmax(power, _LEAST_POWER), self.propeller.diameter, tip_mach, self.blades
            )
        return rates | {'thrust': thrust, 'power': power, drawn: use} | more


def read_propeller(fields: Fields, mass: float) -> PropellerDrive:
    """Return the propeller and its engine that a vehicle's file describes.

    Raises
    ------
    InputError
        If a key is missing or wrong.
    """
    engine = Fields(fields.need('engine'), ENGINE_KEYS, fields.at('engine'))
    kind = engine.choice('kind', ('piston', 'electric'))
    store = 'fuel' if kind == 'piston' else 'charge'
    for other in ('charge', 'efficiency') if kind == 'piston' else ('fuel', 'consumption'):
        if other in engine:
            raise InputError(f"{engine.where}: '{other}' is not of a {kind} engine")
    sense = fields.number('sense', 0.0)
    if sense not in (-1, 0, 1):
        raise InputError(f'{fields.at("sense")}: must be -1, 0 or 1, got {sense:g}')
    propeller: Propeller
    if 'thrust_coefficients' in fields or 'power_coefficients' in fields:
        if 'efficiency' in fields:
            raise InputError(f'{fields.where}: give either coefficients or efficiency')
        propeller = MeasuredPropeller(
            diameter=fields.positive('diameter'),
            thrust=_quadratic(fields, 'thrust_coefficients'),
            power=_quadratic(fields, 'power_coefficients'),
        )
        if propeller.power[0] <= 0:
            raise InputError(f'{fields.at("power_coefficients")}: the first must be positive')
    else:
        propeller = ActuatorDisc(
            diameter=fields.positive('diameter'), efficiency=fields.positive('efficiency', 0.85)
        )
    return PropellerDrive(
        propeller=propeller,
        engine=Engine(
            kind=kind,
            power=engine.positive('power'),
            rotation=engine.positive('rotation'),
            use=(
                engine.number('consumption', 0.0)
                if kind == 'piston'
                else 1.0 / engine.positive('efficiency', 1.0)
            ),
        ),
        stored=engine.positive(store) if store in engine else None,
        blades=_blades(fields) if 'blades' in fields else None,
        sense=sense,
        mount=read_mount(fields),
    )


def _blades(fields: Fields) -> int:
    return whole_number(fields.need('blades'), fields.at('blades'), lower=2, upper=12)


def _quadratic(fields: Fields, key: str) -> Triple:
    given = fields.numbers(key)
    if len(given) > 3:
        raise InputError(f'{fields.at(key)}: at most three (up to J^2), got {len(given)}')
    c0, c1, c2 = (*given, 0.0, 0.0)[:3]
    return c0, c1, c2
