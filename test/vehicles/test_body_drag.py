"""Drag along body axes, by hand."""

from pathlib import Path

import numpy as np
import pytest
from vehicle_making import evaluated, vehicle_of

from flightdyn.errors import InputError

BRICK = """
model: DynamicsRigidBody3DBodyQuaternion
mass: 2
inertia: {Ixx: 1, Iyy: 1, Izz: 1}
gravity: 0
aerodynamics: {kind: body_drag, linear: [0.4, 0.3, 0], areas: [0, 0, 0.05]}
"""


def test_drag_is_along_body_axes_against_the_air(tmp_path: Path) -> None:
    stage = vehicle_of(tmp_path, BRICK).model().stage()
    # heading east (yaw by 90 degrees): wind from the north is from the left
    half = float(np.sqrt(0.5))
    rates, outputs = evaluated(
        stage, wind=(-6.0, 0.0, 0.0), qw=half, qz=half, u_b=3.0, v_b=1.0, w_b=-2.0
    )
    # through the air: 3 forward, 1 - 6 to the right (north is left), 2 up
    airspeed = np.sqrt(3**2 + 5**2 + 2**2)
    up = 0.5 * 1.225 * airspeed * 0.05 * 2
    assert rates['u_b'] == pytest.approx(-0.4 * 3 / 2)
    assert rates['v_b'] == pytest.approx(0.3 * 5 / 2)
    assert rates['w_b'] == pytest.approx(up / 2, rel=1e-4)  # density at sea level to four digits
    assert outputs['drag'] == pytest.approx(np.sqrt(1.2**2 + 1.5**2 + up**2), rel=1e-4)


def test_point_masses_have_it_too(tmp_path: Path) -> None:
    text = BRICK.replace('RigidBody3DBodyQuaternion', 'PointMass3DCartesian')
    stage = vehicle_of(tmp_path, text).model().stage()
    # body axes point along the velocity through the air
    rates, _ = evaluated(stage, u_e=0.0, v_e=5.0)
    assert rates['v_e'] == pytest.approx(-0.4 * 5 / 2)
    assert rates['u_e'] == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize(
    ('given', 'told'),
    [
        ('{kind: body_drag}', "give 'linear', 'areas' or both"),
        ('{kind: body_drag, linear: [1, -1, 0]}', 'must not be negative'),
        ('{kind: body_drag, linear: 1}', r'expected \[x, y, z\]'),
        ('{kind: body_drag, area: 1}', "unknown 'area'"),
    ],
)
def test_bad_ones_are_refused(tmp_path: Path, given: str, told: str) -> None:
    text = BRICK.split('aerodynamics')[0] + f'aerodynamics: {given}\n'
    with pytest.raises(InputError, match=told):
        vehicle_of(tmp_path, text)
