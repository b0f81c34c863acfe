"""Flights through an interval by RK4, with derivatives chained from those of the stage function.

The state at an interval's end is a composition of stage functions with sums between. Its Jacobian
and Hessian follow from theirs by the chain rule, with far fewer operations to evaluate, and to
compile, than if the composition were written out and differentiated.
"""

from functools import lru_cache
from typing import Any

import casadi as cas

from ..dynamics.stage import Stage
from ..simulation.integrator import rk4_step
from .assembly import differentiated
from .compiled import compiled_wide
from .increments import compiled_increments
from .pointwise import Pointwise, pointwise

WEIGHTS = (1 / 6, 1 / 3, 1 / 3, 1 / 6)
AHEAD = (0.0, 0.5, 0.5, 1.0)  # of a step: where the stages of RK4 stand, and how far they reach
WRITTEN_OUT = 1000
"""Operations of all stage functions in it up to which a flight is differentiated written out,
four times as many."""

Functions = tuple[cas.Function, cas.Function, cas.Function]


def written_out(stage: Stage, substeps: int) -> bool:
    """Return whether a flight through an interval is differentiated written out."""
    return bool(stage.function.n_instructions() * substeps <= WRITTEN_OUT)


@lru_cache(maxsize=64)
def flight(stage: Stage, substeps: int, *, linear: bool) -> list[Pointwise]:
    """Return the functions of a Block whose value is the state at an interval's end.

    They are made once for a stage.

    z is (x, u, time, h): state and held controls at the beginning, time there, the interval's
    length; with `linear` controls (x, u, u_end, time, h).
    """
    if not written_out(stage, substeps):
        return pointwise(chained(stage, substeps, linear=linear))
    functions = differentiated(_written_out(stage, substeps, linear))
    return pointwise(functions, compiled_wide(functions) or ())


def _written_out(stage: Stage, substeps: int, linear: bool) -> cas.Function:
    nx, nu = len(stage.states), len(stage.controls)
    ends = 1 + linear
    z, wind = cas.SX.sym('z', nx + ends * nu + 2), cas.SX.sym('wind', 3)
    x, *u, time, h = cas.vertsplit(
        z, [0, nx, *(nx + (i + 1) * nu for i in range(ends)), z.size1() - 1, z.size1()]
    )
    end = rk4_step(stage, substeps)(x, u[0], u[-1], cas.vertcat(wind, time), h)
    return cas.Function('flight', [z, wind], [end])


def chained(stage: Stage, substeps: int, *, linear: bool) -> Functions:
    """Return the same as `flight`, whatever the stage's size."""
    nx, nu = len(stage.states), len(stage.controls)
    ends = 1 + linear
    increment, slope, bend = compiled_increments(stage)
    nz = nx + ends * nu + 2
    z, wind, lam = cas.MX.sym('z', nz), cas.MX.sym('wind', 3), cas.MX.sym('lam', nx)
    x0, *u, time, h = cas.vertsplit(
        z, [0, nx, *(nx + (i + 1) * nu for i in range(ends)), nz - 1, nz]
    )

    def place(state: Any, fraction: float) -> Any:
        """Return what a stage function is evaluated at."""
        controls = u[0] + (u[-1] - u[0]) * fraction if linear else u[0]
        return cas.vertcat(state, controls, time + fraction * h, h / substeps)

    def place_slope(state_slope: Any, fraction: float) -> cas.MX:
        """Return the Jacobian of the same by z."""
        eye = cas.DM.eye(nu)
        shares = [(1 - fraction) * eye, fraction * eye] if linear else [eye]
        controls = cas.horzcat(cas.DM(nu, nx), *shares, cas.DM(nu, 2))
        last = cas.horzcat(cas.DM(2, nz - 2), cas.DM([[1, fraction], [0, 1 / substeps]]))
        slope: cas.MX = cas.vertcat(state_slope, controls, cas.sparsify(last))
        return slope

    x = x0
    for s in range(substeps):
        ks: list[Any] = []
        for i, ahead in enumerate(AHEAD):
            w = place(x + ahead * ks[-1] if i else x, (s + ahead) / substeps)
            ks.append(increment(w, wind))
        x = x + _weighted(ks)
    value = cas.Function('flight', [z, wind], [x])

    x, x_slope = x0, cas.MX(cas.horzcat(cas.DM.eye(nx), cas.DM(nx, nz - nx)))
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
    tangent = cas.Function('flight_slope', [z, wind], [x, x_slope])

    # backwards: what a change of each increment does to the product with the multipliers
    hessian, onward = cas.MX(nz, nz), lam
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
    curvature = cas.Function('flight_bend', [z, wind, lam], [hessian])
    return value, tangent, curvature


def _weighted(ks: list[Any]) -> Any:
    return sum(weight * k for weight, k in zip(WEIGHTS, ks, strict=True))
