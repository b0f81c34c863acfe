"""Smooth functions through gridded samples, in plain arithmetic that CasADi's SX can take.

Along each axis a function is a polynomial through Chebyshev points or a cubic spline through any
others: infinitely and twice continuously differentiable. Several axes multiply.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as cas
import numpy as _np
from numpy.typing import ArrayLike, NDArray

from .. import numpy as np
from ..dynamics import opaque
from ..errors import InputError
from ..numpy import Vectorizable, is_symbolic

Array = NDArray[_np.float64]

MARGIN = 0.01
"""Part of an axis at either end in which an input is already bent towards the end."""

_NEGLIGIBLE = 3e-7  # coefficients left out, as a part of the largest value
_SPLINE_FROM = 4  # nodes; through fewer goes one polynomial


def smooth_clip(x: Vectorizable, lower: float, upper: float, margin: float) -> Vectorizable:
    """Return x between lower + margin and upper - margin, and never beyond lower and upper.

    In between runs a quartic, so that two derivatives are continuous. The ends are reached a
    margin beyond them.
    """
    middle, half = (lower + upper) / 2, (upper - lower) / 2
    away = x - middle
    for sign in (1.0, -1.0):
        # how far x has come through the bend of width 2 margin; its slope is 1 - 3 u^2 + 2 u^3
        u = np.clip((sign * away - (half - margin)) / (2 * margin), 0.0, 1.0)
        straight = np.minimum(sign * away, half - margin)
        away = sign * (straight + 2 * margin * u * (1.0 - u * u * (1.0 - 0.5 * u)))
    return middle + away


@dataclass(frozen=True, eq=False)
class Axis:
    """An axis of a grid and the functions that values along it are made of.

    Parameters
    ----------
    name : str
    nodes : (n,)
        Ascending; one alone for a constant.
    logarithmic : bool
        Whether it is the logarithm that values are a smooth function of.
    """

    name: str
    nodes: Array
    logarithmic: bool = False

    def __post_init__(self) -> None:
        nodes = self.nodes
        if not _np.all(_np.isfinite(nodes)) or _np.any(_np.diff(nodes) <= 0):
            raise InputError(f'{self.name}: nodes must be finite and ascend')
        if self.logarithmic and nodes[0] <= 0:
            raise InputError(f'{self.name}: a logarithmic axis must be positive, got {nodes[0]:g}')

    @property
    def margin(self) -> float:
        """Half the width of the bend at either end."""
        return MARGIN * float(self.nodes[-1] - self.nodes[0])

    @property
    def box(self) -> tuple[float, float]:
        """Range in which inputs are taken as they are."""
        return float(self.nodes[0]) + self.margin, float(self.nodes[-1]) - self.margin

    def clip(self, x: Vectorizable) -> Vectorizable:
        """Return x where the samples are, see `smooth_clip`."""
        if len(self.nodes) == 1:
            return 0.0 * x + self.nodes[0]
        return smooth_clip(x, float(self.nodes[0]), float(self.nodes[-1]), self.margin)

    def scaled(self, x: Any) -> Any:
        """Return x, or its logarithm, brought to -1 ... 1."""
        lower, upper = self.nodes[0], self.nodes[-1]
        if self.logarithmic:
            x, lower, upper = np.log(x), _np.log(lower), _np.log(upper)
        return (2.0 * x - (lower + upper)) / (upper - lower) if lower < upper else x - lower

    @cached_property
    def is_polynomial(self) -> bool:
        """Whether the nodes are extrema of a Chebyshev polynomial, or too few for a spline."""
        n = len(self.nodes)
        # 1e-4: nodes as someone has written them down
        return n < _SPLINE_FROM or bool(
            _np.allclose(
                self.scaled(self.nodes), -_np.cos(_np.pi * _np.arange(n) / (n - 1)), 0, 1e-4
            )
        )

    def basis(self, s: Any, order: int = 0) -> list[list[Any]]:
        """Return the n functions that values are sums of, and their derivatives up to an order.

        Parameters
        ----------
        s
            Scaled input.
        order : 0, 1 or 2

        Returns
        -------
        order + 1 lists of n
        """
        return self._chebyshev(s, order) if self.is_polynomial else self._splines(s, order)

    def _chebyshev(self, s: Any, order: int) -> list[list[Any]]:
        n, twice, nothing = len(self.nodes), 2.0 * s, 0.0 * s
        found = [[1.0 + nothing, s], [nothing, 1.0 + nothing], [nothing, nothing]][: order + 1]
        for d, functions in enumerate(found):
            for i in range(2, n):
                following = twice * functions[-1] - functions[-2]
                if d:
                    following = following + 2.0 * d * found[d - 1][i - 1]
                functions.append(following)
        return [functions[:n] for functions in found]

    def _splines(self, s: Any, order: int) -> list[list[Any]]:
        knots, weights = self._knots
        ahead = [np.maximum(knot - s, 0.0) for knot in knots]
        powers = [
            [part * part * part for part in ahead],
            [-3.0 * part * part for part in ahead],
            [6.0 * part for part in ahead],
        ]
        return [_columns(weighted(part, weights)) for part in powers[: order + 1]]

    @cached_property
    def _knots(self) -> tuple[Array, Array]:
        """Knots (n + 4,) and the weights (n + 4, n) of truncated powers in each B-spline.

        The second node and the last but one are no knots, so that there are as many functions as
        nodes; knots beyond the ends keep all knots simple.

        References
        ----------
        .. [1] de Boor, *A Practical Guide to Splines*, revised edition, 2001, chapters IX
           (B-splines as divided differences of truncated powers) and IV (not-a-knot condition).
        """
        s = _np.asarray(self.scaled(self.nodes))
        inner = _np.concatenate((s[:1], s[2:-2], s[-1:]))
        first, last = inner[1] - inner[0], inner[-1] - inner[-2]
        beyond = _np.arange(1, 4)
        knots = _np.concatenate((s[0] - first * beyond[::-1], inner, s[-1] + last * beyond))
        weights = _np.zeros((len(knots), len(s)))
        for i in range(len(s)):
            five = knots[i : i + 5]
            apart = five[:, None] - five[None, :] + _np.eye(5)
            weights[i : i + 5, i] = (five[4] - five[0]) / apart.prod(axis=1)
        return knots, weights

    def collocation(self, x: ArrayLike) -> Array:
        """Return the functions at inputs: one row each, one column a function."""
        s = self.scaled(_np.asarray(x, float))
        return _np.stack(_np.broadcast_arrays(*self.basis(s)[0]), axis=-1)


@dataclass(frozen=True, eq=False)
class Surrogate:
    """A smooth function of several inputs through gridded samples.

    Parameters
    ----------
    axes : sequence of Axis
    coefficients : (n1, n2, ...)
        Of the products of the axes' functions.
    logarithmic : bool
        Whether it is the logarithm of the value that they add up to.
    """

    axes: tuple[Axis, ...]
    coefficients: Array
    logarithmic: bool = False

    @classmethod
    def fit(cls, axes: Sequence[Axis], values: Array) -> 'Surrogate':
        """Return the function through samples of shape (n1, n2, ...).

        Of values that are all positive the logarithm is fitted: errors are then relative, and the
        function stays positive. Coefficients are left out, the smallest first, that are not worth
        their arithmetic; that moves the values by some 1e-5 at most.
        """
        logarithmic = bool(_np.all(values > 0))
        tensor = _np.log(values) if logarithmic else values
        scale = 1.0 if logarithmic else float(_np.abs(values).max())
        for i, axis in enumerate(axes):
            across = _np.moveaxis(tensor, i, 0)
            flat = _np.linalg.solve(axis.collocation(axis.nodes), across.reshape(len(across), -1))
            tensor = _np.moveaxis(flat.reshape(across.shape), 0, i)
        if all(axis.is_polynomial for axis in axes):
            tensor = _np.where(_np.abs(tensor) > _NEGLIGIBLE * scale, tensor, 0.0)
        return cls(tuple(axes), tensor, logarithmic)

    def __call__(self, inputs: Mapping[str, Vectorizable]) -> Vectorizable:
        """Return the value at inputs by name, bent into the axes' ranges."""
        return evaluated([self], inputs)[0]

    def on_grid(self, points: Sequence[Array]) -> Array:
        """Return the values at all combinations of points along the axes, as they are."""
        tensor = self.coefficients
        for i, (axis, x) in enumerate(zip(self.axes, points, strict=True)):
            tensor = _np.moveaxis(_np.tensordot(axis.collocation(x), tensor, (1, i)), 0, i)
        return _np.exp(tensor) if self.logarithmic else tensor


