"""Angles, load factor and energies against hand-worked cases."""

import numpy as np
import pytest
from numpy.typing import NDArray

from flightdyn.replay.flight_path import (
    EARTH_RATE,
    G0,
    MAX_TURN_STD,
    bank_about,
    energies,
    flight_path,
    specific_force,
)

Array = NDArray[np.float64]


def three(x: float, y: float, z: float) -> tuple[Array, Array, Array]:
    return np.array([x]), np.array([y]), np.array([z])


def angles(vel: tuple[float, ...], acc: tuple[float, ...], **more: object) -> dict[str, float]:
    given: dict[str, object] = {
        'vel_var': three(1e-4, 1e-4, 1e-4),
        'acc_var': three(1e-4, 1e-4, 1e-4),
        'lat': None,
    }
    found = flight_path(three(*vel), three(*acc), **(given | more))  # type: ignore[arg-type]
    return {name: float(values[0]) for name, values in found.items()}


def test_a_banked_climb_to_the_east() -> None:
    """East at 40 m/s, 30 m/s up, turning right (towards south) at 3 m/s^2.

    Up across the velocity, g cos(gamma) = 0.8 g; right, 3 m/s^2.
    """
    found = angles((0.0, 40.0, -30.0), (-3.0, 0.0, 0.0))
    assert found['speed'] == pytest.approx(50.0)
    assert found['gamma'] == pytest.approx(np.arctan2(30, 40))
    assert found['track'] == pytest.approx(np.pi / 2)
    assert found['bank'] == pytest.approx(np.arctan2(3.0, 0.8 * G0))
    assert found['load_factor'] == pytest.approx(np.hypot(3.0, 0.8 * G0) / G0)


@pytest.mark.parametrize('up', [90.0, -90.0])
def test_straight_up_and_down_everything_is_finite(up: float) -> None:
    found = angles((0.0, 0.0, -up), (0.0, 0.0, 0.0), vel_var=three(0.01, 0.01, 0.01))
    assert all(np.isfinite(value) for value in found.values())
    assert found['gamma'] == pytest.approx(np.copysign(np.pi / 2, up))
    assert found['track_std'] == MAX_TURN_STD


@pytest.mark.parametrize(('lat', 'left'), [(50.0, True), (-50.0, False)])
def test_over_a_turning_earth_straight_flight_needs_bank(lat: float, left: bool) -> None:
    """Due north at 250 m/s: 2 omega V sin(lat) to the west in the north, to the east in the south.

    At 50 deg that is 2 * 7.29e-5 * 250 * 0.766 = 0.0279 m/s^2, 0.163 deg of bank.
    """
    found = angles((250.0, 0.0, 0.0), (0.0, 0.0, 0.0), lat=np.array([lat]))
    expected = np.arctan2(2 * EARTH_RATE * 250 * np.sin(np.radians(lat)), G0)
    assert abs(np.degrees(expected)) == pytest.approx(0.163, abs=5e-4)
    assert found['bank'] == pytest.approx(-expected, rel=1e-6)
    assert (found['bank'] < 0) is left


def test_flying_east_over_the_equator_is_lighter() -> None:
    """Eotvos: eastward at the equator 2 omega V less is needed to hold the vehicle up."""
    force = specific_force(three(0.0, 200.0, 0.0), three(0.0, 0.0, 0.0), np.array([0.0]))
    assert float(force[2][0]) == pytest.approx(-G0 + 2 * EARTH_RATE * 200)


def test_bank_and_load_factor_scatter_as_their_sigmas_say() -> None:
    rng = np.random.default_rng(0)
    n, std = 20_000, (0.3, 0.5, 0.4)
    scatter = [s * rng.normal(size=n) for s in std]
    vel = tuple(np.full(n, v) for v in (30.0, 20.0, -5.0))
    acc = (-2.0, 3.0, 0.5)
    noisy = tuple(a + e for a, e in zip(acc, scatter, strict=True))
    none = tuple(np.full(n, 1e-8) for _ in range(3))
    spread = tuple(np.full(n, s**2) for s in std)
    found = flight_path(vel, noisy, none, spread, lat=None)  # type: ignore[arg-type]
    meant = flight_path(vel, tuple(np.full(n, a) for a in acc), none, spread, lat=None)  # type: ignore[arg-type]
    for name in ('bank', 'load_factor'):
        # First order in 0.5 / g; the rest is of the order of its square. 20 000 draws: 0.5 %.
        stated = float(meant[f'{name}_std'][0])
        assert float(np.std(found[name])) == pytest.approx(stated, rel=0.02)


