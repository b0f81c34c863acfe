"""Where many flights end: the ground they bound, in 3D and on a map, as a Rerun recording."""

import os
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..environment.geodesy import GeodeticPoint, geodetic_from_ned
from ..errors import InputError, MissingExtraError
from ..files import written_whole
from .scenery import FIELD_OF_VIEW, map_zoom, nice_step

try:
    import rerun as rr
    import rerun.blueprint as rrb

    from .archetypes import APPLICATION, PALETTE
    from .blueprint import SKY
except ImportError as error:
    raise MissingExtraError('a Rerun recording', 'view') from error

Array = NDArray[np.float64]

MAX_FLIGHTS = 500  # drawn; the area is that of all
RING_POINTS = 181
RING_COLOR = [96, 116, 128]
FILL = 70  # opacity, of 255


@dataclass(frozen=True)
class Area:
    """The ground that some flights bound.

    Parameters
    ----------
    label : str
        What these flights have in common.
    ends : array (n, 2)
        Where they end, north and east of the origin [m], once round.
    flights : sequence of array (m, 3)
        Their paths in earth axes (NED) [m], if they are to be drawn.
    """

    label: str
    ends: Array
    flights: Sequence[Array] = ()

    @property
    def size(self) -> float:
        """Its area [m^2], by the straight lines between its corners."""
        x, y = self.ends.T
        return abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2


def save_footprint(
    path: str | os.PathLike[str],
    areas: Sequence[Area],
    *,
    place: GeodeticPoint | None = None,
    title: str = '',
) -> None:
    """Write areas on the ground as a Rerun recording with its layout.

    Parameters
    ----------
    path : path
        The file to write; it appears complete or not at all.
    areas : sequence of Area
        Drawn in a colour each.
    place : GeodeticPoint, optional
        Where on earth the origin is; with it the areas are on a map, too.

    Raises
    ------
    InputError
        If there is nothing to draw: no area with three corners.
    MissingExtraError
        If rerun-sdk is not installed (on import of this module).
    """
    drawn = [area for area in areas if len(area.ends) >= 3]
    if not drawn:
        raise InputError('no footprint: it takes three flights or more that reach something')
    with written_whole(path) as temporary:
        record = rr.RecordingStream(APPLICATION)
        record.save(str(temporary), default_blueprint=_blueprint(drawn, place))
        try:
            record.send_recording_name(title or 'footprint')
            _rings(record, drawn)
            for number, area in enumerate(drawn):
                color = list(PALETTE[number % len(PALETTE)])
                _area(record, area, number, color)
                if place is not None:
                    _on_map(record, area, number, color, place)
            page = rr.TextDocument(_summary(title, drawn), media_type='text/markdown')
            record.log('summary', page, static=True)
            record.flush()
        finally:
            record.disconnect()


def _reach(areas: Sequence[Area]) -> float:
    return max(float(np.linalg.norm(area.ends, axis=1).max()) for area in areas)


def _rings(record: rr.RecordingStream, areas: Sequence[Area]) -> None:
    """Draw distances from the origin."""
    reach = _reach(areas)
    step = nice_step(reach / 4)
    radii = np.arange(1, int(reach / step) + 2) * step
    turn = np.linspace(0, 2 * np.pi, RING_POINTS)
    circle = np.column_stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)])
    record.log('world', rr.ViewCoordinates.FRD, static=True)
    rings = rr.LineStrips3D(
        [radius * circle for radius in radii],
        colors=[RING_COLOR],
        radii=rr.Radius.ui_points(0.8),
    )
    record.log('world/rings', rings, static=True)
    words = rr.Points3D(
        [(radius, 0.0, 0.0) for radius in radii],
        labels=[f'{radius / 1000:g} km' for radius in radii],
        colors=[RING_COLOR],
        radii=rr.Radius.ui_points(1.0),
        show_labels=True,
    )
    record.log('world/rings/words', words, static=True)


