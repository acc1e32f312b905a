"""surface.head.posing.baked: shade and decimated triangles survive their files, and belong to one order of vertices."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ball_head import skin
from small_head import small_head

from surface.base.errors import HeadFileError
from surface.head import Head, HeadData, save_data
from surface.head.model.meshes import make_surface, pack, tessellate
from surface.head.posing.baked import (
    DECIMATED,
    SHADE,
    apply_decimated,
    apply_shade,
    checksum,
    read_decimated,
    read_shade,
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
