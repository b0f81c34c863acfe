"""Show flights in a running Rerun viewer while they are planned, simulated or replayed."""

import atexit
import socket
import threading
import time as _time
from collections import deque
from collections.abc import Callable, Mapping
from types import TracebackType
from urllib.parse import urlsplit

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, MissingExtraError
from ..trajectory import Trajectory
from ..vehicles.geometry import load_geometry
from . import scenery
from .archetypes import APPLICATION, MARKED, PLANNED, Clock, line_color, log_body, path_part, xyzw
from .blueprint import live_blueprint
from .kinematics import Motion, level_attitude, motion_of
from .meshes import mesh_for
from .quantities import plot_groups, unit_of

try:
    import rerun as rr
except ImportError as error:
    raise MissingExtraError('a live view', 'view') from error

Array = NDArray[np.float64]
Names = tuple[str, ...]
Kind = tuple[str, Names, Names, Names]

URL = 'rerun+http://127.0.0.1:9876/proxy'
PERIOD = 0.1  # s between two sends: smooth to the eye, and few chunks
TRAIL_PERIOD = 1.0  # s between two pieces of trail: the viewer slows with pieces, not with points
PATIENCE = 2.0  # s to wait for a viewer, when connecting and when closing
MAX_WAITING = 200_000  # samples; of more than that, which only a stuck viewer leaves, none is kept
MAX_HISTORIES = 8
HISTORY_WIDTH = 6.0  # of a history, whose height is 1
HISTORY_STEP = 1.35  # from one history to the next below it
EPOCH = 1e8  # s; a clock this far on counts from 1970, not from the start of a flight

# A server of HTTP/2 answers this with settings of its own (RFC 9113, sections 3.4 and 6.5).
_HELLO = b'PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n' + bytes(3) + b'\x04' + bytes(5)


