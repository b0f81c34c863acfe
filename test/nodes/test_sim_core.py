"""The simulator's clockwork against a clock that the test moves."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from flightdyn.errors import InputError
from flightdyn.nodes.sim_core import Rules, Sample, SimCore, Start
from flightdyn.nodes.sim_run import Setting
from flightdyn.nodes.sim_watch import Event
from flightdyn.simulation.gusts import Gusts
from flightdyn.trajectory import Trajectory
from flightdyn.vehicles.vehicle import load_vehicle

EPOCH = 1_700_000_000 * 10**9
HOVER = 0.1 * 9.81 / 2  # N, of each rotor of the 0.1 kg quadcopter


class Bench:
    """A core, what it published, and the wall clock.

    Plans are flown open-loop unless `following` says otherwise.
    """

    def __init__(
        self,
        *,
        vehicle: str = 'quadcopter',
        following: str = 'open_loop',
        wind: tuple[float, ...] = (0.0, 0.0, 0.0),
        gusts: Gusts | None = None,
        start: Start | None = None,
        settings: Sequence[str] = (),
        **rules: object,
    ) -> None:
        self.samples: list[Sample] = []
        self.events: list[Event] = []
        self.wall = 0.0
        self.core = SimCore(
            lambda name: (load_vehicle(name), load_vehicle(name, None, settings)),
            Setting(vehicle=vehicle, following=following, wind=wind, gusts=gusts),  # type: ignore[arg-type]
            self.samples.append,
            self.events.append,
            rate=10.0,
            epoch_ns=EPOCH,
            rules=Rules(**rules),  # type: ignore[arg-type]
            start=start,
            clock=lambda: self.wall,
        )
        self.core.begin()

    def kinds(self) -> list[str]:
        return [event.kind for event in self.events]

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
    assert bench.kinds() == ['run_began', 'plan_ended']
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
    bench.core.rules = Rules(after_plan='hold', real_time_factor=2.0)
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
    assert late <= 0.2 + 1e-9
    bench.pass_time(0.1)
    assert bench.times[-1] - late <= 0.2 + 1e-9


# Starting states, tracking, joining. -------------------------------------------------------------
NAMES = ('x_e', 'z_e', 'u_b', 'w_b', 'theta', 'q')


def whole(duration: float = 1.0, **changes: object) -> Trajectory:
    """Return a plan to hover at the place of `plan`, with every state."""
    states = {name: np.zeros(3) for name in NAMES}
    states['x_e'], states['z_e'] = np.full(3, 1.0), np.full(3, -2.0)
    return plan(duration, states=states, **changes)


def begun(wait: bool = True, **initial: float) -> Start:
    return Start(initial={'z_e': -2.0, **initial}, wait=wait)


def test_a_flight_waits_for_its_first_plan() -> None:
    bench = Bench(start=begun(x_e=1.2), following='lqr', new_plan='join')
    bench.pass_time(1.0)
    assert bench.times == [0.0]
    assert bench.core.state == 'waiting for a plan or controls'
    bench.core.fly(whole(2.0))
    bench.pass_time(1.95)
    assert bench.times[-1] == pytest.approx(1.9)
    assert bench.samples[1].states['x_e'] == pytest.approx(1.2, abs=0.05)
    # closed loop: 20 cm have become less than two
    assert bench.samples[-1].states['x_e'] == pytest.approx(1.0, abs=0.02)


def test_a_flight_that_does_not_wait_falls_with_neutral_controls() -> None:
    bench = Bench(start=begun(wait=False))
    bench.pass_time(0.5)
    assert bench.samples[-1].states['z_e'] == pytest.approx(-2 + 9.81 / 2 * 0.25, abs=1e-9)
    assert set(bench.samples[-1].controls.values()) == {0.0}


def test_unknown_starting_states_are_refused() -> None:
    with pytest.raises(InputError, match="no state 'hight'"):
        Bench(start=Start(initial={'hight': 3.0}))


def test_a_joined_plan_is_flown_by_its_stamp_without_a_jump() -> None:
    bench = Bench(start=begun(False, x_e=1.0), new_plan='join', following='lqr')
    bench.core.fly(whole(5.0))
    bench.pass_time(1.0)
    # a plan that climbs began 0.5 s ago
    climbing = whole(5.0)
    climb = replace(climbing, start_ns=EPOCH + 500_000_000)
    bench.core.fly(climb)
    assert bench.core.plan_age == pytest.approx(0.5)
    bench.pass_time(1.0)
    assert bench.times == pytest.approx(np.arange(21) / 10)
    assert bench.kinds() == ['run_began']


def test_a_plan_of_the_future_is_joined_when_its_time_comes() -> None:
    bench = Bench(start=begun(False, x_e=1.0), new_plan='join')
    bench.core.fly(whole(5.0))
    later = whole(5.0, thrust=0.6)
    bench.core.fly(replace(later, start_ns=EPOCH + 250_000_000))
    bench.pass_time(0.2)
    assert bench.samples[-1].controls['thrust_left'] == HOVER
    bench.pass_time(0.1)
    assert bench.times == pytest.approx([0, 0.1, 0.2, 0.25, 0.3])
    assert bench.samples[-2].controls['thrust_left'] == 0.6


@pytest.mark.parametrize(
    ('start', 'message'), [(-9.0, 'ended 4 s ago'), (100.0, 'begins 100 s from now')]
)
def test_plans_for_another_time_are_not_joined(start: float, message: str) -> None:
    bench = Bench(start=begun(False), new_plan='join')
    with pytest.raises(InputError, match=message):
        bench.core.fly(replace(whole(5.0), start_ns=EPOCH + int(start * 1e9)))


def test_a_flight_that_waits_takes_a_plan_of_another_clock_for_now() -> None:
    bench = Bench(start=begun(x_e=1.0), new_plan='join')
    bench.core.fly(replace(whole(5.0), start_ns=7))
    bench.pass_time(0.2)
    assert bench.times == pytest.approx([0, 0.1, 0.2])


def test_a_flight_that_waits_flies_neutral_controls_until_the_plan_begins() -> None:
    bench = Bench(start=begun(x_e=1.0), new_plan='join')
    bench.core.fly(replace(whole(5.0), start_ns=EPOCH + 150_000_000))
    bench.pass_time(0.2)
    assert [s.controls['thrust_left'] for s in bench.samples] == [0, 0, HOVER, HOVER]


def test_plans_of_other_vehicles_are_not_joined() -> None:
    bench = Bench(start=begun(False), new_plan='join')
    with pytest.raises(InputError, match='for rocket, quadcopter is flying'):
        bench.core.fly(replace(whole(), vehicle='rocket'))


def test_a_plan_with_too_few_states_to_track_is_refused_and_the_run_goes_on() -> None:
    bench = Bench(following='lqr')
    bench.core.fly(whole(5.0))
    with pytest.raises(InputError, match='without the states u_b'):
        bench.core.fly(plan())
    bench.pass_time(0.2)
    assert bench.times[-1] == pytest.approx(0.2)


def test_a_heavier_vehicle_than_believed_is_held_by_feedback() -> None:
    heights = {}
    for following in ('lqr', 'open_loop'):
        bench = Bench(following=following, settings=['mass=0.105'])
        bench.core.fly(whole(2.0))
        bench.pass_time(2.1)
        heights[following] = bench.samples[-1].states['z_e'] + 2.0
    assert heights['open_loop'] == pytest.approx(9.81 * (1 - 1 / 1.05) * 2.0, rel=1e-6)
    assert abs(heights['lqr']) < 0.05


# Rules. ------------------------------------------------------------------------------------------
def commanded(thrust: float = HOVER) -> Trajectory:
    controls = {name: np.full(1, thrust) for name in ('thrust_left', 'thrust_right')}
    return plan(time=np.zeros(1), states={}, controls=controls)


@pytest.mark.parametrize(
    ('policy', 'thrust', 'time'),
    [('hold', HOVER, 1.0), ('neutral', 0.0, 1.0), ('stop', HOVER, 0.35)],
)
def test_missing_controls_time_out(policy: str, thrust: float, time: float) -> None:
    bench = Bench(controls_timeout=0.35, on_timeout=policy)
    bench.core.command(commanded())
    bench.pass_time(1.0)
    assert bench.samples[-1].time == pytest.approx(time)
    assert bench.samples[-1].controls['thrust_left'] == thrust
    (event,) = [event for event in bench.events if event.kind == 'controls_timed_out']
    assert event.time == pytest.approx(0.35)


def test_controls_in_time_time_nothing_out() -> None:
    bench = Bench(controls_timeout=0.35, on_timeout='stop')
    for _ in range(4):
        bench.core.command(commanded())
        bench.pass_time(0.3)
    assert bench.kinds() == ['run_began']
    bench.pass_time(1.0)
    assert bench.core.state == 'paused: no controls came'
    bench.core.command(commanded())
    bench.pass_time(0.2)
    assert bench.samples[-1].time > 1.3


@pytest.mark.parametrize('policy', ['report', 'stop'])
def test_the_ground_is_told_of(policy: str) -> None:
    bench = Bench(start=begun(False), on_ground=policy)
    bench.pass_time(1.0)
    (event,) = [event for event in bench.events if event.kind == 'ground_contact']
    # free fall from 2 m; linear between samples 0.1 s apart, it is off by g dt^2 / 8 over 6 m/s
    assert event.time == pytest.approx(np.sqrt(2 * 2 / 9.81), abs=0.002)
    assert bench.samples[-1].time == pytest.approx(0.7 if policy == 'stop' else 1.0)
    bench.core.reset()
    bench.pass_time(0.3)
    assert bench.samples[-1].time == pytest.approx(0.3)


def test_reset_goes_to_any_state_and_back_to_the_start() -> None:
    bench = Bench(start=begun(False, x_e=1.0))
    bench.pass_time(0.3)
    bench.core.reset({'altitude': 7.0, 'q': 1.0})
    assert bench.samples[-1].states == {
        **dict.fromkeys(NAMES, 0.0),
        'x_e': 1.0,
        'z_e': -7.0,
        'q': 1.0,
    }
    for name, value in (('speed', 1.0), ('q', float('nan'))):
        with pytest.raises(InputError, match=name):
            bench.core.reset({name: value})
    bench.core.reset()
    assert bench.samples[-1].states['z_e'] == -2.0


def test_a_run_flown_again_is_the_same_to_the_last_bit() -> None:
    bench = Bench(gusts=Gusts('severe', 5), start=begun(False, speed=40.0), vehicle='cessna152')
    bench.core.reset({'speed': 40.0, 'altitude': 500.0})
    flights = []
    for pause in (0.05, 0.31):
        bench.core.reset({'speed': 40.0, 'altitude': 500.0})
        del bench.samples[:-1]
        bench.pass_time(2.0, pause)  # ticks come when they come
        flights.append([(s.time, s.states, s.outputs) for s in bench.samples])
        flights[-1] = [row for row in flights[-1] if row[0] <= 1.0]
    assert flights[0] == flights[1]
    assert len(flights[0]) == 11


def test_wind_changes_in_flight_and_is_as_it_was_after_a_reset() -> None:
    bench = Bench(start=begun(False))
    with pytest.raises(InputError, match='3 finite'):
        bench.core.set_wind((1.0, float('nan'), 0.0))
    with pytest.raises(InputError, match='severity'):
        bench.core.set_wind((1.0, 0.0, 0.0), 'mad')
    bench.core.set_wind((3.0, 0.0, 4.0))
    bench.pass_time(0.1)
    sink = 9.81 * 0.1 - 4.0
    assert bench.samples[-1].outputs['airspeed'] == pytest.approx(np.hypot(3.0, sink))
    bench.core.set_wind((0.0, 0.0, 0.0), 'severe')
    bench.pass_time(0.1)
    assert bench.samples[-1].outputs['airspeed'] != pytest.approx(9.81 * 0.2)
    bench.core.reset()
    assert bench.samples[-1].outputs['airspeed'] == pytest.approx(0.0, abs=1e-9)


def test_nothing_to_fly_has_no_wind() -> None:
    with pytest.raises(InputError, match='no wind to set'):
        Bench().core.set_wind((0.0, 0.0, 0.0))


def test_a_flight_that_diverges_stops_and_says_so() -> None:
    bench = Bench(start=begun(False, q=1e200))
    with pytest.raises(InputError, match='diverged'):
        bench.pass_time(0.2)
    assert bench.kinds()[-1] == 'diverged'
    bench.pass_time(1.0)
    assert bench.core.state == 'stopped: the flight diverged'
