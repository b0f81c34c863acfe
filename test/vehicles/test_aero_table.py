"""Tables of aerodynamic samples: the Cessna's against AeroBuildup, and tables of one's own."""

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from vehicle_making import check_first_derivatives, derivatives, evaluated, vehicle_of

from flightdyn.dynamics import DynamicsPointMass2DSpeedGamma
from flightdyn.errors import InputError
from flightdyn.tables import read_table, write_table
from flightdyn.vehicles.aero_table import TableAerodynamics
from flightdyn.vehicles.vehicle import load_vehicle

GOLDEN = Path(__file__).parents[1] / 'data' / 'golden'

VEHICLE = """
model: DynamicsPointMass2DSpeedGamma
mass: 10
controls: {alpha: [-5, 15], flaps: [0, 1]}
aerodynamics: {kind: table, file: table.csv, area: 2, span: 4}
"""


def cessna(name: str = 'cessna152') -> TableAerodynamics:
    aerodynamics = load_vehicle(name).aerodynamics
    assert isinstance(aerodynamics, TableAerodynamics)
    return aerodynamics


def polar(alpha: Any, speed: Any, altitude: Any = 0.0, name: str = 'cessna152') -> dict[str, Any]:
    """Return the coefficients and the glide ratio of all parts together."""
    dyn = DynamicsPointMass2DSpeedGamma(
        speed=speed, alpha=np.asarray(alpha), z_e=-np.asarray(altitude)
    )
    found = cessna(name).attach(dyn, {})
    return {**found, 'glide': found['CL'] / found['CD']}


def test_the_cessnas_polar_is_aerobuildups() -> None:
    golden = json.loads((GOLDEN / 'cessna_polar.json').read_text())
    found = polar(golden['alpha'], golden['velocity'])
    # 1e-3 is what the surrogate promises of drag; lift is fitted to 5e-4
    np.testing.assert_allclose(found['CD'], golden['CD'], rtol=1e-3)
    np.testing.assert_allclose(found['CL'], golden['CL'], atol=1e-3)
    alpha = np.linspace(-5, 15, 4001)
    found = polar(alpha, golden['velocity'])
    best = np.argmax(found['glide'])
    assert found['glide'][best] == pytest.approx(golden['best_glide_ratio'], rel=1e-3)
    # the maximum is flat: 1e-3 of the ratio is 0.1 degrees
    assert alpha[best] == pytest.approx(golden['alpha_best'], abs=0.1)
    assert found['CL'].max() == pytest.approx(golden['CL_max'], abs=1e-3)
    assert alpha[np.argmax(found['CL'])] == 15


def test_the_cessna_is_aerobuildups_at_other_speeds_and_altitudes() -> None:
    rows = np.array(json.loads((GOLDEN / 'cessna_grid.json').read_text())['rows']).T
    alpha, speed, altitude, lift, drag = rows
    found = polar(alpha, speed, altitude)
    np.testing.assert_allclose(found['CD'], drag, rtol=1.2e-3)  # and 2e-4 by the atmosphere
    np.testing.assert_allclose(found['CL'], lift, atol=1e-3)


def test_the_cessnas_fit_is_known_and_good() -> None:
    errors = cessna().errors
    assert errors['CD'].relative and errors['CD'].largest < 1e-3
    assert errors['CD'].rms < 3e-4
    assert not errors['CL'].relative and errors['CL'].largest < 1e-3
    assert errors['CL'].samples == 200
    assert 'CD: relative error at most' in load_vehicle('cessna152').describe()


def test_the_cessnas_box_is_round() -> None:
    box = load_vehicle('cessna152').box
    assert set(box) == {'alpha', 'airspeed', 'altitude'}
    for name, expected in {
        'alpha': (-10, 20),
        'airspeed': (15, 75),
        'altitude': (-300, 3500),
    }.items():
        assert box[name] == pytest.approx(expected, rel=1e-5)


def test_the_calibrated_cessna_glides_nine_to_one() -> None:
    speed = 60 * 1852 / 3600  # the handbook's best glide
    found = polar(np.linspace(-5, 15, 2001), speed, name='cessna152_calibrated')
    best = np.argmax(found['glide'])
    assert found['glide'][best] == pytest.approx(9.0, rel=1e-3)
    # the lift there carries the handbook's weight, 1670 lb; the maximum is flat, and 10 % of
    # lift cost less than 1 % of the ratio
    assert found['lift'][best] == pytest.approx(1670 * 0.45359237 * 9.81, rel=0.1)


