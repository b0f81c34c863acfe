"""Calls list_problems again and again until its input closes; prints how long answers took.

A process of its own: in the one that plays the clients an answer would wait for their threads.
"""

import json
import sys
import threading
import time

from flightdyn.nodes.client import Session
from flightdyn_msgs.srv import ListProblems

PERIOD_S = 0.02


def main() -> None:
    over = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), over.set()), daemon=True).start()
    took: list[float] = []
    with Session('asking') as session:
        session.call(ListProblems, '/planner/list_problems')
        print('asking', flush=True)
        while not over.wait(PERIOD_S):
            began = time.monotonic()
            session.call(ListProblems, '/planner/list_problems')
            took.append(time.monotonic() - began)
    print(json.dumps(took))


if __name__ == '__main__':
    main()
