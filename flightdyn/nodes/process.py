"""Starting nodes as processes of their own; no ROS.

with NodeProcess('planner', max_wall_time=20.0) as planner:
    ...
"""

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import Any

from ..errors import FlightdynError


class NodeProcess:
    """A running node; leaving the context ends it.

    It has a process group of its own: a Ctrl-C in the terminal does not reach it, its owner ends
    it, and whatever it may have started with it.

    Parameters
    ----------
    name : str
        planner, sim or replay.
    command : sequence of str, optional
        What to start. Default: the module of this Python.
    namespace : str, optional
    env : mapping, optional
        Changes to the environment; None removes a variable.
    **parameters
        Of the node.
    """

    def __init__(
        self,
        name: str,
        *,
        command: Sequence[str] | None = None,
        namespace: str = '',
        env: Mapping[str, str | None] | None = None,
        **parameters: Any,
    ) -> None:
        self.name = name
        arguments = list(command or (sys.executable, '-m', f'flightdyn.nodes.{name}'))
        arguments += ['--ros-args']
        if namespace:
            arguments += ['-r', f'__ns:={namespace}']
        for key, value in parameters.items():
            arguments += ['-p', f'{key}:={json.dumps(value)}']
        changed = {**os.environ, **(env or {})}
        self._log = tempfile.TemporaryFile()  # noqa: SIM115 (lives as long as the process)
        self.process = subprocess.Popen(
            arguments,
            stdin=subprocess.DEVNULL,
            stdout=self._log,
            stderr=subprocess.STDOUT,
            env={key: value for key, value in changed.items() if value is not None},
            start_new_session=True,
        )

    def __enter__(self) -> 'NodeProcess':
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.stop()

    @property
    def output(self) -> str:
        """All that the node wrote so far."""
        # a separate read position: the child writes through a descriptor that shares ours
        return os.pread(self._log.fileno(), 10**7, 0).decode('utf-8', 'replace')

    def check(self) -> None:
        """Raise if the node has ended.

        Raises
        ------
        FlightdynError
            With what it wrote last.
        """
        code = self.process.poll()
        if code is not None:
            last = self.output.strip().splitlines()[-5:]
            raise FlightdynError(f'{self.name} ended with {code}: {" | ".join(last)}')

    def stop(self, number: int = signal.SIGINT, timeout: float = 5.0) -> int:
        """Send a signal, and after the timeout SIGKILL; return the exit code."""
        if self.process.poll() is None:
            os.killpg(self.process.pid, number)
        try:
            return self.process.wait(timeout)
        except subprocess.TimeoutExpired:
            return self.kill()

    def kill(self) -> int:
        """End the process and its group at once; return the exit code."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        return self.process.wait()
