"""Derivatives put together by blocks against CasADi's own of the whole programme."""

import casadi as cas
import numpy as np
import pytest

from flightdyn.planning import blocks, interval
from flightdyn.planning.objective import TIME, maximize, minimize
from flightdyn.planning.transcription import Mesh, MultipleShooting, Structure
from flightdyn.vehicles.vehicle import load_vehicle

EVERYTHING = Structure(
    maximize(
        'final.x_e*duration - initial.airspeed**2 + exp(-final.thrust_left)*initial.thrust_right'
        '- 0.3*effort + integral.altitude/duration + integral(sin(theta)*thrust_left*time)'
    ),
    (0.5, 2.0),
    along=('airspeed', 'load_factor'),
    first=('gamma',),
    last=('airspeed', 'load_factor', 'w_e'),
)
STRUCTURES = {
    'time': Structure(TIME, (1.0, 1.0)),
    'everything': EVERYTHING,
    'integral': Structure(minimize('effort'), (0.5, 2.0)),
    'outputs': Structure(minimize('final.z_e'), (1.0, 1.0), (), ('gamma',), ('speed',)),
    'nothing': Structure(minimize('0'), (1.0, 1.0)),
}


@pytest.mark.parametrize('name', STRUCTURES)
@pytest.mark.parametrize('interpolation', ['previous', 'linear'])
@pytest.mark.parametrize('intervals', [2, 7])
@pytest.mark.parametrize('chained', [False, True])
def test_blocks_are_the_derivatives_of_the_programme(
    chained: bool, intervals: int, interpolation: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(interval, 'WRITTEN_OUT', -1 if chained else 10**6)
    mesh = Mesh(intervals, 2, interpolation)  # type: ignore[arg-type]
    stage = load_vehicle('quadcopter').model().stage()
    shooting = MultipleShooting(stage, mesh, STRUCTURES[name])
    nlp = shooting.programme
    lam_f, lam = cas.MX.sym('lam_f'), cas.MX.sym('lam', nlp['g'].size1())
    lagrangian = lam_f * nlp['f'] + cas.dot(lam, nlp['g'])
    whole = cas.Function(
        'whole',
        [nlp['x'], nlp['p'], lam_f, lam],
        [
            nlp['f'],
            cas.gradient(nlp['f'], nlp['x']),
            nlp['g'],
            cas.jacobian(nlp['g'], nlp['x']),
            cas.hessian(lagrangian, nlp['x'])[0],
        ],
    )
    rng = np.random.default_rng(5)
    for _ in range(3):
        w, lam_g = rng.uniform(0.5, 2, shooting.size), rng.normal(size=lam.size1())
        p = np.concatenate([rng.normal(size=3), rng.uniform(0.5, 2, size=shooting.scales)])
        f, gradient, g, jacobian, hessian = (v.full() for v in whole(w, p, 0.7, lam_g))
        cost, slope = shooting.derivatives['grad_f'](w, p)
        assert float(cost) == pytest.approx(f.item(), rel=1e-12)
        assert slope.is_dense()
        np.testing.assert_allclose(slope.full(), gradient, rtol=1e-9, atol=1e-9)
        by_blocks = shooting.derivatives['jac_g'](w, p)
        np.testing.assert_allclose(by_blocks[0].full(), g, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(by_blocks[1].full(), jacobian, rtol=1e-9, atol=1e-9)
        upper = shooting.derivatives['hess_lag'](w, p, 0.7, lam_g).full()
        np.testing.assert_allclose(upper, np.triu(hessian), rtol=1e-9, atol=1e-8)


@pytest.mark.parametrize('intervals', [3, 8, 9])
def test_threads_compute_the_same(intervals: int, monkeypatch: pytest.MonkeyPatch) -> None:
    stage = load_vehicle('quadcopter').model().stage()
    mesh = Mesh(intervals, 1, 'linear')
    alone = MultipleShooting(stage, mesh, EVERYTHING).derivatives
    monkeypatch.setattr(blocks, 'HEAVY', 0)
    monkeypatch.setattr(blocks.os, 'sched_getaffinity', lambda pid: range(4))
    shooting = MultipleShooting(stage, mesh, EVERYTHING)
    rng = np.random.default_rng(1)
    w, p = rng.uniform(0.5, 2, shooting.size), rng.uniform(0.5, 2, 3 + shooting.scales)
    lam = rng.normal(size=shooting.subject.size)
    for name, args in {'grad_f': (w, p), 'jac_g': (w, p), 'hess_lag': (w, p, 1.0, lam)}.items():
        found = shooting.derivatives[name](*args)
        expected = alone[name](*args)
        pairs = zip(*(v if isinstance(v, tuple) else (v,) for v in (found, expected)), strict=True)
        for one, other in pairs:
            np.testing.assert_array_equal(cas.DM(one).full(), cas.DM(other).full())


@pytest.mark.parametrize('interpolation', ['previous', 'linear'])
def test_rows_and_cost_are_those_of_the_model(interpolation: str) -> None:
    """Node by node with the stage function alone, in the user's units."""
    mesh = Mesh(3, 1, interpolation)  # type: ignore[arg-type]
    stage = load_vehicle('quadcopter').model().stage()
    objective = maximize('final.x_e - 2*initial.airspeed + integral.thrust_left*duration')
    shooting = MultipleShooting(
        stage, mesh, Structure(objective, (1.0, 1.0), ('airspeed',), ('gamma',), ('airspeed',))
    )
    rng = np.random.default_rng(2)
    w = rng.uniform(0.5, 2, shooting.size)
    scale = rng.uniform(0.5, 2, shooting.scales)
    point = shooting.unpack(w, scale)
    np.testing.assert_allclose(shooting.pack(point, scale), w, rtol=1e-14)
    p = np.concatenate([[1.0, -2.0, 0.5], scale])
    g = shooting.derivatives['jac_g'](w, p)[0].full().ravel()

    def outputs(node: int) -> dict[str, float]:
        u = point.controls[:, min(node, mesh.control_nodes - 1)]
        time = point.duration * node / 3
        found = stage.function(point.states[:, node], u, [1.0, -2.0, 0.5, time])[1]
        return dict(zip(stage.outputs, found.full().ravel(), strict=True))

    names = [shooting.quantity(int(variable)) for variable in shooting.subject]
    assert names == [*(*stage.states, 'airspeed') * 3, 'gamma', 'airspeed']
    y_scale = scale[-4:-1]
    wanted = [outputs(k)['airspeed'] / y_scale[0] for k in range(3)]
    wanted += [outputs(0)['gamma'] / y_scale[1], outputs(3)['airspeed'] / y_scale[2]]
    rows = [6, 13, 20, 21, 22]
    np.testing.assert_allclose(g[rows], np.array(wanted) - w[-6:-1], rtol=1e-12)

    thrust, step = point.controls[0], point.duration / 3
    area = step * (thrust.sum() if mesh.control_nodes == 3 else np.trapezoid(thrust))
    expected = point.states[0, -1] - 2 * outputs(0)['airspeed'] + area * point.duration
    cost = float(shooting.derivatives['grad_f'](w, p)[0])
    assert shooting.unscaled(cost, scale) == pytest.approx(expected, rel=1e-12)
