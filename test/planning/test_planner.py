"""Plans: the optimum, verification, every way to fail, cancelling."""

import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from flightdyn.errors import InputError, ResultCode
from flightdyn.planning.plan_file import plan_document, read_plan
from flightdyn.planning.planner import REMEDIES, Planner
from flightdyn.planning.problem_file import load_problem
from flightdyn.planning.samples import Path as Way
from flightdyn.planning.verify import compare, refly
from flightdyn.resources import list_configs
from flightdyn.simulation.simulator import Simulator, fly
from flightdyn.trajectory import Trajectory
from flightdyn.vehicles.vehicle import load_vehicle

# minimum time by switch-time optimization with DOP853, 149 starts, terminal error 9e-9
FLIP_OPTIMUM = 0.8240737


@pytest.fixture(scope='module')
def planner() -> Planner:
    return Planner()


@pytest.fixture(scope='module')
def flip(planner: Planner):  # type: ignore[no-untyped-def]
    return planner.plan(load_problem('quadcopter_flip'))


def test_flip_is_solved_verified_and_near_the_optimum(flip) -> None:  # type: ignore[no-untyped-def]
    report = flip.report
    assert (report.code, report.converged, report.verified) == (ResultCode.SUCCESS, True, True)
    # within what flying it again is off by
    assert report.final_time == pytest.approx(FLIP_OPTIMUM, abs=1e-6)
    assert max(report.verification[name] for name in ('x_e', 'z_e')) < 2e-5  # m
    assert max(report.verification.values()) < 2e-4
    assert report.constraint_violation < 1e-7


def test_flip_is_bang_bang_in_seven_arcs(flip) -> None:  # type: ignore[no-untyped-def]
    """The switches of the reference, found by switch-time optimization."""
    arcs = flip.report.arcs
    switches = [arc['start'] for arc in arcs[1:]]
    expected = [0.03514, 0.21773, 0.36056, 0.46351, 0.60634, 0.78893]
    assert switches == pytest.approx(expected, abs=3e-5)
    assert arcs[-1]['end'] == pytest.approx(flip.report.final_time)
    assert arcs[0]['limits'] == {'thrust_left': 'upper', 'thrust_right': 'lower'}
    assert arcs[1]['limits'] == {'thrust_left': 'upper', 'thrust_right': 'upper'}


def test_flip_on_the_textbooks_mesh_is_the_textbooks(planner: Planner) -> None:
    """Trapezoidal collocation on 80 nodes gives 0.82577 s, and is no plan that can be flown."""
    settings = ['transcription=trapezoidal', 'control_interpolation=linear', 'nodes=79']
    report = planner.plan(load_problem('quadcopter_flip', [*settings, 'refine=false'])).report
    assert report.final_time == pytest.approx(0.82577, abs=1e-5)
    assert (report.code, report.converged) == (ResultCode.NOT_VERIFIED, True)
    # m: the end is missed by 3.6 mm in x, 5 mm in z
    assert report.verification['z_e'] == pytest.approx(0.005, abs=0.001)


def test_flip_keeps_its_conditions(flip) -> None:  # type: ignore[no-untyped-def]
    first = {name: values[0] for name, values in flip.trajectory.states.items()}
    last = {name: values[-1] for name, values in flip.trajectory.states.items()}
    assert first == pytest.approx(dict.fromkeys(first, 0.0), abs=1e-7)
    assert last == pytest.approx({**first, 'x_e': 1.0, 'theta': -2 * np.pi}, abs=1e-6)
    for thrust in flip.trajectory.controls.values():
        assert thrust.min() > -1e-7
        assert thrust.max() < 1 + 1e-7


def test_flip_flown_by_the_simulator_stays_on_the_plan(flip) -> None:  # type: ignore[no-untyped-def]
    plan = flip.trajectory
    initial = {name: values[0] for name, values in plan.states.items()}
    flown = fly(
        Simulator(load_vehicle('quadcopter').model(), initial, plan),
        plan.duration,
        100,
        also_at=plan.time,
    )
    for name in ('x_e', 'z_e'):
        assert np.abs(flown.sample(name, plan.time) - plan[name]).max() < 1e-3, name


def test_finer_meshes_come_closer_to_the_optimum(planner: Planner) -> None:
    times = [
        planner.plan(
            load_problem(
                'quadcopter_flip',
                [f'nodes={n}', 'sharpen=false', 'transcription=multiple_shooting'],
            )
        ).report.final_time
        for n in (20, 40, 80)
    ]
    assert times[0] > times[1] > times[2] > FLIP_OPTIMUM


