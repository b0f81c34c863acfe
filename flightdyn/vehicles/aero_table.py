"""Aerodynamic coefficients from a table of samples on a grid."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as _np
from numpy.typing import NDArray

from ..config import load_yaml, number, suggestion
from ..dynamics import Dynamics
from ..errors import InputError
from ..numpy import Vectorizable
from ..tables import Table, read_table
from .aerodynamics import COEFFICIENTS, SHARED_KEYS, Coefficients, Values, read_shared
from .fields import Context, Fields
from .surrogate import Axis, Surrogate, evaluated

Array = NDArray[_np.float64]

KEYS = (*SHARED_KEYS, 'file', 'logarithmic')
AXES = ('alpha', 'beta', 'airspeed', 'mach', 'reynolds', 'altitude')
"""What a table can be over, beside controls: [deg], [m/s], of the chord, [m]."""
CHECK = 'check'
"""Column that is 1 in rows that are kept out of the fit and compared with it."""


class FitError(NamedTuple):
    """How far a fit is off samples that it was not made of.

    Parameters
    ----------
    largest, rms : float
        Relative where `relative`, else in the quantity's own unit.
    samples : int
    """

    largest: float
    rms: float
    samples: int
    relative: bool


@dataclass(frozen=True, kw_only=True)
class TableAerodynamics(Coefficients):
    """Aerodynamics by smooth functions through the samples of a table.

    Parameters
    ----------
    digest : str
        Of the table's content: what tells two of these apart.
    fits : mapping of coefficient to Surrogate
        All over the same axes.
    errors : mapping of coefficient to FitError
    """

    digest: str
    fits: Mapping[str, Surrogate] = field(repr=False, compare=False)
    errors: Mapping[str, FitError] = field(repr=False, compare=False)

    @property
    def axes(self) -> tuple[Axis, ...]:
        """Axes of the table."""
        return next(iter(self.fits.values())).axes

    @property
    def box(self) -> dict[str, tuple[float, float]]:
        """Range of each axis in which the table is taken as it is; beyond it ends smoothly."""
        return {axis.name: axis.box for axis in self.axes if len(axis.nodes) > 1}

    @property
    def uses(self) -> tuple[str, ...]:
        """Names of the controls that the forces depend on."""
        return (*super().uses, *(axis.name for axis in self.axes))

    def coefficients(self, dyn: Dynamics, controls: Values) -> dict[str, Vectorizable]:
        """Return the coefficients of the table's columns."""
        found = evaluated(list(self.fits.values()), self._inputs(dyn, controls))
        return dict(zip(self.fits, found, strict=True))

    def _inputs(self, dyn: Dynamics, controls: Values) -> dict[str, Vectorizable]:
        air = dyn.op_point
        return {
            'alpha': air.alpha,
            'beta': air.beta,
            'airspeed': air.velocity,
            'mach': air.mach(),
            'reynolds': air.reynolds(self.chord),
            'altitude': air.atmosphere.altitude,
            **controls,
        }

    def attach(self, dyn: Dynamics, controls: Values) -> dict[str, Vectorizable]:
        """Add the forces, and moments to rigid bodies; return also what the table is over."""
        inputs = self._inputs(dyn, controls)
        over = {axis.name: inputs[axis.name] for axis in self.axes}
        known = {name: over[name] for name in ('altitude', 'mach', 'reynolds') if name in over}
        return super().attach(dyn, controls) | known

    def describe(self) -> list[str]:
        """Return lines about the table's axes and the errors of its fit."""
        lines = [
            f'{axis.name} {axis.box[0]:.6g} to {axis.box[1]:.6g}, {len(axis.nodes)} nodes'
            for axis in self.axes
        ]
        for name, error in self.errors.items():
            kind = 'relative error' if error.relative else 'error'
            lines.append(
                f'{name}: {kind} at most {error.largest:.1e}, rms {error.rms:.1e}, '
                f'at {error.samples} samples kept out of the fit'
            )
        return lines


