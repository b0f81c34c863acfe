"""Optimisation problems as in the textbook: variables, constraints, an objective, `solve()`.

A layer over `casadi.Opti` that scales variables and objective, hands bounds to the solver as
bounds, knows where in the user's code each thing was declared, and says so when a solve fails.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import casadi as cas
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, NotConvergedError
from ..numpy import Vectorizable
from .declarations import Declaration, Place, caller
from .integration_rules import check_mesh, gradient, residuals
from .opti_arguments import (
    check_bounds,
    check_constant,
    column,
    find_declaration,
    flattened,
    initial_values,
    operator_of,
    scales,
)
from .opti_ipopt import MAX_ITERATIONS, Ipopt
from .opti_solution import OptiSol
from .opti_sweep import sweep, values_over

Array = NDArray[np.float64]
_Constraint = Any  # cas.MX | bool | np.ndarray | sequence of these


class Opti(cas.Opti):
    """A nonlinear programme under construction.

    Parameters
    ----------
    variable_categories_to_freeze : str or sequence of str
        Variables of these categories stay at their initial guess; 'all' freezes every variable.
    freeze_style : 'parameter' or 'float'
        Whether a frozen variable is a parameter, which `solve(parameter_mapping=...)` may still
        set, or a plain number.
    ignore_violated_parametric_constraints : bool
        Let constraints pass that hold no free variable and are violated.
    """

    def __init__(
        self,
        variable_categories_to_freeze: Sequence[str] | str = (),
        *,
        freeze_style: Literal['parameter', 'float'] = 'parameter',
        ignore_violated_parametric_constraints: bool = False,
    ) -> None:
        super().__init__()
        if freeze_style not in ('parameter', 'float'):
            raise InputError(f"freeze_style must be 'parameter' or 'float', got {freeze_style!r}")
        frozen = variable_categories_to_freeze
        self._frozen_categories = {frozen} if isinstance(frozen, str) else set(frozen)
        self._freeze_style = freeze_style
        self._ignore_parametric = ignore_violated_parametric_constraints
        self.decisions: list[tuple[cas.MX, Declaration]] = []
        self.parameters: list[cas.MX] = []
        self.guesses: list[Array] = []
        self.scales: list[Array] = []
        self.constraint_declarations: list[Declaration] = []
        self._parametric: list[tuple[cas.MX, Declaration]] = []
        self.objective: cas.MX | None = None
        self.objective_place = Place()
        self._ipopt = Ipopt(self)

    def variable(  # type: ignore[override]
        self,
        init_guess: Vectorizable = None,
        n_vars: int | None = None,
        scale: Vectorizable = None,
        freeze: bool = False,
        log_transform: bool = False,
        category: str = 'Uncategorized',
        lower_bound: Vectorizable = None,
        upper_bound: Vectorizable = None,
    ) -> Vectorizable:
        """Return new decision variables.

        Parameters
        ----------
        init_guess : float, array (n,) or expression of earlier variables
            Where the solver starts. Left out: the middle of the bounds, or 0 moved into them.
        n_vars : int
            How many; by default as many as there are guesses.
        scale : float or array (n,), positive
            Expected size; the solver works with the variable over its scale. By default the
            largest magnitude of the guess, else of the bounds, else 1.
        freeze : bool
            Keep the value at the guess.
        log_transform : bool
            For quantities that are positive by nature: the solver works with v in
            x = scale exp(v). Guess and bounds are in terms of x, the scale is the guess.
        category : str
            Group, for `variable_categories_to_freeze`.
        lower_bound, upper_bound : float, array (n,) or expression of parameters
            Limits; infinite ones are no limits. A solution meets them exactly, or to 1e-8 of their
            size where IPOPT had to take them as rows (`detect_simple_bounds`).

        Returns
        -------
        MX (n, 1)
            A parameter, float or array (n,) where frozen.

        Raises
        ------
        InputError
            If sizes disagree, a value is not a number, a scale or log-transformed guess is not
            positive, or the bounds contradict each other.
        """
        place = caller()
        check_bounds(lower_bound, upper_bound, place)
        if isinstance(init_guess, cas.MX):
            init_guess = self.at_guess(init_guess)
        guess, n = initial_values(init_guess, n_vars, lower_bound, upper_bound, log_transform)
        frozen = freeze or bool(self._frozen_categories & {category, 'all'})
        if log_transform and (guess <= 0).any():
            raise InputError(
                f'a log-transformed variable is positive, its guess is {guess.min():g} ({place})'
            )
        size = scales(scale, guess, lower_bound, upper_bound, n, log_transform)
        if frozen and self._freeze_style == 'float':
            x: Vectorizable = guess if n > 1 or np.ndim(init_guess) else float(guess[0])
        elif frozen:
            x = self.parameter(guess)
        else:
            declaration = Declaration('variable', n, place)
            start, unit = (np.log(guess / size), np.ones(n)) if log_transform else (guess, size)
            x = self._decision(start, unit, declaration)
        for bound, sign in ((lower_bound, 1), (upper_bound, -1)):
            if bound is not None:
                self._bound(x, bound, sign, size if log_transform and not frozen else None, place)
        return cas.DM(size) * cas.exp(x) if log_transform and not frozen else x

    def _decision(self, start: Array, scale: Array, declaration: Declaration) -> cas.MX:
        x = super().variable(declaration.size)
        self.set_linear_scale(x, cas.DM(scale))
        self.set_initial(x, cas.DM(start))
        self.decisions.append((x, declaration))
        self.guesses.append(start)
        self.scales.append(scale)
        self._ipopt.outdate()
        return x

    def _bound(
        self,
        x: Vectorizable,
        bound: Vectorizable,
        sign: int,
        log_scale: Array | None,
        place: Place,
    ) -> None:
        """Keep x at or above (sign 1), at or below (-1) a bound; x may be a logarithm."""
        declaration = Declaration('lower bound' if sign > 0 else 'upper bound', 1, place)
        if isinstance(bound, cas.MX):
            self._add(
                sign * (x if log_scale is None else log_scale * cas.exp(x)) >= sign * bound,
                declaration,
            )
            return
        rows = x.shape[0] if isinstance(x, cas.MX) else np.size(x)
        limit = np.asarray(bound, float).ravel()
        if limit.size not in (1, rows) or np.isnan(limit).any():
            raise InputError(
                f'{declaration.kind} {bound}: give a number or one for each of {rows} variables'
                f' ({place})'
            )
        limit = np.array(np.broadcast_to(limit, (rows,)))
        if log_scale is not None:
            if sign < 0 and (limit <= 0).any():
                raise InputError(
                    f'a log-transformed variable is positive, its upper bound is {limit.min():g}'
                    f' ({place})'
                )
            with np.errstate(divide='ignore', invalid='ignore'):
                limit = np.where(limit > 0, np.log(limit / log_scale), -np.inf)
        where = np.flatnonzero(np.isfinite(limit))
        if where.size == 0:
            return
        if where.size < rows:
            x, limit = x[where.tolist()], limit[where]
        if isinstance(x, cas.MX):
            self._add(x >= cas.DM(limit) if sign > 0 else x <= cas.DM(limit), declaration)
        else:
            self._add(x >= limit if sign > 0 else x <= limit, declaration)

    def parameter(self, value: Vectorizable = 0.0, n_params: int | None = None) -> cas.MX:  # type: ignore[override]
        """Return a parameter (n, 1): a number that may change between solves.

        Parameters
        ----------
        value : float or array (n,)
            Value until `solve(parameter_mapping=...)` gives another.
        n_params : int
            How many; by default as many as there are values.

        Raises
        ------
        InputError
            If there is neither one value nor one each.
        """
        values = np.asarray(value, float).ravel()
        n = values.size if n_params is None else n_params
        if values.size not in (1, n):
            raise InputError(f'{values.size} values for {n} parameters: give one, or one each')
        p = super().parameter(n)
        self.set_value(p, cas.DM(np.array(np.broadcast_to(values, (n,)))))
        self.parameters.append(p)
        self._ipopt.outdate()
        return p

    def subject_to(  # type: ignore[override]
        self, constraint: _Constraint, scale: float | None = None, *, name: str | None = None
    ) -> _Constraint:
        """Add a constraint, or all in a nested list; return what was given.

        Parameters
        ----------
        constraint : MX comparison, bool, bool array, or (nested) sequence of these
            True is dropped. `x >= c` on a variable is handed to the solver as a bound.
        scale : float
            Size of a violation that matters; rows are divided by it.
        name : str
            What to call it in messages.

        Raises
        ------
        InputError
            If a constraint is False, or is not a comparison.
        """
        place = caller()
        for item, path in flattened(constraint):
            self._add(item, Declaration('constraint', 1, place, path, name), scale)
        return constraint

    def _add(self, constraint: Any, declaration: Declaration, scale: float | None = None) -> None:
        """Add one constraint; a declaration's size is set here."""
        if not isinstance(constraint, cas.MX):
            check_constant(constraint, declaration)
            return
        declaration = replace(declaration, size=constraint.numel())
        if self.advanced.is_parametric(constraint):
            self._parametric.append((constraint, declaration))
            return
        try:
            super().subject_to(constraint, *([] if scale is None else [scale]))
        except RuntimeError as error:
            raise InputError(
                f'{declaration.text()} is not a constraint: write ==, <= or >= between '
                'expressions of the variables'
            ) from error
        self.constraint_declarations.append(declaration)
        self._ipopt.outdate()

    def minimize(self, f: Vectorizable) -> None:  # type: ignore[override]
        """Make the scalar `f` the objective; the last call counts.

        Raises
        ------
        InputError
            If `f` is not a scalar.
        """
        f = cas.MX(f)
        if not f.is_scalar():
            raise InputError(f'an objective is a scalar, got shape {f.shape} ({caller()})')
        self.objective, self.objective_place = f, caller()
        super().minimize(f)
        self._ipopt.outdate()

    def maximize(self, f: Vectorizable) -> None:
        """Make the negative of the scalar `f` the objective."""
        self.minimize(-f)

    def constrain_derivative(
        self,
        derivative: Vectorizable,
        variable: Vectorizable,
        with_respect_to: Vectorizable,
        method: str = 'trapezoidal',
        *,
        name: str | None = None,
    ) -> list[_Constraint]:
        """Let `variable` have a given derivative over a mesh; return the constraints.

        Parameters
        ----------
        derivative : float, array (n,) or MX (n, 1)
            d(variable)/d(with_respect_to) at the nodes.
        variable, with_respect_to : array (n,) or MX (n, 1)
            Values at the nodes; rows are scaled up where the variable is small.
        method : str
            'forward_euler', 'backward_euler' (order 1), 'trapezoidal' (2) or 'hermite_simpson'
            (4): see `flightdyn.planning.integration_rules.residuals` for what each demands. The
            last wants an odd number of nodes, every second one halfway between its neighbours;
            where `with_respect_to` is free, that is checked at the initial guess.
        name : str
            What to call it in messages.

        Raises
        ------
        InputError
            If the method is unknown, sizes disagree or the nodes do not suit the method.
        """
        place = caller()
        y, x = column(variable, 'variable'), column(with_respect_to, 'with_respect_to')
        f = column(derivative, 'derivative')
        n = y.shape[0]
        if f.shape[0] == 1:
            f = cas.repmat(f, n, 1)
        if x.shape[0] != n or f.shape[0] != n:
            raise InputError(
                f'variable has {n} nodes, its derivative {f.shape[0]}, with_respect_to '
                f'{x.shape[0]} ({place})'
            )
        check_mesh(method, self.at_guess(x).ravel())
        # IPOPT scales rows of large variables down by itself, those of small ones not up.
        size = min(1.0, self._size_of(variable))
        declaration = Declaration(
            'dynamics', 1, place, name=name, subject=self._declaration_of(variable)
        )
        constraints = []
        for change, integral in residuals(method, f, y, x):
            constraint = change == integral
            if isinstance(constraint, cas.DM):
                constraint = np.isclose(change.full(), integral.full()).ravel()
            self._add(constraint, declaration, size)
            constraints.append(constraint)
        return constraints

    def derivative_of(
        self,
        variable: Vectorizable,
        with_respect_to: Vectorizable,
        derivative_init_guess: Vectorizable,
        derivative_scale: Vectorizable = None,
        method: str = 'trapezoidal',
        explicit: bool = False,
        *,
        name: str | None = None,
    ) -> cas.MX:
        """Return the derivative of `variable` at the nodes, as new variables (n, 1).

        Parameters
        ----------
        variable, with_respect_to, method, name
            As for `constrain_derivative`.
        derivative_init_guess, derivative_scale : float or array (n,)
            Guess and scale of the new variables.
        explicit : bool
            Return differences of second order of `variable` instead, an expression and no new
            variable; guess, scale and method are then not used. At least 3 nodes.

        Raises
        ------
        InputError
            As `constrain_derivative`.
        """
        y, x = column(variable, 'variable'), column(with_respect_to, 'with_respect_to')
        if explicit:
            if y.shape != x.shape or y.shape[0] < 3:
                raise InputError(
                    f'differences need 3 nodes or more, got {y.shape[0]} of the variable and '
                    f'{x.shape[0]} of with_respect_to'
                )
            derivative: cas.MX = cas.MX(gradient(y, x))
            return derivative
        derivative = self.variable(derivative_init_guess, y.shape[0], derivative_scale)
        self.constrain_derivative(derivative, variable, with_respect_to, method, name=name)
        return derivative

    def at_guess(self, expression: Vectorizable) -> Array:
        """Return the value of an expression at the initial guess, as a 2-D array."""
        if not isinstance(expression, cas.MX):
            return np.array(cas.DM(expression).full())
        if expression.is_constant():
            return np.array(expression.to_DM().full())
        symbols = [x for x, _ in self.decisions]
        f = cas.Function('value', [*symbols, *self.parameters], [expression])
        values = [cas.DM(guess) for guess in self.guesses]
        return np.array(f(*values, *(self.debug.value(p) for p in self.parameters)).full())

    def _declaration_of(self, variable: Vectorizable) -> Declaration | None:
        """Return the declaration of a bare variable, None for an expression."""
        index = self._index_of(variable)
        return None if index is None else self.decisions[index][1]

    def _index_of(self, variable: Vectorizable) -> int | None:
        if not isinstance(variable, cas.MX) or not variable.is_symbolic():
            return None
        key = variable.__hash__()
        return next((i for i, (x, _) in enumerate(self.decisions) if x.__hash__() == key), None)

    def _size_of(self, variable: Vectorizable) -> float:
        """Return the expected magnitude of a variable or expression; 1 if it is 0 at the guess."""
        index = self._index_of(variable)
        if index is not None:
            return float(self.scales[index].max())
        return float(np.abs(self.at_guess(variable)).max()) or 1.0

    def solve(  # type: ignore[override]
        self,
        parameter_mapping: Mapping[cas.MX, Vectorizable] | None = None,
        max_iter: int = MAX_ITERATIONS,
        max_runtime: float = 1e20,
        callback: Callable[[int], Any] | None = None,
        verbose: bool = True,
        jit: bool = False,
        detect_simple_bounds: bool = True,
        expand: bool = False,
        options: Mapping[str, Any] | None = None,
        behavior_on_failure: Literal['raise', 'return_last'] = 'raise',
    ) -> OptiSol:
        """Solve with IPOPT; without an objective, find a point that meets the constraints.

        Parameters
        ----------
        parameter_mapping : dict
            Values of parameters (or of frozen variables), kept for later solves.
        max_iter, max_runtime : int, float
            Limits: iterations, seconds.
        callback : function of the number of the iteration
            Called after each; `opti.debug.value(x)` is the iterate there. What it raises ends
            the solve and comes out of it.
        verbose : bool
            Let IPOPT print its progress.
        jit : bool
            Compile the problem's functions with the C compiler: minutes for large problems, worth
            it only for many solves.
        detect_simple_bounds : bool
            Hand constraints on a single variable to IPOPT as bounds rather than as rows.
        expand : bool
            Break the problem into scalar operations. Pays where the constraints were built element
            by element; problems made of columns are slower to set up and no faster to solve.
            Where the model holds functions that cannot be expanded it has no effect.
        options : dict
            Further options of CasADi's `nlpsol` ('ipopt.tol' and so on); they prevail.
        behavior_on_failure : 'raise' or 'return_last'
            Whether an unconverged solve raises or returns its last iterate, marked
            `converged=False`.

        Raises
        ------
        NotConvergedError
            If there is no solution; names the most violated constraints, the cause and what to
            try. `error.last` is the last iterate, `error.result_code` the cause.
        InputError
            If the problem is not defined at the guess, or an argument cannot be used.
        KeyboardInterrupt
            If interrupted (main thread); the problem can be solved again.

        Notes
        -----
        IPOPT is tried with several strategies one after another: the next one where it ends
        without a solution, or after 100 iterations. `max_iter` and `max_runtime` limit their sum.
        Setting 'ipopt.mu_strategy' among the options leaves it at that one.

        The solver stays built: another solve with the same structure and options, say with other
        parameters, starts at once.
        """
        if behavior_on_failure not in ('raise', 'return_last'):
            raise InputError(
                "behavior_on_failure must be 'raise' or 'return_last', got "
                f'{behavior_on_failure!r}'
            )
        self._set_parameters(parameter_mapping or {})
        self._check_parametric()
        plugin: dict[str, Any] = {
            'expand': expand,
            'detect_simple_bounds': detect_simple_bounds,
            'ipopt.print_level': 5 if verbose else 0,
            'print_time': verbose,
            'ipopt.max_iter': max_iter,
            'ipopt.max_wall_time': max_runtime,
        }
        if jit:
            plugin |= {'jit': True, 'jit_options': {'flags': ['-O1']}}
        sol = self._ipopt.solve(plugin | dict(options or {}), callback)
        if not sol.converged and behavior_on_failure == 'raise':
            raise NotConvergedError(self._ipopt.explanation(sol), self._ipopt.code(sol), sol)
        return sol

    def _set_parameters(self, mapping: Mapping[cas.MX, Vectorizable]) -> None:
        for p, value in mapping.items():
            if not any(p.__hash__() == known.__hash__() for known in self.parameters):
                raise InputError(
                    f'{p} is not a parameter of this problem: map what opti.parameter() returned'
                )
            values = np.asarray(value, float).ravel()
            if values.size not in (1, p.numel()):
                raise InputError(f'{values.size} values for {p.numel()} parameters {p}')
            self.set_value(p, cas.DM(values))

    def _check_parametric(self) -> None:
        """Refuse constraints that no variable can change and that the parameters violate."""
        if self._ignore_parametric or not self._parametric:
            return
        for constraint, declaration in self._parametric:
            # The comparison itself would be exact; one part in 1e8 is forgiven.
            left, right = (self.at_guess(constraint.dep(i)) for i in range(2))
            gap = {'<=': left - right, '==': np.abs(left - right)}[operator_of(constraint)]
            allowed = 1e-8 * np.maximum(1.0, np.maximum(np.abs(left), np.abs(right)))
            if not (gap <= allowed).all():
                row = int(np.argmax(np.broadcast_to(gap - allowed, constraint.shape)))
                raise InputError(
                    f'{declaration.text(row)} holds no free variable and is violated by '
                    f'{np.broadcast_to(gap, constraint.shape).ravel()[row]:.3g}: change the '
                    'parameters, or unfreeze a variable'
                )

    def solve_sweep(
        self,
        parameter_mapping: Mapping[cas.MX, Vectorizable],
        update_initial_guesses_between_solves: bool = False,
        verbose: bool = True,
        solve_kwargs: Mapping[str, Any] | None = None,
        return_callable: bool = False,
    ) -> Any:
        """Solve for each value of parameters, with a solver that is built once.

        Parameters
        ----------
        parameter_mapping : dict
            Values of scalar parameters, broadcast against each other to the shape of the sweep.
        update_initial_guesses_between_solves : bool
            Start from the solution of the last point that converged.
        verbose : bool
            Print a line for each point.
        solve_kwargs : dict
            Further arguments of `solve`.
        return_callable : bool
            Return a function of an expression instead, giving its values over the sweep.

        Returns
        -------
        object array of OptiSol, shape of the sweep
            A point that failed does not stop the others: its `converged` is False, `reason` says
            why, and every value that depends on the variables is NaN.
        function
            With `return_callable`: expression to array (shape of the sweep, shape of its value).

        Raises
        ------
        InputError
            If the values cannot be broadcast against each other.
        """
        before = self._ipopt.start()
        try:
            solutions = sweep(
                self,
                parameter_mapping,
                {'verbose': False, **(solve_kwargs or {}), 'behavior_on_failure': 'raise'},
                self._ipopt.nothing,
                follow=update_initial_guesses_between_solves,
                report=print if verbose else None,
            )
        finally:
            self._ipopt.restart(before)
        return values_over(solutions) if return_callable else solutions

    def set_initial_from_sol(
        self, sol: OptiSol, initialize_primals: bool = True, initialize_duals: bool = True
    ) -> None:
        """Start the next solve where another ended: its variables, the multipliers, or both.

        Raises
        ------
        InputError
            If the solution is of a problem of another size.
        """
        self._ipopt.start_from(sol, initialize_primals, initialize_duals)

    def find_constraint_declaration(self, index: int, use_full_filename: bool = False) -> str:
        """Return what row `index` of all constraints (`opti.g`) is and where it was declared.

        Raises
        ------
        InputError
            If there is no such row.
        """
        return find_declaration(
            self.constraint_declarations, index, 'constraints', use_full_filename
        )

    def find_variable_declaration(self, index: int, use_full_filename: bool = False) -> str:
        """Return what element `index` of all variables is called and where it was declared.

        Raises
        ------
        InputError
            If there is no such element.
        """
        declarations = [declaration for _, declaration in self.decisions]
        return find_declaration(declarations, index, 'variables', use_full_filename)