def test_backflip_is_slower(planner: Planner) -> None:
    backflip = planner.plan(
        load_problem('quadcopter_flip', ['final.theta=360 deg', 'guess.theta=[0, 360 deg]'])
    )
    # 1.00154 s: AeroSandbox 4.2.10, trapezoidal, 80 nodes; with its switches free less
    assert backflip.report.final_time == pytest.approx(1.00082, abs=1e-4)


def test_linear_controls_are_verified_too(planner: Planner) -> None:
    report = planner.plan(load_problem('quadcopter_flip', ['control_interpolation=linear'])).report
    assert report.verified
    assert report.final_time == pytest.approx(FLIP_OPTIMUM, abs=2e-3)


# kg: all of it burnt at once, at the start, by the rocket equation from the speed that it takes
ROCKET_INFIMUM = 198_686.24


def test_rocket_comes_down_to_the_least_fuel_and_never_below(planner: Planner) -> None:
    """Thrust has no limit: what is lost to burning through one interval goes with its length."""

    def over(nodes: int, *settings: str) -> float:
        problem = load_problem('rocket_climb', [f'nodes={nodes}', *settings])
        report = planner.plan(problem).report
        assert report.verified, report.message
        return report.objective / ROCKET_INFIMUM - 1

    shooting = [over(nodes) for nodes in (25, 50, 100)]
    assert 0 < shooting[2] < 0.006
    assert shooting[:2] == pytest.approx([2 * shooting[1], 2 * shooting[2]], rel=0.05)
    # collocation finds out that its first steps are too long, and cuts them short
    refined = [over(nodes, 'control_interpolation=linear') for nodes in (25, 50, 100)]
    assert 0 < min(refined) < max(refined) < 1e-3


def test_turning_back_is_solved_verified_and_near_the_optimum(planner: Planner) -> None:
    plan = planner.plan(load_problem('cessna152_turnback'))
    report = plan.report
    assert report.verified, report.message
    # m, s: Legendre-Gauss-Radau collocation with AeroBuildup itself, 60 to 150 intervals agree.
    # The table of aerodynamics and the mesh are within some mm.
    assert report.objective == pytest.approx(45.641, abs=0.01)
    assert report.final_time == pytest.approx(16.58, abs=0.05)
    flown = plan.trajectory
    # kept at nodes and points; what happens between is told
    assert flown['speed'].min() > 23 - 0.02
    assert [said.split()[0] for said in report.warnings] == ['speed']
    assert np.abs(flown['bank']).max() < np.radians(60) + 1e-6
    assert flown['alpha'].max() < 12 + 1e-6


def test_glide_is_solved_verified_and_near_the_optimum(planner: Planner) -> None:
    plan = planner.plan(load_problem('cessna152_glide'))
    assert plan.report.verified, plan.report.message
    # m, s: as above. Between the nodes the plan may skim a little below the ground.
    assert plan.report.objective == pytest.approx(20_921, abs=1)
    assert plan.report.final_time == pytest.approx(587.9, abs=2)
    assert plan.trajectory['altitude'].min() > -1e-3


def test_a_tampered_plan_fails_verification(flip) -> None:  # type: ignore[no-untyped-def]
    stage = load_vehicle('quadcopter').model().stage()
    plan = flip.trajectory
    states = np.array([plan.states[name] for name in stage.states])
    controls = np.array([plan.controls[name][:-1] for name in stage.controls])
    every = np.arange(len(plan))

    def worst(factor: float) -> float:
        held = controls * factor
        way = Way(plan.time, held, held, np.zeros(3), every, states, every[:-1])
        return compare(stage.states, way, refly(stage, states[:, 0], way, 1e-4), {}).worst

    assert worst(1.0) < 1e-4 < 1e-2 < worst(1.01)


def test_too_coarse_a_mesh_is_not_called_a_success(planner: Planner) -> None:
    settings = ['nodes=20', 'tolerance=1e-12', 'sharpen=false']
    report = planner.plan(load_problem('quadcopter_flip', settings)).report
    assert (report.code, report.converged) == (ResultCode.NOT_VERIFIED, True)
    assert 'raise nodes' in report.message


def test_substeps_are_doubled_until_verified(planner: Planner) -> None:
    settings = ['nodes=20', 'tolerance=1e-5', 'sharpen=false']
    report = planner.plan(load_problem('quadcopter_flip', settings)).report
    assert report.verified
    assert 'RK4 x1,' not in report.transcription


