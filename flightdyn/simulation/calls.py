"""CasADi functions called with arrays, without what conversions cost."""

import casadi as cas
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class ArrayCall:
    """A CasADi function of column vectors, called with arrays; some ten times quicker.

    Not for two threads at once.
    """

    def __init__(self, function: cas.Function) -> None:
        symbols = [cas.MX.sym(f'i{i}', function.size1_in(i)) for i in range(function.n_in())]
        results = [cas.densify(result) for result in function.call(symbols)]
        if any(function.sparsity_out(i).nnz() != r.numel() for i, r in enumerate(results)):
            function = cas.Function(f'{function.name()}_dense', symbols, results)
        self._function = function  # what is compiled holds addresses alone: its owner must live
        self._buffer, self._evaluate = function.buffer()
        self._arguments = [np.zeros(function.size1_in(i)) for i in range(function.n_in())]
        self._results = [np.zeros(function.size1_out(i)) for i in range(function.n_out())]
        for i, array in enumerate(self._arguments):
            self._buffer.set_arg(i, memoryview(array))  # type: ignore[call-arg, arg-type]
        for i, array in enumerate(self._results):
            self._buffer.set_res(i, memoryview(array))  # type: ignore[call-arg, arg-type]

    def __call__(self, *arguments: ArrayLike) -> tuple[Array, ...]:
        """Return new arrays (n,), one for each result."""
        for array, value in zip(self._arguments, arguments, strict=True):
            array[:] = value
        self._evaluate()
        return tuple(result.copy() for result in self._results)
