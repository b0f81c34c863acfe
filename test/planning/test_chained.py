"""Derivatives chained through RK4 against CasADi's own of the composition written out."""

from pathlib import Path

import casadi as cas
import numpy as np
import pytest

from flightdyn.dynamics.stage import Stage
from flightdyn.planning import compiled as compiling
from flightdyn.planning.chained import chain
from flightdyn.planning.compiled import compiled
from flightdyn.simulation.integrator import rk4_step
from flightdyn.vehicles.vehicle import load_vehicle


def written_out(stage: Stage, intervals: int, substeps: int) -> cas.Function:
    nx, nu = len(stage.states), len(stage.controls)
    zeta, wind = cas.SX.sym('zeta', nx + 2 * nu + 1), cas.SX.sym('wind', 3)
    number, lam = cas.SX.sym('number'), cas.SX.sym('lam', nx)
    x, u0, u1, duration = cas.vertsplit(zeta, [0, nx, nx + nu, nx + 2 * nu, zeta.size1()])
    length = duration / intervals
    end = rk4_step(stage, substeps)(x, u0, u1, cas.vertcat(wind, number * length), length)
    hessian = cas.hessian(cas.dot(lam, end), zeta)[0]
    return cas.Function(
        'written_out', [zeta, wind, number, lam], [end, cas.jacobian(end, zeta), hessian]
    )


@pytest.mark.parametrize('substeps', [1, 3])
@pytest.mark.parametrize('vehicle', ['quadcopter', 'rocket'])
def test_the_chain_is_the_composition(vehicle: str, substeps: int) -> None:
    stage = load_vehicle(vehicle).model().stage()
    chained, expected = chain(stage, 7, substeps), written_out(stage, 7, substeps)
    rng = np.random.default_rng(2)
    for number in (0, 3):
        given = [rng.uniform(0.5, 1.5, chained.value.size1_in(0)), rng.normal(size=3), number]
        lam = rng.normal(size=len(stage.states))
        end, jacobian, hessian = (part.full() for part in expected(*given, lam))
        np.testing.assert_allclose(chained.value(*given).full(), end, rtol=1e-13)
        for found in (chained.tangent(*given), chained.curvature(*given, lam)):
            np.testing.assert_allclose(found[0].full(), end, rtol=1e-13)
            np.testing.assert_allclose(found[1].full(), jacobian, rtol=1e-11, atol=1e-12)
        bend = chained.curvature(*given, lam)[2].full()
        np.testing.assert_allclose(bend, hessian, rtol=1e-10, atol=1e-11)


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path))
    monkeypatch.setattr(compiling, 'WORTHWHILE', 0)
    return tmp_path / 'flightdyn' / 'compiled'


def cube(name: str = 'cube') -> cas.Function:
    x = cas.SX.sym('x', 2)
    return cas.Function(name, [x], [x**3, cas.jacobian(x**3, x)])


def test_what_is_compiled_gives_the_same_and_is_kept(cache: Path) -> None:
    (first,) = compiled([cube()])
    assert [part.full().tolist() for part in first([2.0, 3.0])] == [
        [[8], [27]],
        [[12, 0], [0, 27]],
    ]
    assert first.sparsity_out(1).nnz() == 2
    (library,) = cache.glob('*.so')
    written = library.stat().st_mtime_ns
    compiled([cube()])
    assert library.stat().st_mtime_ns == written
    compiled([cube('other')])
    assert len(list(cache.glob('*.so'))) == 2
    assert not [path for path in cache.iterdir() if path.is_dir()]


@pytest.mark.usefixtures('cache')
def test_a_function_that_has_changed_is_compiled_anew() -> None:
    x = cas.SX.sym('x')
    before, after = (
        compiled([cas.Function('f', [x], [factor * x])])[0] for factor in (2.0, 2.0 + 1e-15)
    )
    assert float(after(1.0)) > float(before(1.0)) == 2.0


@pytest.mark.usefixtures('cache')
def test_several_functions_are_compiled_together() -> None:
    both = compiled([cube(), cube('other')])
    assert [function.name() for function in both] == ['cube', 'other']
    for function in both:
        np.testing.assert_array_equal(function([2.0, 3.0])[0], [[8.0], [27.0]])


@pytest.mark.usefixtures('cache')
def test_without_a_compiler_functions_stay_as_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    function = cube()
    monkeypatch.setattr(compiling.shutil, 'which', lambda name: None)
    assert compiled([function]) == [function]


def test_a_compiler_that_fails_leaves_nothing(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = tmp_path / 'cc'
    broken.write_text('#!/bin/sh\nexit 1\n')
    broken.chmod(0o755)
    monkeypatch.setattr(compiling.shutil, 'which', lambda name: str(broken))
    function = cube()
    assert compiled([function]) == [function]
    assert not list(cache.glob('*'))


def test_an_unwritable_cache_is_no_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / 'file').write_text('')
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / 'file'))
    monkeypatch.setattr(compiling, 'WORTHWHILE', 0)
    function = cube()
    assert compiled([function]) == [function]
