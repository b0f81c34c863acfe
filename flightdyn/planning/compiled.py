"""CasADi functions compiled by the C compiler of the machine, and kept for the next time."""

import contextlib
import hashlib
import os
import shutil
import subprocess
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory

import casadi as cas

from ..files import cache_folder
from . import wide_code
from .wide_code import can_be_wide, wide_name, wide_source

COMPILERS = ('cc', 'gcc', 'clang')
SHARED = ('-fPIC', '-shared')
FLAGS = ('-Og', *SHARED)  # further optimisation takes longer and gains nothing
# this gains a factor of two; the numbers are to be the interpreter's, so nothing is contracted
WIDE_FLAGS = ('-Og', '-fexpensive-optimizations', '-ffp-contract=off', *SHARED)
WORTHWHILE = 4000  # operations in all; below, CasADi's own interpreter is done sooner
WIDEST = 50_000  # operations in all; above, optimising them takes longer than a user waits
TIMEOUT = 120.0  # s


@dataclass(frozen=True)
class Unit:
    """A function to compile.

    Parameters
    ----------
    function : SX Function
    name : str
        What is called in the library.
    flags : of the compiler
    write : function returning C source
    """

    function: cas.Function
    name: str
    flags: tuple[str, ...]
    write: Callable[[], str]

    def library(self, compiler: str) -> Path:
        """Return where the shared library is kept."""
        what = (cas.CasadiMeta.version(), str(Path(compiler).resolve()), self.name, *self.flags)
        # the function's serialization is had sooner than its C source, and tells as much
        key = '\n'.join((*what, _writer_version(), self.function.serialize()))
        return cache_folder() / 'compiled' / f'{hashlib.sha256(key.encode()).hexdigest()[:32]}.so'


def compiled(functions: Sequence[cas.Function]) -> list[cas.Function]:
    """Return the functions compiled, or as they are where that does not pay or cannot be done.

    The machine code of each is kept in the user's cache folder under a hash of the function,
    CasADi's version, compiler and flags, so that it is compiled once and never outdated. Without a
    compiler, or with a cache folder that cannot be written, functions stay as they are: they give
    the same numbers, slower.

    Parameters
    ----------
    functions : sequence of SX Functions with different names
        Each must have all the derivatives it needs beside it: compiled ones cannot be
        differentiated.
    """
    if _operations(functions) < WORTHWHILE:
        return list(functions)
    units = [Unit(each, each.name(), FLAGS, partial(_plain_source, each)) for each in functions]
    return _loaded(units) or list(functions)


def compiled_wide(functions: Sequence[cas.Function]) -> list[cas.Function] | None:
    """Return each function mapped over a few columns, compiled and kept as `compiled` does.

    Of many points it takes a third of the time. None where that does not pay or cannot be done.
    """
    worthwhile = WORTHWHILE <= _operations(functions) <= WIDEST
    if not worthwhile or not all(map(can_be_wide, functions)):
        return None
    lanes, flags = _vectors()
    return _loaded(
        [
            Unit(each, wide_name(each), (*WIDE_FLAGS, *flags), partial(wide_source, each, lanes))
            for each in functions
        ]
    )


def _operations(functions: Sequence[cas.Function]) -> int:
    return sum(function.n_instructions() for function in functions)


def _plain_source(function: cas.Function) -> str:
    generator = cas.CodeGenerator('stage')
    generator.add(function)
    return str(generator.dump())


@cache
def _writer_version() -> str:
    """Return what tells one way of writing sources from another."""
    return hashlib.sha256(Path(wide_code.__file__).read_bytes()).hexdigest()


@cache
def _vectors() -> tuple[int, tuple[str, ...]]:
    """Return how many numbers this processor takes at once, and what tells the compiler so."""
    processor = set[str]()
    with contextlib.suppress(OSError):
        processor = set(Path('/proc/cpuinfo').read_text().split())
    for extension, lanes in (('avx512f', 8), ('avx2', 4)):
        if extension in processor:
            return lanes, (f'-m{extension}',)
    return 2, ()


def _loaded(units: Sequence[Unit]) -> list[cas.Function] | None:
    """Return compiled functions, compiled now if they are not kept; None if that fails."""
    compiler = next((path for path in map(shutil.which, COMPILERS) if path), None)
    if compiler is None:
        return None
    libraries = {unit.library(compiler): unit for unit in units}
    try:
        _compile({path: unit for path, unit in libraries.items() if not path.is_file()}, compiler)
    except (OSError, subprocess.SubprocessError):
        return None
    return [cas.external(unit.name, str(path)) for path, unit in libraries.items()]


def _compile(libraries: Mapping[Path, Unit], compiler: str) -> None:
    """Compile functions, all at once."""
    if not libraries:
        return
    folder = next(iter(libraries)).parent
    # what is loaded from here runs: nobody else may put files there
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if folder.stat().st_uid != os.getuid():
        raise PermissionError(f'{folder} belongs to another user')
    runs: dict[Path, subprocess.Popen[bytes]] = {}
    with TemporaryDirectory(dir=folder) as scratch:
        try:
            for path, unit in libraries.items():
                source = Path(scratch, f'{path.stem}.c')
                source.write_text(unit.write())
                runs[path] = subprocess.Popen(
                    [compiler, *unit.flags, source.name, '-o', path.name, '-lm'],
                    cwd=scratch,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                )
            for path, run in runs.items():
                if run.wait(TIMEOUT):
                    raise subprocess.CalledProcessError(run.returncode, compiler)
                os.replace(Path(scratch, path.name), path)
        finally:
            for run in runs.values():
                run.kill()
                run.wait()
