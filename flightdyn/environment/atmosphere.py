"""The US Standard Atmosphere 1976 up to 86 km, exact or with its corners rounded."""

import warnings
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as _np
from numpy.typing import NDArray

from .. import numpy as np
from ..errors import InputError
from ..numpy import Vectorizable, is_symbolic
from .elements import Steps, common_length, elements

Array = NDArray[_np.float64]

METHODS = ('differentiable', 'isa')

# Constants of the standard [1]_.
gas_constant_universal = 8.31432  # J/(mol K); CODATA has moved on, the standard has not
molar_mass_air = 28.9644e-3  # kg/mol, at sea level
gas_constant_air = gas_constant_universal / molar_mass_air  # J/(kg K)
G0 = 9.80665  # m/s^2
EARTH_RADIUS = 6_356_766.0  # m, the r0 that makes geopotential altitude right at 45.5 degrees
PRESSURE_SEA_LEVEL = 101_325.0  # Pa
TEMPERATURE_SEA_LEVEL = 288.15  # K
HEAT_CAPACITY_RATIO = 1.4
SUTHERLAND_BETA = 1.458e-6  # kg/(s m K^0.5)
SUTHERLAND_TEMPERATURE = 110.4  # K

DENSITY_SEA_LEVEL = PRESSURE_SEA_LEVEL / (gas_constant_air * TEMPERATURE_SEA_LEVEL)  # kg/m^3
SPEED_OF_SOUND_SEA_LEVEL = float(
    _np.sqrt(HEAT_CAPACITY_RATIO * gas_constant_air * TEMPERATURE_SEA_LEVEL)
)  # m/s

_BASES = _np.array([0.0, 11e3, 20e3, 32e3, 47e3, 51e3, 71e3, 84_852.0])  # m, geopotential
_LAPSES = _np.array([-6.5, 0.0, 1.0, 2.8, 0.0, -2.8, -2.0, 0.0]) * 1e-3  # K/m
_RANGE = (-5004.0, 86_000.0)  # m, geopotential; -5004 m is -5 km geometric, the table's first line

_ROUNDING = 4e-4  # largest change of temperature by rounding a corner, as a part of it
_WIDEST = 1000.0  # m, half of the longest stretch that is rounded


def _layers() -> tuple[Array, Array]:
    """Return the coefficients of the layers and those of their corners, one column each."""
    temperatures = TEMPERATURE_SEA_LEVEL + _np.concatenate(
        ([0.0], _np.cumsum(_LAPSES[:-1] * _np.diff(_BASES)))
    )
    slope = G0 / gas_constant_air  # K/m, the lapse rate of an atmosphere of constant density
    isothermal = _LAPSES == 0
    power = _np.where(isothermal, 0.0, -slope / _np.where(isothermal, 1.0, _LAPSES))
    decay = _np.where(isothermal, -slope / temperatures, 0.0)
    steps = power[:-1] * _np.log(temperatures[1:] / temperatures[:-1]) + decay[:-1] * _np.diff(
        _BASES
    )
    log_pressures = _np.concatenate(([0.0], _np.cumsum(steps)))
    layers = _np.array([_BASES, temperatures, _LAPSES, log_pressures, power, decay])

    corners, bends = _BASES[1:], _np.diff(_LAPSES)
    # 5/64 is the rounded corner's distance from the sharp one, see _rounded.
    half_widths = _np.minimum(_ROUNDING * temperatures[1:] * 64 / 5 / _np.abs(bends), _WIDEST)
    warmth = bends * half_widths / 64
    swell = slope * warmth * half_widths / temperatures[1:] ** 2
    return layers, _np.array([corners, 1 / half_widths, warmth, swell])


def _layers_by_density(layers: Array) -> Array:
    """Return the coefficients of altitude as a function of -ln(density / density at 0 m)."""
    bases, temperatures, lapses, log_pressures, power, decay = layers
    isothermal = lapses == 0
    thinness = _np.log(temperatures / TEMPERATURE_SEA_LEVEL) - log_pressures
    scale = _np.where(isothermal, 0.0, temperatures / _np.where(isothermal, 1.0, lapses))
    rate = _np.where(isothermal, 0.0, 1 / (1 - power))
    height = _np.where(isothermal, -1 / _np.where(isothermal, decay, 1.0), 0.0)
    return _np.array([bases, thinness, scale, rate, height])


