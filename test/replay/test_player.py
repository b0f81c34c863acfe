"""The play clock, on a clock that moves only when told."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightdyn.errors import InputError
from flightdyn.replay.player import Player


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
    for bad in (0.0, -1.0, float('nan'), float('inf')):
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


steps = st.lists(st.floats(0, 30), min_size=1, max_size=30)


@settings(derandomize=True, deadline=None)
@given(steps=steps, at=st.floats(-0.2, 1.2), rate=st.floats(0.1, 20), waste=st.floats(0, 100))
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
    first = int(np.searchsorted(times, t))
    assert [i for i, _ in played] == list(range(first, times.size))
    expected = (times[first:] - t) / rate
    np.testing.assert_allclose([w for _, w in played], expected, atol=1e-8)


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
