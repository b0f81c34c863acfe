"""Rockets, propellers and rotors: closed forms, balances, and what is used up."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from vehicle_making import check_first_derivatives, derivatives, evaluated, vehicle_of

from flightdyn.dynamics import DynamicsPointMass3DCartesian
from flightdyn.environment.noise import propeller_level
from flightdyn.errors import InputError
from flightdyn.vehicles.propeller import ActuatorDisc, MeasuredPropeller
from flightdyn.vehicles.vehicle import load_vehicle

RHO = 1.225  # kg/m^3


# ---------------------------------------------------------------------- rocket


def test_the_rocket_does_what_tsiolkovsky_says() -> None:
    stage = load_vehicle('rocket').model().stage()
    assert stage.states == ('z_e', 'w_e', 'mass')
    assert stage.controls == ('thrust',)
    seconds, thrust = 100.0, 8e6
    solution = solve_ivp(
        stage.right_hand_side({'thrust': thrust}),
        (0.0, seconds),
        [0.0, 0.0, 500e3],
        method='DOP853',
        rtol=1e-11,
        atol=1e-9,
    )
    height, climb, mass = -solution.y[0, -1], -solution.y[1, -1], solution.y[2, -1]
    exhaust = 300 * 9.81
    assert mass == pytest.approx(500e3 - seconds * thrust / exhaust, rel=1e-12)
    # delta v without gravity's loss; integrated to 1e-11
    assert climb == pytest.approx(exhaust * np.log(500e3 / mass) - 9.81 * seconds, rel=1e-9)
    burnt = mass / 500e3
    flow = thrust / exhaust
    powered = exhaust * (500e3 / flow) * (1 - burnt + burnt * np.log(burnt))
    assert height == pytest.approx(powered - 0.5 * 9.81 * seconds**2, rel=1e-9)


def test_the_rocket_has_the_textbooks_limits() -> None:
    rocket = load_vehicle('rocket')
    assert rocket.model().controls == {'thrust': (0.0, np.inf)}
    assert rocket.limits['mass'] == (1e3, 500e3)
    _, outputs = evaluated(rocket.model().stage(), mass=500e3, thrust=2943.0)
    assert outputs['fuel_flow'] == pytest.approx(1.0)


BOOSTER = """
model: DynamicsRigidBody3DBodyEuler
mass: 100
radii_of_gyration: [1, 2, 2]
propulsion:
  kind: rocket
  thrust: [1000, 4000]
  control: throttle
  specific_impulse: 250
  state: fuel
  propellant: 300
  direction: [1, 0, 0]
  position: [-2, 0, 0.1]
"""


def test_fuel_weighs_and_turns_with_the_rest(tmp_path: Path) -> None:
    vehicle = vehicle_of(tmp_path, BOOSTER)
    assert vehicle.model().controls == {'throttle': (0.25, 1.0)}
    assert vehicle.limits['fuel'] == (0.0, 300.0)
    rates, outputs = evaluated(vehicle.model().stage(), fuel=150.0, throttle=0.5)
    assert outputs['thrust'] == 2000.0
    assert rates['u_b'] == pytest.approx(2000 / 250)
    assert rates['fuel'] == pytest.approx(-2000 / (250 * 9.80665))
    # thrust below the centre of gravity pitches the nose up; radius of gyration 2 m
    assert rates['q'] == pytest.approx(2000 * 0.1 / (250 * 2**2))


# ---------------------------------------------------------------------- propellers


@pytest.mark.parametrize('speed', [0.0, 1.0, 20.0, 60.0, 300.0])
@pytest.mark.parametrize('power', [1.0, 1e3, 80e3, 1e7])
def test_an_actuator_disc_balances_power_and_momentum(power: float, speed: float) -> None:
    disc = ActuatorDisc(diameter=1.75, efficiency=0.9)
    thrust = disc.turn(power, 40.0, speed, RHO).thrust
    flow = 0.9 * power / thrust
    area = np.pi / 4 * 1.75**2
    # the 0.1 m/s that keep the slope at rest finite count as speed
    induced = flow - speed - 0.1
    assert thrust == pytest.approx(2 * RHO * area * flow * induced, rel=1e-9, abs=1e-9)


def test_an_actuator_disc_at_rest_has_the_static_thrust() -> None:
    disc = ActuatorDisc(diameter=1.75, efficiency=1.0)
    thrust = disc.turn(80e3, 40.0, 0.0, RHO).thrust
    ideal = (2 * RHO * np.pi / 4 * 1.75**2 * 80e3**2) ** (1 / 3)
    assert thrust == pytest.approx(ideal, rel=5e-3)  # 0.1 m/s of a flow of 24 m/s


def test_a_measured_propeller_takes_the_engines_torque() -> None:
    propeller = MeasuredPropeller(
        diameter=1.75, thrust=(0.1, -0.02, -0.08), power=(0.05, 0.02, -0.06)
    )
    for speed in (0.0, 20.0, 50.0):
        turning = propeller.turn(60e3, 40.0, speed, RHO)
        n = turning.rotation
        assert isinstance(n, float)
        ratio = speed / (n * 1.75)
        taken = RHO * n**3 * 1.75**5 * (0.05 + 0.02 * ratio - 0.06 * ratio**2)
        assert turning.power == pytest.approx(taken, rel=1e-6)
        assert turning.power == pytest.approx(60e3 / 40.0 * n)
        expected = RHO * n**2 * 1.75**4 * (0.1 - 0.02 * ratio - 0.08 * ratio**2)
        assert turning.thrust == pytest.approx(expected, rel=1e-9)
    # without power it windmills, and brakes
    idle = propeller.turn(0.0, 40.0, 40.0, RHO)
    assert idle.power == 0.0
    assert idle.thrust < 0
    assert idle.rotation > 10


AIRPLANE = """
model: DynamicsPointMass3DSpeedGammaTrack
mass: 700
controls: {alpha: [-5, 15], bank: [-1, 1]}
aerodynamics:
  {kind: polar, area: 15, span: 10, CL0: 0.3, CL_alpha: 5, CD0: 0.04, efficiency: 0.8}
