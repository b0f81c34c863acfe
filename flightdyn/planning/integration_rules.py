"""Rules that tie a variable to its derivative over a mesh of nodes.

Every rule is local: an interval, or a pair of them, is integrated from the derivatives at its own
nodes. Rules that fit a curve through nodes of neighbouring intervals are left out: their equations
do not tie every node down, and an optimiser makes gains of that which the equations of motion do
not have.
"""

from typing import Any

import casadi as cas
import numpy as np

from ..errors import InputError

_NAMES = {
    'forward_euler': ('forward_euler', 'euler_forward', 'forward', 'left'),
    'backward_euler': ('backward_euler', 'euler_backward', 'backward', 'right'),
    'trapezoidal': ('trapezoidal', 'trapezoid', 'trapz', 'midpoint'),
    'hermite_simpson': ('hermite_simpson',),
}
ORDERS = {'forward_euler': 1, 'backward_euler': 1, 'trapezoidal': 2, 'hermite_simpson': 4}
_RULES = {alias: rule for rule, aliases in _NAMES.items() for alias in aliases}


def rule_name(method: str) -> str:
    """Return the rule that a name or one of its aliases stands for.

    Raises
    ------
    InputError
        If there is none; the message lists the known names.
    """
    name = method.lower().replace(' ', '_').replace('-', '_')
    if name not in _RULES:
        known = '; '.join(
            ' or '.join(aliases) + f' (order {ORDERS[rule]})' for rule, aliases in _NAMES.items()
        )
        raise InputError(f'integration method {method!r} is unknown; known: {known}')
    return _RULES[name]


def residuals(method: str, derivative: Any, variable: Any, x: Any) -> list[tuple[Any, Any]]:
    """Return pairs (change of the variable, integral of its derivative) that must be equal.

    Parameters
    ----------
    method : str
        'forward_euler' and 'backward_euler' (order 1), 'trapezoidal' (2), 'hermite_simpson' (4).
    derivative, variable, x : DM or MX (n, 1)
        d(variable)/dx, variable and independent variable at the nodes.

    Notes
    -----
    'hermite_simpson' is the separated form of the Hermite-Simpson rule: nodes 0, 2, 4, ... are
    the ends of steps and those between them the middles, so that n is odd and a middle lies
    halfway between its ends. Over a step h from a through m to b it demands

        y_b - y_a = h / 6 (f_a + 4 f_m + f_b),    y_m - (y_a + y_b) / 2 = h / 8 (f_a - f_b).

    A rule is as good as the derivative is smooth over a step. Where nothing bounds a control the
    optimum may be an impulse at one node: hermite_simpson then finds gains that are not there.
    Bound the control before asking for order 4.

    The trapezoid holds the derivative linear over an interval; its integral is also what the
    name 'midpoint' stands for here, the mean of both ends.

    References
    ----------
    .. [1] Betts, J. T., *Practical Methods for Optimal Control and Estimation Using Nonlinear
       Programming*, 2nd edition, SIAM, 2010, chapter 4.
    .. [2] Kelly, M., "An Introduction to Trajectory Optimization", SIAM Review 59 (4), 2017,
       section 4.
    """
    rule = rule_name(method)
    if rule == 'hermite_simpson':
        return _hermite_simpson(derivative, variable, x)
    left, right = derivative[:-1], derivative[1:]
    mean = {
        'forward_euler': lambda: left,
        'backward_euler': lambda: right,
        'trapezoidal': lambda: (left + right) / 2,
    }[rule]()
    return [(variable[1:] - variable[:-1], mean * (x[1:] - x[:-1]))]


def _hermite_simpson(derivative: Any, variable: Any, x: Any) -> list[tuple[Any, Any]]:
    h = x[2::2] - x[:-2:2]
    f_a, f_m, f_b = derivative[:-2:2], derivative[1::2], derivative[2::2]
    y_a, y_m, y_b = variable[:-2:2], variable[1::2], variable[2::2]
    return [
        (y_b - y_a, h / 6 * (f_a + 4 * f_m + f_b)),
        (y_m - (y_a + y_b) / 2, h / 8 * (f_a - f_b)),
    ]


def check_mesh(method: str, nodes: Any) -> None:
    """Refuse nodes that a rule cannot integrate over.

    Parameters
    ----------
    nodes : array (n,)
        The independent variable, or its value at the initial guess where that is free.

    Raises
    ------
    InputError
        If there are fewer than two nodes, or if 'hermite_simpson' gets an even number of them or
        a middle node that is not halfway between its neighbours.
    """
    n = len(nodes)
    if n < 2:
        raise InputError(f'a derivative needs at least 2 nodes to hold over, got {n}')
    if rule_name(method) != 'hermite_simpson':
        return
    if n % 2 == 0:
        raise InputError(
            f'hermite_simpson needs an odd number of nodes, got {n}: {n - 1} or {n + 1}'
        )
    middle, halfway = nodes[1::2], (nodes[:-2:2] + nodes[2::2]) / 2
    off = np.abs(middle - halfway) > 1e-6 * np.abs(nodes[2::2] - nodes[:-2:2])
    if off.any():
        node = 2 * int(np.argmax(off)) + 1
        raise InputError(
            'hermite_simpson needs every second node halfway between its neighbours; '
            f'node {node} is at {nodes[node]:.9g}, halfway is {halfway[node // 2]:.9g}'
        )


def gradient(variable: Any, x: Any) -> Any:
    """Return d(variable)/dx at the nodes from differences of second order, also at both ends.

    Each node takes the slope of the parabola through itself and its neighbours; (n, 1), n >= 3.
    """
    h = x[1:] - x[:-1]
    slope = (variable[1:] - variable[:-1]) / h
    curvature = (slope[1:] - slope[:-1]) / (h[1:] + h[:-1])
    inner = slope[:-1] + h[:-1] * curvature
    first = slope[0] - h[0] * curvature[0]
    last = slope[-1] + h[-1] * curvature[-1]
    return cas.vertcat(first, inner, last)
