"""Integration: closed forms, orders, dense output, events, and three integrators to one answer."""

import math
import signal
from collections.abc import Callable, Sequence
from typing import Any

import casadi as cas
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from flightdyn.dynamics import FAMILY, Dynamics, MassProperties
from flightdyn.dynamics.stage import Model, Stage
from flightdyn.errors import InputError
from flightdyn.simulation.events import Event, ground_contact
from flightdyn.simulation.integrator import integrate, reintegrate, rk4_step
from flightdyn.trajectory import Trajectory
from flightdyn.vehicles.vehicle import load_vehicle

Array = NDArray[np.float64]
BOTH = pytest.mark.parametrize('options', [{}, {'method': 'rk4', 'max_step': 0.01}])
QUADCOPTER = load_vehicle('quadcopter').model().stage()
G = 9.81


def stage_of(
    states: str,
    equations: Callable[[cas.SX, cas.SX, cas.SX], Sequence[Any]],
    controls: str = '',
) -> Stage:
    """Return a stage of (x, u, time) -> dx/dt, whose one output is the sum of the states."""
    names, controlled = tuple(states.split()), tuple(controls.split())
    x, u, p = cas.SX.sym('x', len(names)), cas.SX.sym('u', len(controlled)), cas.SX.sym('p', 4)
    dx = cas.vertcat(*equations(x, u, p[-1]))
    function = cas.Function('f', [x, u, p], [dx, cas.sum1(x)], ['x', 'u', 'p'], ['dx', 'outputs'])
    return Stage(names, controlled, ('sum',), function, (0.0,) * len(names))


OSCILLATOR = stage_of('a b', lambda x, u, t: (x[1], -x[0]))
FALL = stage_of('x_e z_e u_e w_e', lambda x, u, t: (x[2], x[3], 0, G))
LAG = stage_of('a', lambda x, u, t: (u[0] - x[0],), 'u')


def oscillation(t: Array) -> Array:
    return np.array([np.cos(t), -np.sin(t)])


# ---------------------------------------------------------------------- accuracy


def test_rk4_converges_with_fourth_order_at_its_nodes_and_between() -> None:
    t = np.linspace(0, 5, 777)
    nodes, between = [], []
    for step in (0.2, 0.1, 0.05, 0.025):
        flown = integrate(OSCILLATOR, {'a': 1}, (0, 5), method='rk4', max_step=step)
        nodes.append(np.abs(flown.states - oscillation(flown.time)).max())
        between.append(np.abs(flown.sol(t) - oscillation(t)).max())
    for errors in (nodes, between):
        slope = np.polyfit(np.log2([8, 4, 2, 1]), np.log2(errors), 1)[0]
        assert slope == pytest.approx(4, abs=0.2)


def test_rk4_with_forces_that_depend_on_time_keeps_its_order() -> None:
    driven = stage_of('a', lambda x, u, t: (-(x[0] ** 2) * (1 + t),))
    exact = 1 / (1 + 2 + 2**2 / 2)
    step = rk4_step(driven, 1)
    errors = []
    for n in (20, 40, 80, 160):
        x = 1.0
        for k in range(n):
            x = float(step(x, [], [], [0, 0, 0, 2 * k / n], 2 / n))
        whole = rk4_step(driven, n)(1.0, [], [], [0, 0, 0, 0], 2.0)
        assert x == pytest.approx(float(whole), rel=1e-13)
        errors.append(abs(x - exact))
    assert np.log2(errors[-2] / errors[-1]) == pytest.approx(4, abs=0.2)


