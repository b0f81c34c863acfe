"""What formulas of finished plans come to."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flightdyn.errors import InputError
from flightdyn.planning.expression import Expression
from flightdyn.planning.plan_values import check_value, quantities_of, value_of
from flightdyn.planning.problem_file import load_problem
from flightdyn.trajectory import Trajectory

FLIGHT = Trajectory(
    time=np.array([0.0, 1.0, 2.0]),
    states={'x_e': np.array([1.0, 5.0, 3.0]), 'z_e': np.array([-10.0, -30.0, -20.0])},
    outputs={'load_factor': np.array([1.0, 2.5, 0.5])},
)
REPORT = SimpleNamespace(objective=7.0, final_time=2.0, iterations=9, nodes=40)
PLAN: Any = SimpleNamespace(trajectory=FLIGHT, report=REPORT)
PARAMETERS = {'bank': 0.5, 'vehicle': 'rocket', 'initial.altitude': 10.0}


@pytest.mark.parametrize(
    ('formula', 'value'),
    [
        ('final.x_e - initial.x_e', 2.0),
        ('initial.altitude', 10.0),
        ('largest.altitude', 30.0),
        ('smallest.altitude', 10.0),
        ('largest.load_factor - smallest.load_factor', 2.0),
        ('objective / duration + final_time', 5.5),
        ('iterations + nodes', 49.0),
        ('bank / deg', np.degrees(0.5)),
        ('1 / (final.x_e - 3)', None),
        ('sqrt(-final.x_e)', None),
    ],
)
def test_values(formula: str, value: float | None) -> None:
    found = value_of(Expression(formula), PLAN, PARAMETERS)
    assert found == (None if value is None else pytest.approx(value, rel=1e-15))


@pytest.mark.parametrize(
    ('formula', 'said'),
    [
        ('final.x_d', "unknown 'x_d', did you mean 'x_e'"),
        ('last.x_e', "unknown 'last.x_e'"),
        ('x_e', "'x_e' at which time"),
        ('vehicle', "unknown 'vehicle'"),
        ('objektive', "did you mean 'objective'"),
        ('integral(x_e)', 'integral is not allowed here'),
    ],
)
def test_unknown_names_are_refused(formula: str, said: str) -> None:
    with pytest.raises(InputError, match=said.replace('(', r'\(')):
        value_of(Expression(formula), PLAN, PARAMETERS)


def test_names_are_checked_before_there_is_a_plan() -> None:
    names = quantities_of(load_problem('quadcopter_flip'))
    check_value(Expression('final.theta + largest.q'), names, {})
    with pytest.raises(InputError, match='bnak'):
        check_value(Expression('bnak'), names, {'bank': 1.0})
