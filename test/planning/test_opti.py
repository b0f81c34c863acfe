"""Opti on problems whose solution is known in closed form."""

import threading
from concurrent.futures import ThreadPoolExecutor

import casadi as cas
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from flightdyn.errors import InputError
from flightdyn.planning.opti import Opti

QUIET = {'verbose': False}


def rosenbrock(x):
    return (1 - x[0]) ** 2 + 100 * (x[1] - x[0] ** 2) ** 2


def test_rosenbrock():
    opti = Opti()
    x = opti.variable([-1.2, 1.0])
    opti.minimize(rosenbrock(x))
    assert opti.solve(**QUIET)(x) == pytest.approx([1, 1], abs=1e-6)


def test_maximum():
    opti = Opti()
    x = opti.variable(0.5)
    opti.maximize(3 - (x - 2) ** 2)
    assert opti.solve(**QUIET)(x) == pytest.approx(2)


def test_feasibility_problem_needs_no_objective():
    opti = Opti()
    x = opti.variable(1.0)
    opti.subject_to(x**3 == 8)
    assert opti.solve(**QUIET)(x) == pytest.approx(2)


def test_multipliers_of_bounds_and_constraints():
    """Minimum of |x|^2 with x0 >= 1, x2 <= -2, x0 + x1 = 4 is (2, 2, -2): x0 is free there."""
    opti = Opti()
    x = opti.variable([0.0, 5.0, 7.0], scale=[1.0, 10.0, 0.1])
    low, high, equal = x[0] >= 1, x[2] <= -2, x[0] + x[1] == 4
    opti.subject_to([low, high, equal])
    opti.minimize(cas.sumsqr(x))
    sol = opti.solve(**QUIET)
    assert sol(x) == pytest.approx([2, 2, -2], abs=1e-6)
    # How much the objective would gain: 2 |x| for a limit, 2 x0 for the sum.
    multipliers = [sol(opti.dual(constraint)) for constraint in (low, high, equal)]
    assert np.abs(multipliers) == pytest.approx([0, 4, 4], abs=1e-5)


def test_brachistochrone_with_free_time():
    """Fastest slide from (0, 10) to (10, 5): a cycloid, T = phi sqrt(r / g) = 1.8016 s."""
    g, n = 9.80665, 61
    phi = brentq(lambda a: (a - np.sin(a)) / (1 - np.cos(a)) - 2, 1, 6)
    exact = phi * np.sqrt(5 / (1 - np.cos(phi)) / g)
    assert exact == pytest.approx(1.8016, abs=1e-4)

    opti = Opti()
    time = opti.variable(init_guess=1, log_transform=True) * cas.DM(np.linspace(0, 1, n))
    x = opti.variable(init_guess=np.linspace(0, 10, n))
    y = opti.variable(init_guess=np.linspace(10, 5, n))
    v = opti.variable(init_guess=5, n_vars=n, lower_bound=0)
    angle = opti.variable(init_guess=1, n_vars=n, lower_bound=0, upper_bound=np.pi)
    for f, state in ((v * cas.sin(angle), x), (-v * cas.cos(angle), y), (g * cas.cos(angle), v)):
        opti.constrain_derivative(f, state, time, method='hermite_simpson')
    opti.subject_to([x[0] == 0, y[0] == 10, v[0] == 0, x[-1] == 10, y[-1] == 5])
    opti.minimize(time[-1])
    # 30 steps of order 4 on a cycloid: far below the tenth of a millisecond asked for.
    assert opti.solve(**QUIET)(time)[-1] == pytest.approx(exact, abs=1e-4)


