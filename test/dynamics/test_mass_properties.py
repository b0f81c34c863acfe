"""Mass properties: sums, axes, impossible values, and the numbers of AeroSandbox."""

import json
from collections.abc import Iterator
from dataclasses import replace
from math import cos, sin
from pathlib import Path
from typing import Any

import casadi as cas
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightdyn.dynamics import mass_shapes
from flightdyn.dynamics.mass_properties import INERTIA, NAMES, MassProperties
from flightdyn.errors import InputError
from flightdyn.frames import R_BODY_GEOMETRY, rotation_from_euler, transpose

GOLDEN = json.loads((Path(__file__).parents[1] / 'data/golden/mass_properties.json').read_text())
EXACT = 1e-12  # of numbers near 1 to 1000 in double precision, added up a few times

BODY = MassProperties(2.0, 1.0, -2.0, 0.5, Ixx=3.0, Iyy=4.0, Izz=5.0, Ixy=0.3, Iyz=-0.2, Ixz=0.5)
quick = settings(derandomize=True, deadline=None, max_examples=50)


@st.composite
def point_masses(draw: st.DrawFn) -> list[tuple[float, float, float, float]]:
    """Return masses and places that make a body."""
    seed, count = draw(st.integers(0, 2**16)), draw(st.integers(4, 8))
    random = np.random.default_rng(seed)
    return [(random.uniform(0.5, 2), *random.normal(size=3)) for _ in range(count)]


def body_of(points: list[tuple[float, float, float, float]]) -> MassProperties:
    """Return the mass properties of point masses by the definitions."""
    m, r = np.array(points)[:, 0], np.array(points)[:, 1:]
    cg = m @ r / m.sum()
    d = r - cg
    tensor = np.einsum('k,kij->ij', m, (d * d).sum(1)[:, None, None] * np.eye(3))
    tensor -= np.einsum('k,ki,kj->ij', m, d, d)
    elements = tensor[[0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]]
    return MassProperties(m.sum(), *cg, *elements)


def assert_equal(a: MassProperties, expected: dict[str, float], scale: float = 1.0) -> None:
    for name, value in expected.items():
        assert getattr(a, name) == pytest.approx(value, rel=EXACT, abs=EXACT * scale), name


def golden(group: str) -> Iterator[dict[str, Any]]:
    return iter(GOLDEN[group])


# ---------------------------------------------------------------------- golden numbers


@pytest.mark.parametrize('shape', ['ellipsoid', 'sphere', 'rectangular_prism', 'cube'])
def test_shapes_have_the_golden_inertia(shape: str) -> None:
    function = getattr(mass_shapes, f'mass_properties_of_{shape}')
    for case in golden(shape):
        assert_equal(function(**case['inp']), case['out'])


def test_radii_of_gyration_give_golden_inertia_or_are_refused() -> None:
    made = 0
    for case in golden('from_radius_of_gyration'):
        x, y, z = sorted(case['inp'][f'radius_of_gyration_{axis}'] ** 2 for axis in 'xyz')
        if z > x + y:
            with pytest.raises(InputError, match='none may exceed the sum of the other two'):
                mass_shapes.mass_properties_from_radius_of_gyration(**case['inp'])
        else:
            made += 1
            body = mass_shapes.mass_properties_from_radius_of_gyration(**case['inp'])
            assert_equal(body, case['out'])
    assert made == 3


def test_sums_differences_and_multiples_are_golden() -> None:
    for case in golden('add'):
        a, b, c = (MassProperties(**case[name]) for name in 'abc')
        assert_equal(a + b, case['a_plus_b'], 1e3)
        assert_equal(sum([a, b, c]), case['a_plus_b_plus_c'], 1e3)  # type: ignore[arg-type]
    for case in golden('subtract'):
        rest = MassProperties(**case['ab']) - MassProperties(**case['b'])
        assert_equal(rest, case['out'], 1e3)
    for case in golden('multiply'):
        a, s = MassProperties(**case['a']), case['s']
        for product in (a * s, s * a, a / (1 / s)):
            assert_equal(product, case['out'])


