"""Write a flight as a Rerun recording (.rrd) that opens ready to play."""

import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..config import suggestion
from ..environment.surroundings import Surroundings
from ..errors import InputError, MissingExtraError
from ..files import written_whole
from ..trajectory import Trajectory
from ..vehicles.geometry import load_geometry
from . import scenery
from .archetypes import APPLICATION, Clock
from .arrows import arrows_of
from .blueprint import Layout, flight_blueprint
from .coloring import coloring_of
from .events import (
    Event,
    Lane,
    flat,
    flight_events,
    flight_figures,
    flight_lanes,
    gate_lanes,
    gates_passed,
    summary_markdown,
)  # fmt: skip
from .kinematics import lat_lon_of, motion_of, pose_at, thinned
from .meshes import mesh_for
from .quantities import Group, Series, plot_groups
from .view_legend import log_legend
from .view_map import log_plain_track, log_position, log_track
from .view_plots import log_events, log_lane, log_lines
from .view_scene import (
    log_axes,
    log_curtain,
    log_ground,
    log_line,
    log_path,
    log_tube,
    log_vehicles_along,
    log_world,
)  # fmt: skip
from .view_surroundings import log_surroundings, places
from .view_vehicle import (
    log_arrows,
    log_chase,
    log_planned_vehicle,
    log_uncertainty,
    log_vehicle,
)  # fmt: skip

try:
    import rerun as rr
except ImportError as error:
    raise MissingExtraError('a Rerun recording', 'view') from error

Array = NDArray[np.float64]

MAX_ROWS = 200_000
AXES = ('axes', 'earth axes')
PARTS = (*AXES, 'path', 'curtain', 'ground', 'grid', 'ghosts', 'arrows', 'uncertainty')
"""What of the 3D view can be left out."""

SMALLEST_MAP = 20.0  # m; a shorter flight is one dot on a map


def save_rrd(
    path: str | os.PathLike[str],
    flight: Trajectory,
    *,
    planned: Trajectory | None = None,
    name: str = '',
    color: str = 'speed',
    surroundings: Surroundings | None = None,
    geometry: Mapping[str, Any] | None = None,
    events: Sequence[Event] = (),
    lanes: Sequence[Lane] = (),
    properties: Mapping[str, Any] | None = None,
    vehicles: int | None = None,
    hidden: Collection[str] = AXES,
    max_rows: int = MAX_ROWS,
) -> None:
    """Write a flight as a Rerun recording with its layout.

    Parameters
    ----------
    path : path
        The file to write; it appears complete or not at all.
    flight : Trajectory
        What to show: a plan, a simulation or a replay.
    planned : Trajectory or None
        What was meant to happen, drawn beside it and compared at equal times.
    name : str
        Title of the recording; the vehicle and problem if empty.
    color : str
        What the path is coloured by, see `coloring.coloring_of`.
    surroundings : Surroundings or None
        What stands around the flight; a terrain takes the place of the level ground.
    geometry : mapping
        Of the vehicle, as `vehicles.geometry` reads it; the configured vehicle's unless given.
    events : sequence of Event
        Shown with the ones read off the flight itself.
    lanes : sequence of Lane
        Phases and the like, shown with the stretches of an interrupted flight.
    properties : mapping of name to value
        Figures of the run (solver times, objective ...) to keep with the recording.
    vehicles : int
        How many are drawn along the path, if not as many as fit.
    hidden : names among `PARTS`
        What is left out; unless given, the axes of the vehicle and of the earth.
    max_rows : int
        Of a longer flight about this many samples are sent, with every extreme among them; the
        summary says so. 200 000 make some 80 MB.

    Raises
    ------
    MissingExtraError
        If rerun-sdk is not installed (on import of this module).
    InputError
        If there is nothing of the name `color` or one in `hidden`, or the vehicle's mesh cannot
        be read.
    OSError
        If the file cannot be written.

    Notes
    -----
    Timelines: `flight_time`, and `utc` where the trajectory has a date. The path is drawn to one
    50 000th of its length; the moving vehicle and the plots have every sample sent. Where the
    vehicle at its true size would be under 4 % of the scene, the overview and the ghosts show it
    enlarged to that; the chase view is always to scale.
    """
    for part in hidden:
        if part not in PARTS:
            raise InputError(f"there is no '{part}' to hide{suggestion(part, PARTS)}")
    look = _Look(color, surroundings or Surroundings(), geometry, vehicles, hidden)
    recorder = _Recorder(flight, planned, name, max_rows, look)
    with written_whole(path) as temporary:
        recorder.write(str(temporary), events, lanes, properties or {})


