"""Linear-quadratic regulators along a trajectory, from the model's own derivatives."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import casadi as cas
import numpy as np
from numpy.typing import NDArray

from ..config import suggestion
from ..dynamics.opaque import differentiated
from ..dynamics.stage import Stage
from ..errors import InputError
from ..trajectory import Trajectory

Array = NDArray[np.float64]

POSITIONS = ('x_e', 'y_e', 'z_e')
VELOCITIES = ('u_e', 'v_e', 'w_e', 'u_b', 'v_b', 'w_b', 'speed')
DEVIATIONS = {
    **dict.fromkeys(('phi', 'theta', 'psi', 'gamma', 'track'), 0.2),
    **dict.fromkeys(('qw', 'qx', 'qy', 'qz'), 0.1),
    **dict.fromkeys(('p', 'q', 'r'), 2.0),
}
"""Deviations [rad, rad/s] that are as bad as a control off by `CONTROL_DEVIATION`."""
SHARE = 0.05  # of the way along an axis, or of the greatest speed of a plan: as bad
LEAST = 0.05  # m
LEAST_SPEED = 0.1  # m/s
CONTROL_DEVIATION = 0.25  # of a control's range
TAYLOR_TERMS = 8
"""Of the matrix exponential; a step of norm 1 then errs by 3e-6."""
STEADY = 1e-12  # relative change of the cost, below which it is that of all time
DOUBLINGS = 14  # at most 16384 steps
TRIM_STEPS = 8
TRIMMED = 1e-6  # m/s^2, rad/s^2
BLOCK = 256  # Riccati steps in one call


@dataclass(frozen=True)
class Weights:
    """What is acceptable, by Bryson's rule: each weight is 1 over the square of it.

    Parameters
    ----------
    states, controls : mapping of name to float
        Acceptable deviations in the library's units. Of what is not named: a twentieth of the
        plan's extent along an axis and of its greatest speed, at least 5 cm and 0.1 m/s; of
        angles and rates `DEVIATIONS`; of controls a quarter of their range. States besides,
        such as a mass of fuel, do not count.

    Raises
    ------
    InputError
        If one is not above 0; inf means that it does not count.
    """

    states: Mapping[str, float] = field(default_factory=dict)
    controls: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, value in (*self.states.items(), *self.controls.items()):
            if not value > 0:
                raise InputError(f'the acceptable deviation of {name} must be above 0: {value:g}')

    def matrices(
        self, stage: Stage, plan: Trajectory, ranges: Mapping[str, tuple[float, float]]
    ) -> tuple[Array, Array]:
        """Return the diagonals of Q (nx,) and R (nu,) for a plan and its controls' ranges.

        Raises
        ------
        InputError
            If a name is not of the stage, or a control without a range has no weight.
        """
        for given, known in ((self.states, stage.states), (self.controls, stage.controls)):
            for name in given:
                if name not in known:
                    raise InputError(f"weights: there is no '{name}'{suggestion(name, known)}")
        widths = {
            name: self.controls.get(name, CONTROL_DEVIATION * (ranges[name][1] - ranges[name][0]))
            for name in stage.controls
        }
        for name, width in widths.items():
            if not 0 < width < math.inf:
                raise InputError(
                    f'control {name} has no range from which a weight follows: give its weight'
                )
        speeds = [np.abs(plan.states[name]).max() for name in VELOCITIES if name in plan.states]
        deviations = {
            **DEVIATIONS,
            **dict.fromkeys(VELOCITIES, max(SHARE * max(speeds, default=0.0), LEAST_SPEED)),
            **{
                name: max(SHARE * float(np.ptp(plan.states[name])), LEAST)
                for name in POSITIONS
                if name in plan.states
            },
            **self.states,
        }
        q = np.array([deviations.get(name, math.inf) for name in stage.states])
        return q**-2.0, np.array([widths[name] for name in stage.controls]) ** -2.0


@lru_cache(maxsize=16)
def jacobians(stage: Stage) -> cas.Function:
    """Return (x, u, p) -> d(dx/dt)/dx (nx, nx), d(dx/dt)/du (nx, nu)."""
    outline = stage.outline
    w, mu = cas.vertcat(outline.x, outline.u), cas.SX.sym('mu', outline.x.size1())
    _, slope, _ = differentiated(cas.densify(outline.dx), w, mu, outline.calls)
    nx = outline.x.size1()
    return cas.Function(
        'jacobians',
        [outline.x, outline.u, outline.p],
        [cas.densify(slope[:, :nx]), cas.densify(slope[:, nx:])],
        ['x', 'u', 'p'],
        ['A', 'B'],
    )


def linearised(stage: Stage, x: Array, u: Array, p: Array) -> tuple[Array, Array]:
    """Return the linearised equations of motion at n points.

    Parameters
    ----------
    x, u, p : arrays (nx, n), (nu, n), (4, n)
        As the stage takes them.

    Returns
    -------
    A (n, nx, nx), B (n, nx, nu)
        d(dx)/dt = A dx + B du.
    """
    nx, nu, n = len(stage.states), len(stage.controls), x.shape[1]
    a, b = (part.full() for part in jacobians(stage)(x, u, p))
    return (
        a.reshape(nx, n, nx).transpose(1, 0, 2),
        b.reshape(nx, n, nu).transpose(1, 0, 2),
    )


def discretised(a: Array, b: Array, period: float) -> tuple[Array, Array]:
    """Return (n, nx, nx), (n, nx, nu) of steps of a period [s] in which the control is held.

    x(t + period) = A_d x(t) + B_d u. The exponential's series is cut short after squaring the
    step down to a norm below 1.
    """
    nx, nu = b.shape[1:]
    m = np.zeros((a.shape[0], nx + nu, nx + nu))
    m[:, :nx, :nx], m[:, :nx, nx:] = a * period, b * period
    norm = float(np.abs(m[:, :, :nx]).sum(axis=2).max()) if a.size else 0.0
    halvings = max(0, math.ceil(math.log2(norm))) if norm > 0 else 0
    m /= 2.0**halvings
    term = result = np.broadcast_to(np.eye(nx + nu), m.shape)
    for k in range(1, TAYLOR_TERMS + 1):
        term = term @ m / k
        result = result + term
    for _ in range(halvings):
        result = result @ result
    return result[:, :nx, :nx], result[:, :nx, nx:]


def gains(
    a: Array, b: Array, q: Array, r: Array, period: float, final: Array | None = None
) -> tuple[Array, Array]:
    """Return the gains that minimise the sum of x'Qx + u'Ru along a discrete trajectory.

    Parameters
    ----------
    a, b : arrays (n, nx, nx), (n, nx, nu)
        Of `discretised`.
    q, r : arrays (nx,), (nu,)
        Diagonals of Q and R; they count per second, so that gains hardly depend on the period.
    period : float [s]
    final : array (nx, nx), optional
        Cost at the end; by default what it costs to go on for ever as in the last step.

    Returns
    -------
    K (n, nu, nx), P (nx, nx)
        u = -K x, and the cost at the beginning.

    References
    ----------
    .. [1] Anderson, Moore, *Optimal Control: Linear Quadratic Methods*, 1990, chapter 2.
    """
    n, nx, nu = b.shape
    sweep = _riccati(nx, nu).mapaccum('sweep', BLOCK)
    qd, rd = np.diag(q * period), np.diag(r * period)
    cost = _steady(a[-1], b[-1], qd, rd) if final is None else final
    found = np.zeros((n, nu, nx))
    for end in range(n, 0, -BLOCK):
        steps = np.maximum(np.arange(end - 1, end - 1 - BLOCK, -1), 0)  # what is too many is cut
        count = min(BLOCK, end)
        a_row = a[steps].transpose(1, 0, 2).reshape(nx, -1)
        b_row = b[steps].transpose(1, 0, 2).reshape(nx, -1)
        costs, k = (part.full() for part in sweep(cost, a_row, b_row, qd, rd))
        cost = costs[:, (count - 1) * nx : count * nx]
        found[steps[:count]] = k.reshape(nu, BLOCK, nx).transpose(1, 0, 2)[:count]
    return found, cost


def _steady(a: Array, b: Array, q: Array, r: Array) -> Array:
    """Return the cost of a steady state; of what cannot be brought back, for a long time.

    Each round doubles the number of steps that count.

    References
    ----------
    .. [1] Chu, Fan, Lin, Wang, "Structure-preserving algorithms for periodic discrete-time
       algebraic Riccati equations", Int. J. Control 77 (2004), 767-788.
    """
    cost, reach = q, b @ np.linalg.solve(r, b.T) if b.shape[1] else np.zeros_like(q)
    for _ in range(DOUBLINGS):
        w = np.linalg.solve(np.eye(q.shape[0]) + reach @ cost, np.column_stack([a, reach]))
        v, gain = w[:, : q.shape[0]], w[:, q.shape[0] :]
        change = a.T @ cost @ v
        reach = reach + a @ gain @ a.T
        a = a @ v
        cost = cost + (change + change.T) / 2
        reach = (reach + reach.T) / 2
        if np.abs(change).max() <= STEADY * np.abs(cost).max():
            break
    return cost


@lru_cache(maxsize=16)
def _riccati(nx: int, nu: int) -> cas.Function:
    """Return (P, A, B, Q, R) -> P a step before, K in that step."""
    p, a, q = (cas.SX.sym(name, nx, nx) for name in 'PAQ')
    b, r = cas.SX.sym('B', nx, nu), cas.SX.sym('R', nu, nu)
    pb = cas.mtimes(p, b)
    k = cas.solve(r + cas.mtimes(b.T, pb), cas.mtimes(pb.T, a)) if nu else cas.SX(0, nx)
    closed = a - cas.mtimes(b, k)
    # Joseph's form keeps the cost symmetric and positive in spite of rounding
    before = q + cas.mtimes([closed.T, p, closed]) + cas.mtimes([k.T, r, k])
    return cas.Function('riccati', [p, a, b, q, r], [(before + before.T) / 2, cas.densify(k)])


def trimmed(stage: Stage, x: Array, u: Array, p: Array) -> Array | None:
    """Return controls (nu,) near u that keep velocity and attitude of a state x as they are.

    None if there are none, as for a glider that slows down. The controls' own range is not
    looked at.
    """
    steady = [i for i, name in enumerate(stage.states) if name not in POSITIONS]
    for _ in range(TRIM_STEPS):
        rate = stage.function(x, u, p)[0].full().ravel()[steady]
        if np.abs(rate).max(initial=0.0) < TRIMMED:
            return u
        _, b = linearised(stage, x[:, None], u[:, None], p[:, None])
        u = u - np.linalg.lstsq(b[0][steady], rate, rcond=None)[0]
    return None
