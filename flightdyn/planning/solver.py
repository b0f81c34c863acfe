"""Solving a nonlinear programme with IPOPT: progress, cancelling, time limit, plain words."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as cas
import numpy as np
from numpy.typing import NDArray

from ..errors import ResultCode
from ..trajectory import Trajectory

Array = NDArray[np.float64]

MAX_ITERATIONS = 1000
OPTIONS: dict[str, Any] = {
    'ipopt.print_level': 0,
    'ipopt.sb': 'yes',
    'ipopt.max_iter': MAX_ITERATIONS,
    'ipopt.tol': 1e-8,
    # variables and constraints are scaled: MUMPS' own search for scalings only takes time
    'ipopt.mumps_permuting_scaling': 0,
    'ipopt.mumps_scaling': 0,
    'ipopt.mumps_pivot_order': 0,
    'ipopt.fixed_variable_treatment': 'make_parameter_nodual',
    'print_time': False,
    'show_eval_warnings': False,  # the report says where a model gives no number
    'calc_lam_p': False,
    'calc_lam_x': False,
    'no_nlp_grad': True,
}
QUICK: dict[str, Any] = {
    # neither IPOPT's own scaling nor refined steps, which pay only where a solve is hard
    'ipopt.nlp_scaling_method': 'none',
    'ipopt.fast_step_computation': 'yes',
}
ADAPTIVE = {'ipopt.mu_strategy': 'adaptive', 'ipopt.mu_oracle': 'probing'}
STRATEGIES: dict[str, dict[str, Any]] = {
    'monotone': {},
    'rough': {
        **QUICK,
        'ipopt.tol': 1e-3,
        'ipopt.barrier_tol_factor': 30.0,  # on the way down, the rougher the sooner
        'ipopt.mu_linear_decrease_factor': 0.1,
    },
    'adaptive': ADAPTIVE,
    'quick': {**QUICK, **ADAPTIVE},
    'near': {
        **QUICK,
        **ADAPTIVE,
        'ipopt.mu_init': 1e-4,
        'ipopt.bound_mult_init_method': 'mu-based',
        'ipopt.bound_push': 1e-5,
        'ipopt.bound_frac': 1e-5,
    },
    'warm': {
        **QUICK,
        'ipopt.warm_start_init_point': 'yes',
        'ipopt.tol': 1e-7,  # of plans made anew every moment
        'ipopt.mu_init': 1e-4,
        'ipopt.mu_strategy': 'adaptive',
        'ipopt.warm_start_bound_push': 1e-6,
        'ipopt.warm_start_bound_frac': 1e-6,
        'ipopt.warm_start_slack_bound_push': 1e-6,
        'ipopt.warm_start_slack_bound_frac': 1e-6,
        'ipopt.warm_start_mult_bound_push': 1e-6,
    },
}
"""Ways of IPOPT: the barrier is lowered step by step, to the end or until it shows where a plan is
at limits; or as progress goes, with care or with less of it; from where another solve left off;
from a solution's neighbourhood, multipliers included."""

RESULT_CODES = {
    'Solve_Succeeded': ResultCode.SUCCESS,
    'Solved_To_Acceptable_Level': ResultCode.SUCCESS,
    'Infeasible_Problem_Detected': ResultCode.INFEASIBLE,
    'Restoration_Failed': ResultCode.INFEASIBLE,
    'Search_Direction_Becomes_Too_Small': ResultCode.INFEASIBLE,
    'Diverging_Iterates': ResultCode.INFEASIBLE,
    'Invalid_Number_Detected': ResultCode.INFEASIBLE,
    'Not_Enough_Degrees_Of_Freedom': ResultCode.BAD_REQUEST,
    'Maximum_Iterations_Exceeded': ResultCode.ITERATION_LIMIT,
    'Maximum_WallTime_Exceeded': ResultCode.TIME_LIMIT,
    'Maximum_CpuTime_Exceeded': ResultCode.TIME_LIMIT,
    'User_Requested_Stop': ResultCode.CANCELLED,
}


@dataclass(frozen=True)
class Iteration:
    """Progress of a solve after one iteration; `elapsed` in seconds.

    Parameters
    ----------
    variables : (size,)
        The iterate; scaled, until the programme hands it on in SI units.
    trajectory : function returning a Trajectory
        Makes a flight of the iterate; costs nothing unless called.
    """

    number: int
    objective: float
    primal_infeasibility: float
    dual_infeasibility: float
    elapsed: float
    variables: Array | None = field(default=None, repr=False, compare=False)
    trajectory: Callable[[], Trajectory] | None = field(default=None, repr=False, compare=False)


@dataclass(frozen=True)
class Multipliers:
    """Of bounds and constraints: with them a solve near another's solution starts."""

    bounds: Array
    constraints: Array

    def scaled(self, bounds: Array, constraints: Array) -> 'Multipliers':
        """Return them each times a number."""
        return Multipliers(self.bounds * bounds, self.constraints * constraints)


@dataclass(frozen=True)
class Solution:
    """The last iterate and how the solve ended."""

    code: ResultCode
    status: str
    variables: Array
    gaps: Array
    violation: float
    iterations: int
    cost: float
    multipliers: Multipliers


OnIteration = Callable[[Iteration], None]


