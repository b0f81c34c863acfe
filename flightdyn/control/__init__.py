"""Following a planned trajectory: feed-forward of its controls and a time-varying LQR."""

from .lqr import Weights as Weights
from .tracker import Tracker as Tracker
from .tracker import track as track
