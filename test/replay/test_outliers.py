"""Samples that the rest contradicts are left out and counted; good ones are not."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from flightdyn.logs.track import Track
from flightdyn.replay import gate, outliers
from flightdyn.replay.outliers import MAX_GATE_SHARE, REACQUIRE, Rejected
from flightdyn.replay.reconstruct import reconstruct_checked
from flightdyn.replay.report import Replay
from flightdyn.replay.smoother import smooth
from flightdyn.trajectory import Trajectory

Array = NDArray[np.float64]

SPEED, RADIUS = 40.0, 120.0


def circling(t: Array, noise: float = 1.0, seed: int = 3) -> Array:
    """A thermalling glider: 54 degrees of bank, climbing at 2 m/s."""
    angle = SPEED / RADIUS * t
    p = np.stack((RADIUS * np.cos(angle), RADIUS * np.sin(angle), -2.0 * t - 500.0), axis=1)
    return p + noise * np.random.default_rng(seed).normal(size=p.shape)


def track_of(t: Array, p: Array, **more: object) -> Track:
    columns: dict[str, object] = {
        'time_ns': np.round(t * 1e9).astype(np.int64),
        'segment': np.zeros(t.size, np.int64),
        'position_ned': p,
        'messages': t.size,
    }
    return Track(**(columns | more))  # type: ignore[arg-type]


def replayed(t: Array, p: Array, **more: object) -> tuple[Trajectory, Rejected]:
    return reconstruct_checked(track_of(t, p, **more))


def position_of(flown: Trajectory) -> Array:
    return np.stack([flown[name] for name in ('x_e', 'y_e', 'z_e')], axis=1)


@pytest.mark.parametrize('at', [0, 1, 200, 398, 399])
def test_a_spike_of_55_km_leaves_no_trace(at: int) -> None:
    """As if the sample had never been: it is out before the noise is estimated."""
    t = np.arange(400.0)
    p = circling(t)
    p[at, 0] += 55_000.0
    flown, rejected = replayed(t, p)
    assert rejected.counts == {outliers.POSITION: 1}
    without, nothing = replayed(np.delete(t, at), np.delete(p, at, axis=0))
    assert nothing.counts == {}
    shift = 1.0 if at == 0 else 0.0
    np.testing.assert_allclose(flown.time, without.time + shift, atol=1e-9)
    np.testing.assert_allclose(position_of(flown), position_of(without), atol=1e-6)
    np.testing.assert_allclose(flown['speed_std'], without['speed_std'], rtol=1e-6)


def test_a_spike_less_than_manoeuvres_make_is_left_to_the_filter() -> None:
    """80 m at 1 Hz is 16 g there and back: no coarse limit excludes it, the log's noise does."""
    t = np.arange(400.0)
    p = circling(t)
    p[200] += [0.0, 80.0, 0.0]
    assert not outliers.lone(t, p[:, :2], np.zeros(400, np.int64), 0.1)[0].any()
    flown, rejected = replayed(t, p)
    assert rejected.counts == {outliers.POSITION: 1}
    off, at = rejected.worst[outliers.POSITION]
    assert off == pytest.approx(80.0, abs=15.0)  # what is expected there is known to some metres
    assert at == 200.0
    assert flown['speed'].max() < SPEED + 8.0
    clean, _ = replayed(t, circling(t))
    # The grid of noise levels is a quarter of a decade wide: at most one step, 1.78, apart.
    assert flown['speed_std'][50] < 1.8 * clean['speed_std'][50]


def test_what_is_left_out_is_counted_and_named_in_the_summary() -> None:
    t = np.arange(400.0)
    p = circling(t)
    p[[100, 250], 1] += [9_000.0, 300.0]
    p[300, 2] -= 4_000.0
    track = track_of(t, p)
    summary = Replay(track, *reconstruct_checked(track)).summary()
    assert summary['dropped'] == {outliers.POSITION: 2, outliers.ALTITUDE: 1}
    assert summary['used'] + 2 == summary['messages'] == 400
    assert summary['max_speed'] < SPEED + 8.0
    altitudes, positions = summary['warnings']
    assert '2 positions' in positions
    assert 'at 100 s' in positions
    assert '1 altitudes' in altitudes
    assert 'at 300 s' in altitudes


def test_a_wrong_altitude_keeps_the_place() -> None:
    t = np.arange(200.0)
    p = circling(t)
    p[120, 2] += 3_000.0
    flown, rejected = replayed(t, p)
    assert rejected.counts == {outliers.ALTITUDE: 1}
    assert len(flown) == 200
    assert abs(flown['z_e'][120] + 2.0 * 120 + 500.0) < 5.0
    assert flown['z_e_std'][120] > flown['z_e_std'][110]