def test_impossible_request_says_what_is_violated(planner: Planner) -> None:
    plan = planner.plan(
        load_problem('quadcopter_flip', ['duration.upper=0.5', 'duration.guess=0.4'])
    )
    assert plan.report.code == ResultCode.INFEASIBLE
    assert 'no flight was found that keeps all conditions' in plan.report.message
    assert plan.report.remedies == list(REMEDIES)
    quantities = {each['quantity'] for each in plan.report.missed}
    assert quantities and quantities <= {*plan.trajectory.states, 'duration'}
    assert not plan.report.verified
    assert len(plan.trajectory) > 80


def test_a_singular_start_is_refused(tmp_path: Path) -> None:
    (tmp_path / 'vehicles').mkdir()
    (tmp_path / 'vehicles' / 'kite.yaml').write_text(
        'model: DynamicsPointMass3DSpeedGammaTrack\nmass: 1\n'
        'rotors: {pull: {position: [0, 0, 0], direction: [1, 0, 0], thrust: [0, 5]}}\n'
    )
    (tmp_path / 'problem.yaml').write_text(
        'vehicle: kite\nduration: {lower: 0.1, upper: 9, guess: 1}\nfinal: {x_e: 5}\n'
        'initial: {x_e: 0, speed: 0}\nnodes: 5\n'
    )
    with pytest.raises(InputError, match=r'initial\.speed: .*GammaTrack is singular at speed = 0'):
        load_problem(str(tmp_path / 'problem.yaml'), (), tmp_path)
    kite = load_vehicle('kite', tmp_path).model()
    held = Trajectory(time=np.zeros(1), states={}, controls={'pull': np.ones(1)})
    with pytest.raises(InputError, match='kite cannot start at speed = 0'):
        Simulator(kite, {'x_e': 1.0}, held)


def test_cancel_ends_at_the_next_iteration(planner: Planner) -> None:
    stop = threading.Event()
    seen = []

    def on_iteration(iteration) -> None:  # type: ignore[no-untyped-def]
        seen.append(iteration.number)
        if iteration.number == 5:
            stop.set()

    report = planner.plan(
        load_problem('quadcopter_flip'), on_iteration=on_iteration, should_stop=stop.is_set
    ).report
    assert report.code == ResultCode.CANCELLED
    assert seen == [0, 1, 2, 3, 4, 5]


def test_progress_ends_feasible(planner: Planner) -> None:
    seen = []
    planner.plan(load_problem('quadcopter_flip'), on_iteration=seen.append)
    assert seen[0].primal_infeasibility > 1e-2
    assert seen[-1].primal_infeasibility < 1e-7
    assert seen[-1].dual_infeasibility < 1e-6


def test_time_limit_is_honoured(planner: Planner) -> None:
    report = planner.plan(load_problem('quadcopter_flip', ['max_wall_time=1e-6'])).report
    assert report.code == ResultCode.TIME_LIMIT
    assert 'max_wall_time' in report.message


def test_error_in_the_callers_callback_is_raised(planner: Planner) -> None:
    def fail(iteration) -> None:  # type: ignore[no-untyped-def]
        raise KeyError('mine')

    with pytest.raises(KeyError, match='mine'):
        planner.plan(load_problem('quadcopter_flip'), on_iteration=fail)


def test_same_request_gives_the_same_plan(planner: Planner, flip) -> None:  # type: ignore[no-untyped-def]
    again = planner.plan(load_problem('quadcopter_flip'))
    assert again.report.build_s < flip.report.build_s or flip.report.build_s < 1e-3
    for name, values in flip.trajectory.states.items():
        np.testing.assert_array_equal(values, again.trajectory[name])


def test_a_solution_as_guess_needs_few_iterations(planner: Planner, flip) -> None:  # type: ignore[no-untyped-def]
    problem = load_problem('quadcopter_flip').with_changes(guess_trajectory=flip.trajectory)
    plan = planner.plan(problem)
    assert plan.report.final_time == pytest.approx(flip.report.final_time, abs=1e-6)


def test_many_threads_get_the_answers_of_one_by_one(planner: Planner) -> None:
    """To the last bit: nothing that a solve computes with is shared while it runs."""
    problems = [
        load_problem('quadcopter_flip', ['nodes=20']).with_changes(final={'x_e': (x, x)})
        for x in np.linspace(0.8, 1.2, 12)
    ]
    turns = [
        load_problem('cessna152_turnback', ['nodes=20']).with_changes(wind_ned=(w, 0.0, 0.0))
        for w in np.linspace(-3, 3, 8)
    ]
    every = [each for pair in zip(problems[:8], turns, strict=True) for each in pair]
    every += problems[8:] + problems[:2]
    alone = [Planner().plan(problem) for problem in every[:4]] + [
        planner.plan(problem) for problem in every[4:]
    ]
    with ThreadPoolExecutor(6) as pool:
        together = list(pool.map(planner.plan, every))
    for one, other in zip(alone, together, strict=True):
        assert one.report.objective == other.report.objective
        assert one.report.verification == other.report.verification
        for name, values in one.trajectory.columns.items():
            np.testing.assert_array_equal(values, other.trajectory[name])


