"""The web panel in a real Chromium, over a real body with simulated servos: from a finger to the bus."""

from __future__ import annotations

import base64
import json
import multiprocessing
import shutil
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing import synchronize
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from controller.base.mailboxes import Mailbox
from controller.base.parameters import PARAMETERS as P
from controller.body.body import Body
from controller.body.multi_head import MultiHeadBody
from controller.stage.stage import load_stage
from surface.export.glb_web import web_glb
from surface.head import Head
from surface.head.model.parameters import NAMES, SHAPES, read_pose
from surface.head.posing.dressing import WornMesh
from surface.view.pictures.offscreen import Offscreen
from surface.view.scene.camera import Camera
from surface.view.scene.theme import THEMES
from tests.browser import Page, find_chromium, page
from tests.controller.links.net.sockets import wait_for
from tests.surface.cards import card, picture
from tests.surface.small_head import small_head

CHROMIUM = find_chromium()
JAW = P.index("jawOpen")
WIDER = """[...document.querySelectorAll('body *')].filter(each => each.offsetParent && each.tagName !== 'CANVAS'
  && each.scrollWidth > each.clientWidth + 1 && getComputedStyle(each).overflowX !== 'visible')
  .map(each => each.tagName + ' ' + each.id + ': ' + each.textContent.slice(0, 40))"""
"""What holds more than it shows."""
MARKS = """[['.wanted', 'x'], ['.measured', 'x1']].map(([name, key]) =>
  Number(document.querySelector('#servo-list ' + name).getAttribute(key)))"""
"""Left edge of the mark of what the first servo shall do, and where it is, in hundredths of its limits."""
needs_chromium = pytest.mark.skipif(
    CHROMIUM is None, reason="no Chromium here; Debian, Ubuntu: sudo apt-get install chromium"
)


@contextmanager
def robot(tmp_path: Path, head: Head | None = None) -> Iterator[tuple[Body, Any, str]]:
    """A body with 24 simulated servos and a panel, the panel's link and its address; a small head without ``head``."""
    (tmp_path / "face.glb").write_bytes(web_glb(head or Head(small_head())))
    path = tmp_path / "stage.toml"
    path.write_text(
        'name = "panel"\nrobots = ["head24"]\n[[links]]\nkind = "web"\nlisten = "127.0.0.1:0"\nface = "face.glb"\n'
    )
    with Mailbox.create(len(P)) as mailbox:
        body = Body(load_stage(str(path), P), P, mailbox)
        body.start()
        try:
            body.begin()
            link = body.links[0]._link
            yield body, link, f"127.0.0.1:{link.port}"  # type: ignore[union-attr]
        finally:
            body.stop()


@contextmanager
def choir(tmp_path: Path) -> Iterator[tuple[MultiHeadBody, str]]:
    """Two heads behind one panel, and its address."""
    (tmp_path / "face.glb").write_bytes(web_glb(Head(small_head())))
    path = tmp_path / "choir.toml"
    path.write_text(
        'name = "choir"\n[[links]]\nkind = "web"\nlisten = "127.0.0.1:0"\nface = "face.glb"\n'
        '[[heads]]\nname = "maple"\n[[heads]]\nname = "oak"\n'
    )
    with Mailbox.create(len(P)) as one, Mailbox.create(len(P)) as two:
        several = MultiHeadBody(load_stage(str(path), P), P, [one, two])
        several.start()
        try:
            several.begin()
            yield several, f"127.0.0.1:{several.bodies[0].links[0]._link.port}"  # type: ignore[union-attr]
        finally:
            several.stop()


def moved(body: Body, name: str) -> float:
    """The measured angle of a servo, degrees."""
    return float(next(each for each in body.state.servo_records() if each["name"] == name)["measured_deg"] or 0.0)


def open_panel(browser: Page, where: str, width: int, height: int) -> None:
    browser.resize(width, height)
    browser.open(f"http://{where}/")
    browser.wait("Boolean(globalThis.omote && omote.robot.good && omote.face.head && omote.face.frames > 0)", 90.0)
    assert browser.evaluate("document.documentElement.scrollWidth <= window.innerWidth"), "fits its width"


