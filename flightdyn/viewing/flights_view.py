"""Write several flights as one Rerun recording: each in its colour, aligned in time."""

import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..config import suggestion
from ..environment.surroundings import Surroundings
from ..errors import InputError, MissingExtraError
from ..files import written_whole
from ..replay.flights import find_flights
from ..trajectory import Trajectory
from ..vehicles.geometry import load_geometry
from . import scenery
from .archetypes import APPLICATION, PALETTE, Clock, log_body, path_part
from .blueprint import Layout, flight_blueprint
from .events import Event, flight_events, flight_figures
from .kinematics import Motion, lat_lon_of, motion_of, thinned
from .meshes import mesh_for
from .quantities import Group, Series, plot_groups
from .rerun_view import MAX_ROWS, SMALLEST_MAP
from .view_map import log_plain_track, log_position
from .view_plots import log_events, log_lines
from .view_scene import log_ground, log_line, log_world
from .view_surroundings import log_surroundings, places
from .view_vehicle import log_chase, log_poses

try:
    import rerun as rr
except ImportError as error:
    raise MissingExtraError('a Rerun recording', 'view') from error

Array = NDArray[np.float64]

MAX_FLIGHTS = 100
SHOWN = ('altitude', 'speed', 'airspeed', 'gamma', 'bank', 'alpha', 'load_factor')
"""What is plotted of several flights, one plot each."""

MOMENTS: dict[str, Callable[[Trajectory, Motion], float | None]] = {
    'start': lambda flight, motion: float(motion.time[0]),
    'end': lambda flight, motion: float(motion.time[-1]),
    'highest': lambda flight, motion: float(motion.time[np.argmax(motion.altitude)]),
    'lowest': lambda flight, motion: float(motion.time[np.argmin(motion.altitude)]),
    'fastest': lambda flight, motion: float(motion.time[np.argmax(motion.speed)]),
    'take-off': lambda flight, motion: _first(flight, motion, 'takeoff', 'start'),
    'landing': lambda flight, motion: _first(flight, motion, 'landing', 'end'),
}
"""Events that flights can be aligned by, and the time of each [s], None if there is no such."""


def save_flights(
    path: str | os.PathLike[str],
    flights: Mapping[str, Trajectory],
    *,
    align: str = 'time',
    name: str = '',
    surroundings: Surroundings | None = None,
    max_rows: int = MAX_ROWS,
) -> None:
    """Write several flights as one recording, to compare them.

    Parameters
    ----------
    path : path
        The file to write; it appears complete or not at all.
    flights : mapping of label to Trajectory
    align : str
        'time': by date, or by their own clocks if none has a date. Otherwise the event, one of
        `MOMENTS`, that is at 0 s in each: 'start', 'take-off', 'highest' ...
    name : str
        Title of the recording.
    surroundings : Surroundings or None
        What stands around them.
    max_rows : int
        About this many samples are sent in all, with every extreme among them.

    Raises
    ------
    InputError
        If there are none or more than 100 flights, some but not all have a date or a place on
        earth, the event is unknown, or a flight has none of it.
    OSError
        If the file cannot be written.

    Notes
    -----
    All are drawn in the local frame of the first one's origin.
    """
    recorder = _Recorder(flights, align, name, surroundings or Surroundings(), max_rows)
    with written_whole(path) as temporary:
        recorder.write(str(temporary))


