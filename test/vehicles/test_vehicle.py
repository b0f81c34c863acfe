"""Vehicles from YAML, and the stage function traced from them."""

from dataclasses import replace
from pathlib import Path

import casadi as cas
import numpy as np
import pytest
from vehicle_making import derivatives, evaluated, vehicle_of

from flightdyn.dynamics.stage import KINEMATICS
from flightdyn.errors import InputError
from flightdyn.vehicles.vehicle import Vehicle, list_vehicles, load_vehicle

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


@pytest.mark.parametrize('vehicle', list_vehicles(), ids=lambda v: v.name)
def test_everything_is_finite_at_rest(vehicle) -> None:  # type: ignore[no-untyped-def]
    stage = vehicle.model().stage()
    values = dict(zip(stage.states, stage.rest, strict=True))
    values |= {name: vehicle.limits[name][1] for name in ('mass', 'fuel') if name in stage.states}
    x = [values.get(name, 0.0) for name in (*stage.states, *stage.controls)]
    value, first, _ = derivatives(stage)(x, [0.0] * stage.function.size1_in(2))
    assert np.all(np.isfinite(value.full()))
    assert np.all(np.isfinite(first.full()))


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
        ('mass: 0.1', 'mass: 0.1\nradii_of_gyration: [1, 1, 1]', 'give either inertia or radii'),
        ('{Iyy: 0.0005}', '{Ixx: 1, Iyy: 2, Izz: 4}', r'bad.yaml: MassProperties: no body has'),
        ('mass: 0.1', 'mass: 0.1\ncontrols: {flaps: [0, 1]}', "controls: 'flaps' has no effect"),
        ('mass: 0.1', 'mass: 0.1\ncontrols: {alhpa: [0, 1]}', "did you mean 'alpha'"),
        ('mass: 0.1', 'mass: 0.1\ncontrols: {a-b: [0, 1]}', "'a-b' is no name of letters"),
        ('mass: 0.1', 'mass: 0.1\nlimits: {sped: [0, 1]}', "unknown 'sped', did you mean 'speed'"),
        ('mass: 0.1', 'mass: 0.1\nlimits: {speed: [2, 1]}', 'limits.speed: lower bound 2 is'),
        ('mass: 0.1', 'mass: 0.1\naerodynamics: {kind: poler}', "'poler', did you mean 'polar'"),
        ('mass: 0.1', 'mass: 0.1\naerodynamics: 3', 'aerodynamics: expected a mapping, got 3'),
        ('mass: 0.1', 'mass: 0.1\ngeometry: 3', 'geometry: expected a mapping, got 3'),
        ('mass: 0.1', 'mass: 0.1\ngeometry: {kind: baloon}', "'baloon', did you mean 'balloon'"),
        ('mass: 0.1', 'mass: 0.1\ngeometry: {kind: balloon}', "'diameter' is missing"),
        (
            'mass: 0.1',
            'mass: 0.1\ngeometry: {kind: rocket, length: 9, diamter: 1}',
            "unknown 'diamter', did you mean 'diameter'",
        ),
        ('mass: 0.1', 'mass: 0.1\ngeometry: {kind: airplane}', 'geometry: needs wings'),
        ('position: [0, 0, 0], ', '', "rotors.thrust: 'position' is missing"),
        ('mass: 0.1', 'mass: 0.1\nrates: {trust: 1}', "'trust' is not .*did you mean 'thrust'"),
        ('mass: 0.1', 'mass: 0.1\nrates: {thrust: 0}', 'rates.thrust: must be positive, got 0'),
        ('mass: 0.1', 'mass: 0.1\nrates: [1]', 'rates: expected names and values'),
        ('mass: 0.1', 'mass: 0.1\nrates: {thrust: fast}', 'rates.thrust: expected a number'),
    ],
)
def test_bad_files_are_refused_by_key(tmp_path: Path, old: str, new: str, message: str) -> None:
    (tmp_path / 'vehicles').mkdir()
    assert old in GOOD
    (tmp_path / 'vehicles' / 'bad.yaml').write_text(GOOD.replace(old, new))
    with pytest.raises(InputError, match=message):
        load_vehicle('bad', tmp_path)


GLIDER = """
model: DynamicsPointMass2DSpeedGamma
mass: 300
inertia: {Ixx: 1, Iyy: 1, Izz: 1}
controls:
  alpha: [-5 deg, 15]
  bank: [-60 deg, 60 deg]
limits: {load_factor: [-2, 4], alpha: [-5, 15 deg], gamma: [-60 deg, 60 deg]}
aerodynamics:
  kind: polar
  area: 10
  span: 15
  CL_alpha: 5
  CD0: 0.01
  k: 0.02
  increments: {INCREMENT}
"""


def glider(folder: Path, increment: str = '', more: str = '') -> Vehicle:
    return vehicle_of(folder, GLIDER.replace('INCREMENT', increment) + more)