class LiveView:
    """A running viewer to which samples, plans and a solver's iterations are sent as they come.

    All methods return at once: a thread sends what has gathered some ten times a second. Nothing
    is raised when the viewer goes away; what it cannot take is dropped and counted.

    Parameters
    ----------
    url : str
        Of the viewer, such as `rerun+http://127.0.0.1:9876/proxy`; `rerun` on a command line
        starts one there.
    name : str
        Title of the recording.

    Raises
    ------
    InputError
        If the URL is not of that form, or no viewer answers there within 2 s.
    """

    def __init__(self, url: str = URL, *, name: str = '') -> None:
        _check_viewer(url)
        self._rec = rr.RecordingStream(APPLICATION)
        self._rec.connect_grpc(url)
        self._rec.send_recording_name(name or 'live')
        self._rec.log('world', rr.ViewCoordinates.FRD, static=True)
        self._lock = threading.Lock()
        self._waiting: dict[Kind, list[Names | tuple[float, ...]]] = {}
        self._count = 0
        self._jobs: deque[Callable[[], None]] = deque(maxlen=1000)
        self._crafts: dict[str, _Craft] = {}
        self._plan: Motion | None = None
        self._layout: tuple[object, ...] = ()
        self._iterating = False
        self._histories = _Histories()
        self._dropped = 0
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name='live view', daemon=True)
        self._thread.start()

    @property
    def dropped(self) -> int:
        """How many samples were not sent: not finite, or more than a stuck viewer leaves."""
        return self._dropped

    def sample(
        self,
        time: float,
        states: Mapping[str, float],
        *,
        vehicle: str = '',
        controls: Mapping[str, float] | None = None,
        outputs: Mapping[str, float] | None = None,
    ) -> None:
        """Show where a vehicle is and how it moves.

        Parameters
        ----------
        time : float
            Seconds of the flight, or since 1970. When it goes back the trail starts anew.
        states, controls, outputs : mapping of name to value
            As a `Trajectory` has them: SI, radians, `alpha` and `beta` in degrees.
        vehicle : str
            Name of the vehicle; each has its own mesh, trail and lines.
        """
        controls, outputs = controls or {}, outputs or {}
        kind = vehicle, tuple(states), tuple(controls), tuple(outputs)
        row = (time, *states.values(), *controls.values(), *outputs.values())
        with self._lock:
            if self._count >= MAX_WAITING:
                self._dropped += 1
                return
            self._count += 1
            self._waiting.setdefault(kind, []).append(row)

    def trajectory(self, trajectory: Trajectory, entity: str = 'plan') -> None:
        """Show a whole path, such as a plan; a later one of the same entity takes its place."""
        self._jobs.append(lambda: self._send_trajectory(trajectory, entity))

    def iteration(self, number: int, trajectory: Trajectory) -> None:
        """Show a solver's iterate on the timeline `iteration`: its path and how long it takes."""
        self._jobs.append(lambda: self._send_iteration(number, trajectory))

    def close(self) -> None:
        """Send what is left and let the viewer go; takes 2 s at most."""
        if self._closing.is_set():
            return
        self._closing.set()
        self._thread.join(PATIENCE)
        if self._thread.is_alive():
            # The viewer takes nothing more: without this the interpreter would wait for it at its
            # end for ever.
            atexit.unregister(rr.rerun_shutdown)

    def __enter__(self) -> 'LiveView':
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _run(self) -> None:
        while not self._closing.wait(PERIOD):
            self._send_waiting()
        self._send_waiting()
        for name, craft in self._crafts.items():
            self._send_trail(name, craft)
        self._rec.disconnect()

    def _send_waiting(self) -> None:
        with self._lock:
            waiting, self._waiting, self._count = self._waiting, {}, 0
        while self._jobs:
            self._jobs.popleft()()
        for kind, rows in waiting.items():
            for flight in self._flights(kind, np.array(rows, float)):
                self._send_flight(path_part(kind[0] or 'vehicle'), flight)

    def _flights(self, kind: Kind, rows: Array) -> list[Trajectory]:
        """Return samples as flights, one more after each step back in time."""
        vehicle, states, controls, outputs = kind
        finite = np.isfinite(rows).all(axis=1)
        if not finite.all():
            self._dropped += int((~finite).sum())
            names = ('time', *states, *controls, *outputs)
            bad = int(np.argmin(np.isfinite(rows[int(np.argmin(finite))])))
            text = f'{vehicle}: {names[bad]} is not a finite number; sample dropped'
            self._rec.log('events', rr.TextLog(text, level='ERROR'))
            rows = rows[finite]
        found = []
        for part in np.split(rows, np.flatnonzero(np.diff(rows[:, 0]) <= 0) + 1):
            if not len(part):
                continue
            columns = [part[:, i] for i in range(1, part.shape[1])]
            end = len(states), len(states) + len(controls)
            found.append(
                Trajectory(
                    time=part[:, 0],
                    states=dict(zip(states, columns, strict=False)),
                    controls=dict(zip(controls, columns[end[0] :], strict=False)),
                    outputs=dict(zip(outputs, columns[end[1] :], strict=False)),
                    vehicle=vehicle,
                )
            )
        return found

    def _send_flight(self, name: str, flight: Trajectory) -> None:
        motion = motion_of(flight)
        craft = self._crafts.get(name)
        if craft is None:
            mesh = mesh_for(flight.vehicle, geometry=load_geometry(flight.vehicle))
            craft = self._crafts[name] = _Craft(mesh.size)
            log_body(self._rec, f'world/{name}/body', mesh)
            dot = rr.Points3D([[0.0, 0.0, 0.0]], radii=rr.Radius.ui_points(4.0), colors=[MARKED])
            self._rec.log(f'world/{name}/marker', dot, static=True)
            self._rec.log(f'world/chase/{name}', rr.ViewCoordinates.FLU, static=True)
        times = _timeline(motion.time)
        position = motion.position.astype(np.float32)
        for entity, attitude in (
            (f'world/{name}', motion.attitude),
            (f'world/chase/{name}', level_attitude(motion.heading)),
        ):
            self._rec.send_columns(
                entity,
                indexes=times,
                columns=rr.Transform3D.columns(translation=position, quaternion=xyzw(attitude)),
            )
        for group in plot_groups(flight, motion):
            entity = f'plots/{group.key}/{name}'
            if group.key not in craft.plots:
                craft.plots[group.key] = group.title
                number = list(self._crafts).index(name)
                prefix = f'{name} ' if len(self._crafts) > 1 else ''
                look = rr.SeriesLines(
                    names=[f'{prefix}{s.name}' for s in group.series],
                    colors=[line_color(number + i) for i in range(len(group.series))],
                )
                self._rec.log(entity, look, static=True)
            values = np.column_stack([s.values for s in group.series])
            self._rec.send_columns(
                entity, indexes=times, columns=rr.Scalars.columns(scalars=values)
            )
        craft.add(motion)
        if _time.monotonic() - craft.sent > TRAIL_PERIOD:
            self._send_trail(name, craft)
        self._arrange()

    def _send_trail(self, name: str, craft: '_Craft') -> None:
        if len(craft.trail) < 2:
            return
        color = line_color(list(self._crafts).index(name))
        strip = craft.trail.astype(np.float32)
        self._rec.send_columns(
            f'world/trail/{name}',
            indexes=_timeline(np.array([craft.ends])),
            columns=rr.LineStrips3D.columns(strips=[[strip]], colors=[[color]], radii=[[-2.0]]),
        )
        craft.trail = craft.trail[-1:]  # the next piece joins this one
        craft.sent = _time.monotonic()

    def _send_trajectory(self, trajectory: Trajectory, entity: str) -> None:
        motion = self._plan = motion_of(trajectory)
        self._rec.log(f'world/{entity}', _path(motion), static=True)
        self._arrange()

    def _send_iteration(self, number: int, trajectory: Trajectory) -> None:
        motion = motion_of(trajectory)
        if self._plan is None:
            self._plan = motion
        self._rec.set_time('iteration', sequence=number)
        self._rec.log('world/iterate', _path(motion, MARKED))
        self._rec.log('iterations/final_time', rr.Scalars(trajectory.duration))
        self._rec.log('histories', self._histories.of(trajectory, motion))
        self._rec.reset_time()
        self._iterating = True
        self._arrange()

    def _arrange(self) -> None:
        """Send the blueprint when there is something new for it to show."""
        titles: dict[str, str] = {}
        for craft in self._crafts.values():
            titles |= craft.plots
        layout = tuple(self._crafts), tuple(titles), self._iterating, self._plan is None
        if layout == self._layout:
            return
        self._layout = layout
        overview = None
        if self._plan is not None:
            low = float(self._plan.position[:, 2].max())
            overview = scenery.overview_camera(
                self._plan, ground_z=low, margin=0.05 * self._plan.size
            )
        first = next(iter(self._crafts), None)
        self._rec.send_blueprint(
            live_blueprint(
                vehicle=first,
                chase_distance=self._crafts[first].size if first else 1.0,
                overview=overview,
                plots=titles,
                iterating=self._iterating,
            )
        )


