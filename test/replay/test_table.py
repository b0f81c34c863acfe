"""A replay written to a table and read back."""

from pathlib import Path

import numpy as np
import pytest

from flightdyn import tables
from flightdyn.errors import InputError
from flightdyn.logs.track import Track
from flightdyn.replay import reconstruct
from flightdyn.replay.table import COLUMNS, read_table, trajectory_to_columns, write_table
from flightdyn.trajectory import Trajectory


@pytest.fixture(scope='module')
def flown() -> Trajectory:
    rng = np.random.default_rng(0)
    n = 80
    return reconstruct(
        Track(
            time_ns=1_600_000_000_123_456_789 + np.arange(n) * 1_000_000_007,
            segment=np.repeat([0, 1], [50, 30]),
            lat=47 + 3e-4 * np.arange(n) + 1e-6 * rng.normal(size=n),
            lon=8 + 1e-4 * np.arange(n),
            altitude=500.0 + np.arange(n),
        )
    )


@pytest.fixture
def local() -> Trajectory:
    t = np.arange(20)
    return reconstruct(
        Track(
            time_ns=t * 10**9,
            segment=np.zeros(20, np.int64),
            position_ned=np.stack((5.0 * t, 0.0 * t, -1.0 * t), axis=1),
        )
    )


@pytest.mark.parametrize('suffix', ['.csv', '.parquet'])
def test_round_trip(flown: Trajectory, tmp_path: Path, suffix: str) -> None:
    if suffix == '.parquet':
        pytest.importorskip('pyarrow')
    path = tmp_path / f'flight{suffix}'
    write_table(flown, path)
    back = read_table(path)
    assert list(back.states) == list(flown.states)
    assert list(back.controls) == list(flown.controls)
    assert set(back.outputs) == set(flown.outputs)
    for name, values in flown.columns.items():
        np.testing.assert_array_equal(back[name], values)
    np.testing.assert_array_equal(back.unix_ns, flown.unix_ns)
    np.testing.assert_array_equal(back.time, flown.time)
    np.testing.assert_array_equal(back.segment, flown.segment)
    assert back.model == flown.model
    assert back.origin is not None
    assert flown.origin is not None
    # CSV does not hold the origin: it is solved for, to a micrometre.
    assert back.origin.lat == pytest.approx(flown.origin.lat, abs=1e-11)
    assert back.origin.lon == pytest.approx(flown.origin.lon, abs=1e-11)
    assert back.origin.altitude == pytest.approx(flown.origin.altitude, abs=1e-6)


def test_columns_of_the_file(flown: Trajectory, tmp_path: Path) -> None:
    path = tmp_path / 'flight.csv'
    write_table(flown, path)
    columns, _ = tables.read_table(path)
    assert tuple(columns) == COLUMNS
    assert columns['t'].dtype == np.int64
    assert columns['t'][1] - columns['t'][0] == 1_000_000_007


def test_a_part_keeps_its_dates_and_origin(flown: Trajectory, tmp_path: Path) -> None:
    part = flown.between(60.0, 70.0)
    path = tmp_path / 'part.csv'
    write_table(part, path)
    back = read_table(path)
    np.testing.assert_array_equal(back.unix_ns, part.unix_ns)
    assert back.origin is not None
    assert flown.origin is not None
    assert back.origin.lat == pytest.approx(flown.origin.lat, abs=1e-10)


def test_a_local_replay_has_no_lat_and_lon(local: Trajectory, tmp_path: Path) -> None:
    columns = trajectory_to_columns(local)
    assert 'lat' not in columns
    np.testing.assert_array_equal(columns['altitude'], -local['z_e'])
    path = tmp_path / 'local.csv'
    write_table(local, path)
    back = read_table(path)
    assert back.origin is None
    assert set(back.outputs) == set(local.outputs)


def test_another_table_is_refused(tmp_path: Path) -> None:
    path = tmp_path / 'other.csv'
    tables.write_table({'t': [1, 2], 'x_e': [0.0, 1.0]}, path)
    with pytest.raises(InputError, match='no column segment, y_e'):
        read_table(path)
