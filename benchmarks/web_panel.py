"""How fast a browser without a graphics processor draws the panel's face, beside omote's own renderer, and how soon a
STOP switches the torque off: ``python -m benchmarks.web_panel``.

The face is the shipped head with hair, at 1280 x 720 and device pixel ratio 1; every frame moves a quarter of all
parameters, chest and pupils. Run it with nothing else on the machine. Needs Chromium and the extras view and web.
"""

from __future__ import annotations

import json
import multiprocessing
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
from websockets.sync.client import connect

from controller.base.parameters import PARAMETERS
from controller.body.body import Body
from controller.face.still import Still, for_head
from controller.layers.commands import CommandState
from controller.links.kind import LinkContext
from controller.links.links import open_links, read_link
from drivers.base.shutdown import Closers
from surface.export.glb_web import web_glb
from surface.head import Head
from surface.view.pictures.offscreen import Offscreen
from surface.view.scene.camera import Camera
from surface.view.scene.framing import framed
from tests.browser import Page, find_chromium, page
from tests.test_web_panel import flood_panel, open_panel, robot

SIZE, FRAMES = (1280, 720), 40
TRIES = 10
"""Stops of each kind."""
ROUNDS = 3
"""The quickest counts: what else the machine does can only slow one down."""
LONGEST_S = 300.0
"""For one answer of the browser: it draws forty frames before it answers, and others may use the processor."""
DRAW = """(() => {
  const { face, robot } = omote, gl = face.renderer.getContext(), pixel = new Uint8Array(4), n = %d;
  const began = performance.now();
  for (let i = 0; i < n; i++) {
    const swing = (k) => 0.3 * Math.sin(0.3 * i + k);
    const move = (name, k) => name.startsWith("head") ? swing(0) * 2 / 3 : k %% 4 ? 0 : 0.3 + swing(k);
    face.pose(robot.names, robot.names.map(move));
    face.live?.([1.5 + 1.5 * Math.sin(0.1 * i), 0.05 * Math.sin(0.2 * i)]);
    face.changed = true;
    face.draw();
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
  }
  return 1000 * n / (performance.now() - began);
})()"""


def values(i: int) -> np.ndarray:
    """The same parameters as the page's."""
    row = PARAMETERS.neutral()
    for k, name in enumerate(PARAMETERS.names):
        if name.startswith("head"):
            row[k] = 0.2 * np.sin(0.3 * i)
        elif k % 4 == 0:
            row[k] = 0.3 + 0.3 * np.sin(0.3 * i + k)
    return row


def _chromium() -> str:
    found = find_chromium()
    if found is None:
        raise SystemExit("no Chromium here; Debian, Ubuntu: sudo apt-get install chromium")
    return found


def browser_fps(face: Path) -> float:
    """Frames a second of the panel's face in Chromium's SwiftShader."""
    chromium = _chromium()
    closers = Closers()
    table = {"kind": "web", "listen": "127.0.0.1:0", "face": str(face)}
    try:
        (link,) = open_links([read_link(table)], LinkContext(CommandState(PARAMETERS), closers))
        with page(chromium) as browser:
            browser.resize(*SIZE)
            browser.open(f"http://127.0.0.1:{link.port}/")  # type: ignore[attr-defined]
            say("the browser loads the face")
            browser.wait("Boolean(globalThis.omote && omote.face.head && omote.robot.names.length)", LONGEST_S)
            browser.evaluate("document.getElementById('stage').style.cssText = 'position:fixed;inset:0;z-index:9'")
            time.sleep(1.0)
            say("the browser draws")
            browser.evaluate(DRAW % 5, LONGEST_S)
            return max(float(browser.evaluate(DRAW % FRAMES, LONGEST_S)) for _ in range(ROUNDS))
    finally:
        with suppress(Exception):
            closers.close()


def own_fps(still: Still) -> float:
    """Frames a second of omote's own renderer, live, in the same size and poses."""
    head = still.load_head()
    with Offscreen(head, SIZE, quality="full", theme=still.look.make_theme()) as screen:
        screen.go_live()
        camera = framed(still.look.make_camera(), head, worn=still.look.dressed)
        for i in range(5):
            screen.draw(for_head(values(i), head.parameters), camera)
        return max(_round(screen, head, camera) for _ in range(ROUNDS))


def _round(screen: Offscreen, head: Head, camera: Camera) -> float:
    began = time.monotonic()
    for i in range(FRAMES):
        screen.draw(for_head(values(i), head.parameters), camera)
    return FRAMES / (time.monotonic() - began)


def say(what: str) -> None:
    """What is being done, for who waits: each takes seconds, and a minute and more beside other programs."""
    sys.stderr.write(f"{what}\n")
    sys.stderr.flush()


def stop_ms(folder: Path, *, flooded: bool, browser: Page | None = None) -> float:
    """The longest time from a STOP to the torque of all 24 simulated servos off, of some tries.

    browser : whose button is pressed; without it a program's message.
    """
    took = []
    with robot(folder) as (body, _, where), _hand(where, browser) as press:
        processes = multiprocessing.get_context("spawn")  # a client is another program
        ending = processes.Event()
        flood = processes.Process(target=flood_panel, args=(where, ending))
        if flooded:
            flood.start()
        for _ in range(TRIES):
            time.sleep(0.5)
            began = time.monotonic()
            press("stop")
            _until(lambda: not any(loop.bus.running for loop in body.buses))
            took.append(time.monotonic() - began)
            _until(lambda: _started(press, body))
        ending.set()
        if flooded:
            flood.join()
    return round(1000 * max(took), 1)


@contextmanager
def _hand(where: str, browser: Page | None) -> Iterator[Callable[[str], object]]:
    """What presses ``stop`` and ``start``: a button in a browser, or a program that sends messages."""
    if browser is None:
        with connect(f"ws://{where}/ws") as client:
            yield lambda what: client.send(json.dumps({"type": what}))
        return
    open_panel(browser, where, 390, 844)
    yield lambda what: browser.evaluate(f"document.getElementById('{what}').click()")


def _started(press: Callable[[str], object], body: Body) -> bool:
    if all(loop.bus.running for loop in body.buses):
        return True
    press("start")
    time.sleep(0.3)
    return False


def _until(true: Callable[[], bool]) -> None:
    end = time.monotonic() + LONGEST_S
    while not true():
        if time.monotonic() > end:
            raise SystemExit("the servos did not stop, or did not start again")
        time.sleep(0.001)


def main() -> None:
    """Print frames a second of both, and how long a stop takes (ms), also while another client floods."""
    with tempfile.TemporaryDirectory() as folder:
        say("servos are stopped and started")
        stops = {f"stop_ms{end}": stop_ms(Path(folder), flooded=bool(end)) for end in ("", "_flooded")}
        say("a button in the browser stops them")
        with page(_chromium()) as browser:
            for end in ("", "_flooded"):
                stops[f"browser_stop_ms{end}"] = stop_ms(Path(folder), flooded=bool(end), browser=browser)
    still = Still.parse([], [], look={"person": "maple"})
    with tempfile.TemporaryDirectory() as folder:
        face = Path(folder) / "face.glb"
        say("the face is made")
        face.write_bytes(web_glb(still.load_head()))
        found = {**stops, "browser_fps": round(browser_fps(face), 1)}
        say("omote draws")
        found["omote_fps"] = round(own_fps(still), 1)
    sys.stdout.write(json.dumps(found) + "\n")


if __name__ == "__main__":
    main()
