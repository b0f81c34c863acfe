"""IPOPT behind `Opti`: options, running it, and explaining how it ended."""

import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import casadi as cas
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, ResultCode
from .declarations import Declaration
from .infeasibility import not_numbers
from .opti_solution import OptiSol
from .solver import RESULT_CODES

if TYPE_CHECKING:
    from .opti import Opti

Array = NDArray[np.float64]

MAX_ITERATIONS = 1000
_CONTRADICTION = 'Invalid_Problem_Definition'
_ROUNDING = 1e-9  # limits that cross by less, relative, are the same limit written twice
# Tried one after another. The first is the quickest on flips and rockets; the others found what
# it did not: 5 of 27 flips from guesses of their duration of 0.7 to 1.5 s, and glides of free
# duration. Bounds as rows cost time on long meshes, but leave the guess where it is.
_STRATEGIES: tuple[dict[str, Any], ...] = (
    {'ipopt.mu_strategy': 'adaptive', 'ipopt.fast_step_computation': 'yes'},
    {'ipopt.mu_strategy': 'monotone', 'ipopt.mu_init': 1e-3, 'detect_simple_bounds': False},
    {'ipopt.mu_strategy': 'monotone', 'ipopt.mu_init': 1e-3},
)
_OPTIONS: dict[str, Any] = {
    'ipopt.sb': 'yes',
    'ipopt.honor_original_bounds': 'yes',
    'show_eval_warnings': False,
    'calc_lam_p': False,
}
_ADVICE = {
    'Maximum_Iterations_Exceeded': 'it may need more iterations (max_iter), better scales, or a '
    'guess nearer to the solution',
    'Maximum_WallTime_Exceeded': 'raise max_runtime, or start nearer to the solution',
    'Not_Enough_Degrees_Of_Freedom': 'there are more equations than variables: drop those that '
    'follow from others, or free a variable',
    'Diverging_Iterates': 'the objective seems to have no limit: bound the variables '
    'that it depends on',
    'Invalid_Number_Detected': 'an expression left its domain on the way: bound its variables '
    'away from there',
    _CONTRADICTION: 'limits on the same variable contradict each other',
}
_ADVICE_OTHERWISE = (
    'check the constraints named above against each other, try a guess that nearly meets them, '
    'or leave one out to see which is to blame'
)
_WORST = 5
_FIRST_ITERATIONS = 100  # of a strategy before the next one is tried
_RETRY = (
    'Infeasible_Problem_Detected',
    'Restoration_Failed',
    'Error_In_Step_Computation',
    'Maximum_Iterations_Exceeded',
)


