"""Problems in winds that vary: what is planned is what is flown; ends that are tied together."""

import json
from pathlib import Path

import numpy as np
import pytest

from flightdyn.cli import main
from flightdyn.environment.wind import ShearWind
from flightdyn.errors import InputError, ResultCode
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem_file import load_problem

GLIDE = 'cessna152_glide'
SHEAR = 'wind={kind: power_law, speed: 8, from: 30 deg}'
PLANE = ['vehicle=dynamic_soarer', 'model=DynamicsPointMass2DSpeedGamma']
SHORT = [*PLANE, 'initial.altitude=300', 'duration.guess=200', 'guess.x_e=[0, 6000]', 'nodes=30']

IN_3D = [
    'vehicle=dynamic_soarer',
    'initial={x_e: 0, y_e: 0, altitude: 60, airspeed: 20, gamma: 0, track: 0}',
    'final={x_e: [null, 700]}',
    'duration={lower: 10, upper: 200, guess: 40}',
    'path={altitude: [5, null], gamma: [-30 deg, 30 deg], track: [-60 deg, 60 deg], '
    'airspeed: [10, null]}',
    'guess={x_e: [0, 600], altitude: [60, 5], speed: 20, alpha: 8}',
    'nodes=25',
    'spacing=uniform',
    SHEAR,
    'wind_ned=[0, 1, 0]',
]


def test_a_plan_is_flown_in_the_wind_it_was_planned_in(tmp_path: Path) -> None:
    """In three dimensions, though the vehicle itself is of two: the plan says both."""
    path = tmp_path / 'plan.json'
    arguments = [part for each in IN_3D for part in ('--set', each)]
    assert main(['plan', GLIDE, *arguments, '-o', str(path)]) == 0
    document = json.loads(path.read_text())
    (wind,) = document['wind']
    assert wind['kind'] == 'power_law' and wind['speed'] == 8.0
    # through the air it starts at 20 m/s against the wind at 60 m, from 30 deg, and a side wind
    towards = np.radians(30) + np.pi
    fast = 8 * (60 / 10) ** (1 / 7)
    north, east = fast * np.cos(towards), fast * np.sin(towards) + 1
    speed = document['states']['speed'][0]
    assert np.hypot(speed - north, east) == pytest.approx(20, abs=1e-3)
    assert speed < 20 - 8

    flown = tmp_path / 'flown.json'
    assert main(['sim', str(path), '-o', str(flown)]) == 0
    errors = json.loads(flown.read_text())['deviation_from_plan']
    # what the plan's tolerance allows of its range of 700 m, and fewer of the others
    assert max(errors['x_e'], errors['y_e'], errors['z_e']) < 0.2


def test_the_strength_of_a_wind_is_a_state_that_stays() -> None:
    problem = load_problem(GLIDE, [*IN_3D, 'wind_strength=[0, 2]', 'initial.wind_strength=0.5'])
    assert problem.model.states == (
        *('x_e', 'y_e', 'z_e', 'speed', 'gamma', 'track'),
        'wind_strength',
    )
    planner = Planner()
    plan = planner.plan(problem)
    assert plan.report.verified, plan.report.message
    assert plan.trajectory['wind_strength'] == pytest.approx(0.5, abs=1e-9)
    same = load_problem(GLIDE, [*IN_3D, SHEAR.replace('speed: 8', 'speed: 4')])
    other = planner.plan(same)
    assert other.report.objective == pytest.approx(plan.report.objective, rel=1e-4)


def test_a_change_ties_the_end_to_the_beginning() -> None:
    settings = [*SHORT, 'initial={x_e: 0, altitude: 300}']
    problem = load_problem(
        GLIDE,
        [*settings, 'change={altitude: [-100, null], speed: 0, gamma: [0, 1 deg], alpha: 0}'],
    )
    assert problem.change['z_e'] == (-np.inf, 100.0)
    plan = Planner().plan(problem)
    assert plan.report.verified, plan.report.message
    flight = plan.trajectory
    assert np.ptp(flight['speed'][[0, -1]]) == pytest.approx(0, abs=1e-4)
    assert np.ptp(flight['alpha'][[0, -1]]) == pytest.approx(0, abs=1e-4)
    assert flight['z_e'][-1] - flight['z_e'][0] == pytest.approx(100, abs=1e-3)
    assert -1e-6 <= flight['gamma'][-1] - flight['gamma'][0] <= np.radians(1) + 1e-6


def test_a_change_that_cannot_be_is_told() -> None:
    """A zoom may end higher than it began; a glide of four minutes does not."""
    duration = 'duration={lower: 240, upper: 300, guess: 250}'
    settings = [*SHORT, 'change={altitude: [10, null]}', duration, 'nodes=15', 'spacing=uniform']
    report = Planner().plan(load_problem(GLIDE, settings)).report
    assert report.code == ResultCode.INFEASIBLE
    assert any(each['quantity'] == 'change of z_e' for each in report.missed), report.missed


@pytest.mark.parametrize(
    ('setting', 'message'),
    [
        ('wind={kind: shear}', "wind: 'gradient' is missing"),
        ('wind_strength=[0, 2]', 'wind_strength: there is no wind to multiply'),
        ('change={sped: 0}', "change: unknown 'sped', did you mean 'speed'"),
        ('change={load_factor: 0}', "change: unknown 'load_factor'"),
        ('change=[speed]', 'change: expected names and values'),
        ('change={altitude: 0, z_e: 0}', 'change: give altitude or z_e'),
        ('change={speed: [1, 0]}', 'change.speed: lower bound 1 is above'),
    ],
)
def test_wrong_winds_and_changes_are_refused(setting: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        load_problem(GLIDE, [setting])


def test_a_wind_that_a_plan_could_not_carry_is_refused() -> None:
    problem = load_problem(GLIDE)
    with pytest.raises(InputError, match='is no wind that a file can hold'):
        problem.with_changes(wind=lambda x, y, z, t: (0.0, 0.0, 0.0))
    with pytest.raises(InputError, match=r'wind_strength: \[2, 1\] is not a range'):
        problem.with_changes(wind=ShearWind(0.1, 0.0), wind_strength=(2.0, 1.0))
