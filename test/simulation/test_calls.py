"""Functions called with arrays: the same numbers as by CasADi's own way."""

import casadi as cas
import numpy as np
import pytest

from flightdyn.simulation.calls import ArrayCall
from flightdyn.vehicles.vehicle import load_vehicle


def test_results_are_the_functions_own_and_new_each_time() -> None:
    function = load_vehicle('quadcopter').model().stage().function
    call = ArrayCall(function)
    random = np.random.default_rng(0)
    arguments = [[random.normal(size=function.size1_in(i)) for i in range(3)] for _ in range(2)]
    results = [call(*each) for each in arguments]
    for each, found in zip(arguments, results, strict=True):
        for mine, own in zip(found, function(*each), strict=True):
            np.testing.assert_array_equal(mine, own.full().ravel())


def test_zeros_that_a_function_leaves_out_are_there() -> None:
    x = cas.SX.sym('x', 3)
    call = ArrayCall(cas.Function('f', [x], [cas.vertcat(0, x[0], cas.SX(1, 1)), cas.SX(0, 1)]))
    first, second = call([2.0, 3.0, 4.0])
    assert first.tolist() == [0.0, 2.0, 0.0]
    assert second.size == 0


def test_arguments_have_to_be_as_many_as_the_function_has() -> None:
    x = cas.SX.sym('x')
    with pytest.raises(ValueError, match='zip'):
        ArrayCall(cas.Function('f', [x], [x]))(1.0, 2.0)
