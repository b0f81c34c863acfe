"""The simulator node: flies plans and commands in simulated time and owns /clock."""

import contextlib
import importlib
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nav_msgs.msg import Odometry
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, NavSatFix

from flightdyn_msgs.msg import Trajectory as TrajectoryMsg
from flightdyn_msgs.msg import VehicleState
from flightdyn_msgs.srv import SetRate, Step

from ..environment.geodesy import GeodeticPoint
from ..errors import FlightdynError, InputError
from ..logs.recording import McapRecorder
from ..simulation.gusts import Gusts
from ..vehicles.vehicle import load_vehicle
from .base import LATCHED, SENSOR, STATE, BaseNode
from .convert import (
    fix_of,
    imu_msg,
    motion_of,
    odometry_msg,
    state_msg,
    static_transform_msgs,
    time_msg,
    trajectory_from_message,
    transform_msg,
)
from .parameters import NodeParameters, parameter
from .sim_core import Sample, SimCore

FIX_RATE = 10.0  # Hz
TICK_S = 0.002
CLOCK_AT_REST_S = 0.1
FLUSH_S = 0.5
PLAN_TOPIC = '/plan'
"""Under which the plan that is flown is recorded, as in files that `flightdyn` writes."""


@dataclass(frozen=True)
class SimParameters(NodeParameters):
    vehicle: str = parameter(
        'quadcopter', 'what commands fly, and plans that name no vehicle', read_only=True
    )
    rate: float = parameter(
        200.0, 'samples per simulated second', unit='Hz', lower=1.0, upper=2000.0, read_only=True
    )
    real_time_factor: float = parameter(
        1.0, 'simulated time over wall time; 0 is as fast as possible', lower=0.0, upper=1000.0
    )
    after_plan: str = parameter(
        'pause',
        "at a plan's end time stops, or goes on with the last controls held",
        choices=('pause', 'hold'),
    )
    trajectory_topic: str = parameter(
        'planner/trajectory',
        'plans to fly, beside ~/trajectory; empty for none',
        read_only=True,
    )
    wind_ned: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0),
        'where the air moves to (north, east, down), unless a plan says so itself',
        unit='m/s',
        length=3,
        read_only=True,
    )
    gusts: str = parameter(
        'none',
        'Dryden turbulence on top of the wind',
        choices=('none', 'light', 'moderate', 'severe'),
        read_only=True,
    )
    gust_seed: int = parameter(
        0, 'the same seed makes the same gusts', lower=0, upper=2**31 - 1, read_only=True
    )
    record: str = parameter(
        '', 'MCAP file to record to; it is replaced; empty for none', read_only=True
    )
    config_dir: str = parameter(
        '', 'folder with vehicles/ of your own, searched first; empty for none', read_only=True
    )
    origin_lat: float = parameter(
        0.0, 'latitude of the local origin', unit='deg', lower=-90.0, upper=90.0, read_only=True
    )
    origin_lon: float = parameter(
        0.0, 'longitude of the local origin', unit='deg', lower=-180.0, upper=180.0, read_only=True
    )
    origin_altitude: float = parameter(
        0.0,
        'altitude of the local origin above the ellipsoid',
        unit='m',
        lower=-1000.0,
        upper=100000.0,
        read_only=True,
    )