def test_near_a_plan_a_few_iterations_do(planner: Planner) -> None:
    """What planning again in flight takes, against the same from scratch."""
    for name, change, most in (
        ('quadcopter_flip', {'final': {'x_e': (1.05, 1.05)}}, 8),
        ('cessna152_turnback', {'initial': {'airspeed': (34.0, 34.0)}}, 12),
        ('rocket_climb', {'final': {'altitude': (101e3, 101e3)}}, 9),
    ):
        problem = load_problem(name)
        plan = planner.plan(problem)
        changed = problem.with_changes(**change)  # type: ignore[arg-type]
        warm, cold = planner.plan(changed, near=plan), planner.plan(changed)
        assert warm.report.verified
        assert warm.report.iterations <= most < cold.report.iterations
        assert warm.report.objective == pytest.approx(cold.report.objective, rel=1e-4)
        assert plan.report.objective != pytest.approx(cold.report.objective, rel=1e-4)


def test_near_another_kind_of_plan_is_from_scratch(planner: Planner, flip) -> None:  # type: ignore[no-untyped-def]
    problem = load_problem('rocket_climb')
    assert planner.plan(problem, near=flip).report.verified


@pytest.mark.parametrize(
    ('setting', 'message'),
    [
        ('final.x=1', "final: unknown 'x'"),
        ('final.x_e=[2, 1]', 'lower bound 2 is above'),
        ('final.x_e=.nan', 'must be finite'),
        ('path.thrust_left=[2, 3]', r'outside what quadcopter can do'),
        ('path.x_e=[5, 6]', r'lies outside the path bounds \[5, 6\]'),
        ('nodes=0', 'whole number from 1'),
        ('nodes=1e9', 'whole number from 1'),
        ('nodes=2.5', 'whole number'),
        ('objective=fuel', "unknown objective 'fuel'"),
        ('duration.lower=-1', 'must be positive'),
        ('wind_ned=[1, 2]', 'three finite numbers'),
        ('tolerance=0', 'tolerance'),
        ('guess.theta=[.inf]', 'must be finite'),
        ('vehicle=quadcoptr', "no vehicle 'quadcoptr'"),
        ('nods=3', "did you mean 'nodes'"),
        ('control_interpolation=cubic', 'previous or linear or polynomial'),
        ('final', 'expected KEY=VALUE'),
        ('final.x_e.deep=1', 'is a value, and has no deep'),
        ('final=[1]', 'expected names and values'),
    ],
)
def test_bad_settings_are_refused(setting: str, message: str, planner: Planner) -> None:
    with pytest.raises(InputError, match=message):
        planner.plan(load_problem('quadcopter_flip', [setting]))


def test_plan_file_round_trip(flip, tmp_path) -> None:  # type: ignore[no-untyped-def]
    import json

    path = tmp_path / 'plan.json'
    path.write_text(json.dumps(plan_document(flip)))
    trajectory, document = read_plan(path)
    assert document['verified'] is True
    for name, values in flip.trajectory.columns.items():
        np.testing.assert_array_equal(trajectory[name], values)


@pytest.mark.parametrize('text', ['', '{}', '[1]', '{"time": 3}'])
def test_what_is_no_plan_file_is_refused(text: str, tmp_path) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / 'plan.json'
    path.write_text(text)
    with pytest.raises(InputError, match=r'plan\.json'):
        read_plan(path)


def test_every_shipped_problem_loads() -> None:
    names = list(list_configs('problems'))
    assert 'quadcopter_flip' in names
    assert [load_problem(name).name for name in names] == names


def test_iterations_can_be_made_flights_of():
    problem = load_problem('quadcopter_flip')
    seen = []
    plan = Planner().plan(problem, on_iteration=seen.append)
    first, last = (seen[i].trajectory() for i in (0, -1))
    assert len(first) >= 100
    assert first.problem == 'quadcopter_flip'
    # what the guess says of the end, and what the solution does
    assert last['x_e'][-1] == pytest.approx(1.0, abs=1e-6)
    assert last.duration == pytest.approx(plan.report.final_time, rel=1e-3)
    assert abs(first.duration - last.duration) > 1e-3
