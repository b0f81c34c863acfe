"""What a solution puts numbers into."""

import types
from collections import OrderedDict, defaultdict, namedtuple
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import casadi as cas
import numpy as np
import pytest

import flightdyn as fd
from flightdyn.errors import InputError
from flightdyn.planning.opti import Opti


@pytest.fixture(scope='module')
def solved():
    opti = Opti()
    a = opti.variable(1.0)
    x = opti.variable([1.0, 2.0, 3.0])
    unused = opti.variable(7.0, 2)
    opti.subject_to([a == 2, x == cas.DM([1, 4, 9])])
    return opti.solve(verbose=False), a, x, unused


def test_shapes_of_values(solved):
    sol, a, x, unused = solved
    assert sol(a) == 2 and type(sol(a)) is float
    assert sol(x).shape == (3,) and sol(x.T).shape == (3,)
    assert sol(cas.horzcat(x, 2 * x)).tolist() == [[1, 2], [4, 8], [9, 18]]
    assert sol(unused).tolist() == [7, 7]
    assert sol.value(x[1]) == 4


def test_what_depends_on_no_variable(solved):
    sol, *_ = solved
    for thing in (1.5, 3, 'text', None, np.arange(3), np.sin, Path, types, Path('x'), fd.Dynamics):
        assert sol(thing) is thing
    assert sol(cas.DM([1, 2])).tolist() == [1, 2]
    assert sol(cas.MX(3)) == 3.0 and sol(cas.SX(4)) == 4.0
    f = cas.Function('f', [cas.SX.sym('x')], [1])
    assert sol(f) is f


def test_nested_containers(solved):
    sol, a, x, _ = solved
    Pair = namedtuple('Pair', 'left right')
    nested = {
        'list': [a, [x[0], (a, 'text')]],
        'pair': Pair(a, 1),
        'set': {a, 5},
        'frozen': frozenset([a]),
        'default': defaultdict(list, {'k': [a]}),
        'ordered': OrderedDict(b=a),
        'array': np.array([a, x[1]], dtype=object),
    }
    got = sol(nested)
    assert got['list'] == [2, [1, (2, 'text')]]
    assert got['pair'] == Pair(2, 1) and isinstance(got['pair'], Pair)
    assert got['set'] == {2, 5} and got['frozen'] == frozenset([2])
    assert got['default'] == {'k': [2]} and got['default'].default_factory is list
    assert type(got['ordered']) is OrderedDict and got['ordered'] == {'b': 2}
    assert got['array'].dtype == float and got['array'].tolist() == [2, 4]
    assert isinstance(nested['list'][0], cas.MX)
    with pytest.raises(InputError, match='set'):
        sol({x})


@dataclass(frozen=True)
class Frozen:
    value: Any
    note: str = 'kept'


@dataclass(slots=True)
class Slotted:
    value: Any
    children: list = field(default_factory=list)


def test_objects_are_copied(solved):
    sol, a, x, _ = solved
    thing = types.SimpleNamespace(frozen=Frozen(a), slotted=Slotted(x, [Frozen(x[2])]), plain={})
    got = sol(thing)
    assert got.frozen == Frozen(2)
    assert got.slotted.value.tolist() == [1, 4, 9] and got.slotted.children == [Frozen(9)]
    assert got.plain is thing.plain and got is not thing
    assert thing.frozen.value is a


def test_circles_are_kept(solved):
    sol, a, _, _ = solved
    parent = types.SimpleNamespace(children=[])
    child = types.SimpleNamespace(parent=parent, value=a, me=None)
    child.me = (child,)
    parent.children.append(child)
    got = sol(parent)
    assert got.children[0].parent is got and got.children[0].value == 2
    assert got.children[0].me[0] is got.children[0]
    ring = [a]
    ring.append(ring)
    assert sol(ring)[1][1][0] == 2


def test_vehicles_and_air(solved):
    sol, a, x, _ = solved
    dyn = fd.DynamicsPointMass3DSpeedGammaTrack(
        mass_props=fd.MassProperties(mass=a),
        z_e=-100 * x,
        speed=10 * x,
        gamma=0.1 * x,
        alpha=x,
    )
    dyn.add_gravity_force()
    dyn.add_force(Fx=x, axes='body')
    numeric = fd.DynamicsPointMass3DSpeedGammaTrack(
        mass_props=fd.MassProperties(mass=2.0),
        z_e=-100.0 * np.array([1, 4, 9]),
        speed=10.0 * np.array([1, 4, 9]),
        gamma=0.1 * np.array([1, 4, 9]),
        alpha=np.array([1.0, 4, 9]),
    )
    numeric.add_gravity_force()
    numeric.add_force(Fx=np.array([1.0, 4, 9]), axes='body')
    got = sol(dyn)
    assert type(got) is type(dyn) and isinstance(dyn.speed, cas.MX)
    assert got.mass_props.mass == 2.0
    for name, value in numeric.state_derivatives().items():
        assert got.state_derivatives()[name] == pytest.approx(value, rel=1e-12, abs=1e-12)
    air = sol(dyn.op_point).atmosphere
    assert air.density() == pytest.approx(numeric.op_point.atmosphere.density(), rel=1e-12)


def test_solution_outlives_later_solves():
    opti = Opti()
    p = opti.parameter(1.0)
    x = opti.variable(0.0)
    constraint = x >= p
    opti.subject_to(constraint)
    opti.minimize(x)
    first = opti.solve(verbose=False)
    second = opti.solve({p: 2}, verbose=False)
    assert (first(x), second(x)) == pytest.approx((1, 2))
    assert first(opti.dual(constraint)) == pytest.approx(1)


def test_symbols_of_another_problem_are_refused(solved):
    sol, a, *_ = solved
    other = Opti().variable(1.0)
    with pytest.raises(InputError, match='does not have'):
        sol([a, other])


def test_infeasibilities_are_listed_worst_first(capsys):
    opti = Opti()
    x = opti.variable(1.0, 2, lower_bound=0, upper_bound=[1, 10])
    opti.subject_to([x[0] ** 2 >= 4, x[1] ** 2 >= 1e4])
    last = opti.solve(verbose=False, behavior_on_failure='return_last')
    found = last.infeasibilities()
    # Relative to its limit x0 is off by 3 of 4, x1 by 9900 of 10000.
    assert [row.lower for row in found[:2]] == [1e4, 4]
    assert found[0].violation == pytest.approx(9900, rel=1e-2)
    last.show_infeasibilities()
    assert 'x[1] ** 2 >= 10000.0' in capsys.readouterr().out
    assert last.infeasibilities(tol=1e9) == []
