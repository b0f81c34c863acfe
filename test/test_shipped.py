"""The problems and scenarios that are shipped: complete, shown in an example, right in wind."""

import runpy
from pathlib import Path

import numpy as np
import pytest

from flightdyn.planning.planner import Planner
from flightdyn.planning.problem_file import load_problem
from flightdyn.planning.remedies import perturbed
from flightdyn.resources import list_configs
from flightdyn.simulation.scenario import load_scenario

ROOT = Path(__file__).parents[1]
EXAMPLES = ''.join(path.read_text(encoding='utf-8') for path in (ROOT / 'examples').glob('*.py'))


@pytest.mark.parametrize('name', list_configs('problems'))
def test_a_problem_is_described_and_has_an_example(name: str) -> None:
    problem = load_problem(name)
    assert problem.description
    assert f"'{name}'" in EXAMPLES


@pytest.mark.parametrize('name', list_configs('scenarios'))
def test_a_scenario_is_described_and_has_an_example(name: str) -> None:
    assert load_scenario(name).description
    assert f"'{name}'" in EXAMPLES


def test_turning_back_in_wind_begins_at_the_airspeed_of_a_climb() -> None:
    """It used to begin at 65 kt over the ground: 55 kt through the air in a tailwind of 5 m/s."""
    wind = np.array([3.0, 4.0, 0.0])
    planner = Planner()
    plans = {}
    for name, turned in (('north', 0.0), ('east', np.pi / 2)):
        problem = load_problem('cessna152_turnback')
        turn = np.array([[np.cos(turned), -np.sin(turned)], [np.sin(turned), np.cos(turned)]])
        x, y = turn @ np.array([problem.guess['x_e'], problem.guess['y_e']])
        track = tuple(turned + np.array(problem.guess['track']))
        plans[name] = planner.plan(
            problem.with_changes(
                initial={'track': (turned, turned)},
                final={'track': (turned + np.pi, turned + np.pi)},
                wind_ned=(*(turn @ wind[:2]), 0.0),
                guess={**problem.guess, 'x_e': tuple(x), 'y_e': tuple(y), 'track': track},
            )
        )
        assert plans[name].report.verified, plans[name].report.message
        flight = plans[name].trajectory
        air = np.array([flight[c][[0, -1]] for c in ('u_e', 'v_e', 'w_e')])
        air -= np.array(plans[name].wind_ned)[:, None]
        fast = np.linalg.norm(air, axis=0)
        assert fast[0] == pytest.approx(33.4389, abs=1e-4)  # the solver's tolerance, scaled
        assert fast[1] > 33.4389 - 1e-4
        assert flight['speed'][0] > 35  # the wind has a tail component of 3 m/s
    # runway and wind turned together: the same flight, to what different meshes make of it
    objectives = [plan.report.objective for plan in plans.values()]
    assert objectives[0] == pytest.approx(objectives[1], abs=0.05)


def test_the_valley_is_what_its_formula_gives() -> None:
    formula = runpy.run_path(str(ROOT / 'tools' / 'terrain_racing_map'))['heights']
    terrain = load_problem('terrain_racing').surroundings.terrain
    assert terrain is not None
    heights = formula(terrain.x[:, None], terrain.y)
    # kept to 0.1 m, in single precision
    np.testing.assert_allclose(terrain.height, heights, atol=0.0501)


SPACE = {
    'drone_gates': 0.02,
    'quadcopter_flip_3d': 0.01,
    'terrain_racing': 0.01,
    'engine_out_any_field': 0.05,
    'noise_departure': 0.01,
}
"""How much worse than the best, relatively, a plan may be: other optima are near."""


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize('name', SPACE)
def test_a_problem_of_space_is_solved_from_most_other_guesses(name: str) -> None:
    shipped, planner = load_problem(name), Planner()
    for _, problem in shipped.alternatives or [('', shipped)]:
        own = planner.plan(problem)
        assert own.report.verified, own.report.message
        guessed = [perturbed(problem, seed) for seed in range(1, 11)]
        plans = [plan for plan in map(planner.plan, guessed) if plan.report.verified]
        assert len(plans) >= 8
        sign = problem.objective.sign
        best = min(sign * plan.report.objective for plan in [own, *plans])
        assert sign * own.report.objective - best <= SPACE[name] * abs(best)
