"""What a plan is to make small or large: duration, end values, integrals, and formulas of them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as cas

from ..config import check_keys, number, suggestion
from ..dynamics.stage import Outline, Stage
from ..errors import InputError
from .expression import Expression

FORMS = "'time', {minimize: WHAT} or {maximize: WHAT}, WHAT such as final.mass or duration"


@dataclass(frozen=True)
class Objective:
    """A formula to be minimized or maximized.

    Its names are `duration` [s]; `initial.NAME` and `final.NAME`, a state, control or output at
    the ends; `integral.NAME`, its integral over time; `integral(FORMULA)` with the names alone,
    and `time` [s]; `effort`, the integral of the sum of the squared controls, each over its
    larger limit (over 1 in SI units if it has none); `PHASE.duration` in a problem of several
    phases. `altitude` stands for -z_e.
    """

    expression: Expression
    maximized: bool = False

    @property
    def sign(self) -> float:
        """1 if it is minimized, -1 if it is maximized."""
        return -1.0 if self.maximized else 1.0

    @property
    def weighs_effort(self) -> bool:
        """Whether what it is depends on the limits of controls."""
        return 'effort' in self.expression.source

    def __str__(self) -> str:
        return f'{"maximize" if self.maximized else "minimize"} {self.expression.source}'


def minimize(what: str | Mapping[str, float], where: str = 'minimize') -> Objective:
    """Return the objective of making a formula, or a sum of {formula: weight}, small.

    Raises
    ------
    InputError
        If it is not a formula.
    """
    return Objective(_expression(what, where))


def maximize(what: str | Mapping[str, float], where: str = 'maximize') -> Objective:
    """Return the objective of making a formula, or a sum of {formula: weight}, large."""
    return Objective(_expression(what, where), maximized=True)


TIME = Objective(Expression('duration'))


def parse_objective(value: Any, where: str) -> Objective:
    """Return an objective as it stands in YAML: `time`, {minimize: ...} or {maximize: ...}.

    Raises
    ------
    InputError
        If it is none of these; the message names the place, and the column in a formula.
    """
    if value == 'time':
        return TIME
    if isinstance(value, str):
        raise InputError(f"{where}: unknown objective '{value}': expected {FORMS}")
    given = check_keys(value, ('minimize', 'maximize'), where)
    if len(given) != 1:
        raise InputError(f'{where}: expected {FORMS}; got {value!r}')
    ((key, what),) = given.items()
    return (minimize if key == 'minimize' else maximize)(what, f'{where}.{key}')


def _expression(what: Any, where: str) -> Expression:
    if isinstance(what, Mapping) and what:
        weights = {str(k): number(v, f'{where}.{k}') for k, v in what.items()}
        for term in weights:
            Expression(term, f'{where}.{term}')
        what = ' + '.join(f'{weight!r}*({term})' for term, weight in weights.items())
    if not isinstance(what, str):
        raise InputError(f'{where}: expected a formula or {{formula: weight}}, got {what!r}')
    return Expression(what, where)


@dataclass(frozen=True)
class Costs:
    """An objective traced with scalars, in the user's units and sign.

    Parameters
    ----------
    cost : Function
        (z, wind) -> objective; z is (x_0, u_0, x_n, u_n, duration of each phase, integrals).
    rates : Function
        (x, u, p) -> integrands (k,); p as the stage's.
    """

    cost: cas.Function
    rates: cas.Function

    @property
    def count(self) -> int:
        """Number of integrals."""
        return int(self.rates.size1_out(0))


def trace(
    objective: Objective,
    stage: Stage,
    effort_scales: Sequence[float],
    phases: Sequence[str] = ('',),
) -> Costs:
    """Return an objective's functions.

    Parameters
    ----------
    effort_scales : (nu,)
        What `effort` measures each control by.
    phases : names
        Of the phases, in order.

    Raises
    ------
    InputError
        If a name is unknown.
    """
    nx, nu, np_ = (stage.function.size1_in(i) for i in range(3))
    ends = [cas.SX.sym(s, k) for s, k in (('x0', nx), ('u0', nu), ('xn', nx), ('un', nu))]
    wind, durations = cas.SX.sym('wind', np_ - 1), cas.SX.sym('T', len(phases))
    duration = cas.sum1(durations)
    x, u, p = (cas.SX.sym(s, k) for s, k in (('x', nx), ('u', nu), ('p', np_)))
    along = _values(stage, x, u, p)
    scopes: dict[str, Callable[[str], cas.SX]] = {
        'initial': _values(stage, ends[0], ends[1], cas.vertcat(wind, 0)),
        'final': _values(stage, ends[2], ends[3], cas.vertcat(wind, duration)),
    }
    rates: list[cas.SX] = []
    integrals: list[cas.SX] = []

    def integrated(rate: cas.SX) -> cas.SX:
        rates.append(rate)
        integrals.append(cas.SX.sym(f'integral_{len(rates)}'))
        return integrals[-1]

    def named(name: str) -> cas.SX:
        scope, dot, inner = name.partition('.')
        if dot and scope in scopes:
            return scopes[scope](inner)
        if dot and scope == 'integral':
            return integrated(along(inner))
        if scope in phases and inner == 'duration':
            return durations[phases.index(scope)]
        if name == 'duration':
            return duration
        if name == 'effort':
            return integrated(cas.sumsqr(u / cas.DM(list(effort_scales))))
        known = ('duration', 'effort', 'initial.NAME', 'final.NAME', 'integral.NAME')
        if not dot and (name in _names(stage) or name == 'altitude'):
            raise InputError(f"'{name}' at which time? final.{name}, initial.{name} or integral")
        raise InputError(f"unknown '{name}'{suggestion(name, known)}")

    total = objective.expression.evaluate(named, lambda inner: integrated(inner(along)))
    z = cas.vertcat(*ends, durations, *integrals)
    return Costs(
        cas.Function('cost', [z, wind], [total], {'cse': True}),
        cas.Function('rates', [x, u, p], [_stacked(rates)], {'cse': True}),
    )


def with_integrals(stage: Stage, rates: cas.Function) -> Stage:
    """Return the stage with integrals of functions of it as further states."""
    nx, count, was = len(stage.states), rates.size1_out(0), stage.outline
    sums = cas.SX.sym('sums', count)
    x, u, p = cas.vertcat(was.x, sums), was.u, was.p
    dx, outputs = stage.function(x[:nx], u, p)
    function = cas.Function(
        'stage',
        [x, u, p],
        [cas.vertcat(dx, rates(x[:nx], u, p)), outputs],
        ['x', 'u', 'p'],
        ['dx', 'outputs'],
        {'cse': True},
    )
    rated = cas.vertcat(was.dx, rates(was.x, u, p))
    traced = Outline(x, u, p, rated, was.outputs, was.calls)
    names = tuple(f'integral {i + 1}' for i in range(count))
    rest = (*stage.rest, *(0.0 for _ in names))
    return Stage((*stage.states, *names), stage.controls, stage.outputs, function, rest, traced)


def _stacked(rows: list[cas.SX]) -> cas.SX:
    return cas.vertcat(*rows) if rows else cas.SX(0, 1)


def _names(stage: Stage) -> tuple[str, ...]:
    return (*stage.states, *stage.controls, *stage.outputs)


def _values(stage: Stage, x: cas.SX, u: cas.SX, p: cas.SX) -> Callable[[str], cas.SX]:
    """Return the value of each name of a stage at a point."""
    found: dict[str, cas.SX] = {}

    def value(name: str) -> cas.SX:
        if not found:
            rows = cas.vertsplit(cas.vertcat(x, u, stage.function(x, u, p)[1]))
            found.update(zip(_names(stage), rows, strict=True))
            found['altitude'] = -found['z_e']
            found['time'] = p[-1]
        if name not in found:
            raise InputError(f"unknown '{name}'{suggestion(name, tuple(found))}")
        return found[name]

    return value
