"""Draws docs/pictures/web-panel.webp: the panel in a real Chromium. ``python -m docs.make_web_panel_pictures``."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

from PIL import Image

from tests.browser import Page, find_chromium, page

ADDRESS = "127.0.0.1:8097"
OUT = Path(__file__).parent / "pictures" / "web-panel.webp"
SHOTS = ((1280, 720, "light", "happiness"), (390, 720, "dark", "surprise"))
SHOWN = {"happiness": ("mouthSmileLeft", 0.5), "surprise": ("browInnerUp", 0.5)}
"""A parameter of each expression, and how much of it a face that shows it has at least."""
LONGEST_S = 120.0


def main() -> None:
    """Write the picture. Raises SystemExit: there is no Chromium."""
    chromium = find_chromium()
    if chromium is None:
        raise SystemExit("no Chromium here; Debian, Ubuntu: sudo apt-get install chromium")
    command = [sys.executable, "-c", "from controller.cli import main; main()", "run", "websocket", "--no-face"]
    command += ["--person", "maple", "--web", ADDRESS]
    running = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        with page(chromium) as browser, tempfile.TemporaryDirectory() as folder:
            time.sleep(10.0)
            shots = [_shot(browser, Path(folder) / f"{each[0]}.png", *each) for each in SHOTS]
            _beside(shots).save(OUT, quality=82)
    finally:
        running.terminate()
        running.wait()


def _shot(browser: Page, path: Path, width: int, height: int, scheme: str, expression: str) -> Image.Image:
    browser.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
    browser.resize(width, height)
    browser.open(f"http://{ADDRESS}/")
    browser.wait("Boolean(globalThis.omote && omote.robot.good && omote.face.head)", 120.0)
    browser.evaluate(f"omote.robot.act({{type: 'expression', name: '{expression}', intensity: 0.9}})")
    _wait_for(browser, *SHOWN[expression])
    browser.screenshot(path)
    return Image.open(path).convert("RGB")


def _wait_for(browser: Page, parameter: str, least: float) -> None:
    """Wait until the face that is drawn has an expression, however slowly this machine draws."""
    browser.evaluate("omote.robot.on('frame', (frame) => { globalThis.shown = frame; })")
    at = f"omote.robot.names.indexOf('{parameter}')"
    browser.wait(f"Boolean(omote.robot.good) && (globalThis.shown?.values ?? [])[{at}] > {least}", LONGEST_S)
    browser.evaluate("omote.face.changed = true")
    drawn = browser.evaluate("omote.face.frames")
    browser.wait(f"omote.face.frames > {drawn + 2}", LONGEST_S)


def _beside(shots: list[Image.Image]) -> Image.Image:
    out = Image.new("RGB", (sum(each.width for each in shots) + 24, shots[0].height), "#888")
    at = 0
    for each in shots:
        out.paste(each, (at, 0))
        at += each.width + 24
    return out


if __name__ == "__main__":
    main()
