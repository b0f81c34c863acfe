"""An interval of a programme: what is flown in it, put out and paid, with exact derivatives."""

from typing import Any

import casadi as cas

from ..dynamics.stage import Stage
from ..simulation.integrator import rk4_step
from .blocks import differentiated
from .chained import Chain, chain

WRITTEN_OUT = 500
"""Operations of a stage function up to which the interval is differentiated written out."""

Functions = tuple[cas.Function, cas.Function, cas.Function, cas.Function]


def interval(
    stage: Stage,
    mesh: tuple[int, int],
    start: cas.Function,
    finish: cas.Function,
    along: cas.Function,
) -> Functions:
    """Return function, slope, tangent and curvature of a `blocks.Piece`.

    Parameters
    ----------
    stage : Stage
        Integrals among its states.
    mesh : intervals, substeps
    start : Function of (z, p)
        Gives state, controls at both ends, and the duration of the whole, (x0, u0, u1, T).
    finish : Function of (end, z, p)
        Gives cost and constraints of the state at the end, in which the constraints are linear
        and the cost is linear for a given duration.
    along : Function of (z, p)
        Gives further constraints.

    p begins with the wind and ends with the interval's number.
    """
    if stage.function.n_instructions() <= WRITTEN_OUT:
        return differentiated(_written_out(stage, mesh, start, finish, along))
    return _chained(chain(stage, *mesh), start, finish, along)


def _written_out(
    stage: Stage,
    mesh: tuple[int, int],
    start: cas.Function,
    finish: cas.Function,
    along: cas.Function,
) -> cas.Function:
    intervals, substeps = mesh
    nx, nu = len(stage.states), len(stage.controls)
    z, p = (cas.SX.sym(s, start.size1_in(i)) for i, s in enumerate('zp'))
    x, u0, u1, total = cas.vertsplit(start(z, p), [0, nx, nx + nu, nx + 2 * nu, nx + 2 * nu + 1])
    step = total / intervals
    end = rk4_step(stage, substeps)(x, u0, u1, cas.vertcat(p[:3], p[-1] * step), step)
    cost, rows = finish(end, z, p)
    return cas.Function('interval', [z, p], [cost, cas.vertcat(rows, along(z, p))])


def _chained(
    flight: Chain, start: cas.Function, finish: cas.Function, along: cas.Function
) -> Functions:
    start_slope, finish_slope, finish_bend, along_slope, along_bend = _small(start, finish, along)
    z, p = (cas.MX.sym(s, start.size1_in(i)) for i, s in enumerate('zp'))
    wind, number = p[:3], p[-1]

    cost, rows = finish(flight.value(start(z, p), wind, number), z, p)
    function = cas.Function('interval', [z, p], [cost, cas.vertcat(rows, along(z, p))])

    zeta, by_z = start_slope(z, p)
    end, by_zeta = flight.tangent(zeta, wind, number)
    cost, cost_slope, rows, rows_slope = finish_slope(end, z, p)
    further, further_slope = along_slope(z, p)
    # what `finish` depends on: the end and z itself
    whole = cas.vertcat(cas.mtimes(by_zeta, by_z), cas.MX(cas.DM.eye(z.size1())))
    slope = cas.Function('slope', [z, p], [cost, cas.mtimes(cost_slope, whole)])
    tangent = cas.Function(
        'tangent',
        [z, p],
        [
            cas.vertcat(rows, further),
            cas.vertcat(cas.mtimes(rows_slope, whole), further_slope),
        ],
    )

    m = rows.size1()
    lam_f, lam = cas.MX.sym('lam_f'), cas.MX.sym('lam', m + further.size1())
    # the multipliers of the end do not depend on where it is: `finish` is linear in it
    multipliers, _ = finish_bend(0, z, p, lam_f, lam[:m])
    end, by_zeta, bend = flight.curvature(zeta, wind, number, multipliers)
    whole = cas.vertcat(cas.mtimes(by_zeta, by_z), cas.MX(cas.DM.eye(z.size1())))
    _, outer = finish_bend(end, z, p, lam_f, lam[:m])
    hessian = (
        cas.mtimes([by_z.T, bend, by_z])
        + cas.mtimes([whole.T, outer, whole])
        + along_bend(z, p, lam[m:])
    )
    curvature = cas.Function('curvature', [z, p, lam_f, lam], [cas.triu(hessian)])
    return function, slope, tangent, curvature


def _small(start: cas.Function, finish: cas.Function, along: cas.Function) -> list[Any]:
    """Return the derivatives of the functions around the flight; `start` bends nowhere."""
    z, p = (cas.SX.sym(s, start.size1_in(i)) for i, s in enumerate('zp'))
    end = cas.SX.sym('end', finish.size1_in(0))
    zeta, (cost, rows), further = start(z, p), finish(end, z, p), along(z, p)
    both = cas.vertcat(end, z)
    lam_f, lam = cas.SX.sym('lam_f'), cas.SX.sym('lam', rows.size1())
    lam_along = cas.SX.sym('lam_along', further.size1())
    lagrangian = lam_f * cost + cas.dot(lam, rows)
    return [
        cas.Function('start_slope', [z, p], [zeta, cas.jacobian(zeta, z)]),
        cas.Function(
            'finish_slope',
            [end, z, p],
            [cost, cas.jacobian(cost, both), rows, cas.jacobian(rows, both)],
        ),
        cas.Function(
            'finish_bend',
            [end, z, p, lam_f, lam],
            [cas.gradient(lagrangian, end), cas.hessian(lagrangian, both)[0]],
        ),
        cas.Function('along_slope', [z, p], [further, cas.jacobian(further, z)]),
        cas.Function(
            'along_bend', [z, p, lam_along], [cas.hessian(cas.dot(lam_along, further), z)[0]]
        ),
    ]
