"""`ros2 run flightdyn sim`: flies plans in simulated time."""

import sys

from .entry import run


def main() -> None:
    sys.exit(run('sim', 'sim_node', 'SimNode', 'Flies plans and commands in simulated time.'))


if __name__ == '__main__':
    main()
