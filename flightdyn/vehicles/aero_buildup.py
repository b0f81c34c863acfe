"""Aerodynamics of a geometry by AeroSandbox's AeroBuildup, sampled into a table once.

The geometry is in geometry axes (x aft, y right, z up), as is usual for drawings:

    geometry:
      kind: airplane
      wings:
        - name: wing
          symmetric: true
          origin: [0, 0, 0]
          sections:
            - {le: [0, 0, 0], chord: 1.6, twist: 0 deg, airfoil: naca2412}
      fuselages:
        - name: fuselage
          origin: [0, 0, 0]
          subdivisions: 2
          sections:
            - {centre: [0, 0, 0], radius: 0.5, shape: 2}
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as _np
from numpy.typing import NDArray

from ..dynamics import OperatingPoint
from ..environment.atmosphere import Atmosphere
from ..errors import InputError, MissingExtraError
from ..files import cache_folder
from ..numpy import Vectorizable
from ..tables import Table, write_table
from .aero_table import CHECK, FLOWN, TableAerodynamics, fitted_file, read_box, similarity
from .aerodynamics import SHARED_KEYS, read_shared
from .fields import Context, Fields, in_degrees
from .surrogate import MARGIN

Array = NDArray[_np.float64]
Box = Mapping[str, tuple[float, float]]

KEYS = (*SHARED_KEYS, 'box', 'nodes', 'reference_point')
BOX = {
    'alpha': (-10.0, 20.0),
    'airspeed': (15.0, 75.0),
    'altitude': (-300.0, 3500.0),
}
"""Default box: [deg], [m/s], [m]."""
NODES = {'alpha': 49, 'reynolds': 17, 'mach': 4, 'beta': 9}
"""Default numbers of nodes; by the grid itself drag is within 3e-4 for a light aircraft."""
LOGARITHMIC = ('reynolds',)
CHECKS = 200
"""Samples that are kept out of the fit."""
LARGEST = 50_000  # samples; 0.5 ms each
_DIGITS = 6  # of what is written: far below the fit's error


def read_buildup(fields: Fields, context: Context) -> TableAerodynamics:
    """Return the aerodynamics of the geometry in a vehicle's file.

    The samples are kept under `$XDG_CACHE_HOME/flightdyn` (or `~/.cache/flightdyn`), in a file
    named by what they depend on; it can serve as the `file` of a `kind: table`.

    Raises
    ------
    InputError
        If the geometry is missing or wrong.
    MissingExtraError
        If there are no samples of it yet, and AeroSandbox is not installed.
    """
    check_geometry(context.geometry, fields.at('geometry'))
    box = read_box(fields, (*BOX, 'beta'), BOX)
    shared = read_shared(fields, context)
    axes = _ranges(box, shared['chord'])
    nodes = Fields(fields.values.get('nodes', {}), tuple(axes), fields.at('nodes'))
    counts = {name: int(nodes.positive(name, NODES[name])) for name in axes}
    if min(counts.values()) < 2 or _np.prod(list(counts.values())) > LARGEST:
        raise InputError(f'{nodes.where}: two or more each, {LARGEST} together, got {counts}')
    point = fields.vector('reference_point', [0, 0, 0])
    path = sample_file(context.geometry, box, counts, shared['chord'], point)
    return TableAerodynamics(
        **shared,
        **fitted_file(path, LOGARITHMIC, (), fields.where),
        flown={name: box[name] for name in FLOWN},
    )


def _ranges(box: Box, chord: float) -> dict[str, tuple[float, float]]:
    """Return the ranges of the table's axes."""
    reached = similarity(box['airspeed'], box['altitude'], chord)
    own = {name: limits for name, limits in box.items() if name not in FLOWN}
    return {'alpha': own.pop('alpha'), **reached, **own}


def sample_file(
    geometry: Mapping[str, Any],
    box: Box,
    counts: Mapping[str, int],
    chord: float,
    reference_point: Sequence[float] = (0.0, 0.0, 0.0),
) -> Path:
    """Return a file of the coefficients of a geometry on a grid of Chebyshev points.

    The grid is over Reynolds and Mach number, which AeroBuildup knows speed and air by alone:
    over these, coefficients are sums of half as many terms as over airspeed and altitude. Some
    samples anywhere in the box are kept out of the grid, to check against.

    Parameters
    ----------
    geometry : mapping
        See the module.
    box : mapping of axis to (lower, upper)
        alpha [deg], airspeed [m/s], altitude [m] and perhaps beta [deg]: where the fit is to be
        exact. The grid reaches over it by the margin in which inputs are bent.
    counts : mapping of axis to number of nodes
        alpha, reynolds, mach and perhaps beta.
    chord : float [m]
        That Reynolds numbers are of.
    reference_point : x, y, z [m]
        What moments are about, geometry axes.

    Returns
    -------
    path
        Of a table as `aero_table.fit_table` takes it; made if there is none yet.
    """
    key = json.dumps([geometry, box, counts, chord, list(reference_point), CHECKS], sort_keys=True)
    name = hashlib.sha256(key.encode()).hexdigest()[:20]
    path = cache_folder() / f'aero-{name}.csv'
    if path.is_file():
        return path
    table = _sample(geometry, box, counts, chord, reference_point)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f'cannot keep samples in {path.parent}: {error.strerror}') from error
    write_table(table, path)
    return path


@dataclass(frozen=True, eq=False)
class _Air(Atmosphere):
    """Air of a viscosity of its own [Pa s], so that Reynolds and Mach number can be chosen."""

    viscosity: Vectorizable = 0.0

    def dynamic_viscosity(self) -> Vectorizable:
        return self.viscosity