@pytest.mark.parametrize('rtol', [1e-8, 1e-10, 1e-12])
def test_cvodes_follows_its_tolerance_and_the_dense_output_follows_cvodes(rtol: float) -> None:
    flown = integrate(OSCILLATOR, {'a': 1}, (0, 20), rtol=rtol, atol=rtol / 100)
    t = np.linspace(0, 20, 5001)
    # errors of some 800 steps add up: 250 times the tolerance were measured
    assert np.abs(flown.states - oscillation(flown.time)).max() < 1000 * rtol
    finer = integrate(OSCILLATOR, {'a': 1}, (0, 20), rtol=rtol, atol=rtol / 100, t_eval=t)
    np.testing.assert_array_equal(finer.states, flown.sol(t))
    # the panels' polynomials add less than ten tolerances to the error at the nodes
    nodes = np.interp(t, flown.time, np.abs(flown.states - oscillation(flown.time)).max(axis=0))
    assert (np.abs(flown.sol(t) - oscillation(t)).max(axis=0) < nodes + 20 * rtol).all()


def test_cvodes_is_tight_on_exponentials_both_ways() -> None:
    both = stage_of('up down', lambda x, u, t: (x[0], -x[1]))
    flown = integrate(both, [1, 1], (0, 10))
    assert flown.final_state == pytest.approx([math.exp(10), math.exp(-10)], rel=1e-7)


def test_a_stiff_flight_is_dense_everywhere() -> None:
    # the layer of 1 ms at the begin once fell between two points of one long panel
    rate = 1000.0
    stiff = stage_of('a', lambda x, u, t: (-rate * (x[0] - cas.cos(t)),))

    def exact(t: Array) -> Array:
        steady = rate**2 * np.cos(t) + rate * np.sin(t)
        return np.asarray((steady - rate**2 * np.exp(-rate * t)) / (1 + rate**2))

    flown = integrate(stiff, [0], (0, 20))
    t = np.concatenate([np.linspace(0, 0.02, 1001), np.linspace(0, 20, 1001)])
    np.testing.assert_allclose(flown.sol(t)[0], exact(t), atol=2e-8)


def test_a_jump_of_the_equations_is_found_without_being_told() -> None:
    switched = stage_of('a', lambda x, u, t: (cas.if_else(t > 1.2345, -1, 1),))
    flown = integrate(switched, [0], (0, 3))
    t = np.linspace(0, 3, 1001)
    np.testing.assert_allclose(flown.sol(t)[0], 1.2345 - np.abs(t - 1.2345), atol=1e-7)


@BOTH
def test_a_cannonball_in_vacuum_flies_a_parabola(options: dict[str, Any]) -> None:
    flown = integrate(FALL, {'u_e': 30, 'w_e': -40}, (0, 8), **options)
    t = np.linspace(0, 8, 101)
    exact = np.array([30 * t, -40 * t + G / 2 * t**2, 30 + 0 * t, -40 + G * t])
    np.testing.assert_allclose(flown.sol(t), exact, atol=1e-8)


def test_a_phugoid_turns_in_the_period_of_its_linearization() -> None:
    # lift with the square of the speed, no drag: speed' = -g sin(gamma),
    # gamma' = (g / speed) (speed^2 / trim^2 - cos(gamma)); period sqrt(2) pi trim / g
    trim, small = 60.0, 1e-2
    phugoid = stage_of(
        'speed gamma',
        lambda x, u, t: (
            -G * cas.sin(x[1]),
            G / x[0] * (x[0] ** 2 / trim**2 - cas.cos(x[1])),
        ),
    )
    level = Event('level', 'gamma', terminal=False, direction=1)
    flown = integrate(phugoid, [trim + small, 0], (0, 100), events=[level])
    times = [event.time for event in flown.events]
    # the period of a finite swing differs by its square over the trim speed's
    assert np.diff(times) == pytest.approx(math.sqrt(2) * math.pi * trim / G, rel=1e-6)


