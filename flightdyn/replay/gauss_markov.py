"""One axis of motion driven by white jerk: prediction, measurement and smoothing of one sample.

The arithmetic is written once for floats, arrays and CasADi symbols: `smoother` traces it into a
compiled scan, `noise` runs it on arrays of candidate noise levels. It has no branch on a value.
"""

from ..numpy import Vectorizable

Mean = tuple[Vectorizable, Vectorizable, Vectorizable]
"""Position [m], velocity [m/s], acceleration [m/s^2]."""

Covariance = tuple[
    Vectorizable, Vectorizable, Vectorizable, Vectorizable, Vectorizable, Vectorizable
]
"""Upper triangle by rows: pp, pv, pa, vv, va, aa."""

_INDEX = ((0, 1, 2), (1, 3, 4), (2, 4, 5))
_UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


def jerk_covariance(dt: Vectorizable, jerk_density: Vectorizable) -> Covariance:
    """Return what white jerk of a density [m^2/s^5] adds to the covariance in dt [s].

    References
    ----------
    .. [1] Bar-Shalom, Li, Kirubarajan, *Estimation with Applications to Tracking and Navigation*,
       2001, section 6.2.3, continuous-time white process noise acceleration model.
    """
    q1 = jerk_density * dt
    q2 = q1 * dt
    q3 = q2 * dt
    q4 = q3 * dt
    return q4 * dt / 20, q4 / 8, q3 / 6, q3 / 3, q2 / 2, q1


def predict(
    mean: Mean, cov: Covariance, dt: Vectorizable, jerk_density: Vectorizable
) -> tuple[Mean, Covariance]:
    """Return mean and covariance dt [s] later."""
    p, v, a = mean
    pp, pv, pa, vv, va, aa = cov
    half = dt * dt / 2
    cross_v = pv + dt * vv + half * va
    cross_a = pa + dt * va + half * aa
    noise = jerk_covariance(dt, jerk_density)
    return (p + dt * v + half * a, v + dt * a, a), (
        pp + dt * pv + half * pa + dt * cross_v + half * cross_a + noise[0],
        cross_v + dt * cross_a + noise[1],
        cross_a + noise[2],
        vv + 2 * dt * va + dt * dt * aa + noise[3],
        va + dt * aa + noise[4],
        aa + noise[5],
    )


def measure(
    mean: Mean, cov: Covariance, component: int, value: Vectorizable, weight: Vectorizable
) -> tuple[Mean, Covariance]:
    """Return mean and covariance after one component was measured.

    Parameters
    ----------
    component : int
        0 position, 1 velocity, 2 acceleration.
    weight : float, array or symbol
        1 / variance of the measurement; 0 where there is none (its value must still be finite).
    """
    column = [cov[i] for i in _INDEX[component]]
    scale = 1 / (1 + weight * column[component])
    gain = [weight * scale * c for c in column]
    innovation = value - mean[component]
    updated = tuple(m + k * innovation for m, k in zip(mean, gain, strict=True))
    shrunk = tuple(
        # The measured row shrinks by a factor: no difference of nearly equal numbers there.
        cov[_INDEX[i][j]] * scale
        if component in (i, j)
        else cov[_INDEX[i][j]] - gain[i] * column[j]
        for i, j in _UPPER
    )
    return updated, shrunk


def smooth(
    mean: Mean,
    cov: Covariance,
    later_mean: Mean,
    later_cov: Covariance,
    dt: Vectorizable,
    jerk_density: Vectorizable,
) -> tuple[Mean, Covariance]:
    """Return a filtered sample corrected by the smoothed one dt [s] later.

    Notes
    -----
    The covariance is summed as (I - G F) P (I - G F)' + G (Q + P_later) G', which is positive for
    any gain G, where the usual P + G (P_later - P_predicted) G' loses its sign to rounding.

    References
    ----------
    .. [1] Rauch, Tung, Striebel, "Maximum likelihood estimates of linear dynamic systems",
       AIAA Journal 3(8), 1965.
    """
    predicted_mean, predicted = predict(mean, cov, dt, jerk_density)
    half = dt * dt / 2
    transition = ((1.0, dt, half), (0.0, 1.0, dt), (0.0, 0.0, 1.0))
    p = [[cov[_INDEX[i][j]] for j in range(3)] for i in range(3)]
    cross = [  # P F'
        [p[i][0] + dt * p[i][1] + half * p[i][2], p[i][1] + dt * p[i][2], p[i][2]]
        for i in range(3)
    ]
    gain = [_solve(predicted, row) for row in cross]
    step = [b - a for b, a in zip(later_mean, predicted_mean, strict=True)]
    smoothed = tuple(mean[i] + sum(gain[i][k] * step[k] for k in range(3)) for i in range(3))

    rest = [
        [
            (1.0 if i == j else 0.0) - sum(gain[i][k] * transition[k][j] for k in range(j + 1))
            for j in range(3)
        ]
        for i in range(3)
    ]
    noise = jerk_covariance(dt, jerk_density)
    outer = [n + c for n, c in zip(noise, later_cov, strict=True)]
    inner = _congruence(rest, cov)
    driven = _congruence(gain, tuple(outer))
    summed = tuple(a + b for a, b in zip(inner, driven, strict=True))
    return smoothed, summed


def _solve(cov: Covariance, b: list[Vectorizable]) -> list[Vectorizable]:
    """Return cov^-1 b by L D L', which does not mind that metres and m/s^2 differ in scale."""
    a00, a01, a02, a11, a12, a22 = cov
    l10, l20 = a01 / a00, a02 / a00
    d1 = a11 - l10 * a01
    e12 = a12 - l20 * a01
    l21 = e12 / d1
    d2 = a22 - l20 * a02 - l21 * e12
    y1 = b[1] - l10 * b[0]
    y2 = b[2] - l20 * b[0] - l21 * y1
    x2 = y2 / d2
    x1 = y1 / d1 - l21 * x2
    return [b[0] / a00 - l10 * x1 - l20 * x2, x1, x2]


def _congruence(m: list[list[Vectorizable]], cov: Covariance) -> Covariance:
    """Return the upper triangle of m cov m'."""
    product = [
        [sum(m[i][k] * cov[_INDEX[k][j]] for k in range(3)) for j in range(3)] for i in range(3)
    ]
    upper = tuple(sum(product[i][k] * m[j][k] for k in range(3)) for i, j in _UPPER)
    return upper
