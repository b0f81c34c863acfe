"""Writing files whole or not at all."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import InputError


@contextmanager
def written_whole(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary path beside `path`, which takes its place when the block ends well.

    The temporary file keeps the suffix, so that writers which look at it do the same.

    Raises
    ------
    InputError
        If the folder does not exist or cannot be written to, or the disk is full.
    """
    path = Path(path)
    check_writable(path)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix='.', suffix=path.suffix)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)  # mkstemp makes files that only their owner may read
        os.replace(temporary, path)
    except OSError as error:
        raise InputError(f'cannot write {path}: {error.strerror or error}') from error
    finally:
        temporary.unlink(missing_ok=True)


def check_writable(path: str | os.PathLike[str]) -> None:
    """Raise InputError if a file cannot be written at `path`."""
    path = Path(path)
    folder = path.parent
    if not folder.is_dir():
        raise InputError(f'cannot write {path}: there is no folder {folder}')
    if path.is_dir():
        raise InputError(f'cannot write {path}: it is a folder')
    if not os.access(folder, os.W_OK):
        raise InputError(f'cannot write {path}: no permission to write in {folder}')


def cache_folder() -> Path:
    """Return the folder of files that can be made again."""
    return Path(os.environ.get('XDG_CACHE_HOME') or Path.home() / '.cache') / 'flightdyn'