def test_three_integrators_agree_on_a_flight() -> None:
    x0 = np.array([0, 0, 3, 1, 0.3, 8.0])
    u = {'thrust_left': 0.9, 'thrust_right': 0.2}
    t = np.linspace(0, 1, 41)
    f = QUADCOPTER.right_hand_side(u, (1.0, -2.0, 0.5))
    scipy = solve_ivp(f, (0, 1), x0, 'DOP853', t, rtol=1e-13, atol=1e-13).y
    # it spins up to 60 rad/s: RK4 errs by 4e-7 there, and with the fourth power of the step
    for options, tolerance in (
        ({'rtol': 1e-12, 'atol': 1e-14}, 1e-8),
        ({'method': 'rk4', 'max_step': 5e-4}, 1e-6),
    ):
        flown = integrate(
            QUADCOPTER, x0, (0, 1), controls=u, wind=(1, -2, 0.5), t_eval=t, **options
        )
        np.testing.assert_allclose(flown.states, scipy, atol=tolerance)


# ---------------------------------------------------------------------- controls


@BOTH
@pytest.mark.parametrize('interpolation', ['previous', 'linear'])
def test_jumps_and_bends_of_controls_cost_no_accuracy(
    interpolation: Any, options: dict[str, Any]
) -> None:
    time, u = np.array([0.0, 0.3, 0.37, 1.1]), np.array([1.0, -2.0, 4.0, 0.5])
    plan = Trajectory(time=time, states={}, controls={'u': u}, control_interpolation=interpolation)
    flown = integrate(LAG, [0], (0, 2), controls=plan, **options)
    # piece by piece: u = u0 + k s gives a = u0 - k + k s + (a0 - u0 + k) exp(-s)
    a, exact = 0.0, [0.0]
    ends = u if interpolation == 'previous' else np.append(u[1:], u[-1])
    for s, u0, u1 in zip(np.diff([*time, 2.0]), u, ends, strict=True):
        k = (u1 - u0) / s
        a = u0 - k + k * s + (a - u0 + k) * math.exp(-s)
        exact.append(a)
    np.testing.assert_allclose(flown.sol([*time, 2.0])[0], exact, atol=3e-9)


@BOTH
def test_controls_may_be_functions_of_time(options: dict[str, Any]) -> None:
    t = cas.SX.sym('t')
    exact = (math.sin(3) - math.cos(3) + math.exp(-3)) / 2
    for controls in (
        cas.Function('u', [t], [cas.sin(t)]),
        lambda t: {'u': math.sin(t)},
        lambda t: [math.sin(t)],
    ):
        flown = integrate(LAG, [0], (0, 3), controls=controls, **options)
        assert flown.final_state[0] == pytest.approx(exact, abs=1e-8)
        assert flown.to_trajectory()['u'] == pytest.approx(np.sin(flown.time))


@pytest.mark.parametrize('options', [{}, {'method': 'rk4', 'max_step': 0.02}])
def test_breaks_tell_where_a_function_of_time_jumps(options: dict[str, Any]) -> None:
    # the last stage before the jump once saw the control after it, an error of 1e-3
    def controls(t: float) -> list[float]:
        return [1.0 if t < 0.7 else 0.0]

    flown = integrate(LAG, [0], (0, 2), controls=controls, breaks=[0.7], **options)
    exact = (1 - math.exp(-0.7)) * math.exp(-1.3)
    assert flown.final_state[0] == pytest.approx(exact, abs=3e-9)
    assert 0.7 in flown.time


def test_what_a_control_function_raises_comes_through() -> None:
    def broken(t: float) -> dict[str, float]:
        raise ZeroDivisionError(f'at {t}')

    with pytest.raises(ZeroDivisionError, match=r'at 0\.0'):
        integrate(LAG, [0], (0, 1), controls=broken)
    with pytest.raises(InputError, match=r'controls u are missing; given: v'):
        integrate(LAG, [0], (0, 1), controls=lambda t: {'v': 1.0})


