"""What a replay says of itself."""

import json
from dataclasses import replace

import numpy as np
import pytest

from flightdyn.logs.track import Track
from flightdyn.replay import Replay, reconstruct


@pytest.fixture
def replay() -> Replay:
    t = np.concatenate((np.arange(60.0), np.arange(200.0, 240.0), [300.0]))
    time_ns = 10**18 + (t * 1e9).astype(np.int64)
    time_ns[7] = time_ns[6]
    track = Track(
        time_ns=time_ns,
        segment=np.repeat([0, 1, 2], [60, 40, 1]),
        position_ned=np.stack((20 * t, 0 * t, -2 * t), axis=1),
        file='a.mcap',
        source='/fix',
        schema='sensor_msgs/msg/NavSatFix',
        altitude_datum='local',
        messages=104,
        dropped={'no fix': 3},
        warnings=['from the reader'],
    )
    return Replay(track, reconstruct(track))


def test_summary(replay: Replay) -> None:
    summary = json.loads(json.dumps(replay.summary()))
    assert list(summary) == [
        *('file', 'source', 'schema', 'altitude_datum', 'clock', 'messages', 'used', 'dropped'),
        *(
            'segments',
            'flights',
            'origin',
            'duration_s',
            'distance_m',
            'max_speed',
            'max_altitude',
        ),
        *('wind', 'warnings'),
    ]
    assert summary['used'] + sum(summary['dropped'].values()) == summary['messages']
    assert [s['samples'] for s in summary['segments']] == [59, 40, 1]
    assert summary['segments'][1] == {'start': 200.0, 'end': 239.0, 'samples': 40}
    assert summary['duration_s'] == 300.0
    # 59 s and 39 s of flight, nothing across the gaps.
    assert summary['distance_m'] == pytest.approx(98 * np.hypot(20, 2), rel=0.02)
    assert summary['max_altitude'] == pytest.approx(600, abs=1)
    assert summary['origin'] is None
    assert summary['warnings'][0] == 'from the reader'
    assert any('1 samples had the time' in w for w in summary['warnings'])
    assert any('1 segments of one or two' in w for w in summary['warnings'])


def test_a_wind_that_was_asked_for_and_not_found_is_told(replay: Replay) -> None:
    for method, reason in (('circling', 'full turn'), ('airspeed', 'recorded true airspeed')):
        summary = replace(replay, wind=method).summary()  # type: ignore[arg-type]
        assert summary['wind'] is None
        assert any(reason in w for w in summary['warnings'])


def test_the_wind_is_told_by_where_it_comes_from(replay: Replay) -> None:
    flown = replay.trajectory
    blowing = np.ones(len(flown))
    told = replace(
        flown,
        outputs=flown.outputs
        | {'wind_x_e': -3 * blowing, 'wind_y_e': -4 * blowing, 'wind_std': 0.5 * blowing},
    )
    wind = replace(replay, trajectory=told, wind='circling').summary()['wind']
    assert wind == {
        'method': 'circling',
        'speed': pytest.approx(5.0),
        'from_deg': pytest.approx(53.13, abs=0.01),
        'std': 0.5,
    }
