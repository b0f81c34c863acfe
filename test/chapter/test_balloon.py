"""The textbook's birthday balloon: Dynamics as right-hand side of an integrator of SciPy."""

import pytest

import flightdyn as asb
import flightdyn.numpy as np
import flightdyn.units as u
from flightdyn import gas_constant_universal

integrate = pytest.importorskip('scipy.integrate')

### Balloon parameters
mass_rubber = 0.005  # kg
helium_molar_mass = 4.002602e-3  # kg/mol
atmo_sl = asb.Atmosphere(altitude=0)
volume_sl = 4 / 3 * np.pi * ((10 * u.inch) / 2) ** 3
mass_helium = (  # PV = nRT
    atmo_sl.pressure()
    * volume_sl
    * helium_molar_mass
    / (gas_constant_universal * atmo_sl.temperature())
)
dyn_template = asb.DynamicsPointMass2DCartesian(
    mass_props=asb.MassProperties(mass=mass_rubber + mass_helium)
)


def balloon_volume(atmosphere):
    return (
        mass_helium
        / helium_molar_mass
        * gas_constant_universal
        * atmosphere.temperature()
        / atmosphere.pressure()
    )


def equations_of_motion(t, y):
    g = 9.81
    dyn = dyn_template.get_new_instance_with_state(dyn_template.pack_state(y))
    dyn.add_gravity_force(g=g)

    # Buoyancy: weight of displaced air, pointing up (-z in Earth axes)
    volume = balloon_volume(dyn.op_point.atmosphere)
    dyn.add_force(Fz=-volume * dyn.op_point.atmosphere.density() * g, axes='earth')

    # Drag on a sphere
    radius = (volume * 3 / (4 * np.pi)) ** (1 / 3)
    dyn.add_force(Fx=-dyn.op_point.dynamic_pressure() * 0.4 * np.pi * radius**2, axes='wind')
    return dyn.unpack_state(dyn.state_derivatives())


# AeroSandbox 4.2.10 converges to 95.993 km and 14.03 m; what its default tolerance of 1e-3 gives,
# 96.45 km, is off by as much as that tolerance lets the integrator err.
@pytest.mark.filterwarnings('ignore:altitude is outside')  # at 96 km it is
@pytest.mark.parametrize(
    ('tolerances', 'altitude', 'radius'),
    [
        (
            {'rtol': 1e-8, 'atol': 1e-8},
            pytest.approx(95.99, abs=0.05),
            pytest.approx(14.03, abs=0.05),
        ),
        ({}, pytest.approx(95.99, rel=0.03), pytest.approx(14.03, rel=0.1)),
    ],
    ids=['tight', 'default'],
)
def test_balloon_rises_for_six_hours(tolerances, altitude, radius):
    t_eval = np.cosspace(0, 6 * 3600, 300)  # six hours
    res = integrate.solve_ivp(
        fun=equations_of_motion,
        t_span=(t_eval.min(), t_eval.max()),
        t_eval=t_eval,
        y0=dyn_template.unpack_state({'x_e': 0, 'z_e': 0, 'u_e': 0, 'w_e': 0}),
        method='LSODA',
        **tolerances,
    )
    dyn = dyn_template.get_new_instance_with_state(dyn_template.pack_state(res.y))
    balloon_radius = (balloon_volume(dyn.op_point.atmosphere) * 3 / (4 * np.pi)) ** (1 / 3)

    assert dyn.altitude[-1] / 1e3 == altitude
    assert balloon_radius[-1] == radius