def box_of(browser: Page, name: str) -> list[float]:
    """Left, top, right and bottom of an element, in pixels of the page."""
    box = f"document.getElementById('{name}').getBoundingClientRect()"
    found: list[float] = browser.evaluate(f"(({{left, top, right, bottom}}) => [left, top, right, bottom])({box})")
    return found


def axe() -> str | None:
    """The text of axe-core; None where node or the package is absent."""
    node = shutil.which("node")
    if node is None:
        return None
    found = subprocess.run([node, "-p", "require.resolve('axe-core/axe.min.js')"], capture_output=True, text=True)
    return Path(found.stdout.strip()).read_text(encoding="utf-8") if found.returncode == 0 else None


def slide(browser: Page, name: str, value: float) -> None:
    browser.evaluate(
        f"{{const i = document.getElementById('p-{name}'); i.value = {value}; i.dispatchEvent(new Event('input'));}}"
    )


@pytest.mark.slow
@needs_chromium
@pytest.mark.parametrize(("width", "height"), [(390, 844), (1280, 720)])
def test_nothing_is_cut_or_needs_scrolling_sideways(tmp_path: Path, width: int, height: int) -> None:
    with robot(tmp_path) as (_, _, where), page(CHROMIUM or "") as browser:
        open_panel(browser, where, width, height)
        for tab in ("express", "sliders", "shows", "servos", "links"):
            browser.evaluate(f"document.getElementById('tab-{tab}').click()")
            if tab == "servos":  # at once, and the mark of what is wanted around the line of what is measured
                assert "away" in browser.evaluate("document.querySelector('#servo-list .servo').textContent")
                wanted, measured = browser.evaluate(MARKS)
                assert wanted == pytest.approx(measured - 1.0, abs=0.2)
            if tab == "links":
                browser.wait("document.querySelectorAll('#link-list td').length > 0")
            assert browser.evaluate(WIDER) == [], tab
        broken = browser.evaluate(
            "[...document.querySelectorAll('#link-list :is(th, td)')].filter(each => each.clientHeight > 40).length"
        )
        assert broken == 0  # an address on two lines


@needs_chromium
def test_accessories_are_drawn_with_their_texture_and_blended_with_their_opacity(tmp_path: Path) -> None:
    green, glass = card((-20.0, 0.0), (20.0, 20.0), z=80.0, kind="hair", texture=picture((20, 160, 20))), card(
        (-20.0, -30.0), (20.0, -10.0), z=80.0, kind="glasses", texture=b"", colour=(0.0, 0.0, 1.0, 0.5), alpha="BLEND",
    )  # fmt: skip
    head = Head(small_head())
    head.accessories = tuple(WornMesh(one, head.data.neck) for one in (green, glass))
    with robot(tmp_path, head) as (_, _, where), page(CHROMIUM or "") as browser:
        open_panel(browser, where, 1280, 720)
        browser.screenshot(tmp_path / "seen.png")
        assert browser.errors == []
    with Image.open(tmp_path / "seen.png") as image:
        red, green_light, blue = np.moveaxis(np.asarray(image.convert("RGB")).astype(int)[60:620, :700], 2, 0)
    assert ((green_light > 80) & (np.maximum(red, blue) < 0.6 * green_light)).sum() > 500
    assert ((blue > red + 30) & (blue > green_light + 20) & (red > 20)).sum() > 500  # some of what is behind it


