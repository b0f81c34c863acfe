"""A flight on the map: track, planned track, and where it is and faces."""

import numpy as np
from numpy.typing import NDArray

from ..errors import MissingExtraError
from . import scenery
from .archetypes import MARKED, PLANNED, Clock, send
from .coloring import Coloring
from .kinematics import Motion

try:
    import rerun as rr
except ImportError as error:
    raise MissingExtraError('a Rerun recording', 'view') from error

Array = NDArray[np.float64]

METRES_PER_DEGREE = 111_320.0  # of latitude, near enough to draw a pointer
MAX_POINTERS = 20_000
POINTER = 0.035  # of the larger side of the map that the track takes


def log_track(
    rec: rr.RecordingStream, entity: str, lat_lon: Array, motion: Motion, coloring: Coloring
) -> None:
    """Log a track (n, 2) [deg] in the colours of a quantity."""
    strips = scenery.colored_strips(motion, coloring, budget=10_000)
    if strips:
        lines = [(scenery.lines_on_map(lat_lon, s.index), s.color) for s in strips]
        track = rr.GeoLineStrings(
            lat_lon=[piece for pieces, _ in lines for piece in pieces],
            colors=[color for pieces, color in lines for _ in pieces],
            radii=rr.Radius.ui_points(2.0),
        )
        rec.log(entity, track, static=True)


def log_plain_track(
    rec: rr.RecordingStream,
    entity: str,
    lat_lon: Array,
    motion: Motion,
    *,
    color: tuple[int, int, int] = PLANNED,
    width: float = 1.2,
) -> None:
    """Log a track (n, 2) [deg] in one colour."""
    parts = scenery.drawn_samples(motion, 10_000)
    track = rr.GeoLineStrings(
        lat_lon=[line for part in parts for line in scenery.lines_on_map(lat_lon, part)],
        colors=[color],
        radii=rr.Radius.ui_points(width),
    )
    rec.log(entity, track, static=True)


def log_position(
    rec: rr.RecordingStream,
    entity: str,
    clock: Clock,
    lat_lon: Array,
    heading: Array,
    *,
    color: tuple[int, int, int] = MARKED,
) -> None:
    """Log where a vehicle is over time, with a pointer to where it faces (heading (n,) [rad])."""
    style = rr.GeoPoints.from_fields(colors=[color], radii=rr.Radius.ui_points(6.0))
    rec.log(f'{entity}/position', style, static=True)
    send(
        rec,
        f'{entity}/position',
        clock,
        lambda rows: rr.GeoPoints.columns(positions=lat_lon[rows]),
    )
    shrink = np.cos(np.radians(np.clip(lat_lon[:, 0], -85, 85)))
    spans = np.ptp(lat_lon[:, 0]), np.ptp(np.unwrap(lat_lon[:, 1], period=360)) * shrink.mean()
    length = POINTER * max(float(max(spans)), 20 / METRES_PER_DEGREE)
    ahead = np.column_stack([np.cos(heading), np.sin(heading) / shrink]) * length
    pointers = np.stack([lat_lon, lat_lon + ahead], axis=1)
    # a pointer is four times as much to write as a point, and to the eye these are enough
    some = np.unique(np.linspace(0, len(clock) - 1, min(len(clock), MAX_POINTERS)).astype(np.intp))
    pointers, clock = pointers[some], clock.take(some)
    look = rr.GeoLineStrings.from_fields(colors=[color], radii=rr.Radius.ui_points(2.5))
    rec.log(f'{entity}/heading', look, static=True)
    send(
        rec,
        f'{entity}/heading',
        clock,
        lambda rows: rr.GeoLineStrings.columns(line_strings=pointers[rows]),
    )
