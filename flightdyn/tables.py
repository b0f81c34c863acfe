"""Columns in .csv and .parquet files."""

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import InputError, MissingExtraError
from .files import written_whole

Table = dict[str, NDArray[Any]]

SUFFIXES = ('.csv', '.parquet')


def write_table(
    columns: Mapping[str, ArrayLike], path: str | Path, metadata: Mapping[str, str] | None = None
) -> None:
    """Write columns to a file, in the format its suffix names.

    The file appears whole or not at all, and replaces one of the same name.

    Parameters
    ----------
    columns : mapping of name to array (n,)
        Integers, floats or strings. Floats come back bit for bit.
    path : str or Path
        Ends in .csv or .parquet.
    metadata : mapping, optional
        Key-value text of the Parquet file. CSV has no place for it.

    Raises
    ------
    InputError
        If the suffix is unknown, the folder is missing or the columns differ in length.
    MissingExtraError
        If Parquet is asked for and pyarrow is not installed.
    """
    path = Path(path)
    _check_suffix(path)
    table = {str(name): np.asarray(values) for name, values in columns.items()}
    shapes = {values.shape for values in table.values()}
    if len(shapes) > 1 or any(len(shape) != 1 for shape in shapes):
        told = ', '.join(f'{name} {values.shape}' for name, values in table.items())
        raise InputError(f'{path.name}: columns must be 1-D and of one length, got {told}')
    with written_whole(path) as temporary:
        if path.suffix == '.csv':
            _write_csv(table, temporary)
        else:
            _write_parquet(table, temporary, metadata or {})


def read_table(path: str | Path) -> tuple[Table, dict[str, str]]:
    """Return the columns and the metadata of a file that `write_table` wrote.

    Columns of a .csv are integers, floats or strings by what they hold; its metadata is empty.

    Raises
    ------
    InputError
        If the file is missing, its suffix unknown or its content no table.
    MissingExtraError
        If Parquet is asked for and pyarrow is not installed.
    """
    path = Path(path)
    _check_suffix(path)
    if not path.is_file():
        raise InputError(f'no file {path}')
    return (_read_csv(path), {}) if path.suffix == '.csv' else _read_parquet(path)


def _check_suffix(path: Path) -> None:
    if path.suffix not in SUFFIXES:
        raise InputError(f'{path}: tables are {" or ".join(SUFFIXES)}, not {path.suffix!r}')


def _write_csv(table: Table, path: Path) -> None:
    with path.open('w', newline='', encoding='utf-8') as file:
        writer = csv.writer(file, lineterminator='\n')
        writer.writerow(table)
        # tolist() gives Python numbers, which csv writes by repr: the shortest exact text.
        writer.writerows(zip(*(values.tolist() for values in table.values()), strict=True))


def _read_csv(path: Path) -> Table:
    with path.open(newline='', encoding='utf-8') as file:
        try:
            rows = list(csv.reader(file, strict=True))
        except (csv.Error, UnicodeDecodeError) as error:
            raise InputError(f'{path} is not a CSV file: {error}') from error
    if not rows:
        raise InputError(f'{path} is empty: its first line should name the columns')
    names, body = rows[0], rows[1:]
    for number, row in enumerate(body, start=2):
        if len(row) != len(names):
            raise InputError(f'{path} line {number}: {len(row)} values, {len(names)} columns')
    if len(set(names)) < len(names):
        raise InputError(f'{path}: two columns have the same name')
    columns = zip(*body, strict=True) if body else [()] * len(names)
    return {name: _typed(list(values)) for name, values in zip(names, columns, strict=True)}


def _typed(values: list[str]) -> NDArray[Any]:
    for kind in (int, float):
        try:
            return np.array([kind(v) for v in values], np.int64 if kind is int else np.float64)
        except (ValueError, OverflowError):
            continue
    return np.array(values)


def _pyarrow() -> Any:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise MissingExtraError('parquet', 'view') from None
    return pyarrow


def _write_parquet(table: Table, path: Path, metadata: Mapping[str, str]) -> None:
    pa = _pyarrow()
    arrow = pa.table({name: pa.array(values) for name, values in table.items()})
    arrow = arrow.replace_schema_metadata({**metadata})
    # Splitting floats into bytes and integers into differences is smaller than a dictionary of
    # values that hardly repeat, and quicker.
    encodings = {'f': 'BYTE_STREAM_SPLIT', 'i': 'DELTA_BINARY_PACKED'}
    pa.parquet.write_table(
        arrow,
        path,
        compression='zstd',
        use_dictionary=False,
        column_encoding={n: encodings.get(v.dtype.kind, 'PLAIN') for n, v in table.items()},
    )


def _read_parquet(path: Path) -> tuple[Table, dict[str, str]]:
    pa = _pyarrow()
    try:
        arrow = pa.parquet.read_table(path)
    except pa.ArrowException as error:
        raise InputError(f'{path} is not a Parquet file: {error}') from error
    raw = arrow.schema.metadata or {}
    table = {name: arrow.column(name).to_numpy() for name in arrow.column_names}
    metadata = {k.decode(): v.decode() for k, v in raw.items() if k != b'ARROW:schema'}
    return table, metadata
