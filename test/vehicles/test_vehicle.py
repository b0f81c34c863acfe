"""Vehicles from YAML, and the stage function traced from them."""

from pathlib import Path

import casadi as cas
import numpy as np
import pytest

from flightdyn.dynamics.stage import KINEMATICS
from flightdyn.errors import InputError
from flightdyn.vehicles.vehicle import list_vehicles, load_vehicle

GOOD = """
model: DynamicsRigidBody2DBody
mass: 0.1
inertia: {Iyy: 0.0005}
rotors:
  thrust: {position: [0, 0, 0], direction: [0, 0, -1], thrust: [0, 1]}
"""


@pytest.mark.parametrize('vehicle', list_vehicles(), ids=lambda v: v.name)
def test_stage_gives_every_kinematic_quantity_once(vehicle) -> None:  # type: ignore[no-untyped-def]
    stage = vehicle.model().stage()
    names = [*stage.states, *stage.controls, *stage.outputs]
    assert set(KINEMATICS) <= set(names)
    assert len(names) == len(set(names))


def test_right_rotor_alone_pitches_the_nose_up() -> None:
    # the right rotor is ahead: 1 N at 0.05 m over 0.0005 kg m^2 is 100 rad/s^2
    stage = load_vehicle('quadcopter').model().stage()
    dx, _ = stage.function([0] * 6, [0, 1], [0, 0, 0, 0])
    rates = dict(zip(stage.states, dx.full().ravel(), strict=True))
    assert rates['q'] == pytest.approx(100)
    assert rates['w_b'] == pytest.approx(9.81 - 10)


def test_airspeed_is_against_the_moving_air() -> None:
    stage = load_vehicle('quadcopter').model().stage()
    state = {'u_b': 3.0, 'w_b': -4.0}
    x = [state.get(name, 0.0) for name in stage.states]
    _, outputs = stage.function(x, [0, 0], [1.0, 2.0, -0.5, 0.0])
    named = dict(zip(stage.outputs, outputs.full().ravel(), strict=True))
    assert named['speed'] == pytest.approx(5.0)
    assert named['airspeed'] == pytest.approx(np.sqrt(2.0**2 + 2.0**2 + 3.5**2))


def test_jacobian_agrees_with_central_differences() -> None:
    stage = load_vehicle('quadcopter').model().stage()
    x, u, p = cas.SX.sym('x', 6), cas.SX.sym('u', 2), cas.SX.sym('p', 4)
    dx = stage.function(x, u, p)[0]
    jacobian = cas.Function('j', [x, u, p], [cas.jacobian(dx, x)])
    rng = np.random.default_rng(7)
    for _ in range(5):
        x0, u0, p0 = rng.normal(size=6), rng.uniform(size=2), rng.normal(size=4)
        exact = jacobian(x0, u0, p0).full()
        step = 1e-6
        for i in range(6):
            ahead, behind = x0 + step * np.eye(6)[i], x0 - step * np.eye(6)[i]
            difference = stage.function(ahead, u0, p0)[0] - stage.function(behind, u0, p0)[0]
            # rounding of central differences: 1e-16 / 1e-6 times values of about 30
            np.testing.assert_allclose(exact[:, i], difference.full()[:, 0] / 2e-6, atol=1e-7)


@pytest.mark.parametrize(
    ('old', 'new', 'message'),
    [
        ('mass: 0.1', 'mass: -1', r'bad.yaml: mass: must be positive'),
        ('mass: 0.1', 'mas: 1', "unknown 'mas', did you mean 'mass'"),
        ('mass: 0.1', '', "'mass' is missing"),
        ('Iyy: 0.0005', 'Iyx: 1', "inertia: unknown 'Iyx'"),
        ('Iyy: 0.0005', '', "inertia: 'Iyy' is missing"),
        ('rotors:\n  thrust:', 'rotors:\n  - thrust:', 'expected one or more rotors by name'),
        ('2DBody', '2DBdy', "did you mean 'DynamicsRigidBody2DBody'"),
        ('[0, 0, -1]', '[0, 0, -2]', 'direction: must be a unit vector'),
        ('[0, 1]', '[1, 0]', 'lower bound 1 is above the upper bound 0'),
        ('position: [0, 0, 0], ', '', "rotors.thrust: 'position' is missing"),
    ],
)
def test_bad_files_are_refused_by_key(tmp_path: Path, old: str, new: str, message: str) -> None:
    (tmp_path / 'vehicles').mkdir()
    assert old in GOOD
    (tmp_path / 'vehicles' / 'bad.yaml').write_text(GOOD.replace(old, new))
    with pytest.raises(InputError, match=message):
        load_vehicle('bad', tmp_path)
