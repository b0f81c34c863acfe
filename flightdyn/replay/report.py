"""Replay of a log in one call, and what to say of it."""

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from ..logs.track import Track
from ..trajectory import Trajectory
from .flights import Flight, find_flights
from .outliers import Rejected
from .reconstruct import reconstruct_checked
from .samples import LEAST_ATTITUDE, known_attitude
from .wind import Method

KNOWN_SPEED = 0.2
"""A speed of a larger relative 1-sigma is not reported as the highest: of two fixes, say."""


WindChoice = Literal['auto', 'circling', 'airspeed']
"""How to estimate the wind: from full turns, or from a recorded airspeed; auto prefers that."""

_NO_WIND: dict[Method, str] = {
    'circling': 'no wind: it takes a full turn at a steady airspeed',
    'airspeed': 'no wind: there is no recorded true airspeed on two courses',
}


@dataclass(frozen=True)
class Replay:
    """A log's track and the motion reconstructed from it; `wind` is how that was asked for."""

    track: Track
    trajectory: Trajectory
    rejected: Rejected = field(default_factory=Rejected)
    wind: Method | None = None

    def summary(self) -> dict[str, Any]:
        """Return figures for people and for JSON.

        Returns
        -------
        dict
            `file source schema altitude_datum clock messages used dropped segments flights origin
            duration_s distance_m max_speed max_altitude wind warnings`. Segments and flights start
            and end in seconds of the trajectory's time; distance [m] is flown within segments, not
            across gaps; altitude [m] is above the datum, or the local origin where there is none.
            The highest speed is of those known to `KNOWN_SPEED`. The wind is None, or its
            `method`, median `speed` [m/s], `from_deg` (true) and median 1-sigma `std`. Of an
            altitude or velocity that was dropped, the rest of the sample is used.
        """
        track, flown = self.track, self.trajectory
        origin = flown.origin
        altitude = flown['altitude'] if 'altitude' in flown else -flown['z_e']
        position = np.stack([flown[name] for name in ('x_e', 'y_e', 'z_e')], axis=1)
        pieces = list(flown.segments())
        distance = sum(
            float(np.linalg.norm(np.diff(position[piece], axis=0), axis=1).sum())
            for piece in pieces
        )
        return {
            'file': track.file,
            'source': track.source,
            'schema': track.schema,
            'altitude_datum': track.altitude_datum,
            'clock': track.clock,
            'messages': track.messages,
            'used': len(track) - self.rejected.samples,
            'dropped': dict(track.dropped) | self.rejected.counts,
            'segments': [
                {
                    'start': float(flown.time[piece][0]),
                    'end': float(flown.time[piece][-1]),
                    'samples': piece.stop - piece.start,
                }
                for piece in pieces
            ],
            'flights': [asdict(flight) for flight in self.flights()],
            'origin': None
            if origin is None
            else {'lat': origin.lat, 'lon': origin.lon, 'altitude': origin.altitude},
            # A clock set back starts a segment anew: the last sample need not be the latest.
            'duration_s': float(np.ptp(flown.time)),
            'distance_m': distance,
            'max_speed': _max_speed(flown),
            'max_altitude': float(altitude.max()),
            'wind': self._wind(),
            'warnings': self._warnings(),
        }

    def flights(self) -> list[Flight]:
        """Return the flights from take-off to landing, see `flights.find_flights`."""
        return find_flights(self.trajectory)

    def _wind(self) -> dict[str, Any] | None:
        flown = self.trajectory
        if self.wind is None or 'wind_x_e' not in flown:
            return None
        north, east = (float(np.median(flown[name])) for name in ('wind_x_e', 'wind_y_e'))
        return {
            'method': self.wind,
            'speed': float(np.hypot(north, east)),
            'from_deg': float(np.degrees(np.arctan2(-east, -north)) % 360),
            'std': float(np.median(flown['wind_std'])),
        }

    def _warnings(self) -> list[str]:
        track, flown = self.track, self.trajectory
        found = list(track.warnings)
        found += self.rejected.warnings(len(track))
        repeated = len(track) - len(flown) - self.rejected.samples
        if repeated:
            found.append(f'{repeated} samples had the time of the one before and were averaged')
        if self.wind is not None and 'wind_x_e' not in flown:
            found.append(_NO_WIND[self.wind])
        lonely = sum(piece.stop - piece.start < 3 for piece in flown.segments())
        if lonely:
            found.append(
                f'{lonely} segments of one or two samples: their velocity is hardly known'
            )
        if track.altitude is not None:
            blank = int((~np.isfinite(track.altitude)).sum())
            if blank == len(track):
                found.append('no altitude in the log: taken as 0')
            elif blank:
                found.append(f'{blank} samples had no altitude: interpolated')
        if track.attitude is not None:
            known = np.isfinite(known_attitude(track.attitude)).all(axis=1)
            blank = int((~known).sum())
            if known.mean() < LEAST_ATTITUDE:
                found.append(f'{blank} of {len(track)} samples had no attitude: none is used')
            elif blank:
                found.append(f'{blank} samples had no attitude: taken from those near by')
        return found


