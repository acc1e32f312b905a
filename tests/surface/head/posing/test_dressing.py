"""What is worn: its colours and strands, the colour and shade of the skin below, and what is hidden there."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from cards import card
from small_head import small_head

from surface.base.errors import HeadFileError
from surface.head import Head
from surface.head.model.data import Neck
from surface.head.model.parameters import rotation
from surface.head.posing.dressing import (
    ALONG_MM,
    CURLED_MM,
    ENDS_MM,
    NOT_BARE_MM,
    SCALP,
    SHADED,
    SKIN,
    THROUGH,
    WornMesh,
    dress,
    sample_picture,
)


@pytest.fixture
def head() -> Head:
    return Head(small_head())


def garment(head: Head, fields: dict[str, np.ndarray] | None = None, **look: Any) -> Any:
    """A garment drawn as the part "b" of a small head, red at its roots and blue at its tips."""
    n = len(head.part("b").vertices)
    arrays = {
        "strands": 1e-3 * np.arange(4.0 * n).reshape(n, 4), "fast": np.array([[0, 1, 2]]),
        "tint": np.linspace(0, 255, n).astype(np.uint8), "shade": np.full(n, 64, np.uint8),
    }  # fmt: skip
    worn = {"path": "w.npz", "colour": (0.8, 0.0, 0.0), "tips": (0.0, 0.0, 0.8), "gloss": 0.25, **look}
    part = SimpleNamespace(name="b", arrays=arrays)
    return SimpleNamespace(parts=[part], worn=SimpleNamespace(**worn), fields=fields or {})


def test_hair_goes_from_the_colour_of_its_roots_to_that_of_its_tips(head: Head) -> None:
    part = head.part("b")
    dress(head.parts, [garment(head)])
    tint = np.linspace(0, 255, len(part.vertices)).astype(np.uint8) / 255
    wanted = 0.4 * np.column_stack([1 - tint, 0 * tint, tint])  # at half brightness
    np.testing.assert_allclose(part.attributes["albedo"], wanted, atol=1e-6)
    assert part.attributes["strands"].tolist() == np.float32(1e-3 * np.arange(4.0 * len(tint)).reshape(-1, 4)).tolist()
    assert (part.attributes["gloss"] == 0.25).all() and part.attributes["gloss"].shape == (len(tint), 1)
    assert part.decimated["fast"].tolist() == part.decimated["full"].tolist() == [[0, 1, 2]]
    step = 1e-4  # along v, on the surface itself
    uv = part.mesh.uv.copy()
    down, up = np.clip(uv[:, 1] - step, 0, 1), np.clip(uv[:, 1] + step, 0, 1)
    inside = (down > 0) & (up < 1)
    ends = [part.surface.evaluate(np.column_stack([uv[inside, 0], v[inside]])) for v in (down, up)]
    along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0], axis=1, keepdims=True)
    np.testing.assert_allclose(part.attributes["along"][inside], along, atol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(part.attributes["along"], axis=1), 1.0, atol=1e-5)


def test_curls_have_hardly_a_direction(head: Head) -> None:
    """Their texture changes along them within a few mm, and light glints on single curls, not in a band."""
    part, worn = head.part("b"), garment(head)
    mm = np.linalg.norm(np.diff(part.vertices, axis=0), axis=1)
    same = np.diff(part.mesh.uv[:, 0]) == 0.0
    tiles = 0.4 * CURLED_MM
    worn.parts[0].arrays["strands"][:, 1] = np.concatenate([[0.0], np.cumsum(np.where(same, mm, 7.0))]) / tiles
    dress(head.parts, [worn])
    np.testing.assert_allclose(np.linalg.norm(part.attributes["along"], axis=1), 0.4, rtol=1e-5)


def test_hair_without_tips_has_one_colour_and_bright_hair_stays_in_range(head: Head) -> None:
    worn = garment(head, tips=None)
    worn.parts[0].arrays["shade"][:] = 255
    dress(head.parts, [worn])
    wanted = [min(0.8 * 255 / 128, 1.0), 0.0, 0.0]
    np.testing.assert_allclose(head.part("b").attributes["albedo"], [wanted] * len(head.part("b").vertices), atol=1e-6)


def test_hair_that_hangs_knows_how_far_its_roots_are_and_what_skin_shows_there(head: Head) -> None:
    part, skin = head.part("b"), head.part("a")
    part.material, skin.material = "tress", "skin"
    u = np.asarray(part.uv)[:, 0] % 2.0  # the parting rises, and falls behind
    part.vertices = np.column_stack([0.0 * u, -90.0 * (u - 0.6) ** 2, -120.0 * u]).astype(np.float32)
    skin.attributes["albedo"] = np.full((len(skin.vertices), 3), 0.4, np.float32)
    worn = garment(head, {"cover/a": np.ones((2, 2), np.float32)})
    dress(head.parts, [worn])
    along = worn.parts[0].arrays["strands"][:, 1]
    for patch in np.unique(np.floor(part.uv[:, 0] / 2.0)):
        own = np.floor(part.uv[:, 0] / 2.0) == patch
        closed = part.attributes["roots"][own, 0] - ALONG_MM * (along[own] - along[own].min())
        _check_closed(part.vertices[own].astype(float), np.asarray(part.uv)[own], closed)
    assert part.attributes["scalp"][0] == pytest.approx([0.4 / 0.8, 400.0, 400.0])


def _check_closed(at: np.ndarray, uv: np.ndarray, closed: np.ndarray) -> None:
    """A parting is closed at its front end and from its highest place on, and along each strand as at its root."""
    roots = np.flatnonzero(uv[:, 1] == uv[:, 1].min())
    roots = roots[np.argsort(uv[roots, 0])]
    order = roots if at[roots[0], 2] > at[roots[-1], 2] else roots[::-1]  # from the front
    top = int(at[order, 1].argmax())
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(at[order], axis=0), axis=1))])
    assert closed[order[[0, *range(top, len(order))]]] == pytest.approx(NOT_BARE_MM, abs=1e-4)
    left = np.minimum(way[:top] / ENDS_MM[0], (way[top] - way[:top]) / ENDS_MM[1])
    assert closed[order[:top]] == pytest.approx(NOT_BARE_MM * (1.0 - np.minimum(left, 1.0)), abs=1e-3)
    assert closed == pytest.approx(np.interp(uv[:, 0], uv[roots, 0], closed[roots]), abs=1e-4)


def test_hair_that_does_not_hang_has_no_parting(head: Head) -> None:
    dress(head.parts, [garment(head)])
    assert not {"roots", "scalp"} & set(head.part("b").attributes)


def test_colours_of_another_mesh_are_refused(head: Head) -> None:
    worn = garment(head)
    worn.parts[0].arrays["strands"] = worn.parts[0].arrays["strands"][1:]
    with pytest.raises(HeadFileError, match=r"w\.npz: is damaged: b/strands belongs to another mesh") as caught:
        dress(head.parts, [worn])
    assert caught.value.hint


def test_skin_below_has_the_colour_of_hair_lies_in_its_shade_and_does_not_shine(head: Head) -> None:
    skin = head.part("a")
    skin.attributes["occlusion"] = np.full((len(skin.vertices), 1), 0.8, np.float32)
    skin.attributes["gloss"] = np.full((len(skin.vertices), 1), 0.3, np.float32)
    before = skin.attributes["albedo"].copy()
    across = np.tile(np.linspace(0, 1, 3)[:, None], (1, 4))  # a picture that rises with u
    dress(head.parts, [garment(head, {"cover/a": across, "shadow/a": 0.5 * across, "cover/tooth": across})])
    u = skin.uv[:, :1]
    hair = SCALP * np.array([0.8, 0, 0])
    light = np.minimum(hair.mean() / before.mean(axis=1, keepdims=True), 1.0)  # beside the skin
    below = (1 - SKIN) * hair + SKIN * light * before
    share = u * (1 - THROUGH * light)
    np.testing.assert_allclose(skin.attributes["albedo"], before + share * (below - before), atol=1e-5)
    np.testing.assert_allclose(skin.attributes["occlusion"], 0.8 * (1 - SHADED * share) * (1 - 0.5 * u), atol=1e-5)
    np.testing.assert_allclose(skin.attributes["gloss"], 0.3 * (1 - share), atol=1e-5)
    assert skin.attributes["albedo"].dtype == np.float32


def test_triangles_that_lie_all_below_are_left_out_of_every_mesh(head: Head) -> None:
    skin = head.part("a")
    skin.decimated = {"far": skin.triangles[::2]}
    triangles, u = skin.triangles.copy(), skin.uv[:, 0]
    dress(head.parts, [garment(head, {"hidden/a": np.array([[0.0, 0.0], [1.0, 1.0]])})])
    seen = ~(u > 0.5)[triangles].all(axis=1)
    assert 0 < seen.sum() < len(triangles)
    np.testing.assert_array_equal(skin.triangles, triangles[seen])
    np.testing.assert_array_equal(skin.decimated["far"], triangles[::2][seen[::2]])
    assert len(head.part("tooth").triangles) == len(Head(small_head()).part("tooth").triangles)


def test_pictures_are_linear_between_their_pixels(head: Head) -> None:
    picture = np.random.default_rng(3).uniform(size=(4, 5))
    skin = SimpleNamespace(name="a", uv=np.array([[0, 0], [1, 1], [1 / 3, 0.25], [0.5, 0.625], [-2, 0.5], [3, -1]]))
    found = sample_picture(garment(head, {"cover/a": picture}), "cover", skin)  # type: ignore[arg-type]
    assert found is not None and found.shape == (6, 1) and found.dtype == np.float32
    middle = 0.25 * (picture[1, 2] + picture[1, 3] + picture[2, 2] + picture[2, 3])
    wanted = [picture[0, 0], picture[3, 4], picture[1, 1], middle, picture[0, 2], picture[3, 0]]
    np.testing.assert_allclose(found[:, 0], wanted, atol=1e-6)
    assert sample_picture(garment(head), "cover", skin) is None  # type: ignore[arg-type]


def test_an_accessory_turns_with_the_head_and_over_the_neck_by_its_share() -> None:
    neck = Neck((0.0, -50.0, 0.0), slope=0.0, still=-40.0, whole=0.0)
    worn = WornMesh(card((-10.0, -40.0), (10.0, 20.0), z=30.0), neck)
    assert worn.share.tolist() == [0.0, 0.0, 1.0, 1.0]
    rest = worn.accessory.vertices.copy()
    same, _ = worn.turned(np.eye(3))
    assert same.base is worn.accessory.vertices  # a head that does not turn costs nothing
    quarter = rotation(1.0, 0.0, 0.0)
    vertices, normals = worn.turned(quarter)
    np.testing.assert_allclose(vertices[:2], rest[:2], atol=1e-4)
    pivot = np.array(neck.pivot)
    np.testing.assert_allclose(vertices[2:], (rest[2:] - pivot) @ quarter.T + pivot, atol=1e-3)
    np.testing.assert_allclose(normals[2], quarter @ [0.0, 0.0, 1.0], atol=1e-5)
    assert worn.turned(quarter)[0] is vertices and (worn.accessory.vertices == rest).all()


def test_nobody_can_damage_an_accessory_at_rest_or_as_it_was_turned_last() -> None:
    worn = WornMesh(card(), Neck((0.0, -50.0, 0.0), slope=0.0, still=-40.0, whole=0.0))
    for turn in (np.eye(3), rotation(1.0, 0.0, 0.0)):
        for rows in worn.turned(turn):
            with pytest.raises(ValueError, match="read-only"):
                rows += 1.0