@pytest.mark.parametrize('name', ['cessna152', 'cessna152_calibrated'])
def test_steady_glide_and_wind(name: str) -> None:
    stage = load_vehicle(name).model().stage()
    still, air = evaluated(stage, speed=36.0, alpha=3.0, z_e=-500.0)
    assert still['speed'] == pytest.approx(-air['drag'] / 522.4477)
    assert still['gamma'] == pytest.approx((air['lift'] / 522.4477 - 9.81) / 36.0)
    # the same airspeed against a head wind: air moves aft
    _, head = evaluated(stage, (-6.0, 0.0, 0.0), speed=30.0, alpha=3.0, z_e=-500.0)
    assert head['airspeed'] == pytest.approx(36.0)
    assert head['lift'] == pytest.approx(air['lift'])
    # a down draught of 2 m/s turns lift and drag about the new direction of the air
    rates, down = evaluated(stage, (0.0, 0.0, 2.0), speed=36.0, alpha=3.0, z_e=-500.0)
    assert down['airspeed'] == pytest.approx(np.hypot(36.0, 2.0))
    slope = np.arctan2(2.0, 36.0)
    forward = -down['drag'] * np.cos(slope) - down['lift'] * np.sin(slope)
    assert rates['speed'] == pytest.approx(forward / 522.4477)


def test_derivatives_are_right_and_finite_beyond_the_table_and_at_rest() -> None:
    stage = load_vehicle('cessna152').model().stage()
    assert stage.states == ('x_e', 'z_e', 'speed', 'gamma')
    assert stage.controls == ('alpha',)
    scale = [1.0, 100.0, 1.0, 0.1, 0.3]
    for x in (
        [0, -800.0, 40.0, 0.1, 4.0],
        [0, 0.0, 16.0, -0.2, 14.0],
        [0, -5000.0, 90.0, -0.2, 25.0],
        [0, -3510.0, 14.9, 0.1, -10.1],  # where inputs bend
    ):
        check_first_derivatives(stage, np.array(x), (3.0, 2.0, -1.0), np.array(scale) * 0.1)
    function = derivatives(stage)
    for x in ([0, 0, 0, 0, 0], [0, -2e4, 300.0, 1.0, 170.0], [0, 1e4, 1e-9, 0, -180.0]):
        for values in function(x, [0, 0, 0, 0]):
            assert np.all(np.isfinite(values.full()))


def test_the_table_serves_other_classes() -> None:
    turning = load_vehicle('cessna152').with_model('DynamicsPointMass3DSpeedGammaTrack')
    stage = turning.model().stage()
    assert stage.controls == ('alpha', 'bank')
    rates, air = evaluated(stage, speed=36.0, alpha=6.0, bank=0.5)
    assert rates['track'] == pytest.approx(air['lift'] * np.sin(0.5) / (522.4477 * 36.0))
    rigid = load_vehicle('cessna152').with_model('DynamicsRigidBody3DBodyEuler').model().stage()
    assert rigid.controls == ()
    rates, _ = evaluated(rigid, u_b=36.0, w_b=36.0 * np.tan(np.radians(5.0)))
    assert rates['q'] < 0  # about the wing's leading edge, which is ahead of the neutral point


# ---------------------------------------------------------------------- tables of one's own


def made(folder: Path, text: str = VEHICLE, **columns: Any) -> Any:
    (folder / 'vehicles').mkdir(exist_ok=True)
    write_table(columns, folder / 'vehicles' / 'table.csv')
    return vehicle_of(folder, text)


PLAIN = VEHICLE.replace(', flaps: [0, 1]', '')


def grid(**axes: Any) -> dict[str, Any]:
    mesh = np.meshgrid(*axes.values(), indexing='ij')
    return {name: part.ravel() for name, part in zip(axes, mesh, strict=True)}


def test_a_table_over_alpha_mach_and_a_control(tmp_path: Path) -> None:
    rows = grid(alpha=np.arange(-10.0, 21.0, 2.0), mach=np.array([0.1, 0.3, 0.5]), flaps=[0, 1])
    lift = 0.1 * rows['alpha'] * (1 + rows['mach'] ** 2) + 0.5 * rows['flaps']
    drag = 0.03 + 0.05 * lift**2
    shuffled = np.random.default_rng(3).permutation(len(lift))
    columns = {name: values[shuffled] for name, values in {**rows, 'CL': lift, 'CD': drag}.items()}
    vehicle = made(tmp_path, **columns)
    stage = vehicle.model().stage()
    _, air = evaluated(stage, speed=100.0, alpha=3.0, flaps=0.5)
    mach = 100.0 / 340.294
    assert air['mach'] == pytest.approx(mach, rel=1e-5)
    assert air['CL'] == pytest.approx(0.3 * (1 + mach**2) + 0.25, abs=1e-6)
    assert set(vehicle.box) == {'alpha', 'mach', 'flaps'}
    # without samples to check against the error is one of half the nodes; this one is smooth
    assert vehicle.aerodynamics.errors['CL'].samples == 7 * 3 * 2
    assert vehicle.aerodynamics.errors['CL'].largest < 1e-9


