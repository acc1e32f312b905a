"""How smoothly the face follows a pointer that pulls it, and how near: ``python -m benchmarks.pulling``.

A real window of ``omote run`` on a virtual display, 1280 x 720 without ``--size``, drawn in software. The pointer takes
hold of a point of the face and moves a little each frame, as a hand does; then it rests. Each row says frames a second
while it moved, processor time a frame (of all threads; of the thread that draws), how far the point is from the pointer
at the end, and what a frame is made of, in milliseconds of the clock and of the thread that draws. Run it with nothing
else on the machine; the limits are 30 frames a second and 1 mm. Needs xvfb-run.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from controller.face.point_editing import PointEditor
from controller.panels.overlay.overlay_view import OverlayView
from controller.panels.window.editing import MouseEditing
from controller.panels.window.panel import Panel
from surface.view.draw.renderer import Renderer
from surface.view.draw.target import Target
from tests.hands import Hands, Steps, run_script

PULLS = {
    "corner of the mouth up": ((28.6, -34.0, 102.0), (18.0, -20.0)),
    "brow up": ((25.0, 53.0, 103.0), (0.0, -12.0)),
    "chin down": ((4.0, -71.0, 108.0), (0.0, 24.0)),
}
"""Points of the skin (mm), and how far each is pulled at 720 lines, pixels."""
FRAMES, LEAST_FPS, MOST_MM = 90, 30.0, 1.0
LONGEST_S = 600.0
STAGE = 'name = "pulled"\nrobots = ["head24"]\n[face]\nsize = [{}, {}]\nquality = "{}"\nperson = "maple"\n'
UP = np.array([0.0, 1.0, 0.0])
MEASURED: dict[str, tuple[type, str]] = {
    "the face that fits (solve)": (PointEditor, "drag"),
    "mouse, all in all": (MouseEditing, "__call__"),
    "panel beside its tab": (Panel, "__call__"),
    "overlays": (OverlayView, "__call__"),
    "picture: head posed": (Renderer, "pose"),
    "picture: vertices": (Renderer, "update"),
    "picture: drawn": (Target, "paint"),
    "picture: waited for": (Target, "complete"),
}
"""What a frame is made of: functions whose time is added up."""


class Clocks:
    """Adds up what calls of functions take: of the clock and of the thread that draws, s."""

    def __init__(self) -> None:
        self.spent: dict[str, list[float]] = defaultdict(lambda: [0.0, 0.0])
        for name, (owner, attribute) in MEASURED.items():
            setattr(owner, attribute, self._timed(name, getattr(owner, attribute)))

    def _timed(self, name: str, real: Callable[..., Any]) -> Callable[..., Any]:
        def call(*given: Any, **named: Any) -> Any:
            began = time.perf_counter(), time.thread_time()
            try:
                return real(*given, **named)
            finally:
                spent = self.spent[name]
                spent[0] += time.perf_counter() - began[0]
                spent[1] += time.thread_time() - began[1]

        return call


def left_mm(hands: Hands, vertex: int, pixel: tuple[float, float]) -> float:
    """How far a vertex of the face that is shown is from the line of sight through a pixel."""
    head = hands.face._head
    head.pose(hands.face._values())
    at = head.part("face").vertices[vertex].astype(np.float64)
    aside = np.array(hands.pixel(at)) - pixel
    per_mm = np.hypot(*(np.array(hands.pixel(at + UP)) - hands.pixel(at)))
    return float(np.hypot(*aside) / per_mm)


def pulled(hands: Hands, clocks: Clocks, place: tuple[float, float, float], by: tuple[float, float]) -> Steps:
    """Pull one point and report on it."""
    head, scale = hands.face._head, hands.face._area.height / 720.0
    head.pose(hands.face._values())
    vertex = int(np.argmin(np.linalg.norm(head.part("face").vertices - place, axis=1)))
    x, y = hands.pixel(head.part("face").vertices[vertex])
    yield from hands.move(x, y)
    yield from hands.key(hands.imgui.Key.mod_ctrl, down=True)
    yield from hands.press(down=True)
    clocks.spent.clear()
    began = time.perf_counter(), time.process_time(), time.thread_time()
    for k in range(1, FRAMES + 1):
        share = k / FRAMES * scale
        hands.pointer.move(x + share * by[0], y + share * by[1])
        yield
    ended = time.perf_counter(), time.process_time(), time.thread_time()
    clock, processor, own = (b - a for a, b in zip(began, ended, strict=True))
    spent = {name: [1e3 * each / FRAMES for each in found] for name, found in clocks.spent.items()}
    yield from hands.frames(60)
    goal = x + scale * by[0], y + scale * by[1]
    hands.report["pulls"].append({
        "fps": FRAMES / clock, "processor_ms": 1e3 * processor / FRAMES, "own_ms": 1e3 * own / FRAMES,
        "left_mm": left_mm(hands, vertex, goal), "spent": spent,
    })  # fmt: skip
    yield from hands.press(down=False)
    yield from hands.key(hands.imgui.Key.mod_ctrl, down=False)
    yield from hands.tap(hands.imgui.Key.n)
    yield from hands.until(lambda: np.abs(hands.face._values.full).max() < 1e-6, "the neutral face")
    yield from hands.frames(20)


def script(hands: Hands) -> Steps:
    """Pull every point."""
    clocks = Clocks()
    hands.report["pulls"] = []
    yield from hands.frames(20)
    yield from hands.tab("Sculpt")
    hands.face._mouse.editor.prepare()
    yield from hands.until(lambda: hands.face._mouse.editor.ready, "points of the face")
    for place, by in PULLS.values():
        yield from pulled(hands, clocks, place, by)


def measure(size: tuple[int, int], quality: str) -> list[dict[str, Any]]:
    """What each pull of :data:`PULLS` came to, in a window of a size. Raises SystemExit: there is no display."""
    if shutil.which("xvfb-run") is None:
        raise SystemExit("no virtual display here; Debian, Ubuntu: sudo apt-get install xvfb")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "stage.toml").write_text(STAGE.format(*size, quality), encoding="utf-8")
        server = f"-screen 0 {size[0]}x{size[1]}x24"
        command = ["xvfb-run", "-a", "-s", server, sys.executable, "-m", "benchmarks.pulling", "--window"]
        own = {"LIBGL_ALWAYS_SOFTWARE": "1", "OMOTE_TEST_FOLDER": name, "OMOTE_STATE": f"{name}/state"}
        root = Path(__file__).parent.parent
        done = subprocess.run(
            command, cwd=root, env=os.environ | own, capture_output=True, text=True, timeout=LONGEST_S, check=False
        )
        if done.returncode:
            raise SystemExit(f"the window failed: {done.stdout[-2000:]}{done.stderr[-2000:]}")
        report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    found: list[dict[str, Any]] = report["pulls"]
    return found


def show(console: Console, found: list[dict[str, Any]]) -> None:
    """Print the tables, and which limits do not hold."""
    table = Table("pulled", "frames/s", "processor ms/frame", "of the drawing thread", "mm from the pointer")
    for name, each in zip(PULLS, found, strict=True):
        figures = each["fps"], each["processor_ms"], each["own_ms"]
        table.add_row(name, *(f"{figure:.1f}" for figure in figures), f"{each['left_mm']:.2f}")
    console.print(table)
    parts = Table("a frame is made of", *(f"{name}: clock, own ms" for name in PULLS))
    for part in MEASURED:
        spent = [each["spent"].get(part, [0.0, 0.0]) for each in found]
        parts.add_row(part, *(f"{clock:.2f}, {own:.2f}" for clock, own in spent))
    console.print(parts)
    for name, each in zip(PULLS, found, strict=True):
        if each["fps"] < LEAST_FPS or each["left_mm"] > MOST_MM:
            console.print(f"{name}: beyond the limit of {LEAST_FPS:g} frames/s and {MOST_MM:g} mm")


def main() -> None:
    """Measure and print, or, within the window's process, pull."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", default="1280x720", help="of the window, pixels")
    parser.add_argument("--quality", default="auto", help="full, fast, or auto")
    parser.add_argument("--window", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.window:
        run_script(script, "run", "stage.toml", "--seconds", f"{LONGEST_S:g}")
        return
    width, _, height = given.size.partition("x")
    console = Console(highlight=False)
    show(console, measure((int(width), int(height)), given.quality))


if __name__ == "__main__":
    main()
