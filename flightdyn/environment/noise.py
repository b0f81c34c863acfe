"""Noise of a flight where people listen: levels [dB re 20 uPa] and what they add up to.

A source is taken to be as loud in all directions; what the ground reflects is left out. Its level
is that at 1 m, free field.
"""

from math import log10

import numpy as _np
from numpy.typing import ArrayLike

from .. import numpy as np
from ..numpy import Vectorizable

ABSORPTION = 1.9e-3  # dB/m, of the air at 10 degrees C, 70 % humidity, 500 Hz: ISO 9613-2, table 2
LEAST_DISTANCE = 1.0  # m, where the source's level is that heard


def received_level(
    source_level: Vectorizable, distance: Vectorizable, absorption: float = ABSORPTION
) -> Vectorizable:
    """Return the sound pressure level [dB] at a distance [m] from a source.

    Parameters
    ----------
    source_level : Vectorizable [dB]
        At 1 m.
    distance : Vectorizable [m]
        Nearer than some metres levels are bent to be finite.
    absorption : float [dB/m]
        Of the air.

    References
    ----------
    .. [1] ISO 9613-2:1996, *Acoustics: attenuation of sound during propagation outdoors*,
       equations 7 (geometrical divergence) and 8 (atmospheric absorption).
    """
    squared = distance * distance + LEAST_DISTANCE**2
    return source_level - (10.0 / np.log(10.0)) * np.log(squared) - absorption * distance


def propeller_level(
    power: Vectorizable,
    diameter: float,
    tip_mach: Vectorizable,
    blades: int,
    propellers: int = 1,
) -> Vectorizable:
    """Return the largest sound pressure level of propellers at 1 m [dB].

    Parameters
    ----------
    power : Vectorizable [W]
        At the shaft of each.
    diameter : float [m]
    tip_mach : Vectorizable
        Speed of the blades' tips by rotation alone, over that of sound.
    blades : int
        Of each.

    References
    ----------
    .. [1] Ruijgrok, *Elements of Aviation Acoustics*, 1993, chapter 6: an estimate from
       measurements for subsonic tips, with the power in kW.
    """
    kilowatts = power / 1e3
    return (
        83.4
        + (15.3 / np.log(10.0)) * np.log(kilowatts)
        - 20.0 * log10(diameter)
        + 38.5 * tip_mach
        - 3.0 * (blades - 2)
        + 10.0 * log10(propellers)
    )


def sound_exposure_level(time: ArrayLike, level: ArrayLike) -> float:
    """Return the level [dB] that, held for a second, carries the energy of a whole flight.

    Parameters
    ----------
    time : array (n,) [s]
    level : array (n,) [dB]
        Of sound pressure; between the times it runs straight.

    References
    ----------
    .. [1] ISO 1996-1:2016, *Acoustics: description, measurement and assessment of environmental
       noise*, 3.1.8 (sound exposure level; here of unweighted sound).
    """
    t, dB = _np.asarray(time, float), _np.asarray(level, float)
    loudest = float(dB.max())
    part = 10.0 ** ((dB - loudest) / 10.0)
    # exponentials between the samples are integrated as such: a difference over a logarithm
    ratio = _np.log(part[1:] / part[:-1])
    steep = _np.abs(ratio) > 1e-6
    safe = _np.where(steep, ratio, 1.0)
    mean = _np.where(steep, _np.diff(part) / safe, 0.5 * (part[1:] + part[:-1]))
    return loudest + 10.0 * log10(float((mean * _np.diff(t)).sum()))
