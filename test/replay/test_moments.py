"""Moments of a replay by name: hand-worked times of a flight with a gap."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from flightdyn.errors import InputError
from flightdyn.replay.moments import EVENTS, KINDS, moment, names_event
from flightdyn.trajectory import Trajectory

BEGAN = datetime(2024, 6, 1, 12, 0, tzinfo=UTC)


@pytest.fixture
def flown() -> Trajectory:
    """Stand for 20 s, fly at 10 m/s 50 m up to 180 s, stand; 100 s of the flight missing."""
    t = np.concatenate((np.arange(50.0), np.arange(150.0, 201.0)))
    standing = (t < 20) | (t > 180)
    height = np.interp(t, [20, 30, 170, 180], [0, 50, 50, 0])
    return Trajectory(
        time=t,
        states={
            'x_e': np.cumsum(np.where(standing, 0.0, 10.0)),
            'y_e': 0 * t,
            'z_e': -height,
            'speed': np.where(standing, 0.0, 10.0),
        },
        start_ns=int(BEGAN.timestamp()) * 10**9,
        segment=(t > 100).astype(int),
    )


@pytest.mark.parametrize(
    ('text', 'seconds'),
    [
        ('25', 25.0),
        (' 25.5 ', 25.5),
        ('+5', 35.0),
        ('-7.5', 22.5),
        ('start', 0.0),
        ('end', 200.0),
        ('end - 10', 190.0),
        ('start+1.5', 1.5),
        ('Segment 2', 150.0),
        ('segment2-1', 149.0),
        ('2024-06-01T12:01:30Z', 90.0),
        ('2024-06-01T12:01:30.250', 90.25),
        ('2024-06-01 14:01:30+02:00', 90.0),
    ],
)
def test_moments(flown: Trajectory, text: str, seconds: float) -> None:
    assert moment(text, flown, now=30.0, end=200.0) == pytest.approx(seconds, abs=1e-6)


def test_takeoff_and_landing_are_those_found(flown: Trajectory) -> None:
    takeoff = moment('takeoff', flown, now=0.0, end=200.0)
    landing = moment('landing 1', flown, now=0.0, end=200.0)
    assert takeoff == pytest.approx(20, abs=1)  # samples are 1 s apart
    assert landing == pytest.approx(181, abs=1)
    assert moment('takeoff+15', flown, now=0.0, end=200.0) == takeoff + 15
    assert moment('flight', flown, now=0.0, end=200.0) == takeoff


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('noon', 'takeoff'),
        ('', 'seconds'),
        ('nan', 'seconds'),
        ('1e400', 'seconds'),
        ('201', 'outside the log, which is 0.000 s to 200.000 s, 2024-06-01T12:00:00.000Z'),
        ('-31', 'outside'),
        ('2024-06-02T12:01:30Z', 'outside'),
        ('takeoff 2', 'there is no takeoff 2; found: '),
        ('segment 3', 'but 2 of them'),
        ('start 2', 'one start only'),
    ],
)
def test_what_cannot_be_is_refused(flown: Trajectory, text: str, words: str) -> None:
    with pytest.raises(InputError) as refused:
        moment(text, flown, now=30.0, end=200.0)
    assert words in str(refused.value)


def test_events_are_told_from_other_moments() -> None:
    assert all(names_event(f' {name.title()} 2+1') for name in EVENTS)
    assert not any(names_event(text) for text in ('90', 'start', 'segment 2', '2024-06-01T12:00Z'))
    assert all(name in KINDS for name in EVENTS)


def test_a_moment_is_exact_to_the_microsecond(flown: Trajectory) -> None:
    told = (BEGAN + timedelta(seconds=90, microseconds=1)).isoformat()
    assert moment(told, flown, now=0.0, end=200.0) == pytest.approx(90.000001, abs=1e-9)
