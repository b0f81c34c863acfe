"""Derivatives put together by blocks against CasADi's own of the whole programme."""

import casadi as cas
import numpy as np
import pytest

from flightdyn.planning.transcription import Mesh, MultipleShooting
from flightdyn.vehicles.vehicle import load_vehicle


@pytest.mark.parametrize('interpolation', ['previous', 'linear'])
@pytest.mark.parametrize('intervals', [2, 7])
def test_blocks_are_the_derivatives_of_the_programme(intervals: int, interpolation: str) -> None:
    mesh = Mesh(intervals, 2, interpolation)  # type: ignore[arg-type]
    shooting = MultipleShooting(load_vehicle('quadcopter').model().stage(), mesh)
    nlp = shooting.programme
    lam = cas.MX.sym('lam', nlp['g'].size1())
    whole = cas.Function(
        'whole',
        [nlp['x'], nlp['p'], lam],
        [
            nlp['g'],
            cas.jacobian(nlp['g'], nlp['x']),
            cas.hessian(nlp['f'] + cas.dot(lam, nlp['g']), nlp['x'])[0],
        ],
    )
    rng = np.random.default_rng(5)
    for _ in range(3):
        w, lam_g = rng.normal(size=shooting.size), rng.normal(size=lam.size1())
        p = np.concatenate([rng.normal(size=3), rng.uniform(0.5, 2, size=9)])
        g, jacobian, hessian = (value.full() for value in whole(w, p, lam_g))
        by_blocks = shooting.derivatives['jac_g'](w, p)
        np.testing.assert_allclose(by_blocks[0].full(), g, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(by_blocks[1].full(), jacobian, rtol=1e-10, atol=1e-10)
        upper = shooting.derivatives['hess_lag'](w, p, 1.0, lam_g).full()
        np.testing.assert_allclose(upper, np.triu(hessian), rtol=1e-9, atol=1e-9)
