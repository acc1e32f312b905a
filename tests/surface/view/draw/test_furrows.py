"""The darker floors of wrinkles in pictures: shaders/skin.glsl, furrowed()."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from surface.head import Head
from surface.head.posing.crowd import Crowd
from surface.view import Camera, Offscreen
from surface.view.draw import renderer
from surface.view.scene.wrinkles import Wrinkles

pytestmark = pytest.mark.usefixtures("gl")
SIZE = (360, 360)
SMILE = {"mouthSmileLeft": 1.0, "mouthSmileRight": 1.0}


@pytest.fixture(scope="module")
def folder(root: Path) -> Path:
    return root / "configs" / "heads" / "ict"


def picture(folder: Path, given: Mapping[str, float], *, live: bool = False, **options: str) -> np.ndarray:
    """(height, width, 3) of a pose from the front; ``live`` : with fewer triangles, as windows draw it in software."""
    head = Head.load(folder)
    with Offscreen(head, SIZE, samples=1, **options) as screen:  # type: ignore[arg-type]
        if live:
            screen.renderer.hurry()
        return screen.render(head.values(given), Camera.front()).astype(float)


def shallow(monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on no vertex is in a furrow."""
    monkeypatch.setattr(Wrinkles, "at", lambda self, part: np.zeros((len(part.vertices), 4), np.uint8))


WAYS = [
    {"evaluator": "cpu"}, {"evaluator": "gpu"}, {"live": True},
    {"evaluator": "cpu", "quality": "fast"}, {"evaluator": "gpu", "quality": "fast"}, {"live": True, "quality": "fast"},
]  # fmt: skip


def darker(folder: Path, monkeypatch: pytest.MonkeyPatch, given: Mapping[str, float], **way: str) -> np.ndarray:
    """(height, width, 3) by how much furrows make a picture darker."""
    with_furrows = picture(folder, given, **way)  # type: ignore[arg-type]
    with monkeypatch.context() as patch:
        shallow(patch)
        return picture(folder, given, **way) - with_furrows  # type: ignore[arg-type]


@pytest.mark.parametrize("way", WAYS, ids=str)
def test_folds_of_a_smile_are_darker_and_redder_from_the_front(
    folder: Path, monkeypatch: pytest.MonkeyPatch, way: dict[str, str]
) -> None:
    less = darker(folder, monkeypatch, SMILE, **way)
    assert less.min() >= -5.0, "nothing becomes brighter but where another edge is smoothed"
    for side in (less[:, :180], less[:, 180:]):  # the key light meets the left half of the picture face on
        assert side.max() > 25.0
        floor = side.max(axis=2) > 12.0
        assert 40 < floor.sum() < 1500, "a fold, not the whole cheek"
        assert side[floor][:, 1].mean() > 1.1 * side[floor][:, 0].mean(), "less green is left than red"
    edges = np.abs(np.diff(less[..., 1], axis=1)).max()
    assert edges < 0.6 * less[..., 1].max(), "soft at the sides"


@pytest.mark.slow
def test_every_way_to_draw_agrees(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = [darker(folder, monkeypatch, SMILE | {"browInnerUp": 1.0}, **way)[..., 1] for way in WAYS]  # type: ignore[arg-type]
    whole, off = found[0].sum(), [np.abs(less - found[0]).sum() / found[0].sum() for less in found]
    assert [less.sum() for less in found[:-1]] == pytest.approx([whole] * 5, rel=0.1)
    assert found[-1].sum() == pytest.approx(whole, rel=0.3), "large triangles"
    assert off[1] < 0.01 and max(off[:-1]) < 0.2 and off[-1] < 0.5


@pytest.mark.parametrize("quality", ["full", "fast"])
def test_a_face_at_rest_is_the_same_to_a_bit(folder: Path, monkeypatch: pytest.MonkeyPatch, quality: str) -> None:
    plain = picture(folder, {"jawOpen": 0.3}, quality=quality)
    monkeypatch.setattr(renderer, "wrinkles_of", lambda head: None)
    assert np.array_equal(plain, picture(folder, {"jawOpen": 0.3}, quality=quality))
    assert not np.array_equal(plain, picture(folder, SMILE, quality=quality))


@pytest.mark.parametrize("theme", ["mask", "robot"])
def test_shells_are_not_skin(folder: Path, monkeypatch: pytest.MonkeyPatch, theme: str) -> None:
    assert not darker(folder, monkeypatch, SMILE, theme=theme).any()


def test_more_of_a_smile_is_darker(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    most = [darker(folder, monkeypatch, {"mouthSmileLeft": s}).max() for s in (0.4, 0.7, 1.0)]
    assert 0.0 < most[0] < most[1] < most[2]


def test_heads_of_a_crowd_have_each_its_own(folder: Path) -> None:
    head = Head.load(folder)
    crowd = Crowd(head, 2)
    values = np.stack([head.values({}), head.values(SMILE)])
    crowd.pose(values)
    with Offscreen(head, SIZE, samples=1, evaluator="cpu") as screen:
        found = []
        for k in range(2):
            crowd.show(k)
            found.append(screen.render_present(Camera.front(), crowd.values[k]).astype(float))
    for one, given in zip(found, ({}, SMILE), strict=True):
        assert np.abs(one - picture(folder, given, evaluator="cpu")).max() <= 2.0
