"""surface.fit.surfaces.build: parts of a head are the very surfaces of the file, placed, and their groups."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shapes
from small_head import small_head

from surface import Domain
from surface.fit.surfaces.build import CHORD_ERROR, MAX_DEPTH, make_part, sparse_group, with_groups, with_mesh
from surface.fit.surfaces.pieces import Piece
from surface.head.model.data import Group, PartData
from surface.head.model.meshes import make_surface, unpack
from surface.head.model.placement import Placement

TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


@pytest.fixture
def placement() -> Placement:
    """A quarter turn about z, twice as large, and moved."""
    return Placement(TURN, 2.0, np.array([10.0, 20.0, 30.0]))


def piece(**other: Any) -> Piece:
    surface = shapes.hills(8, 40.0)
    fields = {"name": "cheek", "material": "skin", "surface": surface, "domain": Domain((0.0, 1.0, 0.0, 1.0)), **other}
    return Piece(title="object 1", chord=0.1, **fields)


def made(placement: Placement, follows: str = "skin", *, flip: bool = False, **other: Any) -> PartData:
    return make_part(piece(**other), placement, 200.0, follows, flip=flip)


def test_a_part_is_the_surface_of_the_file_in_head_space(placement: Placement) -> None:
    part, own = made(placement), piece().surface
    uv = np.random.default_rng(1).random((50, 2))
    np.testing.assert_allclose(make_surface(part).evaluate(uv), placement.points(own.evaluate(uv)), atol=1e-9)
    np.testing.assert_array_equal(part.weights, own.weights)
    assert part.weights is not own.weights
    assert (part.name, part.material, part.follows, part.flip) == ("cheek", "skin", "skin", False)
    assert part.budget == (0, CHORD_ERROR * 200.0, MAX_DEPTH) and part.groups == []
    assert part.rect == (0.0, 1.0, 0.0, 1.0) and part.closed_u is None and not part.jaw.any() and not part.lids.any()
    assert made(placement, flip=True).flip


@pytest.mark.parametrize(
    ("follows", "material"), [("left_eye", "eye"), ("right_eye", "eye"), ("jaw", "teeth"), ("skin", "teeth")]
)
def test_what_turns_as_an_eye_is_one(placement: Placement, follows: str, material: str) -> None:
    part = made(placement, follows, material="teeth")
    assert (part.follows, part.material) == (follows, material)


def test_trims_slits_and_closed_directions_are_kept(placement: Placement) -> None:
    torus = shapes.torus()
    part = make_part(piece(surface=torus, domain=Domain((0.0, 1.0, 0.0, 1.0))), placement, 200.0, "skin", flip=False)
    assert part.closed_u == (0, 1) == part.closed_v
    loop = shapes.circle(0.5, 0.5, 0.2)
    trimmed = made(placement, domain=Domain((0.0, 1.0, 0.0, 1.0), loops=[loop]))
    np.testing.assert_allclose(trimmed.loops[0], loop)


def test_a_mesh_is_fine_enough_for_a_face_that_moves(placement: Placement) -> None:
    """The pose that decides how fine it is has 0.4 of every group."""
    head, flat = small_head(), made(placement)
    steep = Group("mouthPucker", np.array([27, 28], np.int32), np.full((2, 3), [0.0, 0.0, 60.0], np.float32))
    counts = []
    for part in (flat, with_groups(flat, [steep])):
        meshed = with_mesh(part, head)
        surface = make_surface(meshed)
        mesh = unpack(meshed.mesh, surface, meshed.budget, rough=False, flip=meshed.flip)
        assert mesh is not None
        np.testing.assert_allclose(mesh.vertices, surface.evaluate(mesh.uv), atol=1e-4)  # at rest
        counts.append(len(mesh.vertices))
    assert counts[1] > counts[0] + 100


def test_groups_of_one_name_become_one_and_points_that_stay_are_left_out() -> None:
    rng = np.random.default_rng(2)
    rows: list[tuple[str, list[int]]] = [("a", [3, 5]), ("b", [1]), ("a", [5, 7])]
    groups = [Group(name, np.array(ids, np.int32), rng.normal(size=(len(ids), 3)).astype("f4")) for name, ids in rows]
    still = Group("c", np.array([2], np.int32), np.zeros((1, 3), np.float32))
    undone = Group("d", np.array([4, 4], np.int32), np.array([[1, 2, 3], [-1, -2, -3]], np.float32))
    part = with_groups(small_head().parts[1], [*groups[:1]])
    found = with_groups(part, [*groups[1:], still, undone]).groups
    assert [group.name for group in found] == ["a", "b"]
    assert found[0].ids.tolist() == [3, 5, 7] and found[0].ids.dtype == np.int32
    first, _, second = (group.moves for group in groups)
    np.testing.assert_allclose(found[0].moves, [first[0], first[1] + second[0], second[1]], rtol=1e-6)


def test_a_group_keeps_its_moves_of_those_that_move() -> None:
    moves = np.zeros((6, 3))
    moves[[1, 4]] = [[0.0, 0.0, 1e-9], [1.0, 2.0, 3.0]]
    group = sparse_group("a", moves)
    assert group.ids.tolist() == [1, 4] and group.moves.dtype == np.float32
    np.testing.assert_array_equal(group.moves, moves[[1, 4]].astype(np.float32))
