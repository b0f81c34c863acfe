"""The replay node: plays the motion in a flight log and owns /clock."""

import itertools
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nav_msgs.msg import Odometry
from nav_msgs.msg import Path as PathMsg
from rclpy.duration import Duration
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import NavSatFix

from flightdyn_msgs.msg import VehicleState
from flightdyn_msgs.srv import Burst, GetRate, IsPaused, PlayNext, Seek, SetRate

from ..errors import InputError
from ..logs.messages import kinematics
from ..replay import Player, replay_log
from .base import LATCHED, SENSOR, STATE, BaseNode
from .convert import (
    fix_msg,
    motion_at,
    nanoseconds,
    odometry_msg,
    path_msg,
    state_msg,
    time_msg,
)
from .parameters import NodeParameters, parameter

TICK_S = 0.005
CLOCK_S = 0.02
BUDGET_S = 0.02  # wall time of one tick; requests wait no longer than this
STANDARD_DATUM = 'ellipsoid'  # of NavSatFix


@dataclass(frozen=True)
class ReplayParameters(NodeParameters):
    log: str = parameter('', 'flight log to play', read_only=True)
    log_root: str = parameter(
        '', 'the only folder from which logs are opened; empty for any', read_only=True
    )
    source: str = parameter(
        '', 'topic to take positions from; empty for the best there is', read_only=True
    )
    start: float = parameter(
        0.0, 'skip this much of the log', unit='s', lower=0.0, upper=1e9, read_only=True
    )
    end: float = parameter(
        0.0,
        'play up to this much after the begin of the log; 0 for all',
        unit='s',
        lower=0.0,
        upper=1e9,
        read_only=True,
    )
    rate: float = parameter(1.0, 'log time over wall time', lower=1e-3, upper=1e4)
    loop: bool = parameter(False, 'start again at the end')
    paused: bool = parameter(False, 'start paused', read_only=True)
    exit_at_end: bool = parameter(False, 'end the node when everything has been played')