class Solver:
    """IPOPT on one programme; for one thread at a time."""

    def __init__(self, programme: dict[str, Any], derivatives: dict[str, Any]) -> None:
        self._callback = _Callback(programme)
        self._programme, self._derivatives = programme, derivatives
        self._solvers: dict[str, cas.Function] = {}

    def _nlp(self, strategy: str) -> cas.Function:
        if strategy not in self._solvers:
            self._solvers[strategy] = cas.nlpsol(
                'plan',
                'ipopt',
                self._programme,
                {
                    **OPTIONS,
                    **STRATEGIES[strategy],
                    **self._derivatives,
                    'iteration_callback': self._callback,
                },
            )
        return self._solvers[strategy]

    def solve(
        self,
        guess: Array,
        lower: Array,
        upper: Array,
        parameters: Array,
        *,
        max_wall_time: float,
        strategy: str = 'monotone',
        multipliers: Multipliers | None = None,
        most_iterations: int | None = None,
        on_iteration: OnIteration | None = None,
        should_stop: Callable[[], bool] | None = None,
    ) -> Solution:
        """Return the last iterate; a stop asked for takes effect at the next iteration.

        Parameters
        ----------
        strategy : str
            One of `STRATEGIES`; `warm` needs multipliers.
        """
        nlp = self._nlp(strategy)
        watch = _Watch(nlp, lower, upper, max_wall_time, on_iteration, should_stop)
        watch.most = most_iterations or MAX_ITERATIONS
        start: dict[str, Any] = {
            'x0': guess,
            'lbx': lower,
            'ubx': upper,
            'lbg': 0,
            'ubg': 0,
            'p': parameters,
        }
        if multipliers is not None:
            start |= {'lam_x0': multipliers.bounds, 'lam_g0': multipliers.constraints}
        self._callback.watch = watch
        try:
            result = nlp(**start)
        finally:
            self._callback.watch = None
        stats = nlp.stats()
        if watch.error is not None:
            raise watch.error
        status = str(stats['return_status'])
        code = RESULT_CODES.get(status, ResultCode.INTERNAL)
        if code == ResultCode.CANCELLED and watch.timed_out:
            code, status = ResultCode.TIME_LIMIT, 'Maximum_WallTime_Exceeded'
        elif code == ResultCode.CANCELLED and watch.count > watch.most:
            code, status = ResultCode.ITERATION_LIMIT, 'Maximum_Iterations_Exceeded'
        variables, gaps = result['x'].full().ravel(), result['g'].full().ravel()
        return Solution(
            code=code,
            status=status,
            variables=variables,
            gaps=gaps,
            violation=_violation(variables, gaps, lower, upper),
            iterations=int(stats['iter_count']),
            cost=float(result['f']),
            multipliers=Multipliers(
                result['lam_x'].full().ravel(), result['lam_g'].full().ravel()
            ),
        )


def _violation(variables: Array, gaps: Array, lower: Array, upper: Array) -> float:
    outside = np.maximum(lower - variables, variables - upper)
    return float(max(np.abs(gaps).max(initial=0.0), outside.max(initial=0.0), 0.0))


class _Watch:
    """What one solve reports to its caller, and when it has to end."""

    def __init__(
        self,
        nlp: cas.Function,
        lower: Array,
        upper: Array,
        max_wall_time: float,
        on_iteration: OnIteration | None,
        should_stop: Callable[[], bool] | None,
    ) -> None:
        self.nlp, self.lower, self.upper = nlp, lower, upper
        self.max_wall_time = max_wall_time
        self.on_iteration, self.should_stop = on_iteration, should_stop
        self.started = time.perf_counter()
        self.count = 0
        self.timed_out = False
        self.most = MAX_ITERATIONS
        self.error: BaseException | None = None

    def __call__(self, iterate: Sequence[memoryview]) -> bool:
        """Report an iterate (x, f, g, ...); return whether to stop."""
        elapsed = time.perf_counter() - self.started
        try:
            if self.on_iteration is not None:
                variables, objective, gaps = (np.frombuffer(part) for part in iterate[:3])
                dual = self.nlp.stats()['iterations']['inf_du']
                self.on_iteration(
                    Iteration(
                        number=self.count,
                        objective=float(objective[0]),
                        primal_infeasibility=_violation(variables, gaps, self.lower, self.upper),
                        dual_infeasibility=float(dual[-1]) if dual else float('nan'),
                        elapsed=elapsed,
                        variables=variables.copy(),
                    )
                )
            self.count += 1
            self.timed_out = elapsed > self.max_wall_time
            if self.count > self.most:
                return True
            return self.timed_out or (self.should_stop is not None and self.should_stop())
        except BaseException as error:  # it cannot pass through IPOPT: solve() raises it again
            self.error = error
            return True


class _Callback(cas.Callback):
    """CasADi's iteration callback, handed on to the watch of the solve under way.

    It takes buffers, not matrices: those cost more to make than all else it does.
    """

    def __init__(self, programme: dict[str, Any]) -> None:
        super().__init__()
        self._sizes = {key: programme[key].size1() for key in ('x', 'g', 'p')}
        self.watch: _Watch | None = None
        self.construct('progress', {})

    def get_n_in(self) -> int:
        return int(cas.nlpsol_n_out())

    def get_n_out(self) -> int:
        return 1

    def get_name_in(self, i: int) -> str:
        return str(cas.nlpsol_out(i))

    def get_sparsity_in(self, i: int) -> cas.Sparsity:
        name = cas.nlpsol_out(i).removeprefix('lam_')
        return cas.Sparsity.dense(1 if name == 'f' else self._sizes[name])

    def has_eval_buffer(self) -> bool:
        return True

    def eval_buffer(self, arg: Sequence[memoryview], res: Sequence[memoryview]) -> int:
        stop = self.watch is not None and self.watch(arg)
        np.frombuffer(res[0])[0] = float(stop)
        return 0
