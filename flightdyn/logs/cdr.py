"""Columns from CDR payloads: many messages of one type at once.

A type is flattened into steps (numbers, strings, sequences) up to the last field that is wanted.
Messages that are laid out like the one before, as nearly all of a topic are, are copied as whole
rows, see `cdr_layout`. The others go through the steps together: as long as they have the same
lengths of strings and sequences, offsets are plain integers; then they become one array per step.

References
----------
.. [1] OMG, *DDS-XTypes 1.3*, 2020, section 7.4: encapsulation, XCDR1 and XCDR2.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import LogError
from .cdr_layout import ENCAPSULATIONS, Layout, text_of
from .cdr_steps import Number, Sequence_, Step, Text
from .cdr_steps import flatten as flatten
from .definitions import Definitions

Bytes = NDArray[np.uint8]
Offsets = NDArray[np.int64]

FAULTS = (
    '',
    'shorter than its schema',
    'unsupported encapsulation',
    'a length beyond its end',
    'too long a sequence',
)
"""Why a message could not be decoded, by fault code."""

_SHORT, _ENCAPSULATION, _LENGTH, _TOO_LONG = 1, 2, 3, 4

_MAX_ELEMENTS = 65536  # of strings or structs, each a step of its own


class CdrDecoder:
    """Turns payloads of one message type into columns.

    Parameters
    ----------
    definitions : mapping
        Parsed message definitions by full name (`pkg/msg/Type`).
    type_name : str
    fields : sequence of str
        Dotted names of numbers, fixed arrays of numbers, strings, sequences of numbers, of
        strings, and of messages: these are lists of mappings from the dotted names in them.

    Raises
    ------
    LogError
        If a type or a field is not defined, or something in front of a field cannot be skipped.
    """

    def __init__(self, definitions: Definitions, type_name: str, fields: Sequence[str]) -> None:
        steps = flatten(definitions, type_name)
        by_name = {step.name: i for i, step in enumerate(steps)}
        missing = [name for name in fields if name not in by_name]
        if missing:
            raise LogError(
                f'{type_name} has no field {", ".join(missing)}; '
                f'it has {", ".join(list(by_name)[:40])}'
            )
        self.type_name = type_name
        self._steps = steps[: 1 + max((by_name[name] for name in fields), default=-1)]
        self._wanted = {name: steps[by_name[name]] for name in fields}
        self._layout: Layout | None = None

    def empty(self, size: int) -> dict[str, NDArray[Any]]:
        """Return columns of `size` rows: zeros, None for what has no fixed size."""
        return {name: _column(step, size) for name, step in self._wanted.items()}

    def decode(
        self, data: Bytes, start: Offsets, end: Offsets, into: dict[str, NDArray[Any]]
    ) -> NDArray[np.uint8]:
        """Decode payloads into the rows of columns.

        Parameters
        ----------
        data : uint8 array
        start, end : int array (n,)
            Where the payloads are, encapsulation word included.
        into : mapping of field to array (n, ...)
            Filled where the message is sound, left alone where it is not.

        Returns
        -------
        uint8 array (n,)
            0, or an index into `FAULTS`.
        """
        fault = np.zeros(start.size, np.uint8)
        rows = self._decode_alike(data, start, end, into)
        long_enough = end[rows] - start[rows] >= 4
        fault[rows[~long_enough]] = _SHORT
        rows = rows[long_enough]
        if rows.size == 0:
            return fault
        words = _at(data, start[rows], '>u2')
        for word in np.unique(words):
            these = rows[words == word]
            if int(word) not in ENCAPSULATIONS:
                fault[these] = _ENCAPSULATION
                continue
            order, align = ENCAPSULATIONS[int(word)]
            cursor = _Cursor(
                data, order, align, these, start[these] + 4, end[these] - start[these] - 4, fault
            )
            cursor.run(self._steps, into)
            cursor.fetch(into)
        return fault

    def _decode_alike(
        self, data: Bytes, start: Offsets, end: Offsets, into: dict[str, NDArray[Any]]
    ) -> NDArray[np.intp]:
        """Decode the messages that are laid out like the last ones; return which are left."""
        if self._layout is None and start.size:
            first = data[start[0] : end[0]].tobytes()
            self._layout = Layout.of(self._steps, self._wanted, first)
        if self._layout is None:
            return np.arange(start.size)
        left = self._layout.decode(data, start, end, into)
        if 2 * left.size > start.size:
            self._layout = None
        return left


def _column(step: Step, size: int) -> NDArray[Any]:
    if isinstance(step, Number):
        shape = (size,) if step.count is None else (size, step.count)
        return np.zeros(shape, np.bool_ if step.is_bool else step.code)
    return np.full(size, None, object)


class _Cursor:
    """Where decoding stands in each message of a group with one byte order.

    `rows` are the messages still sound; `base` their bodies and `limit` the bodies' sizes.
    `pos` is one offset while all agree, else one per message.
    """

    def __init__(
        self,
        data: Bytes,
        order: str,
        align: int,
        rows: NDArray[np.intp],
        base: Offsets,
        limit: Offsets,
        fault: NDArray[np.uint8],
    ) -> None:
        self.data, self.order, self.max_align = data, order, align
        self.rows, self.base, self.limit, self.fault = rows, base, limit, fault
        self.pos: int | Offsets = 0
        self.pending: list[tuple[Number, int]] = []

    def run(self, steps: Sequence[Step], into: dict[str, NDArray[Any]]) -> None:
        """Go through steps, filling columns; numbers at common offsets wait for `fetch`."""
        for step in steps:
            if self.rows.size == 0:
                return
            if isinstance(step, Number):
                self._number(step, into)
            elif isinstance(step, Text):
                self._text(step, into)
            else:
                self._sequence(step, into)

    def fetch(self, into: dict[str, NDArray[Any]]) -> None:
        """Copy the numbers at common offsets, all in one go."""
        if isinstance(self.pos, int):
            self._require(self.pos)
        if not self.pending or self.rows.size == 0:
            return
        last, offset = self.pending[-1]
        dtype = np.dtype(
            {
                'names': [step.name for step, _ in self.pending],
                'formats': [_format(self.order, step) for step, _ in self.pending],
                'offsets': [offset for _, offset in self.pending],
                'itemsize': offset + np.dtype(_format(self.order, last)).itemsize,
            }
        )
        table = _at(self.data, self.base, f'V{dtype.itemsize}').view(dtype)
        whole = self.rows.size == self.fault.size
        for step, _ in self.pending:
            values = table[step.name]
            values = values != 0 if step.is_bool else values
            into[step.name][slice(None) if whole else self.rows] = values

    def _align(self, size: int) -> None:
        size = min(size, self.max_align)
        self.pos = (self.pos + size - 1) & -size

    def _number(self, step: Number, into: dict[str, NDArray[Any]]) -> None:
        if step.count == 0:
            return
        size = int(step.code[1])
        self._align(size)
        total = size * (1 if step.count is None else step.count)
        if isinstance(self.pos, int):
            if step.name in into:
                self.pending.append((step, self.pos))
        else:
            self._require(self.pos + total)
            if step.name in into and self.rows.size:
                values = _at(self.data, self.base + self.pos, f'V{total}').view(
                    _format(self.order, step)
                )
                into[step.name][self.rows] = values != 0 if step.is_bool else values
        self.pos = self.pos + total

    def _length(self) -> Offsets:
        """Read the length word in front of a string or sequence."""
        self._align(4)
        self._require(self.pos + 4)
        length = _at(self.data, self.base + self.pos, f'{self.order}u4').astype(np.int64)
        self.pos = self.pos + 4
        return length

    def _text(self, step: Text, into: dict[str, NDArray[Any]]) -> None:
        length = self._length()
        ok = self._keep(length <= self.limit - self.pos, _LENGTH)
        length = length[ok]
        if step.name in into:
            begin = self.base + self.pos
            into[step.name][self.rows] = self._strings(begin, length)
        self._advance(length)

    def _strings(self, begin: Offsets, length: Offsets) -> NDArray[Any]:
        if length.size and (length == length[0]).all() and length[0] > 0:
            pieces = _at(self.data, begin, f'S{length[0]}')
            if (pieces == pieces[0]).all():  # as a frame_id nearly always is
                texts = np.empty(begin.size, object)
                texts[:] = text_of(pieces[:1].tobytes())
                return texts
        raw = self.data.data
        known: dict[bytes, str] = {}
        texts = np.empty(begin.size, object)
        for i, (at, size) in enumerate(zip(begin.tolist(), length.tolist(), strict=True)):
            piece = bytes(raw[at : at + size])
            text = known.get(piece)
            if text is None:
                text = known[piece] = text_of(piece)
            texts[i] = text
        return texts

    def _sequence(self, step: Sequence_, into: dict[str, NDArray[Any]]) -> None:
        wanted = step.name in into
        if isinstance(step.element, Number):
            self._numbers(step, step.element, into)
            return
        if self.max_align == 4:  # XCDR2 puts a size in front of these; not needed so far
            self._keep(np.zeros(self.rows.size, bool), _ENCAPSULATION)
            return
        count = self._length()
        ok = self._keep(count <= self.limit - self.pos, _LENGTH)
        ok2 = self._keep(count[ok] <= _MAX_ELEMENTS, _TOO_LONG)
        count = count[ok][ok2]
        if count.size == 0:
            return
        lists: list[list[Any]] = [[] for _ in range(count.size)]
        inner: tuple[Step, ...] = (Text('text'),) if step.element else step.steps
        pos = np.broadcast_to(np.asarray(self.pos, np.int64), count.shape).copy()
        alive = np.ones(count.size, bool)
        for k in range(int(count.max())):
            these = np.flatnonzero((count > k) & alive)
            if these.size == 0:
                break
            part = _Cursor(
                self.data,
                self.order,
                self.max_align,
                these.copy(),
                self.base[these],
                self.limit[these],
                np.zeros(count.size, np.uint8),
            )
            part.pos = pos[these]
            columns = {each.name: _column(each, count.size) for each in inner if wanted}
            part.run(inner, columns)
            part.fetch(columns)
            pos[part.rows] = part.pos
            alive[these] = part.fault[these] == 0
            self.fault[self.rows[these]] = part.fault[these]
            if wanted:
                for row in part.rows:
                    element = {name: column[row] for name, column in columns.items()}
                    lists[row].append(element['text'] if step.element else element)
        self.pos = pos
        kept = self._keep(alive, None)
        if wanted:
            for row, values in zip(self.rows, np.flatnonzero(kept), strict=True):
                into[step.name][row] = lists[values]
        self._settle()

    def _numbers(self, step: Sequence_, element: Number, into: dict[str, NDArray[Any]]) -> None:
        count = self._length()
        size = int(element.code[1])
        # No elements, no padding: alignment belongs to the first element.
        unaligned = self.pos
        self._align(size)
        padding = np.where(count > 0, self.pos - unaligned, 0)
        self.pos = unaligned
        ok = self._keep(count * size + padding <= self.limit - self.pos, _LENGTH)
        count, padding = count[ok], padding[ok]
        if step.name in into:
            begin = (self.base + self.pos + padding).tolist()
            dtype = np.dtype(self.order + element.code)
            for row, at, n in zip(self.rows, begin, count.tolist(), strict=True):
                values = np.frombuffer(self.data, dtype, n, at) if n else np.empty(0, dtype)
                native = values.astype(dtype.newbyteorder('='))
                into[step.name][row] = native != 0 if element.is_bool else native
        self._advance(count * size + padding)

    def _advance(self, length: Offsets) -> None:
        self.pos = self.pos + length
        self._settle()

    def _settle(self) -> None:
        """Go back to one offset if all messages agree on it."""
        pos = self.pos
        if not isinstance(pos, int) and pos.size and (pos == pos[0]).all():
            self.pos = int(pos[0])

    def _require(self, needed: int | Offsets) -> None:
        self._keep(self.limit >= needed, _SHORT)

    def _keep(self, ok: NDArray[np.bool_], fault: int | None) -> NDArray[np.bool_]:
        """Go on with the messages that are sound; mark the others."""
        if not ok.all():
            if fault is not None:
                self.fault[self.rows[~ok]] = fault
            self.rows, self.base, self.limit = self.rows[ok], self.base[ok], self.limit[ok]
            if not isinstance(self.pos, int):
                self.pos = self.pos[ok]
        return ok


def _format(order: str, step: Number) -> Any:
    code = order + step.code
    return code if step.count is None else (code, (step.count,))


def _at(data: Bytes, offsets: Offsets, code: str) -> NDArray[Any]:
    """Return the values at byte offsets, wherever they are aligned."""
    dtype = np.dtype(code)
    values = np.ndarray((max(data.size - dtype.itemsize + 1, 0),), dtype, data, strides=(1,))
    return values[offsets]