class SimNode(BaseNode):
    """Publishes what a SimCore flies, and records exactly that."""

    def __init__(self) -> None:
        super().__init__('sim', SimParameters)
        values = self.parameters.values
        load_vehicle(values.vehicle, values.config_dir)
        self._origin = GeodeticPoint(values.origin_lat, values.origin_lon, values.origin_altitude)
        self._recorder: McapRecorder | None = None
        self._recording_over = False
        if values.record and not Path(values.record).absolute().parent.is_dir():
            raise InputError(f'parameter record: there is no folder for {values.record}')
        self._outgoing: dict[str, tuple[Any, str, str]] = {}
        self._plan: Any = None
        self._next_fix = 0
        self._core = SimCore(
            lambda name: load_vehicle(name, values.config_dir),
            self._publish,
            vehicle=values.vehicle,
            rate=values.rate,
            real_time_factor=values.real_time_factor,
            after_plan=values.after_plan,
            wind=values.wind_ned,
            gusts=None
            if values.gusts == 'none'
            else Gusts(severity=values.gusts, seed=values.gust_seed),
            epoch_ns=int(time.time()) * 10**9,
            on_plan_end=self._on_plan_end,
        )
        self._clock_publisher = self.create_publisher(Clock, '/clock', STATE)
        for name, kind, topic, qos in (
            ('state', VehicleState, '~/state', STATE),
            ('odom', Odometry, 'odom', STATE),
            ('fix', NavSatFix, 'fix', SENSOR),
            ('imu', Imu, 'imu', SENSOR),
        ):
            publisher = self.create_publisher(kind, topic, qos)
            package, _, _ = kind.__module__.partition('.')
            self._outgoing[name] = (
                publisher,
                publisher.topic_name,
                f'{package}/msg/{kind.__name__}',
            )
        self._transforms = self._transform_publishers()
        on_plan = self.guarded(self._on_plan)
        self.create_subscription(TrajectoryMsg, '~/trajectory', on_plan, STATE)
        if values.trajectory_topic:
            self.create_subscription(TrajectoryMsg, values.trajectory_topic, on_plan, LATCHED)
        self.create_subscription(
            TrajectoryMsg, '~/controls', self.guarded(self._on_controls), STATE
        )
        self.serve_trigger('reset', self._reset)
        self.serve_trigger('pause', self._pause)
        self.serve_trigger('resume', self._resume)
        self.serve(Step, 'step', self._step)
        self.serve(SetRate, 'set_rate', self._set_rate)
        self.every(TICK_S, self._core.tick)
        self.every(CLOCK_AT_REST_S, self._publish_clock_at_rest)
        if values.record:
            self.every(FLUSH_S, self._flush)
        self.get_logger().info('ready to fly')

    # Incoming. -----------------------------------------------------------------------------------
    def _on_plan(self, message: Any) -> None:
        plan = trajectory_from_message(message)
        before, self._plan = self._plan, message
        try:
            self._core.fly(plan)
        except FlightdynError:
            self._plan = before  # the run before goes on
            raise
        self.get_logger().info(
            f'flying a plan of {plan.duration:g} s for {plan.vehicle or "the vehicle"}'
        )

    def _on_controls(self, message: Any) -> None:
        self._core.command(trajectory_from_message(message))

    def _reset(self) -> str:
        self._core.reset()
        return 'the run begins again'

    def _pause(self) -> str:
        self._core.pause()
        return 'paused'

    def _resume(self) -> str:
        self._core.resume()
        return 'running' if self._core.run else 'waiting for a plan or controls'

    def _step(self, request: Any, _response: Any) -> None:
        self._core.step(float(request.duration))

    def _set_rate(self, request: Any, _response: Any) -> None:
        if not request.rate > 0:
            raise InputError(f'rate must be above 0, got {request.rate:g}')
        value = Parameter('real_time_factor', value=float(request.rate))
        (result,) = self.set_parameters([value])
        if not result.successful:
            raise InputError(result.reason)

    def on_parameters(self, values: SimParameters) -> None:
        self._core.after_plan = values.after_plan
        self._core.real_time_factor = values.real_time_factor

    # Outgoing. -----------------------------------------------------------------------------------
    def _publish(self, sample: Sample) -> None:
        ns = sample.clock_ns
        self._clock_publisher.publish(Clock(clock=time_msg(ns)))
        if sample.time == 0.0:
            self._next_fix = 0
            self._begin_recording(sample)
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
        self._send('state', state, ns)
        self._send('odom', odometry_msg(motion, ns), ns)
        self._send('imu', imu_msg(motion, ns, sample.specific_force_b), ns)
        if sample.time >= self._next_fix / FIX_RATE - 1e-9:
            self._next_fix = int(sample.time * FIX_RATE + 1e-9) + 1
            self._send('fix', fix_of(motion, ns, self._origin), ns)
        if self._transforms is not None:
            kind, publisher = self._transforms
            publisher.publish(kind(transforms=[transform_msg(motion, ns)]))

    def _send(self, name: str, message: Any, ns: int) -> None:
        publisher, topic, msgtype = self._outgoing[name]
        if self._recorder is None:
            publisher.publish(message)
        else:
            data = serialize_message(message)
            publisher.publish(data)
            self._record(topic, msgtype, data, ns)

    def _publish_clock_at_rest(self) -> None:
        """Show the clock while it stands: whoever starts now would else wait for it."""
        if self._core.run is None or self._core.is_paused:
            self._clock_publisher.publish(Clock(clock=time_msg(self._core.clock_ns)))

    def _transform_publishers(self) -> tuple[Any, Any] | None:
        """Publish the fixed transforms; None where tf2's messages are not installed."""
        try:
            kind = importlib.import_module('tf2_msgs.msg').TFMessage
        except ImportError:
            self.get_logger().info('tf2_msgs is not installed: no transforms')
            return None
        self._static = self.create_publisher(kind, '/tf_static', LATCHED)
        self._static.publish(kind(transforms=static_transform_msgs(self._core.clock_ns)))
        return kind, self.create_publisher(kind, '/tf', 100)

    # Recording. ----------------------------------------------------------------------------------
    def _begin_recording(self, sample: Sample) -> None:
        run, values = self._core.run, self.parameters.values
        if not values.record or run is None or self._recording_over:
            return
        if self._recorder is None:
            self._recorder = McapRecorder(
                values.record,
                {
                    'vehicle': sample.vehicle,
                    'model': sample.model,
                    'problem': run.problem,
                    'origin_lat': repr(self._origin.lat),
                    'origin_lon': repr(self._origin.lon),
                    'origin_altitude': repr(self._origin.altitude),
                },
            )
        if self._plan is not None:
            self._plan.header.stamp = time_msg(sample.clock_ns)
            data = serialize_message(self._plan)
            self._record(PLAN_TOPIC, 'flightdyn_msgs/msg/Trajectory', data, sample.clock_ns)

    def _record(self, topic: str, msgtype: str, data: bytes, ns: int) -> None:
        assert self._recorder is not None
        try:
            self._recorder.write(topic, msgtype, data, ns)
        except OSError as error:  # a full disk must not stop the flight
            self.get_logger().error(f'recording ends here: {error}')
            with contextlib.suppress(OSError):
                self._recorder.finish()
            self._recorder, self._recording_over = None, True

    def _on_plan_end(self) -> None:
        self._flush()
        self.get_logger().info('end of the plan')

    def _flush(self) -> None:
        if self._recorder is not None:
            self._recorder.flush()

    def clean_up(self) -> None:
        if self._recorder is not None:
            self._recorder.finish()
