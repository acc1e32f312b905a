"""surface.head.posing.baked: shade and decimated triangles survive their files, and belong to one order of vertices."""

from __future__ import annotations

import struct
import zlib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from ball_head import skin
from small_head import small_head

from surface.base.errors import HeadFileError
from surface.head import Head, HeadData, save_data
from surface.head.model.meshes import make_surface, pack, tessellate
from surface.head.posing import baked
from surface.head.posing.baked import (
    DECIMATED,
    SHADE,
    apply_decimated,
    apply_shade,
    checksum,
    read_decimated,
    read_shade,
    tessellation_key,
    write_decimated,
    write_shade,
)


def test_shares_survive_the_file(tmp_path: Path) -> None:
    share = np.linspace(0, 1, 30)[:, None]
    path = write_shade(tmp_path, {"face": share, "back": np.ones((4, 1))})
    assert path == tmp_path / SHADE
    back = read_shade(tmp_path / "head.toml")
    assert back["face"] == pytest.approx(share, abs=0.5 / 255 + 1e-6)
    assert (back["back"] == 1.0).all()
    assert [entry.name for entry in tmp_path.iterdir()] == [SHADE]


def test_a_head_without_shade(tmp_path: Path) -> None:
    assert read_shade(tmp_path) == {}


def test_a_damaged_file_is_named(tmp_path: Path) -> None:
    write_shade(tmp_path, {"face": np.ones((300, 1))})
    whole = (tmp_path / SHADE).read_bytes()
    (tmp_path / SHADE).write_bytes(whole[: len(whole) // 2])
    with pytest.raises(HeadFileError, match=SHADE) as caught:
        read_shade(tmp_path)
    assert "delete" in caught.value.hint


def test_shade_darkens_what_is_painted_and_passes_over_another_mesh() -> None:
    part = skin()
    count = len(part.rest)
    apply_shade([part], {"face": np.full((count, 1), 0.5, np.float32), "gone": np.ones((3, 1), np.float32)})
    apply_shade([part], {"face": np.full((count, 1), 0.5, np.float32)})
    assert part.attributes["occlusion"] == pytest.approx(np.full((count, 1), 0.25))
    apply_shade([part], {"face": np.zeros((count - 1, 1), np.float32)})
    assert part.attributes["occlusion"].min() == pytest.approx(0.25)


def test_shade_stops_at_a_painted_floor() -> None:
    part = skin()
    part.attributes["occlusion_floor"] = np.full((len(part.rest), 1), 0.4, np.float32)
    apply_shade([part], {"face": np.linspace(0.0, 1.0, len(part.rest), dtype=np.float32)[:, None]})
    assert part.attributes["occlusion"].min() == pytest.approx(0.4)
    assert part.attributes["occlusion"].max() == pytest.approx(1.0)


@pytest.fixture(scope="module")
def head() -> Head:
    return Head(small_head())


def test_triangles_survive_the_file(head: Head, tmp_path: Path) -> None:
    few = head.part("a").triangles[::2]
    assert write_decimated(tmp_path, head.parts, {"a/fast": few}) == tmp_path / DECIMATED
    apply_decimated(head.parts, read_decimated(tmp_path / "head.toml"))
    assert head.part("a").decimated.keys() == {"fast"}
    assert np.array_equal(head.part("a").decimated["fast"], few)
    assert head.part("b").decimated == {}
    assert [entry.name for entry in tmp_path.iterdir()] == [DECIMATED]


def test_another_tessellation_or_an_index_out_of_range_is_passed_over(head: Head, tmp_path: Path) -> None:
    other = Head(small_head())
    triangles = other.part("a").triangles
    write_decimated(tmp_path, head.parts, {"a/fast": triangles, "b/fast": triangles + len(head.part("b").vertices)})
    decimated = read_decimated(tmp_path)
    other.part("a").triangles = triangles[::-1].copy()
    apply_decimated(other.parts, decimated)
    assert all(part.decimated == {} for part in other.parts)


def test_a_head_without_triangles(tmp_path: Path) -> None:
    assert read_decimated(tmp_path) == {}


def test_damaged_triangles_are_named(head: Head, tmp_path: Path) -> None:
    path = write_decimated(tmp_path, head.parts, {"a/full": head.part("a").triangles})
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(HeadFileError, match=DECIMATED) as caught:
        read_decimated(tmp_path)
    assert "delete" in caught.value.hint


def with_meshes(turned: bool = False) -> HeadData:
    """The small head with its tessellation kept in its file; or with the vertices of part "a" in another order."""
    data = small_head()
    meshes = [pack(tessellate(p, make_surface(p), data.seams), p.budget) for p in data.parts]
    if turned:
        order = meshes[0]["mesh_cell_start"][1]  # the vertices of the first cell, the other way round
        rank = np.arange(len(meshes[0]["mesh_uv"]))
        rank[:order] = rank[:order][::-1]
        meshes[0] |= {k: meshes[0][k][rank] for k in ("mesh_uv", "mesh_side")}
        meshes[0]["mesh_triangles"] = rank[meshes[0]["mesh_triangles"]].astype(np.int32)
    return replace(data, parts=[replace(p, mesh=mesh) for p, mesh in zip(data.parts, meshes, strict=True)])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A head with shade and decimated triangles of part "a" beside it."""
    save_data(tmp_path, with_meshes())
    head = Head.load(tmp_path)
    half = np.full((len(head.part("a").vertices), 1), 0.5)
    write_shade(tmp_path, {"a": half, "a/thin": half}, head.parts)
    write_decimated(tmp_path, head.parts, {"a/fast": head.part("a").triangles[::2]})
    return tmp_path


def shaded(head: Head) -> bool:
    """Does part "a" have what stands beside the head?"""
    part = head.part("a")
    found = ["occlusion" in part.attributes, "thin" in part.attributes, part.decimated != {}]
    assert len(set(found)) == 1
    return found[0]


def test_files_are_used_with_the_head_they_were_made_for(folder: Path) -> None:
    assert shaded(Head.load(folder))


@pytest.mark.parametrize("file", [SHADE, DECIMATED])
def test_another_order_of_as_many_vertices_is_refused_with_what_to_do(folder: Path, file: str) -> None:
    before = Head.load(folder).part("a")
    other = DECIMATED if file == SHADE else SHADE
    (folder / other).unlink()
    save_data(folder, with_meshes(turned=True))
    with pytest.raises(HeadFileError, match=rf"{file}: was made for another mesh of part 'a'") as caught:
        Head.load(folder)
    assert caught.value.hint == f"delete {folder / file}, or make the head again: omote fit MESH -o {folder}"
    (folder / file).unlink()
    assert len(Head.load(folder).part("a").vertices) == len(before.vertices)


def test_another_budget_leaves_the_files_out(folder: Path) -> None:
    toml = folder / "head.toml"
    toml.write_text(toml.read_text().replace("    0.1,\n    4,\n]", "    0.3,\n    4,\n]"))
    head = Head.load(folder)
    assert not head.part("a").stored
    assert not shaded(head)


def test_older_files_without_checksums_are_read(folder: Path) -> None:
    for name in (SHADE, DECIMATED):
        with np.load(folder / name) as stored:
            arrays = {k: stored[k] for k in stored.files if not k.startswith("omote/")}
        np.savez_compressed(folder / name, **arrays)
    assert shaded(Head.load(folder))


def test_the_checksum_sees_order_and_places_but_no_last_bits() -> None:
    rng = np.random.default_rng(0)
    uv, triangles = rng.integers(0, 257, (300, 2)) / 256.0, rng.integers(0, 300, (500, 3))
    check = checksum(triangles, uv)
    assert check == checksum(triangles.astype(np.int32), np.nextafter(uv, 2.0)) == checksum(triangles, uv - 1e-12)
    assert check != checksum(triangles[::-1], uv)
    assert check != checksum(triangles, uv[::-1])
    assert check != checksum(triangles, uv + 1 / 256)


def test_the_checksum_is_that_of_the_files_that_heads_have() -> None:
    """Steps of 1/16384, rounded up from two thirds: another rule would refuse every file written before."""
    uv = np.array([[0.0, 0.5], [1.0, 0.25], [8191.7 / 16384, 8191.6 / 16384], [0.75, 4096.6 / 16384]])
    places = struct.pack("<8i", 0, 8192, 16384, 4096, 8192, 8191, 12288, 4096)
    triangles = struct.pack("<6i", 0, 1, 2, 2, 1, 3)
    assert checksum(np.array([[0, 1, 2], [2, 1, 3]]), uv) == zlib.crc32(triangles + places)


def test_the_key_of_a_mesh_is_that_of_the_files_that_heads_have() -> None:
    rng = np.random.default_rng(1)
    for _ in range(12):
        triangles = rng.integers(0, 9, (4, 3))
        part: Any = SimpleNamespace(vertices=np.zeros((9, 3)), triangles=triangles)
        check = zlib.crc32(struct.pack("<12i", *triangles.ravel()))
        assert tessellation_key(part).tolist() == [9, 4, check % 2**31]


def test_shares_beyond_their_range_are_kept_within_it(tmp_path: Path) -> None:
    write_shade(tmp_path, {"face": np.array([[-0.3], [0.0], [0.5], [1.0], [1.7]])})
    assert read_shade(tmp_path)["face"] == pytest.approx(np.array([[0], [0], [128 / 255], [1], [1]]), abs=1e-6)


def test_only_what_belongs_to_a_changed_part_is_left_out(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    meshes = [SimpleNamespace(triangles=rng.integers(0, 9, (5, 3)), uv=rng.random((9, 2))) for _ in range(3)]
    parts: list[Any] = [
        SimpleNamespace(name=name, mesh=mesh, stored=False) for name, mesh in zip(("a", "ab", "c"), meshes, strict=True)
    ]
    names = ("a", "a/thin", "ab", "ab/thin", "c", "c/visible")
    write_shade(tmp_path, {name: np.ones((9, 1)) for name in names}, parts)
    assert set(read_shade(tmp_path, parts)) == set(names)
    parts[0].mesh = meshes[1]
    assert set(read_shade(tmp_path, parts)) == {"ab", "ab/thin", "c", "c/visible"}
    parts[0].stored = True
    with pytest.raises(HeadFileError, match="of part 'a'"):
        read_shade(tmp_path, parts)


def test_sky_and_thin_flesh_are_taken_where_they_fit() -> None:
    part = skin()
    count = len(part.rest)
    sky, thin = np.random.default_rng(0).random((count, 4)), np.ones((count - 1, 1))
    apply_shade([part], {"face/visible": sky, "face/thin": thin, "other/thin": np.ones((count, 1))})
    assert part.attributes["visible"] is sky and set(part.attributes) == {"visible"}


GOOD = np.array([[0, 1, 2], [2, 1, 3]], np.int32)


@pytest.mark.parametrize(
    ("triangles", "taken"),
    [(GOOD, True), (GOOD + 1, False), (GOOD - 1, False), (GOOD[:0], False), (GOOD[0], False), (GOOD[:, :2], False),
     (GOOD[None], False), (GOOD[:1], True)],
)  # fmt: skip
def test_triangles_are_taken_that_can_be_drawn(triangles: np.ndarray, taken: bool) -> None:
    part: Any = SimpleNamespace(name="a", vertices=np.zeros((4, 3)), triangles=GOOD, decimated={})
    apply_decimated([part], {"a": tessellation_key(part), "a/full": triangles, "a/other": GOOD})
    assert set(part.decimated) == ({"full"} if taken else set())


@pytest.mark.parametrize(("highest", "kind"), [(65535, np.uint16), (65536, np.uint32)])
def test_indices_are_stored_as_narrowly_as_they_can_be(tmp_path: Path, highest: int, kind: type) -> None:
    triangles = np.array([[0, 1, highest]], np.int32)
    path = write_decimated(tmp_path, [], {"a/full": triangles})
    with np.load(path) as stored:
        assert stored["a/full"].dtype == kind
    assert read_decimated(tmp_path)["a/full"].tolist() == triangles.tolist()


def test_rows_of_another_mesh_are_no_attribute_of_a_part() -> None:
    one, other = (SimpleNamespace(name=name, vertices=np.zeros((3, 3)), attributes={}) for name in ("a", "b"))
    rows = {"a": np.ones((3, 2), np.float32), "b": np.ones((4, 2), np.float32)}
    baked.set_attribute([one, other], "grain", rows)  # type: ignore[list-item]
    assert one.attributes["grain"] is rows["a"] and not other.attributes