def test_tensors_about_points_and_inverses_are_golden() -> None:
    for case in golden('about_point'):
        tensor = MassProperties(**case['a']).get_inertia_tensor_about_point(*case['point'])
        assert np.allclose(tensor, case['J'], rtol=EXACT, atol=EXACT * 1e3)
    for case in golden('inverse'):
        body = MassProperties(**case['a'])
        assert np.allclose(body.inverse_inertia_tensor(), case['inv'], rtol=EXACT, atol=1e-14)
        assert np.allclose(body.inertia_tensor @ body.inv_inertia_tensor(), np.eye(3))


# ---------------------------------------------------------------------- laws


def test_products_of_inertia_are_tensor_elements() -> None:
    # one kilogram at (1, 2, 0) and one at (-1, -2, 0): Ixy = -sum(m x y) = -4
    two = MassProperties(1.0, 1.0, 2.0) + MassProperties(1.0, -1.0, -2.0)
    assert (two.mass, *two.xyz_cg) == (2, 0, 0, 0)
    assert [getattr(two, name) for name in INERTIA] == [8, 2, 10, -4, 0, 0]


@quick
@given(point_masses())
def test_point_masses_add_up_to_their_definition(points: Any) -> None:
    total = sum(MassProperties(*point) for point in points)
    assert total.allclose(body_of(points), rtol=1e-12, atol=1e-12)  # type: ignore[union-attr]
    about = total.get_inertia_tensor_about_point(0.1, -0.2, 0.3)  # type: ignore[union-attr]
    moved = body_of([(m, x - 0.1, y + 0.2, z - 0.3) for m, x, y, z in points])
    assert np.allclose(about, moved.get_inertia_tensor_about_point(), rtol=1e-12, atol=1e-12)


@quick
@given(point_masses(), point_masses(), point_masses())
def test_sums_do_not_depend_on_order_and_parts_come_off_again(a: Any, b: Any, c: Any) -> None:
    first, second, third = body_of(a), body_of(b), body_of(c)
    total = first + second + third
    assert total.allclose(third + (second + first), rtol=1e-12, atol=1e-12)
    assert (total - second).allclose(first + third, rtol=1e-10, atol=1e-10)
    assert (first + first).allclose(2 * first, rtol=1e-13, atol=1e-13)


@quick
@given(point_masses(), st.floats(-3, 3), st.floats(-1.5, 1.5), st.floats(-3, 3))
def test_rotation_of_a_body_is_that_of_its_points(
    points: Any, phi: float, theta: float, psi: float
) -> None:
    rotation = rotation_from_euler(phi, theta, psi)
    turned = [(m, *(np.array(rotation) @ r)) for m, *r in points]
    body = body_of(points)
    assert body.rotated(rotation).allclose(body_of(turned), rtol=1e-12, atol=1e-12)
    assert body.rotated(np.array(rotation)).rotated(transpose(rotation)).allclose(body, 1e-12)


def test_geometry_axes_come_to_body_axes() -> None:
    # aft 1, right -2, up 0.5 is forward -1, right -2, down -0.5; products of x with z keep sign
    body = BODY.rotated(R_BODY_GEOMETRY)
    assert body.xyz_cg == (-1.0, -2.0, -0.5)
    assert [getattr(body, name) for name in INERTIA] == [3, 4, 5, -0.3, 0.2, 0.5]


def test_moving_a_body_moves_its_centre_of_gravity_alone() -> None:
    assert BODY.moved(1.0, z=-1.0) == replace(BODY, x_cg=2.0, z_cg=-0.5)


def test_nothing_is_the_start_of_a_sum() -> None:
    assert MassProperties() + BODY == BODY == sum([BODY])
    assert MassProperties() + MassProperties() == MassProperties()
    assert (BODY - BODY).allclose(MassProperties())
    with pytest.raises(TypeError):
        BODY + 3.0  # type: ignore[operator]
    with pytest.raises(TypeError):
        3.0 - BODY  # type: ignore[operator]


