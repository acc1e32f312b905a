"""Every step of docs/walkthroughs.md, as docs/make_walkthroughs.py takes them for its pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from docs.make_walkthroughs import PAGE, PICTURES, new_expression, phone, servo_head
from tests.browser import find_chromium


@pytest.mark.slow
def test_a_new_expression_is_pulled_saved_and_known(tmp_path: Path) -> None:
    weights, picture = new_expression(tmp_path)
    assert weights[P.index("mouthSmileLeft")] > 0.15 > 2 * weights[P.index("mouthSmileRight")]
    assert weights[P.index("browOuterUpRight")] > 0.2 and weights[P.index("jawOpen")] < 0.05
    left, right = np.split(np.asarray(picture, float)[:, : 2 * (picture.width // 2)], 2, axis=1)
    assert np.abs(left - right).mean() > 0.3  # the face has changed


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
    assert found == {path.name for path in PICTURES.glob("walkthrough-*.webp")} and len(found) == 3
