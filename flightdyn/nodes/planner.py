"""`ros2 run flightdyn planner`: plans trajectories on request."""

import sys

from .entry import run


def main() -> None:
    sys.exit(run('planner', 'planner_node', 'PlannerNode', 'Plans trajectories on request.'))


if __name__ == '__main__':
    main()