def read_table_aerodynamics(fields: Fields, context: Context) -> TableAerodynamics:
    """Return the aerodynamics of the table that a vehicle's file names: .csv, .parquet or .yaml.

    Raises
    ------
    InputError
        If a key is missing or wrong, or the file is missing or no full grid.
    """
    name = fields.need('file')
    if not isinstance(name, str):
        raise InputError(f'{fields.at("file")}: expected the name of a table, got {name!r}')
    logarithmic = fields.values.get('logarithmic', [])
    if not isinstance(logarithmic, list) or not all(isinstance(n, str) for n in logarithmic):
        raise InputError(f'{fields.at("logarithmic")}: expected names of axes in a list')
    path = context.folder / name
    return TableAerodynamics(
        **read_shared(fields, context),
        **fitted_file(path, tuple(logarithmic), tuple(context.controls), str(path)),
    )


def fitted_file(
    path: Path, logarithmic: tuple[str, ...], controls: tuple[str, ...], where: str
) -> dict[str, Any]:
    """Return digest, fits and errors of a file's table, kept for when it is asked for again.

    Raises
    ------
    InputError
        As of `read_table` and `fit_table`.
    """
    content = path.read_bytes() if path.is_file() else b''
    return dict(_fitted_file(content, path, logarithmic, controls, where))


@lru_cache(maxsize=16)
def _fitted_file(
    content: bytes,  # tells whether the file has changed
    path: Path,
    logarithmic: tuple[str, ...],
    controls: tuple[str, ...],
    where: str,
) -> dict[str, Any]:
    table = _columns(path) if path.suffix in ('.yaml', '.yml') else read_table(path)[0]
    fits, errors = fit_table(table, logarithmic, controls, where)
    return {'digest': digest(table, logarithmic), 'fits': fits, 'errors': errors}


def _columns(path: Path) -> Table:
    """Return the columns of a YAML file of names and lists."""
    table = {}
    for name, values in load_yaml(path).items():
        if not isinstance(values, list):
            raise InputError(f"{path}: column '{name}': expected a list, got {values!r}")
        table[str(name)] = _np.array([number(v, f"{path}: column '{name}'") for v in values])
    if len({len(column) for column in table.values()}) > 1:
        told = ', '.join(f'{name} {len(column)}' for name, column in table.items())
        raise InputError(f'{path}: columns must be of one length, got {told}')
    return table


def digest(table: Table, logarithmic: Sequence[str]) -> str:
    """Return a text that differs for tables that differ."""
    content = hashlib.sha256(repr(sorted(logarithmic)).encode())
    for name, values in table.items():
        content.update(name.encode() + b'\0' + values.tobytes())
    return content.hexdigest()[:16]


def fit_table(
    table: Table, logarithmic: Sequence[str], controls: Sequence[str], where: str
) -> tuple[dict[str, Surrogate], dict[str, FitError]]:
    """Return a smooth function for each coefficient of a table, and its errors.

    Parameters
    ----------
    table : columns by name
        Axes (`AXES` or controls) and coefficients (`COEFFICIENTS`), one row a sample, in any
        order; all combinations of the axes' values. Rows whose column `check` is 1 may lie
        anywhere: they are compared, not fitted.
    logarithmic : names of axes
        Whose logarithm the coefficients are a smooth function of.
    where : str
        Name of the table, for messages.

    Returns
    -------
    fits, errors : by coefficient
        Without rows to check against, errors are those of fits through every second node of one
        axis at a time, at the nodes between: several times those of the fits themselves.

    Raises
    ------
    InputError
        If a column is unknown or holds no numbers, or a combination is missing or there twice.
    """
    known = tuple(dict.fromkeys((*AXES, *controls)))
    for name, column in table.items():
        if name not in (*known, *COEFFICIENTS, CHECK):
            names = (*known, *COEFFICIENTS, CHECK)
            raise InputError(f"{where}: unknown column '{name}'{suggestion(name, names)}")
        if column.dtype.kind not in 'if' or not _np.all(_np.isfinite(column)):
            raise InputError(f"{where}: column '{name}' must hold finite numbers")
    for name in ('CL', 'CD'):
        if name not in table:
            raise InputError(f"{where}: there is no column '{name}'")
    over = [name for name in table if name in known]
    for name in logarithmic:
        if name not in over:
            raise InputError(
                f"{where}: no axis '{name}' to be logarithmic{suggestion(name, over)}"
            )
    if not over:
        raise InputError(f'{where}: no column to be an axis; known: {", ".join(known)}')
    apart = table[CHECK] != 0 if CHECK in table else _np.zeros(len(table['CL']), bool)
    axes, order = _grid({name: table[name][~apart] for name in over}, logarithmic, where)
    shape = [len(axis.nodes) for axis in axes]
    checks = {name: table[name][apart].astype(float) for name in over}
    fits, errors = {}, {}
    for name in COEFFICIENTS:
        if name in table:
            values = table[name][~apart].astype(float)[order].reshape(shape)
            fits[name] = Surrogate.fit(axes, values)
            if apart.any():
                found = _at(fits[name], checks)
                errors[name] = _error(found, table[name][apart], fits[name].logarithmic)
            else:
                errors[name] = _error_between(axes, values)
    return fits, errors


