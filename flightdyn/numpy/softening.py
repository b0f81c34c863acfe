"""Smooth stand-ins for functions with kinks and jumps, for gradient-based solvers."""

from functools import reduce
from math import pi

from ..errors import InputError
from .core import Vectorizable
from .elementwise import absolute, arctan, exp, log1p, maximum, sqrt, tanh
from .making import asarray

_SIGMOIDS = ('tanh', 'logistic', 'arctan', 'polynomial')


def _softness(
    name: str, softness: Vectorizable | None, hardness: Vectorizable | None
) -> Vectorizable:
    if softness is not None and hardness is not None:
        raise InputError(f'{name}: give softness or hardness, not both')
    if hardness is not None:
        softness = 1.0 / hardness
    return 1.0 if softness is None else softness


def softmax(
    *args: Vectorizable,
    softness: Vectorizable | None = None,
    hardness: Vectorizable | None = None,
) -> Vectorizable:
    """Return a smooth maximum of two or more arrays, element by element.

    It is softness * log(sum(exp(arg / softness))): never below the maximum, above it by
    softness * log(number of args) at most, where all are alike.

    Parameters
    ----------
    *args : Vectorizable
    softness : Vectorizable
        The range of differences over which it is smooth, in the unit of the args; 1 by default.
    hardness : Vectorizable
        1/softness, if that is easier to say.

    Raises
    ------
    InputError
        If there are fewer than two args, or both softness and hardness.
    """
    if len(args) < 2:
        raise InputError(f'softmax: takes two or more arrays, got {len(args)}')
    softness = _softness('softmax', softness, hardness)

    def join(a: Vectorizable, b: Vectorizable) -> Vectorizable:
        # log(e^a + e^b) without overflow; the gradient at a = b is the mean, as it should be
        return maximum(a, b) + softness * log1p(exp(-absolute(a - b) / softness))

    return reduce(join, map(asarray, args))


def softmin(
    *args: Vectorizable,
    softness: Vectorizable | None = None,
    hardness: Vectorizable | None = None,
) -> Vectorizable:
    """Return a smooth minimum: `softmax` upside down, never above the minimum."""
    return -softmax(*(-asarray(arg) for arg in args), softness=softness, hardness=hardness)


def softplus(x: Vectorizable, beta: Vectorizable = 1.0) -> Vectorizable:
    """Return a smooth max(x, 0): log(1 + exp(beta x)) / beta."""
    return softmax(x, 0.0, hardness=beta)


def softabs(x: Vectorizable, softness: Vectorizable = 1.0) -> Vectorizable:
    """Return a smooth |x|: sqrt(x^2 + softness^2) - softness, 0 at 0 and below |x| elsewhere."""
    x = asarray(x)
    return sqrt(x * x + softness * softness) - softness


def sigmoid(
    x: Vectorizable,
    sigmoid_type: str = 'tanh',
    normalization_range: tuple[float, float] = (0, 1),
) -> Vectorizable:
    """Return a smooth step from one value to another, the mean of them at x = 0.

    Parameters
    ----------
    x : Vectorizable
    sigmoid_type : 'tanh', 'logistic', 'arctan' or 'polynomial'
        tanh(x); 1/(1 + exp(-x)); arctan(pi x/2); x/sqrt(1 + x^2): each brought to the range. All
        but the logistic one have the same slope at 0.
    normalization_range : values far below and far above 0

    Raises
    ------
    InputError
        If the type is another word.
    """
    x = asarray(x)
    if sigmoid_type == 'tanh':
        step = tanh(x)
    elif sigmoid_type == 'logistic':
        step = tanh(x / 2)
    elif sigmoid_type == 'arctan':
        step = arctan(x * (pi / 2)) / (pi / 2)
    elif sigmoid_type == 'polynomial':
        step = x / sqrt(1 + x * x)
    else:
        raise InputError(f'sigmoid: unknown type {sigmoid_type!r}: take one of {_SIGMOIDS}')
    low, high = normalization_range
    return low + (high - low) * (1 + step) / 2


def blend(
    switch: Vectorizable, value_switch_high: Vectorizable, value_switch_low: Vectorizable
) -> Vectorizable:
    """Return a smooth choice: the low value for switch << 0, the high for >> 0, the mean at 0.

    The weight of the high value is (1 + tanh(switch))/2: 0.88 at switch = 1, 0.98 at 2.
    """
    weight = sigmoid(switch)
    return weight * asarray(value_switch_high) + (1.0 - weight) * asarray(value_switch_low)
