"""Maps of the ground: read in every form, and refused with what is wrong with them."""

import sys
from pathlib import Path

import casadi as cas
import numpy as np
import pytest

from flightdyn.environment.geodesy import GeodeticPoint, geodetic_from_ned
from flightdyn.environment.surroundings import Terrain
from flightdyn.environment.terrain_map import MAX_POINTS, read_terrain_map
from flightdyn.environment.terrain_spline import spline_through
from flightdyn.errors import InputError

X, Y = np.linspace(0, 1000, 21), np.linspace(-300, 500, 17)
HEIGHT = 100 + 40 * np.sin(X / 160)[:, None] * np.cos(Y / 130)
ORIGIN = GeodeticPoint(47.0, 8.0, 400.0)


def test_the_spline_meets_the_points_and_has_the_derivatives_of_differences() -> None:
    spline = spline_through(Terrain(X, Y, HEIGHT))
    np.testing.assert_allclose(spline.heights(*np.meshgrid(X, Y, indexing='ij')), HEIGHT, 1e-12)
    p = cas.SX.sym('p', 2)
    value = spline.heights(p[0], p[1])
    function = cas.Function('f', [p], [value, *cas.hessian(value, p)])
    h = 1e-2
    for at in np.random.default_rng(1).uniform((10, -290), (990, 490), (20, 2)):
        _, bend, slope = (each.full() for each in function(at))
        for i in range(2):
            step = h * np.eye(2)[i]
            ahead, behind = function(at + step), function(at - step)
            # third derivatives are some 1e-5: h^2 of them is 1e-9
            assert (ahead[0] - behind[0]) / (2 * h) == pytest.approx(slope[i, 0], abs=1e-8)
            # third derivatives jump between the points: half a jump times h
            rise = ((ahead[2] - behind[2]) / (2 * h)).full()[:, 0]
            np.testing.assert_allclose(rise, bend[:, i], atol=3e-7)


def test_the_spline_takes_symbols_of_columns_and_holds_the_edge() -> None:
    spline = spline_through(Terrain(X, Y, HEIGHT))
    column = cas.MX.sym('x', 3)
    found = cas.Function('f', [column], [spline.heights(column, 20.0)])([10.0, 500.0, 2000.0])
    expected = spline.heights(np.array([10.0, 500.0, 1000.0]), 20.0)
    np.testing.assert_allclose(found.full().ravel(), expected, 1e-12)


def test_two_lines_are_a_plane() -> None:
    ground = spline_through(Terrain(np.array([0.0, 10]), np.array([0.0, 10]), np.eye(2) * 10))
    assert ground.heights(5.0, 0.0) == pytest.approx(5.0)


def test_npz_and_csv_are_read_alike(tmp_path: Path) -> None:
    np.savez(tmp_path / 'map.npz', x=X, y=Y, height=HEIGHT)
    rows = [
        f'{y},{x},{h!r}'
        for x, line in zip(X, HEIGHT, strict=True)
        for y, h in zip(Y, line.tolist(), strict=True)
    ]
    np.random.default_rng(1).shuffle(rows)
    (tmp_path / 'map.csv').write_text('\n'.join(['y,x,height', *rows]) + '\n')
    for name in ('map.npz', 'map.csv'):
        found = read_terrain_map(tmp_path / name, clearance=12)
        assert repr(found) == repr(Terrain(X, Y, HEIGHT, 12)), name


def geodetic_map(tmp_path: Path) -> tuple[Path, Path]:
    """Write a hill at x_e = 800, y_e = 500 m over latitude and longitude; return NPZ and TIFF."""
    lat, lon = np.linspace(46.99, 47.02, 61), np.linspace(7.99, 8.02, 51)
    peak = [float(v) for v in geodetic_from_ned(800.0, 500.0, 0.0, ORIGIN)[:2]]
    north = (lat - peak[0])[:, None] * 111_000
    east = (lon - peak[1]) * 111_000 * np.cos(np.radians(47))
    height = 450 + 200 * np.exp(-(north**2 + east**2) / 400**2)
    np.savez(tmp_path / 'hill.npz', lat=lat, lon=lon, height=height)
    rasterio = pytest.importorskip('rasterio')
    d_lat, d_lon = lat[1] - lat[0], lon[1] - lon[0]
    with rasterio.open(
        tmp_path / 'hill.tif',
        'w',
        driver='GTiff',
        width=lon.size,
        height=lat.size,
        count=1,
        dtype='float32',
        crs='EPSG:4326',
        compress='deflate',
        transform=rasterio.transform.from_origin(
            lon[0] - d_lon / 2, lat[-1] + d_lat / 2, d_lon, d_lat
        ),
    ) as file:
        file.write(height[::-1].astype('float32'), 1)
    return tmp_path / 'hill.npz', tmp_path / 'hill.tif'


