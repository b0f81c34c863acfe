"""Pictures and animations of recordings, drawn by a viewer without a window."""

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..errors import FlightdynError, InputError, MissingExtraError
from ..files import written_whole

try:
    from rerun.experimental import ViewerClient
except ImportError as error:
    raise MissingExtraError('a picture of a recording', 'view') from error

SIZE = (1600, 1000)  # px
PATIENCE = 60.0  # s, for the viewer to start and to load
STATIC = 20  # looks at a recording without a timeline, after which none is expected
STILL = 0.25  # s between two pictures that must be the same: axes ease, chunks load on demand
MAX_FRAMES = 600


def rerun_program() -> Path:
    """Return the viewer's program, which is installed beside this Python.

    Raises
    ------
    InputError
        If it is not there.
    """
    for folder in (Path(sys.executable).parent, *map(Path, os.get_exec_path())):
        program = folder / 'rerun'
        if program.is_file() and os.access(program, os.X_OK):
            return program
    raise InputError("no program 'rerun' beside this Python: pip install 'flightdyn[view]'")


def save_shot(
    recordings: Sequence[str | Path],
    path: str | Path,
    *,
    at: float | None = None,
    view: str | None = None,
    size: tuple[int, int] = SIZE,
) -> None:
    """Write a picture (.png) of what recordings open as.

    Parameters
    ----------
    recordings : paths of .rrd files
    path : path of the .png file; it appears whole or not at all
    at : float
        Seconds from the start of the timeline; its start unless given.
    view : str
        Only the view with this name, such as 'Overview', without the bars of the window.
    size : (width, height) [px]
        Of the window.

    Raises
    ------
    InputError
        If there is no such view, the time is beyond the flight, or nothing can draw here.
    FlightdynError
        If the viewer fails.
    """
    with _headless(recordings, size) as client:
        shown = _show(client, view)
        line = _timeline(client)
        if line is not None:
            _set_time(client, line, at or 0.0)
        elif at:
            raise InputError(f'time {at:g} s: nothing in the recording changes over time')
        picture = _still(client, shown)
    with written_whole(path) as temporary:
        temporary.write_bytes(picture)


def save_animation(
    recordings: Sequence[str | Path],
    path: str | Path,
    *,
    seconds: float = 4.0,
    rate: float = 10.0,
    view: str | None = None,
    size: tuple[int, int] = (960, 600),
) -> None:
    """Write an animation (.webp) of a whole flight.

    Parameters
    ----------
    seconds : float
        How long it plays.
    rate : float
        Frames a second.
    Others as `save_shot`.

    Raises
    ------
    InputError
        As `save_shot`; or if there would be more than 600 frames.
    MissingExtraError
        If Pillow is not installed.
    """
    try:
        from PIL import Image
    except ImportError:
        raise MissingExtraError('an animation', 'view') from None
    from io import BytesIO

    count = round(seconds * rate)
    if not 2 <= count <= MAX_FRAMES:
        raise InputError(f'an animation has 2 to {MAX_FRAMES} frames, not {count}')
    with _headless(recordings, size) as client:
        shown = _show(client, view)
        line = _timeline(client)
        if line is None:
            raise InputError('nothing in the recording changes over time: draw a picture of it')
        frames = []
        for number in range(count):
            _set_time(client, line, _duration(line) * number / (count - 1))
            picture = _still(client, shown) if number == 0 else client.take_screenshot(shown)
            frames.append(Image.open(BytesIO(picture)).convert('RGB'))
    with written_whole(path) as temporary:
        frames[0].save(
            temporary,
            'WEBP',
            save_all=True,
            append_images=frames[1:],
            duration=round(1000 / rate),
            loop=0,
            quality=75,
            method=4,
        )


@contextmanager
def _headless(recordings: Sequence[str | Path], size: tuple[int, int]) -> Iterator[ViewerClient]:
    """Run a viewer without a window that has loaded some recordings."""
    files = [Path(each).absolute() for each in recordings]
    for file in files:
        if not file.is_file():
            raise InputError(f'no file {file}')
    with tempfile.TemporaryDirectory(prefix='flightdyn-view-') as home:
        log = Path(home, 'log')
        port = free_port()
        with log.open('wb') as output:
            process = subprocess.Popen(
                [
                    *(str(rerun_program()), '--headless', '--hide-welcome-screen'),
                    *('--window-size', f'{size[0]}x{size[1]}'),
                    *('--bind', '127.0.0.1', '--port', str(port)),
                    *map(str, files),
                ],
                env=viewer_environment(home),
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
            )
        with ending(process):
            yield _loaded(process, f'rerun+http://127.0.0.1:{port}/proxy', log)


@contextmanager
def ending(process: subprocess.Popen[bytes]) -> Iterator[None]:
    """End a process however the block ends, by SIGTERM, too: nobody else would end a viewer."""
    handles = threading.current_thread() is threading.main_thread()
    if handles:
        previous = signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))
    try:
        yield
    finally:
        end(process)
        if handles:
            signal.signal(signal.SIGTERM, previous)


