"""Objectives: what they may be, and optima known in closed form."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from flightdyn.errors import InputError, ResultCode
from flightdyn.planning.objective import TIME, maximize, minimize, parse_objective, trace
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem_file import load_problem
from flightdyn.planning.report import Plan
from flightdyn.vehicles.vehicle import load_vehicle

# A cart on a line: a body that never turns, of 1 kg, with a rotor at its centre.
CART = """
model: DynamicsRigidBody2DBody
mass: 1
inertia: {Iyy: 1}
gravity: 0
rotors: {push: {position: [0, 0, 0], direction: [1, 0, 0], thrust: [-20, 20]}}
"""
# The same, upright, in gravity.
LIFT = """
model: DynamicsRigidBody2DBody
mass: 2
inertia: {Iyy: 1}
gravity: 10
rotors: {push: {position: [0, 0, 0], direction: [0, 0, -1], thrust: [0, 50]}}
"""
# 3 m from rest to rest in 2 s on least effort
PROBLEM = """
vehicle: cart
objective: {minimize: integral(push**2)}
duration: 2
initial: {x_e: 0, z_e: 0, u_b: 0, w_b: 0, theta: 0, q: 0}
final: {x_e: 3, u_b: 0}
nodes: 20
control_interpolation: linear
"""

Solve = Callable[..., Plan]


@pytest.fixture(scope='module')
def solve(tmp_path_factory: pytest.TempPathFactory) -> Solve:
    folder: Path = tmp_path_factory.mktemp('config')
    (folder / 'vehicles').mkdir()
    (folder / 'vehicles' / 'cart.yaml').write_text(CART)
    (folder / 'vehicles' / 'lift.yaml').write_text(LIFT)
    path = folder / 'line.yaml'
    path.write_text(PROBLEM)
    planner = Planner()

    def solved(*settings: str) -> Plan:
        plan = planner.plan(load_problem(str(path), settings, folder))
        assert plan.report.code == ResultCode.SUCCESS, plan.report.message
        return plan

    return solved


FREE = 'duration={lower: 0.1, upper: 10, guess: 1}'


def test_integrals_may_enter_anyhow(solve: Solve) -> None:
    """The effort's root and its square have the effort's own optimum."""
    root = solve('objective={minimize: sqrt(integral(push**2))}', 'guess={push: [1, -1]}').report
    assert root.objective == pytest.approx(np.sqrt(13.5), rel=1e-8)
    square = solve('objective={minimize: effort**2}').report
    assert square.objective == pytest.approx((13.5 / 20**2) ** 2, rel=1e-6)


def test_least_effort_from_rest_to_rest_is_a_cubic(solve: Solve) -> None:
    """Of a double integrator: u = (6 d / T^2)(1 - 2 t / T), at a cost of 12 d^2 / T^3."""
    plan = solve()
    assert plan.report.objective == pytest.approx(12 * 3**2 / 2**3, rel=1e-8)
    t = plan.trajectory.time / 2
    # linear controls are the optimum's own, and RK4 is exact for its cubic
    np.testing.assert_allclose(plan.trajectory['push'], 4.5 * (1 - 2 * t), atol=1e-5)
    np.testing.assert_allclose(plan.trajectory['x_e'], 3 * t**2 * (3 - 2 * t), atol=1e-6)
    assert plan.report.verification['objective'] < 1e-6


def test_effort_counts_controls_over_their_limits(solve: Solve) -> None:
    effort = solve('objective={minimize: effort}').report
    assert effort.objective == pytest.approx(13.5 / 20**2, rel=1e-6)
    # a mean may be asked for as well: here the duration is fixed, and the plan the same
    mean = solve('objective={minimize: effort/duration}').report
    assert mean.objective == pytest.approx(13.5 / 20**2 / 2, rel=1e-6)


def test_held_controls_cost_a_little_more(solve: Solve) -> None:
    """Piecewise constant controls give up 1/N^2 of the double integrator's optimum, not less."""
    for n in (10, 20):
        held = solve('control_interpolation=previous', f'nodes={n}').report.objective
        assert held == pytest.approx(13.5 / (1 - 1 / n**2), rel=1e-6)


def test_minimum_time_between_rests_is_bang_bang(solve: Solve) -> None:
    report = solve('objective=time', FREE, 'control_interpolation=previous').report
    # 2 sqrt(d / a): with an even number of intervals the switch is at a node
    assert report.objective == pytest.approx(2 * np.sqrt(3 / 20), rel=1e-6)
    assert report.objective == pytest.approx(report.final_time, rel=1e-14)


