"""Values by name that may be arrays: construction, packing, indexing, and a memo."""

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from typing import Any, Self

import casadi as cas
import numpy as _np

from .. import numpy as np
from ..config import suggestion
from ..errors import InputError
from ..numpy import Vectorizable

Names = tuple[str, ...]


class NamedValues:
    """States, indirect controls and rotor momenta by name, each a float, array or expression."""

    states: Names
    indirect_controls: Names = ()
    """What steers without being a state or a load: alpha and beta [deg], bank [rad]."""
    rotor_momenta: Names = ()
    """Angular momentum of spinning rotors relative to the body [kg m^2/s]."""
    also_accepted: Names = ()
    """Values that the constructor takes though they do not matter to the class."""

    _memo: dict[str, Any]

    def __init__(self, values: Mapping[str, Vectorizable]) -> None:
        names = self._value_names()
        for name in values:
            if name not in names:
                raise InputError(f"{type(self).__name__} has no '{name}'{suggestion(name, names)}")
        mine = self.__dict__
        for name in names:
            value = values[name] if name in values else getattr(type(self), name)
            mine[name] = self._checked(name, value)
        mine['_memo'] = {}

    def _checked(self, name: str, value: Any) -> Vectorizable:
        if isinstance(value, float | int) or np.is_symbolic(value):
            return value
        value = np.array(value) if isinstance(value, list | tuple) else value
        if not np.is_symbolic(value) and _np.asarray(value).dtype.kind not in 'iufcb':
            raise InputError(
                f'{type(self).__name__}: {name} must be a number, an array or a CasADi '
                f'expression, got {value!r}'
            )
        return value

    def __init_subclass__(cls) -> None:
        """Show the names of a class's values in its signature, though one __init__ serves all."""
        super().__init_subclass__()
        if not hasattr(cls, 'states'):
            return
        values = [
            inspect.Parameter(
                name,
                inspect.Parameter.KEYWORD_ONLY,
                default=getattr(cls, name),
                annotation=Vectorizable,
            )
            for name in cls._value_names()
        ]
        _, *given = inspect.signature(cls.__init__).parameters.values()
        positional = [p for p in given if p.kind is inspect.Parameter.POSITIONAL_OR_KEYWORD]
        keywords = [p for p in given if p.kind is inspect.Parameter.KEYWORD_ONLY]
        cls.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
            [*positional, *values, *keywords]
        )

    @classmethod
    def _value_names(cls) -> tuple[str, ...]:
        return (*cls.states, *cls.indirect_controls, *cls.rotor_momenta, *cls.also_accepted)

    def __setattr__(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)
        self._memo.clear()

    def _once(self, name: str, evaluate: Callable[[], Any]) -> Any:
        """Return what follows from the present values, evaluated the first time only."""
        if name not in self._memo:
            self._memo[name] = evaluate()
        return self._memo[name]

    @property
    def state(self) -> dict[str, Vectorizable]:
        """State variables by name."""
        return {name: getattr(self, name) for name in self.states}

    @classmethod
    def pack_state(cls, y: Any) -> dict[str, Vectorizable]:
        """Return rows of a flat state, (n_states,) or (n_states, n), by name.

        Raises
        ------
        InputError
            If the number of rows is not the number of states.
        """
        rows = y.shape[0] if hasattr(y, 'shape') else len(y)
        if rows != len(cls.states):
            raise InputError(
                f'{cls.__name__} has {len(cls.states)} states ({", ".join(cls.states)}), '
                f'got {rows} rows'
            )
        if np.is_symbolic(y):
            return {name: y[i, :].T for i, name in enumerate(cls.states)}
        return {name: y[i] for i, name in enumerate(cls.states)}

    def unpack_state(self, state: Mapping[str, Vectorizable] | None = None) -> Any:
        """Return a state by name as a flat array, (n_states,) or (n_states, n).

        Rows are in the order of `states`. Of CasADi expressions it is one CasADi matrix.

        Raises
        ------
        InputError
            If a state is missing.
        """
        state = self.state if state is None else state
        missing = [name for name in self.states if name not in state]
        if missing:
            raise InputError(f'{type(self).__name__} also needs the state {", ".join(missing)}')
        rows = [state[name] for name in self.states]
        if not np.is_symbolic(*rows):
            return _np.array(_np.broadcast_arrays(*rows))
        n = max(length(row) or 1 for row in rows)
        return cas.vertcat(*(_row(row, n) for row in rows))

    def get_new_instance_with_state(
        self, state: Mapping[str, Vectorizable] | Sequence[Vectorizable]
    ) -> Self:
        """Return a vehicle alike in another state (by name, or flat), without loads."""
        if not isinstance(state, Mapping):
            state = self.pack_state(state)
        kept = {n: getattr(self, n) for n in self._value_names() if n not in self.states}
        return type(self)(**self._surroundings(), **{**kept, **state})

    def _surroundings(self) -> dict[str, Any]:
        """Return the constructor's arguments that are not values by name."""
        return {}

    def _columns(self) -> Iterator[tuple[str, Vectorizable]]:
        """Yield by name everything that may be an array along the instance."""
        for name in self._value_names():
            yield name, self.__dict__[name]

    def _length(self) -> int | None:
        """Return the length of the arrays in the instance, None if there are none.

        Raises
        ------
        InputError
            If arrays differ in length.
        """
        sizes = {name: n for name, value in self._columns() if (n := length(value)) is not None}
        several = {n: name for name, n in sizes.items() if n != 1}
        if len(several) > 1:
            (n, one), (m, other), *_ = several.items()
            raise InputError(
                f'{type(self).__name__}: {one} has {n} values, {other} has {m}: '
                'arrays must be of one length'
            )
        return next(iter(several), 1 if sizes else None)

    def __len__(self) -> int:
        """Return how many states an array-valued instance holds; 1 of scalars."""
        return self._length() or 1

    def __getitem__(self, index: Any) -> Self:
        """Return one state, a slice or a selection of them, with their loads, mass and wind.

        Raises
        ------
        IndexError
            If the index is not within the length.
        """
        n = len(self)
        if isinstance(index, int | _np.integer) and not -n <= index < n:
            raise IndexError(f'index {index} of {type(self).__name__} of length {n}')
        return self._map_columns(lambda value: value[index] if length(value) == n else value)

    def _map_columns(self, function: Callable[[Any], Any]) -> Self:
        """Return a copy with a function of everything that may be an array."""
        part = copy(self)
        for name in self._value_names():
            part.__dict__[name] = function(self.__dict__[name])
        return part

    def __iter__(self) -> Iterator[Self]:
        return (self[i] for i in range(len(self)))

    def __copy__(self) -> Self:
        twin = object.__new__(type(self))
        twin.__dict__.update(self.__dict__, _memo={})
        return twin


def length(value: Any) -> int | None:
    """Return the length of an array or CasADi column, None of a scalar."""
    shape: tuple[int, ...] = getattr(value, 'shape', ())
    if np.is_symbolic(value):
        return None if shape == (1, 1) else int(shape[0])
    return int(shape[0]) if shape else None


def _row(value: Any, n: int) -> Any:
    row = value.T if np.is_symbolic(value) else cas.DM(_np.atleast_1d(value)).T
    return cas.repmat(row, 1, n // row.shape[1])