class Ipopt:
    """The solver of one `Opti`, rebuilt only when the problem or the options change."""

    def __init__(self, opti: 'Opti') -> None:
        self._opti = opti
        self._built: dict[str, Any] | None = None
        self._objective_scaled = False
        self._callback: _Callback | None = None

    def outdate(self) -> None:
        """Note that the problem has changed."""
        self._built = None
        self._objective_scaled = False

    def solve(self, options: Mapping[str, Any], callback: Callable[[int], Any] | None) -> OptiSol:
        """Return the solution, or the last iterate marked as unconverged."""
        if not self._opti.decisions:
            raise InputError('the problem has no variables: call opti.variable() first')
        self._scale_objective()
        watch = _Callback(callback) if callback is not None else None
        # Without a callback before and now there is none to take off.
        if watch is not None or self._callback is not None:
            self._opti.callback(*([] if watch is None else [watch]))
            self._callback = watch
        sol = self._attempts(dict(options), watch)
        if sol.reason == 'Invalid_Number_Detected':
            self._refuse_undefined(sol)
        return sol

    def _attempts(self, options: dict[str, Any], watch: '_Callback | None') -> OptiSol:
        """Return the first strategy's solution, or the last iterate of the last one."""
        strategies: tuple[dict[str, Any], ...] = (
            ({},) if 'ipopt.mu_strategy' in options else _STRATEGIES
        )
        iterations, started = 0, time.monotonic()
        for strategy in strategies:
            limits = {
                'ipopt.max_iter': options['ipopt.max_iter'] - iterations,
                'ipopt.max_wall_time': options['ipopt.max_wall_time'],
            }
            if strategy is not strategies[0]:
                limits['ipopt.max_wall_time'] -= time.monotonic() - started
                if limits['ipopt.max_wall_time'] <= 0:
                    break
            if strategy is not strategies[-1]:
                limits['ipopt.max_iter'] = min(_FIRST_ITERATIONS, limits['ipopt.max_iter'])
            simple = options['detect_simple_bounds'] and strategy.get('detect_simple_bounds', True)
            chosen = {
                **_OPTIONS,
                **strategy,
                **options,
                **limits,
                'detect_simple_bounds': simple,
            }
            self._run(chosen, watch)
            sol = self._solution()
            if sol.reason == _CONTRADICTION and self._contradictions(sol)[0] < _ROUNDING:
                self._run({**chosen, 'detect_simple_bounds': False}, watch)
                sol = self._solution()
            iterations += int(sol.statistics['iter_count'])
            if sol.reason not in _RETRY or iterations >= options['ipopt.max_iter']:
                break
        return replace(sol, statistics={**sol.statistics, 'iter_count': iterations})

    def _run(self, options: dict[str, Any], watch: '_Callback | None') -> None:
        opti = self._opti
        for expand in dict.fromkeys([options['expand'], False]):
            chosen = {**options, 'expand': expand}
            if self._built != chosen:
                opti.solver('ipopt', chosen)
                self._built = chosen
            try:
                with _interrupts() as raised:
                    cas.Opti.solve(opti)
                return
            except RuntimeError as error:
                for cause in [*raised, *([] if watch is None else watch.raised)]:
                    raise cause from None
                if 'return_status is' in str(error):
                    return
                self._built = None
                if not expand:
                    raise InputError(f'CasADi cannot build the problem: {error}') from error

    def _scale_objective(self) -> None:
        """Divide a faint objective by its slope, so that IPOPT's tolerance sees it.

        Steep ones are scaled down by IPOPT. The slope is taken at the guess and 10 % of the scales
        to both sides: at the guess alone it may happen to vanish.
        """
        opti = self._opti
        if self._objective_scaled or opti.objective is None:
            return
        self._objective_scaled = True
        x = cas.veccat(*(x for x, _ in opti.decisions))
        start, scale = np.concatenate(opti.guesses), np.concatenate(opti.scales)
        slope = cas.Function(
            'slope', [x, cas.veccat(*opti.parameters)], [cas.gradient(opti.objective, x)]
        )
        p = self._parameter_values()
        with np.errstate(invalid='ignore'):
            points = (start, start + 0.1 * scale, start - 0.1 * scale)
            slopes = np.abs([slope(point, p).full().ravel() * scale for point in points])
        steepest = slopes[np.isfinite(slopes)].max(initial=0.0)
        cas.Opti.minimize(opti, opti.objective, steepest if 0 < steepest < 1 else 1.0)
        self._built = None

    def _parameter_values(self) -> Array:
        parameters = self._opti.parameters
        return np.concatenate(
            [np.zeros(0), *(np.ravel(self._opti.debug.value(p)) for p in parameters)]
        )

    def _solution(self) -> OptiSol:
        stats = self._opti.stats()
        status = str(stats['return_status'])
        if status == _CONTRADICTION:
            stats['iter_count'] = 0  # IPOPT was not started, CasADi leaves it unset
        return self._snapshot(stats, converged=bool(stats['success']), reason=status)

    def _snapshot(self, stats: dict[str, Any], *, converged: bool, reason: str) -> OptiSol:
        opti = self._opti
        active = {s.__hash__() for s in cas.symvar(opti.x)}
        used = [x for x, _ in opti.decisions if x.__hash__() in active]
        multipliers = cas.symvar(opti.lam_g)
        parts = [*used, *multipliers, opti.g, opti.lbg, opti.ubg]
        flat = np.ravel(opti.debug.value(cas.veccat(*parts)))
        ends = np.cumsum([part.numel() for part in parts])[:-1]
        *values, g, lower, upper = np.split(flat, ends)
        found = dict(zip((s.__hash__() for s in (*used, *multipliers)), values, strict=True))
        for (x, _), guess in zip(opti.decisions, opti.guesses, strict=True):
            found.setdefault(x.__hash__(), guess)  # in no constraint: it stays where it was
        for p in opti.parameters:
            found[p.__hash__()] = np.ravel(opti.debug.value(p))
        symbols = [*(x for x, _ in opti.decisions), *opti.parameters, *multipliers]
        return OptiSol(
            symbols=symbols,
            values=[found[s.__hash__()] for s in symbols],
            g=g,
            lower=lower,
            upper=upper,
            constraints=tuple(opti.constraint_declarations),
            statistics=stats,
            converged=converged,
            reason='' if converged else reason,
        )

    def nothing(self, reason: str) -> OptiSol:
        """Return what stands for a solve that failed: no number depends on it unnoticed."""
        opti = self._opti
        symbols = [x for x, _ in opti.decisions]
        return OptiSol(
            symbols=[*symbols, *opti.parameters],
            values=[
                *(np.full(x.numel(), np.nan) for x in symbols),
                *(np.ravel(opti.debug.value(p)) for p in opti.parameters),
            ],
            g=np.zeros(0),
            lower=np.zeros(0),
            upper=np.zeros(0),
            constraints=(),
            statistics={},
            converged=False,
            reason=reason,
        )

    def start(self) -> tuple[Array, Array]:
        """Return where the next solve starts: variables and multipliers."""
        opti = self._opti
        point = opti.initial()
        return (
            np.ravel(opti.debug.value(opti.x, point)),
            np.ravel(opti.debug.value(opti.lam_g, point)) if opti.ng else np.zeros(0),
        )

    def restart(self, point: tuple[Array, Array]) -> None:
        """Start the next solve from what `start` gave."""
        for symbols, values in zip((self._opti.x, self._opti.lam_g), point, strict=True):
            if values.size:
                self._opti.set_initial(symbols, cas.DM(values))

    def start_from(self, sol: OptiSol, primals: bool, duals: bool) -> None:
        """Start the next solve from a solution of a problem built alike."""
        opti = self._opti
        n = len(opti.decisions) + len(opti.parameters)
        targets = [x for x, _ in opti.decisions] if primals else []
        values = list(sol.values[: len(targets)])
        if duals:
            targets += cas.symvar(opti.lam_g)
            values += sol.values[n:]
        if [t.numel() for t in targets] != [v.size for v in values]:
            raise InputError('the solution is of a problem with other variables or constraints')
        for target, value in zip(targets, values, strict=True):
            opti.set_initial(target, cas.DM(value))

    def code(self, sol: OptiSol) -> ResultCode:
        """Return the cause of a failure."""
        return RESULT_CODES.get(sol.reason, ResultCode.INFEASIBLE)

    def explanation(self, sol: OptiSol) -> str:
        """Return how a solve ended, where it is violated, and what to try."""
        lines = [
            f'the solve ended with {sol.reason} after {sol.statistics["iter_count"]} iterations'
        ]
        violated = sol.infeasibilities(1e-6)
        if violated:
            lines.append('most violated at the last iterate:')
            lines += [f'  {row}' for row in violated[:_WORST]]
            if len(violated) > _WORST:
                lines.append(f'  and {len(violated) - _WORST} more rows')
        else:
            lines.append('the last iterate meets all constraints, but is no optimum')
        if sol.reason == _CONTRADICTION:
            declarations = map(
                self._opti.find_constraint_declaration, self._contradictions(sol)[1]
            )
            lines += ['limits of the same variables:', *(f'  {text}' for text in declarations)]
        advice = _ADVICE.get(sol.reason, _ADVICE_OTHERWISE)
        return '\n'.join([*lines, f'what to try: {advice}'])

    def _contradictions(self, sol: OptiSol) -> tuple[float, list[int]]:
        """Return by how much limits of a variable cross, relative, and rows of such limits."""
        opti = self._opti
        simple = np.flatnonzero(sol.statistics.get('detect_simple_bounds_is_simple', []))
        target = sol.statistics.get('detect_simple_bounds_target_x', [])
        x = np.ravel(opti.debug.value(opti.x))
        p = np.ravel(opti.debug.value(opti.p)) if opti.np else np.zeros(0)
        slopes = cas.Function('slope', [opti.x, opti.p], [cas.jacobian(opti.g, opti.x)])(x, p)
        limits: dict[int, list[tuple[float, float, int]]] = {}
        for row, column in zip(map(int, simple), map(int, target), strict=True):
            slope = float(slopes[row, column])
            ends = x[column] + (np.array([sol.lower[row], sol.upper[row]]) - sol.g[row]) / slope
            limits.setdefault(column, []).append((ends.min(), ends.max(), row))
        worst, rows = 0.0, []
        for each in limits.values():
            lower, upper = max(limit[0] for limit in each), min(limit[1] for limit in each)
            if lower > upper:
                worst = max(worst, (lower - upper) / max(abs(lower), abs(upper)))
                rows += [row for _, _, row in each]
        return worst, rows[:_WORST]

    def _refuse_undefined(self, sol: OptiSol) -> None:
        """Raise what is not a number at the guess; return if all is well there."""
        opti = self._opti
        objective = 0.0 if opti.objective is None else opti.objective
        x, _ = self.start()
        active = {s.__hash__() for s in cas.symvar(opti.x)}
        found = not_numbers(
            opti.x,
            cas.veccat(objective, opti.g),
            x,
            opti.p,
            np.ravel(opti.debug.value(opti.p)) if opti.np else np.zeros(0),
            [Declaration('objective', 1, opti.objective_place), *opti.constraint_declarations],
            [d for s, d in opti.decisions if s.__hash__() in active],
        )
        if found and sol.statistics['iter_count'] <= 0:
            more = [f'and {len(found) - _WORST} more'] if len(found) > _WORST else []
            raise InputError(
                '\n  '.join(
                    [
                        'the problem is not defined at the initial guess:',
                        *found[:_WORST],
                        *more,
                        'what to try: another guess, or bounds that keep it away from there',
                    ]
                )
            )


@contextmanager
def _interrupts() -> Iterator[list[BaseException]]:
    """Note what a SIGINT raised, because CasADi stops at it but does not hand it on."""
    raised: list[BaseException] = []
    handler = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield raised
        return

    def note(number: int, frame: Any) -> None:
        try:
            handler(number, frame)
        except BaseException as error:
            raised.append(error)
            raise

    signal.signal(signal.SIGINT, note)
    try:
        yield raised
    finally:
        signal.signal(signal.SIGINT, handler)


class _Callback:
    """The user's callback; what it raises is kept, IPOPT only stops at it."""

    def __init__(self, function: Callable[[int], Any]) -> None:
        self._function = function
        self.raised: list[BaseException] = []

    def __call__(self, iteration: int) -> None:
        try:
            self._function(iteration)
        except BaseException as error:
            self.raised.append(error)
            raise
