"""Flying: closed forms, convergence order, two integrators to one answer."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flightdyn.errors import InputError
from flightdyn.simulation.gusts import Gusts
from flightdyn.simulation.integrator import reintegrate, rk4_step
from flightdyn.simulation.scenario import load_scenario
from flightdyn.simulation.simulator import Simulator, fly
from flightdyn.trajectory import Trajectory
from flightdyn.vehicles.vehicle import load_vehicle

MODEL = load_vehicle('quadcopter').model()
STAGE = MODEL.stage()


def held(left: float, right: float) -> Trajectory:
    return Trajectory(
        time=np.zeros(1),
        states={},
        controls={'thrust_left': np.array([left]), 'thrust_right': np.array([right])},
        control_interpolation='previous',
    )


def test_free_fall_is_a_parabola() -> None:
    simulator = Simulator(MODEL, {'u_b': 3.0, 'q': 1.5}, held(0, 0))
    flown = fly(simulator, 2.0, 50)
    np.testing.assert_allclose(flown['x_e'], 3.0 * flown.time, atol=1e-9)
    np.testing.assert_allclose(flown['z_e'], 9.81 / 2 * flown.time**2, atol=1e-9)
    np.testing.assert_allclose(flown['theta'], 1.5 * flown.time, atol=1e-9)


def test_energy_is_kept_without_thrust() -> None:
    flown = fly(Simulator(MODEL, {'u_b': 5.0, 'w_b': -7.0, 'q': 9.0}, held(0, 0)), 3.0, 100)
    energy = flown['speed'] ** 2 / 2 - 9.81 * flown['z_e']
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)


def test_open_loop_scenario_ends_where_dop853_does() -> None:
    # reference: SciPy DOP853 on the textbook's open-loop case
    scenario = load_scenario('quadcopter_open_loop')
    flown = fly(scenario.simulator(), scenario.duration, 100)
    expected = {
        'x_e': 3.1366300592012495,
        'z_e': -0.8480750176808798,
        'u_b': -8.86959714809234,
        'w_b': -1.8820335119928324,
        'theta': -3.499999999999997,
        'q': -6.999999999999994,
    }
    for name, value in expected.items():
        assert flown[name][-1] == pytest.approx(value, abs=2e-6), name
    assert -flown['z_e'].min() == pytest.approx(1.3164349673638729, abs=1e-4)


def test_a_scenario_drifts_and_rises_with_its_wind(tmp_path: Path) -> None:
    """A feather goes where the air goes: shear from the west, and a thermal on top of it."""
    (tmp_path / 'vehicles').mkdir()
    (tmp_path / 'vehicles' / 'feather.yaml').write_text("""
model: DynamicsPointMass3DCartesian
mass: 0.02
gravity: 0.001
controls: {alpha: [0, 10], beta: [0, 0], bank: [0, 0]}
aerodynamics: {kind: polar, area: 1, span: 1, CL_alpha: 0, CD0: 1, k: 0}
""")
    path = tmp_path / 'drift.yaml'
    path.write_text("""
vehicle: feather
duration: 4
initial: {z_e: -100}
controls: {alpha: 0, beta: 0, bank: 0}
max_step: 0.001
rate: 10
wind:
  - {kind: shear, gradient: 0.1, from: 270 deg}
  - {kind: thermal, x: 0, y: 0, updraft: 2, radius: 1000}
