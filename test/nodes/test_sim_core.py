"""The simulator's clockwork against a clock that the test moves."""

import numpy as np
import pytest

from flightdyn.errors import InputError
from flightdyn.nodes.sim_core import Sample, SimCore
from flightdyn.trajectory import Trajectory
from flightdyn.vehicles.vehicle import load_vehicle

EPOCH = 1_700_000_000 * 10**9
HOVER = 0.1 * 9.81 / 2  # N, of each rotor of the 0.1 kg quadcopter


class Bench:
    """A core, the samples it published, and the wall clock."""

    def __init__(self, **settings: object) -> None:
        self.samples: list[Sample] = []
        self.wall = 0.0
        self.ended = 0
        self.core = SimCore(
            load_vehicle,
            self.samples.append,
            **{  # type: ignore[arg-type]
                'vehicle': 'quadcopter',
                'rate': 10.0,
                'epoch_ns': EPOCH,
                'clock': lambda: self.wall,
                'on_plan_end': self.end,
                **settings,
            },
        )

    def end(self) -> None:
        self.ended += 1

    def pass_time(self, seconds: float, step: float = 0.05) -> None:
        """Tick often, as the node's timer does."""
        end = self.wall + seconds
        while self.wall < end - 1e-9:
            self.wall = min(self.wall + step, end)
            self.core.tick()

    @property
    def times(self) -> list[float]:
        return [sample.time for sample in self.samples]


def plan(duration: float = 0.25, thrust: float = HOVER, **changes: object) -> Trajectory:
    n = 3
    values = {
        'time': np.linspace(5.0, 5.0 + duration, n),  # plans need not begin at 0
        'states': {'x_e': np.full(n, 1.0), 'z_e': np.full(n, -2.0)},
        'controls': {name: np.full(n, thrust) for name in ('thrust_left', 'thrust_right')},
        'model': 'DynamicsRigidBody2DBody',
        'vehicle': 'quadcopter',
        'control_interpolation': 'previous',
        **changes,
    }
    return Trajectory(**values)  # type: ignore[arg-type]


def test_time_stands_still_until_there_is_something_to_fly() -> None:
    bench = Bench()
    bench.pass_time(1.0)
    assert not bench.samples
    assert bench.core.clock_ns == EPOCH


def test_plan_is_sampled_on_the_grid_and_exactly_at_both_ends() -> None:
    bench = Bench()
    bench.core.fly(plan(0.25))
    bench.pass_time(1.0)
    assert bench.times == [0.0, 0.1, 0.2, 0.25]
    assert bench.ended == 1
    assert bench.core.is_paused
    last = bench.samples[-1]
    assert last.clock_ns == EPOCH + 250_000_000
    assert (last.states['x_e'], last.states['z_e']) == pytest.approx((1.0, -2.0), abs=1e-9)


def test_hovering_feels_one_g_and_falling_none() -> None:
    bench = Bench()
    bench.core.fly(plan())
    assert bench.samples[0].specific_force_b == pytest.approx((0, 0, -9.81), abs=1e-9)
    bench.core.fly(plan(thrust=0.0))
    assert bench.samples[-1].specific_force_b == pytest.approx((0, 0, 0), abs=1e-9)


def test_hold_goes_on_after_the_plan_with_its_last_controls() -> None:
    bench = Bench(after_plan='hold')
    bench.core.fly(plan(0.25))
    bench.pass_time(0.5)
    assert bench.times == pytest.approx([0.0, 0.1, 0.2, 0.25, 0.3, 0.4, 0.5])
    assert bench.samples[-1].controls['thrust_left'] == HOVER


def test_run_time_follows_the_real_time_factor() -> None:
    bench = Bench(after_plan='hold', real_time_factor=0.5)
    bench.core.fly(plan())
    bench.pass_time(1.0)
    assert bench.times[-1] == pytest.approx(0.5)
    bench.core.real_time_factor = 2.0
    bench.pass_time(1.0)
    assert bench.times[-1] == pytest.approx(2.5)


def test_factor_zero_does_not_wait() -> None:
    bench = Bench(real_time_factor=0.0)
    bench.core.fly(plan(3.0))
    bench.core.tick()
    assert bench.times[-1] == 3.0


