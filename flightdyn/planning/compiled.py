"""CasADi functions compiled by the C compiler of the machine, and kept for the next time."""

import hashlib
import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import casadi as cas

from ..files import cache_folder, written_whole

COMPILERS = ('cc', 'gcc', 'clang')
FLAGS = ('-O1', '-fPIC', '-shared')
WORTHWHILE = 4000  # operations in all; below, CasADi's own interpreter is done sooner
TIMEOUT = 120.0  # s


def compiled(functions: Sequence[cas.Function]) -> list[cas.Function]:
    """Return the functions compiled, or as they are where that does not pay or cannot be done.

    The machine code is kept in the user's cache folder under a hash of its source, compiler and
    flags, so that it is compiled once and never outdated. Without a compiler, or with a cache
    folder that cannot be written, functions stay as they are: they give the same numbers, slower.

    Parameters
    ----------
    functions : sequence of SX Functions with different names
        Each must have all the derivatives it needs beside it: compiled ones cannot be
        differentiated.
    """
    compiler = next((path for path in map(shutil.which, COMPILERS) if path), None)
    if compiler is None or sum(f.n_instructions() for f in functions) < WORTHWHILE:
        return list(functions)
    generator = cas.CodeGenerator('stage')
    for function in functions:
        generator.add(function)
    source = generator.dump()
    try:
        library = _library(source, compiler)
    except (OSError, subprocess.SubprocessError):
        return list(functions)
    return [cas.external(function.name(), str(library)) for function in functions]


def _library(source: str, compiler: str) -> Path:
    """Return the shared library of a C source, compiled unless it is there already."""
    what = '\n'.join((str(Path(compiler).resolve()), *FLAGS, source))
    key = hashlib.sha256(what.encode()).hexdigest()[:32]
    library = cache_folder() / 'compiled' / f'{key}.so'
    if not library.is_file():
        # what is loaded from here runs: nobody else may put files there
        library.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        if library.parent.stat().st_uid != os.getuid():
            raise PermissionError(f'{library.parent} belongs to another user')
        with written_whole(library) as temporary:
            subprocess.run(
                [compiler, *FLAGS, '-x', 'c', '-', '-o', str(temporary), '-lm'],
                input=source.encode(),
                check=True,
                capture_output=True,
                timeout=TIMEOUT,
            )
    return library
