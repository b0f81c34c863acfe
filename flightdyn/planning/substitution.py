"""Putting values in the place of CasADi expressions anywhere inside nested Python objects."""

import dataclasses
import types
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from enum import Enum
from typing import Any

import casadi as cas
import numpy as np

from ..errors import InputError

_LEAVES = (cas.MX, cas.DM)
_OPAQUE = (
    type,
    types.ModuleType,
    types.FunctionType,
    types.BuiltinFunctionType,
    types.MethodType,
    Enum,
    BaseException,
)


def substitute(value: Any, evaluate: Callable[[list[Any]], list[Any]]) -> Any:
    """Return a copy of a nested object with every MX and DM in it replaced.

    Lists, tuples, dicts (their values), sets, object arrays, dataclasses and whatever keeps its
    attributes in a `__dict__` are gone through; references in circles stay as they were. What
    holds no expression is shared with the original, the outermost object apart.

    Parameters
    ----------
    evaluate : function of a list
        Called once, with all expressions; gives their values.
    """
    tree = _Tree(value)
    values = dict(zip(tree.leaves, evaluate(list(tree.leaves.values())), strict=True))
    return tree.rebuild(value, values)


class _Tree:
    """The objects reachable from one, and which of them lead to an expression."""

    def __init__(self, root: Any) -> None:
        self.leaves: dict[int, Any] = {}
        self._keep: list[Any] = []  # ids stay unique as long as the objects live
        parents: dict[int, list[int]] = {id(root): []}
        todo = [root]
        while todo:
            node = todo.pop()
            self._keep.append(node)
            if isinstance(node, _LEAVES) or (isinstance(node, cas.SX) and node.is_constant()):
                self.leaves[id(node)] = node
                continue
            for child in _children(node):
                if id(child) not in parents:
                    parents[id(child)] = []
                    todo.append(child)
                parents[id(child)].append(id(node))
        self._changed = {id(root)}
        todo_ids = list(self.leaves)
        while todo_ids:
            new = [p for p in parents[todo_ids.pop()] if p not in self._changed]
            self._changed.update(new)
            todo_ids.extend(new)
        self._made: dict[int, Any] = {}

    def rebuild(self, node: Any, values: Mapping[int, Any]) -> Any:
        key = id(node)
        if key in values:
            return values[key]
        if key not in self._changed:
            return node
        if key not in self._made:
            self._fill(node, lambda child: self.rebuild(child, values))
        return self._made[key]

    def _fill(self, node: Any, new: Callable[[Any], Any]) -> None:
        """Make the copy of a node; what can hold itself is noted before it is filled."""
        key = id(node)
        if isinstance(node, list):
            made = self._made[key] = _blank(node, list)
            made.extend(map(new, node))
        elif isinstance(node, dict):
            made = self._made[key] = _blank(node, dict)
            made.update({name: new(item) for name, item in node.items()})
        elif isinstance(node, tuple):
            items = [new(item) for item in node]
            self._made[key] = type(node)(*items) if hasattr(node, '_fields') else tuple(items)
        elif isinstance(node, set | frozenset):
            items = [new(item) for item in node]
            if any(isinstance(item, np.ndarray) for item in items):
                raise InputError('a set cannot hold arrays; put column expressions in a list')
            self._made[key] = type(node)(items)
        elif isinstance(node, np.ndarray):
            self._made[key] = _array(node, new) if node.dtype == object else node
        elif names := _attributes(node):
            made = self._made[key] = _bare(node)
            for name, item in names.items() if made is not node else ():
                object.__setattr__(made, name, new(item))
        else:
            self._made[key] = node


def _children(node: Any) -> Iterable[Any]:
    if isinstance(node, dict):
        return node.values()
    if isinstance(node, list | tuple | set | frozenset):
        return node
    if isinstance(node, np.ndarray):
        return node.ravel().tolist() if node.dtype == object else ()
    return _attributes(node).values()


def _attributes(node: Any) -> dict[str, Any]:
    """Return the attributes of an object that may hold expressions."""
    if isinstance(node, _OPAQUE) or type(node).__module__.partition('.')[0] == 'casadi':
        return {}
    if hasattr(node, 'thisown'):  # derived from a class of CasADi
        return {}
    names = dict(getattr(node, '__dict__', {}))
    if dataclasses.is_dataclass(node):  # also those with __slots__
        names |= {
            field.name: getattr(node, field.name)
            for field in dataclasses.fields(node)
            if hasattr(node, field.name)
        }
    return names


def _bare(like: Any) -> Any:
    """Return an object of the same class without calling its `__init__`.

    One of a class written in C that cannot be made in this way is returned itself.
    """
    kind: Any = type(like)
    for make in (object.__new__, kind.__new__):
        with suppress(TypeError):
            return make(kind)
    return like


def _blank(node: Any, base: type) -> Any:
    """Return an empty container of the same kind, with what else it has (a default factory)."""
    if type(node) is base:
        return base()
    made = node.copy()
    made.clear()
    return made


def _array(node: Any, new: Callable[[Any], Any]) -> Any:
    items = [new(item) for item in node.ravel().tolist()]
    if all(isinstance(item, int | float) for item in items):
        return np.array(items, dtype=float).reshape(node.shape)
    made = np.empty(len(items), dtype=object)
    made[:] = items
    return made.reshape(node.shape)
