"""Takes the steps of docs/walkthroughs.md and draws their pictures: ``python -m docs.make_walkthroughs``."""

from __future__ import annotations

import re
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from controller.base.mailboxes import Mailbox
from controller.base.parameters import PARAMETERS as P
from controller.base.parameters import Floats
from controller.base.paths import find_config
from controller.body.body import Body
from controller.face.face import head_indices
from controller.face.overlays import Overlays
from controller.face.point_editing import PointEditor
from controller.face.skin_model import Screen, SkinModels
from controller.panels.session.own_expressions import save_expression
from controller.robot.anchors import anchor_places
from controller.robot.robot import load_robot
from controller.stage.stage import load_stage
from controller.vocabulary.vocabulary import Vocabulary
from docs.window_steps import take
from surface.head import Head
from surface.view.pictures.offscreen import Offscreen
from surface.view.scene.camera import Camera
from surface.view.scene.framing import framed

PAGE, PICTURES = Path(__file__).with_name("walkthroughs.md"), Path(__file__).parent / "pictures"
SIZE = (480, 480)
WINDOW, CLOSE = (972, 547), (580, 160, 1040, 620)
PULLS = (((28.6, -34.0, 102.0), (10.0, -16.0)), ((-44.0, 56.0, 97.0), (0.0, -14.0)))
"""Points of the skin (mm) and how far the mouse drags each, pixels."""
_LONGEST_S = 60.0


def draw(head: Head, values: Floats) -> Image.Image:
    """The face ``values`` (P,) from the front."""
    with Offscreen(head, SIZE, quality="full") as screen:
        screen.draw(np.append(values, 0.0)[head_indices(P, head.parameters)], framed(Camera.front(), head))
        return Image.fromarray(screen.read())


def new_expression(folder: Path) -> tuple[Floats, Image.Image]:
    """Pull the face, save it as ``glee`` in ``folder``, and read it back; its weights (P,) and a picture."""
    place = find_config("heads", "ict")
    head = Head.load(place)
    editor, values = PointEditor(head, SkinModels(lambda: Head.load(place), P)), P.neutral()
    editor.prepare()
    screen = Screen(framed(Camera.front(), head), SIZE)
    for at, by in PULLS:
        x, y, _ = screen.project(np.array([at]))[0].tolist()
        editor.take((x, y), screen, values)
        while not editor.ready:
            time.sleep(0.05)
        for share in np.linspace(0.1, 1.0, 10):
            moved = editor.drag((x + share * by[0], y + share * by[1]), screen, values)
            values[list(moved)] = list(moved.values())
        editor.release()
    save_expression(folder / "mine.toml", "glee", values, Vocabulary.load(P), P)
    weights = Vocabulary.load(P, more=[folder / "mine.toml"])["glee"].weights
    return weights, beside([draw(head, P.neutral()), draw(head, weights)])


def smirk(folder: Path) -> tuple[dict[str, Any], Image.Image]:
    """Pull one corner of the mouth in a window and save it without typing; its report, and the window."""
    report = take("smirk", folder)
    return report, Image.open(folder / "saved.png").convert("RGB").resize(WINDOW, Image.Resampling.LANCZOS)


def wrinkle(folder: Path) -> tuple[dict[str, Any], Image.Image]:
    """Draw a fold in a window and save it as a slider; its report, and the window with the face before and after."""
    report = take("wrinkle", folder)
    before, drawn, slider = (
        Image.open(folder / f"{name}.png").convert("RGB") for name in ("before", "drawn", "slider")
    )
    close = [each.crop(CLOSE).resize(SIZE, Image.Resampling.LANCZOS) for each in (before, slider)]
    window = drawn.resize((WINDOW[0], WINDOW[1]), Image.Resampling.LANCZOS)
    row = beside(close)
    out = Image.new("RGB", (max(window.width, row.width), window.height + row.height + 12), "#888")
    out.paste(window, (0, 0))
    out.paste(row, (0, window.height + 12))
    return report, out


