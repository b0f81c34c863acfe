"""Flights for the view tests, made by formula."""

import numpy as np

from flightdyn.environment.geodesy import GeodeticPoint, geodetic_from_ned
from flightdyn.trajectory import Trajectory


def flip(n: int = 80, wobble: float = 0.0) -> Trajectory:
    """Return a quadcopter's nose-forward flip over 1 m in 0.8 s."""
    t = np.linspace(0, 0.8, n)
    s = t / 0.8
    blend = s**3 * (10 - 15 * s + 6 * s**2)
    x = blend + wobble * np.sin(2 * np.pi * s) * s
    z = -0.45 * np.sin(np.pi * s) ** 2
    theta = -2 * np.pi * blend
    u_e, w_e = np.gradient(x, t), np.gradient(z, t)
    return Trajectory(
        time=t,
        states={
            'x_e': x,
            'z_e': z,
            'u_b': np.cos(theta) * u_e - np.sin(theta) * w_e,
            'w_b': np.sin(theta) * u_e + np.cos(theta) * w_e,
            'theta': theta,
            'q': np.gradient(theta, t),
        },
        controls={
            'thrust_left': (s < 0.5) * 1.0,
            'thrust_right': (s >= 0.5) * 1.0,
        },
        model='DynamicsRigidBody2DBody',
        vehicle='quadcopter',
        problem='quadcopter_flip',
        control_interpolation='previous',
    )


def soaring(n: int = 600, gap: bool = True) -> Trajectory:
    """Return a circling, drifting glider with a date, a place, 1-sigmas and a gap."""
    t = np.arange(n) * 1.0
    segment = np.zeros(n, int)
    if gap:
        t[n // 2 :] += 120.0
        segment[n // 2 :] = 1
    track = np.mod(0.2 * t, 2 * np.pi)
    x, y, z = 6 * t + 150 * np.sin(0.2 * t), -150 * np.cos(0.2 * t), -500 - 1.5 * t
    origin = GeodeticPoint(50.29, 8.54, 300.0)
    lat, lon, altitude = geodetic_from_ned(x, y, z, origin)
    speed = np.full(n, 30.0) + np.sin(0.05 * t)
    return Trajectory(
        time=t,
        states={
            'x_e': x, 'y_e': y, 'z_e': z, 'speed': speed,
            'gamma': np.full(n, 0.05), 'track': track,
        },
        controls={'bank': np.full(n, np.arctan(0.2 * 30 / 9.81))},
        outputs={
            'lat': lat, 'lon': lon, 'altitude': altitude, 'load_factor': np.full(n, 1.17),
            'speed_std': np.full(n, 0.4), 'altitude_std': np.full(n, 3.0),
        },
        model='DynamicsPointMass3DSpeedGammaTrack',
        vehicle='glider',
        start_ns=1_532_865_178_000_000_000,
        origin=origin,
        segment=segment,
    )  # fmt: skip


def by_label(figure):
    """Return the axes of a figure by what is written at their upright sides, in one line."""
    return {' '.join(ax.get_ylabel().split()): ax for ax in figure.axes}