def evaluated(
    surrogates: Sequence[Surrogate], inputs: Mapping[str, Vectorizable]
) -> list[Vectorizable]:
    """Return the values of surrogates over the same axes; what they share is done once."""
    axes = surrogates[0].axes
    sums = TensorSums(axes, _np.stack([surrogate.coefficients for surrogate in surrogates]))
    scaled = [axis.scaled(axis.clip(inputs[axis.name])) for axis in axes]
    totals = opaque.values(sums, scaled, len(surrogates))
    return [
        np.exp(total) if surrogate.logarithmic else total
        for surrogate, total in zip(surrogates, totals, strict=True)
    ]


@dataclass(frozen=True, eq=False)
class TensorSums:
    """Sums of products of the axes' functions, and their derivatives by the scaled inputs.

    Parameters
    ----------
    axes : sequence of Axis
    coefficients : (k, n1, n2, ...)
        Of k sums.
    """

    axes: tuple[Axis, ...]
    coefficients: Array

    def partials(
        self, inputs: Sequence[Vectorizable], order: int
    ) -> dict[opaque.Orders, list[Vectorizable]]:
        """Return all partial derivatives up to an order, by how often each input is in them.

        One axis after another is summed over, the longest first: that leaves least to the others.
        """
        inputs = _alike(inputs)
        turn = sorted(range(len(self.axes)), key=lambda i: -len(self.axes[i].nodes))
        first, *others = (self.axes[i].basis(inputs[i], order) for i in turn)
        tensor = self.coefficients.transpose(*(i + 1 for i in turn), 0)
        weights = tensor.reshape(len(tensor), -1)
        parts: dict[opaque.Orders, Any] = {
            (d,): weighted(functions, weights) for d, functions in enumerate(first)
        }
        for basis in others:
            parts = {
                (*orders, d): _summed(basis[d], part)
                for orders, part in parts.items()
                for d in range(order + 1 - sum(orders))
            }
        back = _np.argsort(turn)
        return {tuple(orders[i] for i in back): _columns(part) for orders, part in parts.items()}


