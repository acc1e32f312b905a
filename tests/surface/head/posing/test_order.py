"""Files beside a head belong to one order of its vertices."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_head import small_head

from surface.base.errors import HeadFileError
from surface.head import Head, HeadData, save_data
from surface.head.model.meshes import make_surface, pack, tessellate
from surface.head.posing import decimation, shade
from surface.head.posing.order import checksum


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
    shade.write_shade(tmp_path, {"a": half, "a/thin": half}, head.parts)
    decimation.write_decimated(tmp_path, head.parts, {"a/fast": head.part("a").triangles[::2]})
    return tmp_path


def shaded(head: Head) -> bool:
    """Does part "a" have what stands beside the head?"""
    part = head.part("a")
    found = ["occlusion" in part.attributes, "thin" in part.attributes, part.decimated != {}]
    assert len(set(found)) == 1
    return found[0]


def test_files_are_used_with_the_head_they_were_made_for(folder: Path) -> None:
    assert shaded(Head.load(folder))


@pytest.mark.parametrize("file", [shade.FILE, decimation.FILE])
def test_another_order_of_as_many_vertices_is_refused_with_what_to_do(folder: Path, file: str) -> None:
    before = Head.load(folder).part("a")
    other = decimation.FILE if file == shade.FILE else shade.FILE
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
    for name in (shade.FILE, decimation.FILE):
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