@pytest.mark.parametrize('name', ['airspeed', 'u_b'])  # an output, a state
def test_speed_limit_makes_it_bang_coast_bang(solve: Solve, name: str) -> None:
    """Over d at most at speed v with acceleration a: d / v + v / a."""
    held = ('objective=time', FREE, 'nodes=19', 'control_interpolation=previous')
    plan = solve(*held, f'path.{name}=[null, 4]')
    # 19 intervals of 0.05 s have nodes where it switches, at 0.2 s and 0.75 s
    assert plan.report.final_time == pytest.approx(3 / 4 + 4 / 20, rel=1e-6)
    cruise = plan.trajectory.between(0.2001, 0.7499)['airspeed']
    assert cruise == pytest.approx(np.full(cruise.size, 4), abs=1e-4)
    assert plan.report.warnings == []


def test_bounds_left_between_the_nodes_are_told(solve: Solve) -> None:
    """Linear controls of both signs in turn keep a speed at the nodes, not between."""
    report = solve(
        *('objective=time', FREE, 'nodes=19', 'path.airspeed=[null, 4]'),
        'transcription=multiple_shooting',
    ).report
    assert report.final_time < 3 / 4 + 4 / 20
    assert len(report.warnings) == 1
    assert 'between nodes' in report.warnings[0]
    assert report.warnings[0].startswith('airspeed is 4.')


def test_longest_way_in_a_given_time(solve: Solve) -> None:
    """From rest, to rest: a T^2 / 4; not to rest: a T^2 / 2."""
    far = ('objective={maximize: final.x_e}', 'control_interpolation=previous')
    to_rest = solve(*far, 'final={u_b: 0}').report
    assert to_rest.objective == pytest.approx(20 * 2**2 / 4, rel=1e-6)
    flying = solve(*far, 'final={}').report
    assert flying.objective == pytest.approx(20 * 2**2 / 2, rel=1e-6)


def test_greatest_height_in_a_given_time(solve: Solve) -> None:
    """Full thrust all the way: (F / m - g) T^2 / 2, here 15 m/s^2."""
    plan = solve('vehicle=lift', 'objective={maximize: final.altitude}', 'final={x_e: 0}')
    assert plan.report.objective == pytest.approx(15 * 2**2 / 2, rel=1e-6)
    assert plan.trajectory['z_e'][-1] == pytest.approx(-30, rel=1e-6)
    np.testing.assert_allclose(plan.trajectory['push'], 50, rtol=1e-5)


def test_highest_hop_burns_first_and_coasts(solve: Solve) -> None:
    """At rest at the top: v^2 / 2 (1/a + 1/g) by energy, with v = a t1 = g (T - t1)."""
    plan = solve(
        *('vehicle=lift', 'objective={maximize: final.altitude}', 'final={w_b: 0, x_e: 0}'),
        *('control_interpolation=previous', 'nodes=20'),
    )
    v = 2 / (1 / 15 + 1 / 10)
    assert plan.report.objective == pytest.approx(v**2 / 2 * (1 / 15 + 1 / 10), rel=1e-6)
    push = plan.trajectory.sample('push', [0, 0.65, 0.95, 1.85])
    assert push == pytest.approx([50, 50, 0, 0], abs=1e-3)


def test_outputs_may_be_bounded_at_the_ends(solve: Solve) -> None:
    """Greatest speed reached over a distance, from a given one: v^2 = v0^2 + 2 a d."""
    plan = solve(
        *('objective={maximize: final.airspeed}', FREE, 'final={x_e: 3}'),
        *('initial={x_e: 0, z_e: 0, w_b: 0, theta: 0, q: 0, airspeed: [null, 5]}',),
        'guess.u_b=[5, 9]',
    )
    assert plan.report.objective == pytest.approx(np.sqrt(5**2 + 2 * 20 * 3), rel=1e-6)
    slow = solve('objective=time', FREE, 'final={x_e: 3, airspeed: [0, 2]}', 'guess.u_b=[1, 2]')
    assert slow.trajectory['airspeed'][-1] == pytest.approx(2, abs=1e-5)


def test_controls_may_be_bounded_at_the_ends(solve: Solve) -> None:
    plan = solve('initial.push=0', 'final.push=[-1, 1]')
    assert plan.trajectory['push'][0] == pytest.approx(0, abs=1e-9)
    assert plan.trajectory['push'][-1] == pytest.approx(-1, abs=1e-4)
    assert plan.report.objective > 13.5


def test_weights_trade_time_against_effort(solve: Solve) -> None:
    """Least T + w 12 d^2 / T^3 is at T^4 = 36 w d^2, and the less effort the more time."""
    times = []
    for weight in (0.01, 0.1, 1.0):
        report = solve(
            f'objective={{minimize: {{duration: 1, integral(push**2): {weight}}}}}', FREE
        ).report
        best = (36 * weight * 9) ** 0.25
        if 6 * 3 / best**2 < 20:  # no limit is in the way
            assert report.final_time == pytest.approx(best, rel=1e-5)
            assert report.objective == pytest.approx(best + weight * 108 / best**3, rel=1e-6)
        times.append(report.final_time)
    assert times[0] < times[1] < times[2]


