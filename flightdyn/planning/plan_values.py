"""Values of finished plans: figures of the report, and formulas of what was flown."""

from collections.abc import Callable, Mapping
from typing import Any

import casadi as cas
import numpy as np

from ..config import suggestion
from ..errors import InputError
from ..trajectory import Trajectory
from .expression import Expression
from .problem import Problem
from .report import Plan

REPORTED = ('objective', 'final_time', 'iterations', 'nodes')
"""Of a plan's report."""
SCOPES: Mapping[str, Callable[[Any], Any]] = {
    'initial': lambda column: column[0],
    'final': lambda column: column[-1],
    'smallest': np.min,
    'largest': np.max,
}
"""Of a quantity over time; the last two are of the samples of a plan."""


def value_of(formula: Expression, plan: Plan, parameters: Mapping[str, Any]) -> float | None:
    """Return what a formula comes to for a plan; None if that is no finite number.

    Parameters
    ----------
    formula : Expression
        Its names are REPORTED and `duration`, NAME at or over SCOPES such as `final.x_e`, and
        parameters; `altitude` stands for -z_e.
    parameters : mapping
        Of the case.

    Raises
    ------
    InputError
        If a name is unknown.
    """
    flight, report = plan.trajectory, plan.report
    figures = {name: float(getattr(report, name)) for name in REPORTED}
    figures['duration'] = report.final_time
    check_value(formula, tuple(flight.columns), parameters)
    try:
        return evaluated(formula, lambda name: _worth(name, figures, flight, parameters))
    except InputError:  # with names that are known: a division by zero, a root of less
        return None


def _worth(
    name: str, figures: Mapping[str, float], flight: Trajectory, parameters: Mapping[str, Any]
) -> float:
    if name in figures:
        return figures[name]
    scope, _, quantity = name.partition('.')
    if scope not in SCOPES or not quantity:
        return float(parameters[name])
    if quantity == 'altitude' and quantity not in flight:
        return float(SCOPES[scope](-flight['z_e']))
    return float(SCOPES[scope](flight[quantity]))


def check_value(
    formula: Expression, quantities: tuple[str, ...], parameters: Mapping[str, Any]
) -> None:
    """Refuse a formula of names that plans with these states, controls and outputs lack.

    Raises
    ------
    InputError
        Naming the nearest one.
    """
    inside = (*quantities, 'altitude')
    numbers = tuple(k for k, v in parameters.items() if isinstance(v, int | float))
    known = (*REPORTED, 'duration', *numbers)

    def name(name: str) -> cas.SX:
        scope, _, quantity = name.partition('.')
        if name in known or (scope in SCOPES and quantity in inside):
            return cas.SX.sym(name)
        if scope in SCOPES and quantity:
            raise InputError(f"unknown '{quantity}'{suggestion(quantity, inside)}")
        if name in inside:
            raise InputError(f"'{name}' at which time? final.{name}, initial, smallest or largest")
        raise InputError(f"unknown '{name}'{suggestion(name, (*known, 'final.NAME'))}")

    formula.evaluate(name)


def quantities_of(problem: Problem) -> tuple[str, ...]:
    """Return the names of the states, controls and outputs that a problem's plans have."""
    stage = problem.stage
    return (*stage.states, *stage.controls, *stage.outputs)


def evaluated(formula: Expression, value: Callable[[str], float]) -> float:
    """Return what a formula comes to, given the value of each name.

    Raises
    ------
    InputError
        If it comes to no finite number.
    """
    return float(formula.evaluate(lambda name: cas.SX(value(name))))