def _area(record: rr.RecordingStream, area: Area, number: int, color: list[int]) -> None:
    entity = f'world/areas/{number}'
    n = len(area.ends)
    # just over one another, or two would fight for the same pixels
    up = np.full((n, 1), -1e-3 * number * float(np.abs(area.ends).max()))
    corners = np.column_stack([area.ends, up])
    middle = corners.mean(axis=0)
    fan = [(n, i, (i + 1) % n) for i in range(n)]
    fill = rr.Mesh3D(
        vertex_positions=np.vstack([corners, middle]),
        triangle_indices=fan,
        vertex_colors=[color] * (n + 1),
        albedo_factor=[255, 255, 255, FILL],
    )
    record.log(f'{entity}/fill', fill, static=True)
    edge = rr.LineStrips3D(
        [np.vstack([corners, corners[:1]])],
        colors=[color],
        radii=rr.Radius.ui_points(2.0),
        labels=[area.label] if area.label else None,
    )
    record.log(f'{entity}/edge', edge, static=True)
    if area.flights:
        paths = rr.LineStrips3D(
            list(area.flights[:MAX_FLIGHTS]), colors=[color], radii=rr.Radius.ui_points(0.9)
        )
        record.log(f'{entity}/flights', paths, static=True)


def _on_map(
    record: rr.RecordingStream, area: Area, number: int, color: list[int], place: GeodeticPoint
) -> None:
    around = np.vstack([area.ends, area.ends[:1]])
    entity = f'map/areas/{number}'
    edge = rr.GeoLineStrings(
        lat_lon=[_lat_lon(around, place)], colors=[color], radii=rr.Radius.ui_points(2.5)
    )
    record.log(f'{entity}/edge', edge, static=True)
    if area.flights:
        paths = rr.GeoLineStrings(
            lat_lon=[_lat_lon(path[:, :2], place) for path in area.flights[:MAX_FLIGHTS]],
            colors=[color],
            radii=rr.Radius.ui_points(0.9),
        )
        record.log(f'{entity}/flights', paths, static=True)


def _lat_lon(north_east: Array, place: GeodeticPoint) -> Array:
    x, y = north_east.T
    lat, lon, _ = geodetic_from_ned(x, y, np.zeros_like(x), place)
    return np.column_stack([lat, lon])


def _summary(title: str, areas: Sequence[Area]) -> str:
    lines = [f'# {title or "Footprint"}', '', '| flights | end | area | farthest |']
    lines.append('|---|---|---|---|')
    for area in areas:
        far = float(np.linalg.norm(area.ends, axis=1).max())
        lines.append(
            f'| {area.label or "all"} | {len(area.ends)} | {area.size / 1e6:.1f} km² '
            f'| {far / 1e3:.2f} km |'
        )
    return '\n'.join(lines)


def _blueprint(areas: Sequence[Area], place: GeodeticPoint | None) -> rrb.Blueprint:
    reach = _reach(areas)
    middle = np.vstack([area.ends for area in areas]).mean(axis=0)
    far = 1.1 * reach / np.tan(FIELD_OF_VIEW / 2)
    # seen from the south and above, north up
    eye = rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=(middle[0] - 0.6 * far, middle[1], -0.8 * far),
        look_target=(middle[0], middle[1], 0.0),
    )
    scene: rrb.View | rrb.Container = rrb.Spatial3DView(
        origin='/world', name='Reach', background=SKY, line_grid=False, eye_controls=eye
    )
    notes: rrb.View | rrb.Container = rrb.TextDocumentView(origin='/summary', name='Summary')
    if place is not None:
        corners = np.vstack([_lat_lon(area.ends, place) for area in areas])
        zoom = map_zoom(corners, width=420, height=420)
        chart = rrb.MapView(origin='/map', name='Map', zoom=zoom)
        notes = rrb.Vertical(chart, notes, row_shares=[4, 1])
    return rrb.Blueprint(
        rrb.Horizontal(scene, notes, column_shares=[3, 2]),
        rrb.TimePanel(state='hidden'),
        rrb.BlueprintPanel(state='hidden'),
        rrb.SelectionPanel(state='hidden'),
        auto_views=False,
    )