def end(process: subprocess.Popen[bytes]) -> None:
    """End a process that leads a session, and all that it started."""
    for how in (signal.SIGTERM, signal.SIGKILL):
        try:
            os.killpg(process.pid, how)
        except ProcessLookupError:
            break
        try:
            process.wait(3)
            break
        except subprocess.TimeoutExpired:
            continue


def viewer_environment(home: str | Path) -> dict[str, str]:
    """Return the environment of a viewer that neither reads nor writes the user's settings.

    It sends no usage data; a window apart, it draws by Vulkan, in software if need be.
    """
    settings = Path(home, '.config', 'rerun')
    settings.mkdir(parents=True, exist_ok=True)
    off = {'analytics_enabled': False, 'analytics_id': '0' * 32, 'metadata': {}}
    (settings / 'analytics.json').write_text(json.dumps(off))
    defaults = {'RUST_LOG': 'error', 'WGPU_BACKEND': 'vulkan'}
    own = {'HOME': str(home), 'XDG_RUNTIME_DIR': str(home), 'RERUN_APP_ONLY': 'true'}
    own['XDG_CONFIG_HOME'] = str(settings.parent)
    return {**defaults, **os.environ, **own}


def free_port() -> int:
    """Return a port of this machine that nothing listens on."""
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        return int(probe.getsockname()[1])


def _loaded(process: 'subprocess.Popen[bytes]', url: str, log: Path) -> ViewerClient:
    """Return a connection to the viewer once it has loaded everything."""
    deadline = time.monotonic() + PATIENCE
    client, looks = None, 0
    while time.monotonic() < deadline:
        if process.poll() is not None:
            raise _failure(log)
        try:
            client = client or ViewerClient.connect(url)
            state = client.get_state()
        except (ConnectionError, RuntimeError):
            time.sleep(0.05)
            continue
        recording = _active(state)
        if not state.loading and recording is not None and state.views:
            looks += 1  # of what changes over time there is a timeline, once it is there
            if recording.timelines or looks > STATIC:
                return client
        time.sleep(0.05)
    raise FlightdynError(f'the viewer has not loaded the recording within {PATIENCE:g} s')


def _failure(log: Path) -> FlightdynError:
    said = log.read_text(errors='replace')
    if 'No graphics adapter' in said or 'Adapter' in said:
        return InputError(
            'nothing here can draw without a screen: install a Vulkan driver, such as '
            'Debian and Ubuntu have in mesa-vulkan-drivers'
        )
    lines = [line for line in said.splitlines() if line.strip()]
    return FlightdynError(f'the viewer ended: {" ".join(lines[-3:])[:400]}')


def _active(state: Any) -> Any:
    recordings = (r for r in state.recordings if r.store_id == state.active_recording)
    return next(recordings, None)


def _timeline(client: ViewerClient) -> Any:
    """Return the timeline that plays; None if nothing changes over time."""
    recording = _active(client.get_state())
    lines = (each for each in recording.timelines if each.name == recording.current_timeline)
    return next(lines, None)


def _duration(line: Any) -> float:
    return float(line.end - line.start) / 1e9


def _set_time(client: ViewerClient, line: Any, at: float) -> None:
    if not -1e-6 <= at <= _duration(line) + 1e-6:
        raise InputError(f'time {at:g} s is not within the recording, 0 to {_duration(line):g} s')
    seconds = line.start / 1e9 + at
    if str(line.time_type) == 'timestamp':
        client.set_time(line.name, play_state='paused', timestamp=seconds)
    else:
        client.set_time(line.name, play_state='paused', duration=seconds)


def _show(client: ViewerClient, name: str | None) -> Any:
    """Let one view fill the window; return its id, None for the whole window."""
    if name is None:
        return None
    views = client.get_state().views
    found = next((view for view in views if view.name == name), None)
    if found is None:
        known = ', '.join(dict.fromkeys(str(view.name) for view in views))
        raise InputError(f"no view '{name}' in the recording; it has {known}")
    blueprint = client.get_blueprint('recording').blueprint
    viewport = blueprint.setdefault('/viewport', {}).setdefault('ViewportBlueprint', {})
    viewport['maximized'] = found.view_id
    child = f'/view/{found.view_id}'
    while child:  # a view in a hidden tab is not painted: bring the tabs above it to the front
        parents = (
            key
            for key, value in blueprint.items()
            if child in value.get('ContainerBlueprint', {}).get('contents', [])
        )
        parent = next(parents, None)
        if parent and blueprint[parent]['ContainerBlueprint']['container_kind'] == 'Tabs':
            blueprint[parent]['ContainerBlueprint']['active_tab'] = child
        child = parent or ''
    client.set_blueprint(blueprint, 'recording')
    time.sleep(0.3)
    return found.view_id


def _still(client: ViewerClient, view: Any) -> bytes:
    """Return a picture once it no longer changes."""
    last, same = b'', 0
    deadline = time.monotonic() + 20
    while same < 2 and time.monotonic() < deadline:
        try:
            picture = bytes(client.take_screenshot(view))
        except ConnectionError as error:  # a view is known only once it has been painted
            if 'not found' not in str(error):
                raise
            time.sleep(STILL)
            continue
        same = same + 1 if picture == last else 0
        last = picture
        if same < 2:
            time.sleep(STILL)
    if not last:
        raise FlightdynError('the viewer has painted nothing')
    return last
