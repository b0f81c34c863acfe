"""Node parameters from a dataclass: declared once, described, checked at start and when set."""

import math
from collections.abc import Callable, Iterable
from dataclasses import Field, dataclass, field, fields, is_dataclass, replace
from typing import Any, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import ParameterException
from rclpy.parameter import Parameter

from ..errors import InputError

P = TypeVar('P')


def parameter(
    default: Any,
    description: str,
    *,
    unit: str = '',
    lower: float | None = None,
    upper: float | None = None,
    choices: tuple[str, ...] = (),
    length: int | None = None,
    read_only: bool = False,
    unconfigured_only: bool = False,
) -> Any:
    """Return the field of a parameters dataclass.

    Parameters
    ----------
    lower, upper : float, optional
        Allowed range of a number, both or none.
    choices : tuple of str
        Allowed words.
    length : int, optional
        How many numbers an array holds.
    read_only : bool
        Can be given at start only.
    unconfigured_only : bool
        Takes effect when the node is configured, and cannot be set while it is.
    """
    return field(
        default=default,
        metadata={
            'description': description + (f' [{unit}]' if unit else ''),
            'range': None if lower is None or upper is None else (lower, upper),
            'choices': choices,
            'length': length,
            'read_only': read_only,
            'unconfigured_only': unconfigured_only,
        },
    )


@dataclass(frozen=True)
class NodeParameters:
    """What every node has; the parameters of each derive from it."""

    autostart: bool = parameter(
        True,
        'configure and activate the node at start; false leaves that to `ros2 lifecycle`',
        read_only=True,
    )
    viewer: str = parameter(
        '',
        'rerun viewer to show everything in, such as rerun+http://127.0.0.1:9876/proxy; '
        'empty for none',
        unconfigured_only=True,
    )


def checked(item: 'Field[Any]', value: Any) -> Any:
    """Return a parameter's value in its field's type.

    Raises
    ------
    InputError
        If it has another type, or is outside what is allowed; the message says what is.
    """
    where = f'parameter {item.name}'
    if isinstance(item.default, tuple):
        try:
            values = tuple(float(v) for v in value)
        except (TypeError, ValueError):
            raise InputError(f'{where}: expected an array of numbers, got {value!r}') from None
        if len(values) != item.metadata['length'] or not all(map(math.isfinite, values)):
            raise InputError(
                f'{where}: expected {item.metadata["length"]} finite numbers, got {list(values)}'
            )
        return values
    if isinstance(item.default, float) and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if type(value) is not type(item.default):
        kind = {'str': 'text', 'bool': 'true or false', 'float': 'a number', 'int': 'an integer'}
        raise InputError(f'{where}: expected {kind[type(item.default).__name__]}, got {value!r}')
    allowed = item.metadata['range']
    if allowed is not None and not allowed[0] <= value <= allowed[1]:  # NaN is outside, too
        raise InputError(f'{where}: must be {allowed[0]:g} to {allowed[1]:g}, got {value:g}')
    choices = item.metadata['choices']
    if choices and value not in choices:
        raise InputError(f'{where}: must be {" or ".join(choices)}, got {value!r}')
    return value


class Parameters:
    """The parameters of one node: `values` is always a checked instance of the dataclass.

    Parameters
    ----------
    node : rclpy.node.Node
    kind : type
        A dataclass whose fields are made by `parameter`.
    on_change : function of the new values, optional
        Called after parameters were set.
    is_configured : function returning a bool, optional
        Whether parameters that are `unconfigured_only` are to be refused.

    Raises
    ------
    InputError
        If a value given at start is not allowed.
    """

    def __init__(
        self,
        node: Any,
        kind: type[P],
        on_change: Callable[[P], None] | None = None,
        is_configured: Callable[[], bool] = lambda: False,
    ) -> None:
        assert is_dataclass(kind)
        self._fields = {item.name: item for item in fields(kind)}
        self._on_change = on_change
        self._is_configured = is_configured
        given = {}
        for name, item in self._fields.items():
            default = list(item.default) if isinstance(item.default, tuple) else item.default
            try:
                value = node.declare_parameter(name, default, _descriptor(item)).value
            except ParameterException as error:
                raise InputError(f'parameter {name}: {error}') from None
            given[name] = checked(item, value)
        self.values: Any = kind(**given)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._apply)

    def _check(self, parameters: Iterable[Parameter]) -> SetParametersResult:
        try:
            for p in parameters:
                if p.name in self._fields:
                    self._check_one(self._fields[p.name], p.value)
        except InputError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _check_one(self, item: 'Field[Any]', value: Any) -> None:
        value = checked(item, value)
        if item.metadata['unconfigured_only'] and self._is_configured():
            before = getattr(self.values, item.name)
            if value != before:
                raise InputError(
                    f'parameter {item.name}: stays {before!r} while the node is configured: '
                    'deactivate it and clean it up first'
                )

    def _apply(self, parameters: Iterable[Parameter]) -> None:
        changes = {
            p.name: checked(self._fields[p.name], p.value)
            for p in parameters
            if p.name in self._fields
        }
        if changes:
            self.values = replace(self.values, **changes)
            if self._on_change is not None:
                self._on_change(self.values)


def _descriptor(item: 'Field[Any]') -> ParameterDescriptor:
    descriptor = ParameterDescriptor(
        description=item.metadata['description'], read_only=item.metadata['read_only']
    )
    # `rate: 3` is an integer to ROS; a number is a number here, so types are checked above
    descriptor.dynamic_typing = isinstance(item.default, float | tuple)
    constraints = []
    if item.metadata['choices']:
        constraints.append(' or '.join(item.metadata['choices']))
    if item.metadata['length'] is not None:
        constraints.append(f'{item.metadata["length"]} numbers')
    if item.metadata['unconfigured_only']:
        constraints.append('can be set only while the node is unconfigured')
    descriptor.additional_constraints = '; '.join(constraints)
    if item.metadata['range'] is not None:
        lower, upper = item.metadata['range']
        if isinstance(item.default, float):
            span = FloatingPointRange(from_value=float(lower), to_value=float(upper), step=0.0)
            descriptor.floating_point_range = [span]
        else:
            descriptor.integer_range = [
                IntegerRange(from_value=int(lower), to_value=int(upper), step=1)
            ]
    return descriptor
