"""Exact derivatives of a programme whose constraints are one function, once for each interval.

The function's Jacobian and Hessian are traced once with scalars, mapped over the intervals, and
their elements put where they belong. Differentiating the whole programme instead costs several
times more an iteration.
"""

from typing import Any

import casadi as cas
import numpy as np
from numpy.typing import NDArray

Index = NDArray[np.int64]


def block_derivatives(
    interval: cas.Function, gather: Index, linear: tuple[Index, Index], rows: int, size: int
) -> dict[str, Any]:
    """Return `jac_g` and `hess_lag` for CasADi's nlpsol.

    Parameters
    ----------
    interval : Function of (z, p)
        Gives the constraints (m,) of an interval from its variables z (nz,), but for a part that
        is linear; the objective is linear, too. The last of p is the interval's number.
    gather : int array (nz, n)
        Which of the programme's variables z is in each interval, increasing down each column.
    linear : row and column indices
        Where the Jacobian holds -1 besides.
    rows, size : int
        Numbers of constraints and of variables.
    """
    nz, n = gather.shape
    m = rows // n
    z, p = cas.SX.sym('z', nz), cas.SX.sym('p', interval.size1_in(1))
    lam = cas.SX.sym('lam', m)
    phi = interval(z, p)
    jacobian = cas.Function('jacobian', [z, p], [phi, cas.jacobian(phi, z)])
    hessian_block = cas.triu(cas.hessian(cas.dot(lam, phi), z)[0])
    hessian = cas.Function('hessian', [z, p, lam], [hessian_block])

    w, parameters = cas.MX.sym('w', size), cas.MX.sym('p', interval.size1_in(1) - 1)
    local = cas.reshape(w[gather.ravel(order='F').tolist()], nz, n)
    repeated = numbered(parameters, n)
    values, blocks = jacobian.map(n)(local, repeated)
    row, column = _places(jacobian.sparsity_out(1), n)
    interval_of = column // nz
    jac_g = _scatter(
        cas.vertcat(blocks.nz[:], -cas.DM.ones(len(linear[0]))),
        np.concatenate([row + m * interval_of, linear[0]]),
        np.concatenate([gather[column % nz, interval_of], linear[1]]),
        (rows, size),
    )
    lam_f, lam_g = cas.MX.sym('lam_f'), cas.MX.sym('lam_g', rows)
    blocks = hessian.map(n)(local, repeated, cas.reshape(lam_g, m, n))
    row, column = _places(hessian.sparsity_out(0), n)
    interval_of = column // nz
    hess_lag = _scatter(
        blocks.nz[:],
        gather[row, interval_of],
        gather[column % nz, interval_of],
        (size, size),
    )
    g = cas.vec(values) - w[linear[1].tolist()]
    return {
        'jac_g': cas.Function('jac_g', [w, parameters], [g, jac_g], ['x', 'p'], ['g', 'jac_g_x']),
        'hess_lag': cas.Function(
            'hess_lag',
            [w, parameters, lam_f, lam_g],
            [hess_lag],
            ['x', 'p', 'lam_f', 'lam_g'],
            ['triu_hess_gamma_x_x'],
        ),
    }


def numbered(parameters: cas.MX, n: int) -> cas.MX:
    """Return the programme's parameters for each of n intervals, its number below them."""
    return cas.vertcat(cas.repmat(parameters, 1, n), cas.DM(range(n)).T)


def _places(block: cas.Sparsity, n: int) -> tuple[Index, Index]:
    """Return row and column of each element of n blocks side by side, in their order."""
    row, column = (np.array(index, dtype=np.int64) for index in block.get_triplet())
    offsets = np.repeat(np.arange(n) * block.size2(), row.size)
    return np.tile(row, n), np.tile(column, n) + offsets


def _scatter(values: cas.MX, row: Index, column: Index, shape: tuple[int, int]) -> cas.MX:
    """Return the sparse matrix with values at their places; those at one place are added up."""
    places, index = np.unique(column * shape[0] + row, return_inverse=True)
    sparsity = cas.Sparsity.triplet(
        *shape, (places % shape[0]).tolist(), (places // shape[0]).tolist()
    )
    total = cas.Sparsity.triplet(
        places.size, index.size, index.tolist(), np.arange(index.size).tolist()
    )
    return cas.MX(sparsity, cas.mtimes(cas.DM(total, 1), values))
