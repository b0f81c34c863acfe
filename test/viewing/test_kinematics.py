"""Position, attitude and velocity from every kind of trajectory, worked by hand."""

import numpy as np
import pytest

from flightdyn import frames
from flightdyn.environment.geodesy import GeodeticPoint
from flightdyn.trajectory import Trajectory
from flightdyn.viewing.kinematics import lat_lon_of, motion_of, pose_at, thinned

TIGHT = {'atol': 1e-12}  # a handful of roundings of numbers near 1


def one(**columns):
    """Return a trajectory of two equal samples."""
    states = {name: np.full(2, float(value)) for name, value in columns.items()}
    return Trajectory(time=np.array([0.0, 1.0]), states=states)


def axes_of(trajectory):
    """Return nose, right wing and belly in earth axes."""
    motion = motion_of(trajectory)
    r_eb = frames.rotation_from_quaternion(tuple(motion.attitude[0]))
    return [np.array([float(row[i]) for row in r_eb]) for i in range(3)]


def test_pitching_up_raises_the_nose():
    nose, wing, belly = axes_of(one(x_e=0, z_e=0, theta=np.pi / 6))
    np.testing.assert_allclose(nose, (np.sqrt(3) / 2, 0, -0.5), **TIGHT)  # down is positive
    np.testing.assert_allclose(wing, (0, 1, 0), **TIGHT)
    np.testing.assert_allclose(belly, (0.5, 0, np.sqrt(3) / 2), **TIGHT)


def test_rolling_right_lowers_the_right_wing_and_yaw_points_east():
    nose, wing, _ = axes_of(one(phi=np.pi / 2, theta=0, psi=np.pi / 2))
    np.testing.assert_allclose(nose, (0, 1, 0), **TIGHT)
    np.testing.assert_allclose(wing, (0, 0, 1), **TIGHT)


def test_point_mass_points_along_track_and_gamma_plus_alpha():
    nose, wing, _ = axes_of(one(speed=20, gamma=np.radians(20), track=np.pi / 2, alpha=10))
    np.testing.assert_allclose(nose, (0, np.sqrt(3) / 2, -0.5), **TIGHT)
    np.testing.assert_allclose(wing, (-1, 0, 0), **TIGHT)


def test_point_mass_banked_right_pitches_its_nose_into_the_turn():
    nose, wing, _ = axes_of(one(speed=20, gamma=0, track=0, bank=np.pi / 2, alpha=30))
    np.testing.assert_allclose(wing, (0, 0, 1), **TIGHT)
    np.testing.assert_allclose(nose, (np.sqrt(3) / 2, 0.5, 0), **TIGHT)  # east of north


def test_wind_in_the_right_ear_turns_the_nose_left():
    nose, *_ = axes_of(one(speed=20, gamma=0, track=0, beta=30))
    np.testing.assert_allclose(nose, (np.sqrt(3) / 2, -0.5, 0), **TIGHT)


def test_velocity_of_each_kind():
    body = motion_of(one(u_b=3, w_b=4, theta=np.pi / 2))
    np.testing.assert_allclose(body.velocity[0], (4, 0, -3), **TIGHT)
    np.testing.assert_allclose(body.velocity_body[0], (3, 0, 4), **TIGHT)
    assert body.speed[0] == pytest.approx(5)
    wind = motion_of(one(speed=10, gamma=np.radians(30), track=np.pi / 2))
    np.testing.assert_allclose(wind.velocity[0], (0, 10 * np.sqrt(3) / 2, -5), **TIGHT)
    earth = motion_of(one(x_e=0, z_e=0, u_e=3, w_e=-4))
    np.testing.assert_allclose(earth.velocity[0], (3, 0, -4), **TIGHT)
    nose, *_ = axes_of(one(x_e=0, z_e=0, u_e=3, w_e=-4))
    np.testing.assert_allclose(nose, (0.6, 0, -0.8), **TIGHT)


def test_vertical_rocket_points_up_and_a_stopped_one_keeps_its_attitude():
    t = np.linspace(0, 2, 5)
    states = {'z_e': -t, 'w_e': np.array([0.0, -10.0, -10.0, -10.0, 0.0])}
    motion = motion_of(Trajectory(time=t, states=states))
    for q_eb in motion.attitude:
        r_eb = frames.rotation_from_quaternion(tuple(q_eb))
        assert float(r_eb[2][0]) == pytest.approx(-1)


def test_velocity_from_positions_never_reaches_across_a_gap():
    t = np.array([0.0, 1.0, 2.0, 100.0, 101.0, 102.0])
    x = np.array([0.0, 1.0, 2.0, 5000.0, 5001.0, 5002.0])
    flight = Trajectory(time=t, states={'x_e': x}, segment=np.array([0, 0, 0, 1, 1, 1]))
    motion = motion_of(flight)
    np.testing.assert_allclose(motion.velocity[:, 0], 1.0, **TIGHT)
    assert motion.arc_length[-1] == pytest.approx(4.0)
    _, _, known = pose_at(motion, np.array([-1.0, 1.5, 50.0, 101.0, 103.0]))
    assert known.tolist() == [False, True, False, True, False]


def test_between_samples_a_parabola_and_a_turn_are_met():
    t = np.array([0.0, 0.5, 1.0])
    flight = Trajectory(
        time=t,
        states={'x_e': 3 * t, 'z_e': 4.905 * t**2, 'u_e': 3 + 0 * t, 'w_e': 9.81 * t,
                'theta': -2.0 * t},
    )  # fmt: skip
    position, attitude, known = pose_at(motion_of(flight), np.array([0.1, 0.75, 1.0]))
    assert known.all()
    np.testing.assert_allclose(position[:, 2], 4.905 * np.array([0.01, 0.5625, 1.0]), **TIGHT)
    expected = frames.quaternion_from_euler(0.0, -1.5, 0.0)
    assert abs(attitude[1] @ np.array(expected)) == pytest.approx(1, abs=1e-9)


def test_positions_relative_to_another_origin():
    here, there = GeodeticPoint(47.0, 8.0, 400.0), GeodeticPoint(47.01, 8.0, 400.0)
    plan = Trajectory(
        time=np.array([0.0, 1.0]), states={'x_e': np.zeros(2), 'z_e': np.zeros(2)}, origin=there
    )
    north = motion_of(plan, origin=here).position[0, 0]
    assert north == pytest.approx(1111.8, abs=1.0)  # 0.01 deg of the meridian at 47 deg north
    np.testing.assert_allclose(lat_lon_of(plan)[0], (47.01, 8.0), atol=1e-9)


def test_thinning_keeps_peaks_and_gaps():
    n = 1000
    x = np.arange(n) * 1.0
    spike = np.zeros(n)
    spike[777], spike[333] = 50.0, -50.0
    flight = Trajectory(
        time=x, states={'x_e': x}, controls={'thrust': spike}, segment=(x > 501).astype(int)
    )
    thin = thinned(flight, 100)
    assert len(thin) <= 110
    assert (thin['thrust'].min(), thin['thrust'].max()) == (-50.0, 50.0)
    assert {0.0, 501.0, 502.0, 999.0} <= set(thin.time)
    assert thinned(flight, n) is flight