def _grid(
    columns: Mapping[str, NDArray[Any]], logarithmic: Sequence[str], where: str
) -> tuple[list[Axis], NDArray[Any]]:
    """Return the axes, and the order that brings the rows into their grid."""
    try:
        axes = [
            Axis(name, _distinct(values), name in logarithmic) for name, values in columns.items()
        ]
    except InputError as error:
        raise InputError(f'{where}: {error}') from None
    expected = int(_np.prod([len(axis.nodes) for axis in axes]))
    rows = _np.stack(list(columns.values()), axis=1)
    order = _np.lexsort(list(columns.values())[::-1])
    steps = _np.diff(rows[order], axis=0, prepend=_np.nan)
    different = _np.count_nonzero(_np.any(steps != 0, axis=1))
    if not expected or len(rows) != expected or different != expected:
        shape = ' x '.join(f'{len(axis.nodes)} {axis.name}' for axis in axes)
        raise InputError(
            f'{where}: {len(rows)} rows, {different} of them different, are no full grid of '
            f'{shape} = {expected}'
        )
    return axes, order


def _distinct(values: NDArray[Any]) -> Array:
    """Return the values that there are, ascending; `numpy.unique` imports masked arrays first."""
    ascending: Array = _np.sort(values.astype(float))
    return ascending[_np.diff(ascending, prepend=-_np.inf) > 0]


def _at(fit: Surrogate, inputs: Mapping[str, Array]) -> Array:
    return _np.asarray(fit(inputs), float)


def _error(found: Array, samples: NDArray[Any], relative: bool) -> FitError:
    off = found / samples - 1.0 if relative else found - samples
    return FitError(float(abs(off).max()), float(_np.sqrt(_np.mean(off**2))), off.size, relative)


def _error_between(axes: Sequence[Axis], values: Array) -> FitError:
    """Return the errors of fits through every second node of an axis at the nodes between."""
    relative = bool(_np.all(values > 0))
    found, expected = [], []
    for i, axis in enumerate(axes):
        n = len(axis.nodes)
        if n < 5:
            continue
        kept = _np.union1d(_np.arange(0, n, 2), [n - 1])
        between = _np.setdiff1d(_np.arange(n), kept)
        coarse = [*axes[:i], replace(axis, nodes=axis.nodes[kept]), *axes[i + 1 :]]
        fit = Surrogate.fit(coarse, values.take(kept, axis=i))
        points = [other.nodes[between] if j == i else other.nodes for j, other in enumerate(axes)]
        found.append(fit.on_grid(points).ravel())
        expected.append(values.take(between, axis=i).ravel())
    if not found:
        return FitError(_np.nan, _np.nan, 0, relative)
    return _error(_np.concatenate(found), _np.concatenate(expected), relative)
