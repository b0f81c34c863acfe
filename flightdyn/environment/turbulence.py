"""Random gusts with the Dryden spectra of the US military standards."""

import math

import numpy as np

from ..errors import InputError
from ..units import foot, knot

WIND_AT_20_FT = {
    'none': 0.0,
    'light': 15 * knot,
    'moderate': 30 * knot,
    'severe': 45 * knot,
}
"""Mean wind 20 ft above the ground [m/s], which sets the gusts near it."""

SEVERITIES = tuple(WIND_AT_20_FT)

# Intensity [ft/s] over altitude [ft] at which the standard's probability is exceeded: 1e-2 light,
# 1e-3 moderate, 1e-5 severe. MIL-F-8785C, figure 7.
_ALTITUDE = (500, 1750, 3750, 7500, 15e3, 25e3, 35e3, 45e3, 55e3, 65e3, 75e3, 80e3)
_INTENSITY = {
    'none': (0.0,) * 12,
    'light': (6.6, 6.9, 7.4, 6.7, 4.6, 2.7, 0.4, 0, 0, 0, 0, 0),
    'moderate': (8.6, 9.6, 10.6, 10.1, 8.0, 6.6, 5.0, 4.2, 2.7, 0, 0, 0),
    'severe': (15.6, 17.6, 23.0, 23.6, 22.1, 20.0, 16.0, 15.1, 12.1, 7.9, 6.2, 5.1),
}
_LOWEST, _LOW, _HIGH = 10.0, 1000.0, 2000.0  # ft, ends of the low-altitude and the other model
_LENGTH_ALOFT = 1750.0  # ft

Triple = tuple[float, float, float]


def scale_lengths(height: float) -> Triple:
    """Return how far gusts along, across and vertical reach [m] at a height above ground [m].

    They are the L of MIL-F-8785C. MIL-HDBK-1797 calls half of the second and third its L and
    puts 2 L into the spectra: the gusts are the same.
    """
    h = max(height / foot, _LOWEST)
    if h < _LOW:
        along = h / (0.177 + 0.000823 * h) ** 1.2
        return along * foot, along * foot, h * foot
    length = float(np.interp(h, (_LOW, _HIGH), (_LOW, _LENGTH_ALOFT))) * foot
    return length, length, length


def intensities(height: float, severity: str, wind_at_20_ft: float | None = None) -> Triple:
    """Return the standard deviations of gusts along, across and vertical [m/s].

    Parameters
    ----------
    height : float
        Above the ground [m].
    severity : str
        'none', 'light', 'moderate' or 'severe'.
    wind_at_20_ft : float, optional
        Mean wind 20 ft above the ground [m/s]; by default that of the severity.

    Raises
    ------
    InputError
        If the severity is unknown.
    """
    if severity not in _INTENSITY:
        raise InputError(f'severity {severity!r} is unknown; known: {", ".join(_INTENSITY)}')
    wind = WIND_AT_20_FT[severity] if wind_at_20_ft is None else wind_at_20_ft
    h = max(height / foot, _LOWEST)
    vertical = 0.1 * wind
    if h < _LOW:
        level = vertical / (0.177 + 0.000823 * h) ** 0.4
        return level, level, vertical
    table = _INTENSITY[severity]
    if h < _HIGH:
        aloft = foot * float(np.interp(_HIGH, _ALTITUDE, table))
        sigma = float(np.interp(h, (_LOW, _HIGH), (vertical, aloft)))
    else:
        sigma = foot * float(np.interp(h, _ALTITUDE, table))
    return sigma, sigma, sigma


def shaping_step(theta: float) -> tuple[Triple, Triple]:
    """Return one step of the filter (1 + sqrt(3) s) / (1 + s)^2 driven by white noise.

    The filter is x1' = -x1 + noise, x2' = -x2 + x1 in the time V t / L, and its output is
    sqrt(3) x1 + (1 - sqrt(3)) x2, of variance 1 in the long run. The step has the process's own
    distribution, whatever its length.

    Parameters
    ----------
    theta : float
        Length of the step, V dt / L.

    Returns
    -------
    (a11, a21, a22), (l11, l21, l22)
        Lower triangles: x becomes a x + l n, with n two independent standard normal numbers.
    """
    decay = math.exp(-theta)
    squared = decay * decay
    lost = -math.expm1(-2 * theta)  # 1 - squared, without cancellation
    q11 = lost / 2
    q12 = (lost - 2 * theta * squared) / 4
    q22 = (lost - 2 * theta * (1 + theta) * squared) / 4
    l11 = math.sqrt(q11)
    l21 = q12 / l11 if l11 else 0.0
    return (decay, theta * decay, decay), (l11, l21, math.sqrt(max(q22 - l21 * l21, 0.0)))


