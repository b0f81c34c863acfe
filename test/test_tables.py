"""Tables come back as they were written, or not at all."""

import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightdyn import tables
from flightdyn.errors import InputError, MissingExtraError
from flightdyn.files import written_whole

COLUMNS = {
    't': np.array([1_532_865_178_000_000_001, 1_532_865_178_000_000_002], np.int64),
    'x_e': np.array([0.1 + 0.2, -1e-300]),
    'whole': np.array([3.0, 4.0]),
    'name': np.array(['a, "b"', 'ü']),
}


@pytest.fixture(params=tables.SUFFIXES)
def path(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    if request.param == '.parquet':
        pytest.importorskip('pyarrow')
    return tmp_path / f'table{request.param}'


def test_columns_come_back_with_type_and_every_bit(path: Path) -> None:
    tables.write_table(COLUMNS, path, {'key': 'value'})
    columns, metadata = tables.read_table(path)
    assert list(columns) == list(COLUMNS)
    for name, values in COLUMNS.items():
        np.testing.assert_array_equal(columns[name], values)
    assert columns['t'].dtype == np.int64
    assert columns['whole'].dtype == np.float64
    assert metadata == ({'key': 'value'} if path.suffix == '.parquet' else {})


def test_a_table_without_rows(path: Path) -> None:
    tables.write_table({'t': np.array([], np.int64), 'x': np.array([])}, path)
    columns, _ = tables.read_table(path)
    assert [values.size for values in columns.values()] == [0, 0]


def test_a_file_is_replaced_whole_and_nothing_is_left_over(path: Path) -> None:
    tables.write_table({'x': [1.0, 2.0]}, path)
    tables.write_table({'x': [3.0]}, path)
    np.testing.assert_array_equal(tables.read_table(path)[0]['x'], [3.0])
    assert list(path.parent.iterdir()) == [path]


def test_a_failure_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / 'kept.csv'
    path.write_text('old')

    def fail_half_way() -> None:
        with written_whole(path) as temporary:
            temporary.write_text('half')
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail_half_way()
    assert path.read_text() == 'old'
    assert list(tmp_path.iterdir()) == [path]


def test_bad_requests_say_what_would_be_right(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r'\.csv or \.parquet'):
        tables.write_table({'x': [1]}, tmp_path / 'a.xlsx')
    with pytest.raises(InputError, match='no folder'):
        tables.write_table({'x': [1]}, tmp_path / 'nowhere' / 'a.csv')
    with pytest.raises(InputError, match=r'x \(1,\), y \(2,\)'):
        tables.write_table({'x': [1], 'y': [1, 2]}, tmp_path / 'a.csv')
    with pytest.raises(InputError, match='no file'):
        tables.read_table(tmp_path / 'a.csv')
    (tmp_path / 'folder.csv').mkdir()
    with pytest.raises(InputError, match='folder'):
        tables.write_table({'x': [1]}, tmp_path / 'folder.csv')


@pytest.mark.parametrize(
    ('text', 'says'),
    [('', 'empty'), ('a,b\n1\n', 'line 2'), ('a,a\n1,2\n', 'same name'), ('a\n"1\n', 'CSV')],
)
def test_broken_csv_is_refused(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / 'broken.csv'
    path.write_text(text)
    with pytest.raises(InputError, match=says):
        tables.read_table(path)


def test_broken_parquet_is_refused(tmp_path: Path) -> None:
    pytest.importorskip('pyarrow')
    path = tmp_path / 'broken.parquet'
    path.write_bytes(b'not parquet')
    with pytest.raises(InputError, match='not a Parquet file'):
        tables.read_table(path)


def test_parquet_without_pyarrow_names_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, 'pyarrow', None)
    with pytest.raises(MissingExtraError, match='view'):
        tables.write_table({'x': [1.0]}, tmp_path / 'a.parquet')
    assert not list(tmp_path.iterdir())


@settings(derandomize=True, deadline=None)
@given(values=st.lists(st.floats(), max_size=20), whole=st.integers(-(2**63), 2**63 - 1))
def test_any_float_and_integer_survives_csv(
    tmp_path_factory: pytest.TempPathFactory, values: list[float], whole: int
) -> None:
    path = tmp_path_factory.mktemp('csv') / 'a.csv'
    tables.write_table({'x': values, 'n': np.full(len(values), whole, np.int64)}, path)
    columns, _ = tables.read_table(path)
    np.testing.assert_array_equal(columns['x'], np.array(values, float))
    np.testing.assert_array_equal(columns['n'], np.full(len(values), whole))
