"""Maps of the ground from files: NPZ, CSV, GeoTIFF.

GeoTIFFs are read by rasterio (extra `terrain`), which is imported where it is used.
"""

import csv
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .geodesy import GeodeticPoint, geodetic_from_ned, ned_from_geodetic
from .surroundings import Terrain
from .terrain_spline import spline_through

Array = NDArray[np.float64]

MAX_POINTS = 100_000
"""Of a map: what a model can carry and a view can draw."""


def read_terrain_map(
    path: str | Path, clearance: float = 0.0, origin: GeodeticPoint | None = None
) -> Terrain:
    """Return the ground of a map.

    Parameters
    ----------
    path : path
        `.npz` with arrays x (n,), y (m,) [m] and height (n, m) [m], or lat, lon [deg] in place of
        x, y. `.csv` with columns of these names, a row for each point of the grid, in any order.
        `.tif`, `.tiff`: a GeoTIFF of heights, its first band, in any projection.
    clearance : float [m]
        See `Terrain`.
    origin : GeodeticPoint or None
        Of the earth axes. Maps that know where on earth they are need it: distances from it
        become x and y, and altitudes count from its altitude. Maps in x and y are left as they
        are.

    Raises
    ------
    InputError
        If the file cannot be read, lacks something, has gaps or too many points.
    """
    path = Path(path)
    readers = {'.npz': _read_npz, '.csv': _read_csv, '.tif': _read_tif, '.tiff': _read_tif}
    if path.suffix.lower() not in readers:
        raise InputError(f"terrain {path}: suffix '{path.suffix}', not {' '.join(readers)}")
    if not path.is_file():
        raise InputError(f'terrain {path}: there is no such file')
    try:
        axes, first, second, height = readers[path.suffix.lower()](path, origin)
        if height.size > MAX_POINTS:
            raise InputError(
                f'terrain: has {height.size} points, more than {MAX_POINTS}: cut out the part '
                'that is flown over, or take a coarser one'
            )
        if axes == ('lat', 'lon'):
            checked = Terrain(first, second, height)
            return _local(checked, clearance, _need_origin(origin))
        return Terrain(first, second, height, clearance)
    except InputError as error:
        raise InputError(f'{path}: {error}') from None


Found = tuple[tuple[str, str], Array, Array, Array]


def _need_origin(origin: GeodeticPoint | None) -> GeodeticPoint:
    if origin is None:
        raise InputError(
            'terrain: the map is in latitude and longitude: say with `origin: {lat, lon, '
            'altitude}` where x_e = y_e = 0 is'
        )
    return origin


def _axes(names: Any) -> tuple[str, str]:
    for axes in (('x', 'y'), ('lat', 'lon')):
        if {*axes, 'height'} <= set(names):
            return axes
    raise InputError(
        f'terrain: has {", ".join(names) or "nothing"}, expected x, y and height, or lat, lon '
        'and height'
    )