def servo_head(folder: Path) -> tuple[dict[str, float], Image.Image]:
    """Write the page's robot and a stage, smile with the left side, and return how far the servos turned, degrees."""
    text = re.search(r"```toml\n# smiler.toml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert text is not None
    (folder / "smiler.toml").write_text(text[1], encoding="utf-8")
    (folder / "stage.toml").write_text('name = "smiler"\nrobots = ["smiler.toml"]\n', encoding="utf-8")
    stage, smile = load_stage(str(folder / "stage.toml"), P), P.index("mouthSmileLeft")
    with Mailbox.create(len(P)) as mailbox:
        body = Body(stage, P, mailbox)
        body.start()
        try:
            body.begin()
            before = angles(body)
            body.state.set_parameters([smile], [0.8], time.monotonic_ns())
            end_s, now = time.monotonic() + _LONGEST_S, before
            while now["cornerLeft"] - before["cornerLeft"] < 5.0 and time.monotonic() < end_s:
                time.sleep(0.05)
                now = angles(body)
        finally:
            body.stop()
    return {name: now[name] - before[name] for name in now}, anchored(folder / "smiler.toml", smile)


def angles(body: Body) -> dict[str, float]:
    """The measured angle of every servo, degrees."""
    records = body.state.servo_records()
    return {str(each["name"]): float(each.get("measured_deg") or 0.0) for each in records}


def anchored(robot: Path, smile: int) -> Image.Image:
    """A smile with the robot's anchors on it."""
    head, values = Head.load(find_config("heads", "ict")), P.neutral()
    values[smile] = 0.8
    picture = draw(head, values)
    overlays = Overlays(head, anchor_places(load_robot(robot, P), head, "face"))
    overlays.pose(np.append(values, 0.0)[head_indices(P, head.parameters)])
    marks, pen = overlays.marks("anchors"), ImageDraw.Draw(picture)
    for i, (x, y, _) in enumerate(Screen(framed(Camera.front(), head), SIZE).project(marks.points).tolist()):
        pen.ellipse((x - 4, y - 4, x + 4, y + 4), fill="#f07040", outline="white")
        pen.text((x + 8, y - 6), marks.labels[i], fill="white")
    return picture


def phone(folder: Path) -> Image.Image:
    """Tap an expression on a phone's panel, then STOP; both screens. Raises SystemExit: there is no Chromium."""
    from tests.browser import find_chromium, page  # the tests' browser
    from tests.test_web_panel import open_panel, robot

    chromium = find_chromium()
    if chromium is None:
        raise SystemExit("no Chromium here; Debian, Ubuntu: sudo apt-get install chromium")
    with robot(folder, Head.load(find_config("heads", "ict"))) as (body, _, where), page(chromium) as browser:
        open_panel(browser, where, 390, 720)
        browser.evaluate("document.querySelector('[data-name=happiness]').click()")
        until(lambda: body.newest()[0][P.index("mouthSmileLeft")] > 0.4)
        drawn = browser.evaluate("omote.face.frames")
        browser.wait(f"omote.face.frames > {drawn + 2}", _LONGEST_S)
        browser.screenshot(folder / "tapped.png")
        browser.evaluate("document.getElementById('tab-servos').click()")
        figures = "document.querySelector('#servo-list .servo').textContent"
        assert "away" in browser.evaluate(figures), "what a servo measures is there as soon as the tab is open"
        browser.evaluate("document.getElementById('stop').click()")
        until(lambda: not any(loop.bus.running for loop in body.buses))
        browser.wait("document.getElementById('stopped').textContent.includes('Servos are off')", _LONGEST_S)
        browser.wait(f"{figures}.includes('motor off')", _LONGEST_S)
        browser.screenshot(folder / "stopped.png")
    return beside([Image.open(folder / name).convert("RGB") for name in ("tapped.png", "stopped.png")])


def until(true: object) -> None:
    """Wait until a function is true."""
    end_s = time.monotonic() + _LONGEST_S
    while not true():  # type: ignore[operator]
        assert time.monotonic() < end_s, "waited in vain"
        time.sleep(0.02)


def beside(pictures: list[Image.Image]) -> Image.Image:
    """Pictures of one height in a row."""
    out = Image.new("RGB", (sum(each.width + 12 for each in pictures) - 12, pictures[0].height), "#888")
    at = 0
    for each in pictures:
        out.paste(each, (at, 0))
        at += each.width + 12
    return out


def main() -> None:
    """Write the pictures of the page."""
    made = {
        "expression": lambda f: new_expression(f)[1],
        "smirk": lambda f: smirk(f)[1], "wrinkle": lambda f: wrinkle(f)[1],
        "anchors": lambda f: servo_head(f)[1], "phone": phone,
    }  # fmt: skip
    for name in sys.argv[1:] or made:
        with tempfile.TemporaryDirectory() as folder:
            made[name](Path(folder)).save(PICTURES / f"walkthrough-{name}.webp", quality=82)


if __name__ == "__main__":
    main()
