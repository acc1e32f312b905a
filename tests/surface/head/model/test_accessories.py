"""surface.head.model.accessories"""

from __future__ import annotations

import random
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from cards import RED, card, picture
from small_head import small_head

from surface.base.errors import HeadFileError
from surface.head import Head, save_data
from surface.head.model.accessories import FILE, Accessory, fault_of, read_accessories, write_accessories
from surface.head.model.sidecar import FORMAT
from tests.fuzz.mutators import mutate


def test_all_of_them_come_back(tmp_path: Path) -> None:
    jpeg = picture(RED[:3], kind="JPEG")
    glasses = replace(card(), name="Brille 眼鏡", kind="glasses", texture=jpeg, alpha="BLEND", two_sided=False)
    turned = np.array([[2, 1, 0]], np.int32)
    wanted = [replace(card(), colour=(0.5, 0.25, 1.0, 0.5), alpha="MASK", cutoff=0.25), glasses,
              replace(card(), outside=turned)]  # fmt: skip
    assert write_accessories(tmp_path, wanted) == tmp_path / FILE
    found = read_accessories(tmp_path)
    assert [one.mime for one in found] == ["image/png", "image/jpeg", "image/png"]
    for one, other in zip(found, wanted, strict=True):
        for field in fields(one):
            np.testing.assert_array_equal(getattr(one, field.name), getattr(other, field.name))
            assert type(getattr(one, field.name)) is type(getattr(other, field.name))


def test_a_head_without_any_has_no_file_and_one_of_the_head_before_goes(tmp_path: Path) -> None:
    assert read_accessories(tmp_path) == ()
    write_accessories(tmp_path, [card()])
    assert write_accessories(tmp_path, []) is None and list(tmp_path.iterdir()) == []


def test_a_head_wears_what_lies_beside_it(tmp_path: Path) -> None:
    save_data(tmp_path, small_head())
    assert Head.load(tmp_path).accessories == ()
    write_accessories(tmp_path, [card()])
    (worn,) = Head.load(tmp_path).accessories
    assert worn.accessory.name == "Card" and worn.pivot == (0.0, -50.0, 0.0)


MUTATIONS = 150
DAMAGE = {
    "names": np.array([1, 2]), "kinds": np.array(["boots"]), "alphas": np.array(["OPAQUE", "MASK"]),
    "colours": np.ones((1, 3), np.float32), "cutoffs": np.array([np.nan], np.float32),
    "two_sided": np.ones((2,), np.uint8), "0/vertices": np.full((4, 3), np.inf, np.float32),
    "0/normals": np.ones((3, 3), np.float32), "0/uv": np.ones((4, 3), np.float32),
    "0/triangles": np.array([[0, 1, 4]], np.int32), "0/shade": np.ones(5, np.float32),
    "0/texture": np.frombuffer(b"GIF89a", np.uint8),
}  # fmt: skip


@pytest.mark.parametrize("key", DAMAGE)
@pytest.mark.parametrize("how", ["other", "missing"])
def test_a_damaged_file_is_refused_with_the_array_that_is_wrong(tmp_path: Path, key: str, how: str) -> None:
    path = write_accessories(tmp_path, [card()])
    assert path is not None
    arrays = dict(np.load(path))
    arrays = {**arrays, key: DAMAGE[key]} if how == "other" else {k: v for k, v in arrays.items() if k != key}
    np.savez_compressed(path, **arrays)
    with pytest.raises(HeadFileError, match=rf"accessories\.npz: .*{key}") as caught:
        read_accessories(tmp_path)
    assert "omote fit" in str(caught.value.hint)


def test_negative_and_no_triangles_are_refused_too_and_a_newer_version(tmp_path: Path) -> None:
    path = write_accessories(tmp_path, [card()])
    assert path is not None
    arrays = dict(np.load(path))
    for key, array in (
        ("0/triangles", np.array([[0, 1, -1]])), ("0/outside", np.array([[0, 1, 4]])), ("0/outside", np.ones((1, 3))),
        ("0/outside", np.zeros((9, 2), np.int32)), ("0/triangles", np.zeros((0, 3), np.int32)),
        (FORMAT, np.array([99])),
    ):  # fmt: skip
        np.savez_compressed(path, **{**arrays, key: array})
        with pytest.raises(HeadFileError):
            read_accessories(tmp_path)


MANY = replace(card(), **{key: np.zeros((400_001, n), np.float32) for key, n in (("vertices", 3), ("uv", 2))})
FAR = np.full((4, 3), 2e5, np.float32)


@pytest.mark.parametrize(("worn", "why"), [
    ([replace(card(), vertices=FAR)], "'Card': 0/vertices"), ([replace(card(), uv=FAR[:, :2])], "'Card': 0/uv"),
    ([card(), replace(card(), name="b", texture=b"GIF89a")], "'b': 1/texture is neither PNG nor JPEG"),
    ([replace(card(), name=257 * "a")], "names have 257 letters, 256 are the most"),
    ([card()] * 257, "names are 257, 256 are the most"), ([card(kind="boots")], "kinds"),
    ([replace(card(), triangles=np.zeros((1_000_001, 3), np.int32))], "1000001 triangles, 1000000 are the most"),
    ([MANY], "400001 vertices, 400000 are the most"),
])  # fmt: skip
def test_nothing_is_written_that_could_not_be_read(tmp_path: Path, worn: list[Accessory], why: str) -> None:
    path = write_accessories(tmp_path, [card()])
    assert path is not None
    before = path.read_bytes()
    with pytest.raises(HeadFileError, match="could not be read again") as caught:
        write_accessories(tmp_path, worn)
    assert why in str(caught.value) and path.read_bytes() == before
    assert why in fault_of(*worn) and fault_of(card()) == ""


def test_a_file_that_is_cut_short_is_refused(tmp_path: Path) -> None:
    save_data(tmp_path, small_head())
    path = write_accessories(tmp_path, [card()])
    assert path is not None
    path.write_bytes(path.read_bytes()[:400])
    with pytest.raises(HeadFileError, match=r"accessories\.npz"):
        Head.load(tmp_path)


def test_files_with_seeded_damage_are_read_or_refused_in_plain_words(tmp_path: Path) -> None:
    """``make fuzz`` reads more of them, as whole heads."""
    path = write_accessories(tmp_path, [card(), replace(card(), name="Band", texture=b"")])
    assert path is not None
    sound, refused = path.read_bytes(), 0
    for seed in range(MUTATIONS):
        path.write_bytes(mutate(sound, random.Random(seed)))
        try:
            read_accessories(tmp_path)
        except HeadFileError as error:
            refused += 1
            assert str(error).startswith(f"{path}: ") and error.hint and "\n" not in str(error)
    assert MUTATIONS // 2 < refused < MUTATIONS


def test_a_texture_repeats_only_where_its_coordinates_leave_it() -> None:
    assert not card().repeats
    assert replace(card(), uv=card().uv + np.float32(0.5)).repeats
