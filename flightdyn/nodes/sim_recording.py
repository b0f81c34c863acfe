"""What the sim node records, and that it flies on when it cannot."""

import contextlib
from collections.abc import Callable, Mapping
from pathlib import Path

from ..errors import InputError
from ..logs.messages import canonical
from ..logs.recording import McapRecorder
from .folders import folder


def recording_path(record: str, root: str) -> Path | None:
    """Return the file to record to; None if none is wanted.

    Raises
    ------
    InputError
        If it would be outside the root, wherever its links lead, or there is no folder for it.
    """
    if not record:
        return None
    if '\0' in record:
        raise InputError(f'parameter record: {record!r} is not the name of a file')
    below = folder(root, 'record_root')
    path = Path(record).expanduser()
    path = path.resolve() if below is None else (below / path).resolve()
    if below is not None and not path.is_relative_to(below):
        raise InputError(f'parameter record: {record} is outside {below}')
    if not path.parent.is_dir():
        raise InputError(f'parameter record: there is no folder for {record}')
    if path.is_dir():
        raise InputError(f'parameter record: {record} is a folder')
    return path


class Recording:
    """Records until that fails, and says so once.

    Parameters
    ----------
    path : Path or None
        None records nothing.
    on_failure : function of a message
        Called once; nothing is recorded afterwards.
    """

    def __init__(self, path: Path | None, on_failure: Callable[[str], None]) -> None:
        self.path = path
        self._on_failure = on_failure
        self._recorder: McapRecorder | None = None
        self._over = path is None

    @property
    def is_on(self) -> bool:
        """Whether what is written now is recorded."""
        return self._recorder is not None

    @property
    def state(self) -> str:
        """none, waiting, recording or failed."""
        if self.path is None:
            return 'none'
        return 'recording' if self.is_on else 'failed' if self._over else 'waiting'

    def begin(self, metadata: Mapping[str, str]) -> None:
        """Open the file, if that has not been done."""
        if self._over or self._recorder is not None:
            return
        assert self.path is not None
        try:
            self._recorder = McapRecorder(self.path, metadata)
        except InputError as error:
            self._fail(str(error))
        except OSError as error:
            self._fail(self._told(error))

    def write(self, topic: str, msgtype: str, data: bytes, ns: int) -> None:
        """Record a message, if recording is on."""
        if self._recorder is None:
            return
        try:
            self._recorder.write(topic, msgtype, canonical(msgtype, data), ns)
        except OSError as error:  # a full disk must not stop the flight
            self._fail(self._told(error))

    def flush(self) -> None:
        """Write everything so far to the file."""
        if self._recorder is not None:
            try:
                self._recorder.flush()
            except OSError as error:
                self._fail(self._told(error))

    def finish(self) -> None:
        """Write the index and close the file; the next `begin` opens it anew."""
        recorder, self._recorder = self._recorder, None
        if recorder is not None:
            try:
                recorder.finish()
            except OSError as error:
                self._fail(self._told(error))

    def _told(self, error: OSError) -> str:
        return f'{self.path}: {error.strerror or error}'

    def _fail(self, message: str) -> None:
        recorder, self._recorder, self._over = self._recorder, None, True
        if recorder is not None:
            with contextlib.suppress(OSError):
                recorder.finish()
        self._on_failure(f'recording ends here, the flight goes on: {message}')