def test_reintegration_ends_in_nan_where_the_flight_cannot_go_on() -> None:
    explosion = stage_of('a', lambda x, u, t: (x[0] ** 2,))
    time = np.linspace(0, 2, 9)
    states = reintegrate(explosion, [1.0], time, np.zeros((0, 8)), np.zeros((0, 8)), np.zeros(3))
    np.testing.assert_allclose(states[0, :4], 1 / (1 - time[:4]), rtol=1e-7)
    assert np.isnan(states[0, 5:]).all()


# ---------------------------------------------------------------------- events


@BOTH
@settings(max_examples=20)
@given(up=st.floats(5, 60), height=st.floats(-50, 1))
def test_ground_contact_is_where_the_parabola_meets_it(
    options: dict[str, Any], up: float, height: float
) -> None:
    flown = integrate(
        FALL, {'u_e': 7, 'w_e': -up}, (0, 30), events=[ground_contact(height)], **options
    )
    time = (up + math.sqrt(up**2 - 2 * G * height)) / G
    (event,) = flown.events
    assert event.time == pytest.approx(time, abs=1e-9)
    # a tenth of a nanosecond at the speed of the fall, and CVODES' own error
    assert event.state == pytest.approx([7 * time, -height, 7, G * time - up], abs=1e-8)
    assert flown.status == 'event' and flown.terminated_by == 'ground contact'
    assert flown.final_time == event.time
    np.testing.assert_array_equal(flown.final_state, event.state)


@BOTH
def test_every_crossing_is_found_in_its_direction(options: dict[str, Any]) -> None:
    events = [
        Event('any', 'a', terminal=False),
        Event('rising', 'a', terminal=False, direction=1),
        Event('falling', 'a', terminal=False, direction=-1),
    ]
    flown = integrate(OSCILLATOR, {'a': 1}, (0, 20), events=events, **options)
    times = {e.name: [x.time for x in flown.events if x.name == e.name] for e in events}
    crossings = np.arange(math.pi / 2, 20, math.pi)
    assert times['any'] == pytest.approx(crossings, abs=1e-7)
    assert times['falling'] == pytest.approx(crossings[::2], abs=1e-7)
    assert times['rising'] == pytest.approx(crossings[1::2], abs=1e-7)
    assert [e.time for e in flown.events] == sorted(e.time for e in flown.events)


@BOTH
def test_two_crossings_of_one_panel_are_both_found(options: dict[str, Any]) -> None:
    # a flight through 20.3 m, 0.2 m below its summit: 0.4 s above
    summit = 20**2 / (2 * G)
    event = Event('20.3', lambda t, x: -x['z_e'] - (summit - 0.2), terminal=False)
    flown = integrate(FALL, {'w_e': -20}, (0, 4), events=[event], **options)
    half = math.sqrt(2 * 0.2 / G)
    expected = [20 / G - half, 20 / G + half]
    assert [e.time for e in flown.events] == pytest.approx(expected, abs=1e-9)


def test_events_may_be_names_casadi_functions_and_python_functions() -> None:
    x, u, p = cas.SX.sym('x', 2), cas.SX.sym('u', 0), cas.SX.sym('p', 4)
    quantities: list[Any] = [
        'sum',
        cas.Function('sum', [x, u, p], [x[0] + x[1] + 0 * p[3]]),
        lambda t, state: state['a'] + state['b'] + 0 * t,
    ]
    for quantity in quantities:
        event = Event('sum is 0.3', quantity, value=0.3)
        flown = integrate(OSCILLATOR, {'a': 1}, (0, 9), events=[event])
        # cos(t) - sin(t) = sqrt(2) cos(t + pi / 4)
        exact = math.acos(0.3 / math.sqrt(2)) - math.pi / 4
        assert flown.final_time == pytest.approx(exact, abs=1e-9)