def test_maps_in_latitude_and_longitude_come_to_the_origin(tmp_path: Path) -> None:
    for path in geodetic_map(tmp_path):
        terrain = read_terrain_map(path, origin=ORIGIN)
        ground = spline_through(terrain)
        north, east = np.meshgrid(
            np.linspace(600, 1000, 81), np.linspace(300, 700, 81), indexing='ij'
        )
        heights = ground.heights(north, east)
        top = np.unravel_index(np.argmax(heights), heights.shape)
        # the map's points are 55 m apart and the hill is 400 m wide
        assert (north[top], east[top]) == pytest.approx((800, 500), abs=10), path
        assert heights.max() == pytest.approx(450 + 200 - 400, abs=1.0), path
        assert ground.heights(-500.0, -500.0) == pytest.approx(50, abs=0.1), path


def test_maps_in_latitude_and_longitude_need_an_origin(tmp_path: Path) -> None:
    for path in geodetic_map(tmp_path):
        with pytest.raises(InputError, match='origin'):
            read_terrain_map(path)


def test_without_rasterio_a_geotiff_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / 'a.tif').write_bytes(b'II')
    monkeypatch.setitem(sys.modules, 'rasterio', None)
    with pytest.raises(InputError, match=r'flightdyn\[terrain\]'):
        read_terrain_map(tmp_path / 'a.tif')


def test_bad_maps_are_refused_by_what_is_wrong(tmp_path: Path) -> None:
    gap = HEIGHT.copy()
    gap[3, 4] = np.nan
    np.savez(tmp_path / 'gap.npz', x=X, y=Y, height=gap)
    np.savez(tmp_path / 'turned.npz', x=Y, y=X, height=HEIGHT)
    np.savez(tmp_path / 'lacks.npz', x=X, height=HEIGHT)
    side = np.arange(float(int(MAX_POINTS**0.5) + 2))
    np.savez(tmp_path / 'large.npz', x=side, y=side, height=np.zeros((side.size, side.size)))
    np.savez(tmp_path / 'objects.npz', x=X, y=Y, height=np.array([None]))
    (tmp_path / 'no.npz').write_bytes(b'not a zip file')
    (tmp_path / 'words.csv').write_text('x,y,height\n0,0,a\n')
    (tmp_path / 'twice.csv').write_text('x,y,height\n0,0,1\n0,0,2\n')
    (tmp_path / 'empty.csv').write_text('')
    (tmp_path / 'map.txt').write_text('')
    told = {
        'gap.npz': r'height at \[3, 4\] is not a finite number \(1 of 357 are not\)',
        'turned.npz': r'height has shape \(21, 17\).*\(17, 21\)',
        'lacks.npz': 'has x, height, expected x, y and height',
        'large.npz': f'more than {MAX_POINTS}',
        'objects.npz': 'no NPZ file of numbers',
        'no.npz': 'no NPZ file',
        'words.csv': 'line 2 is not numbers',
        'twice.csv': 'x = 0, y = 0 is there 2 times',
        'empty.csv': 'has nothing, expected',
        'map.txt': "suffix '.txt'",
        'missing.npz': 'no such file',
    }
    for name, words in told.items():
        with pytest.raises(InputError, match=words) as error:
            read_terrain_map(tmp_path / name)
        assert name in str(error.value)


def test_a_file_that_is_no_geotiff_or_has_a_hole_is_refused(tmp_path: Path) -> None:
    rasterio = pytest.importorskip('rasterio')
    (tmp_path / 'no.tif').write_bytes(b'no picture')
    with pytest.raises(InputError, match='no GeoTIFF'):
        read_terrain_map(tmp_path / 'no.tif', origin=ORIGIN)
    heights = np.full((40, 40), 500, 'float32')
    heights[20:23, 20:23] = -9999
    with rasterio.open(
        tmp_path / 'hole.tif',
        'w',
        driver='GTiff',
        width=40,
        height=40,
        count=1,
        dtype='float32',
        crs='EPSG:4326',
        nodata=-9999,
        transform=rasterio.transform.from_origin(7.99, 47.01, 5e-4, 5e-4),
    ) as file:
        file.write(heights, 1)
    with pytest.raises(InputError, match='is not a finite number'):
        read_terrain_map(tmp_path / 'hole.tif', origin=ORIGIN)
