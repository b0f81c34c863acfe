"""The classes against reference numbers of AeroSandbox 4.2.10 (test/data/golden/SOURCE.md)."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import casadi as cas
import numpy as np
import pytest

from flightdyn.dynamics import FAMILY, Dynamics, MassProperties

GOLDEN = Path(__file__).parents[1] / 'data' / 'golden'
CLASSES = {cls['cls']: cls for cls in json.loads((GOLDEN / 'dynamics_classes.json').read_text())}

# Rounding of some dozen operations, relative to each number. What cancels keeps the rounding of
# what it is the difference of: SMALL is relative to the largest number of the case.
RELATIVE, SMALL = 1e-13, 1e-15

Outputs = Callable[..., list[Any]]


def load(kind: str, cls: str) -> list[dict[str, Any]]:
    cases: list[dict[str, Any]] = json.loads((GOLDEN / f'{kind}_{cls}.json').read_text())['cases']
    return cases


def by_floats(outputs: Outputs, values: dict[str, float]) -> np.ndarray:
    return np.array(outputs(**values), dtype=float)


def by_arrays(outputs: Outputs, values: dict[str, float]) -> np.ndarray:
    arrays = {name: np.full(3, value) for name, value in values.items()}
    found = np.array([np.broadcast_to(value, 3) for value in outputs(**arrays)], dtype=float)
    np.testing.assert_array_equal(found.T, [by_floats(outputs, values)] * 3)  # to the last bit
    return found[:, 0]


def by_symbols(kind: Any, outputs: Outputs, values: dict[str, float]) -> np.ndarray:
    symbols = {name: kind.sym(name) for name in values}
    function = cas.Function('f', list(symbols.values()), [cas.vertcat(*outputs(**symbols))])
    result: np.ndarray = function(*values.values()).full()[:, 0]
    return result


EVALUATIONS = {
    'floats': by_floats,
    'arrays': by_arrays,
    'SX': lambda *args: by_symbols(cas.SX, *args),
    'MX': lambda *args: by_symbols(cas.MX, *args),
}


def values_of(cls: str, case: dict[str, Any]) -> dict[str, float]:
    momenta = case['angular_momentum'] if FAMILY[cls].rotor_momenta else {}
    return {**case['state_and_indirect_controls'], **momenta}


def loaded(cls: str, case: dict[str, Any], values: dict[str, Any], only: str = '') -> Dynamics:
    """Return an instance with the loads of a case, or a single one of them."""
    dyn = FAMILY[cls](MassProperties(**case['mass_props']), **values)
    for load_ in case['forces']:
        if only in ('', f'force_{load_["axes"]}'):
            dyn.add_force(*load_['F'], axes=load_['axes'])
    for load_ in case['moments']:
        if only in ('', f'moment_{load_["axes"]}'):
            dyn.add_moment(*load_['M'], axes=load_['axes'])  # type: ignore[attr-defined]
    if only in ('', 'gravity'):
        dyn.add_gravity_force(case['g'])
    return dyn


def expected_derivatives(case: dict[str, Any], only: str) -> dict[str, float]:
    found: dict[str, float] = dict(
        case['state_derivatives_single'][only] if only else case['state_derivatives']
    )
    if 'q' in found and 'p' not in found and not case['planar']:
        # Here the peer lets products of inertia and rotors turn the body out of its plane. A body
        # held in the plane answers to My and Iyy alone.
        if only:
            del found['q']
        else:
            found['q'] = case['total_moment_body'][1] / case['mass_props']['Iyy']
    return found


def assert_close(found: dict[str, Any], expected: dict[str, float], what: str) -> None:
    scale = max(1.0, *(abs(value) for value in expected.values()))
    for name, value in expected.items():
        limit = RELATIVE * abs(value) + SMALL * scale
        assert abs(found[name] - value) <= limit, f'{what}: {name}: {found[name]} is not {value}'


@pytest.mark.parametrize('evaluation', EVALUATIONS)
@pytest.mark.parametrize('cls', CLASSES)
def test_state_derivatives_of_loads_in_all_axes(cls: str, evaluation: str) -> None:
    for case in load('dyn', cls):
        values = values_of(cls, case)
        for only in ('', *case['state_derivatives_single']):

            def outputs(case: Any = case, only: str = only, **values: Any) -> list[Any]:
                return list(loaded(cls, case, values, only).state_derivatives().values())

            found = EVALUATIONS[evaluation](outputs, values)
            named = dict(zip(FAMILY[cls].states, found, strict=True))
            assert_close(named, expected_derivatives(case, only), only or 'all loads')


@pytest.mark.parametrize('evaluation', EVALUATIONS)
@pytest.mark.parametrize('cls', CLASSES)
def test_convert_axes_of_all_ordered_pairs(cls: str, evaluation: str) -> None:
    for case in load('axes', cls):

        def outputs(case: Any = case, **values: Any) -> list[Any]:
            dyn = FAMILY[cls](**values)
            pairs = ((p['v'], p['from_axes'], p['to_axes']) for p in case['pairs'])
            return [out for v, a, b in pairs for out in dyn.convert_axes(*v, a, b)]

        found = EVALUATIONS[evaluation](outputs, case['state_and_indirect_controls'])
        for pair, out in zip(case['pairs'], found.reshape(-1, 3), strict=True):
            error = np.linalg.norm(out - pair['out'])
            # two chains of at most seven turns each, every one good to an ulp or two
            assert error <= 3e-15 * np.linalg.norm(pair['v']), pair


@pytest.mark.parametrize('cls', CLASSES)
def test_what_follows_from_the_state(cls: str) -> None:
    for case in load('dyn', cls):
        dyn = FAMILY[cls](MassProperties(**case['mass_props']), **values_of(cls, case))
        expected = case['derived']
        op_point = dyn.op_point
        found = {
            **{name: getattr(dyn, name) for name in expected if hasattr(dyn, name)},
            'potential_energy_g9p81': dyn.potential_energy,
            'alpha_deg': dyn.alpha,
            'beta_deg': dyn.beta,
            'velocity': op_point.velocity,
            **dict(zip(('u_e', 'v_e', 'w_e'), dyn.velocity_earth, strict=True)),
        }
        expected = {name: v for name, v in expected.items() if isinstance(v, float)}
        assert_close(found, expected, cls)
        for name in ('p', 'q', 'r'):
            assert getattr(op_point, name) == case['derived']['op_point'][name]


@pytest.mark.parametrize('cls', CLASSES)
def test_states_controls_and_default_axes_are_the_peers(cls: str) -> None:
    golden, ours = CLASSES[cls], FAMILY[cls]()
    assert list(ours.state) == golden['states']
    assert list(ours.control_variables) == golden['controls']
    assert ours.force_axes == golden['add_force_default_axes']
    assert hasattr(ours, 'add_moment') == golden['has_add_moment']
