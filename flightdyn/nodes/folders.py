"""Folders that clients cannot make a node look out of."""

from pathlib import Path

from ..errors import InputError


def folder(path: str, what: str) -> Path | None:
    """Return a folder that a parameter names; None if it is empty.

    Raises
    ------
    InputError
        If there is no such folder.
    """
    if not path:
        return None
    resolved = Path(path).expanduser().resolve()
    if not resolved.is_dir():
        raise InputError(f'parameter {what}: {path} is not a folder')
    return resolved


def file_below(root: Path | None, name: str, what: str, *, folders: bool = False) -> Path:
    """Return the file of a name, wherever its links lead, if it is below a folder.

    Parameters
    ----------
    root : Path or None
        None allows any file. A relative name is one below the root, or the working folder.
    what : str
        Where the name comes from, for the message, such as `parameter log`.
    folders : bool
        Whether it may be a folder, as a ROS 2 bag is.

    Raises
    ------
    InputError
        If the file is outside, or there is none. Outside, the message is the same whether there
        is a file or not.
    """
    if '\0' in name or not name:
        raise InputError(f'{what}: {name!r} is not the name of a file')
    path = Path(name).expanduser()
    path = (path if root is None else root / path).resolve()
    if root is not None and not path.is_relative_to(root):
        raise InputError(f'{what}: {name} is outside {root}')
    if not (path.is_file() or (folders and path.is_dir())):
        raise InputError(f'{what}: there is no file {name}')
    return path
