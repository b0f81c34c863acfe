"""The simulator node: flies plans and commands in simulated time and owns /clock."""

import math
import time
from collections.abc import Iterable
from typing import Any

from nav_msgs.msg import Odometry
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, NavSatFix

from flightdyn_msgs.msg import SimEvent, VehicleState
from flightdyn_msgs.msg import Trajectory as TrajectoryMsg
from flightdyn_msgs.srv import Reset, SetRate, SetWind, Step

from ..environment.geodesy import GeodeticPoint
from ..errors import FlightdynError, InputError
from ..simulation.sensors import FixErrors, FixNoise, InertialErrors
from ..trajectory import Trajectory
from ..vehicles.vehicle import Vehicle, load_vehicle
from .base import LATCHED, SENSOR, STATE, BaseNode
from .convert import (
    event_msg,
    fix_of,
    from_message_unit,
    imu_msg,
    motion_of,
    odometry_msg,
    state_msg,
    static_transform_msgs,
    time_msg,
    trajectory_from_message,
    transform_msg,
)
from .diagnostics import Level, Status
from .sim_core import Sample, SimCore
from .sim_parameters import SimParameters, rules_of, setting_of, start_of
from .sim_recording import Recording, recording_path
from .sim_watch import Event

TICK_S = 0.002
AT_REST_S = 0.1
FLUSH_S = 0.5
VIEW_S = 0.03
PLAN_TOPIC = '/plan'
"""Under which the plans that are flown are recorded, as in files that `flightdyn` writes."""
TRAJECTORY = 'flightdyn_msgs/msg/Trajectory'
EVENTS = STATE  # reliable: none may be lost
WARNED = ('limit_left', 'controls_timed_out', 'diverged')