def drawn_alone(browser: Page, life: tuple[float, float], at: str, away: float) -> np.ndarray:
    """The page's picture with a breath (mm) and pupils (share), (height, width, 4) uint8, from straight in front of a
    place of the page, metres; alpha is 0 around the head."""
    browser.evaluate(f"""(() => {{
      const {{ face }} = omote, gl = face.renderer.getContext(), w = gl.drawingBufferWidth, h = gl.drawingBufferHeight;
      for (const name of ["live", "pose"]) face[name] = () => {{}};  // what the robot sends is not shown
      Object.getPrototypeOf(face).live.call(face, {json.dumps(life)});
      face.target.copy({at});
      Object.assign(face.turn, {{ yaw: 0, pitch: 0, reach: 1 }});
      face.size = 2 * Math.tan(face.camera.fov * Math.PI / 360) * {away};
      face.changed = true;
      face.draw();
      const pixels = new Uint8Array(4 * w * h);
      gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
      globalThis.seen = {{ w, h, eye: face.camera.position.toArray(), target: face.target.toArray(),
        pixels: btoa(Array.from(pixels, (each) => String.fromCharCode(each)).join("")) }};
    }})()""")
    width, height, pixels = browser.evaluate("[seen.w, seen.h, seen.pixels]")
    return np.frombuffer(base64.b64decode(pixels), np.uint8).reshape(height, width, 4)[::-1]


def drawn_by_omote(head: Head, life: tuple[float, float], browser: Page) -> np.ndarray:
    """The same by omote's own renderer, as the page was drawn last."""
    width, height, eye, target, fov_deg = browser.evaluate(
        "[seen.w, seen.h, seen.eye, seen.target, omote.face.camera.fov]"
    )
    camera = Camera(tuple(1000.0 * np.array(eye)), tuple(1000.0 * np.array(target)), fov_deg)
    green = replace(THEMES["skin"], background_top=(0.0, 1.0, 0.0), background_bottom=(0.0, 1.0, 0.0))
    with Offscreen(head, (width, height), theme=green) as screen:
        head.live(*life)
        picture = screen.render(np.zeros(len(head.parameters)), camera)
        head.live(0.0, 0.0)
    around = picture[..., 1] > 100.0 + picture[..., [0, 2]].max(axis=2)
    return np.dstack([picture, np.where(around, 0, 255).astype(np.uint8)])


@pytest.mark.slow
@needs_chromium
def test_a_breath_and_pupils_are_as_large_as_in_omotes_own_picture(root: Path, tmp_path: Path) -> None:
    head = Head.load(root / "configs" / "heads" / "ict")
    with robot(tmp_path, head) as (_, _, where), page(CHROMIUM or "") as browser:
        open_panel(browser, where, 1280, 720)
        centre, eye = "face.target", json.dumps(dict(zip("xyz", (0.001 * head.data.eyes[0]).tolist(), strict=True)))
        tops, holes = [], []
        for life in ((0.0, 0.0), (3.0, 0.0)):
            page_, own = drawn_alone(browser, life, centre, 0.7), drawn_by_omote(head, life, browser)
            tops.append([shoulders(each) for each in (page_, own)])
        for life in ((0.0, -0.2), (0.0, 0.25)):
            page_, own = drawn_alone(browser, life, eye, 0.25), drawn_by_omote(head, life, browser)
            holes.append([dark(each) for each in (page_, own)])
        assert browser.errors == []
    rises = np.subtract(tops[0], tops[1])
    assert rises[1] > 2.0 and rises[0] == pytest.approx(rises[1], rel=0.1), rises
    wider = np.sqrt(np.divide(holes[1], holes[0]))
    np.testing.assert_allclose(wider, 1.25 / 0.8, rtol=0.1)


def shoulders(picture: np.ndarray) -> float:
    """Mean row of the highest pixel of the bust, in columns beside the head."""
    middle = picture.shape[1] // 2
    columns = picture[:, [*range(middle - 240, middle - 180), *range(middle + 180, middle + 240)], 3] > 0
    return float(columns.argmax(axis=0)[columns.any(axis=0)].mean())


