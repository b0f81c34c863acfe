"""Plans keep clear of what stands around, fly through gates, and tell what conflicts."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from flightdyn.environment.surroundings import Surroundings
from flightdyn.environment.terrain_spline import spline_through
from flightdyn.errors import InputError, ResultCode
from flightdyn.planning.plan_file import plan_document, read_plan
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem import Problem
from flightdyn.planning.problem_file import load_problem

MAST = {'centre': [400.0, 5.0], 'radius': 60.0}
PLANE = """
description: Model plane
model: DynamicsPointMass3DSpeedGammaTrack
mass: 2.0
controls: {alpha: [-5 deg, 12 deg], bank: [-60 deg, 60 deg]}
aerodynamics: {kind: polar, area: 0.5, span: 2.0, CL0: 0.3, CL_alpha: 4.8, CD0: 0.03, k: 0.05}
propulsion:
  kind: propeller
  diameter: 0.33
  engine: {kind: electric, power: 400, rotation: 150}
"""
planner = Planner()


def problem(folder: Path, **more: Any) -> Problem:
    """Return the fastest flight of a model plane over 800 m, at 50 m at both ends."""
    (folder / 'vehicles').mkdir(exist_ok=True)
    (folder / 'vehicles' / 'plane.yaml').write_text(PLANE)
    document = {
        'vehicle': 'plane',
        'duration': {'lower': 10, 'upper': 120, 'guess': 40},
        'initial': {'x_e': 0, 'y_e': 0, 'altitude': 50, 'speed': 20, 'gamma': 0, 'track': 0},
        'final': {'x_e': 800, 'y_e': 0, 'altitude': 50},
        'path': {'altitude': [0, 100], 'gamma': ['-30 deg', '30 deg'], 'speed': [10, 40]},
        'guess': {'speed': 20, 'alpha': 3, 'throttle': 0.7, 'bank': 0},
        'nodes': 20,
        'control_interpolation': 'linear',
        'max_wall_time': 100,
        **more,
    }
    path = folder / 'crossing.yaml'
    path.write_text(yaml.safe_dump(document, sort_keys=False))
    return load_problem(str(path), [], folder)


def gate(
    x: float, y: float, altitude: float, heading: Any = 0, size: float = 4
) -> Mapping[str, Any]:
    return {'centre': [x, y, altitude], 'heading': heading, 'width': size, 'height': size}


def test_a_mast_is_flown_round_at_its_radius(tmp_path: Path) -> None:
    plan = planner.plan(problem(tmp_path, keep_out={'mast': MAST}))
    assert plan.report.verified, plan.report.message
    flight = plan.trajectory
    distance = np.hypot(flight['x_e'] - 400, flight['y_e'] - 5)
    # bounds hold at the points of the mesh; between them plans warn from 1e-4 of the range on
    assert distance.min() == pytest.approx(60, abs=0.1)
    assert flight['clearance_mast'].min() == pytest.approx(distance.min() - 60, abs=1e-6)


def test_a_low_wall_is_flown_over(tmp_path: Path) -> None:
    corners = [[350, -500], [350, 500], [450, 500], [450, -500]]
    plan = planner.plan(problem(tmp_path, keep_out={'wall': {'corners': corners, 'top': 70}}))
    assert plan.report.verified, plan.report.message
    flight = plan.trajectory
    over = (flight['x_e'] > 350) & (flight['x_e'] < 450)
    assert over.sum() > 10
    # within a fifth of the wall's 100 m of an edge its rounding is up to 1.05 m thick
    assert 69.9 < (-flight['z_e'][over]).min() < 71.1


def test_terrain_is_kept_clear_of_and_its_map_not_left(tmp_path: Path) -> None:
    x, y = np.linspace(-100, 900, 25), np.linspace(-100, 300, 19)
    height = 60 * np.exp(-(((x - 400) / 100) ** 2))[:, None] * np.ones(y.size)
    np.savez(tmp_path / 'ridge.npz', x=x, y=y, height=height)
    found = problem(tmp_path, terrain={'file': 'ridge.npz', 'clearance': 15})
    plan = planner.plan(found)
    assert plan.report.verified, plan.report.message
    flight, terrain = plan.trajectory, found.surroundings.terrain
    assert terrain is not None
    ground = spline_through(terrain).heights(flight['x_e'], flight['y_e'])
    np.testing.assert_allclose(flight['height_above_terrain'], -flight['z_e'] - ground, atol=1e-9)
    assert flight['height_above_terrain'].min() == pytest.approx(15, abs=0.1)


def test_gates_are_flown_through_in_their_order(tmp_path: Path) -> None:
    # on, back, and on again
    gates = {
        'far': gate(500, 150, 60, '60 deg'),
        'near': gate(200, 200, 50, '200 deg'),
        'again': gate(400, 0, 40),
    }
    story = {'track': [0, 0, 3, 6, 6.28], 'speed': 20, 'alpha': 3, 'throttle': 0.7, 'bank': 0}
    found = problem(tmp_path, gates=gates, guess=story)
    assert [phase.name for phase in found.phases] == ['to_far', 'to_near', 'to_again', 'to_end']
    plan = planner.plan(found)
    assert plan.report.verified, plan.report.message
    flight, before = plan.trajectory, 0.0
    for each in found.surroundings.gates:
        along, aside, above, through = (
            flight[f'{each.name}_{what}'] for what in ('along', 'aside', 'above', 'through')
        )
        there = (np.abs(along) < 1e-3) & (np.abs(aside) <= 2.001) & (np.abs(above) <= 2.001)
        times = flight.time[there & (flight.time > before) & (through > 0)]
        assert times.size, each.name
        before = float(times[0])
    assert before < plan.report.final_time


def test_without_conditions_at_the_end_the_flight_ends_in_the_last_gate(tmp_path: Path) -> None:
    found = problem(tmp_path, gates={'only': gate(800, 0, 50)}, final={})
    assert [phase.name for phase in found.phases] == ['to_only']
    plan, whole = planner.plan(found), planner.plan(problem(tmp_path))
    assert plan.report.verified
    # the gate lets 2 m go in height: some hundredths of a second
    assert plan.report.final_time == pytest.approx(whole.report.final_time, abs=0.1)


def test_surroundings_go_with_the_plan_into_its_file(tmp_path: Path) -> None:
    found = problem(tmp_path, keep_out={'mast': MAST}, marks={'home': {'place': [0, 0, 0]}})
    plan = planner.plan(found)
    assert plan.surroundings == found.surroundings
    (tmp_path / 'plan.json').write_text(json.dumps(plan_document(plan)))
    _, document = read_plan(tmp_path / 'plan.json')
    assert Surroundings.from_dict(document['surroundings']) == found.surroundings


def test_other_surroundings_are_another_model(tmp_path: Path) -> None:
    here, there = (
        problem(tmp_path, keep_out={'mast': {**MAST, 'radius': radius}}) for radius in (60.0, 45.0)
    )
    assert here.stage is not there.stage
    assert here.stage is problem(tmp_path, keep_out={'mast': MAST}).stage


@pytest.mark.parametrize(
    ('more', 'told'),
    [
        (
            {'keep_out': {'town': {'centre': [800, 0], 'radius': 30}}},
            "final: the flight ends 30 m inside keep_out 'town'",
        ),
        (
            {'terrain': {'x': [-50, 500], 'y': [-50, 50], 'height': [[0, 0], [0, 0]]}},
            r'final\.x_e: 800 m is off the map of the terrain, which goes from -50 to 500 m',
        ),
        (
            {
                'terrain': {'x': [-50, 950], 'y': [-50, 50], 'height': [[0, 0], [0, 0]]},
                'path': {'y_e': [-80, None]},
            },
            r'path\.y_e: -80 m is off the map',
        ),
        (
            {
                'terrain': {
                    'x': [-50, 950],
                    'y': [-50, 50],
                    'height': [[48, 48], [48, 48]],
                    'clearance': 5,
                }
            },
            r'begins 2 m above the terrain \(48 m there\), whose clearance is 5 m',
        ),
        (
            {'gates': {'high': gate(300, 0, 130)}},
            r'gates\.high: .* altitude in it is 128 to 132 m, path\.altitude allows 0 to 100 m',
        ),
        (
            {'keep_out': {'mast': MAST}, 'gates': {'g': gate(400, 5, 50)}},
            r"gates\.g: cannot be flown through: its centre lies 60 m inside keep_out 'mast'",
        ),
        (
            {
                'model': 'DynamicsPointMass2DSpeedGamma',
                'gates': {'g': gate(5, 0, 1)},
                'initial': {'x_e': 0},
                'final': {'x_e': 800},
                'guess': {'speed': 20},
            },
            'has no state y_e',
        ),
        (
            {'gates': {'g': gate(5, 0, 1)}, 'phases': {'a': {'duration': 3}}},
            'either phases or gates',
        ),
    ],
)
def test_what_cannot_be_is_refused_at_once(
    more: Mapping[str, Any], told: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=told):
        problem(tmp_path, **more)


def test_gates_that_are_too_far_for_the_time_are_told_by_how_much(tmp_path: Path) -> None:
    short = {'lower': 10, 'upper': 15, 'guess': 12}
    plan = planner.plan(problem(tmp_path, gates={'far': gate(700, 0, 50)}, duration=short))
    assert plan.report.code == ResultCode.INFEASIBLE and not plan.report.converged
    (missed,) = plan.report.missed
    assert missed['quantity'] == 'duration'
    # the fastest flight takes 25.3 s, whatever gate lies on the way
    assert missed['amount'] == pytest.approx(10.3, abs=0.1)
    assert 'duration is 25.' in plan.report.message


def test_other_guesses_of_a_flight_through_gates_are_no_arcs(tmp_path: Path) -> None:
    """They ended in a KeyError: a guess of its own made phases look like those of arcs."""
    plan = planner.plan(problem(tmp_path, gates={'mid': gate(400, 20, 50)}), multistart=2)
    assert plan.report.verified and not plan.report.arcs


def test_terrain_that_meets_the_ceiling_is_named_with_place_and_amount(tmp_path: Path) -> None:
    x, y = np.linspace(-100, 900, 25), np.linspace(-100, 300, 5)
    height = 130 * np.exp(-(((x - 400) / 100) ** 2))[:, None] * np.ones(y.size)
    ground = {'x': x.tolist(), 'y': y.tolist(), 'height': height.tolist(), 'clearance': 15}
    plan = planner.plan(problem(tmp_path, terrain=ground, duration=30))
    assert plan.report.code == ResultCode.INFEASIBLE
    missed = {each['quantity']: each for each in plan.report.missed}
    assert set(missed) <= {'height_above_terrain', 'z_e'}
    # 130 m of ridge and 15 m of clearance under 100 m
    assert sum(each['amount'] for each in missed.values()) == pytest.approx(45, abs=1)
    assert 'z_e at' in plan.report.message
