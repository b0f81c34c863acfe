"""The replay node: plays the motion in a flight log and owns /clock."""

import itertools
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nav_msgs.msg import Odometry
from nav_msgs.msg import Path as PathMsg
from rcl_interfaces.msg import SetParametersResult
from rclpy.duration import Duration
from rclpy.parameter import Parameter
from rclpy.task import Future as RosFuture
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import NavSatFix

from flightdyn_msgs.msg import PlayProgress, VehicleState
from flightdyn_msgs.srv import (
    Burst,
    GetRate,
    IsPaused,
    Load,
    Play,
    PlayNext,
    Seek,
    SeekTo,
    SetRate,
)

from ..errors import FlightdynError, InputError
from ..logs.any_log import read_track
from ..replay.moments import moment, names_event
from ..replay.player import Player, checked_rate
from .base import LATCHED, SENSOR, STATE, BaseNode
from .convert import MAP, header, nanoseconds, static_transform_msgs, time_msg
from .diagnostics import Level, Status
from .folders import file_below, folder
from .parameters import NodeParameters, parameter
from .reel import Reel, in_background

TICK_S = 0.005
PROGRESS_S = 0.2
BUDGET_S = 0.02  # wall time of one tick; requests wait no longer than this
LATE_S = 1.0  # to have samples waiting for longer is worth a warning
STANDARD_DATUM = 'ellipsoid'  # of NavSatFix


@dataclass(frozen=True)
class ReplayParameters(NodeParameters):
    log: str = parameter('', 'flight log to play', unconfigured_only=True)
    log_root: str = parameter(
        '',
        'the only folder from which logs are opened; empty for that of `log`',
        read_only=True,
    )
    source: str = parameter(
        '', 'topic to take positions from; empty for the best there is', unconfigured_only=True
    )
    start: float = parameter(
        0.0, 'skip this much of the log', unit='s', lower=0.0, upper=1e9, unconfigured_only=True
    )
    end: float = parameter(
        0.0,
        'play up to this much after the begin of the log; 0 for all',
        unit='s',
        lower=0.0,
        upper=1e9,
        unconfigured_only=True,
    )
    start_at: str = parameter(
        '',
        'moment to begin at, as ~/seek_to takes it: 90, takeoff+10, 2024-06-01T12:30:00Z',
        unconfigured_only=True,
    )
    rate: float = parameter(
        1.0, 'log time over wall time; below 0 it plays backwards', lower=-1e4, upper=1e4
    )
    loop: bool = parameter(False, 'start again at the end')
    paused: bool = parameter(False, 'start paused', unconfigured_only=True)
    max_gap: float = parameter(
        0.0,
        'shorten longer pauses between samples to this; 0 plays them in full',
        unit='s',
        lower=0.0,
        upper=1e9,
        unconfigured_only=True,
    )
    whole_first: bool = parameter(
        False,
        'begin a long log only when all of it is reconstructed',
        unconfigured_only=True,
    )
    clock_rate: float = parameter(
        50.0,
        'how often /clock is published at least; 0 for never',
        unit='Hz',
        lower=0.0,
        upper=1000.0,
        read_only=True,
    )
    exit_at_end: bool = parameter(False, 'end the node when everything has been played')


