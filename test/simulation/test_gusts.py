"""Gusty air in the simulator: seeded, repeatable, independent of sampling, right in size."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flightdyn.dynamics import DynamicsPointMass3DCartesian, MassProperties
from flightdyn.dynamics.stage import Model
from flightdyn.environment.turbulence import intensities
from flightdyn.errors import InputError
from flightdyn.simulation.gusts import Gusts
from flightdyn.simulation.scenario import load_scenario
from flightdyn.simulation.simulator import Simulator, fly
from flightdyn.trajectory import Trajectory
from flightdyn.vehicles.vehicle import load_vehicle

# drifts through the air at 30 m/s whatever the air does: only `airspeed` sees the gusts
DRIFTER = Model(
    vehicle='drifter',
    dynamics=DynamicsPointMass3DCartesian,
    mass_props=MassProperties(mass=1.0),
    controls={},
    attach=lambda dyn, controls: None,
)
NO_CONTROLS = Trajectory(time=np.zeros(1), states={}, controls={})


def drift(gusts: Gusts | None, rate: float = 20.0, duration: float = 20.0) -> Trajectory:
    initial = {'z_e': -100.0, 'u_e': 30.0}
    return fly(Simulator(DRIFTER, initial, NO_CONTROLS, gusts=gusts), duration, rate)


def test_the_same_seed_makes_the_same_gusts_whatever_the_sampling() -> None:
    fine, coarse = (drift(Gusts('severe', seed=4), rate).outputs['airspeed'] for rate in (40, 10))
    np.testing.assert_array_equal(fine[::4], coarse)
    other = drift(Gusts('severe', seed=5)).outputs['airspeed']
    assert np.ptp(other - drift(Gusts('severe', seed=4)).outputs['airspeed']) > 1.0


def test_without_severity_the_air_is_calm() -> None:
    calm, none = (drift(g, duration=2.0).outputs['airspeed'] for g in (Gusts('none'), None))
    np.testing.assert_array_equal(calm, none)


def test_gusts_have_the_standards_intensity_along_the_flight() -> None:
    airspeed = np.concatenate(
        [drift(Gusts('moderate', seed=seed), 2.0, 120.0).outputs['airspeed'] for seed in range(6)]
    )
    along = intensities(100.0, 'moderate')[0]
    # 6 x 120 s x 30 m/s over 2 L of 460 m are some 45 independent gusts: within 20 %
    assert np.std(airspeed) == pytest.approx(along, rel=0.2)


def test_a_reset_starts_the_gusts_anew() -> None:
    simulator = Simulator(DRIFTER, {'u_e': 30.0}, NO_CONTROLS, gusts=Gusts('light', seed=2))
    first = fly(simulator, 3.0, 10.0).outputs['airspeed']
    simulator.reset({'u_e': 30.0})
    np.testing.assert_array_equal(fly(simulator, 3.0, 10.0).outputs['airspeed'], first)


def test_a_body_by_quaternion_starts_upright(tmp_path: Path) -> None:
    """Its quaternion used to start at (0, 0, 0, 0), which is no attitude: all became NaN."""
    (tmp_path / 'vehicles').mkdir()
    (tmp_path / 'vehicles' / 'cube.yaml').write_text(
        'model: DynamicsRigidBody3DBodyQuaternion\nmass: 1\n'
        'inertia: {Ixx: 1, Iyy: 1, Izz: 1}\n'
        'rotors: {lift: {position: [0, 0, 0], direction: [0, 0, -1], thrust: [0, 20]}}\n'
    )
    held = Trajectory(time=np.zeros(1), states={}, controls={'lift': np.full(1, 9.81)})
    simulator = Simulator(load_vehicle('cube', tmp_path).model(), {}, held, gusts=Gusts())
    flown = fly(simulator, 1.0, 10.0)
    np.testing.assert_allclose(flown.states['qw'], 1.0)
    np.testing.assert_allclose(flown.states['z_e'], 0.0, atol=1e-12)


def scenario(folder: Path, gusts: str) -> Any:
    path = folder / 'gusty.yaml'
    path.write_text(
        'vehicle: quadcopter\nduration: 0.2\n'
        f'controls: {{thrust_left: 0.5, thrust_right: 0.5}}\ngusts: {gusts}\n'
    )
    return load_scenario(str(path))


def test_a_scenario_names_its_gusts(tmp_path: Path) -> None:
    loaded = scenario(tmp_path, '{severity: light, seed: 7}')
    assert loaded.gusts == Gusts('light', seed=7)
    assert fly(loaded.simulator(), 0.2, 100.0).outputs['airspeed'][0] > 0


@pytest.mark.parametrize(
    ('gusts', 'message'),
    [
        ('{severity: stiff}', "gusts: severity 'stiff' is unknown; known: none, light"),
        ('{severty: light}', "gusts: unknown 'severty', did you mean 'severity'"),
        ('{seed: 1.5}', 'gusts.seed: expected a whole number, got 1.5'),
        ('{seed: -1}', 'seed of gusts must be 0 or more, got -1'),
        ('{wind_at_20_ft: -3}', 'wind_at_20_ft is -3.0 m/s'),
    ],
)
def test_bad_gusts_are_refused(tmp_path: Path, gusts: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        scenario(tmp_path, gusts)
