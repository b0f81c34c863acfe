"""The textbook's rocket: 100 km in 100 s on the least fuel, written as the book does it."""

import pytest

import flightdyn as asb
import flightdyn.numpy as np

N = 100  # number of discretization points
mass_initial = 500e3  # kg
z_final = 100e3  # m
g = 9.81  # m/s^2
alpha_fuel = 1 / (300 * g)  # kg of fuel per N-s of impulse


def test_manual_forward_euler():
    opti = asb.Opti()
    time = np.linspace(0, 100, N)

    altitude = opti.variable(init_guess=np.linspace(0, z_final, N))
    velocity = opti.variable(init_guess=z_final / 100, n_vars=N)
    mass = opti.variable(init_guess=mass_initial, n_vars=N)
    thrust = opti.variable(init_guess=g * mass_initial, n_vars=N, lower_bound=0)

    opti.subject_to(
        [
            np.diff(altitude) == velocity[:-1] * np.diff(time),
            np.diff(velocity) == (thrust[:-1] / mass[:-1] - g) * np.diff(time),
            np.diff(mass) == -alpha_fuel * thrust[:-1] * np.diff(time),
        ]
    )
    opti.subject_to(
        [
            altitude[0] == 0,
            velocity[0] == 0,
            mass[0] == mass_initial,
            altitude[-1] == z_final,
            mass >= 0,
        ]
    )
    opti.minimize(-mass[-1])
    sol_manual = opti.solve(verbose=False)
    fuel_manual = mass_initial - sol_manual(mass[-1])

    # The book prints 210.0 t; AeroSandbox 4.2.10 gives 209.950 t.
    assert fuel_manual == pytest.approx(209.950e3, abs=1)


def test_dynamics_engine():
    opti = asb.Opti()
    time = np.linspace(0, 100, N)

    dyn = asb.DynamicsPointMass1DVertical(
        mass_props=asb.MassProperties(mass=opti.variable(init_guess=mass_initial, n_vars=N)),
        z_e=opti.variable(init_guess=np.linspace(0, -z_final, N)),
        w_e=opti.variable(init_guess=-z_final / 100, n_vars=N),
    )
    thrust = opti.variable(init_guess=g * mass_initial, n_vars=N, lower_bound=0)
    dyn.add_force(Fz=-thrust)  # Earth axes are North-East-Down: "up" is -z!
    dyn.add_gravity_force(g=g)
    dyn.constrain_derivatives(opti, time)
    opti.constrain_derivative(
        derivative=-alpha_fuel * thrust,
        variable=dyn.mass_props.mass,
        with_respect_to=time,
    )
    opti.subject_to(
        [
            dyn.z_e[0] == 0,
            dyn.w_e[0] == 0,
            dyn.mass_props.mass[0] == mass_initial,
            dyn.z_e[-1] == -z_final,
            dyn.mass_props.mass >= 0,
        ]
    )
    opti.minimize(-dyn.mass_props.mass[-1])
    sol = opti.solve(verbose=False)
    dyn = sol(dyn)
    fuel_engine = mass_initial - dyn.mass_props.mass[-1]

    # The book prints 201.7 t; AeroSandbox 4.2.10 gives 201.713 t.
    assert fuel_engine == pytest.approx(201.713e3, abs=1)


def test_refined_grid():
    def solve_rocket_trapezoidal(N_ref):
        opti = asb.Opti()
        time = np.linspace(0, 100, N_ref)
        z = opti.variable(init_guess=np.linspace(0, z_final, N_ref))
        v = opti.variable(init_guess=z_final / 100, n_vars=N_ref)
        m = opti.variable(init_guess=mass_initial, n_vars=N_ref)
        T = opti.variable(init_guess=g * mass_initial, n_vars=N_ref, lower_bound=0)
        opti.constrain_derivative(v, z, time)
        opti.constrain_derivative(T / m - g, v, time)
        opti.constrain_derivative(-alpha_fuel * T, m, time)
        opti.subject_to([z[0] == 0, v[0] == 0, m[0] == mass_initial, z[-1] == z_final, m >= 0])
        opti.minimize(-m[-1])
        return mass_initial - opti.solve(verbose=False)(m[-1])

    fuel_ref = solve_rocket_trapezoidal(N_ref=2000)

    # AeroSandbox 4.2.10 gives 199.027 t. The limit for ever finer grids, an impulse at the start
    # that needs 198.686 t, is from below: a rule that saved more fuel would be at fault.
    assert fuel_ref == pytest.approx(199.027e3, abs=1)
    assert fuel_ref > 198.686e3
