"""Regulators: against the algebraic Riccati equation, finite differences, closed forms."""

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are

from flightdyn.control.lqr import Weights, discretised, gains, linearised, trimmed
from flightdyn.errors import InputError
from flightdyn.trajectory import Trajectory
from flightdyn.vehicles.vehicle import load_vehicle

QUADCOPTER = load_vehicle('quadcopter').model()
GLIDER = load_vehicle('cessna152').model()
HOVER = np.full(2, 0.1 * 9.81 / 2)  # N


def test_linearised_equations_are_the_difference_quotients() -> None:
    """Central differences with steps of 1e-5 err by their square; the glider's table is smooth."""
    for model, x, u in (
        (QUADCOPTER, [1.0, -2, 3, -1, 0.7, 4], [0.3, 0.8]),
        (GLIDER, [0.0, -500, 38, -0.06], [3.0]),
    ):
        stage = model.stage()
        x, u, p = np.array(x), np.array(u), np.array([-4.0, 3, 1, 0])
        a, b = linearised(stage, x[:, None], u[:, None], p[:, None])

        def rate(x: np.ndarray, u: np.ndarray, stage=stage, p=p) -> np.ndarray:
            return stage.function(x, u, p)[0].full().ravel()

        for i in range(x.size):
            step = 1e-5 * np.eye(x.size)[i]
            slope = (rate(x + step, u) - rate(x - step, u)) / 2e-5
            np.testing.assert_allclose(a[0][:, i], slope, atol=1e-6)
        for i in range(u.size):
            step = 1e-5 * np.eye(u.size)[i]
            slope = (rate(x, u + step) - rate(x, u - step)) / 2e-5
            np.testing.assert_allclose(b[0][:, i], slope, atol=1e-6)


def test_points_are_linearised_one_by_one() -> None:
    stage = QUADCOPTER.stage()
    x, u = np.random.default_rng(0).normal(size=(6, 5)), np.full((2, 5), 0.5)
    p = np.zeros((4, 5))
    together = linearised(stage, x, u, p)
    for k in range(5):
        alone = linearised(stage, x[:, k : k + 1], u[:, :1], p[:, :1])
        np.testing.assert_array_equal(together[0][k], alone[0][0])
        np.testing.assert_array_equal(together[1][k], alone[1][0])


@pytest.mark.parametrize('period', [0.01, 1.0])
def test_discretised_equations_are_matrix_exponentials(period: float) -> None:
    """The series' first term left out is 1 / 9! = 3e-6 of what a step of norm 1 adds."""
    random = np.random.default_rng(1)
    a, b = random.normal(size=(3, 4, 4)), random.normal(size=(3, 4, 2))
    a_d, b_d = discretised(a, b, period)
    for k in range(3):
        m = np.zeros((6, 6))
        m[:4, :4], m[:4, 4:] = a[k], b[k]
        exact = expm(m * period)
        np.testing.assert_allclose(a_d[k], exact[:4, :4], rtol=1e-4, atol=1e-5)
        np.testing.assert_allclose(b_d[k], exact[:4, 4:], rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize('steps', [1, 256, 300])
def test_steady_gains_solve_the_algebraic_riccati_equation(steps: int) -> None:
    """The number of steps covers less than, exactly, and more than one block."""
    x = np.zeros(6)
    a, b = linearised(QUADCOPTER.stage(), x[:, None], HOVER[:, None], np.zeros((4, 1)))
    a_d, b_d = discretised(a, b, 0.02)
    q, r = np.array([4.0, 4, 1, 1, 9, 1]), np.array([2.0, 2])
    exact = solve_discrete_are(a_d[0], b_d[0], np.diag(q) * 0.02, np.diag(r) * 0.02)
    k, cost = gains(np.repeat(a_d, steps, axis=0), np.repeat(b_d, steps, axis=0), q, r, 0.02)
    assert k.shape == (steps, 2, 6)
    np.testing.assert_allclose(cost, exact, rtol=1e-5, atol=1e-5 * np.abs(exact).max())
    closed = np.linalg.eigvals(a_d[0] - b_d[0] @ k[0])
    assert np.abs(closed).max() < 1


def test_gains_along_a_changing_system_are_the_riccati_recursions() -> None:
    random = np.random.default_rng(2)
    n = 300
    a, b = np.eye(3) + 0.1 * random.normal(size=(n, 3, 3)), random.normal(size=(n, 3, 2))
    q, r, period = np.array([1.0, 0, 2]), np.array([1.0, 3]), 0.1
    final = np.diag([1.0, 2, 3])
    k, cost = gains(a, b, q, r, period, final)
    p = final
    for i in range(n - 1, -1, -1):
        s = np.diag(r) * period + b[i].T @ p @ b[i]
        gain = np.linalg.solve(s, b[i].T @ p @ a[i])
        np.testing.assert_allclose(k[i], gain, rtol=1e-8, atol=1e-9)
        p = np.diag(q) * period + a[i].T @ p @ (a[i] - b[i] @ gain)
    np.testing.assert_allclose(cost, p, rtol=1e-8)


def test_trim_of_a_hovering_quadcopter_is_half_its_weight_on_each_rotor() -> None:
    found = trimmed(QUADCOPTER.stage(), np.zeros(6), np.array([1.0, 0.0]), np.zeros(4))
    assert found is not None
    np.testing.assert_allclose(found, HOVER, rtol=1e-9)


def test_a_glider_that_slows_down_has_no_trim() -> None:
    x = np.array([0.0, -500, 38, 0.0])
    assert trimmed(GLIDER.stage(), x, np.array([3.0]), np.zeros(4)) is None


def plan(length: float) -> Trajectory:
    names = ('x_e', 'z_e', 'u_b', 'w_b', 'theta', 'q')
    states = {name: np.zeros(2) for name in names}
    states['x_e'], states['u_b'] = np.array([0, length]), np.array([0.0, 30.0])
    return Trajectory(time=np.array([0.0, 1.0]), states=states)


def test_weights_follow_from_what_a_plan_covers() -> None:
    stage, ranges = QUADCOPTER.stage(), QUADCOPTER.controls
    q, r = Weights().matrices(stage, plan(10.0), ranges)
    assert q**-0.5 == pytest.approx([0.5, 0.05, 1.5, 1.5, 0.2, 2.0])
    assert r**-0.5 == pytest.approx([0.25, 0.25])
    q, r = Weights({'x_e': 3.0, 'theta': np.inf}, {'thrust_left': 0.1}).matrices(
        stage, plan(10.0), ranges
    )
    assert (q[0], q[4], r[0]) == pytest.approx((1 / 9, 0, 100))


@pytest.mark.parametrize(
    ('weights', 'message'),
    [
        (Weights({'x': 1.0}), "no 'x'"),
        (Weights({}, {'thrust': 1.0}), "no 'thrust'"),
    ],
)
def test_weights_of_unknown_names_are_refused(weights: Weights, message: str) -> None:
    with pytest.raises(InputError, match=message):
        weights.matrices(QUADCOPTER.stage(), plan(1.0), QUADCOPTER.controls)


def test_a_control_without_range_needs_a_weight() -> None:
    ranges = dict.fromkeys(QUADCOPTER.controls, (0.0, np.inf))
    with pytest.raises(InputError, match='thrust_left has no range'):
        Weights().matrices(QUADCOPTER.stage(), plan(1.0), ranges)


@pytest.mark.parametrize('value', [0.0, -1.0, float('nan')])
def test_deviations_that_accept_nothing_are_refused(value: float) -> None:
    with pytest.raises(InputError, match='must be above 0'):
        Weights({'x_e': value})