@given(st.floats(-4, 4), st.floats(-4, 4), st.floats(-3, 3))
def test_solution_is_independent_of_the_scales(log_x, log_y, log_f):
    """The same problem in other units of the solver: minimum of (x - 3)^2 + (y - 1)^2, x y = 1."""
    opti = Opti()
    x = opti.variable(2.0, scale=10**log_x, lower_bound=0)
    y = opti.variable(1.0, scale=10**log_y, log_transform=True)
    opti.subject_to(x * y == 1)
    opti.minimize(10**log_f * ((x - 3) ** 2 + (y - 1) ** 2))
    sol = opti.solve(**QUIET)
    # Stationarity along y = 1/x, solved with numpy: x^4 - 3 x^3 + x - 1 = 0.
    root = next(r.real for r in np.roots([1, -3, 0, 1, -1]) if abs(r.imag) < 1e-9 and r.real > 0)
    assert sol(x) == pytest.approx(root, rel=1e-4)
    assert sol(y) == pytest.approx(1 / root, rel=1e-4)


@pytest.mark.parametrize('size', [1e-9, 1e9])
def test_faint_and_steep_objectives_are_solved_alike(size):
    opti = Opti()
    x = opti.variable([-1.2, 1.0])
    opti.minimize(size * rosenbrock(x))
    assert opti.solve(**QUIET)(x) == pytest.approx([1, 1], abs=1e-5)


def test_small_states_are_integrated_as_well_as_large_ones():
    """A state of 1e-9 was met to IPOPT's absolute 1e-8 only, that is not at all."""
    n = 11
    for size in (1e-9, 1e9):
        opti = Opti()
        x = opti.variable(size, n)
        opti.constrain_derivative(-x, x, np.linspace(0, 1, n))
        opti.subject_to(x[0] / size == 1)
        ratio = (1 - 0.05) / (1 + 0.05)  # of the trapezoid over a step of 0.1
        assert opti.solve(**QUIET)(x)[-1] == pytest.approx(size * ratio**10, rel=1e-6)


def test_bounds_are_no_rows_for_the_solver_and_are_met_exactly():
    opti = Opti()
    x = opti.variable(0.5, 5, lower_bound=[-np.inf, 0, 0.1, 0, 0.3], upper_bound=1 / 3)
    opti.subject_to([x[0] >= 0.2, 3 * x[1:] <= 2])
    opti.minimize(-cas.sum(x))
    sol = opti.solve(**QUIET)
    assert all(sol.stats()['detect_simple_bounds_is_simple'])
    assert (sol(x) <= 1 / 3).all() and sol(x) == pytest.approx([1 / 3] * 5)


@pytest.mark.parametrize(
    ('arguments', 'expected'),
    [
        ({'lower_bound': 2, 'upper_bound': 4}, 3),
        ({'lower_bound': 2}, 2),
        ({'upper_bound': -1}, -1),
        ({}, 0),
        ({'lower_bound': 1, 'upper_bound': 4, 'log_transform': True}, 2),
        ({'log_transform': True}, 1),
    ],
)
def test_guess_left_out_is_inside_the_bounds(arguments, expected):
    opti = Opti()
    assert opti.at_guess(opti.variable(**arguments)) == pytest.approx(expected)


@pytest.mark.parametrize('guess', [1e-3, 1.0, 1e6])
def test_log_transformed_variable_keeps_its_bounds(guess):
    for sign, expected in ((1, 0.5e-3), (-1, 2e6)):
        opti = Opti()
        x = opti.variable(guess, log_transform=True, lower_bound=0.5e-3, upper_bound=2e6)
        opti.minimize(sign * cas.log(x))
        assert opti.solve(**QUIET)(x) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        ({'init_guess': [1.0, 2.0], 'n_vars': 3}, 'one value each'),
        ({'init_guess': np.nan}, 'finite'),
        ({'init_guess': 1, 'scale': 0}, 'positive'),
        ({'init_guess': 0, 'log_transform': True}, 'positive'),
        ({'init_guess': 1, 'log_transform': True, 'upper_bound': -1}, 'positive'),
        ({'init_guess': 1, 'n_vars': 3, 'lower_bound': [0, 1]}, '3 variables'),
        ({'init_guess': 1, 'lower_bound': np.nan}, 'lower bound'),
        ({'init_guess': 1, 'lower_bound': 2, 'upper_bound': 1}, 'above'),
    ],
)
def test_bad_variable_is_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        Opti().variable(**arguments)


