"""Rules of integration of Opti.constrain_derivative."""

import casadi as cas
import numpy as np
import pytest

from flightdyn.errors import InputError
from flightdyn.planning.opti import Opti


def final_error(method, n, free_time):
    """Return the error of x(2) where dx/dt = x cos(t), x(0) = 1: x = exp(sin t)."""
    opti = Opti()
    time = np.linspace(0, 2, n)
    if free_time:
        end = opti.variable(1.9)
        opti.subject_to(end**2 == 4)
        time = end * cas.DM(np.linspace(0, 1, n))
    x = opti.variable(1.0, n)
    opti.constrain_derivative(x * cas.cos(time), x, time, method=method)
    opti.subject_to(x[0] == 1)
    return abs(opti.solve(verbose=False)(x)[-1] - np.exp(np.sin(2)))


@pytest.mark.parametrize('free_time', [False, True])
@pytest.mark.parametrize(
    ('method', 'order'),
    [('forward_euler', 1), ('backward_euler', 1), ('trapezoidal', 2), ('hermite_simpson', 4)],
)
def test_order(method, order, free_time):
    # Finer meshes would measure IPOPT's tolerance of 1e-8 instead of the fourth order.
    nodes = np.array([9, 17, 33]) if order == 4 else np.array([33, 65, 129, 257])
    errors = [final_error(method, n, free_time) for n in nodes]
    slope = np.polyfit(np.log(nodes - 1), np.log(errors), 1)[0]
    assert -slope == pytest.approx(order, abs=0.2)


@pytest.mark.parametrize(
    ('alias', 'method'),
    [
        ('forward euler', 'forward_euler'),
        ('left', 'forward_euler'),
        ('backward', 'backward_euler'),
        ('midpoint', 'trapezoidal'),
        ('Trapz', 'trapezoidal'),
    ],
)
def test_aliases(alias, method):
    assert final_error(alias, 9, False) == final_error(method, 9, False)


@pytest.mark.parametrize(
    ('method', 'power', 'exact_at'),
    [
        ('trapezoidal', 1, slice(None)),
        ('hermite_simpson', 2, slice(None)),
        ('hermite_simpson', 3, slice(0, None, 2)),  # Simpson's rule is, Hermite's middle is not
    ],
)
def test_exact_on_polynomials(method, power, exact_at):
    ends = np.array([0, 1, 1.5, 4])
    t = np.sort(np.concatenate([ends, (ends[1:] + ends[:-1]) / 2]))
    opti = Opti()
    x = opti.variable(0.0, t.size)
    opti.constrain_derivative(t**power, x, t, method)
    opti.subject_to(x[0] == 0)
    got, exact = opti.solve(verbose=False)(x), t ** (power + 1) / (power + 1)
    assert got[exact_at] == pytest.approx(exact[exact_at], abs=1e-7)


def test_optimum_is_not_beaten_with_bounded_thrust():
    """Rocket to 100 km in 100 s, thrust at most 20 MN: full thrust, then none; 232.112 t of fuel.

    The burn time of that is from z(100 s) = 100 km with v = c ln(m0 / m) - g t, c = 300 s g.
    """
    g, m0, z_final, peak = 9.81, 500e3, 100e3, 20e6
    for method in ('trapezoidal', 'hermite_simpson'):
        opti = Opti()
        n = 201
        t = np.linspace(0, 100, n)
        z = opti.variable(np.linspace(0, z_final, n))
        v = opti.variable(1000.0, n)
        m = opti.variable(m0, n)
        thrust = opti.variable(g * m0, n, lower_bound=0, upper_bound=peak)
        opti.constrain_derivative(v, z, t, method)
        opti.constrain_derivative(thrust / m - g, v, t, method)
        opti.constrain_derivative(-thrust / (300 * g), m, t, method)
        opti.subject_to([z[0] == 0, v[0] == 0, m[0] == m0, z[-1] == z_final, m >= 0])
        opti.minimize(-m[-1])
        fuel = m0 - opti.solve(verbose=False)(m[-1])
        # Not below, up to IPOPT's tolerance of 1e-8 of the mass at each of the nodes.
        assert -1 < fuel - 232_112.35 < 10


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        ({'method': 'rk45'}, r"'rk45' is unknown; known: forward_euler .*order 1.*hermite"),
        ({'method': 'simpson'}, 'unknown'),
        ({'derivative': np.ones(4)}, 'derivative 4'),
        ({'with_respect_to': np.ones(6)}, 'with_respect_to 6'),
        ({'method': 'hermite_simpson', 'n': 4}, 'odd number of nodes, got 4'),
        (
            {'method': 'hermite_simpson', 'with_respect_to': np.array([0, 1, 2, 3.5, 4])},
            'node 3 is at 3.5, halfway is 3',
        ),
        ({'n': 1}, 'at least 2'),
    ],
)
def test_what_does_not_fit_is_refused(arguments, message):
    n = arguments.pop('n', 5)
    opti = Opti()
    x = opti.variable(0.0, n)
    known = {'derivative': x, 'variable': x, 'with_respect_to': np.linspace(0, 1, n)}
    with pytest.raises(InputError, match=message):
        opti.constrain_derivative(**{**known, **arguments})


def test_uneven_free_mesh_is_refused_at_the_guess():
    opti = Opti()
    end = opti.variable(1.0)
    x = opti.variable(0.0, 5)
    time = end * cas.DM([0, 0.1, 0.5, 0.9, 1])
    with pytest.raises(InputError, match='halfway'):
        opti.constrain_derivative(x, x, time, 'hermite_simpson')


def test_derivative_as_variable():
    """Least acceleration from rest to rest over 1 m in 1 s: x = 3 t^2 - 2 t^3."""
    n = 41
    t = np.linspace(0, 1, n)
    opti = Opti()
    x = opti.variable(t)
    v = opti.derivative_of(x, t, derivative_init_guess=1.0)
    a = opti.derivative_of(v, t, derivative_init_guess=0.0, derivative_scale=5.0)
    opti.subject_to([x[0] == 0, x[-1] == 1, v[0] == 0, v[-1] == 0])
    opti.minimize(cas.sumsqr(a[1:] + a[:-1]))
    # The trapezoid's error is of second order in the step of 1/40, times the fourth derivative 0
    # and third -12: a few 1e-4.
    assert opti.solve(verbose=False)(x) == pytest.approx(3 * t**2 - 2 * t**3, abs=1e-3)


def test_explicit_derivative_is_numpys_gradient():
    t = np.array([0, 0.4, 1, 1.3, 2])
    y = np.array([1, 0, 4, 2, 7.0])
    opti = Opti()
    x = opti.variable(y)
    d = opti.derivative_of(x, t, 0.0, explicit=True)
    assert opti.at_guess(d).ravel() == pytest.approx(np.gradient(y, t, edge_order=2))
    with pytest.raises(InputError, match='3 nodes'):
        opti.derivative_of(opti.variable(1.0, 2), t[:2], 0.0, explicit=True)


@pytest.mark.parametrize('style', ['parameter', 'float'])
def test_frozen_trajectory_is_checked(style):
    def solve(slope):
        t = np.linspace(0, 1, 11)
        opti = Opti('path', freeze_style=style)
        opti.minimize(opti.variable(1.0) ** 2)
        x = opti.variable(0.3 * t, category='path')
        opti.constrain_derivative(slope, x, t)
        return opti.solve(verbose=False)

    assert solve(0.3).converged  # it holds but for rounding
    with pytest.raises(InputError, match='dynamics'):
        solve(0.4)