class _Recorder:
    def __init__(
        self,
        flights: Mapping[str, Trajectory],
        align: str,
        name: str,
        surroundings: Surroundings,
        max_rows: int,
    ) -> None:
        if not 0 < len(flights) <= MAX_FLIGHTS:
            raise InputError(f'1 to {MAX_FLIGHTS} flights can be seen at once, not {len(flights)}')
        self.title = name or f'{len(flights)} flights'
        self.surroundings = surroundings
        whole = list(flights.values())
        self.origin = whole[0].origin
        _check_alike(flights, 'a place on earth', [f.origin is not None for f in whole])
        # Each keeps its peaks, which alignment by an event needs.
        each = max(1, max_rows // len(flights))
        self.flights = {label: thinned(flight, each) for label, flight in flights.items()}
        self.motions = {k: motion_of(f, origin=self.origin) for k, f in self.flights.items()}
        self.start_ns, self.offsets = _aligned(self.flights, self.motions, align)
        self.align = align
        self.rec = rr.RecordingStream(APPLICATION)

    def write(self, path: str) -> None:
        rec, motions = self.rec, self.motions
        merged = _merged(list(motions.values()))
        shapes = {
            label: mesh_for(
                flight.vehicle or label,
                geometry=load_geometry(flight.vehicle),
                motion=motions[label],
            )
            for label, flight in self.flights.items()
        }
        first = next(iter(self.flights))
        size = shapes[first].size
        ground = min(
            scenery.ground_altitude(flight, motions[label])
            for label, flight in self.flights.items()
        )
        on_earth = self.origin is not None
        ground_z = scenery.ground_level(merged, ground, round_earth=on_earth)
        around = places(self.surroundings)
        grid = scenery.ground_grid(merged, ground_z, round_earth=on_earth, around=around)
        lat_lon = {label: lat_lon_of(flight) for label, flight in self.flights.items()}
        tracks = [each for each in lat_lon.values() if each is not None]
        on_map = len(tracks) == len(lat_lon) and merged.size > SMALLEST_MAP
        groups = self._groups()
        layout = Layout(
            duration=float(np.ptp(np.concatenate([self._seconds(k) for k in motions]))),
            groups=list(groups.values()),
            overview=scenery.overview_camera(merged, ground_z=ground_z, margin=0.05 * merged.size),
            chase=scenery.Camera((-3.0 * size, 1.3 * size, 1.1 * size), (0.0, 0.0, 0.0)),
            vehicles=[f'flights/{path_part(label)}' for label in self.flights],
            legend=False,
            map_zoom=scenery.map_zoom(np.concatenate(tracks)) if on_map else None,
        )
        rec.save(path, default_blueprint=flight_blueprint(layout))
        try:
            rec.send_recording_name(self.title)
            log_world(rec)
            if self.surroundings.terrain is None:
                log_ground(rec, grid)
            reach = ground, float(merged.altitude.max())
            log_surroundings(rec, self.surroundings, reach=reach, origin=self.origin)
            events: list[Event] = []
            for number, (label, flight) in enumerate(self.flights.items()):
                self._flight(number, label, flight, shapes[label], merged.size)
                track = lat_lon[label]
                if on_map and track is not None:
                    self._map(number, label, track)
                for event in flight_events(motions[label]):
                    later = event.time + self.offsets[label]
                    events.append(replace(event, time=later, text=f'{label}: {event.text}'))
                figures = flight_figures(flight, motions[label])
                rec.send_property(path_part(label), rr.AnyValues(**figures))
            for group in groups.values():
                self._lines(group)
            events.sort(key=lambda event: event.time)
            times = np.array([event.time for event in events])
            log_events(rec, Clock.of(times, self.start_ns), events)
            log_chase(rec, 'world/chase', self._clock(first), motions[first])
            page = rr.TextDocument(self._summary(), media_type='text/markdown')
            rec.log('summary', page, static=True)
            rec.flush()
        finally:
            rec.disconnect()

    def _seconds(self, label: str) -> Array:
        return self.motions[label].time + self.offsets[label]

    def _clock(self, label: str) -> Clock:
        return Clock.of(self._seconds(label), self.start_ns)

    def _flight(
        self, number: int, label: str, flight: Trajectory, shape: Any, scene: float
    ) -> None:
        rec, motion, color = self.rec, self.motions[label], PALETTE[number % len(PALETTE)]
        entity = f'world/flights/{path_part(label)}'
        log_line(rec, f'world/path/{path_part(label)}', motion, color=color, width=2.0)
        enlarged = max(1.0, scenery.SCENE_SHARE * scene / shape.size)
        log_body(rec, f'{entity}/body', shape)
        log_body(rec, f'{entity}/enlarged', shape.scaled(enlarged))
        dot = rr.Points3D(
            [[0.0, 0.0, 0.0]],
            radii=rr.Radius.ui_points(5.0),
            colors=[color],
            labels=[label],
            show_labels=True,
        )
        rec.log(f'{entity}/marker', dot, static=True)
        log_poses(rec, entity, self._clock(label), motion.position, motion.attitude)

    def _map(self, number: int, label: str, lat_lon: Array) -> None:
        color, motion = PALETTE[number % len(PALETTE)], self.motions[label]
        part = path_part(label)
        log_plain_track(self.rec, f'map/track/{part}', lat_lon, motion, color=color, width=2.0)
        clock = self._clock(label)
        log_position(self.rec, f'map/{part}', clock, lat_lon, motion.heading, color=color)

    def _groups(self) -> dict[str, Group]:
        """Return a plot for each quantity, a line for each flight that has it."""
        found: dict[str, Group] = {}
        for label, flight in self.flights.items():
            for group in plot_groups(flight, self.motions[label]):
                for series in group.series:
                    if series.name not in SHOWN:
                        continue
                    name = series.name.replace('_', ' ')
                    title = f'{name[:1].upper()}{name[1:]} [{group.unit}]'
                    known = found.get(series.name, Group(series.name, title, group.unit, ()))
                    line = Series(label, series.values, None, series.steps)
                    found[series.name] = replace(known, series=(*known.series, line))
        return {name: found[name] for name in SHOWN if name in found}

    def _lines(self, group: Group) -> None:
        labels = list(self.flights)
        for series in group.series:
            log_lines(
                self.rec,
                replace(group, series=(series,)),
                self._clock(series.name),
                self.motions[series.name],
                name=path_part(series.name),
                first_color=labels.index(series.name),
            )

    def _summary(self) -> str:
        keys = ('vehicle', 'duration_s', 'distance_m', 'max_speed_m_s', 'max_altitude_m')
        rows = []
        for label, flight in self.flights.items():
            figures = flight_figures(flight, self.motions[label])
            cells = [figures.get(key, '') for key in keys]
            told = [f'{c:.6g}' if isinstance(c, float) else str(c) for c in cells]
            rows.append(f'| {label} | {" | ".join(told)} |')
        head = f'| flight | {" | ".join(keys)} |', '|' + '---|' * (len(keys) + 1)
        return '\n'.join([f'# {self.title}', '', f'Aligned by {self.align}.', '', *head, *rows])


def _check_alike(flights: Mapping[str, Trajectory], what: str, known: list[bool]) -> None:
    if any(known) and not all(known):
        lacking = [label for label, has in zip(flights, known, strict=True) if not has]
        raise InputError(f'some flights have {what}, but not {", ".join(lacking)}')


def _aligned(
    flights: Mapping[str, Trajectory], motions: Mapping[str, Motion], align: str
) -> tuple[int, dict[str, float]]:
    """Return the date of time 0 [ns], 0 for none, and what is added to each flight's times [s]."""
    if align == 'time':
        dates = {label: flight.start_ns for label, flight in flights.items()}
        _check_alike(flights, 'a date (align by start instead)', [bool(d) for d in dates.values()])
        start_ns = min(dates.values())
        return start_ns, {label: (date - start_ns) / 1e9 for label, date in dates.items()}
    if align not in MOMENTS:
        known = suggestion(align, ('time', *MOMENTS))
        raise InputError(f"cannot align by '{align}'{known}")
    offsets = {}
    for label, flight in flights.items():
        moment = MOMENTS[align](flight, motions[label])
        if moment is None:
            raise InputError(f'cannot align by {align}: {label} has none')
        offsets[label] = -moment
    return 0, offsets


def _first(flight: Trajectory, motion: Motion, has: str, when: str) -> float | None:
    """Return the time of the first take-off or landing."""
    seen = {'speed': motion.speed, 'altitude': motion.altitude}
    seen |= {name: motion.position[:, i] for i, name in enumerate(('x_e', 'y_e', 'z_e'))}
    # models in a plane or in body axes do not have them all
    missing = {name: values for name, values in seen.items() if name not in flight}
    flight = replace(flight, outputs={**flight.outputs, **missing})
    found = (float(getattr(f, when)) for f in find_flights(flight) if getattr(f, has))
    return next(found, None)


def _merged(motions: list[Motion]) -> Motion:
    """Return all motions as one of many segments, for what has to see them all."""
    segments, base = [], 0
    for motion in motions:
        segments += [slice(s.start + base, s.stop + base) for s in motion.segments]
        base += len(motion.time)

    def joined(name: str) -> Array:
        return np.concatenate([getattr(motion, name) for motion in motions])

    names = ('time', 'position', 'attitude', 'heading', 'velocity', 'speed', 'altitude')
    return Motion(**{name: joined(name) for name in names}, segments=segments)
