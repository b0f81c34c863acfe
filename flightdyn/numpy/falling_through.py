"""Names that only NumPy has: they work on numbers and refuse CasADi symbols in plain words."""

from types import ModuleType
from typing import Any

from ..errors import InputError
from .core import holds_symbols


class NumbersOnly:
    """A NumPy function that says so when it is given CasADi symbols."""

    def __init__(self, function: Any, name: str) -> None:
        self._function = function
        self._name = name
        self.__name__ = name.rpartition('.')[2]
        self.__doc__ = function.__doc__

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Call NumPy's function.

        Raises
        ------
        InputError
            If an argument is, or holds, a CasADi matrix.
        """
        if any(map(holds_symbols, (*args, *kwargs.values()))):
            raise InputError(
                f'{self._name} takes numbers only, not CasADi symbols: what takes symbols is '
                'listed by flightdyn.numpy.symbolic_functions()'
            )
        return self._function(*args, **kwargs)

    def __getattr__(self, name: str) -> Any:
        if name.startswith('_'):  # copying asks before there is a function to ask
            raise AttributeError(name)
        return getattr(self._function, name)

    def __repr__(self) -> str:
        return f'<{self._name}: for numbers only>'


def from_numpy(module: ModuleType, prefix: str, name: str) -> Any:
    """Return what NumPy's `module` calls `name`: functions guarded, all else as it is.

    Raises
    ------
    AttributeError
        If NumPy has no such name either.
    """
    # private names are asked for by the import system and by tools, not by users
    if name.startswith('_') or not hasattr(module, name):
        raise AttributeError(f'neither {prefix} nor NumPy has {name!r}')
    value = getattr(module, name)
    if isinstance(value, type | ModuleType) or not callable(value):
        return value
    return NumbersOnly(value, f'{prefix}.{name}')
