"""Angles, load factor and energies of a point mass, out of its smoothed motion."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import frames
from ..environment.geodesy import GeodeticPoint, geodetic_from_ned

Array = NDArray[np.float64]

G0 = 9.80665  # m/s^2, standard gravity: 3rd CGPM 1901
EARTH_RATE = 7.292115e-5  # rad/s, NIMA TR8350.2, 2000

REST_SPEED = 0.01
"""Below this the direction of the velocity means nothing, however precise the log [m/s]."""

MAX_TURN_STD = np.pi / np.sqrt(3)
"""1-sigma of an angle of which nothing is known, uniform over a turn [rad]."""

_MAX_GAMMA_STD = np.pi / np.sqrt(12)  # uniform over +-pi/2


def flight_path(
    vel: frames.Vector,
    acc: frames.Vector,
    vel_var: frames.Vector,
    acc_var: frames.Vector,
    *,
    lat: Array | None,
    vel_covariance: ArrayLike = 0.0,
    acc_covariance: ArrayLike = 0.0,
) -> dict[str, Array]:
    """Return speed, angles and load factor with their 1-sigmas.

    Parameters
    ----------
    vel, acc : three arrays (n,)
        North, east, down at the vehicle [m/s], [m/s^2].
    vel_var, acc_var : three arrays (n,)
        Their variances.
    lat : array (n,) or None
        Latitude [deg], for the rotation of the earth; None leaves that out.
    vel_covariance, acc_covariance : float or array (n,)
        Of north with east.

    Returns
    -------
    dict of name to array (n,)
        `speed gamma track bank load_factor` and their `_std`; [m/s], [rad], [g].

    Notes
    -----
    Over a turning earth a vehicle that keeps its course is accelerated by 2 omega x v, which its
    lift has to make: 0.2 deg of bank at 250 m/s.

    The 1-sigma of bank and load factor is that of the acceleration across the velocity. That of
    the assumption behind them, no side force, is not in it.

    References
    ----------
    .. [1] Drela, *Flight Vehicle Aerodynamics*, 2014, section 9.3, for the wind axes.
    """
    north, east, down = (np.asarray(v) for v in vel)
    horizontal = np.hypot(north, east)
    speed = np.hypot(horizontal, down)
    course = np.arctan2(east, north)
    along = np.where(horizontal > 0, course, 0.0)
    vel_cov, acc_cov = np.asarray(vel_covariance), np.asarray(acc_covariance)
    var_along, _, _ = _turned(along, vel_var, vel_cov)
    track = _hold(course, horizontal > np.maximum(np.sqrt(var_along), REST_SPEED))
    track = np.where(track >= np.pi, track - 2 * np.pi, track)

    var_along, var_across, _ = _turned(track, vel_var, vel_cov)
    climb = np.arctan2(-down, horizontal)
    var_speed = np.cos(climb) ** 2 * var_along + np.sin(climb) ** 2 * vel_var[2]
    moving = _ramp(speed / np.maximum(np.sqrt(var_speed), REST_SPEED))
    gamma = climb * moving
    var_gamma = np.cos(climb) ** 2 * vel_var[2] + np.sin(climb) ** 2 * var_along
    safe = np.maximum(speed, REST_SPEED)

    force = specific_force(vel, acc, lat)
    right, up = _lift_axes(force, track, gamma)
    var_forward, var_right, shared = _turned(track, acc_var, acc_cov)
    var_up = np.sin(gamma) ** 2 * var_forward + np.cos(gamma) ** 2 * acc_var[2]
    # `up` holds less of what is forward as it climbs.
    both = 2 * right * up * -np.sin(gamma) * shared
    lift = np.maximum(np.hypot(right, up), 1e-9)
    bank_std = np.sqrt(up**2 * var_right + right**2 * var_up - both) / lift**2
    load_std = np.sqrt(right**2 * var_right + up**2 * var_up + both) / lift
    # Of a vehicle that may be at rest the bank is taken as 0: it may be all that the lift tilts.
    tilt = np.arctan2(np.hypot(force[0], force[1]), -force[2])
    bank_std = np.hypot(bank_std, (1 - moving) * tilt)
    return {
        'speed': speed,
        'gamma': gamma,
        'track': track,
        'bank': np.arctan2(right, up) * moving,
        'load_factor': np.hypot(right, up) / G0,
        'speed_std': np.sqrt(var_speed),
        'gamma_std': np.minimum(np.sqrt(var_gamma) / safe, _MAX_GAMMA_STD),
        'track_std': np.minimum(
            np.sqrt(var_across) / np.maximum(horizontal, REST_SPEED), MAX_TURN_STD
        ),
        'bank_std': np.minimum(bank_std, MAX_TURN_STD),
        'load_factor_std': load_std / G0,
    }


def _turned(
    track: Array, variance: frames.Vector, covariance: Array
) -> tuple[Array, Array, Array]:
    """Return the variance forward and right of a direction, and the covariance of the two."""
    c, s = np.cos(track), np.sin(track)
    north, east, _ = (np.asarray(v) for v in variance)
    forward = c**2 * north + s**2 * east + 2 * c * s * covariance
    right = s**2 * north + c**2 * east - 2 * c * s * covariance
    return forward, right, s * c * (east - north) + (c**2 - s**2) * covariance


def specific_force(vel: frames.Vector, acc: frames.Vector, lat: Array | None) -> frames.Vector:
    """Return what an accelerometer at rest in north, east, down would read [m/s^2]."""
    if lat is not None:
        phi = np.radians(lat)
        spin = (EARTH_RATE * np.cos(phi), 0.0 * phi, -EARTH_RATE * np.sin(phi))
        turned = frames.cross(spin, vel)
        acc = (acc[0] + 2 * turned[0], acc[1] + 2 * turned[1], acc[2] + 2 * turned[2])
    return acc[0], acc[1], acc[2] - G0


def bank_about(
    vel: frames.Vector, acc: frames.Vector, lat: Array | None, wind: frames.Vector
) -> tuple[Array, Array]:
    """Return the airspeed [m/s] and the bank about the velocity through the air [rad], each (n,).

    Parameters
    ----------
    vel, acc, lat
        As for `flight_path`.
    wind : three arrays (n,)
        Where the air moves to, north, east, down at the vehicle [m/s].
    """
    north, east, down = (np.asarray(v - w) for v, w in zip(vel, wind, strict=True))
    horizontal = np.hypot(north, east)
    airspeed = np.hypot(horizontal, down)
    track = np.where(horizontal > REST_SPEED, np.arctan2(east, north), 0.0)
    gamma = np.where(airspeed > REST_SPEED, np.arctan2(-down, horizontal), 0.0)
    right, up = _lift_axes(specific_force(vel, acc, lat), track, gamma)
    return airspeed, np.arctan2(right, up)


def energies(altitude: Array, vel: frames.Vector, acc: frames.Vector) -> dict[str, Array]:
    """Return the total energy per mass [J/kg], its rate [W/kg] and that per weight [m/s].

    Parameters
    ----------
    altitude : array (n,)
        [m]; the energy is potential from where this is 0.
    vel, acc : three arrays (n,)
        North, east, down at the vehicle [m/s], [m/s^2]: over the ground.

    References
    ----------
    .. [1] Stengel, *Flight Dynamics*, 2004, section 2.6, specific excess power.
    """
    kinetic = sum(np.asarray(v) ** 2 for v in vel) / 2
    power = sum(np.asarray(v * a) for v, a in zip(vel, acc, strict=True)) - G0 * np.asarray(vel[2])
    return {
        'specific_energy': np.asarray(G0 * altitude + kinetic),
        'specific_energy_rate': np.asarray(power),
        'specific_excess_power': np.asarray(power / G0),
    }


def _lift_axes(force: frames.Vector, track: Array, gamma: Array) -> tuple[Array, Array]:
    """Return the force along the wind axes of zero bank: right, and up across the velocity."""
    cos_t, sin_t = np.cos(track), np.sin(track)
    right = -sin_t * force[0] + cos_t * force[1]
    forward = cos_t * force[0] + sin_t * force[1]
    up = -(np.sin(gamma) * forward + np.cos(gamma) * force[2])
    return np.asarray(right), np.asarray(up)


def turn_from_origin(position: Array, origin: GeodeticPoint | None) -> frames.Rotation:
    """Return the rotation from north-east-down at each position (n, 3) to that at the origin."""
    if origin is None:
        return frames.IDENTITY
    lat, lon, _ = geodetic_from_ned(position[:, 0], position[:, 1], position[:, 2], origin)
    here = _earth_fixed_from_ned(lat, lon)
    there = _earth_fixed_from_ned(origin.lat, origin.lon)
    return frames.matmul(frames.transpose(there), here)


def _earth_fixed_from_ned(lat: ArrayLike, lon: ArrayLike) -> frames.Rotation:
    """Return the rotation from local NED to the earth-fixed axes, for degrees.

    North-east-down is the earth-fixed frame yawed by the longitude, then pitched down by a right
    angle and the latitude: x then points to the pole, z to the centre.
    """
    pitch = -(np.pi / 2 + np.radians(lat))
    return frames.rotation_from_euler(0.0, pitch, np.radians(lon))


def _hold(values: Array, meaningful: NDArray[np.bool_]) -> Array:
    """Return values with the meaningless ones replaced by the last (else first) meaningful."""
    if not meaningful.any():
        return np.zeros_like(values)
    index = np.maximum.accumulate(np.where(meaningful, np.arange(values.size), -1))
    index[index < 0] = np.argmax(meaningful)
    return np.asarray(values[index])


def _ramp(ratio: Array) -> Array:
    """Return 0 up to a ratio of 1, 1 from 2 on, smooth between."""
    s = np.clip(ratio - 1.0, 0.0, 1.0)
    return np.asarray(s * s * (3 - 2 * s))