class ReplayNode(BaseNode):
    """Publishes the samples that a Player says are due."""

    def __init__(self) -> None:
        self._reel: Reel | None = None
        self._player: Player | None = None
        super().__init__('replay', ReplayParameters)
        self._root: Path | None = None
        self._rest: Future[Reel] | None = None
        self._loading: tuple[Future[Reel], RosFuture] | None = None
        self._resumes = True
        self._ending = False
        self._pending: Iterator[int] = iter(())
        self._left = 0  # how many are pending
        self._burst_done: RosFuture | None = None
        self._forget()
        clock_rate = self.parameters.values.clock_rate
        self._clock_publisher = self.advertise(Clock, '/clock', STATE) if clock_rate else None
        self._state = self.advertise(VehicleState, '~/state', STATE)
        self._odom = self.advertise(Odometry, 'odom', STATE)
        self._fix = self.advertise(NavSatFix, 'fix', SENSOR)
        self._path = self.advertise(PathMsg, '~/path', LATCHED)
        self._progress = self.advertise(PlayProgress, '~/progress', LATCHED)
        self._transforms = self.advertise_transforms()
        self.add_on_set_parameters_callback(_check_rate)
        self._offer()
        self.every(TICK_S, self._tick)
        self.every(PROGRESS_S, self._publish_progress)
        if clock_rate:
            self.every(1 / clock_rate, self._publish_clock)

    def _offer(self) -> None:
        self.serve_trigger('pause', self._pause)
        self.serve_trigger('resume', self._resume)
        self.serve_trigger('toggle_paused', self._toggle)
        self.serve_trigger('stop', self._stop)
        self.serve(IsPaused, 'is_paused', self._is_paused)
        self.serve(SetRate, 'set_rate', self._set_rate)
        self.serve(GetRate, 'get_rate', self._get_rate)
        self.serve(Seek, 'seek', self._seek)
        self.serve(SeekTo, 'seek_to', self._seek_to)
        self.serve(Play, 'play', self._play)
        self.serve(PlayNext, 'play_next', self._play_next)
        self.serve(PlayNext, 'play_previous', self._play_previous)
        self.serve(Burst, 'burst', self._burst)
        self.serve(Load, 'load', self._load)

    # The life cycle. -----------------------------------------------------------------------------
    def configure(self) -> None:
        """Open the log."""
        values = self.parameters.values
        if not values.log:
            raise InputError('parameter log: which flight log? give -p log:=FILE')
        root = folder(values.log_root, 'log_root')
        path = file_below(root, values.log, 'parameter log', folders=True)
        self._root = root or path.parent
        reel = self._opened(
            path, values.source, values.start_at, start=values.start, end=values.end
        )
        self._put_in(reel, values.start_at)
        self._resumes = not values.paused
        if self._transforms is None:
            self.get_logger().info('tf2_msgs is not installed: no transforms')

    def activate(self) -> None:
        """Begin, or go on."""
        if self._resumes:
            self._playing.resume()
        self._show_again()

    def deactivate(self) -> None:
        """Hold play time."""
        self._resumes = not self._playing.is_paused()
        self._playing.pause()

    def clean_up(self) -> None:
        """Let the log go."""
        self._reel = self._player = self._rest = None
        self._answer_load(InputError('the log was closed meanwhile'))
        self._forget()

    def wind_down(self, seconds: float) -> None:
        """Let what was published arrive."""
        self._ending = True
        for publisher in (self._state, self._odom):
            publisher.wait_for_all_acked(Duration(seconds=seconds / 4))

    def on_parameters(self, values: ReplayParameters) -> None:
        """Take the rate and whether to loop."""
        if self._player is not None:
            if values.rate != self._player.get_rate():
                self._player.set_rate(values.rate)
            self._player.loop = values.loop

    def diagnose(self) -> Iterable[Status]:
        """Tell what is played and whether publishing keeps up."""
        if self._reel is None or self._player is None:
            return
        since = self._behind_since
        late = since is not None and time.monotonic() - since > LATE_S
        yield Status(
            'playing',
            'publishing does not keep up' if late else self._doing(),
            Level.WARN if late else Level.OK,
            {
                'log': self._reel.replay.track.file,
                'samples': len(self._reel.flown),
                'dropped': sum(self._reel.replay.summary()['dropped'].values()),
                'published': self._published,
                'waiting to be published': self._left,
                'complete': self._reel.complete,
            },
        )

    def _doing(self) -> str:
        player = self._playing
        if player.is_waiting:
            return 'waiting for the reconstruction'
        if player.is_finished:
            return 'everything was played'
        return 'paused' if player.is_paused() else f'playing at {player.get_rate():g}'

    # Logs. ---------------------------------------------------------------------------------------
    @property
    def _showing(self) -> Reel:
        assert self._reel is not None
        return self._reel

    @property
    def _playing(self) -> Player:
        assert self._player is not None
        return self._player

    def _opened(
        self, path: Path, source: str, start_at: str, *, start: float = 0.0, end: float = 0.0
    ) -> Reel:
        track = read_track(path, source=source or None, start=start or None, end=end or None)
        # a take-off cannot be found before everything is reconstructed
        whole = self.parameters.values.whole_first or names_event(start_at)
        reel = Reel.first(track, whole=whole)
        if start_at:  # refuse before it is shown
            moment(start_at, reel.flown, now=0.0, end=reel.opened.end)
        return reel

    def _put_in(self, reel: Reel, start_at: str) -> None:
        """Show another log from its beginning, or from a moment; paused."""
        values, flown = self.parameters.values, reel.flown
        player = Player(
            flown.time,
            rate=values.rate,
            loop=values.loop,
            max_gap=values.max_gap or None,
            paused=True,
            growing=not reel.complete,
        )
        if start_at:
            player.seek(moment(start_at, flown, now=0.0, end=reel.opened.end))
        self._reel, self._player = reel, player
        self._forget()
        self._rest = None
        if reel.complete:
            self._report(reel)
        else:
            self.get_logger().info(
                f'the first {len(flown)} of {len(reel.opened.track)} samples can be played; '
                'the rest is being reconstructed'
            )

    def _seek_rest(self) -> None:
        """Begin to reconstruct the whole log, once its first samples are on their way."""
        reel = self._showing
        if self._rest is None and not reel.complete:
            self._rest = in_background(lambda: Reel.whole(reel.opened))

    def _take_rest(self) -> None:
        """Go on with the whole log as soon as it is there."""
        if self._rest is None or not self._rest.done():
            return
        future, self._rest = self._rest, None
        self._drop_pending()
        self._reel = reel = future.result()
        self._playing.grow(reel.flown.time)
        self._path.publish(reel.path)
        self._report(reel)

    def _report(self, reel: Reel) -> None:
        summary = reel.replay.summary()
        for warning in summary['warnings']:
            self.get_logger().warning(warning)
        if 'lat' in reel.flown and summary['altitude_datum'] != STANDARD_DATUM:
            self.get_logger().warning(
                f'altitudes in the log are above {summary["altitude_datum"]}, and so are those in '
                'fix, where the ellipsoid is the standard'
            )
        self.get_logger().info(
            f'{summary["used"]} samples of {summary["source"]} over {summary["duration_s"]:.1f} s'
        )

    async def _load(self, request: Any, _response: Any) -> None:
        if self._loading is not None:
            raise InputError('another log is being opened: wait for it')
        path = file_below(self._root, request.log, 'log', folders=True)
        answer = RosFuture(executor=self.executor)
        source, start_at = request.source, request.start_at
        self._loading = in_background(lambda: self._opened(path, source, start_at)), answer
        failure = await answer
        if failure is not None:
            raise failure
        paused = self._playing.is_paused()
        self._put_in(self._loaded, start_at)
        if not paused:
            self._playing.resume()
        self._show_again()

    def _take_load(self) -> None:
        if self._loading is None or not self._loading[0].done():
            return
        try:
            self._loaded = self._loading[0].result()
        except FlightdynError as error:
            self._answer_load(error)
        except Exception as error:
            self.get_logger().error(f'load: {type(error).__name__}: {error}')
            self._answer_load(InputError(f'the log cannot be read: {error}'))
        else:
            self._answer_load(None)

    def _answer_load(self, failure: FlightdynError | None) -> None:
        if self._loading is not None:
            answer, self._loading = self._loading[1], None
            answer.set_result(failure)

    # Services. -----------------------------------------------------------------------------------
    def _pause(self) -> str:
        self._playing.pause()
        self._publish_progress()
        return 'paused'

    def _resume(self) -> str:
        self._playing.resume()
        self._publish_progress()
        return 'playing'

    def _toggle(self) -> str:
        return self._resume() if self._playing.is_paused() else self._pause()

    def _stop(self) -> str:
        self._drop_pending()
        self._playing.stop()
        self._publish_progress()
        return 'stopped'

    def _is_paused(self, _request: Any, response: Any) -> None:
        response.paused = self._playing.is_paused()

    def _set_rate(self, request: Any, _response: Any) -> None:
        (result,) = self.set_parameters([Parameter('rate', value=float(request.rate))])
        if not result.successful:
            raise InputError(result.reason)
        self._publish_progress()

    def _get_rate(self, _request: Any, response: Any) -> None:
        response.rate = self._playing.get_rate()

    def _seek(self, request: Any, _response: Any) -> None:
        reel, asked = self._showing, nanoseconds(request.time)
        first, last = reel.ns(float(reel.flown.time[0])), reel.ns(reel.opened.end)
        if not first <= asked <= last:
            raise InputError(
                f'time {asked / 1e9:.3f} s is outside the log, {first / 1e9:.3f} s to '
                f'{last / 1e9:.3f} s'
            )
        self._go_to((asked - reel.flown.start_ns) / 1e9)

    def _seek_to(self, request: Any, response: Any) -> None:
        reel = self._showing
        if not reel.complete and names_event(request.moment):
            raise InputError(
                f"'{request.moment}' is known when the whole log is reconstructed: try again in a "
                'moment'
            )
        response.time = moment(
            request.moment, reel.flown, now=self._playing.time, end=reel.opened.end
        )
        self._go_to(response.time)

    def _go_to(self, seconds: float) -> None:
        self._drop_pending()
        self._playing.seek(seconds)
        self._show_again()

    def _play(self, request: Any, _response: Any) -> None:
        player = self._playing
        offset = nanoseconds(request.start_offset) / 1e9
        duration = nanoseconds(request.playback_duration) / 1e9
        if offset < 0:
            raise InputError(f'start_offset must not be below 0 s, got {offset:g}')
        start: float | None = float(self._showing.flown.time[0]) + offset
        if start is not None and start > self._showing.opened.end:
            raise InputError(
                f'start_offset {offset:g} s is after the end of the log, '
                f'{self._showing.opened.end:.3f} s'
            )
        if offset == 0 and player.get_rate() < 0:
            start = None
        player.play(start, duration if duration > 0 else None)
        self._drop_pending()
        self._show_again()

    def _play_next(self, _request: Any, response: Any) -> None:
        response.success = self._step(self._playing.play_next())

    def _play_previous(self, _request: Any, response: Any) -> None:
        response.success = self._step(self._playing.play_previous())

    def _step(self, due: range) -> bool:
        self._enqueue(due)
        self._play_pending()
        return len(due) == 1

    async def _burst(self, request: Any, response: Any) -> None:
        if self._burst_done is not None:
            raise InputError('a burst is under way')
        wanted = min(int(request.num_messages), len(self._playing))
        due = self._playing.burst(wanted)
        self._enqueue(due)
        done = self._burst_done = RosFuture(executor=self.executor)
        left = await done
        response.actually_burst = len(due) - min(left, len(due))

    # Playing. ------------------------------------------------------------------------------------
    def _forget(self) -> None:
        """Have nothing to publish and know no time: another log begins."""
        self._drop_pending()
        self._published = self._jumps = self._clock_ns = 0
        self._behind_since: float | None = None

    def _enqueue(self, due: range) -> None:
        self._pending = itertools.chain(self._pending, due)
        self._left += len(due)

    def _drop_pending(self) -> None:
        self._pending = iter(())
        left, self._left = self._left, 0
        self._answer_burst(left)

    def _answer_burst(self, left: int) -> None:
        if self._burst_done is not None:
            answer, self._burst_done = self._burst_done, None
            answer.set_result(left)

    def _tick(self) -> None:
        self._take_rest()
        self._take_load()
        if not self._play_pending():
            self._behind_since = self._behind_since or time.monotonic()
            return
        self._behind_since = None
        self._enqueue(self._playing.advance())
        played = self._play_pending()
        self._seek_rest()
        if played and self._playing.is_finished and self.parameters.values.exit_at_end:
            self._publish_progress()
            self.get_logger().info('everything was played')
            self.end()

    def _play_pending(self) -> bool:
        """Publish what is due for a while; return whether that was all."""
        until = time.monotonic() + BUDGET_S
        for index in self._pending:
            self._left -= 1
            self._publish(index)
            if self._ending:
                self._drop_pending()
            if time.monotonic() > until and self._left:
                return False
        self._answer_burst(0)
        return True

    def _publish(self, index: int) -> None:
        reel = self._showing
        self._show_clock(int(reel.stamps[index]))
        self._state.publish(reel.state(index))
        self._odom.publish(reel.odometry(index))
        fix = reel.fix(index)
        if fix is not None:
            self._fix.publish(fix)
        if self._transforms is not None:
            kind, moving, _ = self._transforms
            moving.publish(kind(transforms=[reel.transform(index)]))
        if self.view is not None:
            flown = reel.flown
            self.view.sample(
                float(flown.time[index]),
                {name: float(v[index]) for name, v in flown.states.items()},
                vehicle=flown.vehicle,
                controls={name: float(v[index]) for name, v in flown.controls.items()},
            )
        self._published += 1

    def _show_again(self, ns: int | None = None) -> None:
        """Send once more what is kept for latecomers: who resets on a jump has lost it."""
        reel, player = self._showing, self._playing
        self._jumps = player.jumps
        self._clock_ns = reel.ns(player.time) if ns is None else ns
        self._path.publish(reel.path)
        if self._transforms is not None:
            kind, _, fixed = self._transforms
            stamp = reel.ns(float(reel.flown.time[0]))
            fixed.publish(kind(transforms=static_transform_msgs(stamp)))
        self._show_clock(self._clock_ns)
        self._publish_progress()

    def _publish_clock(self) -> None:
        self._tick()  # samples first: the clock must not run ahead of them
        self._show_clock(self._showing.ns(self._playing.time))

    def _show_clock(self, ns: int) -> None:
        """Publish /clock; it goes against the direction of playing only where play time jumps."""
        player = self._playing
        if player.jumps != self._jumps:
            self._show_again(ns)
        ahead = max if player.get_rate() > 0 else min
        self._clock_ns = ahead(self._clock_ns, ns)
        if self._clock_publisher is not None:
            self._clock_publisher.publish(Clock(clock=time_msg(self._clock_ns)))

    def _publish_progress(self) -> None:
        reel, player = self._showing, self._playing
        first, last, now = float(reel.flown.time[0]), reel.opened.end, player.time
        self._progress.publish(
            PlayProgress(
                header=header(reel.ns(now), MAP),
                log=reel.replay.track.file,
                time=now,
                duration=last - first,
                fraction=(now - first) / (last - first) if last > first else 1.0,
                rate=player.get_rate(),
                paused=player.is_paused(),
                loop=player.loop,
                finished=player.is_finished,
                waiting=player.is_waiting,
                complete=reel.complete,
            )
        )


def _check_rate(parameters: Iterable[Parameter]) -> SetParametersResult:
    """Refuse a rate of 0, which a range cannot exclude."""
    try:
        for given in parameters:
            if given.name == 'rate' and isinstance(given.value, int | float):
                checked_rate(float(given.value))
    except InputError as error:
        return SetParametersResult(successful=False, reason=f'parameter rate: {error}')
    return SetParametersResult(successful=True)
