"""Derivatives of RK4 intervals, chained from those of the stage function.

The state at an interval's end is a composition of stage functions with sums between. Its Jacobian
and Hessian follow from theirs by the chain rule, with far fewer operations to evaluate, and to
compile, than if the composition were written out and differentiated.
"""

from dataclasses import dataclass
from typing import Any

import casadi as cas

from ..dynamics.stage import Stage
from .compiled import compiled
from .increments import increments

WEIGHTS = (1 / 6, 1 / 3, 1 / 3, 1 / 6)
AHEAD = (0.0, 0.5, 0.5, 1.0)  # of a step: where the stages of RK4 stand, and how far they reach


@dataclass(frozen=True)
class Chain:
    """The flight through an interval, of zeta = (x0, u0, u1, duration of the whole).

    Parameters
    ----------
    value : Function of (zeta, wind, number)
        State at the end (nx,).
    tangent : Function of (zeta, wind, number)
        State at the end, and its Jacobian (nx, nzeta).
    curvature : Function of (zeta, wind, number, multipliers (nx,))
        State at the end, its Jacobian, and the Hessian (nzeta, nzeta) of the product of the
        multipliers and the state.
    """

    value: cas.Function
    tangent: cas.Function
    curvature: cas.Function


def chain(stage: Stage, intervals: int, substeps: int) -> Chain:
    """Return the flight through one of equal intervals, by RK4 in equal substeps.

    Controls run linearly from u0 to u1; wind is (3,); the number counts intervals from 0.
    """
    nx, nu = len(stage.states), len(stage.controls)
    increment, slope, bend = compiled(increments(stage))
    nzeta = nx + 2 * nu + 1
    zeta, wind = cas.MX.sym('zeta', nzeta), cas.MX.sym('wind', 3)
    number, lam = cas.MX.sym('number'), cas.MX.sym('lam', nx)
    x0, u0, u1, duration = cas.vertsplit(zeta, [0, nx, nx + nu, nx + 2 * nu, nzeta])
    step = 1 / (intervals * substeps)

    def place(state: Any, fraction: float) -> cas.MX:
        """Return what a stage function is evaluated at."""
        time = (number + fraction) / intervals * duration
        return cas.vertcat(state, u0 + (u1 - u0) * fraction, time, step * duration)

    def place_slope(state_slope: Any, fraction: float) -> cas.MX:
        """Return the Jacobian of the same by zeta."""
        eye = cas.DM.eye(nu)
        controls = cas.horzcat(cas.DM(nu, nx), (1 - fraction) * eye, fraction * eye, cas.DM(nu, 1))
        last = cas.vertcat((number + fraction) / intervals, step)
        return cas.vertcat(state_slope, controls, cas.horzcat(cas.MX(2, nzeta - 1), last))

    x = x0
    for s in range(substeps):
        ks: list[Any] = []
        for i, ahead in enumerate(AHEAD):
            w = place(x + ahead * ks[-1] if i else x, (s + ahead) / substeps)
            ks.append(increment(w, wind))
        x = x + _weighted(ks)
    value = cas.Function('value', [zeta, wind, number], [x])

    x, x_slope = x0, cas.MX(cas.horzcat(cas.DM.eye(nx), cas.DM(nx, nzeta - nx)))
    record: list[tuple[cas.MX, cas.MX, cas.MX]] = []
    for s in range(substeps):
        ks, k_slopes = list[Any](), list[Any]()
        for i, ahead in enumerate(AHEAD):
            fraction = (s + ahead) / substeps
            w = place(x + ahead * ks[-1] if i else x, fraction)
            w_slope = place_slope(x_slope + ahead * k_slopes[-1] if i else x_slope, fraction)
            k, jacobian = slope(w, wind)
            ks.append(k)
            k_slopes.append(cas.mtimes(jacobian, w_slope))
            record.append((w, w_slope, jacobian[:, :nx]))
        x, x_slope = x + _weighted(ks), x_slope + _weighted(k_slopes)
    tangent = cas.Function('tangent', [zeta, wind, number], [x, x_slope])

    # backwards: what a change of each increment does to the product with the multipliers
    hessian, onward = cas.MX(nzeta, nzeta), lam
    for s in reversed(range(substeps)):
        pull, total = cas.MX(nx, 1), onward
        for i in reversed(range(len(WEIGHTS))):
            w, w_slope, jacobian_x = record[s * len(WEIGHTS) + i]
            reach = AHEAD[i + 1] if i + 1 < len(AHEAD) else 0.0
            multiplier = WEIGHTS[i] * onward + reach * pull
            block = bend(w, wind, multiplier)
            hessian += cas.mtimes([w_slope.T, block, w_slope])
            pull = cas.mtimes(jacobian_x.T, multiplier)
            total = total + pull
        onward = total
    curvature = cas.Function('curvature', [zeta, wind, number, lam], [x, x_slope, hessian])
    return Chain(value, tangent, curvature)


def _weighted(ks: list[Any]) -> Any:
    return sum(weight * k for weight, k in zip(WEIGHTS, ks, strict=True))
