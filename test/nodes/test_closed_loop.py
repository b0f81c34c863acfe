"""Planner and sim in a closed loop, as processes."""

from pathlib import Path

import numpy as np
import pytest
from ros_support import need_ros

need_ros()

from flightdyn.nodes.closed_loop import Glide, fly_glide  # noqa: E402
from flightdyn.trajectory import Trajectory  # noqa: E402


def test_what_is_promised_is_compared_with_what_was_flown() -> None:
    plan = Trajectory(time=np.array([0.0, 9.0]), states={'x_e': np.array([0.0, 1000.0])})
    glide = Glide(985.0, plan, plan, np.array([1.0, 2.0, 4.5]))
    assert glide.longest_flown() == 2.5
    figures = {check.label: check for check in glide.checks()}
    assert figures['lost of it'].value == pytest.approx(1.5)
    assert figures['lost of it'].kept
    assert not figures['longest flown'].kept


@pytest.mark.slow
@pytest.mark.timeout(400)  # two minutes of flight, in real time
def test_the_glide_comes_near_the_longest_possible(ros: None, tmp_path: Path) -> None:
    """Promised: 98 % of the range of the plan that knows everything from the start."""
    recording = tmp_path / 'glide.mcap'
    glide = fly_glide(recording, 60.0, (-6.0, 0.0, 0.0), 1.0)
    for check in glide.checks():
        assert check.kept, f'{check.label}: {check.value}'
    assert glide.plan_starts.size > 50
