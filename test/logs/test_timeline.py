"""Which messages are used, in what order and where they break off."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from numpy.typing import NDArray

from flightdyn.logs.timeline import (
    GPS_ERA_S,
    MIN_GAP_S,
    WEEK_S,
    Rows,
    arrange,
    choose_clock,
    gap_limit,
)

S = 10**9


def sorted_out(seconds: list[float]) -> tuple[list[int], list[int], dict[str, int], list[str]]:
    time = np.round(np.array(seconds) * S).astype(np.int64)
    rows, warnings = Rows(np.zeros(time.size, np.uint8)), []
    index, segment = arrange(time, rows, warnings)
    return index.tolist(), segment.tolist(), rows.counts(np.ones(time.size, bool)), warnings


def test_repeated_times_are_dropped_and_counted() -> None:
    index, segment, dropped, _ = sorted_out([0, 1, 1, 1, 2, 3, 3])
    assert index == [0, 1, 4, 5]
    assert segment == [0] * 4
    assert dropped == {'repeated time': 3}


def test_a_step_back_begins_a_segment_and_interleaves_nothing() -> None:
    index, segment, _, warnings = sorted_out([0, 1, 2, 3, 4, 1.5, 2.5, 3.5, 4.5, 5.5])
    assert index == list(range(10))
    assert segment == [0] * 5 + [1] * 5
    assert 'steps back 1 times, first by 2.5 s after message 4' in warnings[0]


def test_neighbours_that_changed_places_are_put_right() -> None:
    index, segment, dropped, warnings = sorted_out([0, 1, 3, 2, 4, 5])
    assert index == [0, 1, 3, 2, 4, 5]
    assert segment == [0] * 6
    assert dropped == {}
    assert 'came one late' in warnings[0]


def test_a_gap_is_longer_than_ten_seconds_and_ten_samples() -> None:
    assert sorted_out([0, 1, 2, 12, 13])[1] == [0] * 5  # 10 s: not longer
    assert sorted_out([0, 1, 2, 12.1, 13])[1] == [0, 0, 0, 1, 1]
    slow = [0, 8, 16, 24, 100, 108, 116]  # 76 s is less than ten times 8 s
    assert sorted_out(slow)[1] == [0] * 7


def test_stamps_are_used_where_drivers_fill_them() -> None:
    log = np.arange(5, dtype=np.int64) * S + 10 * S
    for stamp, expected, note in (
        (log - 3 * S, log - 3 * S, None),
        (np.zeros(5, np.int64), log, 'not set'),
        (np.full(5, 7 * S), log, 'never change'),
        (np.full(5, -1), log, 'not set'),
    ):
        warnings: list[str] = []
        rows = Rows(np.zeros(5, np.uint8))
        assert_array_equal(choose_clock(stamp, log, rows, warnings), expected)
        assert rows.used.size == 5
        assert (note is None) == (not warnings)
        assert note is None or note in warnings[0]


def test_a_single_missing_stamp_drops_one_message() -> None:
    log = np.arange(5, dtype=np.int64) * S + 10 * S
    stamp = log - S
    stamp[2] = 0
    rows = Rows(np.zeros(5, np.uint8))
    choose_clock(stamp, log, rows, [])
    assert rows.used.tolist() == [0, 1, 3, 4]


def test_a_run_that_starts_at_zero_keeps_its_first_sample() -> None:
    log = np.arange(5, dtype=np.int64) * S
    rows = Rows(np.zeros(5, np.uint8))
    choose_clock(log.copy(), log, rows, [])
    assert rows.used.size == 5


def test_a_gap_is_ten_usual_steps_and_ten_seconds_at_least() -> None:
    assert gap_limit(np.full(9, 0.1)) == MIN_GAP_S
    assert gap_limit(np.array([8.0, 8.0, 8.0, 500.0])) == 80.0
    assert gap_limit(np.array([0.0, -3.0])) == MIN_GAP_S


NOW = 1_700_000_000 * S  # November 2023


def put_right(stamp: NDArray[np.int64], log: NDArray[np.int64]) -> tuple[NDArray[np.int64], str]:
    warnings: list[str] = []
    time = choose_clock(stamp, log, Rows(np.zeros(stamp.size, np.uint8)), warnings)
    assert time is not log
    return time, ' '.join(warnings)


def arrivals(number: int = 50) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return true times a second apart, and when each arrived, up to 0.1 s late."""
    true = NOW + np.arange(number, dtype=np.int64) * S
    return true, true + np.random.default_rng(0).integers(0, S // 10, number)


def test_stamps_since_the_start_get_the_date_of_the_recorder() -> None:
    true, log = arrivals()
    time, said = put_right(true - NOW + 25 * S, log)
    assert "from the vehicle's start" in said
    assert_array_equal(np.diff(time), S)  # evenly, as the stamps are
    assert abs(time - true).max() < S // 10


def test_a_receiver_that_took_the_wrong_1024_weeks() -> None:
    true, log = arrivals()
    time, said = put_right(true - GPS_ERA_S * S, log)
    assert '1024 weeks' in said
    assert_array_equal(time, true)


def test_gps_time_is_brought_to_utc() -> None:
    true, log = arrivals()
    time, said = put_right(true + 18 * S, log)
    assert 'leap seconds' in said
    assert_array_equal(time, true)


@pytest.mark.parametrize('ahead', [0.0, 1.0, 17.0, 18.6, -18.0, 3600.0])
def test_a_recorder_whose_clock_is_off_is_not_believed(ahead: float) -> None:
    true, log = arrivals()
    stamp = true + int(ahead * S)
    time, said = put_right(stamp, log)
    assert_array_equal(time, stamp)
    assert said == ''


@pytest.mark.parametrize(('period', 'what'), [(86_400, 'a day'), (WEEK_S, 'a week')])
def test_a_time_of_day_or_week_that_starts_anew(period: int, what: str) -> None:
    true, log = arrivals()
    stamp = true.copy()
    stamp[30:] -= period * S
    time, said = put_right(stamp, log)
    assert f'by {what}' in said
    assert_array_equal(time, true)


def test_a_day_back_that_the_recorder_saw_too_is_left() -> None:
    true, log = arrivals()
    true[30:] -= 86_400 * S
    log[30:] -= 86_400 * S
    assert_array_equal(put_right(true, log)[0], true)


def test_logs_of_simulated_time_are_left_alone() -> None:
    stamp = np.arange(50, dtype=np.int64) * S
    assert_array_equal(put_right(stamp + S, stamp + 2 * S)[0], stamp + S)
