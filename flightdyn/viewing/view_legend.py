"""The legend of a path's colours: a strip with its range, in a view of its own."""

import numpy as np

from ..errors import MissingExtraError
from .coloring import Coloring, color_map

try:
    import rerun as rr
except ImportError as error:
    raise MissingExtraError('a Rerun recording', 'view') from error

WIDTH, HEIGHT = 512, 14  # px


def log_legend(rec: rr.RecordingStream, coloring: Coloring) -> None:
    """Log a strip from the least to the greatest colour, with figures below it."""
    row = color_map(np.linspace(0, 1, WIDTH))
    rec.log('legend/strip', rr.Image(np.repeat(row[None], HEIGHT, axis=0)), static=True)
    shares = np.linspace(0, 1, 5)
    span = coloring.high - coloring.low
    values = [coloring.low + s * span for s in shares]
    # what is nothing beside the range is 0, not 1e-11
    figures = [f'{v:.3g}' if abs(v) > 1e-3 * span else '0' for v in values]
    figures[2] = f'{coloring.name} {figures[2]} {coloring.unit}'
    ticks = rr.Points2D(
        np.column_stack([shares * WIDTH, np.full(5, HEIGHT)]),
        labels=figures,
        show_labels=True,
        colors=[[200, 205, 210]],
        radii=rr.Radius.ui_points(1.5),
    )
    rec.log('legend/figures', ticks, static=True)
