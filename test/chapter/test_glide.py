"""The textbook's engine-out glide in its own words, with a parabolic polar."""

import pytest

import flightdyn as asb
import flightdyn.numpy as np
import flightdyn.units as u

area, lift_slope, lift_zero, drag_zero, induced = 15.0, 0.09, 0.2, 0.0133, 0.0535


def test_maximum_range_glide():
    opti = asb.Opti()

    ### Time discretization: free final time, cosine-spaced to resolve both ends
    N = 50
    time = np.cosspace(0, opti.variable(init_guess=180, log_transform=True), N)
    time_guess = np.linspace(0, 180, N)

    mass_props = asb.mass_properties_from_radius_of_gyration(
        mass=1151.8 * u.lbm,
        radius_of_gyration_x=2,
        radius_of_gyration_y=3,
        radius_of_gyration_z=3,  # m
    )
    init_state = {'x_e': 0, 'z_e': -1000, 'speed': 107 * u.knot, 'gamma': 0}
    dyn = asb.DynamicsPointMass2DSpeedGamma(
        mass_props=mass_props,
        x_e=opti.variable(init_guess=init_state['speed'] * time_guess),
        z_e=opti.variable(init_guess=np.linspace(init_state['z_e'], 0, N)),
        speed=opti.variable(init_guess=init_state['speed'], n_vars=N),
        gamma=opti.variable(init_guess=0, n_vars=N, lower_bound=-np.pi / 2, upper_bound=np.pi / 2),
        alpha=opti.variable(init_guess=5, n_vars=N, lower_bound=-5, upper_bound=15),
    )
    for k in dyn.state.keys():  # noqa: SIM118
        opti.subject_to(dyn.state[k][0] == init_state[k])

    dyn.add_gravity_force(g=9.81)
    CL = lift_zero + lift_slope * dyn.alpha
    CD = drag_zero + induced * CL**2
    qS = dyn.op_point.dynamic_pressure() * area
    dyn.add_force(Fx=-qS * CD, Fz=-qS * CL, axes='wind')

    opti.subject_to(dyn.altitude > 0)
    dyn.constrain_derivatives(opti, time)
    opti.minimize(-dyn.x_e[-1])
    sol = opti.solve(verbose=False)
    dyn = sol(dyn)

    # AeroSandbox 4.2.10 reaches 21,177.0 m in 623.98 s, with its own atmosphere.
    assert dyn.x_e[-1] == pytest.approx(21_177, abs=3)
    assert sol(time)[-1] == pytest.approx(624, abs=1)
    # Energy height times the best glide ratio is the most that there is.
    energy_height = 1000 + init_state['speed'] ** 2 / (2 * 9.81)
    assert dyn.x_e[-1] < energy_height / (2 * np.sqrt(drag_zero * induced))
    # On the way it holds the angle of best glide.
    best = (np.sqrt(drag_zero / induced) - lift_zero) / lift_slope
    assert np.median(dyn.alpha) == pytest.approx(best, abs=0.3)
    assert np.min(dyn.altitude) >= -1e-4  # 1e-8 of the scale of 1000 m, and some to spare
