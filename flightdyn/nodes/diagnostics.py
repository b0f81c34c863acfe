"""What a node says of itself on /diagnostics."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue


class Level(IntEnum):
    """How bad it is, in the numbers of diagnostic_msgs."""

    OK = 0
    WARN = 1
    ERROR = 2


@dataclass(frozen=True)
class Status:
    """One aspect of a node.

    Parameters
    ----------
    name : str
        Of the aspect, such as `planning`.
    message : str
        For people; one short sentence.
    level : Level
    values : mapping of str to anything
        Figures with their units in the names; floats are shown with four digits.
    """

    name: str
    message: str
    level: Level = Level.OK
    values: Mapping[str, Any] = field(default_factory=dict)


def diagnostics_msg(node: str, stamp: Any, statuses: Iterable[Status]) -> Any:
    """Return the message.

    Parameters
    ----------
    node : str
        Name of the node with its namespace; statuses are called `node: aspect`.
    stamp : builtin_interfaces.msg.Time
    """
    node = node.lstrip('/')
    array = DiagnosticArray()
    array.header.stamp = stamp
    array.status = [
        DiagnosticStatus(
            level=bytes([status.level]),
            name=f'{node}: {status.name}',
            message=status.message,
            hardware_id=node,
            values=[KeyValue(key=key, value=_shown(v)) for key, v in status.values.items()],
        )
        for status in statuses
    ]
    return array


def _shown(value: Any) -> str:
    return f'{value:.4g}' if isinstance(value, float) else str(value)
