"""Derivatives of the stage function against CasADi's own and against differences."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import casadi as cas
import numpy as np
import pytest

from flightdyn.dynamics import Dynamics, DynamicsPointMass2DSpeedGamma, MassProperties
from flightdyn.dynamics.stage import Model, Stage
from flightdyn.planning.increments import increments, outputs
from flightdyn.tables import write_table
from flightdyn.vehicles.surrogate import Axis, Surrogate
from flightdyn.vehicles.vehicle import load_vehicle

TURNING = """
model: DynamicsRigidBody3DBodyEuler
mass: 10
inertia: {Ixx: 1, Iyy: 2, Izz: 2.5}
controls: {flaps: [0, 1]}
aerodynamics: {kind: table, file: table.csv, area: 2, span: 4, logarithmic: [mach]}
"""


def table() -> dict[str, np.ndarray]:
    """Return coefficients over an uneven axis, a logarithmic one, and ones of two and three."""
    axes = {
        'alpha': np.linspace(-10.0, 20.0, 13) + np.sin(np.arange(13)),
        'mach': np.array([0.02, 0.05, 0.1, 0.2, 0.5]),
        'beta': np.array([-15.0, 0.0, 15.0]),
        'flaps': np.array([0.0, 1.0]),
    }
    mesh = np.meshgrid(*axes.values(), indexing='ij')
    rows = {name: part.ravel() for name, part in zip(axes, mesh, strict=True)}
    alpha, mach, beta, flaps = rows.values()
    lift = 1.2 * np.sin(np.radians(4.0 * alpha)) * (1.0 + mach**2) + 0.3 * flaps
    side = -0.01 * beta * (1.0 + 0.2 * flaps)
    rows |= {'CL': lift, 'CD': 0.03 + 0.05 * lift**2 + side**2, 'CY': side}
    return rows | {'Cl': 0.1 * side, 'Cm': -0.1 * lift, 'Cn': -0.05 * side}


def nested() -> Stage:
    """Return a stage with two tables, one over what the other gives."""
    first = Axis('a', np.linspace(0.0, 3.0, 9))
    second = Axis('b', np.array([-2.0, -1.0, 0.5, 1.0, 2.0]))
    outer = Surrogate.fit([second], np.exp(second.nodes))
    inner = Surrogate.fit([first, second], np.sin(np.add.outer(first.nodes, second.nodes)))

    def attach(dyn: Dynamics, controls: Mapping[str, Any]) -> Mapping[str, Any]:
        found = inner({'a': dyn.speed, 'b': controls['push'] * dyn.time})
        dyn.add_force(outer({'b': found * controls['push']}), 0.0, found, axes='wind')
        return {'found': found}

    return Model(
        vehicle='nested',
        dynamics=DynamicsPointMass2DSpeedGamma,
        mass_props=MassProperties(mass=2.0),
        controls={'push': (-1.0, 1.0)},
        attach=attach,
    ).stage()


@cache
def stage_of(name: str) -> Stage:
    if name == 'nested':
        return nested()
    if name != 'turning':
        return load_vehicle(name).model().stage()
    with TemporaryDirectory() as folder:
        vehicles = Path(folder, 'vehicles')
        vehicles.mkdir()
        write_table(table(), vehicles / 'table.csv')
        (vehicles / 'turning.yaml').write_text(TURNING)
        return load_vehicle('turning', folder).model().stage()


VEHICLES = pytest.mark.parametrize(
    'vehicle', ['cessna152', 'turning', 'nested', 'quadcopter', 'rocket', 'balloon']
)
CENTRES = {
    # in the middle of the table, but for the last one near its edge, where inputs are bent
    'cessna152': [[0, -500, 40, -0.05, 5], [0, -2000, 60, 0.2, 12], [0, -500, 15.4, -0.1, 19.4]],
    'turning': [
        [0, 0, -900, 40, 2, 3, 0.1, -0.2, 0.5, 0.2, 0.1, -0.3, 0.4],
        [0, 0, -900, 7, 0.5, 2.4, 0.1, -0.2, 0.5, 0.2, 0.1, -0.3, 0.995],
    ],
    'nested': [[1, 2, 1.5, 0.3, 0.4], [1, 2, 2.98, 0.3, 0.66]],
}


def places(name: str) -> np.ndarray:
    """Return states and controls to try, one column each."""
    stage = stage_of(name)
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
@VEHICLES
def test_derivatives_are_those_of_the_stage_function(
    vehicle: str, names: tuple[str, ...] | None
) -> None:
    stage = stage_of(vehicle)
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


@VEHICLES
def test_derivatives_are_limits_of_differences(vehicle: str) -> None:
    stage = stage_of(vehicle)
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
    stage = stage_of('cessna152')
    value, slope, bend = increments(stage)
    filled, bent = cas.DM(slope.sparsity_out(1), 1), cas.DM(bend.sparsity_out(0), 1)
    time = len(stage.states) + len(stage.controls)
    for unused in (stage.states.index('x_e'), time):
        assert (filled[:, unused].nnz(), bent[:, unused].nnz()) == (0, 0)
    assert value.sparsity_out(0).is_dense()


def test_a_tables_derivatives_cost_less_than_casadis() -> None:
    stage = stage_of('cessna152')
    value, slope, bend = (function.n_instructions() for function in increments(stage))
    # three and six sums over the table beside its value; CasADi's own are 7214 and 22957
    assert slope < 2 * value
    assert bend < 3 * value


def test_without_an_outline_derivatives_are_of_the_function() -> None:
    stage = replace(stage_of('nested'), traced=None)
    w, wind, mu = [1.0, 2.0, 1.5, 0.3, 0.4, 3.0, 0.7], [0.3, -0.2, 0.1], [1.0, 2.0, 3.0, 4.0]
    for plain, other in zip(increments(stage), increments(stage_of('nested')), strict=True):
        given = [w, wind, mu][: plain.n_in()]
        for i in range(plain.n_out()):
            one, two = (np.array(f.call(given)[i]) for f in (plain, other))
            np.testing.assert_allclose(one, two, rtol=1e-12, atol=1e-12)