class DrydenGusts:
    """Gusts that a vehicle meets one step after the other.

    Parameters
    ----------
    severity : str
        'none', 'light', 'moderate' or 'severe': exceeded with a probability of 1e-2, 1e-3 or
        1e-5 aloft, 15, 30 or 45 kt of wind near the ground.
    wind_at_20_ft : float, optional
        Mean wind 20 ft above the ground [m/s], instead of the severity's.
    seed : int or numpy Generator
        The same seed and the same steps make the same gusts.

    Raises
    ------
    InputError
        If the severity is unknown, or the wind not a finite number from 0.

    Notes
    -----
    Below 1000 ft above the ground scales and intensities are those of the low-altitude model,
    above 2000 ft those of the other, in between linear. Gusts are a frozen field that the vehicle
    flies through: they change with the distance flown through the air, and stand still at rest.
    Steps are exact, so that variance and correlation do not depend on their length; the gusts
    start anywhere in their distribution. Rotational gusts are left out.

    References
    ----------
    .. [1] MIL-F-8785C, *Flying Qualities of Piloted Airplanes*, 1980, section 3.7.
    .. [2] MIL-HDBK-1797, *Flying Qualities of Piloted Aircraft*, 1997.
    """

    def __init__(
        self,
        severity: str = 'moderate',
        *,
        wind_at_20_ft: float | None = None,
        seed: int | np.random.Generator = 0,
    ) -> None:
        intensities(0.0, severity)
        if wind_at_20_ft is not None and not 0 <= wind_at_20_ft < math.inf:
            raise InputError(f'wind_at_20_ft is {wind_at_20_ft} m/s; it must be from 0')
        self.severity, self.wind_at_20_ft = severity, wind_at_20_ft
        self._random = np.random.default_rng(seed)
        # of unit variance each; a gust is its standard deviation at the time times this
        self._u, *pairs = self._random.standard_normal(5).tolist()
        self._v, self._w = (
            # covariance ((2, 1), (1, 1)) / 4: the long run of `shaping_step`
            (math.sqrt(0.5) * pairs[i], math.sqrt(0.125) * (pairs[i] + pairs[i + 1]))
            for i in (0, 2)
        )

    def advance(self, dt: float, airspeed: float, height: float) -> Triple:
        """Return the gust velocity u, v, w [m/s] after a time step.

        Parameters
        ----------
        dt : float
            Time step [s]; 0 gives the present gust.
        airspeed : float
            True airspeed [m/s].
        height : float
            Above the ground [m].

        Returns
        -------
        (u, v, w)
            Below 1000 ft: along the mean wind, across it to the right and down. Above 2000 ft:
            in body axes. The standard mixes the two in between.

        Raises
        ------
        InputError
            If the time step or the airspeed is negative or a number is not finite.
        """
        if not (0 <= dt < math.inf and 0 <= airspeed < math.inf and math.isfinite(height)):
            raise InputError(
                f'dt {dt} s and airspeed {airspeed} m/s must be from 0, height {height} m finite'
            )
        along, across, vertical = (airspeed * dt / length for length in scale_lengths(height))
        n = self._random.standard_normal(5).tolist()
        self._u = math.exp(-along) * self._u + math.sqrt(-math.expm1(-2 * along)) * n[0]
        self._v = _stepped(self._v, across, n[1], n[2])
        self._w = _stepped(self._w, vertical, n[3], n[4])
        sigma_u, sigma_v, sigma_w = intensities(height, self.severity, self.wind_at_20_ft)
        return sigma_u * self._u, sigma_v * _output(self._v), sigma_w * _output(self._w)


def _stepped(x: tuple[float, float], theta: float, n1: float, n2: float) -> tuple[float, float]:
    (a11, a21, a22), (l11, l21, l22) = shaping_step(theta)
    return a11 * x[0] + l11 * n1, a21 * x[0] + a22 * x[1] + l21 * n1 + l22 * n2


def _output(x: tuple[float, float]) -> float:
    return math.sqrt(3) * x[0] + (1 - math.sqrt(3)) * x[1]
