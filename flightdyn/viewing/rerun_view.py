"""Write a flight as a Rerun recording (.rrd) that opens ready to play."""

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import frames
from ..errors import MissingExtraError
from ..files import written_whole
from ..trajectory import Trajectory
from . import scenery
from .blueprint import Layout, flight_blueprint
from .events import Event, flight_events, flight_figures, summary_markdown
from .kinematics import Motion, lat_lon_of, motion_of, pose_at, thinned
from .meshes import Mesh, mesh_for
from .quantities import Group, Series, plot_groups

try:
    import rerun as rr
except ImportError as error:
    raise MissingExtraError('a Rerun recording', 'view') from error

Array = NDArray[np.float64]
Columns = Callable[[slice], Sequence[Any]]

APPLICATION = 'flightdyn'
MAX_ROWS = 250_000
ROWS = 65_536  # a chunk this long loads in the viewer with the least memory
PLANNED = [240, 240, 245]
ARROW = [255, 190, 60]
PALETTE = [(255, 176, 64), (86, 180, 233), (204, 121, 167), (0, 158, 115), (240, 228, 66),
           (213, 94, 0)]  # fmt: skip  # after Okabe and Ito: told apart by the colour-blind


def save_rrd(
    path: str | os.PathLike[str],
    flight: Trajectory,
    *,
    planned: Trajectory | None = None,
    name: str = '',
    events: Sequence[Event] = (),
    properties: Mapping[str, Any] | None = None,
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
    events : sequence of Event
        Shown with the ones read off the flight itself.
    properties : mapping of name to value
        Figures of the run (solver times, objective ...) to keep with the recording.
    max_rows : int
        Of a longer flight about this many samples are sent, with every extreme among them; the
        summary says so. 250 000 make some 80 MB.

    Raises
    ------
    MissingExtraError
        If rerun-sdk is not installed (on import of this module).
    OSError
        If the file cannot be written.

    Notes
    -----
    Timelines: `flight_time`, and `utc` where the trajectory has a date. The path is drawn to one
    50 000th of its length and coloured by speed; the moving vehicle and the plots have every
    sample sent. Where the vehicle at its true size would be under 4 % of the scene, the overview
    and the ghosts show it enlarged to that; the chase view is always to scale.
    """
    with written_whole(path) as temporary:
        _Recorder(flight, planned, name, max_rows).write(str(temporary), events, properties or {})


@dataclass(frozen=True)
class _Clock:
    """Times of some rows on every timeline."""

    elapsed: NDArray[np.timedelta64]
    utc: NDArray[np.datetime64] | None

    def at(self, rows: slice) -> list[rr.TimeColumn]:
        columns = [rr.TimeColumn('flight_time', duration=self.elapsed[rows])]
        if self.utc is not None:
            columns.append(rr.TimeColumn('utc', timestamp=self.utc[rows]))
        return columns

    def __len__(self) -> int:
        return int(self.elapsed.size)


SMALLEST_MAP = 20.0  # m; a shorter flight is one dot on a map


class _Recorder:
    def __init__(
        self, flight: Trajectory, planned: Trajectory | None, name: str, max_rows: int
    ) -> None:
        self.flight = thinned(flight, max_rows)
        self.motion = motion_of(self.flight)
        self.planned = planned = None if planned is None else thinned(planned, max_rows)
        whole = self.motion if self.flight is flight else motion_of(flight)
        self.figures = flight_figures(flight, whole)
        self.notes: list[str] = []
        if self.flight is not flight:
            self.notes.append(f'{len(self.flight)} of {len(flight)} samples are in this recording')
        self.plan_motion = motion_of(planned, origin=flight.origin) if planned else None
        words = [flight.vehicle, flight.problem]
        self.title = name or ' '.join(word for word in words if word) or 'flight'
        self.rec = rr.RecordingStream(APPLICATION)

    def write(self, path: str, events: Sequence[Event], properties: Mapping[str, Any]) -> None:
        flight, motion = self.flight, self.motion
        # a log seldom says what flew, but its name often does
        mesh = mesh_for(flight.vehicle or self.title, scene_size=motion.size)
        enlarged = max(1.0, scenery.SCENE_SHARE * motion.size / mesh.size)
        shown_size = mesh.size * enlarged
        ground = scenery.ground_altitude(flight, motion)
        # The lowest vehicle stands on the ground, not in it.
        lowest = int(np.argmin(motion.altitude))
        ground_z = motion.position[lowest, 2] + motion.altitude[lowest] - ground
        grid = scenery.ground_grid(motion, ground_z + 0.3 * min(shown_size, 0.1 * motion.size))
        groups = plot_groups(flight, motion)
        deviation = self._deviation()
        if deviation is not None and deviation[0].size:
            series = Series('distance from plan', deviation[1])
            groups.insert(2, Group('deviation', 'Distance from plan [m]', 'm', (series,)))
        low, high = scenery.speed_range(motion)
        note = f'path coloured by speed, {low:.3g} (violet) to {high:.3g} m/s (yellow)'
        figures = self.figures
        if deviation is not None and deviation[0].size:
            figures['max_deviation_m'] = float(deviation[1].max())
        lat_lon = lat_lon_of(flight) if motion.size > SMALLEST_MAP else None
        layout = Layout(
            duration=flight.duration,
            groups=groups,
            overview=scenery.overview_camera(motion, ground_z=ground_z, margin=0.6 * shown_size),
            chase=scenery.Camera(
                (-1.7 * mesh.size, 0.75 * mesh.size, 0.65 * mesh.size), (0.0, 0.0, 0.0)
            ),
            path_note=f'speed: violet {low:.2g} to yellow {high:.2g} m/s',
            map_zoom=None if lat_lon is None else scenery.map_zoom(lat_lon),
        )
        self.rec.save(path, default_blueprint=flight_blueprint(layout))
        try:
            self.rec.send_recording_name(self.title)
            self._properties(figures, properties)
            self._scene(mesh, enlarged, ground, grid)
            self._vehicle(mesh, enlarged)
            self._plan(mesh, enlarged)
            self._map(lat_lon)
            self._plots(groups, deviation)
            self._events([*events, *flight_events(motion, deviation)])
            notes = [*self.notes, note, f'ground grid of {grid.spacing:g} m']
            if enlarged > 1:
                notes.append(f'overview: vehicle drawn {enlarged:.3g} times its size')
            page = summary_markdown(self.title, {**figures, **_flat(properties)}, notes)
            document = rr.TextDocument(page, media_type='text/markdown')
            self.rec.log('summary', document, static=True)
            self.rec.flush()
        finally:
            self.rec.disconnect()

    def _clock(self, trajectory: Trajectory, time: Array | None = None) -> _Clock:
        """Return times of a trajectory on the flight's clock."""
        time = trajectory.time if time is None else time
        start_ns = self.flight.start_ns
        elapsed = np.round((time + self._offset(trajectory)) * 1e9).astype(np.int64)
        utc = (start_ns + elapsed).astype('datetime64[ns]') if start_ns else None
        return _Clock(elapsed.astype('timedelta64[ns]'), utc)

    def _offset(self, trajectory: Trajectory) -> float:
        """Return how much later [s] a trajectory's clock starts than the flight's."""
        if not (self.flight.start_ns and trajectory.start_ns):
            return 0.0
        return (trajectory.start_ns - self.flight.start_ns) / 1e9

    def _send(self, entity: str, clock: _Clock, columns: Columns) -> None:
        for rows in scenery.slices(len(clock), ROWS):
            self.rec.send_columns(entity, indexes=clock.at(rows), columns=columns(rows))

    def _properties(self, figures: Mapping[str, Any], properties: Mapping[str, Any]) -> None:
        self.rec.send_property('flight', rr.AnyValues(**figures))
        if properties:
            self.rec.send_property('run', rr.AnyValues(**_flat(properties)))

    def _scene(self, mesh: Mesh, enlarged: float, ground: float, grid: scenery.Ground) -> None:
        log, motion = self.rec.log, self.motion
        log('world', rr.ViewCoordinates.FRD, static=True)
        strips = scenery.colored_strips(motion)
        if strips:
            path = rr.LineStrips3D(
                [motion.position[strip.index] for strip in strips],
                colors=[strip.color for strip in strips],
                radii=rr.Radius.ui_points(2.0),
            )
            log('world/path/flown', path, static=True)
            vertices, triangles, colors = scenery.curtain(motion, ground)
            drape = rr.Mesh3D(
                vertex_positions=vertices,
                triangle_indices=triangles,
                vertex_colors=colors,
                albedo_factor=[255, 255, 255, 70],
            )
            log('world/curtain', drape, static=True)
        lines = rr.LineStrips3D(grid.lines, colors=[[82, 104, 96]], radii=rr.Radius.ui_points(0.6))
        log('world/ground/grid', lines, static=True)
        plane = rr.Mesh3D(
            vertex_positions=grid.corners,
            triangle_indices=[[0, 1, 2], [0, 2, 3]],
            vertex_colors=[[38, 56, 50]] * 4,
        )
        log('world/ground/plane', plane, static=True)
        index = scenery.ghost_samples(motion, mesh.size * enlarged)
        log('world/ghosts', _ghost(mesh.scaled(enlarged), 0.6, 100), static=True)
        poses = rr.InstancePoses3D(
            translations=motion.position[index], quaternions=_xyzw(motion.attitude[index])
        )
        log('world/ghosts', poses, static=True)

    def _vehicle(self, mesh: Mesh, enlarged: float) -> None:
        motion, clock = self.motion, self._clock(self.flight)
        self.rec.log('world/vehicle/body', _mesh(mesh), static=True)
        self.rec.log('world/vehicle/enlarged', _mesh(mesh.scaled(enlarged)), static=True)
        if enlarged > 1:  # a dot that no distance makes too small to find
            dot = rr.Points3D([[0.0, 0.0, 0.0]], radii=rr.Radius.ui_points(4.5), colors=[ARROW])
            self.rec.log('world/vehicle/marker', dot, static=True)
        position = motion.position.astype(np.float32)
        attitude = _xyzw(motion.attitude)
        self._send(
            'world/vehicle',
            clock,
            lambda rows: rr.Transform3D.columns(
                translation=position[rows], quaternion=attitude[rows]
            ),
        )
        # The velocity turns with the body, so one small column draws it at every attitude.
        fastest = max(float(motion.speed.max()), 1e-9)
        arrow = (motion.velocity_body * (1.2 * mesh.size / fastest)).astype(np.float32)
        style = rr.Arrows3D.from_fields(colors=[ARROW], radii=[0.018 * mesh.size])
        self.rec.log('world/vehicle/velocity', style, static=True)
        self._send(
            'world/vehicle/velocity',
            clock,
            lambda rows: rr.Arrows3D.columns(vectors=arrow[rows]),
        )
        self.rec.log('world/chase', rr.ViewCoordinates.FLU, static=True)
        # The viewer wants up to be up: half a turn about forward makes the level frame FLU.
        turn = frames.quaternion_from_euler(0.0, 0.0, motion.heading)
        upright = frames.quaternion_multiply(turn, (0.0, 1.0, 0.0, 0.0))
        level = _xyzw(np.stack(np.broadcast_arrays(*upright), axis=-1))
        self._send(
            'world/chase',
            clock,
            lambda rows: rr.Transform3D.columns(
                translation=position[rows], quaternion=level[rows]
            ),
        )

    def _plan(self, mesh: Mesh, enlarged: float) -> None:
        if self.planned is None or self.plan_motion is None:
            return
        motion = self.plan_motion
        parts = scenery.drawn_samples(motion, scenery.MAX_PATH_POINTS)
        path = rr.LineStrips3D(
            [motion.position[part] for part in parts if part.size > 1],
            colors=[PLANNED],
            radii=rr.Radius.ui_points(1.2),
        )
        self.rec.log('world/path/planned', path, static=True)
        self.rec.log('world/planned_vehicle', _ghost(mesh.scaled(enlarged), 1.0, 55), static=True)
        # At the flight's own times, or the planned vehicle would lag behind by up to a node.
        time = self.motion.time
        meant, turned, known = pose_at(motion, time - self._offset(self.planned))
        position, attitude = meant[known].astype(np.float32), _xyzw(turned[known])
        self._send(
            'world/planned_vehicle',
            self._clock(self.flight, time[known]),
            lambda rows: rr.Transform3D.columns(
                translation=position[rows], quaternion=attitude[rows]
            ),
        )

    def _deviation(self) -> tuple[Array, Array] | None:
        """Return the flight's times within the plan [s] and the distances then [m]."""
        if self.planned is None or self.plan_motion is None:
            return None
        time = self.motion.time
        then = time - self._offset(self.planned)
        meant, _, inside = pose_at(self.plan_motion, then)
        apart = np.linalg.norm(self.motion.position - meant, axis=1)
        return time[inside], apart[inside]

    def _map(self, lat_lon: Array | None) -> None:
        if lat_lon is None:
            return
        strips = scenery.colored_strips(self.motion, budget=10_000)
        if strips:
            lines = [(scenery.lines_on_map(lat_lon, s.index), s.color) for s in strips]
            track = rr.GeoLineStrings(
                lat_lon=[piece for pieces, _ in lines for piece in pieces],
                colors=[color for pieces, color in lines for _ in pieces],
                radii=rr.Radius.ui_points(2.0),
            )
            self.rec.log('map/track/flown', track, static=True)
        if self.planned is not None and self.plan_motion is not None:
            plan = lat_lon_of(self.planned)
            if plan is not None and len(plan) > 1:
                parts = scenery.drawn_samples(self.plan_motion, 10_000)
                drawn = rr.GeoLineStrings(
                    lat_lon=[line for part in parts for line in scenery.lines_on_map(plan, part)],
                    colors=[PLANNED],
                    radii=rr.Radius.ui_points(1.2),
                )
                self.rec.log('map/track/planned', drawn, static=True)
        style = rr.GeoPoints.from_fields(colors=[ARROW], radii=rr.Radius.ui_points(6.0))
        self.rec.log('map/position', style, static=True)
        self._send(
            'map/position',
            self._clock(self.flight),
            lambda rows: rr.GeoPoints.columns(positions=lat_lon[rows]),
        )

    def _plots(self, groups: Sequence[Group], deviation: tuple[Array, Array] | None) -> None:
        for group in groups:
            if group.key == 'deviation' and deviation is not None:
                clock = self._clock(self.flight, deviation[0])
            else:
                clock = self._clock(self.flight)
            self._lines(f'plots/{group.key}', group, clock, self.motion, '')
        if self.planned is None or self.plan_motion is None:
            return
        keys = {group.key for group in groups}
        clock = self._clock(self.planned)
        for group in plot_groups(self.planned, self.plan_motion):
            if group.key in keys:
                self._lines(f'plots/{group.key}', group, clock, self.plan_motion, ' planned')

    def _lines(self, root: str, group: Group, clock: _Clock, motion: Motion, suffix: str) -> None:
        """Send a plot's lines: one entity for those alike, one for each with a 1-sigma band."""
        entity = f'{root}/{"planned" if suffix else "flown"}'
        plain = [(i, s) for i, s in enumerate(group.series) if s.std is None or suffix]
        if plain:
            values = np.column_stack([s.values for _, s in plain])
            style = {
                'names': [f'{s.name}{suffix}' for _, s in plain],
                'colors': [_line_color(i, bool(suffix)) for i, _ in plain],
                'widths': [1.0 if suffix else 1.5] * len(plain),
            }
            if group.key == 'track':  # dots: a line would jump across the plot at 360 degrees
                look: rr.AsComponents = rr.SeriesPoints(
                    names=style['names'], colors=style['colors'],
                    marker_sizes=[0.7] * len(plain), markers=['circle'] * len(plain),
                )  # fmt: skip
            else:
                steps = any(s.steps for _, s in plain)
                look = rr.SeriesLines(**style, interpolation_mode='StepAfter' if steps else None)
            self.rec.log(entity, look, static=True)
            self._send(entity, clock, lambda rows: rr.Scalars.columns(scalars=values[rows]))
            self._breaks(entity, clock, motion)
        for i, series in enumerate(group.series):
            if series.std is None or suffix:
                continue
            self._band(f'{entity}_{series.name}', series, i, group.unit, clock)
            self._breaks(f'{entity}_{series.name}', clock, motion)

    def _band(self, entity: str, series: Series, number: int, unit: str, clock: _Clock) -> None:
        assert series.std is not None
        values, variance = series.values, series.std**2
        look = rr.Measurements.from_fields(
            names=[f'{series.name} +-1 sigma'],
            colors=[_line_color(number, False)],
            units=[unit],
            widths=[1.5],
        )
        self.rec.log(entity, look, static=True)
        self._send(
            entity,
            clock,
            lambda rows: rr.Measurements.columns(values=values[rows], variances=variance[rows]),
        )

    def _breaks(self, entity: str, clock: _Clock, motion: Motion) -> None:
        """Cut a plotted line after each stretch but the last: the viewer joins what is not cut."""
        if len(clock) != len(motion.time) or len(motion.segments) < 2:
            return
        last = np.array([part.stop - 1 for part in motion.segments[:-1]])
        tick = np.timedelta64(1, 'ns')
        utc = None if clock.utc is None else clock.utc[last] + tick
        ends = _Clock(clock.elapsed[last] + tick, utc)
        self._send(
            entity,
            ends,
            lambda rows: rr.Clear.columns(is_recursive=[False] * (rows.stop - rows.start)),
        )

    def _events(self, events: Sequence[Event]) -> None:
        ordered = sorted(events, key=lambda event: event.time)
        time = np.array([event.time for event in ordered])
        texts = [event.text for event in ordered]
        levels = [event.level for event in ordered]
        self._send(
            'events',
            self._clock(self.flight, time),
            lambda rows: rr.TextLog.columns(text=texts[rows], level=levels[rows]),
        )


def _mesh(mesh: Mesh) -> rr.Mesh3D:
    return rr.Mesh3D(
        vertex_positions=mesh.vertices,
        vertex_normals=mesh.normals,
        vertex_colors=mesh.colors,
    )


def _ghost(mesh: Mesh, fade: float, alpha: int) -> rr.Mesh3D:
    """Return a translucent mesh with its colours faded towards white."""
    return rr.Mesh3D(
        vertex_positions=mesh.vertices,
        vertex_normals=mesh.normals,
        vertex_colors=((1 - fade) * mesh.colors + fade * 225).astype(np.uint8),
        albedo_factor=[255, 255, 255, alpha],
    )


def _xyzw(attitude: Array) -> NDArray[np.float32]:
    """Return quaternions (n, 4) in Rerun's order, the scalar last."""
    return np.roll(attitude, -1, axis=1).astype(np.float32)


def _line_color(number: int, faint: bool) -> list[int]:
    color = np.array(PALETTE[number % len(PALETTE)], float)
    mixed = 0.4 * color + 0.6 * 235 if faint else color
    return [int(c) for c in np.round(mixed)]


def _flat(properties: Mapping[str, Any], prefix: str = '') -> dict[str, Any]:
    """Return nested properties as one level of names with values a recording can hold."""
    flat: dict[str, Any] = {}
    for name, value in properties.items():
        key = f'{prefix}{name}'
        if isinstance(value, Mapping):
            flat.update(_flat(value, f'{key}_'))
        elif value is None:
            continue
        elif isinstance(value, bool | int | float | str):
            flat[key] = value
        elif isinstance(value, np.generic):
            flat[key] = value.item()
        else:
            flat[key] = json.dumps(value, default=str)
    return flat
