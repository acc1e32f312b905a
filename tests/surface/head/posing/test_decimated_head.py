"""surface.head.posing.decimated_head"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from shapes import hills
from small_head import all_points, small_head
from small_head import part as patch

from surface.head import Head
from surface.head.model.data import Neck, Seam
from surface.head.posing.decimated_head import DecimatedHead, submesh

VALUES = ({}, {"mouthPucker": 0.7, "headYaw": 0.3}, {"jawOpen": 0.4, "headYaw": 0.3}, {"jawOpen": 0.4})


@pytest.fixture(scope="module")
def head() -> Head:
    made = Head(small_head())
    for part in made.parts:
        part.decimated = {"fast": part.triangles[::3]}
    return made


@pytest.fixture
def decimated(head: Head) -> DecimatedHead:
    return DecimatedHead(head, head.parts[::-1], "fast", {"a": np.array([2, 5])})


def assert_alike(decimated: DecimatedHead) -> None:
    """Within one unit in the last place of a number of 128 to 256 mm: two ways to sum round differently."""
    for part in decimated.parts:
        own = slice(part.first, part.last)
        assert decimated.vertices[own] == pytest.approx(part.part.vertices[part.kept], abs=1.6e-5)
        assert decimated.normals[own] == pytest.approx(part.part.normals[part.kept], abs=1e-4)


def test_what_is_kept_stands_where_the_head_has_it(head: Head, decimated: DecimatedHead) -> None:
    for given in VALUES:
        head.pose(head.values(given))
        decimated.pose(head.values(given))
        assert_alike(decimated)


def test_triangles_and_vertices_asked_for_are_kept_and_others_are_not(head: Head, decimated: DecimatedHead) -> None:
    of = {part.part.name: part for part in decimated.parts}
    for name, part in of.items():
        assert np.array_equal(part.kept[part.triangles], part.part.decimated["fast"])
        assert len(part.kept) < len(head.part(name).vertices)
    assert np.array_equal(of["a"].kept[of["a"].rows(np.array([5, 2])) - of["a"].first], [5, 2])


def test_only_what_moved_is_said_to_have_changed(head: Head, decimated: DecimatedHead) -> None:
    changed = []
    for given in ({"mouthPucker": 0.5}, {"mouthPucker": 0.5}, {"mouthPucker": 0.5, "jawOpen": 0.5}, {"headYaw": 0.1}):
        decimated.pose(head.values(given))
        changed.append({part.part.name for part in decimated.parts if part.changed})
    assert changed == [{"a", "b"}, set(), {"tooth"}, {"a", "b", "tooth"}]


def test_what_hangs_on_a_border_that_hangs_on_another_is_said_to_have_changed() -> None:
    line, data = np.linspace(0, 1, 6), small_head()
    under = Seam("b", "c", np.column_stack([line, np.zeros(6)]), np.column_stack([line, np.ones(6)]))
    parts = [patch("a", -40, groups=[all_points("mouthPucker", (0, 0, 6))]), patch("b", 0), patch("c", 0)]
    head = Head(replace(data, parts=parts, seams=[*data.seams, under]))
    decimated = DecimatedHead(head, head.parts, "fast", {})
    last = decimated.parts[2]
    before = decimated.vertices[last.first :].copy()
    decimated.pose(head.values({"mouthPucker": 1.0}))
    assert (decimated.vertices[last.first :] != before).any() and last.changed


def test_points_at_rest_that_are_changed_are_seen(head: Head, decimated: DecimatedHead) -> None:
    rig, values = head.part("a").rig, head.values({"mouthPucker": 0.5})  # type: ignore[attr-defined]
    before = rig.rest.copy()
    decimated.pose(values)
    try:
        rig.rest[:, 1] += 2.0
        rig.invalidate()
        head.pose(values)
        decimated.pose(values)
        assert_alike(decimated)
    finally:
        rig.rest[:] = before
        rig.invalidate()
        head.pose(head.values({}))


def test_its_rotation_is_the_heads(head: Head, decimated: DecimatedHead) -> None:
    for given in ({"headYaw": 0.4, "headPitch": -0.2}, {}):
        head.pose(head.values(given))
        decimated.pose(head.values(given))
        assert decimated.turn == pytest.approx(head.parts[0].turn, abs=1e-12)
        assert (np.abs(decimated.turn - np.eye(3)).max() > 0.05) == bool(given)


def test_a_part_without_triangles_of_a_level_keeps_all(head: Head) -> None:
    decimated = DecimatedHead(head, head.parts, "full", {})
    for own in decimated.parts:
        assert np.array_equal(own.kept, np.arange(len(own.part.vertices)))
        assert np.array_equal(own.triangles, own.part.triangles)
        assert own.changed == [(0, len(own.kept))]
    assert [own.first for own in decimated.parts[1:]] == [own.last for own in decimated.parts[:-1]]
    assert len(decimated.vertices) == sum(len(part.vertices) for part in head.parts)
    assert_alike(decimated)


@pytest.mark.parametrize("flip", [False, True])
def test_some_vertices_of_a_mesh_keep_their_places_and_the_points_that_reach_them(flip: bool) -> None:
    mesh = hills(16).tessellate(chord_error=0.3, flip=flip)
    cells = len(mesh.cell_start) - 1
    ids = np.flatnonzero((mesh.cell % 3 == 1) & (np.arange(len(mesh.uv)) % 2 == 0))
    some = submesh(mesh, ids)
    assert cells > 6 and some.triangles.shape == (0, 3) and some.flip == flip
    for name in ("vertices", "normals", "uv", "side"):
        assert np.array_equal(getattr(some, name), getattr(mesh, name)[ids]), name
    assert some.cell_start.tolist() == [0, *np.cumsum(np.unique(mesh.cell[ids], return_counts=True)[1]).tolist()]
    for vertex, original in enumerate(ids):
        own = some.points_of(int(some.cell[vertex]))
        assert np.array_equal(own, mesh.points_of(int(mesh.cell[original])))
        first, last = some.cell_start[some.cell[vertex] :][:2]
        assert first <= vertex < last


def test_it_breathes_as_the_head_does() -> None:
    made = Head(small_head(neck=Neck((0.0, 30.0, 0.0), 0.0, 0.0, 15.0)))
    for part in made.parts:
        part.decimated = {"fast": part.triangles[::3]}
    decimated, zeros = DecimatedHead(made, made.parts, "fast", {}), np.zeros(len(made.parameters))
    before = decimated.vertices.copy()
    made.live(2.5, 0.0)
    decimated.pose(zeros)
    made.pose(zeros)
    assert_alike(decimated)
    assert np.abs(decimated.vertices - before).max() > 1.5
    decimated.pose(zeros)
    assert not any(part.changed for part in decimated.parts if not part.part.name.startswith("tooth"))
