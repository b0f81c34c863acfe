"""Programmes: exact derivatives for every method, orders, and rows that say what they should."""

import casadi as cas
import numpy as np
import pytest

from flightdyn.planning import compiled, conditions, pointwise, shooting
from flightdyn.planning.assembly import parameters
from flightdyn.planning.layout import Structure
from flightdyn.planning.mesh import METHODS, ORDERS, Mesh, lagrange, scheme, spaced
from flightdyn.planning.objective import TIME, maximize, minimize
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem_file import load_problem
from flightdyn.planning.transcription import Transcription
from flightdyn.vehicles.vehicle import load_vehicle

OBJECTIVES = {
    'time': TIME,
    'everything': maximize(
        'final.x_e*duration - initial.airspeed**2 + exp(-final.thrust_left)*initial.thrust_right'
        '- 0.3*effort**2 + integral.altitude/duration + integral(sin(theta)*thrust_left*time)'
    ),
    'nothing': minimize('0'),
}
INTERPOLATIONS = ('previous', 'linear', 'polynomial')


def make(method: str, interpolation: str, objective: str, phases: int = 2) -> Transcription:
    mesh = Mesh.of([3, 2][:phases], method, interpolation, spacing='cosine', substeps=2)  # type: ignore[arg-type]
    names = ('up', 'down')[:phases]
    structure = Structure(
        mesh,
        OBJECTIVES[objective],
        (0.5, 2.0),
        names,
        (('airspeed', 'load_factor'), ())[:phases],
        ((('gamma',), ()), ((), ('w_e', 'airspeed')))[:phases],
        rated=('thrust_right',),
    )
    return Transcription(load_vehicle('quadcopter').model().stage(), structure)