def _read_npz(path: Path, origin: GeodeticPoint | None) -> Found:
    try:
        with np.load(path, allow_pickle=False) as file:
            axes = _axes(file.files)
            first, second, height = (np.asarray(file[name], float) for name in (*axes, 'height'))
    except (OSError, ValueError, TypeError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(f'terrain: is no NPZ file of numbers: {error}') from error
    return axes, first, second, height


def _read_csv(path: Path, origin: GeodeticPoint | None) -> Found:
    try:
        with path.open(newline='', encoding='utf-8') as file:
            rows = list(csv.reader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f'terrain: cannot be read: {error}') from error
    header = [name.strip() for name in rows[0]] if rows else []
    axes = _axes(header)
    columns = [header.index(name) for name in (*axes, 'height')]
    points = np.empty((len(rows) - 1, 3))
    for i, row in enumerate(rows[1:]):
        try:
            points[i] = [float(row[column]) for column in columns]
        except (ValueError, IndexError):
            raise InputError(f'terrain: line {i + 2} is not numbers: {",".join(row)}') from None
    first, at_first = np.unique(points[:, 0], return_inverse=True)
    second, at_second = np.unique(points[:, 1], return_inverse=True)
    counts = np.zeros((first.size, second.size), int)
    np.add.at(counts, (at_first, at_second), 1)
    if (counts != 1).any():
        i, j = np.argwhere(counts != 1)[0]
        raise InputError(
            f'terrain: {axes[0]} = {first[i]:g}, {axes[1]} = {second[j]:g} is there '
            f'{counts[i, j]} times: a grid has every combination once'
        )
    height = np.empty(counts.shape)
    height[at_first, at_second] = points[:, 2]
    return axes, first, second, height


def _read_tif(path: Path, origin: GeodeticPoint | None) -> Found:
    try:
        import rasterio
        from rasterio.enums import Resampling
        from rasterio.vrt import WarpedVRT
    except ImportError:
        raise InputError(
            "terrain: GeoTIFFs need rasterio: pip install 'flightdyn[terrain]'"
        ) from None
    try:
        with rasterio.open(path) as source:
            if source.crs is None:
                raise InputError('terrain: does not say where on earth it is (no CRS)')
            here = _need_origin(origin)
            # flat-earth axes wrapped over the globe: distance and azimuth from the origin hold
            local = f'+proj=aeqd +lat_0={here.lat!r} +lon_0={here.lon!r} +datum=WGS84 +units=m'
            with WarpedVRT(source, crs=local, resampling=Resampling.cubic) as warped:
                if warped.width * warped.height > MAX_POINTS:
                    raise InputError(
                        f'terrain: has {warped.width * warped.height} points, more than '
                        f'{MAX_POINTS}: cut out the part that is flown over, or take a coarser one'
                    )
                grid = warped.read(1, masked=True).astype(float).filled(np.nan)
                transform = warped.transform
    except rasterio.errors.RasterioError as error:
        raise InputError(f'terrain: is no GeoTIFF that can be read: {error}') from error
    east = transform.c + transform.a * (np.arange(grid.shape[1]) + 0.5)
    north = transform.f + transform.e * (np.arange(grid.shape[0]) + 0.5)
    height = grid[::-1] - here.altitude
    return ('x', 'y'), *_trimmed(north[::-1], east, height)


def _trimmed(x: Array, y: Array, height: Array) -> tuple[Array, Array, Array]:
    """Return a map without edges that turning it has left empty in part."""
    while min(height.shape) > 1:
        gaps = np.isnan(height)
        edges = [gaps[0].mean(), gaps[-1].mean(), gaps[:, 0].mean(), gaps[:, -1].mean()]
        worst = int(np.argmax(edges))
        if edges[worst] == 0:
            break
        rows, columns = slice(None), slice(None)
        cut = slice(1, None) if worst % 2 == 0 else slice(None, -1)
        if worst < 2:
            rows = cut
        else:
            columns = cut
        x, y, height = x[rows], y[columns], height[rows, columns]
    return x, y, height


def _local(geodetic: Terrain, clearance: float, origin: GeodeticPoint) -> Terrain:
    """Return a map over latitude and longitude as one over x and y, as fine as it is."""
    lat, lon = geodetic.x, geodetic.y
    corner = [
        ned_from_geodetic(a, o, origin.altitude, origin)[:2]
        for a in (lat[0], lat[-1])
        for o in (lon[0], lon[-1])
    ]
    (x00, y00), (x01, y01), (x10, y10), (x11, y11) = corner
    # the rectangle inside: sides of the map are not quite straight, see the margin
    x = np.linspace(max(x00, x01), min(x10, x11), lat.size)
    y = np.linspace(max(y00, y10), min(y01, y11), lon.size)
    north, east = (each.ravel() for each in np.meshgrid(x, y, indexing='ij'))
    at = geodetic_from_ned(north, east, np.zeros_like(north), origin)
    inside = np.clip(at[0], lat[0], lat[-1]), np.clip(at[1], lon[0], lon[-1])
    height = spline_through(geodetic).heights(*inside).reshape(x.size, y.size)
    return Terrain(x, y, height - origin.altitude, clearance)
