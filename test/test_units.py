"""Units against figures that are defined or tabulated elsewhere."""

import pytest

import flightdyn.units as u

# NIST Special Publication 811 (2008), appendix B.8, to the digits printed there
PRINTED = {
    'foot': 3.048e-1,
    'yard': 9.144e-1,
    'mile': 1.609344e3,
    'naut_mile': 1.852e3,
    'lbm': 4.5359237e-1,
    'oz': 2.834952e-2,
    'slug': 1.459390e1,
    'short_ton': 9.071847e2,
    'long_ton': 1.016047e3,
    'lbf': 4.448222,
    'kgf': 9.80665,
    'knot': 5.144444e-1,
    'mph': 4.4704e-1,
    'kph': 2.777778e-1,
    'fps': 3.048e-1,
    'fpm': 5.08e-3,
    'rpm': 1.047198e-1,
    'deg': 1.745329e-2,
    'acre': 4.046873e3,  # of the survey foot there: 4 parts in 10^6 more
    'gallon_us': 3.785412e-3,
    'gallon_imperial': 4.54609e-3,
    'quart': 9.463529e-4,
    'atm': 1.01325e5,
    'torr': 1.333224e2,
    'psi': 6.894757e3,
    'psf': 4.788026e1,
    'inch_hg': 3.386389e3,
    'btu': 1.055056e3,
    'calorie': 4.184,
    'watt_hour': 3.6e3,
    'horsepower': 7.456999e2,
    'day': 8.64e4,
}


@pytest.mark.parametrize('name', PRINTED)
def test_units_are_as_tabulated(name: str) -> None:
    # seven digits are printed, the first may be 1
    assert getattr(u, name) == pytest.approx(PRINTED[name], rel=5e-6 if name == 'acre' else 5e-7)


def test_definitions_are_exact() -> None:
    assert u.knot == 1852 / 3600
    assert u.lbm == 0.45359237
    assert u.foot == pytest.approx(0.3048, rel=1e-16)
    assert 107 * u.knot == pytest.approx(55.0455556, rel=1e-8)


def test_units_fit_together() -> None:
    assert u.slug * u.foot / u.second**2 == pytest.approx(u.lbf, rel=1e-15)
    assert u.psi == pytest.approx(144 * u.psf, rel=1e-15)
    assert u.rpm * u.minute == pytest.approx(u.revolution, rel=1e-15)
    assert u.hp == pytest.approx(33000 * u.foot * u.lbf / u.minute, rel=1e-15)
    assert (u.ft, u.nmi, u.kt, u.hr) == (u.foot, u.naut_mile, u.knot, u.hour)