def test_the_first_terminal_event_ends_the_flight() -> None:
    events = [
        Event('late', 'a', value=-0.5),
        Event('early', 'a', value=0.5),
        Event('passing', 'a', value=0.7, terminal=False),
    ]
    flown = integrate(OSCILLATOR, {'a': 1}, (0, 9), events=events, t_eval=np.linspace(0, 9, 91))
    assert [e.name for e in flown.events] == ['passing', 'early']
    assert flown.terminated_by == 'early'
    assert flown.final_time == pytest.approx(math.pi / 3, abs=1e-9)
    np.testing.assert_allclose(flown.time, np.linspace(0, 1, 11))
    with pytest.raises(InputError, match=r'the flight runs from 0 s to 1\.047'):
        flown.sol(1.1)


@BOTH
def test_a_flight_goes_on_from_an_event_without_meeting_it_again(options: dict[str, Any]) -> None:
    bounces, time = [], 0.0
    state = {'w_e': -10.0}
    for _ in range(3):
        flown = integrate(FALL, state, (time, 60), events=[Event('ground', 'altitude')], **options)
        time = flown.final_time
        bounces.append(time)
        state = dict(zip(FALL.states, flown.final_state.tolist(), strict=True))
        state['w_e'] *= -0.5
    first = 2 * 10 / G
    assert bounces == pytest.approx([first, 1.5 * first, 1.75 * first], abs=1e-8)


def test_a_quantity_that_jumps_with_the_controls_is_an_event_at_the_jump() -> None:
    plan = Trajectory(
        time=np.array([0.0, 0.5]),
        states={},
        controls={'u': np.array([1.0, -1.0])},
        control_interpolation='previous',
    )
    flown = integrate(LAG, [0], (0, 2), controls=plan, events=[Event('reversed', 'u')])
    assert flown.final_time == 0.5 and flown.final_state[0] == pytest.approx(1 - math.exp(-0.5))


# ---------------------------------------------------------------------- refusals and failures


@pytest.mark.parametrize(
    ('options', 'message'),
    [
        ({'x0': {'c': 1.0}}, "unknown state 'c'"),
        ({'x0': [1.0]}, r'has 2 values \(a, b\)'),
        ({'x0': {'b': math.nan}}, 'initial b is nan: must be finite'),
        ({'time_span': (1, 1)}, 'increasing times'),
        ({'time_span': (0, math.inf)}, 'increasing times'),
        ({'t_eval': [0, 2, 1]}, 't_eval must be'),
        ({'t_eval': [0, 3.5]}, 'beyond the span from 0 s to 3 s'),
        ({'method': 'rk5'}, "unknown method 'rk5', did you mean 'rk4'"),
        ({'method': 'rk4'}, 'give max_step'),
        ({'method': 'rk4', 'max_step': 1e-7}, 'more than 1000000 steps'),
        ({'max_step': 0.0}, 'max_step must be positive'),
        ({'rtol': -1e-3}, 'must be positive'),
        ({'wind': (1, 2)}, 'wind must be 3'),
        ({'controls': {'flap': 1.0}}, "unknown control 'flap'"),
        ({'events': [Event('e', 'alpha')]}, "event e: unknown quantity 'alpha'"),
        ({'events': [Event('e', lambda t, x: math.nan)]}, 'event e is not finite at 0 s'),
    ],
)
def test_wrong_requests_are_refused(options: dict[str, Any], message: str) -> None:
    given: dict[str, Any] = {'x0': {'a': 1.0}, 'time_span': (0, 3), **options}
    with pytest.raises(InputError, match=message):
        integrate(OSCILLATOR, **given)


@pytest.mark.parametrize('options', [{'direction': 2}, {'value': math.nan}])
def test_wrong_events_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(InputError, match='event e'):
        Event('e', 'a', **options)


@BOTH
def test_an_explosion_is_an_error_with_its_time_and_state(options: dict[str, Any]) -> None:
    explosion = stage_of('a', lambda x, u, t: (x[0] ** 2,))
    with pytest.raises(InputError, match=r'cannot go on at (0\.9999|1\.0)\d* s.*\(a = ') as error:
        integrate(explosion, [1], (0, 5), **options)
    assert 'Error in Function' not in str(error.value)


