"""Reconstruction against motion whose answer is known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from flightdyn import frames
from flightdyn.environment.geodesy import GeodeticPoint, geodetic_from_ned
from flightdyn.errors import InputError
from flightdyn.logs.track import Track
from flightdyn.replay.flight_path import G0
from flightdyn.replay.reconstruct import VELOCITY_WANDER, reconstruct
from flightdyn.replay.report import Replay
from flightdyn.trajectory import Trajectory

Array = NDArray[np.float64]

START_NS = 1_532_865_178_000_000_000


def local_track(t: Array, position: Array, velocity: Array | None = None, **more: object) -> Track:
    columns: dict[str, object] = {
        'time_ns': START_NS + np.round(t * 1e9).astype(np.int64),
        'segment': np.zeros(t.size, np.int64),
        'position_ned': position,
        'velocity_ned': velocity,
    }
    return Track(**(columns | more))  # type: ignore[arg-type]


def geodetic_track(t: Array, lat: Array, lon: Array, altitude: Array, **more: object) -> Track:
    return Track(
        time_ns=START_NS + np.round(t * 1e9).astype(np.int64),
        segment=np.zeros(t.size, np.int64),
        lat=lat,
        lon=lon,
        altitude=altitude,
        **more,  # type: ignore[arg-type]
    )


def position_of(flown: Trajectory) -> Array:
    return np.stack([flown[name] for name in ('x_e', 'y_e', 'z_e')], axis=1)


def velocity_of(flown: Trajectory) -> Array:
    return np.stack([flown[name] for name in ('u_e', 'v_e', 'w_e')], axis=1)


def from_states(flown: Trajectory) -> Array:
    speed, gamma, track = flown['speed'], flown['gamma'], flown['track']
    return np.stack(
        (
            speed * np.cos(gamma) * np.cos(track),
            speed * np.cos(gamma) * np.sin(track),
            -speed * np.sin(gamma),
        ),
        axis=1,
    )


def assert_usable(flown: Trajectory) -> None:
    """A Trajectory refuses what is not finite; here the ranges."""
    assert (flown['track'] >= -np.pi).all()
    assert (flown['track'] < np.pi).all()
    assert (np.abs(flown['gamma']) <= np.pi / 2).all()
    for name in ('x_e', 'y_e', 'z_e', 'speed', 'gamma', 'track'):
        assert (flown[f'{name}_std'] > 0).all()


def bang_bang(t: Array, switches: list[float], accelerations: list[float]) -> tuple[Array, Array]:
    """Return position and velocity from rest under piecewise constant acceleration, exactly."""
    p, v = np.zeros_like(t), np.zeros_like(t)
    for start, end, a in zip(switches[:-1], switches[1:], accelerations, strict=True):
        on = np.clip(t - start, 0.0, end - start)
        after = np.clip(t - end, 0.0, None)
        p += a * on**2 / 2 + a * (end - start) * after
        v += a * on
    return p, v


@pytest.mark.parametrize('rate', [200, 500, 1000])
@pytest.mark.parametrize('hover', [0.0, 5.0])
def test_bang_bang_flip_is_replayed_at_every_sample(rate: int, hover: float) -> None:
    t = np.arange(-hover, 0.8 + hover, 1 / rate)
    x = bang_bang(t, [0.0, 0.4, 0.8], [20.0, -20.0])
    y = bang_bang(t, [0.0, 0.15, 0.45, 0.8], [-20.0, 20.0, -20.0])
    z = bang_bang(t, [0.0, 0.2, 0.6, 0.8], [-20.0, 20.0, -20.0])
    p, v = (np.stack((x[i], y[i], z[i]), axis=1) for i in range(2))
    flown = reconstruct(local_track(t - t[0], p, v))
    assert_usable(flown)
    assert np.abs(position_of(flown) - p).max() < 0.05
    assert np.abs(velocity_of(flown) - v).max() < 0.2
    assert np.abs(from_states(flown) - v).max() < 0.2


def test_bang_bang_flip_from_positions_alone() -> None:
    t = np.arange(0, 0.8, 1 / 200)
    x, v = bang_bang(t, [0.0, 0.4, 0.8], [20.0, -20.0])
    flown = reconstruct(local_track(t, np.stack((x, 0 * x, -x), axis=1)))
    assert np.abs(flown['x_e'] - x).max() < 0.05
    assert np.abs(flown['u_e'] - v).max() < 0.2


@pytest.mark.parametrize(('noise', 'bank_rms'), [(0.0, 0.5), (0.5, 3.0), (1.5, 5.0)])
def test_circling_glider_at_1_hz(noise: float, bank_rms: float) -> None:
    """Closed form of the steady turn: tan(bank) = V omega / g, n = 1 / cos(bank)."""
    rng = np.random.default_rng(1)
    omega, t = 2 * np.pi / 20, np.arange(900.0)
    v = G0 / omega  # tan(45 deg) = 1
    p = np.stack((v / omega * np.sin(omega * t), -v / omega * np.cos(omega * t), -2 * t), axis=1)
    flown = reconstruct(local_track(t, p + noise * rng.normal(size=p.shape)))
    assert_usable(flown)
    inner = slice(5, -5)
    bank_error = np.degrees(flown['bank'][inner]) - 45.0
    assert abs(bank_error.mean()) < 0.3
    assert np.sqrt(np.mean(bank_error**2)) < bank_rms
    assert np.median(flown['load_factor']) == pytest.approx(np.sqrt(2), rel=0.02)
    assert np.median(flown['speed']) == pytest.approx(np.hypot(v, 2), rel=0.01)
    assert np.median(flown['gamma']) == pytest.approx(np.arctan2(2, v), abs=2e-3)
    turned = np.diff(np.unwrap(flown['track'][inner]))
    assert np.median(turned) == pytest.approx(omega, rel=0.01)


def test_left_and_right_turns_have_opposite_bank() -> None:
    omega, t = 2 * np.pi / 30, np.arange(120.0)
    right = np.stack((100 * np.sin(omega * t), -100 * np.cos(omega * t), 0 * t), axis=1)
    flown = [reconstruct(local_track(t, right * side)) for side in ([1, 1, 1], [1, -1, 1])]
    assert (flown[0]['bank'][5:-5] > 0.1).all()
    np.testing.assert_allclose(flown[0]['bank'], -flown[1]['bank'], atol=1e-6)


def test_reported_sigmas_hold_for_simulated_noise() -> None:
    """Errors over their 1-sigma scatter by about one, for a motion the model can follow."""
    rng = np.random.default_rng(4)
    t = np.arange(0, 400, 0.2)
    omega = 2 * np.pi / 25
    p = np.stack((80 * np.sin(omega * t), 80 * np.cos(omega * t), 5 * np.sin(t / 10)), axis=1)
    v = np.gradient(p, t, axis=0)
    measured_p = p + [1.5, 1.5, 2.5] * rng.normal(size=p.shape)
    measured_v = v + [0.15, 0.15, 0.25] * rng.normal(size=p.shape)
    flown = reconstruct(local_track(t, measured_p, measured_v))
    speed = np.linalg.norm(v, axis=1)
    for name, truth in (
        ('x_e', p[:, 0]),
        ('z_e', p[:, 2]),
        ('speed', speed),
        ('gamma', np.arcsin(-v[:, 2] / speed)),
    ):
        ratio = (flown[name] - truth) / flown[f'{name}_std']
        assert 0.5 < np.sqrt(np.mean(ratio**2)) < 1.5, name
    assert np.sqrt(np.mean((flown['speed'] - speed) ** 2)) < 0.15 * 0.7


def test_great_circle_keeps_local_angles_300_km_from_the_origin() -> None:
    """Due north at constant height: level, north and just under 1 g wherever the origin is."""
    t = np.arange(0.0, 1200.0, 2.0)
    # Meridian arc of WGS84: integrate dlat = V dt / (M + h).
    a, e2, height, speed = 6378137.0, 6.69437999014e-3, 3000.0, 250.0
    lat = np.empty_like(t)
    lat[0] = np.radians(47.0)
    for k in range(1, t.size):

        def rate(x: float) -> float:
            return speed / (a * (1 - e2) / (1 - e2 * np.sin(x) ** 2) ** 1.5 + height)

        half = lat[k - 1] + rate(lat[k - 1])  # midpoint rule: 1 s of a 2 s step
        lat[k] = lat[k - 1] + 2 * rate(half)
    measured = np.tile([speed, 0.0, 0.0], (t.size, 1))
    track = geodetic_track(
        t, np.degrees(lat), np.full(t.size, 8.0), np.full(t.size, height), velocity_ned=measured
    )
    flown = reconstruct(track)
    assert flown.origin == GeodeticPoint(47.0, 8.0, height)
    assert flown['x_e'][-1] == pytest.approx(299.4e3, rel=0.01)
    assert flown['z_e'][-1] > 6000  # the tangent plane rises above the earth
    np.testing.assert_allclose(velocity_of(flown), measured, atol=0.02)
    np.testing.assert_allclose(flown['gamma'], 0.0, atol=1e-4)
    np.testing.assert_allclose(flown['track'], 0.0, atol=1e-4)
    np.testing.assert_allclose(flown['altitude'], height, atol=0.05)
    np.testing.assert_allclose(flown['lat'], np.degrees(lat), atol=1e-6)
    centripetal = speed**2 / 6.37e6 / G0
    np.testing.assert_allclose(flown['load_factor'][5:-5], 1 - centripetal, atol=1e-3)


def test_velocity_is_turned_into_the_origins_plane_east_of_it() -> None:
    """4 degrees of longitude away, north there is not north here: a hand-worked turn.

    At latitude 60 meridians converge by 4 deg sin(60 deg) = 3.46 deg.
    """
    t = np.arange(20.0)
    here = GeodeticPoint(60.0, 10.0, 0.0)
    lon = np.full(t.size, 14.0)
    lat = 60.0 + 100.0 * t / 111_412.0  # metres per degree of latitude at 60 deg, WGS84
    measured = np.tile([100.0, 0.0, 0.0], (t.size, 1))
    track = geodetic_track(t, lat, lon, 0 * t, velocity_ned=measured)
    first = geodetic_track(np.array([-1.0]), np.array([60.0]), np.array([10.0]), np.array([0.0]))
    joined = Track(
        time_ns=np.concatenate((first.time_ns, track.time_ns)),
        segment=np.concatenate(([0], np.ones(t.size, np.int64))),
        lat=np.concatenate(([60.0], lat)),
        lon=np.concatenate(([10.0], lon)),
        altitude=np.zeros(t.size + 1),
        velocity_ned=np.vstack(([[0.0, 0.0, 0.0]], measured)),
    )
    flown = reconstruct(joined)
    assert flown.origin == here
    np.testing.assert_allclose(flown['track'][3:-2], 0.0, atol=1e-3)
    moved = np.arctan2(np.diff(flown['y_e'][1:]), np.diff(flown['x_e'][1:]))
    np.testing.assert_allclose(np.degrees(moved), -4 * np.sin(np.radians(60)), atol=0.05)


def test_a_local_track_needs_no_place_on_earth() -> None:
    t = np.arange(30.0)
    p = np.stack((10 * t, 5 * t, -t), axis=1)
    flown = reconstruct(local_track(t, p))
    assert flown.origin is None
    assert 'lat' not in flown
    assert 'altitude' not in flown
    assert flown.model == 'DynamicsPointMass3DSpeedGammaTrack'
    assert flown.start_ns == START_NS
    np.testing.assert_allclose(velocity_of(flown), np.tile([10.0, 5, -1], (30, 1)), atol=1e-3)
    np.testing.assert_allclose(flown['bank'], 0, atol=1e-3)
    # Lift across a climbing path carries only the weight's share across it.
    np.testing.assert_allclose(flown['load_factor'], np.cos(flown['gamma']), atol=1e-3)


def test_a_local_track_with_an_origin_has_lat_and_lon() -> None:
    origin, t = GeodeticPoint(50.0, 8.0, 300.0), np.arange(30.0)
    p = np.stack((10 * t, 5 * t, -t), axis=1)
    flown = reconstruct(local_track(t, p, origin=origin))
    lat, lon, altitude = geodetic_from_ned(*p.T, origin)
    np.testing.assert_allclose(flown['lat'], lat, atol=1e-8)
    np.testing.assert_allclose(flown['lon'], lon, atol=1e-8)
    np.testing.assert_allclose(flown['altitude'], altitude, atol=1e-2)


def test_at_rest_track_is_held_and_nothing_flickers() -> None:
    """A drive east, a stop, a drive north: the stop keeps pointing east, with no bank."""
    rng = np.random.default_rng(2)
    t = np.arange(120.0)
    east = np.where(t < 40, 15 * t, 600.0)
    north = np.where(t > 80, 15 * (t - 80), 0.0)
    p = np.stack((north, east, 0 * t), axis=1) + 0.05 * rng.normal(size=(120, 3))
    v = np.stack((np.where(t > 80, 15.0, 0.0), np.where(t < 40, 15.0, 0.0), 0 * t), axis=1)
    flown = reconstruct(local_track(t, p, v, velocity_std=np.full((120, 3), 0.3)))
    assert_usable(flown)
    parked = slice(50, 70)
    assert flown['speed'][parked].max() < 0.5
    assert np.ptp(flown['gamma'][parked]) < np.pi / 2
    assert (np.abs(flown['load_factor'][parked] - 1) < 0.1).all()
    still = flown['speed'] < flown['speed_std']
    np.testing.assert_array_equal(flown['bank'][still], 0.0)
    np.testing.assert_array_equal(flown['gamma'][still], 0.0)


def test_never_moving_points_north() -> None:
    t = np.arange(50.0)
    flown = reconstruct(local_track(t, np.ones((50, 3)), np.zeros((50, 3))))
    for name in ('gamma', 'track', 'bank'):
        np.testing.assert_array_equal(flown[name], 0.0)
    np.testing.assert_allclose(flown['load_factor'], 1.0, atol=1e-6)
    assert flown['track_std'].max() <= np.pi / np.sqrt(3)


def test_first_meaningful_track_holds_before_take_off() -> None:
    t = np.arange(0, 40, 0.1)
    run = np.clip(t - 20, 0, None)
    p = np.stack((0 * t, -(run**2), 0 * t), axis=1)
    v = np.stack((0 * t, -2 * run, 0 * t), axis=1)
    flown = reconstruct(local_track(t, p, v))
    np.testing.assert_allclose(flown['track'][:150], -np.pi / 2, atol=1e-3)


def test_vertical_climb_is_finite() -> None:
    t = np.arange(0, 20, 0.1)
    p = np.stack((0 * t, 0 * t, -5 * t), axis=1)
    v = np.tile([0.0, 0.0, -5.0], (t.size, 1))
    flown = reconstruct(local_track(t, p, v))
    assert_usable(flown)
    np.testing.assert_allclose(flown['gamma'], np.pi / 2, atol=1e-3)
    np.testing.assert_array_equal(flown['track'], 0.0)


def test_due_south_is_minus_pi() -> None:
    """arctan2 returns +pi for some zeros and -pi for others; the range is [-pi, pi)."""
    t = np.arange(20.0)
    p = np.stack((-10 * t, 0 * t, 0 * t), axis=1)
    for zero in (0.0, -0.0):
        flown = reconstruct(local_track(t, p, np.tile([-10.0, zero, 0.0], (20, 1))))
        assert_usable(flown)
        np.testing.assert_allclose(np.abs(flown['track']), np.pi, atol=1e-6)


@pytest.mark.parametrize('n', [1, 2])
@pytest.mark.parametrize('with_velocity', [False, True])
def test_tiny_segments_say_how_little_they_know(n: int, with_velocity: bool) -> None:
    t = np.arange(float(n))
    v = np.tile([20.0, 0.0, 0.0], (n, 1)) if with_velocity else None
    flown = reconstruct(local_track(t, np.stack((20 * t, 0 * t, 0 * t), axis=1), v))
    assert_usable(flown)
    assert len(flown) == n
    if with_velocity:
        np.testing.assert_allclose(flown['speed'], 20.0, atol=1e-3)
    else:
        assert flown['speed_std'].min() > 10.0


def test_segments_are_smoothed_one_by_one() -> None:
    """A jump of 10 km between segments leaves no trace on either side."""
    t = np.concatenate((np.arange(30.0), np.arange(100.0, 130.0), [200.0]))
    segment = np.repeat([0, 1, 2], [30, 30, 1])
    p = np.stack((20 * t, 1e4 * segment, 0 * t), axis=1)
    flown = reconstruct(local_track(t, p, segment=segment))
    assert flown.segment is not None
    np.testing.assert_array_equal(flown.segment, segment)
    np.testing.assert_allclose(flown['v_e'], 0.0, atol=1e-6)
    np.testing.assert_allclose(flown['u_e'][:60], 20.0, atol=1e-2)


def test_a_clock_set_back_starts_a_segment() -> None:
    t = np.concatenate((np.arange(10.0, 40.0), np.arange(5.0, 20.0)))
    segment = np.repeat([0, 1], [30, 15])
    flown = reconstruct(local_track(t, np.stack((t, t, t), axis=1), segment=segment))
    assert flown.time[0] == 0.0
    assert flown.time[30] == -5.0


def test_samples_at_one_time_are_averaged() -> None:
    t = np.repeat(np.arange(30.0), 2)
    p = np.stack((10 * t, 0 * t, 0 * t), axis=1)
    p[::2, 1], p[1::2, 1] = 1.0, -1.0
    flown = reconstruct(local_track(t, p))
    assert len(flown) == 30
    np.testing.assert_allclose(flown['y_e'], 0.0, atol=1e-6)
    np.testing.assert_array_equal(flown.time, np.arange(30.0))


def test_repeats_are_averaged_across_the_date_line() -> None:
    t = np.array([0.0, 0.0, 1.0, 2.0])
    lon = np.array([179.9999, -179.9999, -179.999, -179.998])
    flown = reconstruct(geodetic_track(t, np.zeros(4), lon, np.zeros(4)))
    assert flown.origin is not None
    assert abs(flown.origin.lon) == pytest.approx(180.0)
    assert flown['speed'].max() < 1e3


def test_velocity_may_come_and_go() -> None:
    t = np.arange(0, 60, 0.5)
    p = np.stack((20 * t, 3 * np.sin(t / 5), 0 * t), axis=1)
    v = np.stack((20 + 0 * t, 0.6 * np.cos(t / 5), 0 * t), axis=1)
    v[1::3] = np.nan
    v[40:60] = np.nan
    flown = reconstruct(local_track(t, p, v))
    np.testing.assert_allclose(flown['u_e'], 20.0, atol=0.05)


def test_missing_heights_are_bridged() -> None:
    t = np.arange(60.0)
    altitude = 1000.0 + t
    altitude[20:30] = np.nan
    flown = reconstruct(geodetic_track(t, 50 + t * 1e-4, 8 + 0 * t, altitude))
    np.testing.assert_allclose(flown['altitude'], 1000 + t, atol=0.5)
    flat = reconstruct(geodetic_track(t, 50 + t * 1e-4, 8 + 0 * t, np.full(60, np.nan)))
    np.testing.assert_allclose(flat['altitude'], 0, atol=0.1)


def test_given_noise_is_used() -> None:
    rng = np.random.default_rng(0)
    t = np.arange(100.0)
    p = np.stack((20 * t, 0 * t, 0 * t), axis=1) + rng.normal(size=(100, 3))
    stiff = reconstruct(local_track(t, p), position_std=1.0, jerk_density=1e-6)
    loose = reconstruct(local_track(t, p), position_std=[0.01, 0.01, 0.01], jerk_density=100.0)
    assert np.std(stiff['speed']) < 0.1 < np.std(loose['speed'])
    for bad in (0.0, -1.0, [1.0, 2.0], float('nan')):
        with pytest.raises(InputError, match='position_std'):
            reconstruct(local_track(t, p), position_std=bad)


def test_a_common_error_that_the_log_reports_is_not_smoothed_away() -> None:
    """A receiver 5 m off all the time says 5 m; its scatter of 0.1 m must not hide that."""
    rng = np.random.default_rng(0)
    t = np.arange(300.0)
    p = np.stack((20 * t, 30 * np.sin(t / 8), 0 * t), axis=1) + 0.1 * rng.normal(size=(300, 3))
    flown = reconstruct(local_track(t, p, position_std=np.full((300, 3), 5.0)))
    assert flown['x_e_std'].min() > 4.9
    assert flown['speed_std'][5:-5].max() < 0.5  # the common error does not move
    assert np.abs(flown['x_e'] - 20 * t).max() < 0.5


def test_one_huge_sigma_takes_a_sample_out() -> None:
    t = np.arange(100.0)
    p = np.stack((20 * t, 0 * t, 0 * t), axis=1)
    rng = np.random.default_rng(0)
    p += 0.5 * rng.normal(size=p.shape)
    std = np.full((100, 3), 0.5)
    p[50], std[50] = [0.0, 500.0, 0.0], 1e4
    std[10] = np.nan  # unknown: as the others
    flown = reconstruct(local_track(t, p, position_std=std))
    assert abs(flown['y_e'][50]) < 2.0


def test_measured_attitude_is_passed_on_but_bank_comes_from_motion() -> None:
    t = np.arange(50.0)
    p = np.stack((20 * t, 0 * t, 0 * t), axis=1)
    q = np.array(frames.quaternion_from_euler(0.3, -0.2, 1.1), float)
    flown = reconstruct(local_track(t, p, attitude=np.tile(2 * q, (50, 1))))
    for name, value in (('phi', 0.3), ('theta', -0.2), ('psi', 1.1)):
        np.testing.assert_allclose(flown[name], value, atol=1e-12)
    np.testing.assert_allclose(flown['bank'], 0.0, atol=1e-3)


def test_an_attitude_that_some_samples_lack_is_used() -> None:
    """One blank used to drop all."""
    t = np.arange(50.0)
    p = np.stack((20 * t, 0 * t, 0 * t), axis=1)
    roll = 0.02 * t
    q = np.stack(frames.quaternion_from_euler(roll, 0 * t, 0 * t), axis=1)
    q[[0, 7, 20, 49]] = np.nan
    q[30] = 0.0
    q[31] *= -1  # the same attitude
    track = local_track(t, p, attitude=q)
    flown = reconstruct(track)
    # Samples are 1 s apart, and it rolls by 0.02 rad from one to the next.
    np.testing.assert_allclose(flown['phi'], roll, atol=0.0201)
    blank = [0, 7, 20, 30, 49]
    measured = np.delete(roll, blank)
    np.testing.assert_allclose(np.delete(flown['phi'], blank), measured, atol=1e-12)
    told = Replay(track, flown).summary()['warnings']
    assert '5 samples had no attitude: taken from those near by' in told
    q[::2] = np.nan
    assert 'phi' not in reconstruct(local_track(t, p, attitude=q))


@settings(derandomize=True, deadline=None, max_examples=25)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(1, 40),
    scale=st.sampled_from([0.0, 1e-6, 1.0, 1e4]),
    with_velocity=st.booleans(),
    repeats=st.booleans(),
)
def test_any_track_gives_a_usable_trajectory(
    seed: int, n: int, scale: float, with_velocity: bool, repeats: bool
) -> None:
    rng = np.random.default_rng(seed)
    steps = 10 ** rng.uniform(-3, 1.7, n)
    if repeats:
        steps[rng.random(n) < 0.3] = 0.0
    t = np.cumsum(steps)
    segment = np.sort(rng.integers(0, 4, n))
    velocity = scale * rng.normal(size=(n, 3)) if with_velocity else None
    if velocity is not None:
        velocity[rng.random(n) < 0.3] = np.nan
    track = local_track(t, scale * rng.normal(size=(n, 3)), velocity, segment=segment)
    assert_usable(reconstruct(track))


@settings(derandomize=True, deadline=None, max_examples=10)
@given(turn=st.floats(-np.pi, np.pi), shift=st.floats(-1e4, 1e4))
def test_turning_and_moving_the_ground_turns_and_moves_the_flight(
    turn: float, shift: float
) -> None:
    t = np.arange(60.0)
    p = np.stack((25 * t, 80 * np.sin(t / 6), -30 * np.cos(t / 9)), axis=1)
    c, s = np.cos(turn), np.sin(turn)
    turned = np.stack((c * p[:, 0] - s * p[:, 1], s * p[:, 0] + c * p[:, 1], p[:, 2]), axis=1)
    known = {'position_std': 0.5, 'jerk_density': 2.0}
    a = reconstruct(local_track(t, p), **known)
    b = reconstruct(local_track(t, turned + shift), **known)
    for name in ('speed', 'gamma', 'bank', 'load_factor'):
        np.testing.assert_allclose(a[name], b[name], atol=1e-6)
    difference = (b['track'] - a['track'] - turn + np.pi) % (2 * np.pi) - np.pi
    np.testing.assert_allclose(difference, 0.0, atol=1e-6)


def wandering(t: Array, rng: np.random.Generator) -> Array:
    """Return a smooth error of positions (n, 3) [m], whose rate is 0.15 m/s over some 5 s."""
    step = float(t[1] - t[0])
    slow = np.exp(-step / 5.0)
    rate = np.zeros((t.size, 3))
    for k in range(1, t.size):
        rate[k] = slow * rate[k - 1] + 0.15 * np.sqrt(1 - slow**2) * rng.normal(size=3)
    return np.cumsum(rate * step, axis=0)


def test_a_measured_velocity_outweighs_positions_that_wander() -> None:
    """Smooth positions once were taken as exact to a millimetre, and the velocity as noisy."""
    rng = np.random.default_rng(0)
    t = np.arange(0, 120, 0.2)
    true = np.stack((5 * np.sin(t / 4), 5 * np.cos(t / 4), 0.5 * np.sin(t / 7)), axis=1)
    place = np.stack((-20 * np.cos(t / 4), 20 * np.sin(t / 4), -3.5 * np.cos(t / 7)), axis=1)
    place = place + wandering(t, rng)
    lat, lon, altitude = geodetic_from_ned(*place.T, GeodeticPoint(47.0, 8.0, 500.0))
    measured = true + 0.1 * rng.normal(size=true.shape)
    flown = reconstruct(geodetic_track(t, lat, lon, altitude, velocity_ned=measured))
    error = velocity_of(flown) - true
    # The velocity's own noise is 0.1 m/s; who follows the positions is off by 0.15 and more.
    assert np.sqrt(np.mean(error**2)) < 0.12


def test_the_velocity_of_fixes_is_never_stated_better_than_they_wander() -> None:
    t = np.arange(0.0, 600.0)
    lat = 47.0 + 50.0 / 111_170 * t  # 50 m/s north, exactly
    track = geodetic_track(t, lat, np.full(t.size, 8.0), np.full(t.size, 1000.0))
    flown = reconstruct(track)
    assert (flown['speed_std'] >= VELOCITY_WANDER[0]).all()
    assert np.median(flown['gamma_std']) == pytest.approx(VELOCITY_WANDER[2] / 50, rel=0.2)
    with_velocity = geodetic_track(
        t, lat, track.lon, track.altitude, velocity_ned=np.tile([50.0, 0.0, 0.0], (t.size, 1))
    )
    assert np.median(reconstruct(with_velocity)['speed_std']) < VELOCITY_WANDER[0]


def test_a_loop_and_vertical_lines_are_finite_and_right() -> None:
    """An aerobatic box at 10 Hz: pull to the vertical, up, a loop of 4 g, and down again."""
    t = np.arange(0.0, 24.0, 0.01)
    speed, rate = 40.0, 1.0
    # Level, quarter loop, vertical, full loop from the vertical, quarter loop to level inverted.
    turning = ((t > 3) & (t <= 3 + np.pi / 2)) | ((t > 8) & (t <= 8 + 2 * np.pi))
    pitch = np.cumsum(np.where(turning, rate, 0.0)) * 0.01
    v = speed * np.stack((np.cos(pitch), 0 * t, -np.sin(pitch)), axis=1)
    p = np.cumsum(v, axis=0) * 0.01
    noise = 0.05 * np.random.default_rng(0).normal(size=p.shape)
    flown = reconstruct(local_track(t[::10], (p + noise)[::10]))
    assert_usable(flown)
    for values in flown.columns.values():
        assert np.isfinite(values).all()
    inner = slice(5, -5)
    up = np.degrees(flown['gamma'][inner])
    gamma = np.degrees(np.arcsin(np.sin(pitch[::10])))[inner]
    # 5 cm at 10 Hz, smoothed over half a second: 0.1 m/s of 40, and the corners of the loops.
    assert np.percentile(np.abs(up - gamma), 90) < 3.0
    assert up.max() > 87
    assert up.min() < -87
    steady = (t[::10] > 9.5) & (t[::10] < 13)
    lift = np.abs(speed * rate + 9.80665 * np.cos(pitch[::10]))
    error = (flown['load_factor'] - lift / 9.80665)[steady]
    assert np.sqrt(np.mean(error**2)) < 0.5
