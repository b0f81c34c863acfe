"""Formulas in configuration, such as `final.x_e - 0.1*duration`: parsed, never executed.

A formula is read by Python's own grammar, of which only the four operations, powers, numbers,
names and a few functions are taken; everything else is refused with its column.
"""

import ast
import keyword
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import casadi as cas

from ..config import suggestion
from ..errors import InputError

MAX_LENGTH = 1000
MAX_DEPTH = 30
MAX_PARTS = 300

CONSTANTS: Mapping[str, float] = {'pi': math.pi, 'deg': math.pi / 180}

_ONE_ARGUMENT: Mapping[str, Callable[[cas.SX], cas.SX]] = {
    'sqrt': cas.sqrt,
    'abs': cas.fabs,
    'sin': cas.sin,
    'cos': cas.cos,
    'exp': cas.exp,
    'log': cas.log,
}
_MORE_ARGUMENTS: Mapping[str, Callable[[cas.SX, cas.SX], cas.SX]] = {
    'min': cas.fmin,
    'max': cas.fmax,
}
FUNCTIONS = (*_ONE_ARGUMENT, *_MORE_ARGUMENTS)

_OPERATIONS: Mapping[type[ast.operator], Callable[[cas.SX, cas.SX], cas.SX]] = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
    ast.Pow: lambda a, b: a**b,
}

Names = Callable[[str], cas.SX]
"""Gives the value of a name; raises InputError, without a place, if there is no such name."""

Integral = Callable[[Callable[[Names], cas.SX]], cas.SX]
"""Gives the integral of what it is handed: a function of the names under the integral sign."""


