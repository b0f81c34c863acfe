"""Opti when a problem has no solution, is not defined, or is stopped."""

import os
import signal
import threading

import casadi as cas
import numpy as np
import pytest

from flightdyn.errors import InputError, NotConvergedError, ResultCode
from flightdyn.planning.opti import Opti

QUIET = {'verbose': False}


def line_of(text):
    """Return the number of the line of this file that ends with a mark."""
    with open(__file__) as file:
        return next(i for i, line in enumerate(file, 1) if line.rstrip().endswith(text))


def test_infeasible_problem_names_constraint_line_value_and_advice():
    opti = Opti()
    thrust = opti.variable(1.0, 3, lower_bound=0, upper_bound=2)
    speed = opti.variable(10.0)
    opti.minimize(speed)
    opti.subject_to(  # mark: subject_to
        [
            speed >= 5,
            [thrust[1] * speed >= 100, speed**2 <= 49],
        ]
    )
    with pytest.raises(NotConvergedError) as caught:
        opti.solve(**QUIET)
    error, message = caught.value, str(caught.value)
    worst = message.splitlines()[2]
    assert 'constraint thrust[1] * speed >= 100' in worst
    assert f'test_opti_failures.py:{line_of("# mark: subject_to")}' in worst
    assert 'must be >= 100' in worst and 'what to try' in message
    assert error.result_code == ResultCode.INFEASIBLE and error.exit_code == 3
    assert not error.last.converged
    # The last iterate is the nearest it came: thrust at its bound, speed at the end of its range.
    assert error.last(thrust)[1] == pytest.approx(2, rel=1e-2)
    assert error.last(speed) == pytest.approx(7, rel=1e-1)


def test_derivative_that_cannot_hold_is_named():
    opti = Opti()
    x = opti.variable(0.0, 11)
    opti.constrain_derivative(1.0, x, np.linspace(0, 1, 11))
    opti.subject_to([x[0] == 0, cas.sumsqr(x[-1]) <= 0.25])
    with pytest.raises(NotConvergedError, match=r'dynamics of x \[row \d+\] \(test_opti_fail'):
        opti.solve(**QUIET)


def test_limits_of_one_variable_that_contradict_each_other_are_named():
    opti = Opti()
    mass = opti.variable(2.0, lower_bound=1)
    opti.subject_to(-2 * mass >= 6, name='a negative mass')
    opti.minimize(mass)
    with pytest.raises(NotConvergedError) as caught:
        opti.solve(**QUIET)
    message = str(caught.value)
    assert 'lower bound of mass' in message and 'a negative mass' in message
    assert 'contradict' in message


def test_unbounded_objective_is_explained():
    opti = Opti()
    x = opti.variable(1.0)
    opti.minimize(-(x**2))
    with pytest.raises(NotConvergedError, match='bound the variables'):
        opti.solve(**QUIET)


@pytest.mark.parametrize(
    ('limit', 'code'),
    [
        ({'max_iter': 3}, ResultCode.ITERATION_LIMIT),
        ({'max_runtime': 1e-9}, ResultCode.TIME_LIMIT),
    ],
)
def test_limits_end_a_solve(limit, code):
    opti = Opti()
    x = opti.variable([-1.2, 1.0])
    opti.minimize((1 - x[0]) ** 2 + 100 * (x[1] - x[0] ** 2) ** 2)
    with pytest.raises(NotConvergedError) as caught:
        opti.solve(**limit, **QUIET)
    assert caught.value.result_code == code
    last = opti.solve(**limit, behavior_on_failure='return_last', **QUIET)
    assert not last.converged and np.isfinite(last(x)).all()
    assert opti.solve(**QUIET).converged


def test_another_strategy_takes_over_within_the_limit_of_iterations():
    """IPOPT's first strategy calls this flip infeasible."""

    def flip(**arguments):
        n = 50
        opti = Opti()
        duration = opti.variable(1.5, lower_bound=0)
        time = duration * cas.DM(np.linspace(0, 1, n))
        _, _, u, w, theta, q = state = [
            opti.variable(guess, n)
            for guess in (np.linspace(0, 1, n), 0, 0, 0, np.linspace(0, -2 * np.pi, n), 0)
        ]
        left, right = (opti.variable(0.5, n, lower_bound=0, upper_bound=1) for _ in range(2))
        rates = (
            u * cas.cos(theta) + w * cas.sin(theta),
            w * cas.cos(theta) - u * cas.sin(theta),
            -9.81 * cas.sin(theta) - q * w,
            -10 * (left + right) + 9.81 * cas.cos(theta) + q * u,
            q,
            100 * (right - left),
        )
        for rate, variable in zip(rates, state, strict=True):
            opti.constrain_derivative(rate, variable, time)
        end_state = (1, 0, 0, 0, -2 * np.pi, 0)
        opti.subject_to([variable[0] == 0 for variable in state])
        opti.subject_to([v[-1] == end for v, end in zip(state, end_state, strict=True)])
        opti.minimize(duration)
        sol = opti.solve(**arguments, **QUIET)
        return sol(duration), sol.stats()['iter_count']

    with pytest.raises(NotConvergedError):
        flip(options={'ipopt.mu_strategy': 'adaptive', 'ipopt.fast_step_computation': 'yes'})
    duration, iterations = flip()
    assert duration == pytest.approx(0.83, abs=0.01)
    with pytest.raises(NotConvergedError) as caught:
        flip(max_iter=iterations - 5)
    assert caught.value.last.stats()['iter_count'] == iterations - 5
    assert caught.value.result_code == ResultCode.ITERATION_LIMIT


