"""Points of the face that a synthetic mouse grabs and pulls in a real window: where they end, on one side or both."""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np
import pytest

from tests.controller.panels.window.test_face import on_a_display, shown
from tests.hands import Hands, Steps, run_script

STAGE = 'name = "small"\n[face]\nsize = [960, 720]\nquality = "fast"\n'
PROGRAM = "from tests.controller.panels.window.test_pulling import main; main()"
CORNER, CHEEK = np.array([28.6, -34.0, 102.0]), np.array([46.0, -17.0, 91.0])
MIRROR, UP = np.array([-1.0, 1.0, 1.0]), np.array([0.0, 1.0, 0.0])


def skin(hands: Hands) -> np.ndarray:
    """(m, 3) mm the vertices of the face as it is shown now; the picture sums its own, fewer ones."""
    head = hands.face._head
    head.pose(hands.face._values())
    found: np.ndarray = head.part("face").vertices.astype(np.float64)
    return found


def at_rest(hands: Hands) -> np.ndarray:
    """(m, 3) mm the vertices of the face with all parameters 0."""
    head = hands.face._head
    head.pose(np.zeros(len(head.parameters)))
    found: np.ndarray = head.part("face").vertices.astype(np.float64)
    return found


def nearest(hands: Hands, place: np.ndarray) -> int:
    return int(np.argmin(np.linalg.norm(skin(hands) - place, axis=1)))


def left_mm(hands: Hands, vertex: int, pixel: tuple[float, float]) -> float:
    """How far a vertex is from the line of sight through a pixel."""
    at = skin(hands)[vertex]
    aside = np.array(hands.pixel(at)) - pixel
    per_mm = np.hypot(*(np.array(hands.pixel(at + UP)) - hands.pixel(at)))
    return float(np.hypot(*aside) / per_mm)


def pull(hands: Hands, vertex: int, by: tuple[float, float], still: float = 0.02) -> Steps:
    """Ctrl, the button, and a way of pixels; hold until the face stands still; tell what came of it; let go."""
    x, y = hands.pixel(skin(hands)[vertex])
    goal = x + by[0], y + by[1]
    yield from hands.move(x, y)
    yield from hands.key(hands.imgui.Key.mod_ctrl, down=True)
    yield from hands.press(down=True)
    began, first, frames = time.monotonic(), hands.imgui.get_frame_count(), 30
    for k in range(1, frames + 1):
        yield from hands.move(x + by[0] * k / frames, y + by[1] * k / frames)
    hands.report["frames_s"] = (hands.imgui.get_frame_count() - first) / (time.monotonic() - began)
    before = skin(hands)
    for _ in range(400):
        yield from hands.frames(6)
        after = skin(hands)
        if np.abs(after - before).max() < still and not hands.face._mouse.editor._pending:
            break
        before = after
    hands.report["left_mm"] = left_mm(hands, vertex, goal)
    yield from hands.press(down=False)
    yield from hands.key(hands.imgui.Key.mod_ctrl, down=False)
    yield from hands.frames(6)


def undo(hands: Hands) -> Steps:
    yield from hands.key(hands.imgui.Key.mod_ctrl, down=True)
    yield from hands.tap(hands.imgui.Key.z)
    yield from hands.key(hands.imgui.Key.mod_ctrl, down=False)
    yield from hands.frames(6)


def script(hands: Hands) -> Steps:
    told = hands.report
    yield from hands.frames(10)
    yield from hands.tap(hands.imgui.Key.n)
    yield from hands.frames(10)
    yield from hands.tab("Sculpt")
    hands.face._mouse.editor.prepare()
    yield from hands.until(lambda: hands.face._mouse.editor.ready, "points of the face")
    yield from pull(hands, nearest(hands, CORNER), (18.0, -20.0))
    told["face"] = told.pop("left_mm")
    yield from hands.grab("pulled")
    yield from hands.tap(hands.imgui.Key.n)
    yield from hands.until(lambda: np.abs(hands.face._values.full).max() < 1e-6, "the neutral face")
    yield from hands.frames(6)
    yield from hands.click("pull the skin")
    rest = at_rest(hands)
    vertex, other = nearest(hands, CHEEK), nearest(hands, CHEEK * MIRROR)
    for name in ("one", "both"):
        if name == "both":
            yield from hands.click("both sides of the face")
        yield from pull(hands, vertex, (16.0, -16.0))
        moved = at_rest(hands) - rest
        away = np.linalg.norm(rest - rest[vertex], axis=1)
        far = away > hands.face._mouse.brush.falloff_mm + 25.0  # control points reach farther than they lie
        told[name] = {
            "left_mm": told.pop("left_mm"), "moved": moved[vertex].tolist(), "across": moved[other].tolist(),
            "far": float(np.abs(moved[far & (rest[:, 0] > 0.0)]).max()),
            "half": float(np.linalg.norm(moved[(away > 10.0) & (away < 14.0)], axis=1).mean()),
        }  # fmt: skip
        yield from hands.grab(name)
        yield from undo(hands)
        told[name]["undone"] = at_rest(hands).tobytes() == rest.tobytes()


def main() -> None:
    """Run in the process of the window."""
    run_script(script, "edit", "stage.toml", "--seconds", "230")


@pytest.mark.slow
@on_a_display
def test_what_is_grabbed_follows_the_pointer_on_one_side_or_both_and_is_undone_to_the_bit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "stage.toml").write_text(STAGE)
    monkeypatch.setenv("OMOTE_TEST_FOLDER", str(tmp_path))
    monkeypatch.setenv("OMOTE_STATE", str(tmp_path / "state"))
    shown(PROGRAM)
    told = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    assert told["face"] < 1.0  # mm between the pointer and the grabbed point
    for name in ("one", "both"):
        found = told[name]
        moved, across = np.array(found["moved"]), np.array(found["across"])
        assert found["left_mm"] < 1.0 and np.linalg.norm(moved) > 3.0
        assert found["far"] < 0.1 * np.linalg.norm(moved) and 0.2 * np.linalg.norm(moved) < found[
            "half"
        ] < np.linalg.norm(moved)
        assert found["undone"]
        wanted = moved * MIRROR if name == "both" else np.zeros(3)
        np.testing.assert_allclose(across, wanted, atol=0.25)
