"""Jet engines: thrust that falls with the density of the air, and the fuel that it takes."""

from dataclasses import dataclass

from .. import numpy as np
from ..dynamics import Dynamics
from ..environment.atmosphere import DENSITY_SEA_LEVEL
from ..numpy import Vectorizable
from .aerodynamics import Values
from .fields import Fields
from .propulsion import FORWARD, MOUNT_KEYS, Bounds, Mount, Propulsion, read_mount

KEYS = ('kind', 'thrust', 'lapse', 'consumption', 'fuel', *MOUNT_KEYS)


@dataclass(frozen=True, kw_only=True)
class Jet(Propulsion):
    """All jet engines of a vehicle, with one throttle.

    Parameters
    ----------
    thrust : float [N]
        The largest, at sea level.
    lapse : float
        Power of the density ratio that the largest thrust goes with.
    consumption : float [kg/(N s)]
        Mass flow of fuel over thrust, the same at any throttle, height and speed.
    fuel : float [kg]
        When full, an extra state; the mass in the vehicle's file is without it.

    References
    ----------
    .. [1] Anderson, *Aircraft Performance and Design*, 1999, chapter 3: thrust in proportion to
       the density, consumption all but the same at any height.
    """

    thrust: float
    lapse: float = 1.0
    consumption: float
    fuel: float
    mount: Mount = FORWARD

    @property
    def controls(self) -> Bounds:
        return {'throttle': (0.0, 1.0)}

    @property
    def extra_states(self) -> Bounds:
        return {'fuel': (0.0, self.fuel)}

    def attach(self, dyn: Dynamics, controls: Values) -> dict[str, Vectorizable]:
        """Add the thrust; return it, the fuel's rate and flow [kg/s] and the Mach number."""
        air = dyn.op_point
        part = np.power(air.atmosphere.density() / DENSITY_SEA_LEVEL, self.lapse)
        thrust = controls['throttle'] * (self.thrust * part)
        self.mount.push(dyn, thrust)
        flow = self.consumption * thrust
        return {'fuel': -flow, 'thrust': thrust, 'fuel_flow': flow, 'mach': air.mach()}


def read_jet(fields: Fields, mass: float) -> Jet:
    """Return the jet engines that a vehicle's file describes.

    Raises
    ------
    InputError
        If a key is missing or wrong.
    """
    return Jet(
        thrust=fields.positive('thrust'),
        lapse=fields.positive('lapse', 1.0),
        consumption=fields.positive('consumption'),
        fuel=fields.positive('fuel'),
        mount=read_mount(fields),
    )
