"""The parametric polar, its parts, ground effect and moments: closed forms."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from vehicle_making import check_first_derivatives, derivatives, evaluated, vehicle_of

from flightdyn.vehicles.aero_polar import Stall
from flightdyn.vehicles.aerodynamics import GroundEffect

RHO = 1.225  # kg/m^3 at sea level, to 1e-5

GLIDER = """
model: DynamicsPointMass2DSpeedGamma
mass: 300
controls: {alpha: [-10 deg, 20 deg], flaps: [0, 1]}
aerodynamics:
  kind: polar
  area: 10
  span: 15
  CL0: 0.3
  CL_alpha: 5.5
  CD0: 0.012
  k: 0.018
  CL_min_drag: 0.2
"""
STALL = '  stall: {alpha: [-14 deg, 15 deg], width: 2 deg, CD90: 1.8}\n'


def test_lift_and_drag_follow_the_polar(tmp_path: Path) -> None:
    stage = vehicle_of(tmp_path, GLIDER.replace(', flaps: [0, 1]', '')).model().stage()
    rates, air = evaluated(stage, speed=30.0, gamma=-0.03, alpha=4.0)
    lift = 0.3 + 5.5 * np.radians(4)
    assert air['CL'] == pytest.approx(lift)
    assert air['CD'] == pytest.approx(0.012 + 0.018 * (lift - 0.2) ** 2)
    force = 0.5 * RHO * 30**2 * 10
    assert air['lift'] == pytest.approx(force * lift, rel=1e-5)
    expected = -air['drag'] / 300 - 9.81 * np.sin(-0.03)
    assert rates['speed'] == pytest.approx(expected)


def test_a_stalled_wing_is_a_plate(tmp_path: Path) -> None:
    text = GLIDER.replace(', flaps: [0, 1]', '') + STALL
    stage = vehicle_of(tmp_path, text).model().stage()
    for alpha in (45.0, 90.0, -60.0):  # 15 widths from the stall nothing is left of attached flow
        _, air = evaluated(stage, speed=30.0, alpha=alpha)
        sine, cosine = np.sin(np.radians(alpha)), np.cos(np.radians(alpha))
        assert air['CL'] == pytest.approx(1.8 * sine * cosine, abs=1e-6)
        assert air['CD'] == pytest.approx(0.012 + 1.8 * sine**2, rel=1e-6)
    # well inside of it the stall is not felt: tanh(12/2) is 1 - 1.2e-5
    _, air = evaluated(stage, speed=30.0, alpha=3.0)
    assert air['CL'] == pytest.approx(0.3 + 5.5 * np.radians(3), rel=1e-4)
    _, half = evaluated(stage, speed=30.0, alpha=15.0)
    plate = 1.8 * np.sin(np.radians(15)) * np.cos(np.radians(15))
    assert half['CL'] == pytest.approx((0.3 + 5.5 * np.radians(15) + plate) / 2, rel=1e-6)


@given(st.floats(-180, 180))
def test_flow_is_attached_by_a_part(alpha: float) -> None:
    assert 0 <= Stall(alpha=(-14, 15), width=2, CD90=1.8).attached(alpha) <= 1


def test_parts_add_their_drag_as_controls_move_them(tmp_path: Path) -> None:
    text = (
        GLIDER
        + """
  increments:
    gear: {drag_area: 0.2}
    flaps: {CL: 0.6, CD: 0.04, control: flaps}
