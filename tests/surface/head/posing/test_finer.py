"""surface.head.posing.finer: what was baked for a mesh is carried over to the same mesh made finer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_head import small_head

from surface.head import Head, save_data
from surface.head.model.light import LightPoints, with_light
from surface.head.model.meshes import make_surface, pack, tessellate
from surface.head.posing.baked import write_decimated, write_shade
from surface.head.posing.finer import Original, apply_baked, coarser_of

KNOTS = np.linspace(0.4, 0.6, 5)[None]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A head with stored meshes, shade and decimated triangles of its parts."""
    data = small_head(seams=[])
    parts = [replace(part, mesh=pack(tessellate(part, make_surface(part), []), part.budget)) for part in data.parts]
    save_data(tmp_path, replace(data, parts=parts))
    head = Head.load(tmp_path)
    shares = {part.name: np.linspace(0.2, 1.0, len(part.vertices))[:, None] for part in head.parts}
    shares["a/thin"] = np.linspace(0.0, 1.0, len(head.parts[0].vertices))[:, None]
    write_shade(tmp_path, shares, head.parts)
    few = {f"{part.name}/{level}": part.triangles[::step] for part in head.parts
           for level, step in (("full", 2), ("fast", 4))}  # fmt: skip
    write_decimated(tmp_path, head.parts, few)
    return tmp_path


def test_the_fewer_triangles_of_a_part_are_found_by_level(folder: Path) -> None:
    head = Head.load(folder)
    part = head.parts[0]
    found = coarser_of(folder, "a", part.mesh)
    assert found.keys() == {"full", "fast"} and found["fast"].dtype == np.int64
    np.testing.assert_array_equal(found["full"], part.triangles[::2])
    assert coarser_of(folder, "nobody", part.mesh) == {}
    (folder / "decimated.npz").unlink()
    assert coarser_of(folder, "a", part.mesh) == {}


def test_a_part_whose_mesh_is_the_stored_one_gets_what_was_baked(folder: Path) -> None:
    head = Head.load(folder)
    for part in head.parts:
        np.testing.assert_allclose(
            part.attributes["occlusion"][:, 0], np.linspace(0.2, 1.0, len(part.vertices)), atol=2e-3
        )
        assert len(part.decimated["full"]) == -(-len(part.triangles) // 2)
        assert len(part.decimated["fast"]) == -(-len(part.triangles) // 4)


def test_a_part_that_became_finer_keeps_its_shade_and_has_middles_between(folder: Path) -> None:
    plain = Head.load(folder)
    light = LightPoints("a", KNOTS, KNOTS)
    fine = Head.load(folder, light=[light])
    before, after = plain.parts[0], fine.parts[0]
    n = len(before.vertices)
    assert len(after.vertices) > n
    for name in ("occlusion", "thin"):
        np.testing.assert_allclose(after.attributes[name][:n], before.attributes[name], atol=1e-6)
        new = after.attributes[name][n:]
        assert before.attributes[name].min() <= new.min() and new.max() <= before.attributes[name].max()
    _, refined = with_light(plain.data, [light], lambda name, mesh: coarser_of(folder, name, mesh))
    a, b = refined["a"].ends.T
    shade = after.attributes["occlusion"]
    np.testing.assert_allclose(shade[n:], 0.5 * (shade[a] + shade[b]), atol=3e-3)  # of the two that it lies between
    for level in ("full", "fast"):
        np.testing.assert_array_equal(after.decimated[level], refined["a"].coarser[level])
    assert len(after.decimated["full"]) > len(before.decimated["full"])
    for one, other in zip(plain.parts[1:], fine.parts[1:], strict=True):  # the others are as they were
        np.testing.assert_array_equal(one.attributes["occlusion"], other.attributes["occlusion"])
        np.testing.assert_array_equal(one.decimated["fast"], other.decimated["fast"])


def test_without_baked_files_nothing_is_set(folder: Path) -> None:
    for name in ("occlusion.npz", "decimated.npz"):
        (folder / name).unlink()
    head = Head.load(folder, light=[LightPoints("a", KNOTS, KNOTS)])
    assert all("occlusion" not in part.attributes and not part.decimated for part in head.parts)
    apply_baked(folder, head.parts, {})


def test_a_part_is_known_as_the_files_know_it() -> None:
    mesh: object = object()
    made = Original("a", mesh)  # type: ignore[arg-type]
    assert (made.name, made.mesh, made.stored) == ("a", mesh, True)
