"""A plan between its samples."""

import numpy as np
import pytest

from flightdyn.control.reference import Reference, planned_wind
from flightdyn.errors import InputError
from flightdyn.simulation.simulator import Simulator, fly
from flightdyn.trajectory import Trajectory
from flightdyn.vehicles.vehicle import load_vehicle

MODEL = load_vehicle('quadcopter').model()
STAGE = MODEL.stage()
TIME = np.array([0.0, 0.01, 0.025])
CONTROLS = {'thrust_left': np.array([1.0, 0.2, 0.5]), 'thrust_right': np.array([0.3, 0.9, 0.5])}


@pytest.mark.parametrize('interpolation', ['previous', 'linear'])
def test_states_between_samples_are_those_flown(interpolation: str) -> None:
    """A cubic errs with h^4 / 384 of the fourth derivative: 3e-5 at 15 ms and 2e5 m/s^5."""
    controls = Trajectory(
        time=TIME,
        states={},
        controls=CONTROLS,
        control_interpolation=interpolation,  # type: ignore[arg-type]
    )
    flown = fly(Simulator(MODEL, {'u_b': 2.0, 'q': 3.0}, controls), 0.025, 1000, also_at=TIME)
    at = np.searchsorted(flown.time, TIME)
    plan = Trajectory(
        time=TIME,
        states={name: values[at] for name, values in flown.states.items()},
        controls=CONTROLS,
        control_interpolation=interpolation,  # type: ignore[arg-type]
    )
    reference = Reference(STAGE, plan)
    table = np.array(list(flown.states.values()))
    np.testing.assert_allclose(reference.states(flown.time), table, atol=3e-5)
    np.testing.assert_allclose(reference.states(TIME), table[:, at], atol=1e-12)
    np.testing.assert_allclose(reference.states([-1.0, 2.0]), table[:, [0, -1]], atol=1e-12)
    assert reference.controls(0.01)[:, 0].tolist() == [0.2, 0.9]


def test_a_single_sample_is_held() -> None:
    plan = Trajectory(
        time=np.zeros(1),
        states={name: np.full(1, i) for i, name in enumerate(STAGE.states)},
        controls={name: np.zeros(1) for name in STAGE.controls},
    )
    assert Reference(STAGE, plan).states([0.0, 5.0])[:, 1].tolist() == [0, 1, 2, 3, 4, 5]


def test_wind_is_that_of_the_plan() -> None:
    plan = Trajectory(time=np.zeros(1), states={}, outputs={'wind_y_e': np.full(1, 3.0)})
    assert planned_wind(plan, (1.0, 2.0, 0.5)).tolist() == [1.0, 3.0, 0.5]
    varying = Trajectory(time=TIME, states={}, outputs={'wind_z_e': TIME})
    with pytest.raises(InputError, match=r'wind_z_e varies on its way.*flightdyn sim plan.json'):
        planned_wind(varying)


@pytest.mark.parametrize('missing', ['theta', 'thrust_right'])
def test_incomplete_plans_are_refused(missing: str) -> None:
    plan = Trajectory(
        time=np.zeros(1),
        states={name: np.zeros(1) for name in STAGE.states if name != missing},
        controls={name: np.zeros(1) for name in STAGE.controls if name != missing},
    )
    with pytest.raises(InputError, match=f'without the .*{missing}'):
        Reference(STAGE, plan)


def test_plans_with_gaps_are_refused() -> None:
    plan = Trajectory(
        time=np.array([0.0, 1.0]),
        states={name: np.zeros(2) for name in STAGE.states},
        controls={name: np.zeros(2) for name in STAGE.controls},
        segment=np.array([0, 1]),
    )
    with pytest.raises(InputError, match='gaps'):
        Reference(STAGE, plan)