def test_alpha_is_in_degrees_and_all_other_angles_in_radians(tmp_path: Path) -> None:
    vehicle = glider(tmp_path)
    assert vehicle.controls['alpha'] == vehicle.limits['alpha'] == (-5.0, 15.0)
    assert vehicle.controls['bank'] == pytest.approx((-np.pi / 3, np.pi / 3))
    assert vehicle.limits['gamma'] == pytest.approx((-np.pi / 3, np.pi / 3))


@pytest.mark.parametrize(
    ('model', 'controls'),
    [
        ('DynamicsPointMass2DSpeedGamma', ['alpha']),
        ('DynamicsPointMass3DSpeedGammaTrack', ['alpha', 'bank']),
        ('DynamicsPointMass3DCartesian', ['alpha', 'bank']),
        ('DynamicsRigidBody3DBodyQuaternion', []),
    ],
)
def test_controls_follow_the_class(tmp_path: Path, model: str, controls: list[str]) -> None:
    vehicle = glider(tmp_path).with_model(model)
    assert list(vehicle.model().controls) == controls
    assert set(controls) <= set(vehicle.model().stage().controls)


def test_two_classes_give_the_same_motion(tmp_path: Path) -> None:
    vehicle = glider(tmp_path)
    path = vehicle.with_model('DynamicsPointMass3DSpeedGammaTrack').model().stage()
    plain = vehicle.with_model('DynamicsPointMass3DCartesian').model().stage()
    steer = {'alpha': 4.0, 'bank': 0.4}
    wind = (3.0, -2.0, 1.0)
    rates, outputs = evaluated(path, wind, speed=30.0, gamma=-0.1, track=0.7, **steer)
    velocity = {name: outputs[name] for name in ('u_e', 'v_e', 'w_e')}
    others, again = evaluated(plain, wind, **velocity, **steer)
    along = sum(velocity[name] * others[name] for name in velocity) / 30.0
    assert rates['speed'] == pytest.approx(along)
    assert outputs['drag'] == pytest.approx(again['drag'])


def test_rates_are_of_any_control_and_alphas_in_degrees(tmp_path: Path) -> None:
    rates = 'rates: {alpha: 10 deg, bank: 30 deg, throttle: 0.5}\n'
    engine = 'engine: {kind: electric, power: 1, rotation: 1}'
    more = f'{rates}propulsion: {{kind: propeller, diameter: 1, {engine}}}'
    vehicle = glider(tmp_path, more=more)
    assert vehicle.rates == pytest.approx({'alpha': 10, 'bank': np.pi / 6, 'throttle': 0.5})
    assert 'rates alpha 10/s' in vehicle.describe()
    assert repr(vehicle) != repr(glider(tmp_path, more=more.replace('0.5', '0.6')))
    assert load_vehicle('quadcopter').rates == {}
    with pytest.raises(InputError, match="made: rates: 'flaps' is not among the vehicle's"):
        replace(vehicle, rates={'flaps': 1.0})
    with pytest.raises(InputError, match=r'made: rates.bank: must be positive, got -1'):
        replace(vehicle, rates={'bank': -1.0})


def test_a_class_without_its_inertia_is_refused(tmp_path: Path) -> None:
    vehicle = load_vehicle('rocket')
    with pytest.raises(InputError, match="rocket: inertia: 'Ixx' is missing"):
        vehicle.with_model('DynamicsRigidBody3DBodyEuler')
    with pytest.raises(InputError, match="did you mean 'DynamicsPointMass3DCartesian'"):
        vehicle.with_model('DynamicsPointMass3DCartesan')


def test_the_key_of_a_vehicle_has_everything(tmp_path: Path) -> None:
    keys = {
        repr(glider(tmp_path)),
        repr(glider(tmp_path, 'gear: {drag_area: 0.1}')),
        repr(glider(tmp_path, 'gear: {drag_area: 0.2}')),
        repr(glider(tmp_path, more='  stall: {alpha: [-10, 15]}')),
        repr(glider(tmp_path).with_model('DynamicsPointMass3DCartesian')),
    }
    assert len(keys) == 5
    assert repr(glider(tmp_path)) in keys
    assert all('0x' not in key for key in keys)  # no addresses


def test_an_increment_names_its_control(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"made.yaml: .*gear: control: 'gear' is not among"):
        glider(tmp_path, 'gear: {drag_area: 0.1, control: gear}')
    with pytest.raises(InputError, match=r"increments.gear: unknown 'area', did you mean"):
        glider(tmp_path, 'gear: {area: 0.1}')


def test_two_controls_of_one_name_are_refused(tmp_path: Path) -> None:
    text = GLIDER.replace('INCREMENT', 'f: {CD: 1, control: throttle}')
    text = text.replace('controls:', 'controls:\n  throttle: [0, 1]')
    engine = '{kind: electric, power: 1, rotation: 1}'
    text += f'propulsion: {{kind: propeller, diameter: 1, engine: {engine}}}'
    with pytest.raises(InputError, match="two controls have the name 'throttle'"):
        vehicle_of(tmp_path, text)


def test_a_description_tells_controls_limits_and_states(tmp_path: Path) -> None:
    told = glider(tmp_path).describe()
    assert 'controls alpha -5 to 15' in told
    assert 'load_factor -2 to 4' in told
    assert 'states x_e z_e speed gamma' in told
