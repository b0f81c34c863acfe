"""Figures of studies: what is drawn where, with units."""

import numpy as np
import pytest

pytest.importorskip('matplotlib')

from flights import flip, soaring

from flightdyn.errors import InputError
from flightdyn.viewing import figures


def test_a_polar_marks_its_best_ratio():
    alpha = np.linspace(-5, 15, 201)
    lift = 0.2 + 0.1 * alpha
    polar = {'alpha': alpha, 'CL': lift, 'CD': 0.02 + 0.05 * lift**2}
    draggy = {**polar, 'CD': polar['CD'] + 0.02}
    figure = figures.polar_figure({'clean': polar, 'draggy': draggy})
    assert [ax.get_ylabel() for ax in figure.axes] == ['CL [-]', 'CD [-]', 'CL/CD [-]']
    assert {ax.get_xlabel() for ax in figure.axes} == {'alpha [deg]'}
    ratio = figure.axes[2]
    marks = [line.get_xydata()[0] for line in ratio.lines if line.get_marker() == 'o']
    # closed form: CL = sqrt(CD0 / k), ratio 1 / (2 sqrt(CD0 k)); alpha in steps of 0.1 deg
    for mark, zero in zip(marks, (0.02, 0.04), strict=True):
        best = (np.sqrt(zero / 0.05) - 0.2) / 0.1
        np.testing.assert_allclose(mark[0], best, atol=0.05 + 1e-9)
        np.testing.assert_allclose(mark[1], 0.5 / np.sqrt(zero * 0.05), rtol=1e-4)
    with pytest.raises(InputError, match='no polar of odd: it lacks CD'):
        figures.polar_figure({'odd': {'alpha': alpha, 'CL': lift}})


def test_tracks_and_altitudes_of_several_flights():
    figure = figures.tracks_figure({'there': soaring(), 'flip': flip()})
    track, high = figure.axes
    assert (track.get_xlabel(), track.get_ylabel()) == ('y_e, east [m]', 'x_e, north [m]')
    assert (high.get_xlabel(), high.get_ylabel()) == ('time [s]', 'altitude [m]')
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ['there', 'flip']
    tracks = [line for line in track.lines if len(line.get_xdata()) > 1]
    assert len(tracks) == 3  # two stretches and one
