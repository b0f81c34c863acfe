"""Long logs: what is shown first, and that all of it is what a replay makes of the whole."""

from pathlib import Path

import numpy as np
import pytest

from flightdyn.logs.any_log import read_track
from flightdyn.replay import opening
from flightdyn.replay.opening import open_track
from flightdyn.replay.report import replay_log, replay_track

DISCUS = Path(__file__).parents[1] / 'data/discus2_thermal.mcap'


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a log of some hundred samples be a long one."""
    monkeypatch.setattr(opening, 'AT_ONCE', 400)
    monkeypatch.setattr(opening, 'FIRST', 400)
    monkeypatch.setattr(opening, 'AHEAD', 60)


def test_a_short_log_is_complete_at_once() -> None:
    opened = open_track(read_track(DISCUS, end=100.0))
    assert opened.complete
    assert opened.whole() is opened.known
    assert opened.end == 100.0
    assert len(opened.known.trajectory) == 101


def test_the_whole_is_what_replay_log_returns(short: None) -> None:
    opened = open_track(read_track(DISCUS, start=10.0))
    assert not opened.complete
    whole, expected = opened.whole().trajectory, replay_log(DISCUS, start=10.0).trajectory
    for name, values in expected.columns.items():
        np.testing.assert_array_equal(whole[name], values, err_msg=name)
    assert opened.end == expected.time[-1]


def test_what_is_shown_first_is_a_replay_of_a_shorter_log(short: None) -> None:
    known = open_track(read_track(DISCUS)).known.trajectory
    assert len(known) == 400
    shorter = replay_track(read_track(DISCUS).first(460)).trajectory
    np.testing.assert_array_equal(known['speed'], shorter['speed'][:400])


def test_what_is_shown_first_is_near_the_whole(short: None) -> None:
    """A glider circles from the first to the last sample: it goes on as it began."""
    opened = open_track(read_track(DISCUS))
    known, whole = opened.known.trajectory, opened.whole().trajectory
    np.testing.assert_array_equal(known.time, whole.time[:400])
    for name in ('x_e', 'y_e', 'z_e', 'speed'):
        apart = np.abs(known[name] - whole[name][:400])
        assert apart.max() < np.median(whole[f'{name}_std']), name


def test_whole_on_demand(short: None) -> None:
    assert open_track(read_track(DISCUS), whole=True).complete


def test_track_first_cuts_every_column() -> None:
    track = read_track(DISCUS)
    cut = track.first(7)
    assert len(cut) == 7
    assert cut.lat is not None
    assert cut.lat.shape == cut.segment.shape == (7,)
    assert cut.messages == track.messages
