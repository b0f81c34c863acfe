"""Derivatives of the stage function against CasADi's own and against differences."""

import casadi as cas
import numpy as np
import pytest

from flightdyn.dynamics.stage import Stage
from flightdyn.planning.increments import increments, outputs
from flightdyn.vehicles.vehicle import load_vehicle

STAGES = {
    name: load_vehicle(name).model().stage()
    for name in ('cessna152', 'quadcopter', 'rocket', 'balloon')
}
CENTRES = {
    # in the middle of the table, but for the last one near its edge, where inputs are bent
    'cessna152': [[0, -500, 40, -0.05, 5], [0, -2000, 60, 0.2, 12], [0, -500, 15.4, -0.1, 19.4]],
}


def places(name: str) -> np.ndarray:
    """Return states and controls to try, one column each."""
    stage = STAGES[name]
    n = len(stage.states) + len(stage.controls)
    rng = np.random.default_rng(7)
    centres = np.array(CENTRES.get(name, [np.ones(n), rng.uniform(0.5, 1.5, n)]), float)
    return (centres * rng.uniform(0.999, 1.001, centres.shape)).T


def derivatives(stage: Stage, names: tuple[str, ...] | None) -> cas.Function:
    """Return value, Jacobian and Hessian by CasADi, of increments or of outputs."""
    x, u, p, h = (cas.SX.sym(s, n) for s, n in zip('xuph', (*sizes(stage), 4, 1), strict=True))
    if names is None:
        w, value = cas.vertcat(x, u, p[3], h), h * stage.function(x, u, p)[0]
    else:
        rows = [stage.outputs.index(name) for name in names]
        w, value = cas.vertcat(x, u, p[3]), stage.function(x, u, p)[1][rows]
    mu = cas.SX.sym('mu', value.size1())
    bend = cas.hessian(cas.dot(mu, value), w)[0]
    return cas.Function('d', [w, p[:3], mu], [value, cas.jacobian(value, w), bend])


def sizes(stage: Stage) -> tuple[int, int]:
    return len(stage.states), len(stage.controls)


@pytest.mark.parametrize('names', [None, ('load_factor', 'airspeed')])
@pytest.mark.parametrize('vehicle', list(STAGES))
def test_derivatives_are_those_of_the_stage_function(
    vehicle: str, names: tuple[str, ...] | None
) -> None:
    stage = STAGES[vehicle]
    value, slope, bend = increments(stage) if names is None else outputs(stage, names)
    assert [f.name() for f in (value, slope, bend)] == [
        f'{"increment" if names is None else "output"}{what}' for what in ('', '_slope', '_bend')
    ]
    exact = derivatives(stage, names)
    rng = np.random.default_rng(3)
    for place in places(vehicle).T:
        w = [*place, 3.0] if names else [*place, 3.0, 0.7]
        wind, mu = 0.1 * rng.normal(size=3), rng.normal(size=value.size1_out(0))
        expected = [part.full() for part in exact(w, wind, mu)]
        found = [value(w, wind), *slope(w, wind), bend(w, wind, mu)]
        for part, other in zip(found, [expected[0], *expected], strict=True):
            # the sums are taken in another order: some roundings of the largest terms
            close = {'rtol': 1e-12, 'atol': 1e-12 * max(1.0, abs(other).max())}
            np.testing.assert_allclose(part.full(), other, **close)
        assert found[3].sparsity() == found[3].sparsity().T


@pytest.mark.parametrize('vehicle', list(STAGES))
def test_derivatives_are_limits_of_differences(vehicle: str) -> None:
    stage = STAGES[vehicle]
    value, slope, bend = increments(stage)
    mu = np.linspace(1.0, 2.0, len(stage.states))
    wind = [0.3, -0.2, 0.1]
    for place in places(vehicle).T:
        w = np.array([*place, 3.0, 0.7])
        first, second = slope(w, wind)[1].full(), bend(w, wind, mu).full()
        for i in range(len(w)):
            step = np.zeros(len(w))
            step[i] = 1e-5 * max(1.0, abs(w[i]))
            above, below = slope(w + step, wind), slope(w - step, wind)
            for exact, ends in (
                (first[:, i], [value(w + d, wind).full()[:, 0] for d in (step, -step)]),
                (second[:, i], [mu @ end[1].full() for end in (above, below)]),
            ):
                found = (ends[0] - ends[1]) / (2 * step[i])
                # differences are off by 1e-16 / 1e-5 and by 1e-10 of the third derivative
                scale = max(1.0, abs(exact).max(), abs(ends[0]).max())
                np.testing.assert_allclose(found, exact, rtol=1e-6, atol=1e-7 * scale)


def test_what_is_always_zero_is_not_there() -> None:
    stage = STAGES['cessna152']
    value, slope, bend = increments(stage)
    filled, bent = cas.DM(slope.sparsity_out(1), 1), cas.DM(bend.sparsity_out(0), 1)
    time = len(stage.states) + len(stage.controls)
    for unused in (stage.states.index('x_e'), time):
        assert (filled[:, unused].nnz(), bent[:, unused].nnz()) == (0, 0)
    assert value.sparsity_out(0).is_dense()