def _alike(inputs: Sequence[Any]) -> list[Any]:
    """Return inputs of one length."""
    if not is_symbolic(*inputs):
        return list(_np.broadcast_arrays(*inputs))
    symbols = [x if is_symbolic(x) else cas.DM(x) for x in inputs]
    n = max(x.size1() for x in symbols)
    return [cas.repmat(x, n, 1) if x.size1() < n else x for x in symbols]


def weighted(functions: Sequence[Any], weights: Array) -> Any:
    """Return m sums of n functions with weights (n, m), in columns; see `_columns`."""
    if is_symbolic(*functions):
        # sparse: no products with 0
        return cas.mtimes(cas.horzcat(*functions), cas.sparsify(cas.DM(weights)))
    return _np.tensordot(_np.stack(functions, -1), weights, 1)


def _summed(functions: Sequence[Any], columns: Any) -> Any:
    """Return the sum of functions times as many blocks of columns."""
    width = columns.shape[-1] // len(functions)
    if is_symbolic(columns):
        blocks = cas.horzsplit(columns, width)
        factors = [cas.repmat(function, 1, width) for function in functions]
    else:
        blocks = _np.split(columns, len(functions), axis=-1)
        factors = [function[..., None] for function in functions]
    return sum(factor * block for factor, block in zip(factors, blocks, strict=True))


def _columns(columns: Any) -> list[Any]:
    if is_symbolic(columns):
        return list(cas.horzsplit(columns))
    return list(_np.moveaxis(columns, -1, 0))
