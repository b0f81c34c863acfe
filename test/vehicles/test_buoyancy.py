"""The balloon: it weighs what it should, floats by its gas, and rises at its terminal speed."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from vehicle_making import check_first_derivatives, derivatives, evaluated

from flightdyn.vehicles.vehicle import load_vehicle

HELIUM = 4.002602 / 28.9644  # density over that of air at the same pressure and temperature


def test_the_balloon_weighs_its_rubber_and_its_gas() -> None:
    volume = np.pi / 6 * 0.254**3
    mass = 0.005 + HELIUM * 1.225 * volume
    assert load_vehicle('balloon').mass_props.mass == pytest.approx(mass, rel=1e-5)


@pytest.mark.parametrize('altitude', [0.0, 5e3, 30e3])
def test_the_lift_is_the_same_at_every_height(altitude: float) -> None:
    stage = load_vehicle('balloon').model().stage()
    rates, outputs = evaluated(stage, z_e=-altitude)
    # the displaced air weighs what the gas weighs times the ratio of molar masses
    gas = load_vehicle('balloon').mass_props.mass - 0.005
    assert outputs['buoyancy'] == pytest.approx(gas / HELIUM * 9.81, rel=1e-6)
    assert rates['w_e'] == pytest.approx(9.81 - outputs['buoyancy'] / (0.005 + gas), rel=1e-6)


def test_after_a_minute_it_rises_at_terminal_speed() -> None:
    stage = load_vehicle('balloon').model().stage()
    flight = solve_ivp(
        stage.right_hand_side({}), (0, 180), [0.0] * 4, method='LSODA', rtol=1e-9, atol=1e-9
    )
    for minute in (60, 120, 180):
        i = int(np.searchsorted(flight.t, minute)) - 1
        x, z, u, w = flight.y[:, i]
        _, outputs = evaluated(stage, x_e=x, z_e=z, u_e=u, w_e=w)
        mass = load_vehicle('balloon').mass_props.mass
        area = np.pi * outputs['radius'] ** 2
        density = outputs['drag'] / (0.5 * w**2 * 0.4 * area)
        terminal = np.sqrt(2 * (outputs['buoyancy'] - mass * 9.81) / (density * 0.4 * area))
        # it lags as speed grows by 1 % in 300 m
        assert -w == pytest.approx(terminal, rel=1e-3)
    assert -flight.y[1, -1] > 180


def test_it_goes_with_the_wind() -> None:
    stage = load_vehicle('balloon').model().stage()
    still, _ = evaluated(stage)
    blown, outputs = evaluated(stage, (4.0, 0.0, 0.0))
    assert blown['u_e'] == pytest.approx(outputs['drag'] / load_vehicle('balloon').mass_props.mass)
    assert blown['w_e'] == pytest.approx(still['w_e'])
    carried, _ = evaluated(stage, (4.0, 0.0, 0.0), u_e=4.0)
    assert carried['u_e'] == 0.0


def test_derivatives_are_right_and_finite_at_rest() -> None:
    stage = load_vehicle('balloon').model().stage()
    x = np.array([1.0, -3000.0, 2.0, -3.0])
    check_first_derivatives(stage, x, (1.0, 0.0, 0.5), np.array([1.0, 100.0, 0.1, 0.1]))
    value, first, _ = derivatives(stage)([0.0] * 4, [0.0] * 4)
    assert np.all(np.isfinite(value.full()))
    assert np.all(np.isfinite(first.full()))