class _Craft:
    """What has been sent of one vehicle, and its trail since."""

    def __init__(self, size: float) -> None:
        self.size = size
        self.plots: dict[str, str] = {}
        self.sent = 0.0
        self.ends = -np.inf
        self.trail = np.zeros((0, 3))

    def add(self, motion: Motion) -> None:
        back = motion.time[0] < self.ends
        self.trail = np.concatenate([self.trail[:0] if back else self.trail, motion.position])
        self.ends = float(motion.time[-1])


class _Histories:
    """Quantities of iterates over time, one above the other, each in the range seen so far.

    They are drawings: the axis along a plot of the viewer is that of a timeline, here the
    iterations.
    """

    def __init__(self) -> None:
        self._ranges: dict[str, tuple[float, float]] = {}
        self._longest = 0.0

    def of(self, trajectory: Trajectory, motion: Motion) -> rr.LineStrips2D:
        """Return the histories of an iterate."""
        series = [s for group in plot_groups(trajectory, motion) for s in group.series]
        series = series[:MAX_HISTORIES]
        self._longest = max(self._longest, trajectory.duration)
        along = HISTORY_WIDTH * (trajectory.time - trajectory.time[0]) / max(self._longest, 1e-12)
        strips = []
        for row, each in enumerate(series):
            low, high = float(each.values.min()), float(each.values.max())
            known = self._ranges.get(each.name, (low, high))
            low, high = self._ranges[each.name] = min(low, known[0]), max(high, known[1])
            share = (each.values - low) / max(high - low, 1e-12)
            strips.append(np.column_stack([along, HISTORY_STEP * row + 1 - share]))
        return rr.LineStrips2D(
            strips,
            colors=[line_color(row) for row in range(len(series))],
            labels=[f'{s.name} [{unit_of(s.name)[0]}]' for s in series],
            show_labels=True,
            radii=rr.Radius.ui_points(1.5),
        )


def _path(motion: Motion, color: tuple[int, int, int] = PLANNED) -> rr.LineStrips3D:
    parts = scenery.drawn_samples(motion, 5_000)
    return rr.LineStrips3D(
        [motion.position[part] for part in parts if part.size > 1],
        colors=[color],
        radii=rr.Radius.ui_points(1.5),
    )


def _timeline(seconds: Array) -> list[rr.TimeColumn]:
    if seconds[0] < EPOCH:
        return Clock.of(seconds).at(slice(None))
    since_1970 = np.round(seconds * 1e9).astype(np.int64).astype('datetime64[ns]')
    return [rr.TimeColumn('utc', timestamp=since_1970)]


def _check_viewer(url: str) -> None:
    """Raise InputError unless a gRPC server answers at the URL."""
    wanted = f'expected such as {URL}'
    parts = urlsplit(url)
    try:
        port = parts.port
    except ValueError:
        port = None
    if parts.scheme != 'rerun+http' or not parts.hostname or not port or parts.path != '/proxy':
        raise InputError(f"viewer '{url}': {wanted}")
    advice = "start one with 'rerun --bind 127.0.0.1'"
    try:
        with socket.create_connection((parts.hostname, port), PATIENCE) as connection:
            connection.settimeout(PATIENCE)
            connection.sendall(_HELLO)
            answer = connection.recv(9)
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(f'no viewer at {url}: {reason}; {advice}') from None
    if len(answer) < 4 or answer[3] != 4:
        raise InputError(f'what answers at {url} is no Rerun viewer; {advice}')