"""
    )
    stage = vehicle_of(tmp_path, text).model().stage()
    assert stage.controls == ('alpha', 'flaps')
    _, up = evaluated(stage, speed=30.0, alpha=2.0)
    _, half = evaluated(stage, speed=30.0, alpha=2.0, flaps=0.5)
    lift = 0.3 + 5.5 * np.radians(2)
    assert up['CD'] == pytest.approx(0.012 + 0.018 * (lift - 0.2) ** 2 + 0.2 / 10)
    assert half['CL'] - up['CL'] == pytest.approx(0.3)
    assert half['CD'] - up['CD'] == pytest.approx(0.02)


def test_ground_effect_has_its_limits() -> None:
    effect = GroundEffect(span=16.0, efficiency=0.8, height=1.0, elevation=100.0)
    assert effect.factor(99.0) == 0.0
    assert effect.factor(1e6) == pytest.approx(1.0)
    assert effect.factor(100.0) == pytest.approx(0.5)  # a height of span/16
    # a wing half its span above the ground has 1.5 % less induced drag: 64/65
    assert effect.factor(107.0) == pytest.approx(64 / 65)


def test_ground_effect_takes_induced_drag_alone(tmp_path: Path) -> None:
    text = GLIDER + '  ground_effect: {efficiency: 0.9, height: 1.5}\n'
    stage = vehicle_of(tmp_path, text.replace(', flaps: [0, 1]', '')).model().stage()
    _, high = evaluated(stage, speed=25.0, alpha=6.0, z_e=-1e4)
    _, low = evaluated(stage, speed=25.0, alpha=6.0)
    ratio = (16 * 1.5 / 15) ** 2
    saved = 1 - ratio / (1 + ratio)
    assert high['CL'] == low['CL']
    induced = low['CL'] ** 2 / (np.pi * 22.5 * 0.9)
    assert high['CD'] - low['CD'] == pytest.approx(saved * induced, rel=1e-5)


RIGID = """
model: DynamicsRigidBody3DBodyEuler
mass: 20
inertia: {Ixx: 1, Iyy: 2, Izz: 3}
controls: {elevator: [-20 deg, 20 deg], aileron: [-20 deg, 20 deg]}
aerodynamics:
  kind: polar
  area: 0.8
  span: 3
  chord: 0.3
  CL_alpha: 5
  CD0: 0.03
  efficiency: 0.9
  derivatives:
    CL: {elevator: 0.4}
    CY: {beta: -0.5}
    Cl: {beta: -0.1, p: -0.45, aileron: 0.2}
    Cm: {constant: 0.02, alpha: -0.8, q: -10, elevator: -1.2}
    Cn: {beta: 0.07, r: -0.1}
"""


def test_moments_follow_their_derivatives(tmp_path: Path) -> None:
    stage = vehicle_of(tmp_path, RIGID).model().stage()
    alpha, beta = np.radians(3.0), np.radians(4.0)
    speed = 20.0
    body = {
        'u_b': speed * np.cos(alpha) * np.cos(beta),
        'v_b': speed * np.sin(beta),
        'w_b': speed * np.sin(alpha) * np.cos(beta),
    }
    rates, _ = evaluated(stage, **body, elevator=0.1, aileron=0.05)
    force = 0.5 * RHO * speed**2 * 0.8
    pitch = 0.02 - 0.8 * alpha - 1.2 * 0.1
    assert rates['q'] == pytest.approx(force * 0.3 * pitch / 2, rel=1e-5)
    assert rates['p'] == pytest.approx(force * 3 * (-0.1 * beta + 0.2 * 0.05), rel=1e-5)
    assert rates['r'] == pytest.approx(force * 3 * 0.07 * beta / 3, rel=1e-5)
    turning, _ = evaluated(stage, **body, elevator=0.1, q=0.2)
    damping = -10 * 0.2 * 0.3 / (2 * speed)
    assert turning['q'] - rates['q'] == pytest.approx(force * 0.3 * damping / 2, rel=1e-5)


def test_a_side_wind_pushes_downwind_and_turns_the_nose_into_it(tmp_path: Path) -> None:
    stage = vehicle_of(tmp_path, RIGID).model().stage()
    # from the right: the air moves to the left
    rates, air = evaluated(stage, (0.0, -3.0, 0.0), u_b=20.0)
    assert air['beta'] == pytest.approx(np.degrees(np.arctan2(3.0, 20.0)))
    assert rates['v_b'] < 0
    assert rates['r'] > 0
    assert rates['p'] < 0  # dihedral lifts the wing that the wind meets


@pytest.mark.parametrize('text', [GLIDER.replace(', flaps: [0, 1]', '') + STALL, RIGID])
def test_derivatives_are_right_and_finite_at_rest(tmp_path: Path, text: str) -> None:
    stage = vehicle_of(tmp_path, text).model().stage()
    n = len(stage.states) + len(stage.controls)
    rng = np.random.default_rng(4)
    for _ in range(3):
        x = rng.uniform(0.1, 1, n) + 20 * np.isin(
            (*stage.states, *stage.controls), ['speed', 'u_b']
        )
        check_first_derivatives(stage, x, (1.0, 2.0, -3.0), np.full(n, 0.1))
    value, first, _ = derivatives(stage)(np.zeros(n), [0, 0, 0, 0])
    assert np.all(np.isfinite(value.full()))
    assert np.all(np.isfinite(first.full()))