propulsion:
  kind: propeller
  diameter: 1.75
  PROPELLER
  engine: {kind: piston, power: 82.0e+3, rotation: 42.5, consumption: 8.0e-8, fuel: 70}
"""
COEFFICIENTS = """thrust_coefficients: [0.1, -0.02, -0.08]
  power_coefficients: [0.05, 0.02, -0.06]"""


def test_an_airplane_burns_fuel_and_loses_power_with_height(tmp_path: Path) -> None:
    vehicle = vehicle_of(tmp_path, AIRPLANE.replace('PROPELLER', 'efficiency: 0.85'))
    stage = vehicle.model().stage()
    assert vehicle.model().controls['throttle'] == (0.0, 1.0)
    at = {'speed': 50.0, 'alpha': 2.0, 'fuel': 50.0}
    rates, low = evaluated(stage, **at, throttle=1.0)
    assert low['power'] == pytest.approx(82e3, rel=1e-5)
    assert rates['fuel'] == pytest.approx(-82e3 * 8e-8, rel=1e-5)
    along = low['thrust'] * np.cos(np.radians(2.0))  # thrust is along the body
    assert rates['speed'] == pytest.approx((along - low['drag']) / 750)
    _, high = evaluated(stage, **at, throttle=1.0, z_e=-3000.0)
    ratio = 0.9091 / 1.2250  # densities of the standard atmosphere at 3 km and 0
    assert high['power'] == pytest.approx(82e3 * (1.132 * ratio - 0.132), rel=1e-3)
    _, windy = evaluated(stage, (50.0 - 30.0, 0.0, 0.0), **at, throttle=1.0)
    assert windy['airspeed'] == pytest.approx(30.0)
    assert windy['thrust'] > low['thrust']  # it is the air that counts


@pytest.mark.parametrize('propeller', ['efficiency: 0.85', COEFFICIENTS])
def test_derivatives_are_right_and_finite_at_rest(tmp_path: Path, propeller: str) -> None:
    stage = vehicle_of(tmp_path, AIRPLANE.replace('PROPELLER', propeller)).model().stage()
    names = (*stage.states, *stage.controls)
    values = {'speed': 45.0, 'alpha': 3.0, 'throttle': 0.6, 'fuel': 40.0, 'bank': 0.2}
    x = np.array([values.get(name, 0.1) for name in names])
    check_first_derivatives(stage, x, (1.0, -2.0, 3.0), np.full(len(x), 0.05))
    for throttle in (0.0, 1.0):
        x = np.array([throttle if name == 'throttle' else 0.0 for name in names])
        for found in derivatives(stage)(x, [0, 0, 0, 0]):
            assert np.all(np.isfinite(found.full()))


def test_a_motor_draws_charge_and_twists_the_body(tmp_path: Path) -> None:
    text = """
model: DynamicsRigidBody3DBodyEuler
mass: 2
inertia: {Ixx: 0.05, Iyy: 0.1, Izz: 0.1}
propulsion:
  kind: propeller
  diameter: 0.3
  sense: -1
  engine: {kind: electric, power: 300, rotation: 150, efficiency: 0.8, charge: 2.0e+5}
"""
    vehicle = vehicle_of(tmp_path, text)
    assert vehicle.limits['charge'] == (0.0, 2e5)
    rates, outputs = evaluated(vehicle.model().stage(), u_b=15.0, charge=1e5, throttle=0.5)
    assert outputs['power'] == pytest.approx(150.0)
    assert rates['charge'] == pytest.approx(-150 / 0.8)
    assert rates['u_b'] == pytest.approx(outputs['thrust'] / 2)  # a battery keeps its mass
    assert rates['p'] == pytest.approx(-150 / (2 * np.pi * 150) / 0.05)


# ---------------------------------------------------------------------- rotors


def test_a_rotors_reaction_turns_the_vehicle_about_its_thrust(tmp_path: Path) -> None:
    text = """