def test_pause_holds_time_and_resume_does_not_catch_up() -> None:
    bench = Bench(after_plan='hold')
    bench.core.fly(plan())
    bench.pass_time(0.3)
    bench.core.pause()
    bench.pass_time(5.0)
    assert bench.times[-1] == pytest.approx(0.3)
    bench.core.resume()
    bench.pass_time(0.1)
    assert bench.times[-1] == pytest.approx(0.4)


def test_step_publishes_its_end_and_stays_paused() -> None:
    bench = Bench(after_plan='hold')
    bench.core.fly(plan())
    bench.core.pause()
    bench.core.step(0.13)
    bench.core.step(0.1)
    assert bench.times == pytest.approx([0, 0.1, 0.13, 0.2, 0.23])
    bench.pass_time(1.0)
    assert bench.times[-1] == pytest.approx(0.23)


@pytest.mark.parametrize('duration', [0.0, -1.0, 61.0, float('nan')])
def test_bad_steps_are_refused(duration: float) -> None:
    bench = Bench()
    bench.core.fly(plan())
    bench.core.pause()
    with pytest.raises(InputError, match='duration'):
        bench.core.step(duration)


def test_step_needs_a_pause() -> None:
    bench = Bench()
    with pytest.raises(InputError, match='nothing'):
        bench.core.step(0.1)
    bench.core.fly(plan())
    with pytest.raises(InputError, match='pause'):
        bench.core.step(0.1)


def test_clock_never_goes_back() -> None:
    bench = Bench()
    for _ in range(2):
        bench.core.fly(plan())
        bench.pass_time(1.0)
        bench.core.reset()
        bench.pass_time(0.15)
    clocks = [sample.clock_ns for sample in bench.samples]
    assert np.diff(clocks).min() > 0
    assert bench.times.count(0.0) == 4


def test_a_new_plan_ends_the_pause_of_the_old_one_but_not_the_users() -> None:
    bench = Bench()
    bench.core.fly(plan())
    bench.pass_time(1.0)
    assert bench.core.is_paused
    bench.core.fly(plan())
    assert not bench.core.is_paused
    bench.core.pause()
    bench.core.fly(plan())
    assert bench.core.is_paused


def test_command_holds_and_leaves_the_plan() -> None:
    bench = Bench()
    bench.core.fly(plan(1.0))
    bench.pass_time(0.5)
    bench.core.command(
        plan(
            thrust=0.5,
            time=np.zeros(1),
            states={},
            controls={
                'thrust_left': np.array([0.5]),
                'thrust_right': np.array([0.5]),
            },
        )
    )
    bench.pass_time(1.0)
    assert bench.times[-1] == pytest.approx(1.5)  # the plan's end at 1.0 means nothing
    last = bench.samples[-1]
    assert last.controls['thrust_left'] == 0.5
    climb = (2 * 0.5 / 0.1 - 9.81) * 1.0**2 / 2  # constant acceleration over one second
    assert last.states['z_e'] == pytest.approx(-2.0 - climb, abs=1e-9)


def test_command_beyond_the_limits_is_refused() -> None:
    bench = Bench()
    with pytest.raises(InputError, match=r'thrust_left.*outside'):
        bench.core.command(plan(thrust=1.5))
    assert bench.core.run is None


def test_plan_for_another_model_is_refused_and_the_run_goes_on() -> None:
    bench = Bench()
    bench.core.fly(plan(1.0))
    with pytest.raises(InputError, match='model'):
        bench.core.fly(plan(model='DynamicsPointMass3DSpeedGammaTrack'))
    bench.pass_time(0.2)
    assert bench.times[-1] == pytest.approx(0.2)


def test_plan_brings_its_wind() -> None:
    bench = Bench(wind=(9.0, 9.0, 9.0))
    wind = {f'wind_{axis}_e': np.full(3, v) for axis, v in zip('xyz', (3.0, 0, 4), strict=True)}
    bench.core.fly(plan(outputs=wind))
    assert bench.samples[0].outputs['airspeed'] == pytest.approx(5.0)


def test_slow_machine_makes_time_slower_instead_of_falling_behind() -> None:
    bench = Bench(after_plan='hold')
    bench.core.fly(plan())
    bench.wall = 2.0  # the process was held up for two seconds
    bench.core.tick()
    late = bench.times[-1]
    bench.pass_time(0.1)
    assert bench.times[-1] - late <= 0.2 + 1e-9