def test_a_cylinder_is_the_limit_of_its_discs_and_rods() -> None:
    rod = mass_shapes.mass_properties_of_cylinder(3.0, 0.0, 2.0)
    assert [rod.Ixx, rod.Iyy, rod.Izz] == [0, 1, 1]
    disc = mass_shapes.mass_properties_of_cylinder(4.0, 1.0, 0.0, axis='z')
    assert [disc.Ixx, disc.Iyy, disc.Izz] == [1, 1, 2]
    halves = mass_shapes.mass_properties_of_cylinder(1.5, 0.4, 1.0, axis='y')
    whole = mass_shapes.mass_properties_of_cylinder(3.0, 0.4, 2.0, axis='y')
    assert (halves.moved(y=0.5) + halves.moved(y=-0.5)).allclose(whole, rtol=1e-14)
    with pytest.raises(InputError, match="axis must be 'x', 'y' or 'z'"):
        mass_shapes.mass_properties_of_cylinder(1.0, 1.0, 1.0, axis='w')


def test_eight_boxes_make_a_box() -> None:
    eighth = mass_shapes.mass_properties_of_rectangular_prism(1.0, 1.0, 2.0, 3.0)
    corners = [
        eighth.moved(0.5 * i, j, 1.5 * k) for i in (1, -1) for j in (1, -1) for k in (1, -1)
    ]
    whole = mass_shapes.mass_properties_of_rectangular_prism(8.0, 2.0, 4.0, 6.0)
    assert sum(corners).allclose(whole, rtol=1e-14, atol=1e-13)  # type: ignore[union-attr]


# ---------------------------------------------------------------------- what no body can have


