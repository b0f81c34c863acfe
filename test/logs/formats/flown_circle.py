"""A flight whose motion is known: a climbing circle at constant speed."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from flightdyn.environment.geodesy import GeodeticPoint, geodetic_from_ned
from flightdyn.logs.any_log import read_track
from flightdyn.replay.reconstruct import reconstruct

START_S = 1_722_510_000  # 2024-08-01 11:00 UTC
SPEED, RADIUS, CLIMB = 25.0, 200.0, 2.0
CENTRE = GeodeticPoint(48.5, 9.4, 900.0)


@dataclass(frozen=True)
class Circle:
    """Samples `time` [s, Unix], lat, lon [deg], altitude [m], velocity_ned (n, 3) [m/s]."""

    time: Any
    lat: Any
    lon: Any
    altitude: Any
    velocity_ned: Any


def circle(seconds: float = 120, rate: float = 1.0) -> Circle:
    t = np.arange(0, seconds, 1 / rate)
    turn = SPEED / RADIUS * t
    north, east = RADIUS * np.cos(turn), RADIUS * np.sin(turn)
    lat, lon, altitude = geodetic_from_ned(north, east, -CLIMB * t, CENTRE)
    velocity = np.stack(
        (-SPEED * np.sin(turn), SPEED * np.cos(turn), np.full(t.size, -CLIMB)), axis=1
    )
    return Circle(START_S + t, lat, lon, altitude, velocity)


def flown_speed(path: Any, source: str | None = None) -> tuple[float, float]:
    """Median horizontal speed and climb that replay sees, without the ends."""
    motion = reconstruct(read_track(path, source))
    inner = slice(len(motion) // 5, -len(motion) // 5)
    horizontal = np.hypot(motion['u_e'], motion['v_e'])[inner]
    return float(np.median(horizontal)), float(np.median(-motion['w_e'][inner]))
