"""Hand-worked frame conversions, all axes unequal; round trips alone would hide twin mistakes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation as SciPyRotation

from flightdyn import frames

ANGLE = st.floats(-3.1, 3.1)
PITCH = st.floats(-1.5, 1.5)


def test_ned_to_enu_of_one_two_three() -> None:
    assert frames.enu_from_ned((1, 2, 3)) == (2, 1, -3)


def test_frd_to_flu_of_one_two_three() -> None:
    assert frames.flu_from_frd((1, 2, 3)) == (1, -2, -3)


def test_nose_up_lifts_the_nose() -> None:
    north, east, down = frames.rotate(frames.rotation_from_euler(0, np.radians(30), 0), (1, 0, 0))
    assert (north, east, down) == pytest.approx((np.sqrt(3) / 2, 0, -0.5))


def test_yaw_right_turns_the_nose_east() -> None:
    nose = frames.rotate(frames.rotation_from_euler(0, 0, np.pi / 2), (1, 0, 0))
    assert nose == pytest.approx((0, 1, 0))


def test_roll_right_lowers_the_right_wing() -> None:
    wing = frames.rotate(frames.rotation_from_euler(np.radians(30), 0, 0), (0, 1, 0))
    assert wing == pytest.approx((0, np.sqrt(3) / 2, 0.5))


def test_positive_alpha_has_the_wind_from_below() -> None:
    # flying along x_s with 30 degrees alpha: the velocity has a component out of the belly
    forward = frames.rotate(frames.rotation_body_stability(np.radians(30)), (1, 0, 0))
    assert forward == pytest.approx((np.sqrt(3) / 2, 0, 0.5))


def test_positive_beta_has_the_wind_in_the_right_ear() -> None:
    forward = frames.rotate(frames.rotation_stability_wind(np.radians(30)), (1, 0, 0))
    assert forward == pytest.approx((np.sqrt(3) / 2, 0.5, 0))


def test_heading_east_is_ros_yaw_zero() -> None:
    q = frames.ros_attitude_from_ned(frames.quaternion_from_euler(0, 0, np.pi / 2))
    assert np.abs(q) == pytest.approx((1, 0, 0, 0), abs=1e-12)


def test_heading_north_nose_up_is_ros_yaw_ninety_pitch_negative() -> None:
    # ROS pitch is about the left axis, so that nose up is negative
    q = frames.ros_attitude_from_ned(frames.quaternion_from_euler(0, np.radians(20), 0))
    yaw, pitch, roll = SciPyRotation.from_quat(np.roll(q, -1)).as_euler('ZYX')
    assert (yaw, pitch, roll) == pytest.approx((np.pi / 2, np.radians(-20), 0), abs=1e-12)


@given(ANGLE, PITCH, ANGLE)
def test_euler_quaternion_and_rotation_agree_with_scipy(
    phi: float, theta: float, psi: float
) -> None:
    expected = SciPyRotation.from_euler('ZYX', [psi, theta, phi]).as_matrix()
    np.testing.assert_allclose(frames.rotation_from_euler(phi, theta, psi), expected, atol=1e-12)
    q = frames.quaternion_from_euler(phi, theta, psi)
    np.testing.assert_allclose(frames.rotation_from_quaternion(q), expected, atol=1e-12)
    assert frames.euler_from_rotation(frames.rotation_from_quaternion(q)) == pytest.approx(
        (phi, theta, psi), abs=1e-9
    )


@given(ANGLE, PITCH, ANGLE)
def test_ros_attitude_round_trip(phi: float, theta: float, psi: float) -> None:
    q = frames.quaternion_from_euler(phi, theta, psi)
    back = frames.ned_attitude_from_ros(frames.ros_attitude_from_ned(q))
    assert abs(np.dot(q, back)) == pytest.approx(1)