def test_at_rest_the_bank_is_as_uncertain_as_the_lift_is_tilted() -> None:
    parked = angles((0.005, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert parked['bank'] == 0.0
    assert parked['bank_std'] == pytest.approx(0.01 / G0)  # the acceleration's 1-sigma over g
    pushed = angles((0.005, 0.0, 0.0), (0.0, 3.0, 0.0))
    assert pushed['bank'] == 0.0
    assert pushed['bank_std'] == pytest.approx(np.arctan2(3.0, G0), rel=0.01)


def test_a_stone_thrown_keeps_its_energy() -> None:
    t = np.linspace(0.0, 4.0, 50)
    vel = (np.full(t.size, 12.0), np.full(t.size, -5.0), -20.0 + G0 * t)
    acc = (0 * t, 0 * t, np.full(t.size, G0))
    height = 100 + 20 * t - G0 * t**2 / 2
    found = energies(height, vel, acc)
    np.testing.assert_allclose(found['specific_energy'], G0 * 100 + (144 + 25 + 400) / 2)
    np.testing.assert_allclose(found['specific_energy_rate'], 0.0, atol=1e-12)


def test_energy_rate_of_a_climb_that_gathers_speed() -> None:
    """50 m/s, climbing 4 m/s and gaining 0.5 m/s^2 along the path: (4 g + 25) W/kg."""
    along = np.array([0.0, np.sqrt(50**2 - 4**2), -4.0])
    found = energies(np.array([500.0]), three(*along), three(*(0.5 * along / 50)))
    assert float(found['specific_energy_rate'][0]) == pytest.approx(4 * G0 + 25)
    assert float(found['specific_excess_power'][0]) == pytest.approx(4 + 25 / G0)
    assert float(found['specific_energy'][0]) == pytest.approx(500 * G0 + 1250)


def test_bank_about_the_air_of_a_circle_that_drifts() -> None:
    """A steady turn of 25 m/s and 40 deg in a wind of 8, -6 m/s: the air sees neither change."""
    omega = G0 * np.tan(np.radians(40)) / 25
    t = np.linspace(0, 2 * np.pi / omega, 40)
    wind = (np.full(t.size, 8.0), np.full(t.size, -6.0), np.full(t.size, 0.5))
    vel = (25 * np.cos(omega * t) + 8, 25 * np.sin(omega * t) - 6, 0 * t + 0.5)
    acc = (-25 * omega * np.sin(omega * t), 25 * omega * np.cos(omega * t), 0 * t)
    airspeed, bank = bank_about(vel, acc, None, wind)
    np.testing.assert_allclose(airspeed, 25.0)
    np.testing.assert_allclose(bank, np.radians(40))
    tiny = tuple(np.full(t.size, 1e-8) for _ in range(3))
    over_ground = flight_path(vel, acc, tiny, tiny, lat=None)['bank']
    assert np.ptp(over_ground) > np.radians(2)  # the ground does


def test_what_north_and_east_share_is_noise_along_a_diagonal() -> None:
    """North-east, of variances 1 and covariance 0.6: 1.6 along, 0.4 across."""
    variance = {'vel_var': three(1.0, 1.0, 1.0), 'acc_var': three(1.0, 1.0, 1.0)}
    found = angles(
        (30.0, 30.0, 0.0), (0.0, 0.0, 0.0), **variance, vel_covariance=0.6, acc_covariance=0.6
    )
    assert found['speed_std'] == pytest.approx(np.sqrt(1.6))
    assert found['track_std'] == pytest.approx(np.sqrt(0.4) / np.hypot(30.0, 30.0))
    assert found['bank_std'] == pytest.approx(np.sqrt(0.4) / G0)