_ISA, _BENT = _layers()
_THIN = _layers_by_density(_ISA)
_layer = Steps(_BASES[1:], _ISA)
_corner = Steps((_BASES[2:] + _BASES[1:-1]) / 2, _BENT)
_layer_by_density = Steps(_THIN[1][1:], _THIN)


def _standard(altitude: Vectorizable) -> tuple[Vectorizable, Vectorizable]:
    """Return the standard's temperature [K] and ln(p / p0)."""
    base, temperature_base, lapse, log_base, power, decay = _layer(altitude)
    climbed = altitude - base
    temperature = temperature_base + lapse * climbed
    # One of the two terms is zero: an isothermal layer has power 0, any other one decay 0.
    log_ratio = log_base + power * np.log(temperature / temperature_base) + decay * climbed
    return temperature, log_ratio


def _rounded(altitude: Vectorizable) -> tuple[Vectorizable, Vectorizable]:
    """Return temperature [K] and ln(p / p0) with the nearest corner rounded.

    Added to the temperature is the even polynomial of lowest degree that takes its corner away,
    ends with two vanishing derivatives and has no area on either side, so that pressure beyond
    the corner stays the standard's. Added to ln p is the integral of the same. In the distance
    `a` from the corner, 1 at the end:

        64 c(a) = a (1 - a)^4 (5 + 4 a + a^2),   64 c'(a) = (1 - a)^3 (5 - 17 a - 21 a^2 - 7 a^3)
    """
    temperature, log_ratio = _standard(altitude)
    corner, per_half_width, warmth, swell = _corner(altitude)
    # The sign by the comparison that also chooses the layer: what is added then cancels the
    # layers' jump exactly, the second derivative at the corner included.
    side = 2.0 * (altitude >= corner) - 1.0
    a = np.fmin(side * (altitude - corner) * per_half_width, 1.0)
    left = 1.0 - a
    cube = left * left * left
    temperature = temperature + warmth * cube * (5.0 - a * (17.0 + a * (21.0 + a * 7.0)))
    log_ratio = log_ratio + swell * side * a * cube * left * (5.0 + a * (4.0 + a))
    return temperature, log_ratio


def geopotential_altitude(altitude: Vectorizable) -> Vectorizable:
    """Return the geopotential altitude [m] of a geometric one [m] above mean sea level."""
    return EARTH_RADIUS * altitude / (EARTH_RADIUS + altitude)


def geometric_altitude(altitude: Vectorizable) -> Vectorizable:
    """Return the geometric altitude [m] above mean sea level of a geopotential one [m]."""
    return EARTH_RADIUS * altitude / (EARTH_RADIUS - altitude)


