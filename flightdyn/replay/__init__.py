"""Replay: from a log's positions and velocities to smooth motion, and a clock to play it by."""

from .player import Player as Player
from .reconstruct import reconstruct as reconstruct
from .report import Replay as Replay
from .report import replay_log as replay_log
from .smoother import Smoothed as Smoothed
from .smoother import smooth as smooth