@pytest.mark.skipif(not hasattr(signal, 'setitimer'), reason='needs interval timers')
def test_ctrl_c_is_heard_inside_of_cvodes() -> None:
    # CVODES reports it as a failure of the equations, which once made the integrator try again
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 0.05)
    try:
        with pytest.raises(KeyboardInterrupt):
            integrate(OSCILLATOR, {'a': 1}, (0, 1e5))  # of a minute
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def test_a_state_without_derivative_is_an_error() -> None:
    root = stage_of('a', lambda x, u, t: (-cas.sqrt(x[0]),))
    with pytest.raises(InputError, match=r'cannot go on at 0 s.*\(a = -1\)'):
        integrate(root, [-1], (0, 5))


def test_max_step_bounds_the_distance_of_nodes_and_sees_a_short_push() -> None:
    pushed = stage_of('a', lambda x, u, t: (cas.exp(-(((t - 70) / 0.05) ** 2)),))
    flown = integrate(pushed, [0], (0, 100), max_step=0.1)
    assert np.diff(flown.time).max() < 0.1
    assert flown.final_state[0] == pytest.approx(0.05 * math.sqrt(math.pi), rel=1e-7)


# ---------------------------------------------------------------------- trajectory


def test_a_flight_becomes_a_trajectory_with_outputs() -> None:
    u = {'thrust_left': 0.9, 'thrust_right': 0.2}
    flown = integrate(
        QUADCOPTER, {'u_b': 3}, (2, 3), controls=u, t_eval=np.linspace(2, 3, 11)
    ).to_trajectory(vehicle='quadcopter', model='DynamicsRigidBody2DBody')
    assert len(flown) == 11 and flown.vehicle == 'quadcopter'
    np.testing.assert_array_equal(flown['thrust_left'], 0.9)
    np.testing.assert_allclose(flown['speed'], np.hypot(flown['u_b'], flown['w_b']), rtol=1e-12)


# ---------------------------------------------------------------------- the Dynamics family


def _push(dyn: Dynamics) -> None:
    dyn.add_gravity_force()
    dyn.add_force(2.0, -3.0, -15.0, axes='body')
    dyn.add_force(Fx=-0.01 * dyn.airspeed**2, axes='wind')


@pytest.mark.parametrize('cls', FAMILY.values())
def test_every_class_drives_scipy_by_its_methods_and_by_the_stage(cls: type[Dynamics]) -> None:
    mass_props = MassProperties(mass=2.0, Ixx=0.3, Iyy=0.5, Izz=0.7)
    model = Model(
        vehicle='any',
        dynamics=cls,
        mass_props=mass_props,
        controls={},
        attach=lambda dyn, u: _push(dyn),
    )
    template = cls(mass_props=mass_props)
    start = {'u_e': 20.0, 'w_e': 1.0, 'speed': 20.0, 'gamma': 0.1, 'u_b': 20.0, 'qw': 1.0}
    y0 = np.array([start.get(name, 0.0) for name in cls.states])

    def by_methods(t: float, y: Array) -> Array:
        dyn = template.get_new_instance_with_state(template.pack_state(y))
        _push(dyn)
        derivatives: Array = dyn.unpack_state(dyn.state_derivatives())
        return derivatives

    t = np.linspace(0, 1, 5)
    stage = model.stage()
    flights = [
        solve_ivp(f, (0, 1), y0, 'DOP853', t, rtol=1e-10, atol=1e-10).y
        for f in (by_methods, stage.right_hand_side())
    ]
    assert np.ptp(flights[0], axis=1).max() > 0.1
    # one arithmetic in another order: rounding, grown in a second
    np.testing.assert_allclose(flights[0], flights[1], rtol=1e-11, atol=1e-11)
    flown = integrate(stage, y0, (0, 1), t_eval=t)
    np.testing.assert_allclose(flown.states, flights[1], rtol=1e-7, atol=1e-7)
