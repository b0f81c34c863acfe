"""Functions that a stage's derivatives go around, because they know their own for less.

Differentiating a sum of a thousand products term by term repeats it for every derivative. While a
stage is traced, symbols stand for the values of such functions, which are kept beside; values and
derivatives of the whole follow by the chain rule.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from itertools import accumulate
from typing import Any, Protocol

import casadi as cas

from ..numpy import Vectorizable

Orders = tuple[int, ...]
"""How often a partial derivative is taken by each input."""


class Opaque(Protocol):
    """A function of several scalars to several scalars."""

    def partials(
        self, inputs: Sequence[Vectorizable], order: int
    ) -> Mapping[Orders, Sequence[Vectorizable]]:
        """Return all partial derivatives up to an order, 0 the values, each of every value."""


@dataclass(frozen=True, eq=False)
class Call:
    """A call of an opaque function while a stage was traced.

    Parameters
    ----------
    function : Opaque
    inputs : (m, 1)
        Of the stage's symbols, and of values of calls before.
    values : (k, 1)
        Symbols that stand for the values.
    """

    function: Opaque
    inputs: cas.SX
    values: cas.SX


_calls: ContextVar[list[Call] | None] = ContextVar('calls', default=None)


@contextmanager
def recorded() -> Iterator[list[Call]]:
    """Give the list that the calls of opaque functions within the block are added to."""
    calls: list[Call] = []
    token = _calls.set(calls)
    try:
        yield calls
    finally:
        _calls.reset(token)


def values(function: Opaque, inputs: Sequence[Vectorizable], count: int) -> Sequence[Vectorizable]:
    """Return the values of an opaque function, or symbols for them while a stage is traced."""
    calls = _calls.get()
    if calls is None or not _are_scalar_symbols(inputs):
        return function.partials(inputs, 0)[(0,) * len(inputs)]
    symbols = cas.SX.sym('opaque', count)
    calls.append(Call(function, cas.vertcat(*inputs), symbols))  # type: ignore[arg-type]
    return list(cas.vertsplit(symbols))


def _are_scalar_symbols(inputs: Sequence[Any]) -> bool:
    symbols = [value for value in inputs if isinstance(value, cas.SX)]
    return bool(symbols) and all(
        value.is_scalar() if isinstance(value, cas.SX) else isinstance(value, float | int)
        for value in inputs
    )


def written_out(expressions: Sequence[cas.SX], calls: Sequence[Call]) -> list[cas.SX]:
    """Return expressions with the functions themselves in place of the symbols for values.

    What is in them more than once is worked out once.
    """
    count = len(expressions)
    # before the functions are written out, which have nothing twice and are long
    found = cas.cse([*expressions, *(call.inputs for call in calls)])
    symbols = [{_orders(call): call.values} for call in calls]
    return _inserted(found[:count], calls, found[count:], symbols)


def differentiated(
    value: cas.SX, w: cas.SX, mu: cas.SX, calls: Sequence[Call]
) -> tuple[cas.SX, cas.SX, cas.SX]:
    """Return an expression written out, its Jacobian, and the Hessian of its product with mu.

    Parameters
    ----------
    value : (n, 1)
        Of symbols w and values of the calls.
    w, mu : symbols (nw, 1), (n, 1)
    calls : in the order they were made in

    Returns
    -------
    (n, 1), (n, nw), (nw, nw)
        The Hessian has both triangles.

    Notes
    -----
    With v = (w, c) and c = S(q(v)) the values of a call, V = dv/dw and Q = dq/dw, the Hessian is
    V' (d2L/dv2) V + Q' (sum of l S'') Q. L is the product with mu plus that of q with what it is
    worth, S'^T l, and l = dL/dc; both are constant in the derivatives.
    """
    calls = _needed(value, calls)
    inputs = [call.inputs for call in calls]
    every = [_partial_symbols(call) for call in calls]
    jacobians = [  # of values by inputs
        cas.horzcat(*(found[_orders(call, i)] for i in range(call.inputs.size1())))
        for call, found in zip(calls, every, strict=True)
    ]
    inward: list[cas.SX] = []  # inputs by w
    through: list[cas.SX] = []  # values by w

    def by_w(expression: cas.SX) -> cas.SX:
        total = cas.jacobian(expression, w)
        for call, slope in zip(calls, through, strict=False):
            total += cas.mtimes(cas.jacobian(expression, call.values), slope)
        return total

    for expression, jacobian in zip(inputs, jacobians, strict=True):
        inward.append(by_w(expression))
        through.append(cas.mtimes(jacobian, inward[-1]))
    slope = by_w(value)

    # L: calls' inputs count in it by what they change through their values, their pull
    pulls = [cas.SX.sym('pull', expression.size1()) for expression in inputs]
    product = cas.dot(mu, value)
    for pull, expression in zip(pulls, inputs, strict=True):
        product += cas.dot(pull, expression)
    unknowns = cas.vertcat(w, *(call.values for call in calls))
    outer, gradient = cas.hessian(product, unknowns)
    all_slopes = cas.vertcat(cas.SX.eye(w.size1()), *through)
    bend = cas.mtimes([all_slopes.T, outer, all_slopes])
    counts = [w.size1(), *(call.values.size1() for call in calls)]
    weights = cas.vertsplit(gradient, [0, *accumulate(counts)])[1:]
    for call, found, weight, part in zip(calls, every, weights, inward, strict=True):
        axes = range(call.inputs.size1())
        own = [[cas.dot(weight, found[_orders(call, i, j)]) for j in axes] for i in axes]
        bend += cas.mtimes([part.T, cas.blockcat(own), part])
    pulled = [cas.mtimes(j.T, weight) for j, weight in zip(jacobians, weights, strict=True)]
    groups = [([pull], [weight]) for pull, weight in zip(pulls, pulled, strict=True)]
    results = _substituted([value, slope, cas.triu(bend)], groups[::-1])
    results = cas.cse([*results, *inputs])  # as in `written_out`
    value, slope, upper = _inserted(results[:3], calls, results[3:], every)
    return value, slope, cas.triu2symm(upper)


def _orders(call: Call, *by: int) -> Orders:
    return tuple(by.count(i) for i in range(call.inputs.size1()))


def _partial_symbols(call: Call) -> dict[Orders, cas.SX]:
    """Return the values, and symbols for first and second derivatives."""
    count, m = call.values.size1(), call.inputs.size1()
    found = {_orders(call): call.values}
    for by in ((i, *rest) for i in range(m) for rest in ((), *((j,) for j in range(i, m)))):
        found[_orders(call, *by)] = cas.SX.sym('partial', count)
    return found


def _needed(value: cas.SX, calls: Sequence[Call]) -> list[Call]:
    """Return the calls that an expression depends on."""
    kept: list[Call] = []
    for call in reversed(calls):
        if cas.depends_on(cas.vertcat(value, *(later.inputs for later in kept)), call.values):
            kept.insert(0, call)
    return kept


def _inserted(
    expressions: Sequence[cas.SX],
    calls: Sequence[Call],
    inputs: Sequence[cas.SX],
    symbols: Sequence[Mapping[Orders, cas.SX]],
) -> list[cas.SX]:
    """Return expressions with partial derivatives of calls at inputs in place of symbols."""
    groups: list[tuple[list[Any], list[Any]]] = []
    for call, at, by_orders in zip(calls, inputs, symbols, strict=True):
        found = call.function.partials(cas.vertsplit(at), max(map(sum, by_orders)))
        definitions = [cas.vertcat(*found[orders]) for orders in by_orders]
        groups.append((list(by_orders.values()), definitions))
    return _substituted(expressions, groups)


def _substituted(
    expressions: Sequence[cas.SX], groups: Sequence[tuple[list[Any], list[Any]]]
) -> list[cas.SX]:
    """Return expressions with groups of symbols replaced by their definitions.

    Definitions may hold symbols of groups before their own.
    """
    found = list(expressions)
    # one group at a time: CasADi's `substitute_inplace` fails where functions are called
    for symbols, definitions in reversed(groups):
        found = cas.substitute(found, symbols, definitions)
    return found
