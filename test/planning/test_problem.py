"""Problems: what they accept, what they refuse, and what they make of it."""

from dataclasses import replace

import numpy as np
import pytest

from flightdyn.errors import InputError, ResultCode
from flightdyn.planning.guess import Guess
from flightdyn.planning.objective import TIME, maximize
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem_file import load_problem

FLIP = 'quadcopter_flip'


def test_altitude_is_minus_z_e_wherever_a_state_is() -> None:
    problem = load_problem(
        FLIP,
        [
            'initial={altitude: 2}',
            'final={altitude: [1, 3]}',
            'path={altitude: [0, null]}',
            'guess={altitude: [2, 1]}',
        ],
    )
    assert problem.initial == {'z_e': (-2, -2)}
    assert problem.final == {'z_e': (-3, -1)}
    assert problem.path == {'z_e': (-np.inf, 0)}
    assert problem.guess == {'z_e': (-2, -1)}
    changed = problem.with_changes(final={'altitude': (5.0, 6.0)})
    assert changed.final == {'z_e': (-6, -5)}


@pytest.mark.parametrize('group', ['initial', 'final', 'path', 'guess'])
def test_altitude_and_z_e_together_are_refused(group: str) -> None:
    with pytest.raises(InputError, match=f'{group}: give altitude or z_e'):
        load_problem(FLIP, [f'{group}={{altitude: 1, z_e: -1}}'])


def test_duration_may_be_fixed() -> None:
    problem = load_problem(FLIP, ['duration=1.5'])
    assert (problem.duration, problem.duration_guess) == ((1.5, 1.5), 1.5)
    report = Planner().plan(problem).report
    assert report.code == ResultCode.SUCCESS, report.message
    assert report.final_time == report.objective == 1.5
    other = problem.with_changes(duration=(2.0, 2.0))
    assert Guess(other).durations == 2


def test_objectives_of_files_and_of_python_are_the_same() -> None:
    problem = load_problem(FLIP)
    assert problem.objective == TIME
    far = load_problem(FLIP, ['objective={maximize: final.x_e}'])
    assert far.objective == problem.with_changes(objective=maximize('final.x_e')).objective


def test_an_end_that_is_free_is_guessed_like_the_other() -> None:
    problem = load_problem(FLIP, ['initial={x_e: 3, u_b: [1, 2]}', 'final={z_e: 4}', 'guess={}'])
    columns = Guess(problem).columns(('x_e', 'u_b', 'z_e', 'theta'), 0, np.array([0.0, 1.0]))
    np.testing.assert_array_equal(columns, [[3, 3], [1.5, 1.5], [4, 4], [0, 0]])


def test_states_that_no_storyboard_names_follow_from_those_it_does() -> None:
    """The flip's solver once started from a turn without a rate: it took twice as long."""
    flip = load_problem(FLIP)  # names x_e, 0 to 1 m, and theta, one turn, in 1 s
    at = np.linspace(0, 1, 11)
    theta, u, w, q, z_e = Guess(flip).columns(('theta', 'u_b', 'w_b', 'q', 'z_e'), 0, at)
    np.testing.assert_allclose(theta, -2 * np.pi * at)
    np.testing.assert_allclose(q, -2 * np.pi)
    # along x_e, in body axes
    np.testing.assert_allclose(np.cos(theta) * u + np.sin(theta) * w, 1.0, atol=1e-9)
    np.testing.assert_array_equal(z_e, 0.0)
    named = load_problem(FLIP, ['guess.q=[-3, -1]'])
    np.testing.assert_allclose(Guess(named).columns(('q',), 0, at)[0], -3 + 2 * at)


def test_what_follows_stays_within_limits() -> None:
    glide = load_problem('cessna152_glide', ['guess={x_e: [0, 3000], altitude: [1000, 0]}'])
    speed, gamma = Guess(glide).columns(('speed', 'gamma'), 0, np.array([0.5]))[:, 0]
    # 5.3 m/s in 600 s would be too slow to fly: as slow as its aerodynamics are known
    assert speed == glide.limits('speed')[0]
    assert gamma == pytest.approx(-np.arcsin(1000 / 600 / speed), abs=0.05)


def test_alpha_is_in_degrees_as_everywhere() -> None:
    glide = load_problem('cessna152_glide', ['path.alpha=[-2 deg, 12]', 'guess.alpha=[3 deg, 4]'])
    assert glide.path['alpha'] == (-2, 12)
    assert glide.guess['alpha'] == (3, 4)
    assert glide.path['gamma'] == pytest.approx((-1.396263, 1.396263))