@pytest.mark.parametrize(
    ('values', 'message'),
    [
        ({'mass': -1.0}, 'mass must not be negative, got -1.0'),
        ({'mass': float('nan')}, 'mass must be finite numbers, got nan'),
        ({'mass': 'heavy'}, "mass must be finite numbers, got 'heavy'"),
        ({'mass': None}, 'mass must be finite numbers, got None'),
        ({'x_cg': float('inf')}, 'x_cg must be finite'),
        ({'Ixx': 3.0, 'Iyy': 1.0, 'Izz': 1.0}, 'Ixx = 3, .* none may exceed the sum'),
        ({'Ixx': -1.0, 'Iyy': 1.0, 'Izz': 1.0}, 'Ixx = -1'),
        ({'Iyy': -1.0}, 'must not be negative'),
        ({'Ixx': 1.0, 'Iyy': 2.0}, 'none may exceed'),
        ({'Ixx': 1.0, 'Iyy': 1.0, 'Izz': 1.0, 'Ixy': 0.6}, 'principal moments 0.4, 1, 1.6'),
        ({'Iyy': 1.0, 'Ixz': 0.1}, 'Ixz = 0.1'),
        ({'Ixy': 0.1}, 'Ixy = 0.1'),
        ({'Ixx': np.ones(3), 'Iyy': 1.0, 'Izz': [1.0, 1.0, 5.0]}, 'Izz = 5, .*at index 2'),
        ({'mass': 0.0, 'Iyy': 1.0}, 'mass of 0 has no moments'),
        ({'mass': np.ones(3), 'Iyy': np.ones(4)}, 'one length, but mass has 3, Iyy has 4'),
    ],
)
def test_what_no_body_can_have_is_refused(values: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        MassProperties(**{'mass': 1.0, **values})


@quick
@given(st.lists(st.floats(-1, 1), min_size=6, max_size=6))
def test_the_closed_form_agrees_with_the_eigenvalues(elements: list[float]) -> None:
    xx, yy, zz, *products = elements
    inertia = [2 + xx, 2 + yy, 2 + zz, *products]
    moments = np.linalg.eigvalsh(np.array(inertia)[[[0, 3, 5], [3, 1, 4], [5, 4, 2]]])
    excess = max(-moments[0], moments[2] - moments[1] - moments[0]) / moments.sum()
    if excess < 0:
        assert MassProperties(1.0, 0, 0, 0, *inertia).is_physically_possible()
    elif excess > 1e-5:  # beyond what counts as rounded
        with pytest.raises(InputError, match='no body has the inertia'):
            MassProperties(1.0, 0, 0, 0, *inertia)


def test_rounded_figures_of_flat_bodies_pass() -> None:
    flat = MassProperties(1.0, Ixx=1.0, Iyy=2.0, Izz=3.0 * (1 + 0.5e-6))
    assert flat.is_physically_possible()
    for shape in np.logspace(-6, 0, 7):
        plate = mass_shapes.mass_properties_of_rectangular_prism(1.0, 1.0, shape, 0.0)
        turned = plate.rotated(rotation_from_euler(0.3, 0.4, 0.5))
        assert turned.is_physically_possible()


def test_one_moment_alone_is_that_of_a_plane_body() -> None:
    plane = MassProperties(1.0, Iyy=0.5)
    assert plane.Iyy == 0.5 and not plane.is_physically_possible()
    assert (plane + plane).Iyy == 1.0
    with pytest.raises(InputError, match='no inverse'):
        plane.inverse_inertia_rows()


def test_a_part_that_was_none_is_not_taken_off() -> None:
    with pytest.raises(InputError, match='mass must not be negative'):
        MassProperties(1.0) - BODY
    with pytest.raises(InputError, match='no body has'):
        BODY - MassProperties(0.5, 30.0)


def test_point_masses_have_no_inertia() -> None:
    assert MassProperties(3.0, 1.0).is_point_mass() and not BODY.is_point_mass()
    assert MassProperties(cas.MX.sym('m')).is_point_mass()
    assert not MassProperties(1.0, Iyy=cas.SX.sym('i')).is_point_mass()
    assert MassProperties(3.0).is_physically_possible()


def test_what_is_no_rotation_is_refused() -> None:
    for matrix in (np.eye(2), 2 * np.eye(3), ((1.0, 0.1, 0), (0, 1, 0), (0, 0, 1))):
        with pytest.raises(InputError, match='orthogonal'):
            BODY.rotated(matrix)  # type: ignore[arg-type]


# ---------------------------------------------------------------------- arrays and symbols


def test_arrays_are_indexed_and_scalars_stay() -> None:
    burning = MassProperties(np.array([3.0, 2.0, 1.0]), Iyy=0.5)
    assert len(burning) == 3 and len(BODY) == 1 and len(MassProperties(np.ones(1))) == 1
    assert burning[1] == MassProperties(2.0, Iyy=0.5) and burning[-1].mass == 1
    assert burning[1:].mass.tolist() == [2, 1] and burning[::-1].Iyy == 0.5
    assert [part.mass for part in burning] == [3, 2, 1]
    assert BODY[7] is BODY, 'what all states share'
    assert MassProperties(np.array([4.0]), Iyy=np.ones(3))[2].mass == 4
    with pytest.raises(IndexError, match='index 3 of MassProperties of length 3'):
        burning[3]


@pytest.mark.parametrize('kind', [cas.SX, cas.MX], ids=['SX', 'MX'])
def test_columns_are_indexed(kind: Any) -> None:
    mass = kind.sym('m', 4)
    column = MassProperties(mass, Iyy=kind.sym('i'))
    assert len(column) == 4
    assert column[2].mass.shape == (1, 1) and column[1:3].mass.shape == (2, 1)
    assert column[2].Iyy is column.Iyy
    assert cas.Function('f', [mass], [column[-1].mass])([1, 2, 3, 4]) == 4


def test_arrays_are_as_good_as_one_by_one() -> None:
    many = [MassProperties(**case['a']) for case in golden('add')]
    stacked = MassProperties(*(np.array([getattr(b, name) for b in many]) for name in NAMES))
    total = stacked + BODY
    turned = stacked.rotated(R_BODY_GEOMETRY)
    assert stacked.inertia_tensor.shape == (20, 3, 3)
    for i, one in enumerate(many):
        assert total[i].allclose(one + BODY, rtol=1e-14, atol=0)
        assert turned[i].allclose(one.rotated(R_BODY_GEOMETRY), rtol=1e-14, atol=0)
        assert np.array_equal(stacked.inertia_tensor[i], one.inertia_tensor)
        assert np.allclose(
            stacked.inverse_inertia_tensor()[i], one.inverse_inertia_tensor(), rtol=1e-13
        )
    assert (np.array([1.0, 2.0]) * MassProperties(3.0)).mass.tolist() == [3, 6]


@pytest.mark.parametrize('kind', [cas.SX, cas.MX], ids=['SX', 'MX'])
def test_symbols_give_what_numbers_give(kind: Any) -> None:
    values = kind.sym('v', 2 * len(NAMES))
    fields = cas.vertsplit(values)
    a, b = MassProperties(*fields[:10]), MassProperties(*fields[10:])
    numbers = [dict(case['a']) for case in golden('add')][:2]
    na, nb = (MassProperties(**case) for case in numbers)
    given = [case[name] for case in numbers for name in NAMES]
    rotation = rotation_from_euler(0.1, 0.2, 0.3)
    for symbolic, expected in (
        (a + b, na + nb),
        ((a + b) - b, na),
        (2.0 * a / 3.0, 2.0 * na / 3.0),
        (a.rotated(rotation), na.rotated(rotation)),
        (a.moved(y=1.0), na.moved(y=1.0)),
    ):
        found = cas.Function('f', [values], [getattr(symbolic, name) for name in NAMES])(given)
        assert MassProperties(*map(float, found)).allclose(expected, rtol=1e-10, atol=1e-9)
    for name in ('inverse_inertia_tensor', 'get_inertia_tensor_about_point'):
        found = cas.Function('f', [values], [getattr(a, name)()])(given).full()
        assert np.allclose(found, getattr(na, name)(), rtol=1e-12)
    found = cas.Function('f', [values], [a.inertia_tensor])(given).full()
    assert np.allclose(found, na.inertia_tensor)
    with pytest.raises(InputError, match='no values to check'):
        a.is_physically_possible()
    with pytest.raises(InputError, match='of arrays first'):
        _ = MassProperties(1.0, Ixx=kind.sym('i', 3), Iyy=1.0, Izz=1.0).inertia_tensor


@pytest.mark.parametrize('kind', [cas.SX, cas.MX], ids=['SX', 'MX'])
def test_shapes_take_symbols(kind: Any) -> None:
    size = kind.sym('size')
    ball = mass_shapes.mass_properties_of_sphere(10.0, size)
    assert cas.Function('f', [size], [ball.Ixx])(0.5) == 1.0
    wheel = mass_shapes.mass_properties_of_cylinder(size, 1.0, 2.0)
    assert cas.Function('f', [size], [wheel.Ixx])(3.0) == 1.5


def test_what_a_solver_returns_goes_in_unchecked() -> None:
    solved = BODY.map_fields(lambda value: -1e-9 if value == 2.0 else value)
    assert solved.mass == -1e-9 and solved.Ixx == BODY.Ixx


def test_a_turned_rod_keeps_its_moments() -> None:
    rod = mass_shapes.mass_properties_of_cylinder(3.0, 0.0, 2.0)
    angle = 0.4
    turned = rod.rotated(rotation_from_euler(0.0, 0.0, angle))
    # moment m L^2/12 = 1 across; x' = cos, y' = sin of its direction
    assert turned.Ixx == pytest.approx(sin(angle) ** 2)
    assert turned.Ixy == pytest.approx(-sin(angle) * cos(angle))
    assert np.allclose(np.linalg.eigvalsh(turned.inertia_tensor), [0, 1, 1])
