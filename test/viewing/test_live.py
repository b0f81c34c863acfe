"""What a live view sends, recorded by a Rerun server, and what it says when there is none."""

import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('rerun')
pytest.importorskip('pyarrow')

from flights import flip, soaring
from recordings import read, rows

from flightdyn.errors import InputError
from flightdyn.viewing.kinematics import motion_of
from flightdyn.viewing.live import LiveView

RERUN = Path(sys.executable).with_name('rerun')


def free_port():
    with socket.socket() as s:
        s.bind(('127.0.0.1', 0))
        return s.getsockname()[1]


@pytest.fixture
def recorder(tmp_path):
    """Yield a URL to send to, a function that gives what came in, and one to signal the server."""
    if not RERUN.exists():
        pytest.skip('no rerun beside this Python')
    port, path = free_port(), tmp_path / 'live.rrd'
    command = [RERUN, '--save', path, '--bind', '127.0.0.1', '--port', str(port)]
    # `rerun` is a script that runs the program itself: signals are for both
    server = subprocess.Popen(
        command,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )

    def send_signal(number):
        os.killpg(server.pid, number)

    def received():
        time.sleep(0.5)  # for what is on its way
        send_signal(signal.SIGINT)
        server.wait(10)
        return read(path)

    try:
        for _ in range(200):
            try:
                socket.create_connection(('127.0.0.1', port), 1).close()
                break
            except OSError:
                time.sleep(0.05)
        yield f'rerun+http://127.0.0.1:{port}/proxy', received, send_signal
    finally:
        with suppress(ProcessLookupError):
            send_signal(signal.SIGKILL)
        server.wait()


def feed(view, flight, name='glider'):
    for i in range(len(flight)):
        states, controls = (
            {k: float(v[i]) for k, v in group.items()}
            for group in (flight.states, flight.controls)
        )
        view.sample(flight.time[i], states, vehicle=name, controls=controls)


def test_samples_plans_and_iterations_arrive(recorder):
    url, received, _ = recorder
    flight = soaring(300, gap=False)
    with LiveView(url, name='a test') as view:
        view.trajectory(flight)
        feed(view, flight)
        for number in range(3):
            view.iteration(number, flip(20))
        view.sample(301.0, {'x_e': np.nan}, vehicle='glider')
    assert view.dropped == 1
    data = received()
    at = np.array(rows(data['/world/glider'], 'translation')).reshape(-1, 3)
    np.testing.assert_allclose(at, motion_of(flight).position, rtol=1e-6, atol=1e-3)  # float32
    np.testing.assert_allclose(np.array(data['/world/glider']['flight_time']) / 1e9, flight.time)
    trail = rows(data['/world/trail/glider'], 'strips')
    assert sum(len(strip[0]) for strip in trail) == len(flight) + len(trail) - 1
    assert len(rows(data['/world/plan'], 'strips')) == 1
    assert data['/world/iterate']['iteration'] == [0, 1, 2]
    histories = rows(data['/histories'], 'strips')
    assert len(histories) == 3
    # altitude is the first: from 0 to its highest and back, its range filled
    np.testing.assert_allclose(np.ptp(np.array(histories[0][0])[:, 1]), 1.0, atol=1e-6)
    np.testing.assert_allclose(np.ravel(rows(data['/iterations/final_time'], 'scalars')), 0.8)
    assert 'x_e is not a finite number' in rows(data['/events'], 'text')[0][0]
    assert rows(data['/__properties'], 'name') == [['a test']]
    bank = np.ravel(rows(data['/plots/angles/glider'], 'scalars')).reshape(-1, 2)[:, 1]
    np.testing.assert_allclose(bank, np.degrees(flight['bank']))


def test_sampling_and_closing_do_not_wait_for_a_stuck_viewer(recorder):
    url, _, send_signal = recorder
    flight = soaring(2000, gap=False)
    view = LiveView(url)
    send_signal(signal.SIGSTOP)
    began = time.thread_time()
    feed(view, flight)
    assert (time.thread_time() - began) / len(flight) < 2e-4  # s of this thread, a sample
    began = time.monotonic()
    view.close()
    assert time.monotonic() - began < 3.0  # 2 s as promised, and a busy machine


@pytest.mark.parametrize(
    'url', ['http://127.0.0.1:9876', '127.0.0.1:9876', 'rerun+http://127.0.0.1/proxy', '',
            'rerun+http://127.0.0.1:99999/proxy', 'rerun+http://127.0.0.1:9876']
)  # fmt: skip
def test_bad_urls_are_refused_with_a_good_one(url):
    with pytest.raises(InputError, match=r'expected such as rerun\+http://127.0.0.1:9876/proxy'):
        LiveView(url)


def test_nobody_there_is_said_at_once():
    began = time.monotonic()
    with pytest.raises(InputError, match=r'no viewer at .* refused'):
        LiveView(f'rerun+http://127.0.0.1:{free_port()}/proxy')
    assert time.monotonic() - began < 2.5


def test_what_does_not_answer_is_no_viewer():
    with socket.socket() as silent:
        silent.bind(('127.0.0.1', 0))
        silent.listen()
        with pytest.raises(InputError, match=r'no viewer at .* timed out'):
            LiveView(f'rerun+http://127.0.0.1:{silent.getsockname()[1]}/proxy')
