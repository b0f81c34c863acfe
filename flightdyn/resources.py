"""Where configuration and message definitions are, however flightdyn was installed."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path

from .errors import InputError


@cache
def share_dir() -> Path:
    """Return the folder that holds `config/` and the message definitions.

    A checkout has them at its root; an installation by pip or colcon under `share/flightdyn` of
    its prefix.

    Raises
    ------
    InputError
        If the installation lacks them.
    """
    package = Path(__file__).resolve().parent
    if (package.parent / 'config').is_dir() and (package.parent / 'setup.py').is_file():
        return package.parent
    for parent in Path(__file__).absolute().parents:
        candidate = parent / 'share' / 'flightdyn'
        if (candidate / 'config').is_dir():
            return candidate
    raise InputError(
        f'flightdyn at {package} was installed without its config files: '
        'reinstall it with pip or colcon'
    )


def config_dirs(config_dir: str | Path | None = None) -> tuple[Path, ...]:
    """Return the configuration folders in the order they are searched: the user's own first."""
    own = (Path(config_dir),) if config_dir else ()
    for path in own:
        if not path.is_dir():
            raise InputError(f'config_dir {path} is not a folder')
    return (*own, share_dir() / 'config')


def find_config(kind: str, name: str, config_dir: str | Path | None = None) -> Path:
    """Return the file `kind/name.yaml` of the first configuration folder that has it.

    Raises
    ------
    InputError
        If there is none; the message lists the known names.
    """
    known = list_configs(kind, config_dir)
    if name not in known:
        raise InputError(f"no {kind[:-1]} '{name}'; known: {', '.join(known) or 'none'}")
    return known[name]


def list_configs(kind: str, config_dir: str | Path | None = None) -> dict[str, Path]:
    """Return the configuration files of a kind (`problems`, `vehicles`, `scenarios`) by name."""
    found: dict[str, Path] = {}
    for folder in reversed(config_dirs(config_dir)):
        found.update({path.stem: path for path in sorted((folder / kind).glob('*.yaml'))})
    return dict(sorted(found.items()))


def message_files() -> Sequence[Path]:
    """Return the definitions of flightdyn's own messages (`.msg`)."""
    for folder in (share_dir() / 'flightdyn_msgs' / 'msg', share_dir() / 'msg'):
        if folder.is_dir():
            return sorted(folder.glob('*.msg'))
    raise InputError(f'no message definitions under {share_dir()}: reinstall flightdyn')
