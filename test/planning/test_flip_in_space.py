"""The planar flip in three dimensions: two rotors as two pairs, pitch by a quaternion."""

from pathlib import Path

import numpy as np
import pytest

from flightdyn.errors import InputError
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem_file import load_problem

VEHICLE = """
description: The planar quadcopter with its rotors of 1 N as pairs of 0.5 N
model: DynamicsRigidBody3DBodyQuaternion
mass: 0.1
inertia: {Ixx: 0.0005, Iyy: 0.0005, Izz: 0.001}
rotors:
  front_right: {position: [0.05, 0.05, 0], direction: [0, 0, -1], thrust: [0, 0.5], torque: 0.02}
  rear_right: {position: [-0.05, 0.05, 0], direction: [0, 0, -1], thrust: [0, 0.5], torque: -0.02}
  rear_left: {position: [-0.05, -0.05, 0], direction: [0, 0, -1], thrust: [0, 0.5], torque: 0.02}
  front_left: {position: [0.05, -0.05, 0], direction: [0, 0, -1], thrust: [0, 0.5], torque: -0.02}
"""
PROBLEM = """
vehicle: pairs
duration: {lower: 0.1, upper: 10, guess: 1}
initial:
  {x_e: 0, y_e: 0, z_e: 0, u_b: 0, v_b: 0, w_b: 0, qw: 1, qx: 0, qy: 0, qz: 0, p: 0, q: 0, r: 0}
final:
  {x_e: 1, y_e: 0, z_e: 0, u_b: 0, v_b: 0, w_b: 0, qw: [null, 0], qx: 0, qy: 0, qz: 0,
   p: 0, q: 0, r: 0}
path: {qw: [-1.05, 1.05], qx: [-1.05, 1.05], qy: [-1.05, 1.05], qz: [-1.05, 1.05]}
guess: {qw: [1, 0, -1], qy: [0, -1, 0], q: [0, -8, 0]}
nodes: 40
transcription: radau
sharpen: false
"""


def test_it_takes_as_long_as_in_the_plane(tmp_path: Path) -> None:
    (tmp_path / 'vehicles').mkdir()
    (tmp_path / 'vehicles' / 'pairs.yaml').write_text(VEHICLE)
    (tmp_path / 'flip.yaml').write_text(PROBLEM)
    plan = Planner().plan(load_problem(str(tmp_path / 'flip.yaml'), config_dir=tmp_path))
    assert plan.report.verified, plan.report.message
    # the optimum by its switching times is 0.8240737 s. Controls held over 40 intervals of 20 ms
    # cannot switch at any time: not below it, and one interval of the few that switch above
    assert 0.8240 < plan.report.final_time < 0.8240 + 0.02 / 4
    flight = plan.trajectory
    # it stays in the plane, though nothing asks for it
    for name in ('y_e', 'v_b', 'qx', 'qz', 'p', 'r'):
        assert np.abs(flight[name]).max() < 1e-3, name
    turned = np.sum(0.5 * (flight['q'][1:] + flight['q'][:-1]) * np.diff(flight.time))
    assert turned == pytest.approx(-2 * np.pi, abs=0.01)


def test_an_end_that_fixes_the_whole_quaternion_is_refused(tmp_path: Path) -> None:
    """IPOPT found no way to it: one condition too many, that holds by itself."""
    (tmp_path / 'vehicles').mkdir()
    (tmp_path / 'vehicles' / 'pairs.yaml').write_text(VEHICLE)
    (tmp_path / 'flip.yaml').write_text(PROBLEM.replace('qw: [null, 0]', 'qw: -1'))
    with pytest.raises(InputError, match=r'final: fixes all of qw, qx, qy, qz.*fix three'):
        load_problem(str(tmp_path / 'flip.yaml'), config_dir=tmp_path)
