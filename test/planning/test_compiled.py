"""Compiled functions: the same numbers, kept for the next time, and no failure without."""

from pathlib import Path

import casadi as cas
import numpy as np
import pytest

from flightdyn.planning import compiled as compiling
from flightdyn.planning.compiled import compiled


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
