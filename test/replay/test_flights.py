"""Take-offs and landings, of flights whose times are known."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from flightdyn.errors import InputError
from flightdyn.logs.track import Track
from flightdyn.replay import replay_log
from flightdyn.replay.flights import Flight, find_flights
from flightdyn.replay.reconstruct import reconstruct
from flightdyn.trajectory import Trajectory

Array = NDArray[np.float64]

LEG = [(60, 0, 0), (20, 2, 0), (10, 25, 0), (60, 40, 4), (120, 45, 0), (60, 40, -4), (20, 15, 0)]
"""Seconds, speed over the ground, climb: stands, taxies, rolls, climbs, cruises, sinks, rolls."""


def flown(*legs: tuple[float, float, float], noise: float = 0.3, **more: object) -> Trajectory:
    """Return the replay of legs of so many seconds at so much speed and climb [m/s]."""
    rng = np.random.default_rng(0)
    ground = np.concatenate([np.full(int(s), v, float) for s, v, _ in legs])
    climb = np.concatenate([np.full(int(s), w, float) for s, _, w in legs])
    place = np.stack((np.cumsum(ground), 0 * ground, -100 - np.cumsum(climb)), axis=1)
    t = np.arange(ground.size)
    columns: dict[str, object] = {
        'time_ns': t * 10**9,
        'segment': np.zeros(t.size, np.int64),
        'position_ned': place + noise * rng.normal(size=place.shape),
    }
    return reconstruct(Track(**(columns | more)))  # type: ignore[arg-type]


def assert_flight(found: Flight, start: float, end: float) -> None:
    # A vehicle lifts off within the few seconds over which the smoother sees the climb begin.
    assert found.start == pytest.approx(start, abs=4)
    assert found.end == pytest.approx(end, abs=4)


def test_two_flights_in_one_log_are_two() -> None:
    found = find_flights(flown(*LEG, *LEG, (60, 0, 0)))
    assert len(found) == 2
    assert_flight(found[0], 90, 330)
    assert_flight(found[1], 440, 680)
    assert all(flight.takeoff and flight.landing for flight in found)


def test_a_log_that_begins_and_ends_in_flight() -> None:
    found = find_flights(flown(*LEG[3:6]))
    assert found == [Flight(0.0, 239.0, takeoff=False, landing=False)]


def test_taxiing_over_a_slope_and_standing_is_no_flight() -> None:
    assert find_flights(flown((60, 0, 0), (300, 8, 0.04), (60, 0, 0))) == []
    assert find_flights(flown((300, 0, 0))) == []


def test_a_hover_is_no_landing() -> None:
    stand, up, down = (30, 0, 0), (20, 0, 2), (20, 0, -2)
    found = find_flights(flown(stand, up, (60, 0, 0), (10, 5, 0), down, stand))
    assert len(found) == 1
    assert_flight(found[0], 30, 140)


def test_a_glide_from_a_hill_has_flown() -> None:
    found = find_flights(flown((30, 0, 0), (200, 11, -1.5), (30, 0, 0)))
    assert len(found) == 1
    assert_flight(found[0], 30, 230)


def test_a_gap_in_flight_does_not_end_it() -> None:
    t = np.arange(350)
    with_gap = flown(*LEG, time_ns=(t + 400 * (t > 200)) * 10**9, segment=(t > 200) * 1)
    found = find_flights(with_gap)
    assert len(found) == 1
    assert_flight(found[0], 90, 330 + 400)


def test_a_gap_in_which_it_went_nowhere_hides_a_landing() -> None:
    t = np.arange(240)
    in_the_air = flown(*LEG[3:6], time_ns=(t + 5000 * (t > 120)) * 10**9, segment=(t > 120) * 1)
    found = find_flights(in_the_air)
    assert [(f.start, f.end) for f in found] == [(0.0, 120.0), (5121.0, 5239.0)]


def test_one_flight_of_a_log_is_replayed_alone() -> None:
    log = Path(__file__).parent.parent / 'data' / 'discus2_thermal.mcap'
    whole = replay_log(log)
    (flight,) = whole.flights()
    assert not flight.takeoff
    assert not flight.landing
    one = replay_log(log, flight=1, start=100.0, end=400.0)
    assert one.trajectory.duration == pytest.approx(300.0)
    with pytest.raises(InputError, match=r'no flight 2: there are 1 from 0 to 899 s'):
        replay_log(log, flight=2)