def dark(picture: np.ndarray) -> int:
    """Pixels of a pupil in the middle of a picture."""
    height, width = picture.shape[:2]
    middle = picture[height // 2 - 24 : height // 2 + 24, width // 2 - 24 : width // 2 + 24, :3].astype(int)
    return int((middle.sum(axis=2) < 90).sum())


@needs_chromium
def test_the_panel_breathes_as_the_robot_does(tmp_path: Path) -> None:
    with robot(tmp_path) as (body, _, where), page(CHROMIUM or "") as browser:
        open_panel(browser, where, 1280, 720)
        body.state.live(1.0, 1)
        browser.evaluate(
            "import('/shaders.js').then(({ shared }) => { Object.assign(globalThis, { shared, most: 0 }); "
            "omote.robot.on('frame', () => { most = Math.max(most, shared.lungs.value); }); })"
        )
        browser.wait("shared.lungs.value > 2 && Math.abs(shared.wider.value) > 0.01")
        body.state.live(0.0, 2)
        browser.wait("shared.lungs.value === 0 && shared.wider.value === 0")
        assert browser.evaluate("most") <= 3.0 and browser.errors == []


@needs_chromium
def test_a_phone_drives_the_head_and_stops_it_while_another_client_floods(tmp_path: Path) -> None:
    with robot(tmp_path) as (body, link, where), page(CHROMIUM or "") as browser:
        open_panel(browser, where, 390, 844)
        before = moved(body, "jawOpen")
        slide(browser, "jawOpen", 0.8)
        wait_for(lambda: body.state.held().get(JAW) == 0.8)
        wait_for(lambda: abs(moved(body, "jawOpen") - before) > 3.0)
        browser.wait("document.querySelector('#p-jawOpen').closest('.row').classList.contains('held')")
        ending = threading.Event()
        flood = threading.Thread(target=flood_panel, args=(where, ending))
        flood.start()
        try:
            pressed = box_of(browser, "stop")
            browser.evaluate("document.getElementById('stop').click()")
            wait_for(lambda: body.state.stop_latch.stopped is not None)
            wait_for(lambda: not any(loop.bus.running for loop in body.buses))
            browser.wait("document.getElementById('stopped').textContent.includes('Servos are off')")
            for width, height in ((1280, 720), (390, 844)):  # who presses again where STOP was presses STOP
                browser.resize(width, height)
                stop, start = box_of(browser, "stop"), box_of(browser, "start")
                assert start[2] <= stop[0] and start[1] < height and stop[2] <= width
            assert stop == pytest.approx(pressed, abs=1.0)
        finally:
            ending.set()
            flood.join()
        browser.evaluate("document.getElementById('start').click()")
        wait_for(lambda: body.state.stop_latch.stopped is None)
        link.stop()
        browser.wait("document.getElementById('link').dataset.state === 'lost'")
        assert browser.errors == []


@pytest.mark.slow
@needs_chromium
def test_a_pressed_stop_switches_torque_off_within_200_ms_also_under_a_flood(tmp_path: Path) -> None:
    with robot(tmp_path) as (body, _, where), page(CHROMIUM or "") as browser:
        open_panel(browser, where, 390, 844)
        browser.wait("document.getElementById('stop').getBoundingClientRect().bottom <= innerHeight")  # no scrolling
        box = browser.evaluate("(({x, y, width, height}) => [x + width / 2, y + height / 2])"
                               "(document.getElementById('stop').getBoundingClientRect())")  # fmt: skip
        processes = multiprocessing.get_context("spawn")  # a client is another program
        ending = processes.Event()
        flood = processes.Process(target=flood_panel, args=(where, ending))
        took = []
        for flooded in (False, True):
            if flooded:
                flood.start()
                wait_for(lambda: body.state.held().get(P.index("browInnerUp")) is not None)
            took.append(min(press_stop(browser, body, box) for _ in range(5)))  # the quickest: others use the processor
        ending.set()
        flood.join()
        assert max(took) < 0.2, took


def press_stop(browser: Page, body: Body, at: list[float]) -> float:
    """Seconds from a finger on the button, which is not lifted before, to no torque on the bus; then starts again."""
    finger = {"x": at[0], "y": at[1], "button": "left", "clickCount": 1}
    began = time.monotonic()
    browser.call("Input.dispatchMouseEvent", type="mousePressed", **finger)
    while any(loop.bus.running for loop in body.buses):
        assert time.monotonic() - began < 20.0, "pressed, and the servos go on"
        time.sleep(0.001)
    took = time.monotonic() - began
    browser.call("Input.dispatchMouseEvent", type="mouseReleased", **finger)
    browser.wait("!document.getElementById('start').hidden")
    browser.evaluate("document.getElementById('start').click()")
    wait_for(lambda: all(loop.bus.running for loop in body.buses))
    return took


def flood_panel(where: str, ending: threading.Event | synchronize.Event) -> None:
    """Send commands as fast as the panel takes them, until it ends them or ``ending``."""
    try:
        with connect(f"ws://{where}/ws") as client:
            while not ending.is_set():
                for _ in range(100):
                    client.send('{"type": "set", "parameters": {"browInnerUp": 0.1}}')
                ending.wait(0.01)
    except ConnectionClosed:
        pass


@pytest.mark.slow
@needs_chromium
def test_of_several_heads_one_is_chosen_and_a_stop_is_for_all(tmp_path: Path) -> None:
    with choir(tmp_path) as (several, where), page(CHROMIUM or "") as browser:
        open_panel(browser, where, 390, 844)
        first, second = (body.state for body in several.bodies)
        browser.evaluate("document.getElementById('tab-sliders').click()")
        browser.wait("[...document.getElementById('head').options].some((o) => o.value === 'oak')")
        # at once: before the slider has shown what it was moved to, whose place the other head's value takes
        browser.evaluate(
            "{const i = document.getElementById('p-jawOpen'), s = document.getElementById('head'); i.value = 0.4;"
            "i.dispatchEvent(new Event('input')); s.value = 'oak'; s.dispatchEvent(new Event('change'));}"
        )
        wait_for(lambda: first.held().get(JAW) == 0.4)
        browser.wait("Math.abs(document.getElementById('p-jawOpen').value) < 0.01")
        slide(browser, "jawOpen", 0.8)
        wait_for(lambda: second.held().get(JAW) == 0.8)
        assert first.held().get(JAW) == 0.4
        browser.evaluate("globalThis.heard = null; omote.robot.on('frame', (f) => { globalThis.heard = f.values; })")
        browser.wait("Boolean(heard) && heard[omote.robot.names.indexOf('jawOpen')] > 0.7")
        browser.evaluate("document.getElementById('stop').click()")
        wait_for(lambda: first.stop_latch.stopped is not None and second.stop_latch.stopped is not None)
        assert browser.errors == []


@pytest.mark.slow
@needs_chromium
def test_two_panels_show_each_others_changes_without_leaving_their_origin(tmp_path: Path) -> None:
    with robot(tmp_path) as (_, _, where), page(CHROMIUM or "") as browser:
        open_panel(browser, where, 1280, 720)
        with connect(f"ws://{where}/ws") as other:
            other.send('{"type": "expression", "name": "happiness", "intensity": 1.0}')
            browser.wait("document.querySelector('[data-name=happiness]').getAttribute('aria-pressed') === 'true'")
            other.send('{"type": "set", "parameters": {"mouthPucker": 0.5}}')
            browser.evaluate("document.getElementById('tab-sliders').click()")
            browser.wait("Math.abs(document.getElementById('p-mouthPucker').value - 0.5) < 0.01")
        browser.evaluate("document.getElementById('tab-servos').click()")
        browser.wait("document.querySelectorAll('.servo').length === 24")
        browser.evaluate("document.getElementById('tab-links').click()")
        browser.wait("document.querySelectorAll('#link-list td').length > 0")
        head = browser.evaluate("[...document.querySelectorAll('#link-list thead th')].map(each => each.textContent)")
        assert head == ["In", "Jitter", "Lost", "Age", "Refused"]
        # the port that is really bound, not the 0 of the stage
        assert browser.evaluate("document.querySelector('#link-list tbody th').textContent") == f"{where} · 1 connected"
        loaded = browser.evaluate("performance.getEntriesByType('resource').map(each => new URL(each.name).host)")
        assert loaded and set(loaded) == {where}
        open_panel(browser, where, 1280, 720)  # again: what the browser has is not sent again
        sent = browser.evaluate("performance.getEntriesByType('resource').map(each => [each.name, each.transferSize])")
        sizes = {name.rpartition("/")[2]: size for name, size in sent}
        assert 0 < sizes["face.glb"] < 2000 and sizes["three.min.js"] < 2000, sizes
        assert browser.errors == []


@needs_chromium
@pytest.mark.parametrize("scheme", ["dark", "light"])
@pytest.mark.parametrize("width", [390, 1280])
def test_axe_has_no_serious_findings(tmp_path: Path, width: int, scheme: str) -> None:
    script = axe()
    if script is None:
        pytest.skip("needs node and its package axe-core (npm install axe-core, NODE_PATH)")
    with robot(tmp_path) as (_, _, where), page(CHROMIUM or "") as browser:
        browser.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        open_panel(browser, where, width, 800)
        browser.evaluate(script + "; true")
        for name in ("express", "sliders", "shows", "servos", "links"):
            browser.evaluate(f"document.getElementById('tab-{name}').click()")
            found = browser.evaluate(
                "axe.run().then(r => r.violations.filter(v => ['serious', 'critical'].includes(v.impact))"
                ".map(v => v.id + ': ' + v.nodes[0].html))"
            )
            assert found == [], name


@pytest.mark.skipif(shutil.which("node") is None, reason="needs node")
def test_the_panel_reads_a_pose_as_omote_does(root: Path, tmp_path: Path) -> None:
    values = np.random.default_rng(3).uniform(0.0, 1.0, (50, len(NAMES)))
    values[:, len(SHAPES) :] = 2.0 * values[:, len(SHAPES) :] - 1.0
    (tmp_path / "pose.mjs").write_bytes((root / "controller/links/web/static/pose.js").read_bytes())
    program = (
        "import { readPose } from './pose.mjs'; import { readFileSync } from 'fs';"
        "const { names, values } = JSON.parse(readFileSync(0));"
        "console.log(JSON.stringify(values.map(row => readPose(names, row))));"
    )
    (tmp_path / "run.mjs").write_text(program)
    orders = json.dumps({"names": list(NAMES), "values": values.tolist()})
    done = subprocess.run(["node", "run.mjs"], input=orders, capture_output=True, text=True, cwd=tmp_path, check=True)
    for row, found in zip(values, json.loads(done.stdout), strict=True):
        wanted = read_pose(row)
        np.testing.assert_allclose([found["weights"][name] for name in SHAPES], wanted.shapes, atol=1e-9)
        np.testing.assert_allclose(found["eyes"], wanted.gaze, atol=1e-9)
        np.testing.assert_allclose(found["head"], wanted.head, atol=1e-9)


@pytest.mark.skipif(shutil.which("node") is None, reason="needs node")
@pytest.mark.parametrize(("shown", "apart"), [
    ({}, 0.0), ({"mouthSmileLeft": 1.0}, 0.0), ({"jawOpen": 0.5, "mouthClose": 0.5}, 0.0), ({"jawOpen": 0.4}, 16.0),
    ({"upLeft": 1.0, "upRight": 1.0}, 6.0), ({"upLeft": 1.0}, 4.0), ({"own": 0.5}, 3.0), ({"own": -1.0}, 2.0),
])  # fmt: skip
def test_lips_are_apart_by_what_shapes_do_to_them(
    root: Path, tmp_path: Path, shown: dict[str, float], apart: float
) -> None:
    lips = {"jawOpen": [20, 40, 20], "mouthClose": [-20, -40, -20], "upLeft": [0, 2, 4], "upRight": [4, 4, 0]}
    own = {"own": [0, 6, 0], "-own": [2, -6, 0]}
    (tmp_path / "pose.mjs").write_bytes((root / "controller/links/web/static/pose.js").read_bytes())
    given = f"{json.dumps(shown)}, {json.dumps({**lips, **own})}"
    (tmp_path / "run.mjs").write_text(f"import {{ lipsApart }} from './pose.mjs'; console.log(lipsApart({given}));")
    done = subprocess.run(["node", "run.mjs"], capture_output=True, text=True, cwd=tmp_path, check=True)
    assert float(done.stdout) == pytest.approx(apart)
