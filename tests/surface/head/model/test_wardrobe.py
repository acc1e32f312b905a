"""surface.head.model.wardrobe: garments are read, checked and seated on the skin of a head."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_head import all_points, part, small_head

from surface.base.errors import HeadFileError
from surface.head import Head
from surface.head.model.data import HeadData, PartData
from surface.head.model.file import load_data
from surface.head.model.look import Look, Worn
from surface.head.model.meshes import KEYS, make_surface
from surface.head.model.wardrobe import Garment, WornPart, outline, read_garment, with_garments

CONFIGS = Path(__file__).resolve().parents[4] / "configs"
ICT, WARDROBE = CONFIGS / "heads" / "ict", CONFIGS / "wardrobe"
GREY = (0.2, 0.2, 0.2)


def test_a_garment_knows_the_head_it_was_made_for() -> None:
    garment = read_garment(Worn(WARDROBE / "hair-crop.npz", GREY))
    head = load_data(ICT)
    assert garment.fit == outline(head, garment.anchors)
    face = head.parts[0]
    moved = replace(face, points=face.points + 1.0)
    assert outline(replace(head, parts=[moved, *head.parts[1:]]), garment.anchors) == garment.fit, "any identity"
    other = replace(head, parts=[replace(face, loops=[loop * 0.99 for loop in face.loops]), *head.parts[1:]])
    with pytest.raises(HeadFileError, match="hair-crop was made for another head"):
        with_garments(other, (garment,), "there")
    assert len(with_garments(other, (replace(garment, fit=None),), "there").parts) == len(head.parts) + 1


@pytest.mark.parametrize("key", ["hair/follow", "hair/strands", "hair/fast"])
def test_a_garment_whose_arrays_do_not_belong_together_is_refused_by_its_path(tmp_path: Path, key: str) -> None:
    with np.load(WARDROBE / "hair-crop.npz") as file:
        arrays = dict(file)
    wrong = arrays[key] + 5000 if key == "hair/fast" else arrays[key][:5]
    np.savez(tmp_path / "cut.npz", **arrays | {key: wrong})
    with pytest.raises(HeadFileError, match=rf"cut\.npz: .*{key}"):
        read_garment(Worn(tmp_path / "cut.npz", GREY))


def test_triangles_of_a_garment_end_at_its_last_vertex(tmp_path: Path) -> None:
    with np.load(WARDROBE / "hair-crop.npz") as file:
        arrays = dict(file)
    table = arrays["hair/mesh_triangles"].astype(np.int64)
    for beyond, ends in ((0, False), (1, True)):
        table[0, 0] = len(arrays["hair/mesh_uv"]) - 1 + beyond
        np.savez(tmp_path / "end.npz", **arrays | {"hair/mesh_triangles": table})
        if ends:
            with pytest.raises(HeadFileError, match="hair/mesh_triangles is no table"):
                read_garment(Worn(tmp_path / "end.npz", GREY))
        else:
            read_garment(Worn(tmp_path / "end.npz", GREY))


def test_a_garment_with_what_is_no_number_is_refused(tmp_path: Path) -> None:
    with np.load(WARDROBE / "hair-crop.npz") as file:
        arrays = dict(file)
    strands = arrays["hair/strands"].astype(np.float32)
    strands[7, 2] = np.nan
    np.savez(tmp_path / "nan.npz", **arrays | {"hair/strands": strands})
    with pytest.raises(HeadFileError, match=r"nan\.npz: .*hair/strands holds what is no finite number"):
        read_garment(Worn(tmp_path / "nan.npz", GREY))


def test_points_of_a_garment_lie_on_parts_that_it_names(tmp_path: Path) -> None:
    with np.load(WARDROBE / "hair-crop.npz") as file:
        arrays = dict(file)
    np.savez(tmp_path / "far.npz", **arrays | {"hair/anchor": arrays["hair/anchor"] + 7.0})
    with pytest.raises(HeadFileError, match=r"far\.npz: .*hair/anchor"):
        read_garment(Worn(tmp_path / "far.npz", GREY))


@pytest.mark.parametrize("names", [np.arange(12).reshape(4, 3), np.array(["a" * 200]), np.array(["a"] * 100)])
def test_names_in_a_garment_are_bounded(tmp_path: Path, names: np.ndarray) -> None:
    with np.load(WARDROBE / "hair-crop.npz") as file:
        arrays = dict(file)
    np.savez(tmp_path / "named.npz", **arrays | {"anchors": names})
    with pytest.raises(HeadFileError, match=r"named\.npz: anchors is no list of at most"):
        read_garment(Worn(tmp_path / "named.npz", GREY))


def test_a_garment_with_the_mesh_of_another_is_refused(tmp_path: Path) -> None:
    with np.load(WARDROBE / "hair-crop.npz") as file:
        arrays = dict(file)
    np.savez(tmp_path / "other.npz", **arrays | {"hair/mesh_made": arrays["hair/mesh_made"] + 1.0})
    with pytest.raises(HeadFileError, match=r"other\.npz: is damaged: hair/strands"):
        Head.load(ICT, None, Look(worn=(Worn(tmp_path / "other.npz", GREY),)))


# ---------------------------------------------------------------- seated on a small head
N = 12
PLACES = np.random.default_rng(3).random((N, 2))
SIDE = np.arange(N) % 2  # of the anchors a and b
OFFSETS = np.random.default_rng(4).normal(size=(N, 3))
FOLLOW = np.where(np.arange(N) < 8, np.linspace(0.0, 1.0, N), 0.0)


def garment(**changes: Any) -> Garment:
    """Twelve points over the parts a and b, of which some follow the skin and all sway."""
    arrays = {
        "points": OFFSETS, "anchor": np.column_stack([SIDE, PLACES]), "degrees": np.full((N, 2), 1), "follow": FOLLOW,
        "sway": np.full(N, 0.5), **dict.fromkeys(("knots_u", "knots_v"), np.tile([0.0, 0.5, 1.0], (N, 1))),
        **dict.fromkeys(KEYS, np.zeros(1)), "mesh_uv": np.array([[0.25, 0.5], [3.0, 1.0]]),
        "mesh_made": np.array([7.0, 0.5, 3.0, 9.0]), **changes,
    }  # fmt: skip
    worn = WornPart("cap", "hair", arrays)
    return Garment(Worn(Path("cap.npz"), GREY), ("a", "b"), (worn,), {})


def head(**other: Any) -> HeadData:
    """Two parts that move with a shape, and with the jaw, each in its own way."""
    a = part("a", -40, groups=[all_points("mouthPucker", (1, 2, 3))], jaw=np.linspace(0, 1, 25))
    b = part("b", 0.5, groups=[all_points("mouthPucker", (0, 0, -5)), all_points("cheekPuff", (0, 4, 0))])
    return small_head(parts=[a, b], **other)


def seated(made: Garment | None = None) -> PartData:
    return with_garments(head(), (made or garment(),), "there").parts[-1]


def test_points_stand_off_the_skin_at_their_places() -> None:
    own, cap = head(), seated()
    for k in range(N):
        on_skin = make_surface(own.parts[SIDE[k]]).evaluate(PLACES[k : k + 1])[0]
        np.testing.assert_allclose(cap.points[k], on_skin + OFFSETS[k], atol=1e-9)
    assert (cap.name, cap.material, cap.follows) == ("cap", "hair", "skin") and (cap.weights == 1.0).all()
    assert cap.rect == (0.25, 3.0, 0.5, 1.0) and cap.budget == (7, 0.5, 3) and not cap.lids.any()
    assert [p.name for p in with_garments(own, (garment(), garment()), "x").parts] == ["a", "b", "cap", "cap"]


def test_points_take_their_share_of_what_the_skin_does() -> None:
    """Of the jaw, and of every shape, as the surface moves at their places."""
    own, cap = head(), seated()
    moves = {"mouthPucker": np.array([[1.0, 2, 3], [0, 0, -5]]), "cheekPuff": np.array([[0.0, 0, 0], [0, 4, 0]])}
    for name, each in moves.items():
        group = next(g for g in cap.groups if g.name == name)
        dense = np.zeros((N, 3))
        dense[group.ids] = group.moves
        np.testing.assert_allclose(dense, FOLLOW[:, None] * each[SIDE], atol=1e-6)
    for k in range(N):
        surface, jaw = make_surface(own.parts[SIDE[k]]), own.parts[SIDE[k]].jaw
        wanted = FOLLOW[k] * (surface.basis_matrix(PLACES[k : k + 1]) @ jaw)[0]
        assert cap.jaw[k] == pytest.approx(wanted, abs=1e-9)


def test_points_sway_about_the_neck_by_their_share() -> None:
    cap, pivot = seated(), np.array([0.0, -50.0, 0.0])
    for name, axis in (("swayYaw", [0, 1, 0]), ("swayPitch", [1, 0, 0]), ("swayRoll", [0, 0, 1])):
        group = next(g for g in cap.groups if g.name == name)
        np.testing.assert_allclose(group.moves, 0.5 * np.cross(axis, cap.points - pivot)[group.ids], rtol=1e-5)
    still = seated(garment(sway=np.zeros(N), follow=np.zeros(N)))
    assert still.groups == [] and not still.jaw.any()


def test_moves_below_a_ten_thousandth_of_a_millimetre_are_left_out() -> None:
    faint = seated(garment(follow=np.where(np.arange(N) == 3, 1e-5, FOLLOW), sway=np.zeros(N)))
    pucker = next(g for g in faint.groups if g.name == "mouthPucker")
    assert 3 not in pucker.ids and set(pucker.ids) <= set(np.flatnonzero(FOLLOW > 0.0)) and len(pucker.ids) >= 6


def test_a_garment_for_other_parts_or_beside_the_skin_is_refused() -> None:
    far = replace(garment(), anchors=("a", "scalp"))
    with pytest.raises(HeadFileError, match="there: cap fits a head with the parts a, scalp, which this one has not"):
        with_garments(head(), (far,), "there")
    beside = garment(anchor=np.column_stack([SIDE, PLACES + 9.0]))
    with pytest.raises(HeadFileError, match=r"cap\.npz: is damaged: .* is outside the domain"):
        with_garments(head(), (beside,), "there")
    with pytest.raises(HeadFileError, match="there: cap does not lie on this head"):
        with_garments(head(), (garment(points=OFFSETS * np.nan),), "there")
    with pytest.raises(HeadFileError, match=r"cap\.npz: is damaged"):
        with_garments(head(), (garment(mesh_made=np.zeros(2)),), "there")


def test_an_outline_is_that_of_the_loops_and_slits_of_the_parts_in_their_order() -> None:
    own = head()
    first = outline(own, ("a", "b"))
    assert first == outline(head(), ("a", "b")) and first not in (outline(own, ("a",)), 0)
    slit = replace(own.parts[0], slits=np.array([[0.5, 0.2, 0.8]]))
    assert outline(replace(own, parts=[slit, own.parts[1]]), ("a", "b")) != first
    near = replace(own.parts[0], loops=[loop + 1e-6 for loop in own.parts[0].loops])  # of the last digits
    assert outline(replace(own, parts=[near, own.parts[1]]), ("a", "b")) == first
    uneven = replace(own.parts[0], loops=[own.parts[0].loops[0] * [1.0, 0.9]])
    swapped = [outline(replace(own, parts=[uneven, own.parts[1]]), order) for order in (("a", "b"), ("b", "a"))]
    assert swapped[0] != swapped[1]


def test_pictures_are_read_as_shares(tmp_path: Path) -> None:
    with np.load(WARDROBE / "hair-crop.npz") as file:
        arrays = dict(file)
    arrays["cover/face"] = np.array([[0, 51], [128, 255]], np.uint8)
    del arrays["fit"]
    np.savez(tmp_path / "a.npz", **arrays)
    found = read_garment(Worn(tmp_path / "a.npz", GREY))
    np.testing.assert_allclose(found.fields["cover/face"], [[0.0, 0.2], [128 / 255, 1.0]], rtol=1e-6)
    assert found.fit is None and found.anchors == ("face", "back")
    assert all(key.split("/")[0] in ("cover", "hidden", "shadow") for key in found.fields)