model: DynamicsRigidBody3DBodyEuler
mass: 1
inertia: {Ixx: 0.01, Iyy: 0.01, Izz: 0.02}
rotors:
  a: {position: [0.1, 0, 0], direction: [0, 0, -1], thrust: [0, 8], torque: 0.02}
  b: {position: [-0.1, 0, 0], direction: [0, 0, -1], thrust: [0, 8], torque: -0.02}
"""
    stage = vehicle_of(tmp_path, text).model().stage()
    rates, _ = evaluated(stage, a=5.0, b=5.0)
    assert rates['q'] == rates['r'] == 0.0
    rates, _ = evaluated(stage, a=6.0, b=4.0)
    assert rates['q'] == pytest.approx(2 * 0.1 / 0.01)
    assert rates['r'] == pytest.approx(-2 * 0.02 / 0.02)  # up is against z


# ---------------------------------------------------------------------- errors


@pytest.mark.parametrize(
    ('old', 'new', 'message'),
    [
        ('kind: rocket', 'kind: rokket', "propulsion: kind: unknown 'rokket', did you mean 'roc"),
        ('specific_impulse: 250', 'isp: 250', "propulsion: unknown 'isp'"),
        ('state: fuel', 'state: mas', "propulsion: state: unknown 'mas', did you mean 'mass'"),
        ('state: fuel', 'state: mass', 'propellant: 300 kg is not below the mass, 100 kg'),
        ('[1000, 4000]', '[1000, .inf]', 'thrust: a throttle needs a largest thrust'),
        ('[1000, 4000]', '[-1, 4000]', 'thrust: must not be negative'),
        ('direction: [1, 0, 0]', 'axes: wind', "axes: unknown 'wind'"),
    ],
)
def test_bad_rockets_are_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in BOOSTER
    with pytest.raises(InputError, match=message) as caught:
        vehicle_of(tmp_path, BOOSTER.replace(old, new))
    assert 'made.yaml' in str(caught.value)


@pytest.mark.parametrize(
    ('old', 'new', 'message'),
    [
        ('kind: piston', 'kind: steam', "engine: kind: unknown 'steam'; known: piston, electric"),
        ('fuel: 70', 'charge: 70', "engine: 'charge' is not of a piston engine"),
        ('[0.05, 0.02, -0.06]', '[0, 1]', 'power_coefficients: the first must be positive'),
        ('[0.05, 0.02, -0.06]', '[1, 2, 3, 4]', r'at most three \(up to J\^2\), got 4'),
        ('power_coefficients: [0.05, 0.02, -0.06]', '', "'power_coefficients' is missing"),
        ('diameter: 1.75', 'diameter: 1.75\n  efficiency: 1', 'give either coefficients or'),
        ('diameter: 1.75', 'diameter: 1.75\n  blades: 1.5', 'blades: must be a whole number'),
    ],
)
def test_bad_propellers_are_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = AIRPLANE.replace('PROPELLER', COEFFICIENTS)
    assert old in text
    with pytest.raises(InputError, match=message):
        vehicle_of(tmp_path, text.replace(old, new))


def test_the_same_source_serves_arrays(tmp_path: Path) -> None:
    vehicle = vehicle_of(tmp_path, AIRPLANE.replace('PROPELLER', COEFFICIENTS))
    assert vehicle.propulsion is not None
    speeds = np.array([0.0, 20.0, 50.0])
    dyn = DynamicsPointMass3DCartesian(u_e=speeds)
    several = vehicle.propulsion.attach(dyn, {'throttle': 0.7})['thrust']
    for speed, thrust in zip(speeds, several, strict=True):
        alone = vehicle.propulsion.attach(
            DynamicsPointMass3DCartesian(u_e=float(speed)), {'throttle': 0.7}
        )
        assert alone['thrust'] == pytest.approx(thrust)


@pytest.mark.parametrize(('measured', 'turning'), [(False, 45.0), (True, None)])
def test_a_propeller_with_blades_is_heard(
    tmp_path: Path, measured: bool, turning: float | None
) -> None:
    coefficients = 'thrust_coefficients: [0.1, -0.1], power_coefficients: [0.05, -0.02]'
    text = f"""
model: DynamicsPointMass3DSpeedGammaTrack
mass: 1000
propulsion:
  {{kind: propeller, diameter: 1.9, blades: 2, {coefficients + ',' if measured else ''}
   engine: {{kind: electric, power: 120.0e+3, rotation: 45}}}}
"""
    stage = vehicle_of(tmp_path, text).model().stage()
    _, outputs = evaluated(stage, speed=40.0, throttle=1.0)
    rotation = turning or outputs['rotation']
    tip_mach = np.pi * 1.9 * rotation / 340.294
    expected = propeller_level(outputs['power'], 1.9, tip_mach, 2)
    assert outputs['source_level'] == pytest.approx(expected, abs=1e-3)
    # without power it is quiet, and finite
    assert np.isfinite(evaluated(stage, speed=40.0)[1]['source_level'])
