"""Where in the user's code a variable or constraint was declared, and what it is called there."""

import ast
import linecache
import sys
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from types import CodeType

_PACKAGE = __name__.partition('.')[0]


@dataclass(frozen=True)
class Place:
    """A call in the user's code; its text is looked up only when it has to be shown."""

    code: CodeType | None = None
    instruction: int = 0
    line: int = 0

    def __str__(self) -> str:
        return self.text()

    def text(self, *, full_path: bool = False) -> str:
        """Return 'file:line'."""
        if self.code is None:
            return '<unknown>'
        path = self.code.co_filename
        return f'{path if full_path else Path(path).name}:{self.line}'

    def call(self) -> ast.Call | None:
        """Return the syntax tree of the call, or None where the source cannot be read."""
        tree = self._tree()
        span = self._span()
        if tree is None or span is None:
            return None
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and _span(node) == span:
                return node
        return None

    def assigned_name(self) -> str | None:
        """Return what the result of the call is bound to: `x` in `x = f()` and in `g(x=f())`."""
        tree, call = self._tree(), self.call()
        if tree is None or call is None:
            return None
        for node in ast.walk(tree):
            if isinstance(node, ast.keyword) and _span(node.value) == _span(call):
                return node.arg
            if isinstance(node, ast.Assign) and _span(node.value) == _span(call):
                return ast.unparse(node.targets[0])
        return None

    def item_text(self, path: tuple[int, ...]) -> str | None:
        """Return the source of the call's first argument, or of an item of the list it is."""
        call = self.call()
        if call is None or not call.args:
            return None
        node: ast.expr = call.args[0]
        for index in path:
            if not isinstance(node, ast.List | ast.Tuple) or index >= len(node.elts):
                return None
            node = node.elts[index]
        return ast.unparse(node)

    def _span(self) -> tuple[int, ...] | None:
        if self.code is None:
            return None
        positions = islice(self.code.co_positions(), self.instruction // 2, None)
        first, last, column, end = next(positions, (None, None, None, None))
        if first is None or last is None or column is None or end is None:
            return None
        return first, column, last, end

    def _tree(self) -> ast.Module | None:
        if self.code is None:
            return None
        source = ''.join(linecache.getlines(self.code.co_filename))
        try:
            return ast.parse(source)
        except SyntaxError:  # a notebook cell with its own commands, say
            return None


def _span(node: ast.expr) -> tuple[int, ...]:
    return (node.lineno, node.col_offset, node.end_lineno or 0, node.end_col_offset or 0)


def caller() -> Place:
    """Return the call by which the code outside this package came in."""
    frame = sys._getframe(1)
    while frame.f_globals.get('__name__', '').partition('.')[0] == _PACKAGE:
        if frame.f_back is None:
            return Place()
        frame = frame.f_back
    return Place(frame.f_code, frame.f_lasti, frame.f_lineno)


@dataclass(frozen=True)
class Declaration:
    """Rows of the programme's variables or constraints that one call declared."""

    kind: str
    """'variable', 'constraint', 'lower bound', 'upper bound', or the name given in the call."""
    size: int
    place: Place
    item: tuple[int, ...] = ()
    name: str | None = None
    subject: 'Declaration | None' = None
    """The variable that a constraint is about, to name it by."""

    def title(self, row: int | None = None) -> str:
        """Return what to call it in a message, as 'constraint mass >= 0 [row 3]'."""
        if self.name is not None:
            text = self.name
        elif self.kind == 'constraint':
            text = ' '.join(filter(None, [self.kind, self.place.item_text(self.item)]))
        else:
            name = (self.subject or self).place.assigned_name()
            of = '' if self.kind == 'variable' else 'of '
            text = ' '.join(filter(None, [self.kind, name and of + name]))
        return text if row is None or self.size == 1 else f'{text} [row {row}]'

    def text(self, row: int | None = None, *, full_path: bool = False) -> str:
        """Return the title with the place."""
        return f'{self.title(row)} ({self.place.text(full_path=full_path)})'
