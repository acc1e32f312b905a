"""The robot theme: lamps that show what a face does, on the shipped head."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from surface.head import Head
from surface.view import Camera, Offscreen
from surface.view.scene.openings import Openings

SIZE = (400, 400)
BROWS, MOUTH = slice(60, 150), slice(190, 290)  # rows


@pytest.fixture(scope="module")
def head(root: Path) -> Head:
    return Head.load(root / "configs" / "heads" / "ict")


def lamps(picture: np.ndarray) -> np.ndarray:
    """Pixels in the lamps' colour, (h, w) bool: much more green than red."""
    red, green, blue = np.moveaxis(picture.astype(int), -1, 0)
    return (green - red > 40) & (green > 120) & (blue > 100)


@pytest.fixture(scope="module", params=["full", "fast"])
def lit(head: Head, request: pytest.FixtureRequest, gl: None):  # type: ignore[no-untyped-def]
    """Draws lamps for values of parameters."""
    camera = Camera.around(0.0, 0.0, distance=900.0, target=(0.0, 10.0, 60.0))
    with Offscreen(head, SIZE, quality=request.param, theme="robot") as screen:
        yield lambda **given: lamps(screen.render(head.values(given), camera))


def both(name: str, value: float = 1.0) -> dict[str, float]:
    return {f"{name}Left": value, f"{name}Right": value}


def slope(brows: np.ndarray) -> float:
    """How much higher the outer half of the left half's bar is than its inner half, pixels."""
    rows, columns = np.nonzero(brows[:, :200])
    outer = columns < np.median(columns)
    return float(rows[~outer].mean() - rows[outer].mean())


def test_a_mouth_lights_up_as_it_opens_and_stays_a_line_when_it_is_shut(lit) -> None:  # type: ignore[no-untyped-def]
    shut, little, wide = (lit(jawOpen=value)[MOUTH].sum() for value in (0.0, 0.3, 0.9))
    assert 0 < shut < little < wide and wide > 3 * shut


def test_the_corners_of_the_line_rise_in_a_smile_and_sink_in_a_frown(lit) -> None:  # type: ignore[no-untyped-def]
    def corners(shown: np.ndarray) -> float:
        rows, columns = np.nonzero(shown[MOUTH])
        middle, ends = abs(columns - 200) < 8, abs(columns - 200) > 0.8 * abs(columns - 200).max()
        return float(rows[middle].mean() - rows[ends].mean())

    frown, neutral, smile = (corners(lit(**pose)) for pose in (both("mouthFrown"), {}, both("mouthSmile")))
    assert frown < neutral < smile and smile - frown > 8


def test_brows_of_lamps_slope_with_anger_and_sadness(lit) -> None:  # type: ignore[no-untyped-def]
    angry, neutral, sad = (slope(lit(**pose)[BROWS]) for pose in (both("browDown"), {}, {"browInnerUp": 1.0}))
    assert angry > neutral > sad and angry - sad > 4


def test_eyes_glow_and_shut(lit) -> None:  # type: ignore[no-untyped-def]
    eyes = slice(150, 185)
    assert lit()[eyes].sum() > 3 * max(lit(**both("eyeBlink"))[eyes].sum(), 1)


def test_the_line_of_the_lips_lies_between_them(head: Head) -> None:
    openings = Openings(head.parts)
    face = next(part for part in head.parts if part.name == "face")
    found = openings.lip_line(face)
    assert found.shape == (len(face.vertices),) and found.min() >= 0.0 and found.max() > 0.8
    near = face.vertices[found > 0.5]
    assert np.ptp(near[:, 1]) < 6.0 and 35.0 < np.ptp(near[:, 0]) < 70.0, "as high as a line and as long as a mouth"
    eye = next(part for part in head.parts if part.material == "eye")
    assert not openings.lip_line(eye).any()
