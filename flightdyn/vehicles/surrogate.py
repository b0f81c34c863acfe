"""Smooth functions through gridded samples, in plain arithmetic that CasADi's SX can take.

Along each axis a function is a polynomial through Chebyshev points or a cubic spline through any
others: infinitely and twice continuously differentiable. Several axes multiply.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as _np
from numpy.typing import ArrayLike, NDArray

from .. import numpy as np
from ..errors import InputError
from ..numpy import Vectorizable

Array = NDArray[_np.float64]

MARGIN = 0.01
"""Part of an axis at either end in which an input is already bent towards the end."""

_NEGLIGIBLE = 2e-5  # coefficients left out, as a part of the largest value
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

    @property
    def is_polynomial(self) -> bool:
        """Whether the nodes are extrema of a Chebyshev polynomial, or too few for a spline."""
        n = len(self.nodes)
        # 1e-4: nodes as someone has written them down
        return n < _SPLINE_FROM or bool(
            _np.allclose(
                self.scaled(self.nodes), -_np.cos(_np.pi * _np.arange(n) / (n - 1)), 0, 1e-4
            )
        )

    def basis(self, s: Any) -> list[Any]:
        """Return the n functions that values are sums of, at a scaled input."""
        return self._chebyshev(s) if self.is_polynomial else self._splines(s)

    def _chebyshev(self, s: Any) -> list[Any]:
        functions = [1.0 + 0.0 * s, s]
        while len(functions) < len(self.nodes):
            functions.append(2.0 * s * functions[-1] - functions[-2])
        return functions[: len(self.nodes)]

    def _splines(self, s: Any) -> list[Any]:
        knots, weights = self._knots
        powers = [np.maximum(knot - s, 0.0) for knot in knots]
        powers = [power * power * power for power in powers]
        return [
            sum(w * p for w, p in zip(row, powers[i:], strict=False))
            for i, row in enumerate(weights)
        ]

    @property
    def _knots(self) -> tuple[Array, Array]:
        """Knots and the weights of five truncated powers in each B-spline.

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
        weights = []
        for i in range(len(s)):
            five = knots[i : i + 5]
            apart = five[:, None] - five[None, :] + _np.eye(5)
            weights.append((five[4] - five[0]) / apart.prod(axis=1))
        return knots, _np.array(weights)

    def collocation(self, x: ArrayLike) -> Array:
        """Return the functions at inputs: one row each, one column a function."""
        s = self.scaled(_np.asarray(x, float))
        return _np.stack(_np.broadcast_arrays(*self.basis(s)), axis=-1)


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
        their arithmetic; that moves the values by some 1e-4 at most.
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
        return self.of(basis_functions(self.axes, inputs))

    def of(self, functions: Sequence[Sequence[Vectorizable]]) -> Vectorizable:
        """Return the value of what `basis_functions` gave, which several surrogates may share."""
        total = _contract(self.coefficients, functions)
        return np.exp(total) if self.logarithmic else total

    def on_grid(self, points: Sequence[Array]) -> Array:
        """Return the values at all combinations of points along the axes, as they are."""
        tensor = self.coefficients
        for i, (axis, x) in enumerate(zip(self.axes, points, strict=True)):
            tensor = _np.moveaxis(_np.tensordot(axis.collocation(x), tensor, (1, i)), 0, i)
        return _np.exp(tensor) if self.logarithmic else tensor


def basis_functions(
    axes: Sequence[Axis], inputs: Mapping[str, Vectorizable]
) -> list[list[Vectorizable]]:
    """Return each axis' functions at inputs by name, bent into the axes' ranges."""
    return [axis.basis(axis.scaled(axis.clip(inputs[axis.name]))) for axis in axes]


def _contract(coefficients: Any, functions: Sequence[Sequence[Vectorizable]]) -> Any:
    """Return the sum of coefficients times products of functions, without those that are 0."""
    if not functions:
        return float(coefficients)
    first, *rest = functions
    # the last axes innermost: what depends on fewer inputs is shared by more
    terms = [
        function * _contract(part, rest)
        for function, part in zip(first, coefficients, strict=True)
        if _np.any(part)
    ]
    return sum(terms) if terms else 0.0