def test_a_table_over_beta_and_reynolds_gives_side_force_and_moments(tmp_path: Path) -> None:
    columns = grid(alpha=[-4.0, 12.0], beta=[-10.0, 10.0], reynolds=[1e5, 1e7])
    beta, reynolds = columns['beta'], columns['reynolds']
    text = PLAIN.replace('span: 4', 'span: 4, chord: 0.5, logarithmic: [reynolds]')
    text = text.replace('PointMass2DSpeedGamma', 'RigidBody3DBodyEuler')
    text = text.replace('mass: 10', 'mass: 10\nradii_of_gyration: [1, 1, 1]')
    vehicle = made(
        tmp_path, text, **columns, CL=0.1 * columns['alpha'], CD=0.5 * reynolds**-0.2,
        CY=-0.02 * beta, Cl=-0.001 * beta, Cn=0.002 * beta,
    )  # fmt: skip
    v, angle = 30.0, np.radians(5.0)  # the wind from the right: beta > 0
    rates, air = evaluated(
        vehicle.model().stage(), u_b=v * np.cos(angle), v_b=v * np.sin(angle), z_e=0.0
    )
    force = 0.5 * 1.225 * v**2 * 2.0  # ISA at sea level, area 2 m^2
    # 1e-3: the density of the smooth atmosphere against 1.225
    assert rates['r'] == pytest.approx(force * 4.0 * 0.002 * 5.0 / 10.0, rel=1e-3)
    assert rates['p'] == pytest.approx(-force * 4.0 * 0.001 * 5.0 / 10.0, rel=1e-3)
    # 30 m/s over 0.5 m in air of 1.461e-5 m^2/s (USSA 1976)
    assert air['reynolds'] == pytest.approx(30 * 0.5 / 1.461e-5, rel=2e-3)
    # a power is what a logarithm of drag over one of Reynolds numbers takes to rounding
    assert air['CD'] == pytest.approx(0.5 * air['reynolds'] ** -0.2)
    side = -force * 0.02 * 5.0
    drag = force * air['CD']
    pushed = (side * np.cos(angle) - drag * np.sin(angle)) / 10.0
    assert rates['v_b'] == pytest.approx(pushed, rel=1e-3)


def test_the_error_without_samples_apart_is_pessimistic(tmp_path: Path) -> None:
    alpha = np.linspace(-10.0, 20.0, 31)
    lift = np.sin(0.4 * alpha)
    vehicle = made(tmp_path, PLAIN, alpha=alpha, CL=lift, CD=0.03 + 0 * alpha)
    fit = vehicle.aerodynamics.fits['CL']
    between = np.linspace(*fit.axes[0].box, 500)
    true = np.abs(fit({'alpha': between}) - np.sin(0.4 * between)).max()
    assert true < vehicle.aerodynamics.errors['CL'].largest < 100 * true


def test_samples_apart_are_compared_and_not_fitted(tmp_path: Path) -> None:
    alpha = np.array([0.0, 5.0, 10.0, 3.3])
    vehicle = made(
        tmp_path,
        PLAIN,
        alpha=alpha,
        CL=0.1 * alpha + [0, 0, 0, 0.2],
        CD=[0.1] * 4,
        check=[0, 0, 0, 1],
    )
    error = vehicle.aerodynamics.errors['CL']
    assert (error.samples, error.relative) == (1, False)
    assert error.largest == pytest.approx(0.2)


def test_the_key_of_a_vehicle_changes_with_its_table(tmp_path: Path) -> None:
    alpha = np.array([0.0, 5.0, 10.0])
    first = repr(made(tmp_path, PLAIN, alpha=alpha, CL=0.1 * alpha, CD=[0.1] * 3))
    again = repr(made(tmp_path, PLAIN, alpha=alpha, CL=0.1 * alpha, CD=[0.1] * 3))
    other = repr(made(tmp_path, PLAIN, alpha=alpha, CL=0.1 * alpha, CD=[0.1, 0.1, 0.1000001]))
    assert first == again != other
    assert len(first) < 5000