""")
    scenario = load_scenario(str(path), tmp_path)
    flown = fly(scenario.simulator(), scenario.duration, scenario.rate)
    last = {name: float(values[-1]) for name, values in flown.states.items()}
    # quadratic drag lets 0.04 m/s be left after 4 s, and 0.08 m/s where the shear speeds it up
    assert last['w_e'] == pytest.approx(-2, abs=0.05)
    assert last['v_e'] == pytest.approx(0.1 * -last['z_e'], rel=0.02)
    assert abs(last['x_e']) < 1e-6
    path.write_text(path.read_text().replace('gradient: 0.1, ', ''))
    with pytest.raises(InputError, match=r"drift.yaml: wind\[0\]: 'gradient' is missing"):
        load_scenario(str(path), tmp_path)


def test_rk4_converges_with_fourth_order() -> None:
    # q = 0 and equal thrusts would be integrated exactly; the spin makes the problem hard enough
    x0, u, p = [0, 0, 3, 1, 0.3, 8.0], [0.9, 0.2], [0, 0, 0, 0]
    exact = solve_ivp(
        lambda t, x: STAGE.function(x, u, p)[0].full().ravel(),
        (0, 0.5),
        x0,
        method='DOP853',
        rtol=1e-13,
        atol=1e-13,
    ).y[:, -1]
    errors = []
    for substeps in (4, 8, 16, 32, 64):
        end = rk4_step(STAGE, substeps)(x0, u, u, p, 0.5).full().ravel()
        errors.append(np.abs(end - exact).max())
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    assert slopes[-1] == pytest.approx(4, abs=0.2)


def test_simulator_agrees_with_cvodes_on_jumping_and_running_controls() -> None:
    time = np.array([0.0, 0.1, 0.25, 0.5])
    left, right = np.array([1.0, 0.0, 0.4, 0.9]), np.array([0.0, 1.0, 0.7, 0.1])
    table = np.array([left, right])
    for interpolation in ('previous', 'linear'):
        plan = Trajectory(
            time=time,
            states={},
            controls={'thrust_left': left, 'thrust_right': right},
            control_interpolation=interpolation,  # type: ignore[arg-type]
        )
        end = table[:, 1:] if interpolation == 'linear' else table[:, :-1]
        reference = reintegrate(STAGE, np.zeros(6), time, table[:, :-1], end, np.zeros(3))
        flown = fly(Simulator(MODEL, {}, plan), 0.5, 7, also_at=time)
        for i, name in enumerate(STAGE.states):
            np.testing.assert_allclose(
                flown.sample(name, time), reference[i], atol=1e-8, err_msg=name
            )


def test_cvodes_flies_as_runge_and_kutta_do_in_wind_and_gusts() -> None:
    """Steps of 1 ms err by some nanometres in 0.3 s; gusts depend on what was flown before."""
    glider = load_vehicle('cessna152').model()
    time = np.array([0.0, 0.1, 0.3])
    plan = Trajectory(time=time, states={}, controls={'alpha': np.array([3.0, 5.0, 1.0])})
    flown = [
        fly(
            Simulator(
                glider,
                {'z_e': -300.0, 'speed': 40.0},
                plan,
                wind=(-4.0, 0.0, 1.0),
                gusts=Gusts('severe', 2),
                method=method,  # type: ignore[arg-type]
            ),
            0.3,
            10,
        )
        for method in ('rk4', 'cvodes')
    ]
    for name, values in flown[0].states.items():
        np.testing.assert_allclose(flown[1][name], values, atol=1e-7, err_msg=name)


def test_unknown_methods_are_refused() -> None:
    with pytest.raises(InputError, match="unknown method 'euler'"):
        Simulator(MODEL, {}, held(0, 0), method='euler')  # type: ignore[arg-type]


def test_another_wind_and_its_gusts_blow_from_now_on() -> None:
    simulator = Simulator(MODEL, {}, held(0, 0))
    simulator.blow((3.0, 0.0, 0.0))
    assert simulator.sample()[2]['airspeed'] == pytest.approx(3.0)
    simulator.blow((3.0, 0.0, 0.0), Gusts('severe', 1))
    gusty = simulator.sample()[2]['airspeed']
    assert gusty != pytest.approx(3.0)
    simulator.blow((3.0, 0.0, 0.0))
    assert simulator.sample()[2]['airspeed'] == gusty


def test_sampling_rate_does_not_change_the_flight() -> None:
    ends = [
        fly(Simulator(MODEL, {}, held(0.85, 0.78)), 1.0, rate)['x_e'][-1] for rate in (3, 1000)
    ]
    assert ends[0] == pytest.approx(ends[1], abs=1e-10)


@pytest.mark.parametrize(
    ('initial', 'message'),
    [({'x': 1.0}, "no state 'x'"), ({'x_e': float('nan')}, 'must be finite')],
)
def test_bad_initial_states_are_refused(initial: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Simulator(MODEL, initial, held(0, 0))


def test_missing_controls_are_named() -> None:
    with pytest.raises(InputError, match='controls thrust_left, thrust_right are missing'):
        Simulator(MODEL, {}, Trajectory(time=np.zeros(1), states={}))


def test_scenario_beyond_the_vehicles_limits_is_refused(tmp_path: Path) -> None:
    path = tmp_path / 'wild.yaml'
    path.write_text(
        'vehicle: quadcopter\nduration: 1\ncontrols: {thrust_left: 2, thrust_right: 0}\n'
    )
    with pytest.raises(InputError, match=r'thrust_left: 2 is outside \[0, 1\]'):
        load_scenario(str(path))


@pytest.mark.parametrize(('duration', 'rate'), [(0, 100), (1, 0), (1, float('inf')), (1e9, 1e6)])
def test_absurd_sampling_is_refused(duration: float, rate: float) -> None:
    with pytest.raises(InputError):
        fly(Simulator(MODEL, {}, held(0, 0)), duration, rate)


def test_the_helium_balloon_rises_to_96_km_in_six_hours() -> None:
    """CVODES at tight tolerance gives 96.01 km; AeroSandbox's own atmosphere 95.99 km."""
    scenario = load_scenario('helium_balloon')
    flown = fly(scenario.simulator(), scenario.duration, scenario.rate)
    assert -flown.states['z_e'][-1] == pytest.approx(96_011.5, abs=5.0)


@pytest.mark.parametrize(
    ('line', 'message'),
    [
        ('duration: 0', 'duration: must be positive, got 0'),
        ('max_step: -1', 'max_step: must be positive, got -1'),
        ('rate: 0', 'rate: must be positive, got 0'),
        ('controls: {thrust: 1}', "controls: unknown 'thrust'"),
    ],
)
def test_a_scenario_says_what_is_wrong_with_it(tmp_path: Path, line: str, message: str) -> None:
    path = tmp_path / 'scenario.yaml'
    lines = {'vehicle': 'balloon', 'duration': '10'}
    key, _, value = line.partition(': ')
    path.write_text('\n'.join(f'{k}: {v}' for k, v in (lines | {key: value}).items()))
    with pytest.raises(InputError, match=message):
        load_scenario(str(path))