def _listed(flights: list[Flight]) -> str:
    if not flights:
        return 'none was found'
    spans = (f'{n} from {f.start:.0f} to {f.end:.0f} s' for n, f in enumerate(flights, 1))
    return 'there are ' + ', '.join(spans)


def _max_speed(flown: Trajectory) -> float:
    """Return the highest speed that is known to a fifth, else the highest of all."""
    speed = flown['speed']
    known = flown['speed_std'] < KNOWN_SPEED * speed if 'speed_std' in flown else speed > 0
    return float(speed[known].max() if known.any() else speed.max())


def replay_log(
    path: str | Path,
    *,
    source: str | None = None,
    start: float | None = None,
    end: float | None = None,
    position_std: ArrayLike | None = None,
    velocity_std: ArrayLike | None = None,
    jerk_density: ArrayLike | None = None,
    wind: WindChoice | None = None,
    flight: int | None = None,
) -> Replay:
    """Return the motion recorded in a log.

    Parameters
    ----------
    path : str or Path
        An MCAP file.
    source : str, optional
        Topic to take positions from. Default: the best there is.
    start, end : float, optional
        Seconds from the log's first sample.
    position_std, velocity_std, jerk_density
        See `reconstruct`.
    wind : 'auto', 'circling' or 'airspeed', optional
        How to estimate the wind; 'auto' is by the airspeed if the log has one.
    flight : int, optional
        Only this one of the flights found, counted from 1: take-off to landing.

    Raises
    ------
    LogError
        If the log cannot be read or has no usable position.
    InputError
        If the source or the range has no samples, or there is no such flight.
    """
    from ..logs.any_log import read_track

    if flight is not None:
        whole = replay_log(path, source=source, start=start, end=end)
        found = whole.flights()
        if not 1 <= flight <= len(found):
            raise InputError(f'{path}: there is no flight {flight}: {_listed(found)}')
        one = found[flight - 1]
        start, end = (start or 0.0) + one.start, (start or 0.0) + one.end
    return replay_track(
        read_track(path, source=source, start=start, end=end),
        position_std=position_std,
        velocity_std=velocity_std,
        jerk_density=jerk_density,
        wind=wind,
    )


def replay_track(
    track: Track,
    *,
    position_std: ArrayLike | None = None,
    velocity_std: ArrayLike | None = None,
    jerk_density: ArrayLike | None = None,
    wind: WindChoice | None = None,
) -> Replay:
    """Return the motion of a track that was read already; as `replay_log`."""
    preferred: Method = 'circling' if track.airspeed is None else 'airspeed'
    method = preferred if wind == 'auto' else wind
    trajectory, rejected = reconstruct_checked(
        track,
        position_std=position_std,
        velocity_std=velocity_std,
        jerk_density=jerk_density,
        wind=method,
    )
    return Replay(track, trajectory, rejected, method)
