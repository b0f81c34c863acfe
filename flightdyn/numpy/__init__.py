"""NumPy-like functions that also take CasADi symbols.

One source of physics serves floats, arrays and symbols: import this package as `np` there. What
is listed by `symbolic_functions()` takes numbers, NumPy arrays, CasADi SX and MX, and lists of
any of them. Every other name is NumPy's own: `np.float64`, `np.inf`, `np.random` as they are,
functions for numbers only; given symbols, they raise `InputError` with this list to turn to.

Shapes
------
CasADi has matrices only. A column (n, 1) plays the 1-D array of n, a (1, 1) the scalar, and all
else the 2-D array. So `sum(matrix, axis=0)` is a column, `transpose(column)` the same column, and
`array([column, column])` a matrix of two rows. Operators are CasADi's own: they stretch scalars,
but do not broadcast a vector over a matrix as NumPy does.

Functions with kinks (`abs`, `maximum`, `where`, `clip`, `interp`) have kinks for solvers too:
`softabs`, `softmax`, `blend` and others are smooth. `hypot`, `norm` and `arctan2` have
finite gradients at the origin.
"""

from typing import Any

import numpy as _np
from numpy import pi as pi

from . import linalg as linalg
from .calculus import cumsum as cumsum
from .calculus import cumulative_trapezoid as cumulative_trapezoid
from .calculus import diff as diff
from .calculus import gradient as gradient
from .calculus import trapezoid as trapezoid
from .calculus import trapz as trapz
from .core import Vectorizable as Vectorizable
from .core import holds_symbols as holds_symbols
from .core import is_symbolic as is_symbolic
from .elementwise import abs as abs
from .elementwise import absolute as absolute
from .elementwise import add as add
from .elementwise import arccos as arccos
from .elementwise import arccosd as arccosd
from .elementwise import arccosh as arccosh
from .elementwise import arcsin as arcsin
from .elementwise import arcsind as arcsind
from .elementwise import arcsinh as arcsinh
from .elementwise import arctan as arctan
from .elementwise import arctan2 as arctan2
from .elementwise import arctan2d as arctan2d
from .elementwise import arctanh as arctanh
from .elementwise import ceil as ceil
from .elementwise import centered_mod as centered_mod
from .elementwise import clip as clip
from .elementwise import cos as cos
from .elementwise import cosd as cosd
from .elementwise import cosh as cosh
from .elementwise import deg2rad as deg2rad
from .elementwise import degrees as degrees
from .elementwise import divide as divide
from .elementwise import exp as exp
from .elementwise import expm1 as expm1
from .elementwise import fabs as fabs
from .elementwise import floor as floor
from .elementwise import fmax as fmax
from .elementwise import fmin as fmin
from .elementwise import fmod as fmod
from .elementwise import hypot as hypot
from .elementwise import log as log
from .elementwise import log1p as log1p
from .elementwise import log10 as log10
from .elementwise import logical_and as logical_and
from .elementwise import logical_not as logical_not
from .elementwise import logical_or as logical_or
from .elementwise import maximum as maximum
from .elementwise import minimum as minimum
from .elementwise import mod as mod
from .elementwise import multiply as multiply
from .elementwise import power as power
from .elementwise import rad2deg as rad2deg
from .elementwise import radians as radians
from .elementwise import sign as sign
from .elementwise import sin as sin
from .elementwise import sind as sind
from .elementwise import sinh as sinh
from .elementwise import sqrt as sqrt
from .elementwise import square as square
from .elementwise import subtract as subtract
from .elementwise import tan as tan
from .elementwise import tand as tand
from .elementwise import tanh as tanh
from .elementwise import where as where
from .falling_through import from_numpy as _from_numpy
from .interpolation import interp as interp
from .interpolation import polyval as polyval
from .linear_algebra import cross as cross
from .linear_algebra import dot as dot
from .linear_algebra import inner as inner
from .linear_algebra import matmul as matmul
from .linear_algebra import norm as norm
from .linear_algebra import outer as outer
from .linear_algebra import trace as trace
from .making import array as array
from .making import asarray as asarray
from .making import cosspace as cosspace
from .making import empty_like as empty_like
from .making import full as full
from .making import full_like as full_like
from .making import geomspace as geomspace
from .making import length as length
from .making import linspace as linspace
from .making import logspace as logspace
from .making import ones_like as ones_like
from .making import sinspace as sinspace
from .making import zeros_like as zeros_like
from .reductions import all as all
from .reductions import amax as amax
from .reductions import amin as amin
from .reductions import any as any
from .reductions import max as max
from .reductions import mean as mean
from .reductions import min as min
from .reductions import prod as prod
from .reductions import sum as sum
from .shaping import append as append
from .shaping import atleast_1d as atleast_1d
from .shaping import broadcast_to as broadcast_to
from .shaping import concatenate as concatenate
from .shaping import delete as delete
from .shaping import diag as diag
from .shaping import expand_dims as expand_dims
from .shaping import flip as flip
from .shaping import fliplr as fliplr
from .shaping import flipud as flipud
from .shaping import hstack as hstack
from .shaping import ravel as ravel
from .shaping import repeat as repeat
from .shaping import reshape as reshape
from .shaping import roll as roll
from .shaping import rot90 as rot90
from .shaping import squeeze as squeeze
from .shaping import stack as stack
from .shaping import swapaxes as swapaxes
from .shaping import take as take
from .shaping import tile as tile
from .shaping import transpose as transpose
from .shaping import vstack as vstack
from .softening import blend as blend
from .softening import sigmoid as sigmoid
from .softening import softabs as softabs
from .softening import softmax as softmax
from .softening import softmin as softmin
from .softening import softplus as softplus


def symbolic_functions() -> list[str]:
    """Return the names of the functions that take CasADi symbols as well as numbers."""
    names = []
    for prefix, home in (('', globals()), ('linalg.', vars(linalg))):
        for name, value in home.items():
            module = getattr(value, '__module__', None) or ''
            if module.startswith(f'{__name__}.') and not module.endswith(('.core', '_through')):
                names.append(prefix + name)
    return sorted(name for name in names if not name.rpartition('.')[2].startswith('_'))


def __getattr__(name: str) -> Any:
    value = globals()[name] = _from_numpy(_np, __name__, name)
    return value
