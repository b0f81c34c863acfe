"""Unpacking of compressed chunks into memory of a known size, and their checksum."""

import numpy as np
from numpy.typing import NDArray

try:  # in recent processors ten times as quick as zlib's, which takes as long as unpacking
    from isal.isal_zlib import crc32 as crc32
except ImportError:
    from zlib import crc32 as crc32

Bytes = NDArray[np.uint8]


def unpack(compression: str, packed: Bytes, into: Bytes) -> Bytes:
    """Return the unpacked bytes, which fill `into` exactly (or are `packed` itself).

    Parameters
    ----------
    compression : 'zstd', 'lz4', 'none' or ''
    packed, into : uint8 array

    Raises
    ------
    ValueError
        If the data are damaged or of another size than `into`.
    """
    if compression == 'zstd':
        return _unpack_zstd(packed, into)
    if compression == 'lz4':
        return _unpack_lz4(packed, into)
    if packed.size != into.size:
        raise ValueError(f'{packed.size} bytes are there, {into.size} were announced')
    return packed


def _unpack_zstd(packed: Bytes, into: Bytes) -> Bytes:
    import zstandard

    # Reading into our own memory neither trusts the size in the frame nor allocates.
    reader = zstandard.ZstdDecompressor().stream_reader(packed.data, read_across_frames=True)
    filled = 0
    view = into.data
    try:
        while filled < into.size:
            count = reader.readinto(view[filled:])
            if count == 0:
                break
            filled += count
        more = reader.read(1)
    except zstandard.ZstdError as error:
        raise ValueError(str(error)) from None
    return _checked(filled, bool(more), into)


def _unpack_lz4(packed: Bytes, into: Bytes) -> Bytes:
    import lz4.frame

    decompressor = lz4.frame.LZ4FrameDecompressor()
    try:
        data = decompressor.decompress(packed.data, max_length=into.size + 1)
    except (RuntimeError, EOFError) as error:
        raise ValueError(str(error)) from None
    filled = min(len(data), into.size)
    into[:filled] = np.frombuffer(data, np.uint8, filled)
    return _checked(filled, len(data) > into.size, into)


def _checked(filled: int, more: bool, into: Bytes) -> Bytes:
    if more:
        raise ValueError(f'it holds more than the {into.size} bytes announced')
    if filled < into.size:
        raise ValueError(f'it holds {filled} bytes, {into.size} were announced')
    return into
