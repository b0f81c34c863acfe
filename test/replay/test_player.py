"""The play clock, on a clock that moves only when told."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightdyn.errors import InputError
from flightdyn.logs.any_log import read_track
from flightdyn.replay.player import Player, checked_rate
from flightdyn.replay.samples import merge_repeats

LOGS = ('discus2_thermal', 'px4_zurich_navsatfix', 'px4_zurich_px4msgs')


class FakeClock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> FakeClock:
    return FakeClock()


def play_out(player: Player, clock: FakeClock, most: int = 10_000) -> list[tuple[int, float]]:
    """Return (index, wall seconds from now) of all samples, sleeping exactly as told."""
    began, played = clock.now, []
    for _ in range(most):
        played += [(i, clock.now - began) for i in player.advance()]
        wait = player.next_due()
        if wait is None:
            return played
        clock.now += wait
    raise AssertionError(f'still playing after {most} rounds')


def test_plays_each_sample_once_when_it_is_due(clock: FakeClock) -> None:
    player = Player([5.0, 5.5, 7.0], clock=clock)
    assert player.advance() == range(1)
    assert player.advance() == range(1, 1)
    assert player.next_due() == pytest.approx(0.5)
    clock.now += 0.4
    assert not player.advance()
    assert player.time == pytest.approx(5.4)
    clock.now += 2.0
    assert player.advance() == range(1, 3)
    assert player.next_due() is None
    assert player.is_finished
    assert player.time == 7.0


def test_advance_and_next_due_take_a_reading_of_the_clock(clock: FakeClock) -> None:
    player = Player([0.0, 1.0, 2.0], clock=clock)
    assert player.advance(101.2) == range(2)
    assert player.next_due(101.2) == pytest.approx(0.8)


def test_pause_holds_time_and_resume_goes_on_from_there(clock: FakeClock) -> None:
    player = Player([0.0, 1.0, 2.0], clock=clock)
    player.advance()
    clock.now += 0.6
    player.pause()
    player.pause()
    clock.now += 50
    assert player.is_paused()
    assert not player.advance()
    assert player.next_due() is None
    assert player.time == pytest.approx(0.6)
    player.resume()
    player.resume()
    assert player.next_due() == pytest.approx(0.4)
    assert player.toggle() is True
    assert player.toggle() is False


def test_rate_scales_wall_time_and_changes_on_the_way(clock: FakeClock) -> None:
    player = Player([0.0, 10.0], rate=4.0, clock=clock)
    player.advance()
    assert player.next_due() == pytest.approx(2.5)
    clock.now += 1.0
    player.set_rate(0.5)
    assert player.get_rate() == 0.5
    assert player.time == pytest.approx(4.0)
    assert player.next_due() == pytest.approx(12.0)
    for bad in (0.0, float('nan'), float('inf')):
        with pytest.raises(InputError, match='rate'):
            player.set_rate(bad)


def test_rate_can_be_set_while_paused(clock: FakeClock) -> None:
    player = Player([0.0, 10.0], paused=True, clock=clock)
    clock.now += 5
    player.set_rate(2.0)
    assert player.time == 0.0
    player.resume()
    assert play_out(player, clock) == [(0, 0.0), (1, pytest.approx(5.0))]


def test_play_next_and_burst_only_while_paused(clock: FakeClock) -> None:
    player = Player([0.0, 1.0, 2.0, 3.0, 4.0], clock=clock)
    assert not player.play_next()
    player.pause()
    assert player.play_next() == range(1)
    assert player.play_next() == range(1, 2)
    assert player.time == 1.0
    assert player.burst(2) == range(2, 4)
    assert player.time == 3.0
    player.resume()
    assert player.next_due() == pytest.approx(1.0)
    player.pause()
    assert player.burst() == range(4, 5)
    assert not player.play_next()
    with pytest.raises(InputError, match='burst'):
        player.burst(-1)


def test_stop_ends_it_until_seek(clock: FakeClock) -> None:
    player = Player([0.0, 1.0, 2.0], clock=clock)
    player.advance()
    clock.now += 0.5
    player.stop()
    clock.now += 5
    assert player.is_finished
    assert not player.advance()
    assert player.next_due() is None
    assert player.time == pytest.approx(0.5)
    player.seek(1.0)
    assert player.advance() == range(1, 2)


def test_loop_starts_again_one_interval_after_the_end(clock: FakeClock) -> None:
    player = Player([0.0, 1.0, 2.0], loop=True, clock=clock)
    seen = []
    for _ in range(7):
        wait = player.next_due()
        assert wait is not None
        clock.now += wait
        seen += [(i, clock.now - 100.0) for i in player.advance()]
    assert seen == [(i % 3, pytest.approx(i)) for i in range(7)]
    assert player.jumps == 2
    assert not player.is_finished


def test_a_loop_left_alone_does_not_play_many_rounds_at_once(clock: FakeClock) -> None:
    player = Player([0.0, 1.0, 2.0], loop=True, clock=clock)
    player.advance()
    clock.now += 1000
    assert player.advance() == range(1, 3)
    assert len(player.advance()) <= 2


def test_a_loop_over_one_sample_does_not_spin(clock: FakeClock) -> None:
    player = Player([3.0], loop=True, clock=clock)
    assert player.advance() == range(1)
    assert player.next_due() == pytest.approx(1.0)


def test_long_gaps_can_be_shortened(clock: FakeClock) -> None:
    player = Player([0.0, 1.0, 3601.0, 3602.0], max_gap=2.0, clock=clock)
    assert play_out(player, clock) == [(i, pytest.approx(w)) for i, w in enumerate([0, 1, 3, 4])]
    player.seek(1800.0)
    assert player.next_due() == pytest.approx(2.0)
    assert player.advance() == range(2, 2)
    player.seek(3600.5)
    assert player.next_due() == pytest.approx(0.5)


def test_a_clock_set_back_between_segments_takes_no_time(clock: FakeClock) -> None:
    player = Player([10.0, 11.0, 4.0, 5.0], clock=clock)
    assert play_out(player, clock) == [(i, pytest.approx(w)) for i, w in enumerate([0, 1, 1, 2])]


def test_seek_beyond_the_ends_means_the_ends(clock: FakeClock) -> None:
    player = Player([1.0, 2.0, 3.0], clock=clock)
    player.seek(-50)
    assert player.advance() == range(1)
    player.seek(50)
    assert player.advance() == range(2, 3)
    with pytest.raises(InputError, match='seek'):
        player.seek(float('nan'))


@pytest.mark.parametrize(
    'wrong', [{'times': []}, {'times': [0, np.nan]}, {'times': [0], 'max_gap': 0.0}]
)
def test_bad_input_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(InputError):
        Player(**wrong)  # type: ignore[arg-type]


def test_backwards_visits_the_same_samples_at_the_same_times(clock: FakeClock) -> None:
    player = Player([5.0, 5.5, 7.0], rate=-2.0, clock=clock)
    assert player.time == 7.0
    assert play_out(player, clock) == [(2, 0.0), (1, 0.75), (0, 1.0)]
    assert player.time == 5.0
    assert player.is_finished


def test_a_turn_does_not_play_the_last_sample_again(clock: FakeClock) -> None:
    player = Player([0.0, 1.0, 2.0, 3.0], clock=clock)
    clock.now += 2.5
    assert player.advance() == range(3)
    player.set_rate(-1.0)
    clock.now += 1.0
    assert player.time == pytest.approx(1.5)
    assert not player.advance()
    clock.now += 0.6
    assert player.advance() == range(1, 0, -1)
    player.set_rate(1.0)
    assert play_out(player, clock) == [(2, pytest.approx(1.1)), (3, pytest.approx(2.1))]


def test_a_turn_long_after_the_end_begins_at_the_end(clock: FakeClock) -> None:
    player = Player([0.0, 1.0, 2.0], clock=clock)
    clock.now += 1000
    player.advance()
    player.set_rate(-1.0)
    assert play_out(player, clock) == [(1, pytest.approx(1.0)), (0, pytest.approx(2.0))]


def test_a_turn_before_a_sample_was_fetched_does_not_lose_it(clock: FakeClock) -> None:
    player = Player([0.0, 1.0, 2.0, 3.0], clock=clock)
    player.advance()
    clock.now += 2.5  # 1 and 2 are due, and nobody asked
    player.set_rate(-1.0)
    assert player.time == 1.0
    player.set_rate(1.0)
    assert [i for i, _ in play_out(player, clock)] == [1, 2, 3]


def test_step_back_and_forth_while_paused(clock: FakeClock) -> None:
    player = Player([0.0, 1.0, 2.0, 3.0], paused=True, clock=clock)
    assert not player.play_previous()
    player.burst(3)
    assert player.play_previous() == range(1, 2)
    assert player.time == 1.0
    assert player.play_next() == range(2, 3)
    player.set_rate(-1.0)
    assert player.play_next() == range(1, 0, -1)
    assert player.play_previous() == range(2, 3)
    assert player.burst() == range(1, -1, -1)
    assert not player.play_next()
    player.seek(2.0)
    assert player.play_previous() == range(2, 3)
    player.resume()
    assert not player.play_previous()


def test_backwards_loop_starts_again_at_the_end(clock: FakeClock) -> None:
    player = Player([0.0, 1.0, 2.0], rate=-1.0, loop=True, clock=clock)
    seen = []
    for _ in range(7):
        wait = player.next_due()
        assert wait is not None
        clock.now += wait
        seen += [(i, clock.now - 100.0) for i in player.advance()]
    assert seen == [(2 - i % 3, pytest.approx(i)) for i in range(7)]


def test_play_for_a_while_from_a_time(clock: FakeClock) -> None:
    player = Player([0.0, 1.0, 2.0, 3.0, 4.0], paused=True, clock=clock)
    player.play(1.0, 2.0)
    with pytest.raises(InputError, match='playing already'):
        player.play()
    assert [i for i, _ in play_out(player, clock)] == [1, 2, 3]
    assert player.is_finished
    assert player.time == 3.0
    player.play(0.5, 0.2)  # nothing is in there, but it ends
    assert play_out(player, clock) == []
    assert player.time == pytest.approx(0.7)
    player.play()
    assert [i for i, _ in play_out(player, clock)] == [0, 1, 2, 3, 4]
    player.set_rate(-1.0)
    player.pause()
    player.play(duration=2.0)
    assert [i for i, _ in play_out(player, clock)] == [4, 3, 2]
    player.loop = True
    player.set_rate(1.0)
    player.pause()
    player.play(3.0, 4.0)  # round the end, which takes one interval
    assert [i for i, _ in play_out(player, clock)] == [3, 4, 0, 1, 2]
    with pytest.raises(InputError, match='duration'):
        player.play(0.0, -1.0)


def test_waits_at_the_last_sample_known_until_there_are_more(clock: FakeClock) -> None:
    player = Player([0.0, 1.0, 2.0], growing=True, loop=True, clock=clock)
    clock.now += 1000
    assert player.advance() == range(3)
    assert player.is_waiting
    assert not player.is_finished
    assert player.next_due() is None
    player.grow([0.0, 1.0, 2.0, 3.0, 4.0])
    assert not player.is_waiting
    assert player.jumps == 0
    assert player.next_due() == pytest.approx(1.0)
    player.loop = False
    assert [i for i, _ in play_out(player, clock)] == [3, 4]


def test_seek_beyond_what_is_known_is_done_when_it_is(clock: FakeClock) -> None:
    player = Player([0.0, 1.0], growing=True, paused=True, clock=clock)
    player.play(2.0, 1.0)
    assert player.is_waiting
    assert not player.is_finished
    clock.now += 10
    assert not player.advance()
    player.grow(np.arange(6.0))
    assert player.time == 2.0
    assert player.jumps == 1
    assert [i for i, _ in play_out(player, clock)] == [2, 3]


def test_backwards_waits_for_the_end(clock: FakeClock) -> None:
    player = Player([0.0, 1.0], rate=-1.0, growing=True, clock=clock)
    assert player.is_waiting
    assert not player.advance()
    player.grow([0.0, 1.0, 2.0])
    assert [i for i, _ in play_out(player, clock)] == [2, 1, 0]


def test_grown_times_may_differ_from_those_known(clock: FakeClock) -> None:
    """The whole of a log may show an outlier that its first samples did not."""
    player = Player([0.0, 1.0, 2.0, 3.0], growing=True, clock=clock)
    clock.now += 1.5
    assert player.advance() == range(2)
    player.grow([1.0, 3.0, 4.0])  # without 0 and 2
    assert player.time == pytest.approx(1.5)
    assert play_out(player, clock) == [(1, pytest.approx(1.5)), (2, pytest.approx(2.5))]


def test_checked_rate() -> None:
    assert checked_rate(-2) == -2.0
    with pytest.raises(InputError, match='pause'):
        checked_rate(0.0)


steps = st.lists(st.floats(0, 30), min_size=1, max_size=30)
rates = st.floats(0.1, 20) | st.floats(-20, -0.1)


@settings(derandomize=True, deadline=None)
@given(steps=steps, at=st.floats(-0.2, 1.2), rate=rates, waste=st.floats(0, 100))
def test_seek_then_play_is_play_from_there(
    steps: list[float], at: float, rate: float, waste: float
) -> None:
    times = np.cumsum(steps)
    t = float(times[0] + at * (times[-1] - times[0]))
    clock = FakeClock()
    player = Player(times, rate=rate, clock=clock)
    player.advance()
    clock.now += waste
    player.advance()
    player.seek(t)
    played = play_out(player, clock)
    t = float(np.clip(t, times[0], times[-1]))
    ahead = np.flatnonzero(times >= t if rate > 0 else times <= t)[:: 1 if rate > 0 else -1]
    # of samples that share the time sought, backwards plays the first alone
    same = times[ahead] == t
    if rate < 0 and same.sum() > 1:
        ahead = ahead[int(same.sum()) - 1 :]
    assert [i for i, _ in played] == ahead.tolist()
    np.testing.assert_allclose([w for _, w in played], (times[ahead] - t) / rate, atol=1e-8)


@settings(derandomize=True, deadline=None)
@given(steps=steps, head=st.integers(1, 30), waste=st.floats(0, 300), rate=rates)
def test_grown_is_as_if_all_had_been_known(
    steps: list[float], head: int, waste: float, rate: float
) -> None:
    times = np.cumsum(steps)
    clock = FakeClock()
    player = Player(times[:head], rate=rate, growing=True, clock=clock)
    seen = [*player.advance()]
    clock.now += waste
    seen += player.advance()
    player.grow(times)
    seen += [i for i, _ in play_out(player, clock)]
    assert seen == list(range(len(steps)))[:: 1 if rate > 0 else -1]


@settings(derandomize=True, deadline=None)
@given(
    steps=steps,
    turns=st.lists(st.tuples(rates, st.floats(0, 60)), max_size=20),
    loop=st.booleans(),
)
def test_each_pass_over_a_sample_plays_it_once(
    steps: list[float], turns: list[tuple[float, float]], loop: bool
) -> None:
    """Whichever way it goes, the next sample is the neighbour of the last one that way."""
    clock = FakeClock()
    player = Player(np.cumsum(steps), loop=loop, clock=clock)
    last = player.advance()[-1]
    for rate, wait in turns:
        player.set_rate(rate)
        for _ in range(3):
            clock.now += wait / 3
            for index in player.advance():
                expected = last + (1 if rate > 0 else -1)
                assert index == (expected % len(steps) if loop else expected)
                last = index


@settings(derandomize=True, deadline=None)
@given(
    steps=steps,
    commands=st.lists(
        st.tuples(st.sampled_from(['wait', 'pause', 'resume', 'rate', 'next']), st.floats(0.1, 9)),
        max_size=40,
    ),
)
def test_whatever_happens_samples_come_once_and_in_order(
    steps: list[float], commands: list[tuple[str, float]]
) -> None:
    clock = FakeClock()
    player = Player(np.cumsum(steps), clock=clock)
    seen: list[int] = []
    last = player.time
    for name, value in commands:
        if name == 'wait':
            clock.now += value
        elif name == 'rate':
            player.set_rate(value)
        elif name == 'next':
            seen += player.play_next()
        else:
            getattr(player, name)()
        seen += player.advance()
        assert player.time >= last - 1e-9
        last = player.time
    player.resume()
    seen += [i for i, _ in play_out(player, clock)]
    assert seen == list(range(len(steps)))


@cache
def times_of(log: str) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return the times of a real log, which are not evenly spaced."""
    return merge_repeats(
        read_track(Path(__file__).parents[1] / f'data/{log}.mcap').first(300)
    ).time