class ReplayNode(BaseNode):
    """Publishes the samples that a Player says are due."""

    def __init__(self) -> None:
        super().__init__('replay', ReplayParameters)
        values = self.parameters.values
        replay = replay_log(
            _log_path(values.log, values.log_root),
            source=values.source or None,
            start=values.start or None,
            end=values.end or None,
        )
        self._flown = replay.trajectory
        self._motion = kinematics(self._flown)
        self._stamps = self._flown.unix_ns
        self._player = Player(
            self._flown.time, rate=values.rate, loop=values.loop, paused=values.paused
        )
        self._pending: Iterator[int] = iter(())
        self._jumps = self._clock_ns = 0
        self._ending = False
        self._clock_publisher = self.create_publisher(Clock, '/clock', STATE)
        self._state = self.create_publisher(VehicleState, '~/state', STATE)
        self._odom = self.create_publisher(Odometry, 'odom', STATE)
        self._fix = self.create_publisher(NavSatFix, 'fix', SENSOR)
        self._path = self.create_publisher(PathMsg, '~/path', LATCHED)
        self._path_msg = path_msg(self._flown)
        self._path.publish(self._path_msg)
        self._serve()
        self.every(TICK_S, self._tick)
        self.every(CLOCK_S, self._publish_clock)
        self._report(replay.summary())

    def _serve(self) -> None:
        self.serve_trigger('pause', self._pause)
        self.serve_trigger('resume', self._resume)
        self.serve_trigger('toggle_paused', self._toggle)
        self.serve_trigger('stop', self._stop)
        self.serve(IsPaused, 'is_paused', self._is_paused)
        self.serve(SetRate, 'set_rate', self._set_rate)
        self.serve(GetRate, 'get_rate', self._get_rate)
        self.serve(Seek, 'seek', self._seek)
        self.serve(PlayNext, 'play_next', self._play_next)
        self.serve(Burst, 'burst', self._burst)

    def _report(self, summary: dict[str, Any]) -> None:
        for warning in summary['warnings']:
            self.get_logger().warning(warning)
        if 'lat' in self._flown and summary['altitude_datum'] != STANDARD_DATUM:
            self.get_logger().warning(
                f'altitudes in the log are above {summary["altitude_datum"]}, and so are those in '
                'fix, where the ellipsoid is the standard'
            )
        self.get_logger().info(
            f'{summary["used"]} samples of {summary["source"]} over {summary["duration_s"]:.1f} s'
        )

    # Services. -----------------------------------------------------------------------------------
    def _pause(self) -> str:
        self._player.pause()
        return 'paused'

    def _resume(self) -> str:
        self._player.resume()
        return 'playing'

    def _toggle(self) -> str:
        return 'paused' if self._player.toggle() else 'playing'

    def _stop(self) -> str:
        self._pending = iter(())
        self._player.stop()
        return 'stopped'

    def _is_paused(self, _request: Any, response: Any) -> None:
        response.paused = self._player.is_paused()

    def _set_rate(self, request: Any, _response: Any) -> None:
        (result,) = self.set_parameters([Parameter('rate', value=float(request.rate))])
        if not result.successful:
            raise InputError(result.reason)

    def _get_rate(self, _request: Any, response: Any) -> None:
        response.rate = self._player.get_rate()

    def _seek(self, request: Any, _response: Any) -> None:
        asked = nanoseconds(request.time)
        first, last = int(self._stamps.min()), int(self._stamps.max())
        if not first <= asked <= last:
            raise InputError(
                f'time {asked / 1e9:.3f} s is outside the log, {first / 1e9:.3f} s to '
                f'{last / 1e9:.3f} s'
            )
        self._pending = iter(())
        self._player.seek((asked - self._flown.start_ns) / 1e9)
        self._publish_clock()

    def _play_next(self, _request: Any, response: Any) -> None:
        response.success = self._play(self._player.play_next()) == 1

    def _burst(self, request: Any, response: Any) -> None:
        wanted = min(int(request.num_messages), len(self._player))
        response.actually_burst = self._play(self._player.burst(wanted))

    def on_parameters(self, values: ReplayParameters) -> None:
        if values.rate != self._player.get_rate():
            self._player.set_rate(values.rate)
        self._player.loop = values.loop

    # Playing. ------------------------------------------------------------------------------------
    def _tick(self) -> None:
        if not self._play_pending():
            return
        self._pending = iter(self._player.advance())
        if (
            self._play_pending()
            and self._player.is_finished
            and self.parameters.values.exit_at_end
        ):
            self.get_logger().info('everything was played')
            self.end()

    def _play_pending(self) -> bool:
        """Publish what is due for a while; return whether that was all."""
        until = time.monotonic() + BUDGET_S
        for index in self._pending:
            self._publish(index)
            if time.monotonic() > until:
                return False
        return True

    def _play(self, indices: range) -> int:
        count = 0
        for index in itertools.takewhile(lambda _: not self._ending, indices):
            self._publish(index)
            count += 1
        return count

    def _publish(self, index: int) -> None:
        ns = int(self._stamps[index])
        flown = self._flown
        motion = motion_at(self._motion, index)
        self._show_clock(ns)
        self._state.publish(
            state_msg(
                motion,
                ns,
                time=float(flown.time[index] - flown.time[0]),
                vehicle=flown.vehicle,
                states={name: float(v[index]) for name, v in flown.states.items()},
                controls={name: float(v[index]) for name, v in flown.controls.items()},
            )
        )
        outputs = flown.outputs
        std = tuple(
            float(outputs[name][index]) if name in outputs else 0.0
            for name in ('x_e_std', 'y_e_std', 'z_e_std')
        )
        self._odom.publish(odometry_msg(motion, ns, position_std=(std[0], std[1], std[2])))
        if 'lat' in outputs:
            lat, lon, altitude = (float(outputs[k][index]) for k in ('lat', 'lon', 'altitude'))
            self._fix.publish(fix_msg(lat, lon, altitude, ns))

    def _publish_clock(self) -> None:
        self._tick()  # samples first: the clock must not run ahead of them
        self._show_clock(self._flown.start_ns + round(self._player.time * 1e9))

    def _show_clock(self, ns: int) -> None:
        """Publish /clock; it goes back only where playing does."""
        if self._player.jumps != self._jumps:
            self._jumps = self._player.jumps
            self._clock_ns = ns
            self._path.publish(self._path_msg)  # who resets on the jump has lost it
        self._clock_ns = max(self._clock_ns, ns)
        self._clock_publisher.publish(Clock(clock=time_msg(self._clock_ns)))

    # The end. ------------------------------------------------------------------------------------
    def wind_down(self, seconds: float) -> None:
        """Let what was published arrive."""
        self._ending = True
        for publisher in (self._state, self._odom):
            publisher.wait_for_all_acked(Duration(seconds=seconds / 4))


def _log_path(log: str, log_root: str) -> Path:
    if not log:
        raise InputError('parameter log: which flight log? give -p log:=FILE')
    path = Path(log).expanduser().resolve()
    if log_root and not path.is_relative_to(Path(log_root).expanduser().resolve()):
        raise InputError(f'parameter log: {log} is outside log_root {log_root}')
    if not path.is_file():
        raise InputError(f'parameter log: there is no file {log}')
    return path
