"""Functions of each element by itself."""

from collections.abc import Callable
from typing import Any

import casadi as cas
import numpy as _np

from .core import SYMBOLIC, Vectorizable, column, is_symbolic
from .making import asarray

Unary = Callable[[Vectorizable], Vectorizable]
Binary = Callable[[Vectorizable, Vectorizable], Vectorizable]


def _unary(name: str, casadi_name: str = '') -> Unary:
    for_numpy, for_casadi = getattr(_np, name), getattr(cas, casadi_name or name)

    def function(x: Vectorizable) -> Vectorizable:
        if isinstance(x, SYMBOLIC):
            return for_casadi(x)
        if isinstance(x, list | tuple):
            return function(asarray(x))
        return for_numpy(x)

    function.__name__ = function.__qualname__ = name
    function.__doc__ = f'Return {name}(x), element by element.'
    return function


def _binary(name: str, for_casadi: Binary) -> Binary:
    for_numpy = getattr(_np, name)

    def function(a: Vectorizable, b: Vectorizable) -> Vectorizable:
        if isinstance(a, list | tuple):
            a = asarray(a)
        if isinstance(b, list | tuple):
            b = asarray(b)
        if isinstance(a, SYMBOLIC) or isinstance(b, SYMBOLIC):
            return for_casadi(column(a), column(b))
        return for_numpy(a, b)

    function.__name__ = function.__qualname__ = name
    function.__doc__ = f'Return {name}(a, b), element by element.'
    return function


sin = _unary('sin')
cos = _unary('cos')
tan = _unary('tan')
arcsin = _unary('arcsin', 'asin')
arccos = _unary('arccos', 'acos')
arctan = _unary('arctan', 'atan')
sinh = _unary('sinh')
cosh = _unary('cosh')
tanh = _unary('tanh')
arcsinh = _unary('arcsinh', 'asinh')
arccosh = _unary('arccosh', 'acosh')
arctanh = _unary('arctanh', 'atanh')
exp = _unary('exp')
expm1 = _unary('expm1')
log = _unary('log')
log10 = _unary('log10')
log1p = _unary('log1p')
sqrt = _unary('sqrt')
sign = _unary('sign')
floor = _unary('floor')
ceil = _unary('ceil')
fabs = _unary('fabs')
absolute = _unary('absolute', 'fabs')
abs = absolute
logical_not = _unary('logical_not', 'logic_not')

maximum = _binary('maximum', cas.fmax)
minimum = _binary('minimum', cas.fmin)
fmax = _binary('fmax', cas.fmax)
fmin = _binary('fmin', cas.fmin)
power = _binary('power', cas.power)
add = _binary('add', cas.plus)
subtract = _binary('subtract', cas.minus)
multiply = _binary('multiply', cas.times)
divide = _binary('divide', cas.rdivide)
fmod = _binary('fmod', cas.fmod)
logical_and = _binary('logical_and', cas.logic_and)
logical_or = _binary('logical_or', cas.logic_or)


def _mod(a: Vectorizable, b: Vectorizable) -> Vectorizable:
    rest = cas.fmod(a, b)  # has the sign of a, NumPy's the sign of b
    return rest + (rest * b < 0) * b


mod = _binary('mod', _mod)


def square(x: Vectorizable) -> Vectorizable:
    """Return x times x."""
    x = asarray(x)
    return x * x


def centered_mod(a: Vectorizable, b: Vectorizable) -> Vectorizable:
    """Return a modulo b in (-b/2, b/2]: angles with b = 2 pi come out in (-pi, pi]."""
    a, b = asarray(a), asarray(b)
    rest = fmod(a, b)  # exact, where (a + b/2) mod b would round a small angle off
    return rest - b * (rest > b / 2) + b * (rest <= -b / 2)


def clip(
    x: Vectorizable, min: Vectorizable | None = None, max: Vectorizable | None = None
) -> Vectorizable:
    """Return x, but not below `min` and not above `max`, element by element."""
    if max is not None:
        x = minimum(x, max)
    return x if min is None else maximum(x, min)


def where(condition: Vectorizable, a: Vectorizable, b: Vectorizable) -> Vectorizable:
    """Return a where the condition holds, b elsewhere, element by element.

    Both a and b are evaluated everywhere. A NaN or infinity in the part not taken leaves the
    value alone. Its slope drops out of the gradient only as far as CasADi simplifies (3.8 mostly
    does): left to itself the chain rule multiplies an infinite slope by zero, which is NaN. To be
    safe keep the arguments harmless: `where(x > 0, sqrt(where(x > 0, x, 1)), 0)`.
    """
    condition, a, b = asarray(condition), asarray(a), asarray(b)
    if is_symbolic(condition, a, b):
        return cas.if_else(column(condition), column(a), column(b), False)
    return _np.where(condition, a, b)[()]  # type: ignore[call-overload]


def hypot(*components: Vectorizable) -> Vectorizable:
    """Return the Euclidean norm of the components, element by element.

    At the origin value and gradient are 0, where the plain square root has no slope. A norm below
    1e-154 counts as 0.
    """
    squares: Any = 0.0
    for c in components:
        c = asarray(c) if isinstance(c, list | tuple) else c
        squares = squares + c * c
    nowhere = squares == 0
    return sqrt(squares + nowhere) - nowhere


def arctan2(y: Vectorizable, x: Vectorizable) -> Vectorizable:
    """Return the angle of the point (x, y) from the x axis [rad], element by element.

    At the origin, whatever the signs of the zeros, the angle is 0 with a finite gradient.
    """
    if isinstance(y, list | tuple) or isinstance(x, list | tuple):
        y, x = asarray(y), asarray(x)
    if isinstance(y, SYMBOLIC) or isinstance(x, SYMBOLIC):
        y, x = column(y), column(x)
        return cas.atan2(y, x + cas.logic_and(x == 0, y == 0))
    return _np.arctan2(y, x + ((x == 0) & (y == 0)))


def degrees(x: Vectorizable) -> Vectorizable:
    """Return radians as degrees."""
    return (asarray(x) if isinstance(x, list | tuple) else x) * (180.0 / _np.pi)


def radians(x: Vectorizable) -> Vectorizable:
    """Return degrees as radians."""
    return (asarray(x) if isinstance(x, list | tuple) else x) * (_np.pi / 180.0)


rad2deg = degrees
deg2rad = radians


def sind(x: Vectorizable) -> Vectorizable:
    """Return the sine of an angle in degrees."""
    return sin(radians(x))


def cosd(x: Vectorizable) -> Vectorizable:
    """Return the cosine of an angle in degrees."""
    return cos(radians(x))


def tand(x: Vectorizable) -> Vectorizable:
    """Return the tangent of an angle in degrees."""
    return tan(radians(x))


def arcsind(x: Vectorizable) -> Vectorizable:
    """Return the angle in degrees with a given sine."""
    return degrees(arcsin(x))


def arccosd(x: Vectorizable) -> Vectorizable:
    """Return the angle in degrees with a given cosine."""
    return degrees(arccos(x))


def arctan2d(y: Vectorizable, x: Vectorizable) -> Vectorizable:
    """Return `arctan2(y, x)` in degrees."""
    return degrees(arctan2(y, x))
