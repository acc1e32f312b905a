"""surface.view.draw.decimate"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_head import small_head

from surface.head import Head
from surface.head.posing.part import border_edges
from surface.view import Camera, Offscreen
from surface.view.draw.decimate import decimated_triangles, grouped_in_patches

SHAPES: tuple[dict[str, float], ...] = (
    {"jawOpen": 1.0, "mouthUpperUpLeft": 1.0},
    {"leftEyeYaw": 1.0, "rightEyeYaw": -1.0, "leftEyePitch": -1.0, "eyeWideRight": 1.0, "jawOpen": 0.3},
)
CAMERAS = (Camera.front(), Camera.around(40.0, -15.0))


@pytest.fixture(scope="module")
def head(root: Path) -> Head:
    return Head.load(root / "configs" / "heads" / "ict")


def pictures(head: Head, quality: str) -> np.ndarray:
    with Offscreen(head, (320, 240), quality=quality) as screen:
        made = []
        for shapes, camera in zip(SHAPES, CAMERAS, strict=True):
            screen.draw(head.values(shapes), camera)
            made.append(screen.read().astype(int))
    return np.array(made)


@pytest.mark.parametrize(("quality", "mean"), [("full", 0.2), ("fast", 0.6)])
def test_fewer_triangles_draw_hardly_another_picture(
    gl: None, head: Head, monkeypatch: pytest.MonkeyPatch, quality: str, mean: float
) -> None:
    assert sum(len(p.decimated[quality]) for p in head.parts) < 0.7 * sum(len(p.triangles) for p in head.parts)
    decimated = pictures(head, quality)
    for p in head.parts:
        monkeypatch.setattr(p, "decimated", {})
    off = np.abs(pictures(head, quality) - decimated).max(axis=3)
    assert 0.0 < off.mean() < mean
    assert (off > 48).mean() < 2e-3


def test_where_parts_meet_all_vertices_stay_and_other_borders_thin_out() -> None:
    head = Head(small_head())
    decimated = decimated_triangles(head)
    (zipper,) = head.zippers
    meeting = {zipper.first.name: np.union1d(zipper.low, zipper.high), zipper.second.name: zipper.ids}
    for part in head.parts:
        full, fast = decimated[f"{part.name}/full"], decimated[f"{part.name}/fast"]
        assert len(fast) <= len(full) < len(part.triangles)
        rim, meet = np.unique(border_edges(part.triangles)), meeting.get(part.name, np.zeros(0, int))
        kept = np.unique(border_edges(fast))
        assert np.isin(meet, kept).all() and np.isin(kept, rim).all()
        assert len(kept) < len(rim)


def test_triangles_in_patches_are_the_same_and_share_more_vertices_with_those_drawn_with_them(
    head: Head,
) -> None:
    triangles = head.part("face").decimated["fast"]
    shuffled = np.random.default_rng(2).permutation(triangles)
    made = grouped_in_patches(shuffled)
    assert np.array_equal(np.unique(made, axis=0), np.unique(triangles, axis=0))
    assert worked_out(made) < 1.4 * len(np.unique(triangles)) < 0.5 * worked_out(shuffled)
    assert worked_out(triangles) <= 1.02 * worked_out(made), "the shipped ones are grouped_in_patches"


def worked_out(triangles: np.ndarray, at_once: int = 341) -> int:
    """Vertices that patch after patch needs."""
    return sum(len(np.unique(triangles[k : k + at_once])) for k in range(0, len(triangles), at_once))
