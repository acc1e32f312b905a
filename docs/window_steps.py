"""Steps of docs/walkthroughs.md that are taken in a real window, with mouse and keys:
``xvfb-run -a -s "-screen 0 1280x720x24" python -m docs.window_steps STEPS FOLDER``.

Writes pictures of the window, and a report of what happened, ``report.json``, to the folder.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tests.hands import Hands, Steps

CORNER, SMILE = (28.6, -34.0, 102.0), (22.0, -26.0)
"""The left corner of the mouth (mm), and how far it is pulled, pixels."""
FOLD = ((21.0, -4.0, 108.0), (30.0, -13.0, 101.0), (36.0, -25.0, 95.0), (38.0, -38.0, 90.0))
"""Where the fold from the nose to beside the mouth is drawn, mm."""
DISPLAY = (1280, 720)
LONGEST_S = 300.0


def smirk(hands: Hands) -> Steps:
    """Pull one corner of the mouth and save the face, without typing."""
    yield from ready(hands)
    yield from hands.tap(hands.imgui.Key.n)
    hands.began_s = hands.began()
    x, y = hands.pixel(CORNER)
    yield from hands.draw([(x, y), (x + SMILE[0], y + SMILE[1])])
    yield from hands.until(lambda: arrived(hands), "the pulled face")
    yield from hands.tab("Faces")
    yield from hands.grab("smirk")
    yield from hands.click("save##word")
    hands.report |= {"seconds": hands.seconds(), "message": hands.face._panel.saving.message}
    yield from hands.frames(4)
    yield from hands.grab("saved")


def wrinkle(hands: Hands) -> Steps:
    """Draw a fold on both sides of the face, take it back, do it again, and save it as a slider."""
    yield from ready(hands)
    yield from hands.grab("before")
    first = skin(hands)
    hands.began_s = hands.began()
    yield from hands.tab("Sculpt")
    yield from hands.click("wrinkle")
    yield from hands.until(lambda: hands.face._mouse.editor.ready, "points of the face")
    yield from hands.click("both sides of the face")
    yield from hands.draw([hands.pixel(place) for place in FOLD])
    yield from hands.until(lambda: shown(hands), "the added control points")
    yield from hands.frames(10)
    yield from hands.grab("drawn")
    drawn = skin(hands)
    hands.report |= {"points": len(hands.face._panel.commands.now.light[0]), "deepest_mm": deepest(first, drawn)}
    paused_s = hands.began()  # taking it back and doing it again is no part of making it
    yield from with_ctrl(hands, "z")
    yield from hands.until(lambda: shown(hands) and not hands.face._mouse.editor.light, "the face without them")
    hands.report["undone to the bit"] = same(first, skin(hands))
    yield from with_ctrl(hands, "y")
    yield from hands.until(lambda: shown(hands) and bool(hands.face._mouse.editor.light), "them again")
    hands.report["redone to the bit"] = same(drawn, skin(hands))
    hands.began_s += hands.began() - paused_s
    yield from hands.tab("Faces")
    yield from hands.click("##kind")
    yield from hands.click("group##kind")
    yield from hands.click("save##word")
    hands.report |= {"seconds": hands.seconds(), "message": hands.face._panel.saving.message}
    yield from hands.until(lambda: hands.report["windows"] == 2, "the window with the slider")
    name = hands.face._panel.commands.now.held
    yield from hands.until(lambda: all(hands.face._values.full[i] > 0.99 for i in name), "the fold")
    hands.report["slider"] = [hands.face._panel._options.parameters.names[i] for i in name]
    yield from hands.frames(20)
    yield from hands.tab("Sliders")
    hands.face._panel.sliders._search = "fold"
    yield from hands.grab("slider")


STEPS: dict[str, Callable[[Hands], Steps]] = {"smirk": smirk, "wrinkle": wrinkle}


def ready(hands: Hands) -> Steps:
    """Wait for the first pictures."""
    yield from hands.frames(10)


def arrived(hands: Hands) -> bool:
    """Whether a pull has been carried out, and the face is where it is held."""
    held, values = hands.face._panel.commands.now.held, hands.face._values.full
    still = all(abs(values[i] - value) < 0.01 for i, value in held.items())
    return bool(held) and still and not hands.face._mouse.editor.dragging


def with_ctrl(hands: Hands, key: str) -> Steps:
    """A key with Ctrl."""
    yield from hands.key(hands.imgui.Key.mod_ctrl, down=True)
    yield from hands.tap(getattr(hands.imgui.Key, key))
    yield from hands.key(hands.imgui.Key.mod_ctrl, down=False)


def shown(hands: Hands) -> bool:
    """Whether the window shows the head with the points that are set."""
    light = hands.face._panel.commands.now.light
    return hands.face._mouse.editor.light == light and not hands.face._panel.jobs.running


def skin(hands: Hands) -> np.ndarray:
    """(m, 3) the vertices of the face at rest."""
    head = hands.face._head
    head.pose(np.zeros(len(head.parameters)))
    vertices: np.ndarray = head.part("face").vertices.copy()
    return vertices


def same(one: np.ndarray, two: np.ndarray) -> bool:
    """Whether two faces are the same to the bit."""
    return one.tobytes() == two.tobytes()


def deepest(before: np.ndarray, after: np.ndarray) -> float:
    """How far the farthest vertex that both have has moved, mm."""
    moved: np.ndarray = np.linalg.norm(after[: len(before)] - before, axis=1)
    return float(moved.max())


def take(steps: str, folder: Path) -> dict[str, Any]:
    """Take steps in a window on a virtual display; returns what they report. Raises SystemExit: there is no display."""
    if shutil.which("xvfb-run") is None:
        raise SystemExit("no virtual display here; Debian, Ubuntu: sudo apt-get install xvfb")
    screen = f"-screen 0 {DISPLAY[0]}x{DISPLAY[1]}x24"
    command = ["xvfb-run", "-a", "-s", screen, sys.executable, "-m", "docs.window_steps", steps, str(folder)]
    root = Path(__file__).parent.parent
    path = os.pathsep.join([str(root), os.environ.get("PYTHONPATH", "")])
    environment = os.environ | {"LIBGL_ALWAYS_SOFTWARE": "1", "PYTHONPATH": path, "OMOTE_STATE": str(folder / "state")}
    done = subprocess.run(command, cwd=root, env=environment, capture_output=True, text=True, timeout=LONGEST_S + 60)
    if done.returncode:
        raise RuntimeError(f"{steps}: {done.stdout[-2000:]}{done.stderr[-2000:]}")
    report: dict[str, Any] = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    return report


def main() -> None:
    """Take the steps of the command line."""
    steps, folder = sys.argv[1], Path(sys.argv[2])
    os.chdir(folder)
    hands = Hands(folder)
    try:
        hands.run(STEPS[steps], ["edit", "demo", "--seconds", f"{LONGEST_S:g}"])
    finally:
        (folder / "report.json").write_text(json.dumps(hands.report), encoding="utf-8")


if __name__ == "__main__":
    main()
