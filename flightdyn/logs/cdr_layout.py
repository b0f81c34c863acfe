"""CDR messages that are all laid out alike: fetched as rows, one copy of each.

Where strings and sequences have the same lengths, every field is at the same place. A layout is
taken from one message; of the others it is checked that they have the same encapsulation and the
same lengths in the same places, so that each of them would have given the same layout.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from .cdr_steps import Number, Step, Text

Bytes = NDArray[np.uint8]
Offsets = NDArray[np.int64]

ENCAPSULATIONS = {0x0000: ('>', 8), 0x0001: ('<', 8), 0x0006: ('>', 4), 0x0007: ('<', 4)}
"""Byte order and largest alignment by encapsulation word. Parameter lists and delimited forms are
laid out differently and must not be taken for these."""

ROOM = 8
"""Bytes that a row may be longer than its message."""

_HEADER = 4  # encapsulation word and options, in front of the body
_LEAD = 4  # rows begin so much before the message, for its numbers to be aligned in memory
_MAX_ROW = 4096  # bytes; of longer messages the fields are fetched one by one


@dataclass(frozen=True)
class Layout:
    """Where the wanted fields of such messages are.

    Parameters
    ----------
    row : dtype
        A structure with the wanted fields and what is checked.
    size : int
        Bytes that a message has at least.
    checks : mapping of name in `row` to value
        What has to be there.
    numbers : mapping of field to whether it is a truth value
    texts : sequence of field
    """

    row: np.dtype[np.void]
    size: int
    checks: dict[str, int]
    numbers: dict[str, bool]
    texts: tuple[str, ...]

    @classmethod
    def of(cls, steps: Sequence[Step], wanted: Collection[str], message: bytes) -> Self | None:
        """Return a message's layout; None if it is not sound, or not this simple."""
        word = int.from_bytes(message[:2], 'big')
        if len(message) < _HEADER or word not in ENCAPSULATIONS:
            return None
        order, max_align = ENCAPSULATIONS[word]
        body = message[_HEADER:]
        fields: dict[str, tuple[Any, int]] = {'encapsulation': ('>u2', -_HEADER)}
        checks = {'encapsulation': word}
        numbers: dict[str, bool] = {}
        texts: list[str] = []
        at = 0

        def length() -> int:
            nonlocal at
            at = _aligned(at, 4)
            name = f'length at {at}'
            fields[name] = (f'{order}u4', at)
            checks[name] = int.from_bytes(body[at : at + 4], 'big' if order == '>' else 'little')
            at += 4
            return checks[name]

        for step in steps:
            if isinstance(step, Number):
                if step.count == 0:
                    continue
                size = int(step.code[1])
                at = _aligned(at, min(size, max_align))
                if step.name in wanted:
                    code = order + step.code
                    fields[step.name] = (code if step.count is None else (code, (step.count,)), at)
                    numbers[step.name] = step.is_bool
                at += size * (1 if step.count is None else step.count)
            elif isinstance(step, Text):
                size = length()
                if step.name in wanted:
                    if size == 0:
                        return None
                    fields[step.name] = (f'S{size}', at)
                    texts.append(step.name)
                at += size
            elif isinstance(step.element, Number) and step.name not in wanted:
                if count := length():
                    size = int(step.element.code[1])
                    at = _aligned(at, min(size, max_align)) + count * size
            else:
                return None
            if at > min(len(body), _MAX_ROW):
                return None
        row = np.dtype(
            {
                'names': list(fields),
                'formats': [kind for kind, _ in fields.values()],
                'offsets': [_LEAD + _HEADER + offset for _, offset in fields.values()],
                'itemsize': _aligned(_LEAD + _HEADER + at, ROOM),
            }
        )
        return cls(row, _HEADER + at, checks, numbers, tuple(texts))

    def decode(
        self, data: Bytes, start: Offsets, end: Offsets, into: dict[str, NDArray[Any]]
    ) -> NDArray[np.intp]:
        """Decode the messages that have this layout; see `CdrDecoder.decode`.

        Returns
        -------
        int array
            Which messages have another one, or are too near an end of the data.
        """
        width = self.row.itemsize
        first = start - _LEAD
        here = (first >= 0) & (first <= data.size - width) & (end - start >= self.size)
        picked = _picked(here)
        rows = rows_at(data, first[picked], self.row)
        same = np.ones(rows.size, np.bool_)
        for name, value in self.checks.items():
            same &= rows[name] == value
        if not same.all():
            here[picked] = same
            picked, rows = np.flatnonzero(here), rows[same]
        for name, is_bool in self.numbers.items():
            into[name][picked] = rows[name] != 0 if is_bool else rows[name]
        for name in self.texts:
            into[name][picked] = _texts(rows[name])
        return np.flatnonzero(~here)


def rows_at(data: Bytes, offsets: Offsets, row: np.dtype[np.void]) -> NDArray[np.void]:
    """Return the structures at byte offsets; one copy each, whatever the number of fields."""
    room = max(data.size - row.itemsize + 1, 0)
    everywhere = np.ndarray((room,), f'V{row.itemsize}', data, strides=(1,))
    return everywhere[offsets].view(row)


def text_of(piece: bytes) -> str:
    """Return a string as CDR holds it: with a zero at its end."""
    return piece.removesuffix(b'\0').decode('utf-8', 'replace')


def _texts(pieces: NDArray[np.bytes_]) -> Any:
    width = pieces.dtype.itemsize
    if pieces.size and (pieces == pieces[0]).all():  # as a frame_id nearly always is
        return text_of(pieces[:1].tobytes())
    raw = pieces.tobytes()
    known: dict[bytes, str] = {}
    texts = np.empty(pieces.size, object)
    for i in range(pieces.size):
        piece = raw[i * width : (i + 1) * width]
        text = known.get(piece)
        if text is None:
            text = known[piece] = text_of(piece)
        texts[i] = text
    return texts


def _picked(chosen: NDArray[np.bool_]) -> slice | NDArray[np.intp]:
    """Return a slice where it will do: copying by index takes longer."""
    if chosen.all():
        return slice(None)
    count = int(np.argmin(chosen))
    return np.flatnonzero(chosen) if chosen[count:].any() else slice(0, count)


def _aligned(at: int, size: int) -> int:
    return (at + size - 1) & -size
