"""`np.linalg`: its functions that take CasADi symbols; the rest is NumPy's, for numbers."""

from typing import Any

import numpy as _np

from .falling_through import from_numpy as _from_numpy
from .linear_algebra import det as det
from .linear_algebra import inv as inv
from .linear_algebra import norm as norm
from .linear_algebra import solve as solve


def __getattr__(name: str) -> Any:
    value = globals()[name] = _from_numpy(_np.linalg, __name__, name)
    return value