def _sample(
    geometry: Mapping[str, Any],
    box: Box,
    counts: Mapping[str, int],
    chord: float,
    reference_point: Sequence[float],
) -> Table:
    plane, ranges = airplane(geometry), _ranges(box, chord)
    axes = {name: _points(name, *ranges[name], n) for name, n in counts.items()}
    mesh = [part.ravel() for part in _np.meshgrid(*axes.values(), indexing='ij')]
    rng = _np.random.default_rng(152)
    at = {name: rng.uniform(*limits, CHECKS) for name, limits in box.items()}
    flow = OperatingPoint(Atmosphere(at['altitude']), velocity=at['airspeed'])
    at |= {'reynolds': flow.reynolds(chord), 'mach': flow.mach()}
    points = {
        name: _rounded(_np.concatenate((part, at[name])))
        for name, part in zip(axes, mesh, strict=True)
    }
    standard = Atmosphere()
    speed = points['mach'] * standard.speed_of_sound()
    viscosity = standard.density() * speed * chord / points['reynolds']
    air = OperatingPoint(
        _Air(_np.zeros_like(speed), viscosity=viscosity),
        velocity=speed,
        alpha=points['alpha'],
        beta=points.get('beta', 0.0),
    )
    found = _aerosandbox().AeroBuildup(plane, air, list(reference_point)).run()
    names = ('CL', 'CD', 'CY', 'Cl', 'Cm', 'Cn') if 'beta' in points else ('CL', 'CD', 'Cm')
    coefficients = {name: _rounded(_np.asarray(found[name], float)) for name in names}
    check = _np.repeat([0, 1], [mesh[0].size, CHECKS])
    return {**points, **coefficients, CHECK: check}


def _points(name: str, lower: float, upper: float, n: int) -> Array:
    over = (upper - lower) * MARGIN / (1 - 2 * MARGIN)
    lower, upper = lower - over, upper + over
    s = (1 - _np.cos(_np.pi * _np.arange(n) / (n - 1))) / 2
    if name in LOGARITHMIC:
        if lower <= 0:
            raise InputError(f'{name}: the range must not come as near to 0')
        return _np.asarray(lower * (upper / lower) ** s)
    return _np.asarray(lower + (upper - lower) * s)


def _rounded(values: Array) -> Array:
    return _np.array([float(f'{v:.{_DIGITS}g}') for v in values])


# ---------------------------------------------------------------------- geometry

_WING = ('name', 'symmetric', 'origin', 'sections')
_FUSELAGE = ('name', 'origin', 'sections', 'subdivisions')
_WING_SECTION = ('le', 'chord', 'twist', 'airfoil')
_FUSELAGE_SECTION = ('centre', 'radius', 'shape')


def check_geometry(geometry: Mapping[str, Any], where: str) -> None:
    """Refuse a geometry that no airplane can be built from.

    Raises
    ------
    InputError
        Naming the key.
    """
    given = Fields(geometry, ('kind', 'wings', 'fuselages'), where)
    if not given.values.get('wings'):
        raise InputError(f'{where}: needs wings')
    for kind, keys, section_keys in (
        ('wings', _WING, _WING_SECTION),
        ('fuselages', _FUSELAGE, _FUSELAGE_SECTION),
    ):
        for i, part in enumerate(_list(given.values.get(kind, []), given.at(kind))):
            fields = Fields(part, keys, f'{where}: {kind}[{i}]')
            fields.vector('origin', [0, 0, 0])
            sections = _list(fields.need('sections'), fields.at('sections'))
            if len(sections) < 2:
                raise InputError(f'{fields.at("sections")}: needs two or more')
            for j, section in enumerate(sections):
                found = Fields(section, section_keys, f'{fields.at("sections")}[{j}]')
                found.vector(section_keys[0])
                found.number(section_keys[1])


def _list(value: Any, where: str) -> list[Any]:
    if not isinstance(value, list):
        raise InputError(f'{where}: expected a list, got {value!r}')
    return value


def airplane(geometry: Mapping[str, Any]) -> Any:
    """Return the AeroSandbox airplane of a geometry, for its analyses and drawings.

    Raises
    ------
    MissingExtraError
        If AeroSandbox is not installed.
    """
    asb = _aerosandbox()
    wings = [
        asb.Wing(
            name=wing.get('name', 'wing'),
            symmetric=bool(wing.get('symmetric', False)),
            xsecs=[
                asb.WingXSec(
                    xyz_le=_np.array(section['le'], float),
                    chord=float(section['chord']),
                    twist=in_degrees(section.get('twist', 0), 'twist'),
                    airfoil=asb.Airfoil(section.get('airfoil', 'naca0012')),
                )
                for section in wing['sections']
            ],
        ).translate(_np.array(wing.get('origin', [0, 0, 0]), float))
        for wing in geometry['wings']
    ]
    fuselages = [
        asb.Fuselage(
            name=body.get('name', 'fuselage'),
            xsecs=[
                asb.FuselageXSec(
                    xyz_c=_np.array(section['centre'], float),
                    radius=float(section['radius']),
                    shape=float(section.get('shape', 2)),
                )
                for section in body['sections']
            ],
        )
        .translate(_np.array(body.get('origin', [0, 0, 0]), float))
        .subdivide_sections(int(body.get('subdivisions', 1)))
        for body in geometry.get('fuselages', [])
    ]
    return asb.Airplane(wings=wings, fuselages=fuselages)


def _aerosandbox() -> Any:
    try:
        import aerosandbox
    except ImportError:
        raise MissingExtraError('AeroBuildup', 'aero') from None
    return aerosandbox