@pytest.mark.parametrize('log', LOGS)
@settings(derandomize=True, deadline=None, max_examples=30)
@given(
    at=st.floats(0, 1),
    moves=st.lists(
        st.tuples(st.sampled_from(['play', 'pause', 'rate', 'turn']), st.floats(0.05, 50)),
        max_size=12,
    ),
)
def test_of_a_real_log_no_sample_is_lost_or_doubled(
    log: str, at: float, moves: list[tuple[str, float]]
) -> None:
    """From any place, through pauses, rates and turns: then all of it backwards."""
    times = times_of(log)
    clock = FakeClock()
    player = Player(times, clock=clock)
    start = float(at * times[-1])
    player.seek(start)
    ahead = int(np.searchsorted(times, start))
    gap = ahead - (times[ahead] != start), ahead  # what comes next, backwards and forwards
    for name, value in moves:
        if name == 'play':
            player.resume()
            clock.now += value / abs(player.get_rate())
        elif name == 'pause':
            player.pause()
            clock.now += value
        elif name == 'rate':
            player.set_rate(value if player.get_rate() > 0 else -value)
        else:
            player.set_rate(-player.get_rate())
        for index in player.advance():
            assert index == gap[1 if player.get_rate() > 0 else 0]
            gap = index - 1, index + 1
    player.resume()
    player.set_rate(-abs(player.get_rate()))
    rest = [i for i, _ in play_out(player, clock)]
    assert rest == list(range(gap[0], -1, -1))
