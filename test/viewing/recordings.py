"""Reading recordings back."""

import pytest

chunks = pytest.importorskip('rerun.chunk')
pa = pytest.importorskip('pyarrow')


def read(path):
    """Return the columns of a recording: entity -> column name -> list of rows."""
    entities = {}
    for chunk in chunks.RrdReader(path).stream():
        batch = chunk.to_record_batch()
        entity = batch.schema.metadata[b'rerun:entity_path'].decode()
        columns = entities.setdefault(entity, {})
        for name in batch.schema.names:
            column = batch.column(name)
            if pa.types.is_temporal(column.type):  # as int64 nanoseconds
                column = column.cast(pa.int64())
            columns.setdefault(name, []).extend(column.to_pylist())
    return entities


def rows(entity, suffix):
    """Return a column by the end of its name, without its empty rows."""
    (name,) = [name for name in entity if name.endswith(suffix)]
    return [row for row in entity[name] if row]
