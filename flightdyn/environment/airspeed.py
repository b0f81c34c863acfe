"""True, equivalent and calibrated airspeed and Mach number, each from the others.

True airspeed is what the vehicle does through the air, equivalent airspeed the one with the same
dynamic pressure at sea level, calibrated airspeed what an error-free indicator shows: the one
with the same impact pressure at sea level. The air has a ratio of specific heats of 1.4. Speeds
are in m/s and have finite derivatives at rest. Each function takes floats, arrays and symbols.
"""

from .. import numpy as np
from ..numpy import Vectorizable
from .atmosphere import (
    DENSITY_SEA_LEVEL,
    HEAT_CAPACITY_RATIO,
    PRESSURE_SEA_LEVEL,
    SPEED_OF_SOUND_SEA_LEVEL,
    gas_constant_air,
)

_RAYLEIGH = 7.2**3.5 / 6  # pitot pressure over static pressure is this x m^3.5 / (7 m - 1)^2.5
_IMPACT_AT_SONIC = 1.2**3.5 - 1  # impact over static pressure at Mach 1
_NEWTON_STEPS = 3  # from the starting value below: 2e-15 up to Mach 25


def speed_of_sound(temperature: Vectorizable) -> Vectorizable:
    """Return the speed of sound [m/s] at a temperature [K]."""
    return np.sqrt(HEAT_CAPACITY_RATIO * gas_constant_air * temperature)


def mach_from_true(tas: Vectorizable, temperature: Vectorizable) -> Vectorizable:
    """Return the Mach number of a true airspeed [m/s] at a temperature [K]."""
    return tas / speed_of_sound(temperature)


def true_from_mach(mach: Vectorizable, temperature: Vectorizable) -> Vectorizable:
    """Return the true airspeed [m/s] of a Mach number at a temperature [K]."""
    return mach * speed_of_sound(temperature)


def equivalent_from_true(tas: Vectorizable, density: Vectorizable) -> Vectorizable:
    """Return the equivalent airspeed [m/s] of a true one at a density [kg/m^3]."""
    return tas * np.sqrt(density / DENSITY_SEA_LEVEL)


def true_from_equivalent(eas: Vectorizable, density: Vectorizable) -> Vectorizable:
    """Return the true airspeed [m/s] of an equivalent one at a density [kg/m^3]."""
    return eas * np.sqrt(DENSITY_SEA_LEVEL / density)


def calibrated_from_mach(mach: Vectorizable, pressure: Vectorizable) -> Vectorizable:
    """Return the calibrated airspeed [m/s] of a Mach number at a static pressure [Pa].

    Notes
    -----
    Isentropic below Mach 1, behind a normal shock (Rayleigh's pitot formula) above, at either
    end: a calibrated airspeed above the speed of sound at sea level is found by Newton's method
    with a fixed number of steps.

    References
    ----------
    .. [1] Anderson, *Fundamentals of Aerodynamics*, 5th edition, 2011, section 8.7.
    """
    return SPEED_OF_SOUND_SEA_LEVEL * _mach_elsewhere(mach, pressure / PRESSURE_SEA_LEVEL)


def mach_from_calibrated(cas: Vectorizable, pressure: Vectorizable) -> Vectorizable:
    """Return the Mach number of a calibrated airspeed [m/s] at a static pressure [Pa]."""
    return _mach_elsewhere(cas / SPEED_OF_SOUND_SEA_LEVEL, PRESSURE_SEA_LEVEL / pressure)


def calibrated_from_true(
    tas: Vectorizable, pressure: Vectorizable, temperature: Vectorizable
) -> Vectorizable:
    """Return the calibrated airspeed [m/s] of a true one; static pressure [Pa], temperature [K].

    See `calibrated_from_mach`.
    """
    return calibrated_from_mach(mach_from_true(tas, temperature), pressure)


def true_from_calibrated(
    cas: Vectorizable, pressure: Vectorizable, temperature: Vectorizable
) -> Vectorizable:
    """Return the true airspeed [m/s] of a calibrated one; static pressure [Pa], temperature [K].

    See `calibrated_from_mach`.
    """
    return true_from_mach(mach_from_calibrated(cas, pressure), temperature)


def impact_pressure(mach: Vectorizable, pressure: Vectorizable) -> Vectorizable:
    """Return what a pitot tube measures above the static pressure [Pa]."""
    square = mach * mach
    return pressure * square * _impact_over_square(square)


def _mach_elsewhere(mach: Vectorizable, pressure_ratio: Vectorizable) -> Vectorizable:
    """Return the Mach number of the same impact pressure in air of 1 / ratio the pressure.

    All is written as factors of the Mach number that do not vanish with it, so that neither the
    value nor a derivative is 0 / 0 at rest.
    """
    square = mach * mach
    per_square = pressure_ratio * _impact_over_square(square)
    return mach * np.sqrt(per_square * _square_over_impact(per_square * square))


def _impact_over_square(m: Vectorizable) -> Vectorizable:
    """Return impact over static pressure, divided by m, the square of the Mach number."""
    a = 1.0 + 0.2 * m
    # a^3.5 - 1 = (a^7 - 1) / (a^3.5 + 1), and a - 1 = m / 5 divides the numerator.
    subsonic = 0.2 * _sum_of_powers(a) / (a * a * a * np.sqrt(a) + 1.0)
    fast = np.fmax(m, 1.0)
    shock = 7.0 * fast - 1.0
    pitot = _RAYLEIGH * fast**3 * np.sqrt(fast) / (shock * shock * np.sqrt(shock))
    return np.where(m > 1.0, (pitot - 1.0) / fast, subsonic)


def _square_over_impact(x: Vectorizable) -> Vectorizable:
    """Return the square of the Mach number over x, impact over static pressure."""
    c = (1.0 + x) ** (1.0 / 7.0)
    # m = 5 (c^2 - 1) and x = c^7 - 1: c - 1 divides both.
    subsonic = 5.0 * (c + 1.0) / _sum_of_powers(c)
    strong = np.fmax(x, _IMPACT_AT_SONIC)
    log_pitot = np.log((1.0 + strong) / _RAYLEIGH)
    # Right at Mach 1; the slope is that of high Mach numbers.
    m = 1.0 + (strong - _IMPACT_AT_SONIC) * 7.0**2.5 / _RAYLEIGH
    for _ in range(_NEWTON_STEPS):
        shock = 7.0 * m - 1.0
        residual = 3.5 * np.log(m) - 2.5 * np.log(shock) - log_pitot
        m = m - residual * m * shock / (7.0 * m - 3.5)
    return np.where(x > _IMPACT_AT_SONIC, m / strong, subsonic)


def _sum_of_powers(a: Vectorizable) -> Vectorizable:
    """Return 1 + a + ... + a^6, which is (a^7 - 1) / (a - 1)."""
    total = 1.0 + a
    for _ in range(5):
        total = 1.0 + a * total
    return total