class SimNode(BaseNode):
    """Publishes what a SimCore flies, and records exactly that."""

    def __init__(self) -> None:
        super().__init__('sim', SimParameters)
        self._core: SimCore | None = None
        self._message: Any = None  # the plan's
        self._last_state: Any = None
        self._next_fix = 0  # in multiples of 1 / fix_rate
        self._clock_publisher = self.advertise(Clock, '/clock', STATE)
        self._outgoing: dict[str, tuple[Any, str, str]] = {}
        for name, kind, topic, qos in (
            ('state', VehicleState, '~/state', STATE),
            ('odom', Odometry, 'odom', STATE),
            ('fix', NavSatFix, 'fix', SENSOR),
            ('imu', Imu, 'imu', SENSOR),
            ('event', SimEvent, '~/event', EVENTS),
        ):
            publisher = self.advertise(kind, topic, qos)
            package, _, _ = kind.__module__.partition('.')
            msgtype = f'{package}/msg/{kind.__name__}'
            self._outgoing[name] = publisher, publisher.topic_name, msgtype
        self._transforms = self.advertise_transforms()
        self.subscribe(TrajectoryMsg, '~/trajectory', self._on_plan, STATE)
        plans = self.parameters.values.trajectory_topic
        if plans:
            self.subscribe(TrajectoryMsg, plans, self._on_plan, LATCHED)
        self.subscribe(TrajectoryMsg, '~/controls', self._on_controls, STATE)
        self.serve(Reset, 'reset', self._reset)
        self.serve_trigger('pause', self._pause)
        self.serve_trigger('resume', self._resume)
        self.serve(Step, 'step', self._step)
        self.serve(SetRate, 'set_rate', self._set_rate)
        self.serve(SetWind, 'set_wind', self._set_wind)
        self.every(TICK_S, self._tick)
        self.every(AT_REST_S, self._publish_at_rest)
        self.every(FLUSH_S, self._flush)

    # The life cycle. -----------------------------------------------------------------------------
    def configure(self) -> None:
        values = self.parameters.values
        self._origin = GeodeticPoint(values.origin_lat, values.origin_lon, values.origin_altitude)
        self._recording = Recording(
            recording_path(values.record, values.record_root), self._on_recording_failure
        )
        self._fix_noise = FixNoise(values.fix_noise, values.fix_noise_time)
        self._start_sensors()
        epoch = time.time() if values.start_time < 0 else values.start_time
        self._vehicles_of(values.vehicle)
        self._core = SimCore(
            self._vehicles_of,
            setting_of(values),
            self._publish,
            self._on_event,
            rate=values.rate,
            epoch_ns=int(epoch) * 10**9,
            rules=rules_of(values),
            start=start_of(values),
            ground_altitude=values.ground_altitude,
        )
        self._achieved = math.nan
        self._measured = time.monotonic(), self._core.clock_ns
        self._events, self._samples, self._viewed = 0, 0, 0.0
        if self._transforms is None:
            self.get_logger().info('tf2_msgs is not installed: no transforms')

    def activate(self) -> None:
        core = self._flying()
        if self._transforms is not None:
            kind, _, static = self._transforms
            static.publish(kind(transforms=static_transform_msgs(core.clock_ns)))
        if core.run is None:
            core.begin()
        self.get_logger().info(f'ready to fly: {core.state}')
        values = self.parameters.values
        if values.new_plan == 'join' and values.tracking == 'lqr':
            self.get_logger().warning(
                'new_plan is join and tracking is lqr: a planner that plans anew every second '
                'does not reckon with the feedback, and the flight swings; open_loop does not'
            )

    def clean_up(self) -> None:
        if self._core is not None:
            self._core = None
            self._recording.finish()

    def on_parameters(self, values: SimParameters) -> None:
        if self._core is not None:
            self._core.rules = rules_of(values)

    def _vehicles_of(self, name: str) -> tuple[Vehicle, Vehicle]:
        values = self.parameters.values
        believed = load_vehicle(name, values.config_dir)
        settings = [s.strip() for s in values.vehicle_settings.split(';') if s.strip()]
        return believed, load_vehicle(name, values.config_dir, settings) if settings else believed

    def _flying(self) -> SimCore:
        assert self._core is not None  # what calls this works only while configured
        return self._core

    # Incoming. -----------------------------------------------------------------------------------
    def _on_plan(self, message: Any) -> None:
        plan = trajectory_from_message(message)
        core, before = self._flying(), self._message
        self._message = message
        joined = core.run is not None and core.rules.new_plan == 'join'
        try:
            core.fly(plan)
        except FlightdynError:
            self._message = before  # the run before goes on
            raise
        if self.view is not None:
            self.view.trajectory(plan)
        if joined:
            self._record_plan(core.clock_ns)
            self.get_logger().debug(f'joining a plan of {plan.duration:.4g} s')
        else:
            name = plan.vehicle or self.parameters.values.vehicle
            self.get_logger().info(f'{name} flies a plan of {plan.duration:.4g} s')

    def _on_controls(self, message: Any) -> None:
        self._flying().command(trajectory_from_message(message))

    def _reset(self, request: Any, response: Any) -> None:
        names, values = list(request.state_names), list(request.states)
        if len(names) != len(values):
            raise InputError(f'{len(names)} state_names and {len(values)} states: give one each')
        initial = {
            name: from_message_unit(name, value) for name, value in zip(names, values, strict=True)
        }
        self._flying().reset(initial)
        response.message = 'the run begins again'

    def _pause(self) -> str:
        self._flying().pause()
        return 'paused'

    def _resume(self) -> str:
        core = self._flying()
        core.resume()
        return core.state

    def _step(self, request: Any, _response: Any) -> None:
        self._flying().step(float(request.duration))

    def _set_rate(self, request: Any, _response: Any) -> None:
        if not request.rate > 0:
            raise InputError(f'rate must be above 0, got {request.rate:g}')
        value = Parameter('real_time_factor', value=float(request.rate))
        (result,) = self.set_parameters([value])
        if not result.successful:
            raise InputError(result.reason)

    def _set_wind(self, request: Any, _response: Any) -> None:
        self._flying().set_wind([float(w) for w in request.wind_ned], request.gusts)

    # Outgoing. -----------------------------------------------------------------------------------
    def _tick(self) -> None:
        self._flying().tick()

    def _publish(self, sample: Sample) -> None:
        ns = sample.clock_ns
        self._clock_publisher.publish(Clock(clock=time_msg(ns)))
        if sample.time == 0.0:
            self._begin_run(sample)
        self._samples += 1
        motion = motion_of({**sample.outputs, **sample.controls, **sample.states})
        state = state_msg(
            motion,
            ns,
            time=sample.time,
            vehicle=sample.vehicle,
            model=sample.model,
            states=sample.states,
            controls=sample.controls,
        )
        self._last_state = state
        self._send('state', state, ns)
        self._send('odom', odometry_msg(motion, ns), ns)
        self._send_sensors(sample, motion)
        if self._transforms is not None:
            kind, publisher, _ = self._transforms
            publisher.publish(kind(transforms=[transform_msg(motion, ns)]))
        if self.view is not None and time.monotonic() - self._viewed > VIEW_S:
            self._viewed = time.monotonic()
            self.view.sample(
                sample.time,
                sample.states,
                vehicle=sample.vehicle,
                controls=sample.controls,
                outputs=sample.outputs,
            )

    def _send_sensors(self, sample: Sample, motion: dict[str, float]) -> None:
        values, ns = self.parameters.values, sample.clock_ns
        force, rates = self._imu_errors.next()
        measured = {**motion, **{n: motion[n] + e for n, e in zip('pqr', rates, strict=True)}}
        x, y, z = sample.specific_force_b + force
        self._send('imu', imu_msg(measured, ns, (x, y, z), values.imu_noise), ns)
        if sample.time >= self._next_fix / values.fix_rate - 1e-9:
            self._next_fix = int(sample.time * values.fix_rate + 1e-9) + 1
            error, std = self._fix_errors.next(sample.time), self._fix_noise.std
            known = std if any(std) else None
            self._send('fix', fix_of(motion, ns, self._origin, error, known), ns)

    def _send(self, name: str, message: Any, ns: int) -> None:
        publisher, topic, msgtype = self._outgoing[name]
        if self._recording.is_on:
            data = serialize_message(message)
            publisher.publish(data)
            self._recording.write(topic, msgtype, data, ns)
        else:
            publisher.publish(message)

    def _on_event(self, event: Event) -> None:
        core = self._flying()
        self._events += 1
        ns = core.at(event.time)
        self._send('event', event_msg(event, ns), ns)
        log = self.get_logger()
        (log.warning if event.kind in WARNED else log.info)(event.message)
        if event.kind == 'plan_ended':
            self._flush_at_rest()

    def _publish_at_rest(self) -> None:
        """Show clock and state while they stand: whoever starts now would else wait for them."""
        core = self._flying()
        if core.run is None or core.is_paused:
            self._clock_publisher.publish(Clock(clock=time_msg(core.clock_ns)))
        if core.is_waiting and self._last_state is not None:
            self._outgoing['state'][0].publish(self._last_state)

    # Recording. ----------------------------------------------------------------------------------
    def _begin_run(self, sample: Sample) -> None:
        """Start the sensors, and the recording with what it holds of the run."""
        self._start_sensors()
        plan = self._planned()
        self._recording.begin(
            {
                'vehicle': sample.vehicle,
                'model': sample.model,
                'problem': '' if plan is None else plan.problem,
                'origin_lat': repr(self._origin.lat),
                'origin_lon': repr(self._origin.lon),
                'origin_altitude': repr(self._origin.altitude),
            }
        )
        if plan is not None and self._message is not None:
            self._message.header.stamp = time_msg(sample.clock_ns)
            self._record_plan(sample.clock_ns)

    def _start_sensors(self) -> None:
        values = self.parameters.values
        accelerometer, gyro = values.imu_noise
        self._next_fix = 0
        self._fix_errors: FixErrors = FixErrors(self._fix_noise, (values.seed, 1))
        self._imu_errors: InertialErrors = InertialErrors(accelerometer, gyro, (values.seed, 2))

    def _planned(self) -> Trajectory | None:
        run = self._flying().run
        return None if run is None else run.plan

    def _record_plan(self, ns: int) -> None:
        if self._recording.is_on:
            data = serialize_message(self._message)
            self._recording.write(PLAN_TOPIC, TRAJECTORY, data, ns)

    def _on_recording_failure(self, message: str) -> None:
        self.get_logger().error(message)
        core = self._flying() if self._core is not None else None
        if core is not None and core.run is not None:
            self._on_event(Event('recording_ended', core.run.simulator.time, message))

    def _flush(self) -> None:
        """Let what is recorded reach the disk.

        As fast as possible, the recorder's own rule does: there a recording depends on nothing
        but what is in it.
        """
        core = self._flying()
        if core.is_paused or core.rules.real_time_factor > 0:
            self._flush_at_rest()

    def _flush_at_rest(self) -> None:
        self._recording.flush()

    # Diagnostics. --------------------------------------------------------------------------------
    def diagnose(self) -> Iterable[Status]:
        core = self._core
        if core is None:
            return
        wall, ns = time.monotonic(), core.clock_ns
        passed = wall - self._measured[0]
        if passed > 0:
            self._achieved = (ns - self._measured[1]) / 1e9 / passed
        self._measured = wall, ns
        wanted = core.rules.real_time_factor
        slow = not core.is_paused and core.run is not None and self._achieved < 0.9 * wanted
        values = {
            'run time [s]': 0.0 if core.run is None else float(core.run.simulator.time),
            'real-time factor': float(self._achieved),
            'real-time factor wanted': float(wanted),
            'samples': self._samples,
            'events': self._events,
            'age of the plan [s]': core.plan_age,
        }
        message = f'{core.state}, slower than wanted' if slow else core.state
        yield Status('simulation', message, Level.WARN if slow else Level.OK, values)
        failed = self._recording.state == 'failed'
        yield Status(
            'recording',
            self._recording.state,
            Level.ERROR if failed else Level.OK,
            {'file': self._recording.path or ''},
        )
