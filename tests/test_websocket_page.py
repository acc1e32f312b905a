"""examples/2_browser_page.html in a real Chromium, and examples/1_python_client.py, over a real link."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from controller.base.parameters import PARAMETERS as P
from tests.browser import find_chromium, page
from tests.controller.links.net.sockets import wait_for
from tests.controller.links.websocket.far import served, tick

CHROMIUM = find_chromium()
JAW = P.index("jawOpen")


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def site(root: Path) -> Iterator[str]:
    """The folder of examples, served as ``python -m http.server`` does."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(root / "examples")))
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()
    thread.join()


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here; Debian, Ubuntu: sudo apt-get install chromium")
def test_a_slider_of_the_page_moves_the_face_and_its_button_stops_the_servos(site: str) -> None:
    with served() as (state, link, url), page(CHROMIUM or "") as browser:
        browser.resize(390, 844)
        browser.open(f"{site}/2_browser_page.html?face={url}")
        browser.wait("document.getElementById('status').dataset.on === 'true'")
        assert browser.evaluate("document.querySelectorAll('input[type=range]').length") == len(P)
        assert browser.evaluate("document.documentElement.scrollWidth <= window.innerWidth"), "fits a phone"
        browser.evaluate("{const i = sliders.get('jawOpen').input; i.value = 0.6; i.oninput(); i.onchange();}")
        wait_for(lambda: state.mixer["manual"].values[JAW] == 0.6)
        tick(state)
        browser.wait("sliders.get('jawOpen').value.textContent === '0.60'")
        browser.evaluate("document.getElementById('stop').click()")
        wait_for(lambda: state.stop_latch.stopped is not None)
        browser.wait("document.getElementById('stop').textContent === 'START servos'")
        browser.evaluate("document.getElementById('stop').click()")
        wait_for(lambda: state.stop_latch.stopped is None)
        link.stop()
        browser.wait("document.getElementById('status').textContent.startsWith('not connected')")
        assert browser.errors == []


@pytest.mark.slow
def test_the_python_example_talks_to_a_face(root: Path) -> None:
    program = [sys.executable, str(root / "examples" / "1_python_client.py")]
    with served() as (state, _, url):
        done = subprocess.run([*program, url], capture_output=True, text=True, timeout=60, cwd=root, check=False)
        assert (done.returncode, done.stderr) == (0, "")
        assert len(done.stdout.splitlines()) == 15
        assert state.status()["gaze"] == "off", "it ended with neutral"
    lost = subprocess.run([*program, url], capture_output=True, text=True, timeout=60, cwd=root, check=False)
    assert lost.returncode == 1 and "no face there" in lost.stderr and "Traceback" not in lost.stderr
