"""Flights through an interval: derivatives chained through RK4 against CasADi's own."""

import casadi as cas
import numpy as np
import pytest

from flightdyn.dynamics.stage import Stage
from flightdyn.planning.shooting import chained
from flightdyn.simulation.integrator import rk4_step
from flightdyn.vehicles.vehicle import load_vehicle


def written_out(stage: Stage, substeps: int, linear: bool) -> cas.Function:
    nx, nu = len(stage.states), len(stage.controls)
    size = nx + (1 + linear) * nu + 2
    z, wind, lam = cas.SX.sym('z', size), cas.SX.sym('wind', 3), cas.SX.sym('lam', nx)
    x, u = z[:nx], z[nx:-2]
    p = cas.vertcat(wind, z[-2])
    end = rk4_step(stage, substeps)(x, u[:nu], u[-nu:] if nu else u, p, z[-1])
    hessian = cas.hessian(cas.dot(lam, end), z)[0]
    return cas.Function('written_out', [z, wind, lam], [end, cas.jacobian(end, z), hessian])


@pytest.mark.parametrize('linear', [False, True])
@pytest.mark.parametrize('substeps', [1, 3])
@pytest.mark.parametrize('vehicle', ['quadcopter', 'rocket'])
def test_the_chain_is_the_composition(vehicle: str, substeps: int, linear: bool) -> None:
    stage = load_vehicle(vehicle).model().stage()
    value, slope, bend = chained(stage, substeps, linear=linear)
    expected = written_out(stage, substeps, linear)
    rng = np.random.default_rng(2)
    for _ in range(2):
        given = [rng.uniform(0.5, 1.5, value.size1_in(0)), rng.normal(size=3)]
        lam = rng.normal(size=len(stage.states))
        end, jacobian, hessian = (part.full() for part in expected(*given, lam))
        np.testing.assert_allclose(value(*given).full(), end, rtol=1e-13, atol=1e-14)
        found = slope(*given)
        np.testing.assert_allclose(found[0].full(), end, rtol=1e-13, atol=1e-14)
        np.testing.assert_allclose(found[1].full(), jacobian, rtol=1e-11, atol=1e-12)
        np.testing.assert_allclose(bend(*given, lam).full(), hessian, rtol=1e-10, atol=1e-11)
