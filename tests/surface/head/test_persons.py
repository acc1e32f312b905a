"""Persons on the shipped head: what is worn sits on the skin, covers it, follows it and hides no hole."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from surface.base.errors import HeadFileError
from surface.head import Head
from surface.head.model.look import Look, Worn
from surface.view import Camera, Offscreen

CONFIGS = Path(__file__).resolve().parents[3] / "configs"
ICT, WARDROBE = CONFIGS / "heads" / "ict", CONFIGS / "wardrobe"
GREY, BLUE = (0.2, 0.2, 0.2), (0.05, 0.1, 0.4)


def worn(*names: str) -> Look:
    return Look(melanin=0.5, worn=tuple(Worn(WARDROBE / f"{name}.npz", BLUE) for name in names))


@pytest.fixture(scope="module")
def plain() -> Head:
    return Head.load(ICT)


@pytest.fixture(scope="module")
def dressed() -> Head:
    return Head.load(ICT, {"broad": 0.7}, worn("hair-long", "beard-full", "clothes-shirt"))


@pytest.mark.slow
def test_worn_parts_have_their_colours_and_lie_near_the_head(dressed: Head) -> None:
    names = [part.name for part in dressed.parts[-5:]]
    assert names == ["hair", "tresses", "strays", "beard", "clothes"]
    for part in dressed.parts[-5:]:
        assert np.isfinite(part.vertices).all() and np.abs(part.vertices).max() < 400
        assert part.attributes["albedo"].mean(axis=0).argmax() == 2
        assert {"strands", "along", "gloss"} <= set(part.attributes)
        assert len(part.decimated["fast"]) < 0.7 * len(part.triangles)


def test_cloth_and_hair_lie_outside_of_the_skin_that_is_drawn(dressed: Head) -> None:
    skins = [dressed.part(name) for name in ("face", "back")]
    drawn = [np.unique(part.triangles) for part in skins]
    points = np.vstack([part.vertices[ids] for part, ids in zip(skins, drawn, strict=True)])
    normals = np.vstack([part.normals[ids] for part, ids in zip(skins, drawn, strict=True)])
    tree = cKDTree(points)
    for name in ("hair", "clothes"):
        part = dressed.part(name)
        covers = part.attributes["strands"][:, 2] > 0.0  # the border fades, and ends below the ear's root
        away, near = tree.query(part.vertices)
        height = ((part.vertices - points[near]) * normals[near]).sum(axis=1)
        assert height[covers & (away < 8.0)].min() > -1.5 and covers.mean() > 0.7, name


def test_skin_below_is_hidden_and_darker_in_its_own_hue(plain: Head, dressed: Head) -> None:
    for name in ("face", "back"):
        # skin is drawn up to 26 mm inside the hairline, along which hair fades: of the face 93.1 % is left
        assert len(dressed.part(name).triangles) < 0.94 * len(plain.part(name).triangles)
    bare = Head.load(ICT, {"broad": 0.7}, Look(melanin=0.5))
    crown = bare.part("back").vertices[:, 1] > 125
    under, before = (head.part("back").attributes["albedo"][crown] for head in (dressed, bare))
    assert (under.mean(axis=1) < 0.7 * before.mean(axis=1)).all()
    assert (under[:, 0] > under[:, 2]).all()  # skin, and not blue as the hair
    nose = bare.part("face").vertices[:, 2] > 128
    np.testing.assert_allclose(*(head.part("face").attributes["albedo"][nose] for head in (dressed, bare)))


def test_a_beard_goes_with_the_jaw_and_clothes_stay(dressed: Head) -> None:
    before = {n: dressed.part(n).vertices.copy() for n in ("face", "beard", "clothes", "hair")}
    dressed.pose(dressed.values({"jawOpen": 1.0}))
    moved = {n: np.linalg.norm(dressed.part(n).vertices - rows, axis=1) for n, rows in before.items()}
    dressed.pose(dressed.values({}))
    chin = before["beard"][:, 1] < -65
    away, near = cKDTree(before["face"]).query(before["beard"][chin])
    assert np.abs(moved["beard"][chin] - moved["face"][near]).max() < 0.35 * moved["face"][near].max()
    assert moved["beard"][chin].min() > 5 and not moved["clothes"].any() and not moved["hair"].any()
    assert away.max() < 30


def test_hair_sways_behind_a_turning_head_and_stops(dressed: Head) -> None:
    turned, part = dressed.values({"headYaw": 0.4}), dressed.part("tresses")
    dressed.pose(turned)
    rest = part.vertices.copy()
    dressed.sway.advance(np.zeros(3), 0.0)
    dressed.sway.advance(np.array([0.1, 0.0, 0.0]), 0.02)
    dressed.pose(turned)
    swayed = np.linalg.norm(part.vertices - rest, axis=1)
    dressed.sway.advance(np.zeros(3), 100.0)
    dressed.pose(turned)
    np.testing.assert_array_equal(part.vertices, rest)
    dressed.pose(dressed.values({}))
    assert 2.0 < swayed.max() < 15.0 and np.quantile(swayed, 0.05) < 0.5


def test_no_hole_opens_between_hair_and_skin(dressed: Head, gl: None) -> None:
    from surface.view import Camera, Offscreen

    covered = []
    for head in (Head.load(ICT, {"broad": 0.7}), dressed):
        with Offscreen(head, (160, 160), samples=1) as screen:
            screen.renderer.set_background((0.0, 1.0, 0.0), (0.0, 1.0, 0.0))
            views = [(0, 3), (40, 3), (90, 3), (180, 5), (30, 50)]
            pictures = [screen.render(head.values({}), Camera.around(*view)).astype(int) for view in views]
        covered.append([(p[..., 1] < 120) | (p[..., 0] > 60) | (p[..., 2] > 60) for p in pictures])
    for bare, own in zip(*covered, strict=True):
        inner = bare.copy()  # strands are sparse at the outline
        for axis, by in ((0, 3), (0, -3), (1, 3), (1, -3)):
            inner &= np.roll(bare, by, axis)
        assert (inner & ~own).sum() == 0
        assert own.sum() > 1.1 * bare.sum()


def test_what_is_worn_must_be_there_and_fit(tmp_path: Path) -> None:
    with pytest.raises(HeadFileError, match="missing"):
        Head.load(ICT, None, Look(worn=(Worn(tmp_path / "hat.npz", GREY),)))


@pytest.mark.slow
@pytest.mark.parametrize("simplified", [False, True])
def test_what_is_worn_may_hide_all_of_a_part(tmp_path: Path, simplified: bool) -> None:
    with np.load(WARDROBE / "hair-crop.npz") as file:
        arrays = dict(file)
    hood = {key: np.full_like(arrays[key], 255) for key in ("hidden/face", "hidden/back")}
    np.savez(tmp_path / "hood.npz", **arrays | hood)
    head = Head.load(ICT, None, Look(worn=(Worn(tmp_path / "hood.npz", GREY),)))
    assert len(head.part("back").triangles) == 0
    with Offscreen(head, (96, 96), quality="fast") as screen:
        if simplified:
            screen.renderer.hurry()
        picture = screen.render(np.zeros(len(head.parameters)), Camera.front())
    assert np.ptp(picture[..., :3].astype(int), axis=(0, 1)).max() > 40, "the hair is seen"
