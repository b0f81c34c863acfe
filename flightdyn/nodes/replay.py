"""`ros2 run flightdyn replay`: plays the motion in a flight log."""

import sys

from .entry import run


def main() -> None:
    sys.exit(run('replay', 'replay_node', 'ReplayNode', 'Plays the motion in a flight log.'))


if __name__ == '__main__':
    main()
