"""surface.view.draw.decimate"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_head import small_head

from surface.head import Head
from surface.head.posing.part import border_edges
from surface.mesh.strips import strip_uv
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


@pytest.mark.slow
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
    (stitch,) = head.stitches
    meeting = {stitch.first.name: np.union1d(stitch.low, stitch.high), stitch.second.name: stitch.ids}
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


def test_patches_hold_341_connected_triangles() -> None:
    from ball_head import grid

    _, triangles = grid(31, 31)
    made = grouped_in_patches(np.random.default_rng(1).permutation(triangles))
    for start in range(0, len(made), 341):
        patch = made[start : start + 341]
        found, todo = {0}, [0]
        while todo:
            corner = set(patch[todo.pop()].tolist())
            new = [t for t in range(len(patch)) if t not in found and corner & set(patch[t].tolist())]
            found.update(new)
            todo += new
        assert len(found) == len(patch) or start + 341 >= len(made), "the last one takes what is left over"
    assert len(made) == 1800
    first = made[:341]
    middle = np.unravel_index(first[0, 0], (31, 31))
    reach = np.abs(np.array(np.unravel_index(np.unique(first), (31, 31))).T - middle).max()
    assert reach <= 341 / 2 / 4, "a round patch, no strip"


def test_small_and_empty_meshes_are_one_patch() -> None:
    triangles = np.array([[0, 1, 2], [7, 8, 9], [2, 1, 3]])
    assert sorted(map(tuple, grouped_in_patches(triangles).tolist())) == sorted(map(tuple, triangles.tolist()))


def test_the_head_rests_after_its_triangles_are_found() -> None:
    head = Head(small_head())
    rest = [part.vertices.copy() for part in head.parts]
    decimated_triangles(head)
    for part, before in zip(head.parts, rest, strict=True):
        np.testing.assert_allclose(part.vertices, before, atol=1e-5)


def test_errors_stay_below_those_of_the_material() -> None:
    head = Head(small_head())
    found = decimated_triangles(head)
    for part in head.parts:
        for level, most in (("full", 0.18), ("fast", 0.5)):
            triangles = found[f"{part.name}/{level}"]
            assert triangles.max() < len(part.vertices)
            corners = part.vertices[triangles].astype(float)
            normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            normal /= np.linalg.norm(normal, axis=1, keepdims=True)
            planes = np.abs(((part.vertices[:, None] - corners[None, :, 0]) * normal).sum(axis=2))
            inside = np.linalg.norm(part.vertices[:, None] - corners.mean(axis=1), axis=2).argmin(axis=1)
            near = planes[np.arange(len(inside)), inside]
            assert np.sqrt((near**2).mean()) < 2 * most


ERRORS_MM = {
    "skin": 0.5,
    "brow": 0.56,
    "lash": 0.42,
    "teeth": 0.27,
    "gums": 0.5,
    "mouth": 0.84,
    "eye": 0.35,
    "wool": 0.56,
}


@pytest.mark.parametrize("material", ERRORS_MM)
def test_errors_are_those_of_the_material_and_count_places_normals_and_looks(
    monkeypatch: pytest.MonkeyPatch, material: str
) -> None:
    seen: list[tuple[np.ndarray, np.ndarray, list[float]]] = []

    class Noted:
        def __init__(self, places: np.ndarray, triangles: np.ndarray, locked: np.ndarray) -> None:
            self.triangles = triangles
            seen.append((places, locked, []))

        def run(self, error: float) -> np.ndarray:
            seen[-1][2].append(error)
            return self.triangles

    monkeypatch.setattr("surface.view.draw.decimate.Collapse", Noted)
    data = small_head()
    parts = [data.parts[0], *(replace(part, material=material) for part in data.parts[1:])]
    head = Head(replace(data, parts=parts))
    decimated_triangles(head)
    (first, locked, errors), _, (tooth, free, others) = seen
    assert errors == pytest.approx([0.18, 0.5])
    assert others == pytest.approx([0.36 * ERRORS_MM[material], ERRORS_MM[material]])
    (a, _, rigid), (stitch,) = head.parts, head.stitches
    assert first.shape == (len(a.vertices), 5 * 6 + 3), "five poses of places and normals, and a colour"
    np.testing.assert_allclose(first[:, :3], a.vertices, atol=1e-5)
    np.testing.assert_allclose(first[:, 3:6], 2.0 * a.normals, atol=1e-5)
    np.testing.assert_allclose(first[:, -3:], np.tile(4.0 * np.sqrt([0.1, 0.2, 0.3]), (len(first), 1)), atol=1e-5)
    head.pose(head.values({"mouthPucker": 1, "browOuterUpLeft": 1, "eyeWideLeft": 1}))
    np.testing.assert_allclose(first[:, 18:21], a.vertices, atol=1e-5)
    head.pose(np.zeros(len(head.parameters)))
    assert np.array_equal(np.flatnonzero(locked), np.union1d(stitch.low, stitch.high)) and not free.any()
    looks = {"skin": np.full((len(tooth), 3), 4.0 * np.sqrt(0.5)), "wool": np.zeros((len(tooth), 0))}
    if material in ("brow", "lash"):
        looks[material] = 1.5 * strip_uv(rigid)
    wanted = [rigid.vertices, 2.0 * rigid.normals] if material == "skin" else [rigid.vertices]
    np.testing.assert_allclose(tooth, np.hstack([*wanted, looks.get(material, looks["wool"])]), atol=1e-4)
