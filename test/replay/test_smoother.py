"""The smoother against closed forms, dense least squares and its own statistics."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from flightdyn.errors import InputError
from flightdyn.replay import gauss_markov as gm
from flightdyn.replay.smoother import ACCELERATION_PRIOR, VELOCITY_PRIOR, smooth

Array = NDArray[np.float64]


def transition(dt: float) -> Array:
    return np.array([[1, dt, dt**2 / 2], [0, 1, dt], [0, 0, 1]])


def jerk_covariance(dt: float, q: float) -> Array:
    """Integrate exp(F s) L q L' exp(F s)' over 0..dt; Gauss-Legendre is exact here."""
    nodes, weights = np.polynomial.legendre.leggauss(5)
    total = np.zeros((3, 3))
    for x, w in zip(nodes, weights, strict=True):
        column = transition(dt * (x + 1) / 2)[:, 2:]
        total += w * dt / 2 * q * column @ column.T
    return total


def dense(t: Array, z: Array, std: Array, v: Array, v_std: Array, q: float) -> tuple[Array, Array]:
    """Return mean (n, 3) and covariance (n, 3, 3) of one axis by one big weighted least squares.

    The whitened rows are solved by QR, which shares nothing with the recursion but the model.
    """
    n = t.size
    rows, right = [], []

    def add(block: Array, at: int, value: Array) -> None:
        row = np.zeros((block.shape[0], 3 * n))
        row[:, 3 * at : 3 * at + block.shape[1]] = block
        rows.append(row)
        right.append(value)

    add(np.diag([0, 1 / VELOCITY_PRIOR, 1 / ACCELERATION_PRIOR])[1:], 0, np.zeros(2))
    for k in range(n):
        if np.isfinite(z[k]):
            add(np.array([[1.0, 0, 0]]) / std[k], k, np.array([z[k] / std[k]]))
        if np.isfinite(v[k]):
            add(np.array([[0, 1.0, 0]]) / v_std[k], k, np.array([v[k] / v_std[k]]))
        if k:
            dt = t[k] - t[k - 1]
            root = np.linalg.inv(np.linalg.cholesky(jerk_covariance(dt, q)))
            block = np.hstack((-root @ transition(dt), root))
            add(block, k - 1, np.zeros(3))
    a, b = np.vstack(rows), np.concatenate(right)
    _, r = np.linalg.qr(a)
    mean = np.linalg.lstsq(a, b, rcond=None)[0].reshape(n, 3)
    inverse = np.linalg.inv(r)
    cov = inverse @ inverse.T
    return mean, np.stack([cov[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] for k in range(n)])


def test_jerk_covariance_is_the_integral_of_the_jerk() -> None:
    pp, pv, pa, vv, va, aa = gm.jerk_covariance(0.7, 3.0)
    np.testing.assert_allclose(
        [[pp, pv, pa], [pv, vv, va], [pa, va, aa]], jerk_covariance(0.7, 3.0), rtol=1e-13
    )


@pytest.mark.parametrize('with_velocity', [False, True])
def test_same_as_dense_least_squares(with_velocity: bool) -> None:
    rng = np.random.default_rng(3)
    n = 40
    t = np.cumsum(rng.uniform(0.2, 3.0, n))
    z = rng.normal(size=(n, 3)) * 20 + t[:, None] * [10, -3, 1]
    std = rng.uniform(0.3, 3, (n, 3))
    v = rng.normal(loc=[10, -3, 1], size=(n, 3))
    v[::3] = np.nan  # velocity comes and goes
    z[5], z[17, 1] = np.nan, np.nan
    if not with_velocity:
        v[:] = np.nan
    v_std = rng.uniform(0.1, 1, (n, 3))
    q = np.array([0.5, 2.0, 30.0])
    got = smooth(t, z, position_std=std, velocity=v, velocity_std=v_std, jerk_density=q)
    for axis in range(3):
        mean, cov = dense(t, z[:, axis], std[:, axis], v[:, axis], v_std[:, axis], q[axis])
        # Both lose about half of their digits to the condition of the problem.
        np.testing.assert_allclose(got.position[:, axis], mean[:, 0], atol=1e-6)
        np.testing.assert_allclose(got.velocity[:, axis], mean[:, 1], atol=1e-6)
        np.testing.assert_allclose(got.acceleration[:, axis], mean[:, 2], atol=1e-6)
        np.testing.assert_allclose(got.covariance[:, axis], cov, rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize('dt', [1e-3, 0.1, 1.0, 60.0])
def test_exact_on_constant_acceleration(dt: float) -> None:
    t = np.arange(400) * dt
    a, v0, p0 = np.array([0.3, -2.0, 9.8]), np.array([20.0, 0.0, -3.0]), np.array([1e4, 0.0, 5.0])
    p = p0 + v0 * t[:, None] + a / 2 * t[:, None] ** 2
    v = v0 + a * t[:, None]
    got = smooth(t, p, position_std=1e-3, velocity=v, velocity_std=1e-3, jerk_density=1e-3 / dt)
    # What is left is the pull of the acceleration prior at the first sample, and rounding of
    # positions as large as 3e9 m (dt = 60 s).
    scale = max(1.0, float(np.abs(p).max()) * 1e-9)
    assert np.abs(got.position - p).max() < 1e-6 * scale
    assert np.abs(got.velocity - v).max() < 1e-5 * scale
    assert np.abs(got.acceleration - a).max() < 2e-3


def test_covariance_is_consistent_on_simulated_motion() -> None:
    """The squared error over its covariance (NEES) averages the number of states, 3."""
    rng = np.random.default_rng(11)
    n, q, r = 6000, 4.0, 1.5
    dt = rng.uniform(0.1, 1.0, n - 1)
    t = np.concatenate(([0.0], np.cumsum(dt)))
    x = np.zeros((n, 3, 3))  # sample, axis, state
    for k in range(1, n):
        root = np.linalg.cholesky(jerk_covariance(dt[k - 1], q))
        # A weak spring keeps nothing: the state wanders, as the model says it may.
        x[k] = x[k - 1] @ transition(dt[k - 1]).T + rng.normal(size=(3, 3)) @ root.T
    z = x[:, :, 0] + r * rng.normal(size=(n, 3))
    v = x[:, :, 1] + 0.2 * rng.normal(size=(n, 3))
    for velocity in (None, v):
        got = smooth(t, z, position_std=r, velocity=velocity, velocity_std=0.2, jerk_density=q)
        error = np.stack((got.position, got.velocity, got.acceleration), axis=2) - x
        nees = np.einsum('kai,kaij,kaj->ka', error, np.linalg.inv(got.covariance), error)
        # 18 000 chi-squared values of 3 degrees, correlated over some ten samples:
        # their mean scatters by about sqrt(6 / 1800) = 0.06.
        assert abs(nees.mean() - 3.0) < 0.25


def test_velocity_measurements_sharpen_everything() -> None:
    t = np.arange(50) * 0.2
    zero = np.zeros((50, 3))
    without = smooth(t, zero, position_std=1.5, jerk_density=4.0)
    with_velocity = smooth(
        t, zero, position_std=1.5, velocity=zero, velocity_std=0.15, jerk_density=4.0
    )
    assert (with_velocity.std < without.std).all()


@pytest.mark.parametrize('n', [1, 2, 3, 16, 17, 18, 256, 257, 258])
def test_any_length_and_the_ends_of_the_compiled_chunks(n: int) -> None:
    t = np.arange(n) * 1.0
    p = np.stack((30 * t, -5 * t, 0 * t), axis=1)
    got = smooth(t, p, position_std=0.5, jerk_density=1.0)
    assert got.covariance.shape == (n, 3, 3, 3)
    assert np.isfinite(got.std).all()
    np.testing.assert_allclose(got.position, p, atol=0.2)
    if n == 1:
        np.testing.assert_allclose(got.std[0, 0], [0.5, VELOCITY_PRIOR, ACCELERATION_PRIOR])


def test_a_long_segment_is_the_same_in_small_and_large_chunks(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rng = np.random.default_rng(0)
    t, p = np.arange(600) * 0.5, rng.normal(size=(600, 3)).cumsum(axis=0)
    large = smooth(t, p, position_std=1.0, jerk_density=1.0)
    monkeypatch.setattr('flightdyn.replay.smoother._CHUNKS', (16,))
    small = smooth(t, p, position_std=1.0, jerk_density=1.0)
    np.testing.assert_array_equal(small.velocity, large.velocity)


@settings(derandomize=True, deadline=None, max_examples=60)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(1, 60),
    log_q=st.floats(-4, 6),
    log_r=st.floats(-4, 2),
    with_velocity=st.booleans(),
)
def test_covariances_are_symmetric_and_positive(
    seed: int, n: int, log_q: float, log_r: float, with_velocity: bool
) -> None:
    rng = np.random.default_rng(seed)
    t = np.cumsum(10 ** rng.uniform(-3, np.log10(60), n))  # steps of 1 ms to 60 s, mixed
    z = rng.normal(size=(n, 3)) * 100
    v = rng.normal(size=(n, 3)) * 10 if with_velocity else None
    got = smooth(
        t, z, position_std=10**log_r, velocity=v, velocity_std=10**log_r, jerk_density=10**log_q
    )
    for part in (got.position, got.velocity, got.acceleration, got.std):
        assert np.isfinite(part).all()
    assert (got.covariance == np.swapaxes(got.covariance, 2, 3)).all()
    assert (got.std > 0).all()
    correlation = got.covariance / (got.std[..., :, None] * got.std[..., None, :])
    assert np.linalg.eigvalsh(correlation).min() > -1e-12


@settings(derandomize=True, deadline=None, max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), shift=st.floats(-1e6, 1e6), scale=st.floats(0.1, 10))
def test_smoothing_is_linear_and_moves_with_its_origin(
    seed: int, shift: float, scale: float
) -> None:
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.1, 2, 30))
    z = rng.normal(size=(30, 3)) * 10
    base = smooth(t, z, position_std=1.0, jerk_density=1.0)
    moved = smooth(t, scale * z + shift, position_std=1.0, jerk_density=1.0)
    np.testing.assert_allclose(moved.position, scale * base.position + shift, atol=1e-6)
    np.testing.assert_allclose(moved.velocity, scale * base.velocity, atol=1e-6)


def test_time_reversal_reverses_velocity() -> None:
    rng = np.random.default_rng(5)
    t = np.cumsum(rng.uniform(0.5, 2, 80))
    z = rng.normal(size=(80, 3)).cumsum(axis=0)
    forward = smooth(t, z, position_std=0.5, jerk_density=0.1)
    backward = smooth(-t[::-1], z[::-1], position_std=0.5, jerk_density=0.1)
    inner = slice(10, -10)  # the priors sit at the first sample, on opposite ends
    np.testing.assert_allclose(forward.position[inner], backward.position[::-1][inner], atol=1e-3)
    np.testing.assert_allclose(forward.velocity[inner], -backward.velocity[::-1][inner], atol=1e-3)


@pytest.mark.parametrize(
    ('change', 'says'),
    [
        ({'time': [0.0, 2.0, 1.0]}, 'backwards at sample 2'),
        ({'position_std': 0.0}, 'position_std must be above 0'),
        ({'position': np.zeros((3, 2))}, 'expected'),
        ({'jerk_density': -1.0}, 'jerk_density'),
        ({'velocity': np.zeros((3, 3))}, 'velocity_std must be above 0'),
        ({'time': []}, 'non-empty'),
    ],
)
def test_bad_input_is_refused(change: dict[str, object], says: str) -> None:
    request = {
        'time': [0.0, 1.0, 2.0],
        'position': np.zeros((3, 3)),
        'position_std': 1.0,
        'jerk_density': 1.0,
    } | change
    with pytest.raises(InputError, match=says):
        smooth(request.pop('time'), request.pop('position'), **request)  # type: ignore[arg-type]


def test_axes_are_independent() -> None:
    t, z = np.arange(10.0), np.zeros((10, 3))
    a = smooth(t, z, position_std=1.0, jerk_density=1.0)
    z[:, 0] = 100.0
    b = smooth(t, z, position_std=[0.1, 1.0, 1.0], jerk_density=1.0)
    np.testing.assert_array_equal(a.position[:, 1:], b.position[:, 1:])