@pytest.mark.parametrize('factor', [1e-6, 1e6])
def test_size_of_the_objective_does_not_matter(solve: Solve, factor: float) -> None:
    plain, scaled = solve(), solve(f'objective={{minimize: "{factor} * integral(push**2)"}}')
    assert scaled.report.objective == pytest.approx(factor * plain.report.objective, rel=1e-7)
    assert scaled.report.iterations == pytest.approx(plain.report.iterations, abs=1)


def test_sign_is_the_users(solve: Solve) -> None:
    least = solve('objective={minimize: -final.x_e}', 'final={u_b: 0}').report.objective
    most = solve('objective={maximize: final.x_e}', 'final={u_b: 0}').report.objective
    assert least == pytest.approx(-most, rel=1e-9)
    assert most > 0


def test_progress_is_in_the_users_units(solve: Solve, tmp_path: Path) -> None:
    (tmp_path / 'vehicles').mkdir()
    (tmp_path / 'vehicles' / 'cart.yaml').write_text(CART)
    (tmp_path / 'line.yaml').write_text(PROBLEM)
    seen: list[float] = []
    settings = ['objective={maximize: final.x_e}', 'final={u_b: 0}']
    problem = load_problem(str(tmp_path / 'line.yaml'), settings, tmp_path)
    plan = Planner().plan(problem, on_iteration=lambda i: seen.append(i.objective))
    assert seen[-1] == pytest.approx(plan.report.objective, rel=1e-9)


def test_integrals_are_verified_against_the_flight(solve: Solve) -> None:
    """sin(20 t) over coarse intervals: RK4's quadrature is refined until it is right."""
    report = solve('objective={minimize: integral(push**2 + sin(20*time))}', 'nodes=5').report
    assert 'RK4 x1,' not in report.transcription
    # the added integral does not depend on the plan; 5 linear pieces are the optimum's own
    assert report.objective == pytest.approx(13.5 + (1 - np.cos(40)) / 20, rel=2e-4)


def test_time_has_its_own_word() -> None:
    assert parse_objective('time', 'here') == TIME == minimize('duration')
    assert parse_objective({'maximize': 'final.x_e'}, 'here') == maximize('final.x_e')
    assert str(TIME) == 'minimize duration'


def test_sums_are_written_out() -> None:
    made = minimize({'duration': 1, 'final.z_e - initial.z_e': -2.5})
    assert made.expression.source == '1.0*(duration) + -2.5*(final.z_e - initial.z_e)'


@pytest.mark.parametrize(
    ('value', 'message'),
    [
        ('fuel', r"here: unknown objective 'fuel': expected 'time', \{minimize: WHAT\}"),
        ({}, "expected 'time'"),
        ({'minimize': 'duration', 'maximize': 'duration'}, "expected 'time'"),
        ({'minimise': 'duration'}, "did you mean 'minimize'"),
        ({'minimize': {}}, 'expected a formula'),
        ({'minimize': [1]}, 'expected a formula'),
        ({'minimize': 3}, 'expected a formula'),
        ({'minimize': {'duration': 'much'}}, r'here\.minimize\.duration: expected a number'),
        ({'minimize': {'duration)+(1': 1}}, r'here\.minimize\.duration\)\+\(1: not a formula'),
        (None, 'expected a mapping'),
    ],
)
def test_what_is_no_objective_is_refused(value: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        parse_objective(value, 'here')


@pytest.mark.parametrize(
    ('what', 'message'),
    [
        ('final.x', "unknown 'x'; known: x_e"),
        ('initial.gama', "did you mean 'gamma'"),
        ('integral.thrust', "did you mean 'thrust_"),
        ('middle.x_e', "unknown 'middle.x_e'"),
        ('x_e', "'x_e' at which time"),
        ('altitude', "'altitude' at which time"),
        ('durations', "did you mean 'duration'"),
        ('integral(final.x_e)', "unknown 'final.x_e'"),
        ('integral(integral(x_e))', 'integral is not allowed here'),
        ('final.__class__', "unknown '__class__'"),
        ('final.x_e + 1/0', 'not a finite number'),
    ],
)
def test_names_in_objectives_are_checked(what: str, message: str) -> None:
    stage = load_vehicle('quadcopter').model().stage()
    with pytest.raises(InputError, match=message):
        trace(minimize(what, 'flip: minimize'), stage, (1.0, 1.0))