def test_a_jump_for_good_begins_a_segment_and_costs_nothing() -> None:
    t = np.arange(300.0)
    p = circling(t)
    p[150:] += [2_000.0, -3_000.0, 0.0]
    flown, rejected = replayed(t, p)
    assert rejected.counts == {}
    assert rejected.new_segments == 1
    assert [piece.stop for piece in flown.segments()] == [150, 300]
    assert flown['speed'].max() < SPEED + 15.0  # two more ends, known from one side only


def test_a_spoofed_stretch_is_a_segment_of_its_own() -> None:
    t = np.arange(300.0)
    p = circling(t)
    p[100:160, 0] += 5_000.0
    flown, rejected = replayed(t, p)
    assert rejected.counts == {}
    assert [piece.stop - piece.start for piece in flown.segments()] == [100, 60, 140]


def test_fewer_than_begin_a_segment_are_left_out() -> None:
    t = np.arange(500.0)
    p = circling(t)
    p[100 : 100 + REACQUIRE - 1, 0] += 5_000.0
    flown, rejected = replayed(t, p)
    assert rejected.counts == {outliers.POSITION: REACQUIRE - 1}
    assert len(list(flown.segments())) == 1


def test_a_wrong_velocity_is_not_used_but_its_position_is() -> None:
    t = np.arange(0.0, 100.0, 0.2)
    angle = SPEED / RADIUS * t
    v = SPEED * np.stack((-np.sin(angle), np.cos(angle), 0 * t), axis=1)
    v += 0.1 * np.random.default_rng(1).normal(size=v.shape)
    v[:, 2] -= 2.0
    v[250] = [300.0, 0.0, 0.0]
    flown, rejected = replayed(t, circling(t), velocity_ned=v)
    assert rejected.counts == {outliers.VELOCITY: 1}
    assert len(flown) == t.size
    assert flown['speed'].max() < SPEED + 2.0


def test_held_positions_are_no_measurements() -> None:
    """Every fourth position of an airliner repeats the one before, as of a slow receiver."""
    t = np.arange(601.0)
    p = np.stack((220.0 * t, 30.0 * t, -9_000.0 + 0 * t), axis=1)
    p += 5.0 * np.random.default_rng(2).normal(size=p.shape)
    p[:, 2] = -9_000.0
    repeats = np.arange(3, 600, 4)
    p[repeats] = p[repeats - 1]
    flown, rejected = replayed(t, p)
    assert rejected.counts == {outliers.HELD: repeats.size}
    assert len(flown) == 601 - repeats.size
    assert np.abs(flown['speed'] - np.hypot(220.0, 30.0))[20:-20].max() < 10.0


def test_a_parked_vehicle_holds_no_position() -> None:
    """Drive, stop for two minutes, drive on; the receiver's digits of 0.1 m jitter at times."""
    t = np.arange(300.0)
    way = 12.0 * np.clip(t, 0, 90) + 12.0 * np.clip(t - 210, 0, None)
    p = np.round(np.stack((way, 0.5 * way, 0 * t), axis=1), 1)
    p[[120, 150, 151], 0] += [0.5, 1.0, 1.0]
    flown, rejected = replayed(t, p)
    assert rejected.counts == {}
    assert flown['speed'][150] < 1.0


