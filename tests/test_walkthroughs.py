"""Every step of docs/walkthroughs.md, as docs/make_walkthroughs.py takes them for its pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.stage.stage import load_stage
from controller.vocabulary.vocabulary import Vocabulary
from docs.make_walkthroughs import PAGE, PICTURES, new_expression, phone, servo_head, smirk, wrinkle
from surface.head import Head
from tests.browser import find_chromium
from tests.controller.panels.window.test_face import on_a_display


@pytest.mark.slow
def test_a_new_expression_is_pulled_saved_and_known(tmp_path: Path) -> None:
    weights, picture = new_expression(tmp_path)
    assert weights[P.index("mouthSmileLeft")] > 0.15 > 2 * weights[P.index("mouthSmileRight")]
    assert weights[P.index("browOuterUpRight")] > 0.2 and weights[P.index("jawOpen")] < 0.05
    left, right = np.split(np.asarray(picture, float)[:, : 2 * (picture.width // 2)], 2, axis=1)
    assert np.abs(left - right).mean() > 0.3  # the face has changed


@pytest.mark.slow
@on_a_display
def test_a_smirk_is_made_and_saved_in_under_a_minute_without_typing(tmp_path: Path) -> None:
    told, _ = smirk(tmp_path)
    assert told["seconds"] < 60.0 and told["message"] == "wrote face_1 to mine.toml"
    weights = Vocabulary.load(P, more=[tmp_path / "mine.toml"])["face_1"].weights
    assert weights[P.index("mouthSmileLeft")] > 0.5 and abs(weights[P.index("mouthSmileRight")]) < 0.1


@pytest.mark.slow
@on_a_display
def test_a_wrinkle_is_drawn_and_saved_in_two_minutes_and_undone_and_redone_to_the_bit(tmp_path: Path) -> None:
    told, _ = wrinkle(tmp_path)
    assert told["seconds"] < 120.0 and told["slider"] == ["fold_1"] and told["points"] > 20
    assert told["undone to the bit"] and told["redone to the bit"]
    stage = load_stage("demo", P, [tmp_path / "mine.toml"])
    head = stage.load_head()
    faces = [furrowed(head, value) for value in (0.0, 1.0)]
    sunk = np.linalg.norm(faces[1] - faces[0], axis=1)
    assert 0.8 < sunk.max() < 1.5  # mm: the depth that was asked for is 1.2
    moved = faces[0][sunk > 0.4]
    for side in (-1.0, 1.0):
        own = moved[moved[:, 0] * side > 0.0]
        assert len(own) > 20 and np.abs(own[:, 0]).min() > 18.0 and np.ptp(own[:, 1]) > 15.0  # a line, on both sides
        across = np.linalg.norm(own[:, None] - own, axis=2)
        assert np.partition(across, 3, axis=1)[:, 3].max() < 3.0  # mm: the mesh is fine along it
    assert (sunk > 0.05).mean() < 0.35 and np.abs(faces[1] - faces[0])[faces[0][:, 1] > 30.0].max() == 0.0


def furrowed(head: Head, value: float) -> np.ndarray:
    """(m, 3) the skin of the face with the saved fold."""
    head.pose(head.values({"fold_1": value}))
    vertices: np.ndarray = head.part("face").vertices.astype(np.float64)
    return vertices


@pytest.mark.slow
def test_a_servo_head_follows_from_its_anchors(tmp_path: Path) -> None:
    turned, _ = servo_head(tmp_path)
    assert turned["cornerLeft"] > 5.0 and abs(turned["cornerRight"]) < 2.0


@pytest.mark.slow
@pytest.mark.skipif(find_chromium() is None, reason="no Chromium here; Debian, Ubuntu: sudo apt-get install chromium")
def test_a_phone_drives_the_head_and_stops_it(tmp_path: Path) -> None:
    picture = phone(tmp_path)
    assert picture.size == (792, 720)


def test_the_page_shows_the_pictures_that_there_are() -> None:
    shown = {name for name in PAGE.read_text(encoding="utf-8").split() if "pictures/walkthrough-" in name}
    found = {each.rpartition("pictures/")[2].rstrip(")") for each in shown}
    assert found == {path.name for path in PICTURES.glob("walkthrough-*.webp")} and len(found) == 5
