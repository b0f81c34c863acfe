"""AeroBuildup without a table: what its file may say, and its numbers against the table's."""

import json
from pathlib import Path

import numpy as np
import pytest
from vehicle_making import evaluated, vehicle_of

from flightdyn.errors import InputError
from flightdyn.vehicles.aero_direct import DirectAerodynamics
from flightdyn.vehicles.vehicle import load_vehicle

ROOT = Path(__file__).parents[2]
TEXT = (
    (ROOT / 'config' / 'vehicles' / 'cessna152.yaml')
    .read_text(encoding='utf-8')
    .replace('kind: table\n  file: cessna152_aero.csv\n  logarithmic: [airspeed]', 'kind: buildup')
    .replace('  area:', '  direct: true\n  area:')
)


def test_its_file_says_so_and_nothing_of_samples(tmp_path: Path) -> None:
    vehicle = vehicle_of(tmp_path, TEXT)  # AeroSandbox is not needed until it is flown
    assert isinstance(vehicle.aerodynamics, DirectAerodynamics)
    assert vehicle.box == {} and vehicle.fit_errors == {}
    other = vehicle_of(tmp_path, TEXT.replace('chord: 1.1303', 'chord: 1.2'))
    assert repr(vehicle) != repr(other)
    for old, new, message in (
        ('direct: true', 'direct: maybe', "direct: expected true or false, got 'maybe'"),
        ('direct: true', 'direct: true\n  nodes: {alpha: 9}', "'nodes' is of samples"),
        ('direct: true', 'direct: true\n  box: {alpha: [0, 9]}', "'box' is of samples"),
        ('le: [0, 0, 0], chord', 'le: [0, 0, 0], cord', "unknown 'cord', did you mean 'chord'"),
    ):
        assert old in TEXT
        with pytest.raises(InputError, match=message):
            vehicle_of(tmp_path, TEXT.replace(old, new))


@pytest.mark.slow
def test_it_is_what_the_table_was_sampled_from(tmp_path: Path) -> None:
    pytest.importorskip('aerosandbox')
    stage = vehicle_of(tmp_path, TEXT).model().stage()
    table = load_vehicle('cessna152').model().stage()
    wind = (4.0, 0.0, -1.0)
    for values in (
        {'speed': 50.0, 'gamma': -0.05, 'alpha': 3.0, 'z_e': -800.0},
        {'speed': 30.0, 'gamma': 0.1, 'alpha': 11.0, 'z_e': -100.0},
    ):
        rates, direct = evaluated(stage, wind, **values)
        rates_of_table, sampled = evaluated(table, wind, **values)
        # the fit's largest errors: 6.5e-4 of drag, 5e-4 of the lift coefficient
        assert direct['CD'] == pytest.approx(sampled['CD'], rel=7e-4)
        assert direct['CL'] == pytest.approx(sampled['CL'], abs=5e-4)
        assert rates['gamma'] == pytest.approx(rates_of_table['gamma'], abs=1e-3)


def test_it_is_aerobuildups_polar_on_arrays(tmp_path: Path) -> None:
    pytest.importorskip('aerosandbox')
    from flightdyn.dynamics import DynamicsPointMass2DSpeedGamma

    golden = json.loads((ROOT / 'test' / 'data' / 'golden' / 'cessna_polar.json').read_text())
    aerodynamics = vehicle_of(tmp_path, TEXT).aerodynamics
    assert isinstance(aerodynamics, DirectAerodynamics)
    dyn = DynamicsPointMass2DSpeedGamma(speed=golden['velocity'], alpha=np.array(golden['alpha']))
    found = aerodynamics.coefficients(dyn, {})
    # the atmospheres differ by 1e-4 in viscosity
    np.testing.assert_allclose(found['CL'], golden['CL'], atol=1e-4)
    np.testing.assert_allclose(found['CD'], golden['CD'], rtol=2e-4)