@pytest.mark.parametrize('style', ['parameter', 'float'])
def test_frozen_categories_stay_at_their_guess(style):
    opti = Opti('wing', freeze_style=style)
    span = opti.variable(12.0, category='wing', log_transform=True, lower_bound=1)
    twist = opti.variable([1.0, 2.0], category='wing')
    chord = opti.variable(1.0)
    opti.subject_to([span * chord >= 24, span >= 10, twist >= 0])
    opti.minimize(chord)
    sol = opti.solve(**QUIET)
    assert sol(chord) == pytest.approx(2)
    assert sol(span) == 12 and sol(twist).tolist() == [1, 2]


def test_everything_may_be_frozen_but_one():
    opti = Opti('all')
    x = opti.variable(2.0)
    p = opti.variable(3.0, freeze=True)
    assert (opti.at_guess(x), opti.at_guess(p)) == (2, 3)
    with pytest.raises(InputError, match='no variables'):
        opti.solve(**QUIET)


def test_violated_constraint_on_frozen_variables_is_named():
    def problem(**arguments):
        opti = Opti('fuel', **arguments)
        fuel = opti.variable(2.0, category='fuel')
        x = opti.variable(1.0)
        opti.subject_to([x >= fuel, fuel >= 5])
        opti.minimize(x)
        return opti, fuel, x

    opti, fuel, x = problem()
    with pytest.raises(InputError, match=r'fuel >= 5 .*test_opti.py:\d+.* violated by 3'):
        opti.solve(**QUIET)
    assert opti.solve({fuel: 6}, **QUIET)(x) == pytest.approx(6)
    opti, fuel, x = problem(ignore_violated_parametric_constraints=True)
    assert opti.solve(**QUIET)(x) == pytest.approx(2)


def test_parameters_keep_their_values_and_the_solver():
    opti = Opti()
    p = opti.parameter([1.0, 2.0])
    x = opti.variable(0.0, 2)
    opti.minimize(cas.sumsqr(x - p))
    first = opti.solve(**QUIET)
    second = opti.solve({p: [3, 4]}, **QUIET)
    assert first(x) == pytest.approx([1, 2]) and second(x) == pytest.approx([3, 4])
    assert first(p).tolist() == [1, 2] and second(p).tolist() == [3, 4]
    with pytest.raises(InputError, match='not a parameter'):
        opti.solve({x: 1}, **QUIET)
    with pytest.raises(InputError, match='3 values for 2'):
        opti.solve({p: [1, 2, 3]}, **QUIET)


def test_solver_is_built_once_for_all_parameters(monkeypatch):
    built = []
    solver = cas.Opti.solver
    monkeypatch.setattr(cas.Opti, 'solver', lambda *a: built.append(a) or solver(*a))
    opti = Opti()
    p = opti.parameter()
    x = opti.variable(0.0)
    opti.minimize((x - p) ** 2)
    for value in (1.0, 2.0):
        opti.solve({p: value}, **QUIET)
    opti.solve_sweep({p: [3.0, 4.0]}, verbose=False)
    assert len(built) == 1


def test_the_same_limit_written_twice_is_no_contradiction():
    """0.1 + 0.2 > 0.3 in floating point."""
    opti = Opti()
    x = opti.variable(1.0, lower_bound=0.1 + 0.2)
    y = opti.variable(1.0)
    opti.subject_to([x == 0.3, y >= 2 * x])
    opti.minimize(y)
    assert opti.solve(**QUIET)(y) == pytest.approx(0.6)


def test_constraints_added_after_a_solve_count():
    opti = Opti()
    x = opti.variable(1.0)
    opti.minimize(x**2)
    opti.solve(**QUIET)
    opti.subject_to(x >= 2)
    assert opti.solve(**QUIET)(x) == pytest.approx(2)