def test_what_the_vehicle_stands_is_bounded_too() -> None:
    glide = load_problem('cessna152_glide', ['path.airspeed=[30, 200]'])
    # in still air the speed over the ground is that through the air
    assert glide.limits('speed')[0] == 30
    assert glide.limits('speed')[1] < 77  # never exceed, and where its aerodynamics are known
    assert glide.limits('alpha') == (-5, 15)
    assert glide.bounded()['load_factor'] == (-1.76, 4.4)
    with pytest.raises(InputError, match=r'path\.airspeed: .* outside what cessna152 can do'):
        load_problem('cessna152_glide', ['path.airspeed=[100, 200]'])


def test_in_wind_the_airspeed_is_bounded_itself() -> None:
    settings = ['path.airspeed=[30, 200]', 'path.speed=[10, 90]']
    calm = load_problem('cessna152_glide', settings)
    windy = calm.with_changes(wind_ned=(5.0, 0.0, 0.0))
    assert 'airspeed' not in calm.bounded()
    assert calm.limits('speed')[0] == windy.limits('airspeed')[0] == 30
    assert windy.limits('speed') == (10, 90)
    with pytest.raises(InputError, match='airspeed and speed contradict each other'):
        load_problem('cessna152_glide', ['path.airspeed=[30, 40]', 'path.speed=[50, 60]'])


def test_limits_that_nobody_named_are_set_aside_and_looked_at() -> None:
    problem = load_problem('cessna152_glide')
    lean = problem.without_limits()
    assert lean.aside == {'load_factor'}
    assert 'load_factor' not in lean.bounded()
    asked = load_problem('cessna152_glide', ['path.load_factor=[0.5, 2]'])
    assert asked.without_limits().aside == frozenset()
    planner = Planner()
    plan = planner.plan(problem)
    assert not lean.beyond_limits(plan.trajectory)
    loads = plan.trajectory['load_factor']
    tight = replace(problem.vehicle, limits={'load_factor': (0.0, float(loads.max()) - 0.05)})
    kept = planner.plan(replace(problem, vehicle=tight))
    assert kept.report.verified, kept.report.message
    assert kept.trajectory['load_factor'].max() < loads.max() - 0.04
    assert kept.report.objective < plan.report.objective


def test_the_box_of_the_aerodynamics_is_never_set_aside() -> None:
    """In wind the airspeed is an output like the load factor; outside its box nothing is known."""
    windy = load_problem('cessna152_glide', ['wind_ned=[-5, 0, 0]'])
    assert windy.without_limits().aside == {'load_factor'}
    assert Planner().plan(windy).report.verified


def test_a_second_solve_for_limits_has_the_first_ones_clock() -> None:
    """What fails is not tried again with more limits, and the time told is the one asked for."""
    report = Planner().plan(load_problem('cessna152_glide', ['max_wall_time=1e-6'])).report
    assert report.code == ResultCode.TIME_LIMIT
    assert 'max_wall_time = 1e-06 s' in report.message


def test_another_class_may_fly_the_vehicle() -> None:
    turning = load_problem('cessna152_glide', ['model=DynamicsPointMass3DSpeedGammaTrack'])
    assert 'track' in turning.stage.states
    with pytest.raises(InputError, match="unknown model 'DynamicsX'"):
        load_problem('cessna152_glide', ['model=DynamicsX'])


@pytest.mark.parametrize(
    ('setting', 'message'),
    [
        ('path.airspeeed=[0, 3]', r"path: unknown 'airspeeed', did you mean 'airspeed'"),
        ('initial.airspeeed=3', "initial: unknown 'airspeeed'"),
        ('final.load=3', "final: unknown 'load"),
        ('guess.airspeed=3', "guess: unknown 'airspeed'"),
        ('final.airspeed=[3, 2]', 'lower bound 3 is above'),
        ('final.thrust_left=[2, 3]', r'final\.thrust_left: .* outside what quadcopter can do'),
        ('objective={maximize: final.x}', "unknown 'x'; known: x_e"),
        ('objective={maximize: final.x_e +}', r'objective\.maximize: not a formula'),
        ('duration={lower: 1, upper: 2}', "duration: 'guess' is missing"),
        ('duration=long', 'duration: expected a number'),
        ('duration=-1', 'must be positive'),
        ('model=3', 'model: expected text'),
    ],
)
def test_bad_settings_are_refused(setting: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        load_problem(FLIP, [setting])


def test_an_output_bound_that_cannot_be_kept_is_named() -> None:
    """The flip takes 4 m/s: at 1 m/s in a second it cannot be flown."""
    report = Planner().plan(load_problem(FLIP, ['path.airspeed=[null, 0.5]', 'duration=1'])).report
    assert report.code == ResultCode.INFEASIBLE
    assert 'airspeed' in report.message
    assert 'airspeed' in {each['quantity'] for each in report.missed}