@dataclass(frozen=True, eq=False, repr=False)
class Atmosphere:
    """Air at an altitude, by the US Standard Atmosphere 1976.

    Parameters
    ----------
    altitude : Vectorizable
        Geopotential altitude [m]: the one of the hydrostatic equation with constant g, of
        altimeters, and of a flat earth with uniform gravity. `at_geometric_altitude` takes the
        other. Any shape. Where the temperature deviates it is the pressure altitude.
    method : 'differentiable' or 'isa'
        'isa' is the standard itself; its temperature has a corner at each of the seven layer
        boundaries. 'differentiable' rounds them and has two continuous derivatives.
    temperature_deviation : Vectorizable
        Warmer than standard by so much [K], at an unchanged pressure.

    Raises
    ------
    InputError
        If the method is neither of the two.

    Warns
    -----
    UserWarning
        If a number leaves the standard's tables, -5 km to 86 km. Symbols cannot be checked.

    Notes
    -----
    'differentiable' differs from 'isa' only within 171 m of 11 km, 479 m of 84.852 km, 495 m of
    47 and 51 km, 650 m of 32 km, and 1 km of 20 and 71 km. Largest differences: temperature and
    density 0.04 % (0.09 K at 11 km), in the corners themselves; pressure 0.0005 %.

    Temperature is the standard's molecular-scale temperature, which is the kinetic one below
    80 km and up to 0.08 K above it from there to 86 km. Further up it is held at 186.946 K (the
    standard has a kinetic temperature of 186.87 K up to 91 km), below 0 m it goes on rising.

    References
    ----------
    .. [1] *U.S. Standard Atmosphere, 1976*, NOAA-S/T 76-1562, equations (18) to (52).
    """

    altitude: Vectorizable = 0.0
    method: str = 'differentiable'
    temperature_deviation: Vectorizable = 0.0

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise InputError(f'method {self.method!r} is unknown; known: {", ".join(METHODS)}')
        for name in ('altitude', 'temperature_deviation'):
            value = getattr(self, name)
            if not is_symbolic(value) and _np.ndim(value):
                # its own copy, because what follows from it is computed once and kept
                value = _np.array(value, dtype=float)
                value.flags.writeable = False
                object.__setattr__(self, name, value)
        if not is_symbolic(self.altitude) and _np.any(
            (self.altitude < _RANGE[0]) | (self.altitude > _RANGE[1])
        ):
            warnings.warn(
                'altitude is outside the standard atmosphere, -5 km to 86 km: the air is '
                'isothermal above and ever warmer below',
                stacklevel=3,
            )

    @classmethod
    def at_geometric_altitude(
        cls,
        altitude: Vectorizable,
        method: str = 'differentiable',
        temperature_deviation: Vectorizable = 0.0,
    ) -> Self:
        """Return the air at a height above mean sea level [m] as a ruler measures it."""
        return cls(geopotential_altitude(altitude), method, temperature_deviation)

    @cached_property
    def _profile(self) -> tuple[Vectorizable, Vectorizable]:
        """Standard temperature [K] and pressure [Pa]."""
        profile = _standard if self.method == 'isa' else _rounded
        temperature, log_ratio = profile(self.altitude)
        return temperature, PRESSURE_SEA_LEVEL * np.exp(log_ratio)

    def pressure(self) -> Vectorizable:
        """Return the pressure [Pa]."""
        return self._profile[1]

    def temperature(self) -> Vectorizable:
        """Return the temperature [K]."""
        return self._profile[0] + self.temperature_deviation

    def density(self) -> Vectorizable:
        """Return the density [kg/m^3], by the gas law."""
        return self.pressure() / (gas_constant_air * self.temperature())

    def speed_of_sound(self) -> Vectorizable:
        """Return the speed of sound [m/s]."""
        return np.sqrt(self.ratio_of_specific_heats() * gas_constant_air * self.temperature())

    def dynamic_viscosity(self) -> Vectorizable:
        """Return the dynamic viscosity [Pa s], by Sutherland's law as the standard states it."""
        temperature = self.temperature()
        return (
            SUTHERLAND_BETA
            * temperature
            * np.sqrt(temperature)
            / (temperature + SUTHERLAND_TEMPERATURE)
        )

    def kinematic_viscosity(self) -> Vectorizable:
        """Return the kinematic viscosity [m^2/s]."""
        return self.dynamic_viscosity() / self.density()

    def ratio_of_specific_heats(self) -> float:
        """Return the ratio of specific heats, 1.4."""
        return HEAT_CAPACITY_RATIO

    def mean_free_path(self) -> Vectorizable:
        """Return the mean free path [m] in a gas of hard spheres of the same viscosity.

        The standard's own table has a fixed collision diameter instead, and is 4 % longer at
        sea level.

        References
        ----------
        .. [1] Vincenti, Kruger, *Introduction to Physical Gas Dynamics*, 1965, chapter X.
        """
        return (
            self.dynamic_viscosity()
            / self.pressure()
            * np.sqrt(np.pi / 2 * gas_constant_air * self.temperature())
        )

    def knudsen(self, length: Vectorizable) -> Vectorizable:
        """Return the Knudsen number of a length [m]."""
        return self.mean_free_path() / length

    def density_altitude(self) -> Vectorizable:
        """Return the geopotential altitude [m] at which the standard has this density.

        With the method 'isa' and no deviation it is the altitude itself.
        """
        log_density = np.log(self.density() / DENSITY_SEA_LEVEL)
        # Counted downwards, for the bounds to increase.
        base, log_base, scale, rate, height = _layer_by_density(-log_density)
        thinner = -log_density - log_base
        return base + scale * (np.exp(rate * thinner) - 1.0) + height * thinner

    @property
    def _fields(self) -> dict[str, Vectorizable]:
        return {'altitude': self.altitude, 'temperature_deviation': self.temperature_deviation}

    def __len__(self) -> int:
        return common_length(type(self).__name__, self._fields)

    def __getitem__(self, index: Any) -> Self:
        return type(self)(method=self.method, **elements(type(self).__name__, self._fields, index))

    def __repr__(self) -> str:
        return (
            f'{type(self).__name__}(altitude={self.altitude}, method={self.method!r}, '
            f'temperature_deviation={self.temperature_deviation})'
        )
