"""Flights in phases, and controls that take time to change: optima known in closed form."""

from pathlib import Path

import numpy as np
import pytest

from flightdyn.errors import InputError, ResultCode
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem import Problem
from flightdyn.planning.problem_file import load_problem

# 1 kg on a line, pushed with up to 20 N either way
CART = """
model: DynamicsRigidBody2DBody
mass: 1
inertia: {Iyy: 1}
gravity: 0
rotors: {push: {position: [0, 0, 0], direction: [1, 0, 0], thrust: [-20, 20]}}
"""
OUT_AND_BACK = """
vehicle: cart
initial: {x_e: 0, z_e: 0, u_b: 0, w_b: 0, theta: 0, q: 0}
phases:
  out: {duration: {lower: 0.1, upper: 9, guess: 1}, nodes: 10, final: {x_e: 3, u_b: 0}}
  back: {duration: {lower: 0.1, upper: 9, guess: 1}, nodes: 6, final: {x_e: 1, u_b: 0}}
"""
OUT, BACK = 2 * np.sqrt(3 / 20), 2 * np.sqrt(2 / 20)  # s, from rest to rest: 2 sqrt(d / a)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / 'vehicles').mkdir()
    (tmp_path / 'vehicles' / 'cart.yaml').write_text(CART)
    (tmp_path / 'vehicles' / 'slow.yaml').write_text(CART + 'rates: {push: 40}\n')
    (tmp_path / 'line.yaml').write_text(OUT_AND_BACK)
    return tmp_path


def problem(folder: Path, *settings: str) -> Problem:
    return load_problem(str(folder / 'line.yaml'), settings, folder)


def test_each_phase_takes_its_least_time(folder: Path) -> None:
    plan = Planner().plan(problem(folder))
    assert plan.report.verified, plan.report.message
    assert plan.report.final_time == pytest.approx(OUT + BACK, rel=1e-6)
    there = int(np.argmin(np.abs(plan.trajectory.time - OUT)))
    assert plan.trajectory['x_e'][there] == pytest.approx(3, abs=1e-5)
    assert plan.trajectory['u_b'][there] == pytest.approx(0, abs=1e-5)
    assert 'in 2 phases' in plan.report.transcription
    assert [phase['name'] for phase in plan.report.phases] == ['out', 'back']
    edges = [plan.report.phases[0]['start'], *(phase['end'] for phase in plan.report.phases)]
    assert edges == pytest.approx([0, OUT, OUT + BACK], rel=1e-6)


@pytest.mark.parametrize('method', ['radau', 'trapezoidal', 'hermite_simpson'])
def test_controls_jump_where_a_phase_begins(folder: Path, method: str) -> None:
    """Linear controls could not hold full thrust on both sides of the turn otherwise."""
    plan = Planner().plan(
        problem(
            folder,
            'control_interpolation=linear',
            f'transcription={method}',
            'phases.out.path={push: -10}',
            'phases.out.final={u_b: [null, -2]}',
            'phases.back.path={push: 20}',
            'phases.back.final={u_b: 0}',
        )
    )
    assert plan.report.verified, plan.report.message
    # -10 N to 2 m/s backwards, 20 N to rest
    assert plan.report.final_time == pytest.approx(0.2 + 0.1, abs=1e-6)
    push = plan.trajectory['push']
    assert push[0] == pytest.approx(-10)
    assert push[-1] == pytest.approx(20)
    assert plan.report.warnings == []


def test_bounds_of_a_phase_hold_in_it_alone(folder: Path) -> None:
    """Over d at most at speed v with acceleration a: d / v + v / a."""
    plan = Planner().plan(
        problem(folder, 'phases.out.path={airspeed: [null, 2]}', 'phases.out.nodes=32')
    )
    assert plan.report.verified, plan.report.message
    limited = 3 / 2 + 2 / 20
    assert plan.report.final_time == pytest.approx(limited + BACK, rel=2e-3)
    after = plan.trajectory.time > limited + 0.01
    assert np.abs(plan.trajectory['u_b'][after]).max() > 2.5
    assert np.abs(plan.trajectory['u_b'][~after]).max() < 2 + 1e-4


def test_durations_of_phases_and_of_the_whole(folder: Path) -> None:
    planner = Planner()
    fixed = planner.plan(problem(folder, 'duration=3', 'objective={minimize: out.duration}'))
    assert fixed.report.verified, fixed.report.message
    assert fixed.report.objective == pytest.approx(OUT, rel=1e-6)
    assert fixed.report.final_time == pytest.approx(3, abs=1e-9)


def test_a_guess_may_be_given_by_phase_or_for_the_whole(folder: Path) -> None:
    planner = Planner()
    for guess in ('phases.back.guess={x_e: [3, 2, 1]}', 'guess={x_e: [0, 3, 1]}'):
        plan = planner.plan(problem(folder, guess))
        assert plan.report.final_time == pytest.approx(OUT + BACK, rel=1e-6)


def test_a_rate_limited_push_takes_the_time_of_limited_jerk(folder: Path) -> None:
    """From rest to rest by jerk j, without reaching the largest acceleration: (32 d / j)^(1/3)."""
    settings = [
        *('vehicle=slow', 'phases={}', 'duration={lower: 0.1, upper: 9, guess: 1}', 'nodes=16'),
        *('control_interpolation=linear', 'final={x_e: 3, u_b: 0, push: 0}'),
        'initial={x_e: 0, z_e: 0, u_b: 0, w_b: 0, theta: 0, q: 0, push: 0}',
    ]
    for method in ('multiple_shooting', 'radau', 'trapezoidal'):
        plan = Planner().plan(
            problem(folder, *settings, f'transcription={method}', 'tolerance=1e-3')
        )
        assert plan.report.verified, plan.report.message
        jerk = np.diff(plan.trajectory['push']) / np.diff(plan.trajectory.time)
        assert np.abs(jerk).max() == pytest.approx(40, rel=1e-4)
        assert plan.report.final_time == pytest.approx((32 * 3 / 40) ** (1 / 3), rel=2e-3)


@pytest.mark.parametrize(
    ('setting', 'message'),
    [
        ('phases.out.duration=-1', 'must be positive'),
        ('phases.out.nods=3', "phases.out: unknown 'nods', did you mean 'nodes'"),
        ('phases.out.final={x: 3}', r"phases\.out\.final: unknown 'x'"),
        ('phases={1st: {duration: 3}}', "'1st': each needs a name"),
        ('phases=[1]', 'expected names and conditions of phases'),
        ('phases={out: {}}', "phases.out: 'duration' is missing"),
        ('nodes=3', 'give each phase its own'),
        ('phases.out.path={push: 30}', r'phases\.out\.path\.push: .* outside what cart can do'),
        ('objective={minimize: home.duration}', "unknown 'home.duration'"),
        ('spacing={0.5: 1}', 'ends of stretches must ascend to 1'),
        ('spacing=even', 'must be uniform, cosine or'),
        ('transcription=euler', 'transcription: must be auto or'),
        ('multistart=0', 'multistart: must be a whole number from 1'),
        ('sharpen=maybe', 'sharpen: must be true or false'),
    ],
)
def test_bad_settings_are_refused(folder: Path, setting: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        problem(folder, setting)


def test_what_phases_cannot_meet_is_named(folder: Path) -> None:
    report = Planner().plan(problem(folder, 'phases.back.duration=0.3')).report
    assert report.code == ResultCode.INFEASIBLE
    assert report.missed
