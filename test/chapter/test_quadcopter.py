"""The textbook's planar quadcopter: open-loop flight, and a flip in minimum time."""

import pytest

import flightdyn as asb
import flightdyn.numpy as np

quad_mass_props = asb.MassProperties(
    mass=0.1,  # kg
    Iyy=0.5 * 0.1 * 0.1**2,  # kg m^2; Ixx and Izz don't matter in 2D
    Ixx=1,
    Izz=1,
)


def test_open_loop_flight_is_an_optimization_with_nothing_left_to_choose():
    opti = asb.Opti()
    N = 150
    time = np.linspace(0, 1, N)  # sec
    left_thrust = 0.85 * np.ones(N)  # N (prescribed, not a variable!)
    right_thrust = 0.78 * np.ones(N)

    dyn = asb.DynamicsRigidBody2DBody(
        mass_props=quad_mass_props,
        x_e=opti.variable(init_guess=0, n_vars=N),
        z_e=opti.variable(init_guess=0, n_vars=N),
        u_b=opti.variable(init_guess=0, n_vars=N),
        w_b=opti.variable(init_guess=0, n_vars=N),
        theta=opti.variable(init_guess=0, n_vars=N),
        q=opti.variable(init_guess=0, n_vars=N),
    )
    dyn.add_force(Fz=-(left_thrust + right_thrust), axes='body')
    dyn.add_moment(My=(right_thrust - left_thrust) * 0.1 / 2)
    dyn.add_gravity_force()
    dyn.constrain_derivatives(opti, time)
    opti.subject_to(
        [
            dyn.x_e[0] == 0,
            dyn.z_e[0] == 0,
            dyn.u_b[0] == 0,
            dyn.w_b[0] == 0,
            dyn.theta[0] == 0,
            dyn.q[0] == 0,
        ]
    )
    sol = opti.solve(verbose=False)  # no objective: this is pure simulation
    dyn = sol(dyn)

    # AeroSandbox 4.2.10 on the same grid; theta and q are those of the constant moment.
    assert dyn.x_e[-1] == pytest.approx(3.1363, abs=1e-3)
    assert dyn.z_e[-1] == pytest.approx(-0.8481, abs=1e-3)
    assert dyn.theta[-1] == pytest.approx(-3.5, abs=1e-6)
    assert dyn.q[-1] == pytest.approx(-7.0, abs=1e-6)
    assert np.max(dyn.altitude) == pytest.approx(1.3164, abs=1e-3)


def test_minimum_time_flip():
    opti = asb.Opti()
    N = 80
    time_final = opti.variable(init_guess=1, lower_bound=0)
    time = np.linspace(0, time_final, N)

    left_thrust = opti.variable(init_guess=0.5, n_vars=N, lower_bound=0, upper_bound=1)
    right_thrust = opti.variable(init_guess=0.5, n_vars=N, lower_bound=0, upper_bound=1)

    dyn = asb.DynamicsRigidBody2DBody(
        mass_props=quad_mass_props,
        x_e=opti.variable(init_guess=np.linspace(0, 1, N)),
        z_e=opti.variable(init_guess=0, n_vars=N),
        u_b=opti.variable(init_guess=0, n_vars=N),
        w_b=opti.variable(init_guess=0, n_vars=N),
        theta=opti.variable(init_guess=np.linspace(0, -2 * np.pi, N)),
        q=opti.variable(init_guess=0, n_vars=N),
    )
    dyn.add_force(Fz=-(left_thrust + right_thrust), axes='body')
    dyn.add_moment(My=(right_thrust - left_thrust) * 0.1 / 2)
    dyn.add_gravity_force()
    dyn.constrain_derivatives(opti, time)
    opti.subject_to([dyn.state[k][0] == 0 for k in dyn.state])
    opti.subject_to(
        [
            dyn.x_e[-1] == 1,
            dyn.z_e[-1] == 0,
            dyn.u_b[-1] == 0,
            dyn.w_b[-1] == 0,
            dyn.theta[-1] == -2 * np.pi,
            dyn.q[-1] == 0,
        ]
    )
    opti.minimize(time_final)
    sol = opti.solve(verbose=False)
    dyn = sol(dyn)

    # AeroSandbox 4.2.10 on the same grid: 0.82577 s, at most 0.3402 m high.
    assert sol(time_final) == pytest.approx(0.82577, abs=1e-4)
    assert sol(time)[-1] == pytest.approx(sol(time_final), rel=1e-12)
    assert np.max(dyn.altitude) == pytest.approx(0.3402, abs=1e-3)
    # Bang-bang, and bounds are met exactly.
    for thrust in (sol(left_thrust), sol(right_thrust)):
        assert thrust.min() >= 0 and thrust.max() <= 1
        assert ((thrust < 0.01) | (thrust > 0.99)).mean() > 0.8
    # A snapshot in time, as the book's drawing of the flight takes it.
    assert dyn[5].theta == dyn.theta[5] and len(dyn) == N