def problem_at(guess):
    opti = Opti()
    mass = opti.variable(guess)
    speed = opti.variable(1.0, 3)
    return opti, mass, speed


def test_nan_at_the_guess_names_constraint():
    opti, mass, speed = problem_at(-1.0)
    opti.subject_to([speed >= 0, speed[1] / cas.sqrt(mass) >= 1])  # mark: nan
    opti.minimize(mass)
    with pytest.raises(InputError) as caught:
        opti.solve(**QUIET)
    assert 'speed[1] / cas.sqrt(mass) >= 1' in str(caught.value)
    assert f'test_opti_failures.py:{line_of("# mark: nan")}) is nan' in str(caught.value)


def test_nan_at_the_guess_names_objective():
    opti, mass, _ = problem_at(-1.0)
    opti.minimize(cas.log(mass))  # mark: objective
    with pytest.raises(InputError, match=rf'objective .*:{line_of("# mark: objective")}\) is nan'):
        opti.solve(**QUIET)


def test_infinite_slope_at_the_guess_names_variable():
    opti, mass, speed = problem_at(0.0)
    opti.subject_to(cas.sqrt(mass) + speed[0] <= 1)
    opti.minimize(speed[0] ** 2 + mass**2)
    with pytest.raises(InputError, match=r'derivative of constraint .* by variable mass .* at 0'):
        opti.solve(**QUIET)


def test_guess_on_a_bound_where_the_slope_is_infinite_is_no_error():
    opti = Opti()
    x = opti.variable(0.0, lower_bound=0)
    opti.minimize((cas.sqrt(x) - 1) ** 2)
    assert opti.solve(**QUIET)(x) == pytest.approx(1, rel=1e-3)


@pytest.mark.parametrize('truth', [True, np.True_, np.array([True, True]), 1 < 2])
def test_true_is_dropped(truth):
    opti = Opti()
    x = opti.variable(1.0)
    opti.subject_to([truth, [x >= 2, (truth,)]])
    opti.minimize(x)
    assert opti.solve(**QUIET)(x) == pytest.approx(2)


@pytest.mark.parametrize('constraint', [False, np.False_, np.array([True, False]), 3.0, 'x >= 1'])
def test_false_and_what_is_no_comparison_is_refused(constraint):
    with pytest.raises(InputError, match=r'test_opti_failures.py:\d+'):
        Opti().subject_to([True, constraint])


def test_expression_is_no_constraint():
    opti = Opti()
    x = opti.variable(1.0, 2)
    with pytest.raises(InputError, match=r'x \+ 1 .* is not a constraint'):
        opti.subject_to(x + 1)
    with pytest.raises(InputError, match='scalar'):
        opti.minimize(x)


def test_declarations_can_be_found():
    opti = Opti()
    wing_area, span = opti.variable(1.0), opti.variable(1.0, 2)
    tail_area = opti.variable(1.0)
    opti.subject_to([span[0] ** 2 >= 1, span**2 >= wing_area])
    assert opti.find_variable_declaration(3).startswith('variable tail_area (test_opti_failures')
    assert 'span ** 2 >= wing_area [row 1]' in opti.find_constraint_declaration(2)
    assert __file__ in opti.find_constraint_declaration(0, use_full_filename=True)
    for find in (opti.find_variable_declaration, opti.find_constraint_declaration):
        for index in (-1, 4):
            with pytest.raises(InputError, match='counted from 0'):
                find(index)
    assert tail_area.shape == (1, 1)


def endless():
    opti = Opti()
    x = opti.variable(np.linspace(-2, 2, 20_000))
    opti.minimize(cas.sumsqr(1 - x[:-1]) + 100 * cas.sumsqr(x[1:] - x[:-1] ** 2))
    return opti, x


def test_interrupt_comes_out_of_a_solve():
    """Ctrl-C used to be taken for a failure of the solver."""
    opti, _ = endless()
    handler = signal.getsignal(signal.SIGINT)
    timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        opti.solve(max_runtime=30, options={'ipopt.tol': 1e-300}, **QUIET)
    timer.join()
    assert signal.getsignal(signal.SIGINT) is handler


def test_what_the_callback_raises_comes_out_of_a_solve():
    opti, x = endless()
    seen = []

    def callback(iteration):
        seen.append((iteration, opti.debug.value(x).shape))
        if iteration == 2:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        opti.solve(callback=callback, **QUIET)
    assert seen == [(i, (20_000,)) for i in range(3)]
    last = opti.solve(max_iter=4, behavior_on_failure='return_last', **QUIET)
    assert last.stats()['iter_count'] == 4 and len(seen) == 3