def test_sweep_carries_on_past_failures():
    opti = Opti()
    p, q = opti.parameter(), opti.parameter(1.0)
    x = opti.variable(1.0, upper_bound=3)
    opti.subject_to(x**2 >= p)
    opti.minimize(q * x**2 + x)
    sols = opti.solve_sweep({p: np.array([1.0, 4.0, 16.0]), q: [[1.0], [2.0]]}, verbose=False)
    assert sols.shape == (2, 3)
    assert [sol.converged for sol in sols.ravel()] == [True, True, False] * 2
    assert 'x ** 2 >= p' in sols[0, 2].reason and np.isnan(sols[0, 2](x))
    values = opti.solve_sweep({p: [1.0, 16.0, 4.0]}, True, verbose=False, return_callable=True)(
        cas.vertcat(x, p)
    )
    assert values[:, 0] == pytest.approx([1, np.nan, 2], rel=1e-6, nan_ok=True)
    assert values[:, 1].tolist() == [1, 16, 4]
    with pytest.raises(InputError, match='shapes'):
        opti.solve_sweep({p: [1, 2], q: [1, 2, 3]}, verbose=False)


def test_start_from_a_solution():
    def problem():
        opti = Opti()
        x = opti.variable([-1.2, 1.0], upper_bound=[0.5, 9])
        opti.subject_to(cas.sumsqr(x) <= 2)
        opti.minimize(rosenbrock(x))
        return opti, x

    opti, x = problem()
    sol = opti.solve(**QUIET)
    other, y = problem()
    other.set_initial_from_sol(sol)
    warm = {'ipopt.mu_strategy': 'monotone', 'ipopt.mu_init': 1e-8}
    again = other.solve(options={**warm, 'ipopt.warm_start_init_point': 'yes'}, **QUIET)
    assert again(y) == pytest.approx(sol(x), abs=1e-6)
    assert again.stats()['iter_count'] < sol.stats()['iter_count']
    smaller = Opti()
    smaller.minimize(smaller.variable(1.0) ** 2)
    with pytest.raises(InputError, match='other variables'):
        smaller.set_initial_from_sol(sol)


def test_nothing_is_printed_when_quiet(capfd):
    opti = Opti()
    x = opti.variable([-1.2, 1.0])
    opti.minimize(rosenbrock(x))
    opti.solve(verbose=False)
    assert capfd.readouterr() == ('', '')
    opti.solve()
    assert 'Ipopt' in capfd.readouterr().out


@pytest.mark.parametrize('expand', [False, True])
def test_functions_that_cannot_be_expanded_still_solve(expand):
    class Square(cas.Callback):
        def __init__(self):
            super().__init__()
            self.construct('square', {'enable_fd': True})

        def eval(self, arg):
            return [arg[0] ** 2]

    square = Square()
    opti = Opti()
    x = opti.variable(1.5)
    opti.subject_to(square(x) == 4)
    sol = opti.solve(
        expand=expand, options={'ipopt.hessian_approximation': 'limited-memory'}, **QUIET
    )
    assert sol(x) == pytest.approx(2)


def test_expanding_gives_the_same_answer():
    def solve(expand):
        opti = Opti()
        x = opti.variable([-1.2, 1.0])
        opti.subject_to(cas.sumsqr(x) <= 1)
        opti.minimize(rosenbrock(x))
        return opti.solve(expand=expand, **QUIET)(x)

    assert solve(True) == pytest.approx(solve(False), abs=1e-8)


def test_two_problems_solve_in_two_threads():
    barrier = threading.Barrier(2)

    def solve(target):
        barrier.wait()
        results = []
        for k in range(20):
            opti = Opti()
            x = opti.variable(np.linspace(-1, 1, 50))
            opti.subject_to(cas.sin(x) <= 0.9)
            opti.minimize(cas.sumsqr(x - target - k / 100))
            results.append(opti.solve(**QUIET)(x)[7])
        return results

    with ThreadPoolExecutor(2) as pool:
        low, high = pool.map(solve, (0.1, 0.5))
    assert low == pytest.approx([0.1 + k / 100 for k in range(20)])
    assert high == pytest.approx([0.5 + k / 100 for k in range(20)])
