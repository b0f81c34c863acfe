"""Aerodynamics of a geometry by AeroSandbox's AeroBuildup itself, without a table in between."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from ..dynamics import Dynamics
from ..errors import InputError
from ..numpy import Vectorizable
from .aero_buildup import KEYS as SAMPLED_KEYS
from .aero_buildup import airplane, check_geometry, read_buildup
from .aerodynamics import COEFFICIENTS, Aerodynamics, Coefficients, Values, read_shared
from .fields import Context, Fields

KEYS = (*SAMPLED_KEYS, 'direct')


@dataclass(frozen=True, kw_only=True)
class DirectAerodynamics(Coefficients):
    """AeroBuildup at every evaluation: exact, for simulation and to check what a table gives.

    A stage with it has some million operations, too many for a planner's second derivatives.
    There is no flow at rest, where the coefficients are not numbers.

    Parameters
    ----------
    geometry : mapping
        See `aero_buildup`.
    reference_point : x, y, z [m]
        What moments are about, geometry axes.
    """

    geometry: Mapping[str, Any]
    reference_point: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @cached_property
    def _airplane(self) -> Any:
        return airplane(self.geometry)

    def coefficients(self, dyn: Dynamics, controls: Values) -> dict[str, Vectorizable]:
        """Return all coefficients.

        Raises
        ------
        MissingExtraError
            If AeroSandbox is not installed.
        """
        plane = self._airplane
        from aerosandbox import AeroBuildup

        found = AeroBuildup(plane, dyn.op_point, list(self.reference_point)).run()
        return {name: found[name] for name in COEFFICIENTS}


def read_buildup_or_direct(fields: Fields, context: Context) -> Aerodynamics:
    """Return AeroBuildup of the geometry in a vehicle's file, sampled unless it says `direct`.

    Raises
    ------
    InputError
        If a key is missing, wrong, or of sampling alone.
    """
    direct = fields.values.get('direct', False)
    if not isinstance(direct, bool):
        raise InputError(f'{fields.at("direct")}: expected true or false, got {direct!r}')
    if not direct:
        return read_buildup(fields, context)
    for key in ('box', 'nodes'):
        if key in fields:
            raise InputError(f"{fields.where}: '{key}' is of samples, which direct takes none of")
    check_geometry(context.geometry, fields.at('geometry'))
    return DirectAerodynamics(
        **read_shared(fields, context),
        geometry=context.geometry,
        reference_point=fields.vector('reference_point', [0.0, 0.0, 0.0]),
    )
