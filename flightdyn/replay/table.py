"""A replayed trajectory as columns of a .parquet or .csv file, and back."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import tables
from ..environment.geodesy import GeodeticPoint, geodetic_from_ned
from ..errors import InputError
from ..trajectory import Trajectory
from .reconstruct import MODEL

STATES = ('x_e', 'y_e', 'z_e', 'speed', 'gamma', 'track')
CONTROLS = ('bank',)
COLUMNS = (
    't',
    'segment',
    *('lat', 'lon', 'altitude', 'x_e', 'y_e', 'z_e', 'u_e', 'v_e', 'w_e'),
    *('speed', 'gamma', 'track', 'bank', 'load_factor'),
    *(f'{name}_std' for name in STATES),
    *('bank_std', 'load_factor_std'),
    *('specific_energy', 'specific_energy_rate', 'specific_excess_power'),
)
"""Names in order; `t` is Unix time [ns]. A track not tied to the earth lacks lat and lon."""

_KEY = 'flightdyn'


def trajectory_to_columns(trajectory: Trajectory) -> dict[str, NDArray[Any]]:
    """Return the columns of a trajectory in the order of `COLUMNS`, then any others it has.

    Without an origin there are no `lat` and `lon`, and `altitude` is the height above the local
    origin, `-z_e`.
    """
    values: dict[str, NDArray[Any]] = dict(trajectory.columns)
    if 'altitude' not in values and 'z_e' in values:
        values['altitude'] = -trajectory['z_e']
    assert trajectory.segment is not None
    values |= {'t': trajectory.unix_ns, 'segment': trajectory.segment}
    ordered = [name for name in COLUMNS if name in values]
    return {name: values[name] for name in [*ordered, *(n for n in values if n not in COLUMNS)]}


def trajectory_from_columns(
    columns: Mapping[str, NDArray[Any]],
    *,
    start_ns: int | None = None,
    origin: GeodeticPoint | None = None,
) -> Trajectory:
    """Return the trajectory of a replay's columns.

    Parameters
    ----------
    columns : mapping of name to array (n,)
        As `trajectory_to_columns` gives them.
    start_ns : int, optional
        Unix time of `time` = 0 [ns]. Default: that of the first sample.
    origin : GeodeticPoint, optional
        Default: the point from which the first sample's x_e, y_e, z_e lead to its lat, lon and
        altitude.

    Raises
    ------
    InputError
        If a column is missing.
    """
    needed = ('t', 'segment', *STATES)
    missing = [name for name in needed if name not in columns]
    if missing:
        raise InputError(f'not a replay table: no column {", ".join(missing)}')
    ns = np.asarray(columns['t'], np.int64)
    if ns.size == 0:
        raise InputError('the replay table has no rows')
    geodetic = 'lat' in columns and 'lon' in columns and 'altitude' in columns
    if origin is None and geodetic:
        origin = _origin_of(columns)
    start = int(ns[0]) if start_ns is None else start_ns
    derived = () if geodetic else ('altitude',)
    used = {*needed, *CONTROLS, *derived}
    return Trajectory(
        time=(ns - start) / 1e9,
        states={name: columns[name] for name in STATES},
        controls={name: columns[name] for name in CONTROLS if name in columns},
        outputs={name: values for name, values in columns.items() if name not in used},
        model=MODEL,
        start_ns=start,
        origin=origin,
        segment=np.asarray(columns['segment'], np.int64),
    )


def write_table(trajectory: Trajectory, path: str | Path) -> None:
    """Write a replayed trajectory; see `flightdyn.tables.write_table` for formats and errors."""
    origin = trajectory.origin
    about = {
        'model': trajectory.model,
        'vehicle': trajectory.vehicle,
        'start_ns': trajectory.start_ns,
        'origin': None if origin is None else [origin.lat, origin.lon, origin.altitude],
    }
    tables.write_table(trajectory_to_columns(trajectory), path, {_KEY: json.dumps(about)})


def read_table(path: str | Path) -> Trajectory:
    """Return the trajectory that `write_table` wrote.

    Raises
    ------
    InputError
        If the file cannot be read or lacks a column.
    """
    columns, metadata = tables.read_table(path)
    about = json.loads(metadata.get(_KEY, '{}'))
    origin = about.get('origin')
    return trajectory_from_columns(
        columns,
        start_ns=about.get('start_ns'),
        origin=None if origin is None else GeodeticPoint(*origin),
    )


def _origin_of(columns: Mapping[str, NDArray[Any]]) -> GeodeticPoint:
    """Solve for the origin by fixed point: each step shrinks the error by distance / radius."""
    x, y, z = (float(columns[name][0]) for name in ('x_e', 'y_e', 'z_e'))
    wanted = np.array([float(columns[name][0]) for name in ('lat', 'lon', 'altitude')])
    point = wanted.copy()
    for _ in range(40):
        there = np.array([float(v) for v in geodetic_from_ned(x, y, z, GeodeticPoint(*point))])
        step = wanted - there
        step[1] = (step[1] + 180) % 360 - 180
        point += step
        point[1] = (point[1] + 180) % 360 - 180
        if (np.abs(step) < [1e-13, 1e-13, 1e-8]).all():
            break
    return GeodeticPoint(*point)