@dataclass(frozen=True)
class Expression:
    """A formula, checked when it is made.

    Parameters
    ----------
    source : str
        At most 1000 characters, 300 parts and 30 levels deep. Operations `+ - * / **`, numbers,
        the constants `pi` and `deg` (5*deg is an angle in radians), names with at most one dot,
        the functions `sqrt abs sin cos exp log min max` and `integral`. `abs`, `min` and `max`
        are exact: they have a kink, and a gradient-based solver may end up slowly there.
    where : str
        Where the formula stands, for messages.

    Raises
    ------
    InputError
        If it is no such formula; the message has the column, counted from 1.
    """

    source: str
    where: str = field(default='expression', compare=False, repr=False)

    def __post_init__(self) -> None:
        self._tree()

    def evaluate(self, names: Names, integral: Integral | None = None) -> cas.SX:
        """Return the value, given those of the names.

        Raises
        ------
        InputError
            If a name is unknown, or what is constant is no finite number (1/0); the message has
            the column.
        """
        return self._value(self._tree(), names, integral)

    def _tree(self) -> ast.expr:
        if len(self.source) > MAX_LENGTH:
            raise InputError(
                f'{self.where}: {len(self.source)} characters: at most {MAX_LENGTH} are allowed'
            )
        # only what formulas are made of comes before Python's parser, which warns, folds other
        # alphabets into ASCII and takes much more
        odd = re.search(r'[^A-Za-z0-9_.,+\-*/() ]', self.source)
        if odd:
            raise self._error(odd.start(), f'{odd.group()!r} is not allowed in a formula')
        for word in re.finditer(r'[A-Za-z_]\w*', self.source):
            if keyword.iskeyword(word.group()):
                raise self._error(word.start(), f"'{word.group()}' is not allowed in a formula")
        try:
            tree = ast.parse(self.source.strip() or ' ', mode='eval').body
        except SyntaxError as error:
            raise self._error(self._margin + self._end_or(error.offset), self._advice()) from None
        except (RecursionError, MemoryError, ValueError):
            raise InputError(f'{self.where}: nested too deeply') from None
        self._check(tree)
        return tree

    @property
    def _margin(self) -> int:
        return len(self.source) - len(self.source.lstrip()) if self.source.strip() else 0

    def _end_or(self, offset: int | None) -> int:
        return offset - 1 if offset else len(self.source.strip())

    def _advice(self) -> str:
        if not self.source.strip():
            return 'expected a formula'
        if re.search(r'\d\s+deg\b', self.source):
            return 'not a formula: write an angle as 5*deg'
        return 'not a formula'

    def _error(self, column: int, message: str) -> InputError:
        return InputError(f'{self.where}: {message} (column {column + 1} of {self.source[:80]!r})')

    def _at(self, node: ast.expr, message: str) -> InputError:
        return self._error(self._margin + node.col_offset, message)

    def _check(self, tree: ast.expr) -> None:
        parts, level = 0, [tree]
        for _ in range(MAX_DEPTH):
            parts += len(level)
            below = [child for node in level for child in self._operands(node)]
            if not below:
                return
            if parts > MAX_PARTS:
                raise InputError(f'{self.where}: more than {MAX_PARTS} parts')
            level = below
        raise self._at(level[0], f'nested more than {MAX_DEPTH} levels deep')

    def _operands(self, node: ast.expr) -> list[ast.expr]:
        """Return what a part is made of, if the part is allowed."""
        match node:
            case ast.Constant(value=value):
                if type(value) not in (int, float) or not _is_finite(value):
                    raise self._at(node, 'expected a finite number')
                return []
            case ast.Name() | ast.Attribute(value=ast.Name()):
                return []
            case ast.UnaryOp(op=ast.UAdd() | ast.USub(), operand=operand):
                return [operand]
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATIONS:
                return [left, right]
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                self._check_call(node, name, arguments)
                return arguments
        raise self._at(node, f'{_KINDS.get(type(node), "this")} is not allowed in a formula')

    def _check_call(self, node: ast.expr, name: str, arguments: list[ast.expr]) -> None:
        known = (*FUNCTIONS, 'integral')
        if name not in known:
            raise self._at(node, f"unknown function '{name}'{suggestion(name, known)}")
        if name in _MORE_ARGUMENTS and len(arguments) < 2:
            raise self._at(node, f'{name} takes two or more values')
        if name not in _MORE_ARGUMENTS and len(arguments) != 1:
            raise self._at(node, f'{name} takes one value')

    def _value(self, node: ast.expr, names: Names, integral: Integral | None) -> cas.SX:
        match node:
            case ast.Constant(value=int() | float() as number):
                return cas.SX(float(number))
            case ast.Name(id=name):
                value = self._named(node, name, names)
            case ast.Attribute(value=ast.Name(id=scope), attr=name):
                value = self._named(node, f'{scope}.{name}', names)
            case ast.UnaryOp(op=op, operand=operand):
                value = self._value(operand, names, integral)
                value = -value if isinstance(op, ast.USub) else value
            case ast.BinOp(left=left, op=op, right=right):
                operands = (self._value(side, names, integral) for side in (left, right))
                value = _OPERATIONS[type(op)](*operands)
            case ast.Call(func=ast.Name(id='integral'), args=[argument]):
                if integral is None:
                    raise self._at(node, 'integral is not allowed here')
                value = integral(lambda inner: self._value(argument, inner, None))
            case ast.Call(func=ast.Name(id=name), args=arguments):
                value, *others = (self._value(a, names, integral) for a in arguments)
                if name in _ONE_ARGUMENT:
                    value = _ONE_ARGUMENT[name](value)
                for other in others:
                    value = _MORE_ARGUMENTS[name](value, other)
            case _:  # what is allowed, but not here, does not exist
                raise self._at(node, 'not allowed in a formula')
        if value.is_constant() and not math.isfinite(float(value)):
            raise self._at(node, 'is not a finite number')
        return value

    def _named(self, node: ast.expr, name: str, names: Names) -> cas.SX:
        if name in CONSTANTS:
            return cas.SX(CONSTANTS[name])
        try:
            return names(name)
        except InputError as error:
            raise self._at(node, str(error)) from None


def _is_finite(value: object) -> bool:
    try:
        return math.isfinite(value)  # type: ignore[arg-type]
    except OverflowError:  # a whole number beyond every float
        return False


_KINDS: Mapping[type[ast.expr], str] = {
    ast.Attribute: 'a second dot',
    ast.BinOp: 'this operation',
    ast.Call: 'this call',
}