@settings(derandomize=True, deadline=None, max_examples=30)
@given(
    rate=st.sampled_from([1.0, 5.0, 20.0]),
    speed=st.floats(10.0, 80.0),
    load=st.floats(0.5, 8.0),
    noise=st.sampled_from([0.02, 0.5, 3.0]),
    seed=st.integers(0, 2**31),
)
def test_no_manoeuvre_loses_a_sample(
    rate: float, speed: float, load: float, noise: float, seed: int
) -> None:
    """Straight, then turns or loops at up to 8 g entered at once, and straight again."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 60.0 + 120.0 / rate, 1 / rate)
    turning = (np.sin(2 * np.pi * t / 23.0 + rng.uniform(0, 6)) > 0.3) * rng.choice([-1, 1])
    omega = load * 9.8 / speed * turning
    # At 1 Hz no more than a third of a turn a sample: what is faster is noise to any method.
    omega = np.clip(omega, -2.0 * rate, 2.0 * rate)
    angle = np.cumsum(omega) / rate
    steps = speed / rate * np.stack((np.cos(angle), np.sin(angle) * 0.8, np.sin(angle) * 0.6), 1)
    p = np.cumsum(steps, axis=0) + noise * rng.normal(size=(t.size, 3))
    _, rejected = replayed(t, p)
    assert sum(rejected.counts.values()) / t.size < 0.005
    assert rejected.new_segments == 0


def test_if_too_many_contradict_the_model_is_wrong() -> None:
    """Noise of two kinds mixed, one in 12 ten times as wide: not outliers but the receiver."""
    rng = np.random.default_rng(8)
    t = np.arange(600.0)
    p = circling(t, 0.0) + rng.normal(size=(600, 3)) * np.where(rng.random((600, 1)) < 0.08, 60, 1)
    _, rejected = replayed(t, p)
    assert rejected.counts.get(outliers.POSITION, 0) <= MAX_GATE_SHARE * t.size
    if rejected.refused:
        assert any('no more are' in text for text in rejected.warnings(t.size))


def test_position_left_out_is_what_smoothing_without_it_makes() -> None:
    """Two ways to one answer: the formula, and the smoother run without the sample."""
    t = np.arange(40.0)
    p = circling(t)
    std = np.full((40, 3), 1.0)
    q = np.full(3, 2.0)
    whole = smooth(t, p, position_std=std, jerk_density=q)
    segment = np.zeros(40, np.int64)
    variance = whole.std[:, :, 0] ** 2
    _, distance = gate.left_out(t, p, whole.position, variance, segment, std)
    for k in (5, 20, 33):
        blank = p.copy()
        blank[k] = np.nan
        without = smooth(t, blank, position_std=std, jerk_density=q)
        apart = p[k] - without.position[k]
        assert distance[k, 0] == pytest.approx(np.hypot(apart[0], apart[1]), rel=1e-6)
        assert distance[k, 1] == pytest.approx(abs(apart[2]), rel=1e-6)


def test_innovations_of_the_models_own_motion_are_within_the_gate() -> None:
    """White jerk and white noise drawn: ratios of one axis average 1 less what surprise allows."""
    rng = np.random.default_rng(5)
    n, dt, q = 4000, 0.05, 4.0
    t = dt * np.arange(n)
    a = np.cumsum(np.sqrt(q * dt) * rng.normal(size=(n, 3)), axis=0)
    p = np.cumsum(np.cumsum(a, axis=0) * dt, axis=0) * dt
    std = np.full((n, 3), 1.0)
    found = gate.innovations(t, p + rng.normal(size=p.shape), std, None, std, np.full(3, q))
    # Surprise adds 15 * 0.05^2 / 2 = 0.02 m to 1 m: nothing.
    assert found.ratio[100:, 1].mean() == pytest.approx(1.0, abs=0.1)
    assert found.ratio.max() < gate.GATE_SIGMAS**2


def test_two_axes_are_as_unlikely_at_the_gate_as_one() -> None:
    """P(chi2_2 > x) = exp(-x/2) in closed form; of one axis erfc(5.5 / sqrt 2) by definition."""
    from math import erfc, exp, sqrt

    scale = gate._of_two_axes()
    both = exp(-scale * gate.GATE_SIGMAS**2 / 2)
    assert both == pytest.approx(erfc(gate.GATE_SIGMAS / sqrt(2)), rel=0.01)


def test_crossing_the_date_line_loses_nothing() -> None:
    t = np.arange(200.0)
    lon = 179.99 + 40.0 * t / 111_320.0
    lon = np.where(lon > 180, lon - 360, lon)
    track = replace(
        track_of(t, circling(t)), position_ned=None, lat=0 * t, lon=lon, altitude=500 + 0 * t
    )
    flown, rejected = reconstruct_checked(track)
    assert rejected.counts == {}
    assert flown['speed'].max() < 45.0


@pytest.mark.parametrize('n', [2, 3, 4, 6])
def test_a_handful_of_wild_samples_is_left_as_it_is(n: int) -> None:
    """With so few there is nothing to say which is wrong."""
    rng = np.random.default_rng(n)
    flown, rejected = replayed(np.arange(float(n)), 1e4 * rng.normal(size=(n, 3)))
    assert len(flown) + rejected.samples == n
    assert len(flown) >= 2


@pytest.mark.parametrize('noise', [3.0, 1000.0])
def test_judging_takes_time_in_proportion_to_the_samples(
    noise: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A noisy walk began anew all the time, and each time all that was left was filtered."""
    filtered = []

    def counted(time: Array, *rest: object) -> gate.Innovations:
        filtered.append(time.size)
        return gate.innovations(time, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(outliers, 'innovations', counted)
    t = np.arange(8000) / 200
    rng = np.random.default_rng(5)
    p = np.cumsum(rng.normal(0, 1.1, (t.size, 3)), axis=0) + rng.normal(0, noise, (t.size, 3))
    flown, rejected = replayed(t, p, position_std=np.full((t.size, 3), 1.5))
    assert outliers.POSITION in rejected.refused
    assert len(flown) == t.size
    # In each round once over all samples, and a few times as far as each beginning found.
    assert sum(filtered) < 10 * t.size