@dataclass(frozen=True)
class _Look:
    """What is drawn and how, as `save_rrd` is asked."""

    color: str
    surroundings: Surroundings
    geometry: Mapping[str, Any] | None
    vehicles: int | None
    hidden: Collection[str]


class _Recorder:
    def __init__(
        self,
        flight: Trajectory,
        planned: Trajectory | None,
        name: str,
        max_rows: int,
        look: _Look,
    ) -> None:
        self.look = look
        self.flight = thinned(flight, max_rows)
        self.motion = motion_of(self.flight)
        self.planned = planned = None if planned is None else thinned(planned, max_rows)
        self.plan_motion = motion_of(planned, origin=flight.origin) if planned else None
        whole = self.motion if self.flight is flight else motion_of(flight)
        self.figures = flight_figures(flight, whole)
        words = [flight.vehicle, flight.problem]
        self.title = name or ' '.join(word for word in words if word) or 'flight'
        self.deviation = self._deviation()
        self.coloring = coloring_of(self.flight, self.motion, look.color, deviation=self.deviation)
        geometry = load_geometry(flight.vehicle) if look.geometry is None else look.geometry
        # a log seldom says what flew, but its name often does
        self.shape = mesh_for(flight.vehicle or self.title, geometry=geometry, motion=self.motion)
        self.notes = [f'path coloured by {self.coloring.note}']
        if self.flight is not flight:
            text = f'{len(self.flight)} of {len(flight)} samples are in this recording'
            self.notes.insert(0, text)
        self.rec = rr.RecordingStream(APPLICATION)

    def write(
        self,
        path: str,
        events: Sequence[Event],
        lanes: Sequence[Lane],
        properties: Mapping[str, Any],
    ) -> None:
        flight, motion, rec = self.flight, self.motion, self.rec
        surroundings, hidden = self.look.surroundings, self.look.hidden
        size = self.shape.size
        enlarged = max(1.0, scenery.SCENE_SHARE * motion.size / size)
        shown = self.shape.scaled(enlarged)
        ground = scenery.ground_altitude(flight, motion)
        on_earth = flight.origin is not None
        ground_z = scenery.ground_level(motion, ground, round_earth=on_earth)
        # The lowest vehicle stands on the ground, not in it.
        under = ground_z + 0.3 * min(shown.size, 0.1 * motion.size)
        around = places(surroundings)
        grid = scenery.ground_grid(motion, under, round_earth=on_earth, around=around)
        groups = plot_groups(flight, motion)
        if self.deviation is not None:
            series = Series('distance from plan', self.deviation[1])
            groups.insert(2, Group('deviation', 'Distance from plan [m]', 'm', (series,)))
            self.figures['max_deviation_m'] = float(self.deviation[1].max())
        lat_lon = lat_lon_of(flight) if motion.size > SMALLEST_MAP else None
        passings = gates_passed(motion, surroundings.gates)
        lanes = [*lanes, *gate_lanes(motion, passings), *flight_lanes(motion)]
        events = [*events, *(Event(time, f'through gate {g.name}') for time, g in passings)]
        layout = Layout(
            duration=flight.duration,
            groups=groups,
            overview=scenery.overview_camera(
                motion,
                ground_z=ground_z,
                margin=0.6 * shown.size,
                hilly=surroundings.terrain is not None,
            ),
            chase=scenery.Camera((-1.7 * size, 0.75 * size, 0.65 * size), (0.0, 0.0, 0.0)),
            lanes=len(lanes),
            map_zoom=None if lat_lon is None else scenery.map_zoom(lat_lon),
        )
        rec.save(path, default_blueprint=flight_blueprint(layout))
        try:
            rec.send_recording_name(self.title)
            rec.send_property('flight', rr.AnyValues(**self.figures))
            if properties:
                rec.send_property('run', rr.AnyValues(**flat(properties)))
            clock = self._clock(flight)
            log_world(rec)
            if 'path' not in hidden:
                log_path(rec, 'world/path/flown', motion, self.coloring)
            log_legend(rec, self.coloring)
            if surroundings.terrain is None:
                if 'curtain' not in hidden:
                    log_curtain(rec, motion, self.coloring, ground)
                if 'ground' not in hidden:
                    log_ground(rec, grid, lines='grid' not in hidden)
                    self.notes.append(f'ground grid of {grid.spacing:g} m')
            reach = float(min(ground, motion.altitude.min())), float(motion.altitude.max())
            note = log_surroundings(rec, surroundings, reach=reach, origin=flight.origin)
            self.notes += [note] if note else []
            if 'uncertainty' not in hidden and log_tube(rec, motion):
                self.notes.append('blue tube: 1-sigma of the position')
            if 'ghosts' not in hidden:
                log_vehicles_along(rec, motion, shown, self.look.vehicles)
            log_vehicle(rec, 'world/vehicle', clock, motion, self.shape, enlarged)
            if 'arrows' not in hidden:
                arrows = arrows_of(flight, motion)
                self.notes += log_arrows(rec, 'world/vehicle', clock, arrows, size)
            if 'uncertainty' not in hidden:
                log_uncertainty(rec, clock, motion)
            if 'axes' not in hidden:
                log_axes(rec, 'world/vehicle/axes', shown.size)
            if 'earth axes' not in hidden:
                log_axes(rec, 'world/earth_axes', 0.2 * motion.size)
            log_chase(rec, 'world/chase', clock, motion)
            self._plan(shown, groups)
            if lat_lon is not None:
                self._map(clock, lat_lon)
            for group in groups:
                at = clock
                if group.key == 'deviation' and self.deviation is not None:
                    at = self._clock(flight, self.deviation[0])
                log_lines(rec, group, at, motion)
            happened = sorted(
                [*events, *flight_events(motion, self.deviation)], key=lambda event: event.time
            )
            times = np.array([event.time for event in happened])
            log_events(rec, self._clock(flight, times), happened)
            for lane in lanes:
                log_lane(rec, lane, self._clock(flight, np.array(lane.times)))
            if enlarged > 1:
                self.notes.append(f'overview: vehicle drawn {enlarged:.3g} times its size')
            page = summary_markdown(self.title, {**self.figures, **flat(properties)}, self.notes)
            rec.log('summary', rr.TextDocument(page, media_type='text/markdown'), static=True)
            rec.flush()
        finally:
            rec.disconnect()

    def _clock(self, trajectory: Trajectory, time: Array | None = None) -> Clock:
        """Return times of a trajectory on the flight's clock."""
        time = trajectory.time if time is None else time
        return Clock.of(time + self._offset(trajectory), self.flight.start_ns)

    def _offset(self, trajectory: Trajectory) -> float:
        """Return how much later [s] a trajectory's clock starts than the flight's."""
        if not (self.flight.start_ns and trajectory.start_ns):
            return 0.0
        return (trajectory.start_ns - self.flight.start_ns) / 1e9

    def _deviation(self) -> tuple[Array, Array] | None:
        """Return the flight's times within the plan [s] and the distances then [m]."""
        if self.planned is None or self.plan_motion is None:
            return None
        time = self.motion.time
        meant, _, inside = pose_at(self.plan_motion, time - self._offset(self.planned))
        apart = np.linalg.norm(self.motion.position - meant, axis=1)
        return (time[inside], apart[inside]) if inside.any() else None

    def _plan(self, shown: Any, groups: Sequence[Group]) -> None:
        if self.planned is None or self.plan_motion is None:
            return
        motion = self.plan_motion
        log_line(self.rec, 'world/path/planned', motion)
        # At the flight's own times, or the planned vehicle would lag behind by up to a node.
        time = self.motion.time
        meant, turned, known = pose_at(motion, time - self._offset(self.planned))
        clock = self._clock(self.flight, time[known])
        log_planned_vehicle(self.rec, clock, meant[known], turned[known], shown)
        keys = {group.key for group in groups}
        for group in plot_groups(self.planned, motion):
            if group.key in keys:
                clock = self._clock(self.planned)
                log_lines(self.rec, group, clock, motion, name='planned', planned=True)

    def _map(self, clock: Clock, lat_lon: Array) -> None:
        log_track(self.rec, 'map/track/flown', lat_lon, self.motion, self.coloring)
        if self.planned is not None and self.plan_motion is not None:
            plan = lat_lon_of(self.planned)
            if plan is not None and len(plan) > 1:
                log_plain_track(self.rec, 'map/track/planned', plan, self.plan_motion)
        log_position(self.rec, 'map', clock, lat_lon, self.motion.heading)