def test_a_table_is_fitted_once_and_again_when_it_has_changed(tmp_path: Path) -> None:
    alpha = np.array([0.0, 5.0])
    first = made(tmp_path, PLAIN, alpha=alpha, CL=[0.0, 0.5], CD=[0.1, 0.2])
    assert load_vehicle('made', tmp_path).aerodynamics.fits['CL'] is first.aerodynamics.fits['CL']
    path = tmp_path / 'vehicles' / 'table.csv'
    before = path.stat()
    path.write_bytes(path.read_bytes().replace(b'0.5', b'0.7'))
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    changed = load_vehicle('made', tmp_path)
    assert changed.aerodynamics.fits['CL']({'alpha': 2.5}) == pytest.approx(0.35)
    assert repr(changed) != repr(first)


@pytest.mark.parametrize(
    ('columns', 'message'),
    [
        ({'alpah': [0, 1]}, r"table.csv: unknown column 'alpah', did you mean 'alpha'"),
        ({'alpha': [0, 1], 'speed': [0, 1]}, "'speed', did you mean 'airspeed'"),
        ({'alpha': [0, np.nan]}, "column 'alpha' must hold finite numbers"),
        ({'alpha': ['0', 'a']}, "column 'alpha' must hold finite numbers"),
        ({'alpha': [0, 0]}, '2 rows, 1 of them different, are no full grid of 1 alpha = 1'),
        ({'alpha': [0, 1], 'flaps': [0, 1]}, 'no full grid of 2 alpha x 2 flaps = 4'),
        ({'alpha': [0, 1], 'check': [1, 1]}, '0 rows, 0 of them different, are no full grid'),
        ({}, 'no column to be an axis; known: alpha'),
    ],
)
def test_bad_tables_are_refused(tmp_path: Path, columns: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        made(tmp_path, **columns, CL=[0.0, 1.0], CD=[0.1, 0.1])


def test_a_table_may_be_yaml_and_parquet(tmp_path: Path) -> None:
    alpha, lift, drag = [0.0, 4.0, 8.0], [0.1, 0.5, 0.8], [0.02, 0.03, 0.05]
    keys = {repr(made(tmp_path, PLAIN, alpha=alpha, CL=lift, CD=drag))}
    write_table({'alpha': alpha, 'CL': lift, 'CD': drag}, tmp_path / 'vehicles' / 'table.parquet')
    keys.add(repr(vehicle_of(tmp_path, PLAIN.replace('table.csv', 'table.parquet'))))
    text = f'alpha: {alpha}\nCL: {lift}\nCD: {drag}\n'
    path = tmp_path / 'vehicles' / 'table.yaml'
    for content, message in (
        (text, ''),
        (text.replace('0.05]', ']'), 'columns must be of one length, got alpha 3, CL 3, CD 2'),
        (text.replace('0.05]', 'x]'), "table.yaml: column 'CD': expected a number, got 'x'"),
        (text.replace(str(alpha), '3'), "column 'alpha': expected a list, got 3"),
    ):
        path.write_text(content)
        if message:
            with pytest.raises(InputError, match=message):
                vehicle_of(tmp_path, PLAIN.replace('table.csv', 'table.yaml'))
        else:
            keys.add(repr(vehicle_of(tmp_path, PLAIN.replace('table.csv', 'table.yaml'))))
    assert len(keys) == 1  # the same content, wherever it stands


def test_what_is_missing_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"table.csv: there is no column 'CD'"):
        made(tmp_path, alpha=[0, 1], CL=[0, 1])
    text = VEHICLE.replace('span: 4', 'span: 4, logarithmic: [airsped]')
    with pytest.raises(InputError, match=r"no axis 'airsped' to be logarithmic"):
        made(tmp_path, text, alpha=[0, 1], CL=[0, 1], CD=[1, 1])
    with pytest.raises(InputError, match='logarithmic: expected names of axes'):
        made(tmp_path, text.replace('[airsped]', '[[alpha]]'), alpha=[0, 1], CL=[0, 1], CD=[1, 1])
    with pytest.raises(InputError, match=r'no file .*other.csv'):
        made(tmp_path, VEHICLE.replace('table.csv', 'other.csv'), CL=[1])


def test_the_shipped_table_is_of_moderate_size() -> None:
    path = Path(__file__).parents[2] / 'config' / 'vehicles' / 'cessna152_aero.csv'
    assert path.stat().st_size < 150_000
    assert sum(read_table(path)[0]['check']) == 200
