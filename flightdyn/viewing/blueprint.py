"""How a recording opens in the Rerun viewer: which views, where, from which side."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import MissingExtraError
from .quantities import Group
from .scenery import Camera, nice_step

try:
    import rerun as rr
    import rerun.blueprint as rrb
except ImportError as error:
    raise MissingExtraError('a Rerun recording', 'view') from error

SKY = [22, 30, 42]
MAX_PLOT_ROWS = 6
STEADY = 1e-7  # of the largest value: what a solver leaves of a control that is at its limit


@dataclass(frozen=True, kw_only=True)
class Layout:
    """What the blueprint has to know of a recording.

    Parameters
    ----------
    duration : float
        Of the flight [s].
    groups : sequence of Group
        The plots that were recorded, most useful first.
    overview, chase : Camera
        The overview's in earth axes, the chase view's in forward, left, up of the heading.
    lanes : int
        How many lanes of states there are.
    vehicles : sequence of str
        Their entities below `/world`.
    legend : bool
        Whether the path's colours have a legend.
    map_zoom : float or None
        Zoom of the map; None if there is no map.
    """

    duration: float
    groups: Sequence[Group]
    overview: Camera
    chase: Camera
    lanes: int = 0
    vehicles: Sequence[str] = ('vehicle',)
    legend: bool = True
    map_zoom: float | None = None


def playback_speed(duration: float) -> float:
    """Return a round play rate: a second-long flip takes ten, an hour takes about one minute."""
    rate = duration / (10.0 * max(duration, 1e-3) ** 0.2)
    return 1.0 if 0.4 < rate < 2.5 else nice_step(rate)


def flight_blueprint(layout: Layout) -> rrb.Blueprint:
    """Return the blueprint: 3D views and map left, plots right, paused at the start."""
    everything = '+ /world/**'
    # Sizes of arrows fit the true vehicle: the overview's would be dots, or in its way.
    small = ['- /world/chase/**']
    small += [f'- /world/{v}/{part}/**' for v in layout.vehicles for part in ('body', 'arrows')]
    overview = rrb.Spatial3DView(
        origin='/world',
        name='Overview',
        contents=[everything, *small, '- /world/sigma/**'],
        background=SKY,
        line_grid=False,
        eye_controls=_eye(layout.overview),
    )
    # Ghosts and the curtain of every circle flown would stand in the way from close by.
    large = [f'- /world/{v}/enlarged/**' for v in layout.vehicles]
    large += [f'- /world/{layout.vehicles[0]}/marker/**']
    hidden = [*large, '- /world/ghosts/**', '- /world/curtain/**', '- /world/uncertainty/**']
    chase = rrb.Spatial3DView(
        origin='/world/chase',
        name='Chase',
        contents=[everything, *hidden],
        background=SKY,
        line_grid=False,
        eye_controls=_eye(layout.chase),
    )
    legend = rrb.Spatial2DView(
        origin='/legend',
        name='Colours of the path',
        background=[13, 16, 17],
        titlebar=False,
        visual_bounds=rrb.VisualBounds2D(x_range=[-50, 562], y_range=[-4, 34]),
    )
    events = rrb.TextLogView(origin='/events', name='Events')
    summary = rrb.TextDocumentView(origin='/summary', name='Summary')
    if layout.map_zoom is None:
        lower = rrb.Horizontal(events, summary, column_shares=[3, 2])
    else:
        # The zoom is given: left to itself the viewer may fit the map before its data arrive.
        chart = rrb.MapView(origin='/map', name='Map', zoom=layout.map_zoom)
        notes = rrb.Tabs(events, summary, active_tab=0)
        lower = rrb.Horizontal(chart, notes, column_shares=[1, 1])
    whole = rrb.Vertical(overview, legend, row_shares=[11, 1]) if layout.legend else overview
    scene = rrb.Horizontal(whole, chase, column_shares=[3, 2])
    left = rrb.Vertical(scene, lower, row_shares=[5, 2])
    plots = _plots(layout.groups, layout.lanes)
    return rrb.Blueprint(
        rrb.Horizontal(left, plots, column_shares=[5, 2]) if layout.groups else left,
        rrb.TimePanel(
            state='collapsed',
            timeline='flight_time',
            play_state='paused',
            playback_speed=playback_speed(layout.duration),
            loop_mode='all',
        ),
        rrb.BlueprintPanel(state='hidden'),
        rrb.SelectionPanel(state='hidden'),
        auto_views=False,
    )


def live_blueprint(
    *,
    vehicle: str | None,
    chase_distance: float,
    overview: Camera | None,
    plots: Mapping[str, str],
    iterating: bool,
) -> rrb.Blueprint:
    """Return the blueprint of what comes in live: it follows the newest data.

    Parameters
    ----------
    vehicle : str or None
        The one to chase, if any has been seen.
    chase_distance : float
        Size of that vehicle [m].
    overview : Camera or None
        From where a whole path is seen; without one the overview follows the vehicle.
    plots : mapping of key to title
    iterating : bool
        Whether there are a solver's iterations to watch.
    """
    # pieces of trail since the start stay; all else is as it is now
    trail = rrb.VisibleTimeRange(
        'flight_time',
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    eye = _eye(overview) if overview else rrb.EyeControls3D(tracking_entity=f'/world/{vehicle}')
    scenes: list[rrb.View] = [
        rrb.Spatial3DView(
            origin='/world',
            name='Overview',
            background=SKY,
            eye_controls=eye,
            time_ranges=[trail],
        )
    ]
    if vehicle is not None:
        d = chase_distance
        scenes.append(
            rrb.Spatial3DView(
                origin=f'/world/chase/{vehicle}',
                name='Chase',
                contents=['+ /world/**', f'- /world/{vehicle}/marker'],
                background=SKY,
                eye_controls=_eye(Camera((-1.9 * d, 0.9 * d, 0.8 * d), (0.0, 0.0, 0.0))),
                time_ranges=[trail],
            )
        )
    recent = rr.TimeRange(
        start=rr.TimeRangeBoundary.cursor_relative(seconds=-60),
        end=rr.TimeRangeBoundary.cursor_relative(seconds=0),
    )
    views: list[rrb.View] = [
        rrb.TimeSeriesView(
            origin=f'/plots/{key}', name=title, axis_x=rrb.TimeAxis(view_range=recent)
        )
        for key, title in list(plots.items())[:MAX_PLOT_ROWS]
    ]
    if iterating:
        views.append(rrb.Spatial2DView(origin='/histories', name='The iterate over time'))
        views.append(rrb.TimeSeriesView(origin='/iterations', name='Duration of the iterate [s]'))
    views.append(rrb.TextLogView(origin='/events', name='Events'))
    shares = [2.5 if view.origin == '/histories' else 1.0 for view in views]
    side = rrb.Vertical(*views, row_shares=shares)
    return rrb.Blueprint(
        rrb.Horizontal(rrb.Vertical(*scenes), side, column_shares=[2, 1]),
        rrb.TimePanel(
            state='collapsed',
            timeline='flight_time' if vehicle is not None or not iterating else 'iteration',
            play_state='following',
        ),
        rrb.BlueprintPanel(state='hidden'),
        rrb.SelectionPanel(state='hidden'),
        auto_views=False,
    )


def _eye(camera: Camera) -> rrb.EyeControls3D:
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital, position=camera.position, look_target=camera.target
    )


def _plots(groups: Sequence[Group], lanes: int) -> rrb.Container:
    views: list[rrb.View | rrb.Container] = [_plot(group) for group in groups]
    keep = MAX_PLOT_ROWS if len(views) <= MAX_PLOT_ROWS else MAX_PLOT_ROWS - 1
    if len(views) > keep:
        views = [*views[:keep], rrb.Tabs(*views[keep:], active_tab=0)]
    shares = [3.0] * len(views)
    if lanes:
        lane = rrb.StateTimelineView(
            origin='/lanes', name='Phases', time_view=rrb.TimeAxis(view_range=_whole_flight())
        )
        views.append(lane)
        shares.append(1.2 + 0.9 * lanes)
    return rrb.Vertical(*views, row_shares=shares)


def _whole_flight() -> rr.TimeRange:
    return rr.TimeRange(start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.infinite())


def _plot(group: Group) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin=f'/plots/{group.key}',
        name=group.title,
        axis_x=rrb.TimeAxis(view_range=_whole_flight()),
        axis_y=rrb.ScalarAxis(range=_value_range(group)),
        plot_legend=rrb.PlotLegend(corner=_free_corner(group)),
    )


def _value_range(group: Group) -> tuple[float, float]:
    """Return the axis range: the values and some air, so that no line runs along the frame.

    Bands count but for their widest twentieth: at rest nothing is known of an angle, and a band
    of +-100 degrees then would press the flight itself into a line.
    """
    low, high = np.inf, -np.inf
    for s in group.series:
        low, high = min(low, float(s.values.min())), max(high, float(s.values.max()))
        if s.std is not None:
            low = min(low, float(np.quantile(s.values - s.std, 0.05)))
            high = max(high, float(np.quantile(s.values + s.std, 0.95)))
    largest = max(abs(low), abs(high))
    # what differs by so little is constant: enlarged, it would look like noise
    steady = high - low < STEADY * largest
    air = 0.08 * (high - low) if high > low and not steady else max(0.05 * largest, 0.05)
    return low - air, high + air


def _free_corner(group: Group) -> rrb.Corner2D:
    """Return the corner of the plot with the fewest values behind the legend."""
    low, high = _value_range(group)
    crowd = {}
    for right in (True, False):
        for top in (True, False):
            count = 0
            for series in group.series:
                n = series.values.size
                part = series.values[int(0.7 * n) :] if right else series.values[: int(0.3 * n)]
                level = (part - low) / (high - low)
                count += int((level > 0.6).sum() if top else (level < 0.4).sum())
            crowd[right, top] = count
    corners = {
        (True, True): rrb.Corner2D.RightTop,
        (False, True): rrb.Corner2D.LeftTop,
        (True, False): rrb.Corner2D.RightBottom,
        (False, False): rrb.Corner2D.LeftBottom,
    }
    return corners[min(crowd, key=lambda corner: crowd[corner])]
