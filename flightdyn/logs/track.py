"""Measured columns of one source in a log, before anything is reconstructed from them."""

from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..environment.geodesy import GeodeticPoint
from ..errors import InputError

Array = NDArray[np.float64]
Datum = Literal['ellipsoid', 'msl', 'baro', 'local', 'unknown']


@dataclass(frozen=True, kw_only=True)
class Track:
    """What a position source measured, in time order, only samples that can be used.

    A source is geodetic (`lat`, `lon`, `altitude`) or local (`position_ned`), never both.

    Parameters
    ----------
    time_ns : int array (n,)
        Unix time of each sample [ns], never decreasing within a segment (a clock that jumps
        backwards starts a new one).
    segment : int array (n,)
        Which unbroken stretch each sample is in, counted from 0.
    lat, lon, altitude : array (n,) or None
        WGS84 degrees and metres above `altitude_datum`.
    position_ned : array (n, 3) or None
        Metres north, east, down of `origin` (or of an unknown point, when `origin` is None).
    velocity_ned : array (n, 3) or None
        Measured velocity over the ground, local north, east, down [m/s]; a row of NaN where
        there is none.
    attitude : array (n, 4) or None
        q_eb (w, x, y, z), body FRD to local NED.
    airspeed : array (n,) or None
        Measured true airspeed [m/s], NaN where there is none.
    position_std, velocity_std : array (n, 3) or None
        Reported 1-sigma, north, east, down [m], [m/s]; a row of NaN where unknown.
    origin : GeodeticPoint or None
        Origin of a local track, if the log says it.
    clock : 'message' or 'recorder'
        Whose times these are: those in the messages, or when they were recorded.
    source, schema : str
        Topic and schema name.
    messages : int
        How many messages the source has in the range asked for.
    dropped : mapping of reason to count
        Messages that could not be used.
    warnings : list of str
        What a user should know of this log.
    """

    time_ns: NDArray[np.int64]
    segment: NDArray[np.int64]
    lat: Array | None = None
    lon: Array | None = None
    altitude: Array | None = None
    position_ned: Array | None = None
    velocity_ned: Array | None = None
    attitude: Array | None = None
    airspeed: Array | None = None
    position_std: Array | None = None
    velocity_std: Array | None = None
    origin: GeodeticPoint | None = None
    altitude_datum: Datum = 'unknown'
    clock: Literal['message', 'recorder'] = 'message'
    file: str = ''
    source: str = ''
    schema: str = ''
    messages: int = 0
    dropped: dict[str, int] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        if (self.lat is None) == (self.position_ned is None):
            raise InputError(f'track of {self.source}: give lat/lon/altitude or position_ned')
        if self.time_ns.size == 0:
            raise InputError(f'track of {self.source} has no samples')

    def __len__(self) -> int:
        return int(self.time_ns.size)

    def first(self, count: int) -> 'Track':
        """Return the first samples alone; what is said of all the messages stays."""
        columns: dict[str, Any] = {
            name: values[:count]
            for name, values in vars(self).items()
            if isinstance(values, np.ndarray)
        }
        return replace(self, **columns)
