"""Jet engines: thrust by height and throttle, fuel by thrust, and their limits."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from vehicle_making import check_first_derivatives, evaluated, vehicle_of

from flightdyn.environment.atmosphere import Atmosphere
from flightdyn.errors import InputError

SLED = """
model: DynamicsPointMass2DCartesian
mass: 800
gravity: 9.81
propulsion: {kind: jet, thrust: 5000, lapse: 0.8, consumption: 2.0e-5, fuel: 200}
"""


def test_thrust_falls_with_the_density_and_fuel_with_the_thrust(tmp_path: Path) -> None:
    stage = vehicle_of(tmp_path, SLED).model().stage()
    assert stage.states == ('x_e', 'z_e', 'u_e', 'w_e', 'fuel')
    assert stage.controls == ('alpha', 'throttle') or stage.controls == ('throttle',)
    for height in (0.0, 5000.0, 12000.0):
        rates, outputs = evaluated(stage, z_e=-height, u_e=200.0, fuel=100.0, throttle=0.6)
        part = Atmosphere(height).density() / Atmosphere(0.0).density()
        assert outputs['thrust'] == pytest.approx(0.6 * 5000 * part**0.8, rel=1e-9)
        assert rates['fuel'] == pytest.approx(-2e-5 * outputs['thrust'])
        assert outputs['fuel_flow'] == -rates['fuel']
        assert rates['u_e'] == pytest.approx(outputs['thrust'] / 900)
        sound = Atmosphere(height).speed_of_sound()
        assert outputs['mach'] == pytest.approx(200 / sound, rel=1e-9)


def test_it_is_a_rocket_of_its_consumption(tmp_path: Path) -> None:
    """On a level track without drag: Tsiolkovsky's equation, its exhaust 1 / consumption."""
    text = SLED.replace('2DCartesian', '1DHorizontal').replace('lapse: 0.8, ', '')
    stage = vehicle_of(tmp_path, text).model().stage()
    solution = solve_ivp(
        stage.right_hand_side({'throttle': 1.0}),
        (0.0, 1000.0),
        [0.0, 0.0, 200.0],
        method='DOP853',
        rtol=1e-11,
        atol=1e-9,
    )
    _, speed, fuel = solution.y[:, -1]
    assert fuel == pytest.approx(200 - 2e-5 * 5000 * 1000, rel=1e-9)
    assert speed == pytest.approx(np.log(1000 / (800 + fuel)) / 2e-5, rel=1e-9)


def test_derivatives_are_right(tmp_path: Path) -> None:
    stage = vehicle_of(tmp_path, SLED).model().stage()
    values = {'x_e': 1e3, 'z_e': -9e3, 'u_e': 210.0, 'w_e': -4.0, 'fuel': 120.0, 'throttle': 0.7}
    names = (*stage.states, *stage.controls)
    x = np.array([values.get(name, 0.0) for name in names])
    scale = [max(abs(v), 1.0) for v in x]
    check_first_derivatives(stage, x, (1.0, -2.0, 0.5), scale)


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        (('thrust: 5000', 'thrust: -5'), 'thrust: must be positive'),
        (('thrust: 5000, ', ''), "'thrust' is missing"),
        (('consumption: 2.0e-5, ', ''), "'consumption' is missing"),
        ((', fuel: 200', ''), "'fuel' is missing"),
        (('lapse', 'laps'), "unknown 'laps', did you mean 'lapse'"),
    ],
)
def test_wrong_jets_are_refused(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        vehicle_of(tmp_path, SLED.replace(*change))
