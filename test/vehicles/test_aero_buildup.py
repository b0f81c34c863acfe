"""Sampling AeroBuildup: its cache and errors without AeroSandbox, its numbers with it."""

import sys
from pathlib import Path
from typing import Any

import casadi as cas
import numpy as np
import pytest
import yaml
from vehicle_making import evaluated, vehicle_of

import flightdyn as fd
from flightdyn.errors import InputError, MissingExtraError
from flightdyn.tables import read_table
from flightdyn.vehicles import aero_buildup
from flightdyn.vehicles.vehicle import load_vehicle

CONFIG = Path(__file__).parents[2] / 'config' / 'vehicles'

TEXT = """
model: DynamicsPointMass2DSpeedGamma
mass: 1
controls: {alpha: [-5, 15]}
aerodynamics:
  kind: buildup
  area: 1
  span: 5
  box: {airspeed: [10, 30], altitude: [0, 1000]}
  nodes: {alpha: 9, airspeed: 3, altitude: 2}
geometry:
  kind: airplane
  wings:
    - symmetric: true
      sections:
        - {le: [0, 0, 0], chord: 0.2, airfoil: naca2412}
        - {le: [0, 2.5, 0], chord: 0.2, airfoil: naca2412}
"""


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / 'cache'))
    return tmp_path / 'cache' / 'flightdyn'


def made_up(
    geometry: Any, box: dict[str, Any], counts: dict[str, int], point: Any
) -> dict[str, Any]:
    """Return coefficients on the grid that would be sampled, of no geometry."""
    axes = [aero_buildup._points(name, *box[name], counts[name]) for name in box]
    mesh = np.meshgrid(*axes, indexing='ij')
    columns = {name: part.ravel() for name, part in zip(box, mesh, strict=True)}
    lift = 0.1 * columns['alpha']
    return {**columns, 'CL': lift, 'CD': 0.02 + 0.05 * lift**2}


def test_samples_are_taken_once(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(aero_buildup, '_sample', made_up)
    first = vehicle_of(tmp_path, TEXT)
    assert len(list(cache.iterdir())) == 1
    assert first.box['alpha'] == pytest.approx((-10, 20))
    monkeypatch.delattr(aero_buildup, '_sample')
    assert repr(vehicle_of(tmp_path, TEXT)) == repr(first)


def test_another_geometry_is_another_file(
    tmp_path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(aero_buildup, '_sample', made_up)
    vehicle_of(tmp_path, TEXT)
    vehicle_of(tmp_path, TEXT.replace('2.5, 0', '2.6, 0'))
    assert len(list(cache.iterdir())) == 2


def test_without_aerosandbox_the_extra_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, 'aerosandbox', None)
    with pytest.raises(MissingExtraError, match=r"extra 'aero': pip install 'flightdyn\[aero\]'"):
        vehicle_of(tmp_path, TEXT)


@pytest.mark.parametrize(
    ('old', 'new', 'message'),
    [
        ('chord: 0.2, airfoil', 'cord: 0.2, airfoil', r"sections\[0\]: unknown 'cord', did you"),
        ('wings:', 'wing:', "geometry: unknown 'wing', did you mean 'wings'"),
        ('le: [0, 0, 0]', 'le: 0', r'le: expected \[x, y, z\], got 0'),
        ('[10, 30]', '[0, 30]', 'box: airspeed: must be positive'),
        ('[10, 30]', '[30, 10]', 'lower bound 30 is above'),
        ('alpha: 9', 'alpha: 1', 'two or more each'),
        ('nodes: {alpha', 'nodes: {alfa', "unknown 'alfa', did you mean 'alpha'"),
    ],
)
def test_bad_geometries_are_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in TEXT
    with pytest.raises(InputError, match=message):
        vehicle_of(tmp_path, TEXT.replace(old, new, 1))


def test_both_cessnas_have_one_geometry() -> None:
    clean, calibrated = (
        yaml.safe_load((CONFIG / f'{name}.yaml').read_text())
        for name in ('cessna152', 'cessna152_calibrated')
    )
    part = calibrated['aerodynamics'].pop('increments')
    assert list(part) == ['everything_else']
    assert {**clean, 'description': ''} == {**calibrated, 'description': ''}


@pytest.mark.slow
def test_the_shipped_table_is_what_aerobuildup_gives() -> None:
    pytest.importorskip('aerosandbox')
    geometry = yaml.safe_load((CONFIG / 'cessna152.yaml').read_text())['geometry']
    counts = {name: aero_buildup.NODES[name] for name in aero_buildup.BOX}
    table, _ = read_table(aero_buildup.sample_file(geometry, aero_buildup.BOX, counts))
    shipped, _ = read_table(CONFIG / 'cessna152_aero.csv')
    assert list(table) == list(shipped)
    for name, values in shipped.items():
        np.testing.assert_allclose(table[name], values, rtol=1e-5, atol=1e-7)


@pytest.mark.slow
def test_aerobuildup_takes_an_operating_point_of_symbols() -> None:
    asb = pytest.importorskip('aerosandbox')
    airplane = aero_buildup.airplane(load_vehicle('cessna152').geometry)
    x = cas.MX.sym('x', 3)
    dyn = fd.DynamicsPointMass2DSpeedGamma(speed=x[0], alpha=x[1], z_e=x[2])
    force = asb.AeroBuildup(airplane=airplane, op_point=dyn.op_point).run()['F_w']
    dyn.add_force(*force, axes='wind')
    function = cas.Function('f', [x], [cas.vertcat(*force), dyn.state_derivatives()['speed']])
    found, braking = function([50.0, 3.0, -800.0])
    # the table has the same samples, to its fit error of 6.5e-4 at most
    table = evaluated(
        load_vehicle('cessna152').model().stage(), speed=50.0, alpha=3.0, z_e=-800.0
    )[1]
    assert float(found[0]) == pytest.approx(-table['drag'], rel=1e-3)
    assert float(found[2]) == pytest.approx(-table['lift'], rel=1e-3)
    assert float(braking) == pytest.approx(float(found[0]))  # of the default mass, 1 kg
    slopes = cas.Function('j', [x], [cas.jacobian(cas.vertcat(*force), x)])([50.0, 3.0, -800.0])
    assert np.all(np.isfinite(slopes.full()))
