"""Show recordings in Rerun's window or, served on this machine alone, in a browser."""

import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from ..errors import FlightdynError
from .shot import ending, free_port, rerun_program, viewer_environment

HOST = '127.0.0.1'


def open_window(recordings: Sequence[Path]) -> int:
    """Open a window, and return 0 when it is closed.

    Raises
    ------
    InputError
        If there is no viewer.
    FlightdynError
        If the viewer fails.
    """
    command = [str(rerun_program()), '--bind', HOST, '--port', 'auto', *map(str, recordings)]
    process = subprocess.Popen(command, start_new_session=True)
    with ending(process):
        code = process.wait()
    if code:
        raise FlightdynError(f'the viewer ended with {code}')
    return 0


def serve(recordings: Sequence[Path]) -> int:
    """Serve recordings to browsers on this machine until interrupted.

    Raises
    ------
    InputError
        If there is no viewer.
    FlightdynError
        If the server fails.
    """
    page, data = free_port(), free_port()
    command = [
        *(str(rerun_program()), '--serve-web', '--bind', HOST),
        *('--port', str(data), '--web-viewer-port', str(page)),
        *map(str, recordings),
    ]
    with tempfile.TemporaryDirectory(prefix='flightdyn-view-') as home:
        return _serve(command, viewer_environment(home), page, data)


def _serve(command: Sequence[str], environment: Mapping[str, str], page: int, data: int) -> int:
    process = subprocess.Popen(
        command,
        env=environment,
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    with ending(process):
        while process.poll() is None and not (_listens(page) and _listens(data)):
            time.sleep(0.05)
        if process.poll() is None:
            source = f'rerun%2Bhttp%3A%2F%2F{HOST}%3A{data}%2Fproxy'
            print(f'http://{HOST}:{page}/?url={source}', flush=True)
            print('flightdyn: serving until Ctrl-C', file=sys.stderr)
        code = process.wait()
    raise FlightdynError(f'the server ended with {code}')


def _listens(port: int) -> bool:
    try:
        socket.create_connection((HOST, port), 1).close()
    except OSError:
        return False
    return True
