"""From record to record through MCAP data, messages many at a time.

A message says how long it is, so where the next one begins is only known after it. Instead of
asking one by one, every place that may begin a message is found at once; where each of these ends
at the next, they are what a walk would have found.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from .mcap_records import MESSAGE, MESSAGE_HEAD, RECORD, DamageError

Bytes = NDArray[np.uint8]
Offsets = NDArray[np.int64]

_MIN_LENGTH = MESSAGE_HEAD.itemsize - RECORD.size
_MIN_WINDOW, _MAX_WINDOW = 4096, 2**20  # bytes looked at together
_SHORT_RUN = 16  # fewer are found as quickly one by one
_STEPS = 512  # messages before looking for many again


def walk(data: Bytes, at: int, stop: int) -> Iterator[tuple[int, Offsets, int, int]]:
    """Yield the records between two bytes; messages that follow each other as one.

    Yields
    ------
    opcode : int
    offsets : int array (n,)
        Where the records begin: several messages, or one record of another kind.
    body, end : int
        Where the content of the first begins, and where the last one ends.

    Raises
    ------
    DamageError
        If a record does not fit; after all before it.
    """
    view = data.data
    window, steps = _MIN_WINDOW, 0
    while at < stop:
        opcode, length = _record(view, at, stop)
        body = at + RECORD.size
        if opcode != MESSAGE:
            yield opcode, np.array([at]), body, body + length
            at = body + length
            continue
        if length < _MIN_LENGTH:
            raise DamageError(at, 'a message record is too short')
        if steps > 0 or length > _MIN_WINDOW:
            offsets, end = _stepped(view, at, stop)
            steps -= offsets.size
        else:
            offsets, end = _run(data[:stop], at, window)
            if end < at + window and offsets.size < _SHORT_RUN:
                window, steps = _MIN_WINDOW, _STEPS
            else:
                window = min(2 * window, _MAX_WINDOW)
        yield opcode, offsets, body, end
        at = end


def by_channel(data: Bytes, offsets: Offsets) -> dict[int, Offsets]:
    """Return the messages of each channel, in the order of the file."""
    at = MESSAGE_HEAD.fields['channel'][1] if MESSAGE_HEAD.fields else 0
    channels = values_at(data, offsets + at, '<u2')
    if (channels == channels[:1]).all():
        return {int(channels[0]): offsets} if offsets.size else {}
    order = np.argsort(channels, kind='stable')
    keys, first = np.unique(channels[order], return_index=True)
    parts = np.split(offsets[order], first[1:])
    return {int(key): part for key, part in zip(keys, parts, strict=True)}


def values_at(data: Bytes, offsets: Offsets, code: str) -> NDArray[np.integer]:
    """Return the numbers at byte offsets, wherever they are aligned."""
    dtype = np.dtype(code)
    room = max(data.size - dtype.itemsize + 1, 0)
    values: NDArray[np.integer] = np.ndarray((room,), dtype, data, strides=(1,))[offsets]
    return values


def _record(view: memoryview, at: int, stop: int) -> tuple[int, int]:
    if stop - at < RECORD.size:
        raise DamageError(at, f'{stop - at} bytes are too few for a record')
    opcode, length = RECORD.unpack_from(view, at)
    if opcode == 0:
        raise DamageError(at, 'expected a record, found zeros')
    left = stop - at - RECORD.size
    if length > left:
        raise DamageError(at, f'record 0x{opcode:02x} claims {length} bytes, {left} follow')
    return opcode, length


def _stepped(view: memoryview, at: int, stop: int) -> tuple[Offsets, int]:
    """Return where messages from `at` on begin, one after the other, and where they end."""
    offsets: list[int] = []
    unpack_from, size = RECORD.unpack_from, RECORD.size
    last = stop - size
    while at <= last and len(offsets) < _STEPS:
        opcode, length = unpack_from(view, at)
        if opcode != MESSAGE or not _MIN_LENGTH <= length <= last - at:
            break
        offsets.append(at)
        at += size + length
    return np.array(offsets, np.int64), at


def _run(data: Bytes, at: int, window: int) -> tuple[Offsets, int]:
    """Return the same, found together: neighbours that begin within a window."""
    last = data.size - MESSAGE_HEAD.itemsize
    offsets = at + np.flatnonzero(data[at : min(at + window, last + 1)] == MESSAGE)
    length = values_at(data, offsets + 1, '<u8')
    fits = (length >= _MIN_LENGTH) & (length <= (data.size - RECORD.size - offsets).astype('u8'))
    offsets = offsets[fits]
    end = offsets + RECORD.size + length[fits].astype(np.int64)
    if (end[:-1] != offsets[1:]).any():  # bytes of a payload that look like a record, mostly
        reached = np.isin(offsets, end)
        reached[0] = True
        offsets, end = offsets[reached], end[reached]
    apart = end[:-1] != offsets[1:]
    count = int(np.argmax(apart)) + 1 if apart.any() else offsets.size
    return offsets[:count], int(end[count - 1])
