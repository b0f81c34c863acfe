"""Unpacking fills the memory it was given, no more and no less."""

import zlib

import lz4.frame
import numpy as np
import pytest
import zstandard

from flightdyn.logs.unpacking import crc32, unpack

DATA = np.random.default_rng(1).integers(0, 9, 5000, np.uint8)
PACKED = {
    'zstd': zstandard.compress(DATA.tobytes()),
    'zstd, two frames': zstandard.compress(DATA[:9].tobytes())
    + zstandard.compress(DATA[9:].tobytes()),
    'lz4': lz4.frame.compress(DATA.tobytes()),
    'none': DATA.tobytes(),
    '': DATA.tobytes(),
}


def unpacked(kind: str, packed: bytes, size: int) -> np.ndarray:
    return unpack(kind.split(',')[0], np.frombuffer(packed, np.uint8), np.empty(size, np.uint8))


@pytest.mark.parametrize('kind', PACKED)
def test_unpacks(kind: str) -> None:
    np.testing.assert_array_equal(unpacked(kind, PACKED[kind], DATA.size), DATA)


@pytest.mark.parametrize('kind', PACKED)
@pytest.mark.parametrize('size', [0, DATA.size - 1, DATA.size + 1])
def test_another_size_is_refused(kind: str, size: int) -> None:
    with pytest.raises(ValueError, match='announced'):
        unpacked(kind, PACKED[kind], size)


@pytest.mark.parametrize('kind', ['zstd', 'lz4'])
def test_damage_is_refused(kind: str) -> None:
    for packed in (b'', b'nonsense', PACKED[kind][:-20], b'\0' + PACKED[kind][1:]):
        with pytest.raises(ValueError):
            unpacked(kind, packed, DATA.size)


def test_crc_is_that_of_zlib() -> None:
    assert crc32(b'123456789') == 0xCBF43926  # the check value of CRC-32/ISO-HDLC
    assert crc32(DATA.data) == zlib.crc32(DATA.data)
