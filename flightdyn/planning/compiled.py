"""CasADi functions compiled by the C compiler of the machine, and kept for the next time."""

import hashlib
import os
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import casadi as cas

from ..files import cache_folder

COMPILERS = ('cc', 'gcc', 'clang')
FLAGS = ('-Og', '-fPIC', '-shared')  # further optimisation takes longer and gains nothing
WORTHWHILE = 4000  # operations in all; below, CasADi's own interpreter is done sooner
TIMEOUT = 120.0  # s


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
    compiler = next((path for path in map(shutil.which, COMPILERS) if path), None)
    if compiler is None or sum(f.n_instructions() for f in functions) < WORTHWHILE:
        return list(functions)
    libraries = {_library(function, compiler): function for function in functions}
    try:
        _compile({path: f for path, f in libraries.items() if not path.is_file()}, compiler)
    except (OSError, subprocess.SubprocessError):
        return list(functions)
    return [cas.external(function.name(), str(path)) for path, function in libraries.items()]


def _library(function: cas.Function, compiler: str) -> Path:
    """Return where the shared library of a function is kept."""
    what = '\n'.join((cas.CasadiMeta.version(), str(Path(compiler).resolve()), *FLAGS))
    # quicker than the C source, and as exact
    key = hashlib.sha256(f'{what}\n{function.serialize()}'.encode()).hexdigest()[:32]
    return cache_folder() / 'compiled' / f'{key}.so'


def _compile(libraries: Mapping[Path, cas.Function], compiler: str) -> None:
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
            for path, function in libraries.items():
                generator = cas.CodeGenerator('stage')
                generator.add(function)
                source = Path(scratch, f'{path.stem}.c')
                source.write_text(generator.dump())
                runs[path] = subprocess.Popen(
                    [compiler, *FLAGS, source.name, '-o', path.name, '-lm'],
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