def numbers(made: Transcription, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    size, rows = made.layout.size, made.rows
    p = parameters(rng.normal(size=3), rng.uniform(0.5, 2, size), rng.uniform(0.5, 2, rows), 1.7)
    return rng.uniform(0.5, 2, size), p


@pytest.mark.parametrize('objective', OBJECTIVES)
@pytest.mark.parametrize('interpolation', INTERPOLATIONS)
@pytest.mark.parametrize('method', METHODS)
def test_derivatives_are_those_of_the_programme(
    method: str, interpolation: str, objective: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compiled, 'COMPILERS', ())  # what is compiled has no derivatives
    made = make(method, interpolation, objective)
    nlp = made.programme
    # with SX CasADi differentiates functions that are mapped in one go
    whole = cas.Function('whole', [nlp['x'], nlp['p']], [nlp['f'], nlp['g']]).expand()
    x, p = (cas.SX.sym(s, nlp[s].size1()) for s in 'xp')
    f, g = whole(x, p)
    lam_sx, lam_f_sx = cas.SX.sym('lam', made.rows), cas.SX.sym('lam_f')
    lagrangian = lam_f_sx * f + cas.dot(lam_sx, g)
    reference = cas.Function(
        'reference',
        [x, p, lam_f_sx, lam_sx],
        [f, cas.gradient(f, x), g, cas.jacobian(g, x), cas.hessian(lagrangian, x)[0]],
    )
    w, given = numbers(made, 5)
    multipliers = np.random.default_rng(7).normal(size=made.rows)
    f, gradient, g, jacobian, hessian = (v.full() for v in reference(w, given, 0.7, multipliers))
    cost, slope = made.derivatives['grad_f'](w, given)
    assert float(cost) == pytest.approx(f.item(), rel=1e-12)
    assert slope.is_dense()
    np.testing.assert_allclose(slope.full(), gradient, rtol=1e-9, atol=1e-9)
    found = made.derivatives['jac_g'](w, given)
    np.testing.assert_allclose(found[0].full(), g, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(found[1].full(), jacobian, rtol=1e-9, atol=1e-9)
    upper = made.derivatives['hess_lag'](w, given, 0.7, multipliers).full()
    np.testing.assert_allclose(upper, np.triu(hessian), rtol=1e-9, atol=1e-8)


def test_threads_and_chains_compute_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    alone = make('radau', 'linear', 'everything')
    monkeypatch.setattr(pointwise, 'HEAVY', 0)
    monkeypatch.setattr(pointwise, 'can_be_spread', lambda function: False)
    monkeypatch.setattr(pointwise.os, 'sched_getaffinity', lambda pid: range(4))
    threaded = make('radau', 'linear', 'everything')
    w, p = numbers(alone, 1)
    lam = np.ones(alone.rows)

    def found(made: Transcription) -> list[np.ndarray]:
        values = made.derivatives['jac_g'](w, p)
        return [v.full() for v in (*values, made.derivatives['hess_lag'](w, p, 1.0, lam))]

    for one, other in zip(found(alone), found(threaded), strict=True):
        np.testing.assert_array_equal(one, other)
    monkeypatch.undo()
    written = make('multiple_shooting', 'linear', 'everything')
    monkeypatch.setattr(shooting, 'WRITTEN_OUT', -1)
    chain = make('multiple_shooting', 'linear', 'everything')
    w, p = numbers(chain, 2)
    for made in (written, chain):
        made_g = made.derivatives['jac_g'](w, p)[0].full()
        np.testing.assert_allclose(made_g, written.derivatives['jac_g'](w, p)[0].full(), 1e-11)


@pytest.mark.parametrize('method', METHODS)
@pytest.mark.parametrize('interpolation', INTERPOLATIONS)
def test_rows_about_outputs_rates_and_totals(method: str, interpolation: str) -> None:
    """Point by point with the stage function alone, in SI units."""
    made = make(method, interpolation, 'time')
    layout, mesh = made.layout, made.mesh
    w = np.random.default_rng(2).uniform(0.5, 2, layout.size)
    ones = parameters([1.0, -2.0, 0.5], np.ones(layout.size), np.ones(made.rows), 1.0)
    g = made.derivatives['jac_g'](w, ones)[0].full().ravel()
    about = {int(v): row for row, v in enumerate(made.subject)}
    durations = w[layout.durations]
    for variable, each in zip(layout.outputs, layout.bounded, strict=True):
        shares = lagrange(mesh.control_positions, np.array([each.position]))[0]
        u = w[layout.steering[:, :, each.interval]] @ shares
        time = durations[: each.phase].sum() + durations[each.phase] * (
            mesh.begin[each.interval] + each.position * mesh.length[each.interval]
        )
        assert layout.time(int(variable), w) == pytest.approx(time)
        x = w[layout.state_at(each.interval, each.position)]
        outputs = made.stage.function(x, u, [1.0, -2.0, 0.5, time])[1].full().ravel()
        value = outputs[made.stage.outputs.index(each.name)]
        assert g[about[int(variable)]] == pytest.approx(w[variable] - value, rel=1e-12, abs=1e-12)
    assert g[about[layout.total]] == pytest.approx(w[layout.total] - durations.sum())
    first = layout.rates[0, 0]
    right = w[layout.controls[1]]
    where = [layout.fraction(int(v)) for v in layout.controls[1, :2]]
    step = (where[1][1] - where[0][1]) * durations[0]  # type: ignore[index]
    assert g[about[int(first)]] == pytest.approx(right[1] - right[0] - w[first] * step)


def test_rated_controls_do_not_jump_between_phases() -> None:
    """No time passes from a phase's last value to the next one's first."""
    made = make('trapezoidal', 'linear', 'time')
    layout = made.layout
    w = np.random.default_rng(2).uniform(0.5, 2, layout.size)
    ones = parameters([0, 0, 0], np.ones(layout.size), np.ones(made.rows), 1.0)
    g = made.derivatives['jac_g'](w, ones)[0].full().ravel()
    about = {int(v): row for row, v in enumerate(made.subject)}
    jump = int(layout.rates[0, 3])
    end, start = layout.steering[1, -1, 2], layout.steering[1, 0, 3]
    assert g[about[jump]] == pytest.approx(w[start] - w[end])


@pytest.mark.parametrize('method', [m for m in METHODS if m != 'multiple_shooting'])
def test_schemes_integrate_polynomials(method: str) -> None:
    """Exactly up to the degree of their points, the weights up to the order of the method."""
    s = scheme(method)
    c = np.concatenate([[0.0], s.points])
    for k in range(1, s.points.size + s.at_start + 1):
        slope = k * c ** (k - 1)
        if not s.at_start:
            slope[0] = 0
        motion = s.differences @ c[1:] ** k
        np.testing.assert_allclose(motion, slope[1:] + s.start * slope[0], atol=1e-12)
    for k in range(ORDERS[method]):
        assert s.weights @ c**k == pytest.approx(1 / (k + 1), abs=1e-13)


@pytest.mark.parametrize('method', METHODS)
def test_order_of_convergence(method: str) -> None:
    """Of a quadcopter's turn under given, held thrusts: error at the end against the step."""
    errors = []
    counts = (4, 8, 16) if method != 'radau' else (2, 4, 8)
    for n in counts:
        plan = Planner().plan(
            load_problem(
                'quadcopter_flip',
                [
                    f'transcription={method}',
                    f'nodes={n}',
                    'duration=1.2',
                    'objective={minimize: "0"}',
                    'final={}',
                    'path={thrust_left: 0.31, thrust_right: 0.3, z_e: [-100, 100]}',
                    'refine=false',
                    'sharpen=false',
                    'tolerance=1',
                ],
            )
        )
        assert plan.report.converged, plan.report.message
        errors.append(plan.report.verification['x_e'])
    slopes = np.diff(np.log(errors)) / np.diff(np.log(1 / np.array(counts)))
    # at the points inside, where it is compared too, Radau collocation is of order 4
    assert slopes[-1] == pytest.approx(min(ORDERS[method], 4), abs=0.2)


def test_spacings() -> None:
    np.testing.assert_allclose(spaced(4, 'uniform'), [0, 0.25, 0.5, 0.75, 1])
    np.testing.assert_allclose(spaced(2, 'cosine'), [0, 0.5, 1])
    np.testing.assert_allclose(spaced(4, ((0.1, 2), (1.0, 2))), [0, 0.05, 0.1, 0.55, 1])
    graded = load_problem('cessna152_glide', ['spacing={0.5: 1, 1: 3}', 'nodes=4'])
    mesh = Mesh.of([4], 'radau', 'linear', spacing=graded.spacing)
    np.testing.assert_allclose(mesh.cuts[0], [0, 0.5, 2 / 3, 5 / 6, 1])


def test_splitting_keeps_the_cuts() -> None:
    mesh = Mesh.of([2, 1], 'radau', 'linear').split([1, 2, 3])
    np.testing.assert_allclose(mesh.cuts[0], [0, 0.5, 0.75, 1])
    np.testing.assert_allclose(mesh.cuts[1], [0, 1 / 3, 2 / 3, 1])


def test_only_the_names_of_bounded_outputs_are_built_in() -> None:
    problem = load_problem(
        'quadcopter_flip', ['path={airspeed: [0, 9], x_e: [null, 4]}', 'final.gamma=0']
    )
    mesh = Mesh.of([4], 'multiple_shooting', 'previous')
    built = conditions.structure(problem, mesh)
    assert (built.along, built.ends) == ((('airspeed',),), (((), ('gamma',)),))
    other = problem.with_changes(path={'airspeed': (1.0, 7.0)}, final={'gamma': (0.0, 1.0)})
    assert conditions.structure(other, mesh) == built
