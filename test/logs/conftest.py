"""Fixtures for the tests of logs."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from log_making import STORE, Message
from mcap.writer import CompressionType, Writer

DATA = Path(__file__).parents[1] / 'data'


@pytest.fixture
def glider_log() -> Path:
    return DATA / 'discus2_thermal.mcap'


@pytest.fixture
def write_log(tmp_path: Path) -> Callable[..., Path]:
    def write(
        messages: list[Message],
        types: dict[str, str] | None = None,
        *,
        name: str = 'log.mcap',
        chunk_size: int = 1000,
        compression: CompressionType = CompressionType.ZSTD,
        texts: dict[str, bytes] | None = None,
        encoding: str = 'cdr',
        schema_encoding: str = 'ros2msg',
        **options: Any,
    ) -> Path:
        types = types or {'/fix': 'sensor_msgs/msg/NavSatFix'}
        path = tmp_path / name
        with path.open('wb') as stream:
            writer = Writer(stream, chunk_size=chunk_size, compression=compression, **options)
            writer.start(profile='ros2', library='test')
            channels = {}
            for topic, type_ in types.items():
                text = (texts or {}).get(type_)
                if text is None:
                    text = STORE.generate_msgdef(type_, ros_version=2)[0].encode()
                schema = writer.register_schema(type_, schema_encoding, text)
                channels[topic] = writer.register_channel(topic, encoding, schema)
            for topic, ns, payload in messages:
                writer.add_message(channels[topic], ns, payload, ns)
            writer.finish()
        return path

    return write
