"""The document of what the nodes offer against the running nodes."""

import subprocess
import sys

from ros_support import ROOT, need_ros

need_ros()


def test_contract_is_what_the_nodes_offer(ros: None) -> None:
    command = [sys.executable, str(ROOT / 'tools/node_contract'), '--check']
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
