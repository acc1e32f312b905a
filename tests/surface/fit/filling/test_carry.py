"""A mesh that lies on a head moves as that head does."""

import numpy as np
import pytest
from part_mesh import part_mesh, shipped

from surface.fit.filling.carry import Carrier, Continued, vertex_normals
from surface.fit.source.mesh import FitMesh

NAMES = ("eyeBlinkLeft", "mouthUpperUpLeft", "jawForward", "cheekPuff")


@pytest.fixture(scope="module")
def carried() -> tuple:
    mesh, ids = part_mesh(NAMES)
    return mesh, ids, Carrier(mesh, shipped().head).moves(NAMES)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("part", ["face", "lashes", "teeth_lower", "teeth_upper", "tongue"])
def test_every_part_moves_as_on_the_head(carried, name, part):
    mesh, ids, moves = carried
    k = NAMES.index(name)
    ours, theirs = moves[k][ids[part]], mesh.deltas[k][ids[part]]
    off = np.linalg.norm(ours - theirs, axis=1)
    assert np.sqrt((off**2).mean()) < 0.05 + 0.08 * np.sqrt((theirs**2).sum(axis=1).mean())


def test_lips_that_touch_take_nothing_from_each_other(carried):
    mesh, ids, moves = carried
    k = NAMES.index("mouthUpperUpLeft")
    theirs = np.linalg.norm(mesh.deltas[k], axis=1)
    lower = ids["face"][(theirs[ids["face"]] < 0.05)]
    tree = np.abs(mesh.vertices[lower] - [0.0, -33.0, 100.0]).max(axis=1) < 30
    assert tree.sum() > 100 and np.linalg.norm(moves[k][lower[tree]], axis=1).mean() < 0.05


@pytest.mark.parametrize(("turned", "follows"), [(False, True), (True, False)])
def test_skin_takes_nothing_from_skin_that_faces_the_other_way(turned, follows):
    """A patch close behind the brow, which hangs on nothing: it moves as the brow does where it faces as that does."""
    mesh, ids = part_mesh()
    at, normals = mesh.vertices, vertex_normals(mesh)
    brow = ids["face"][(np.abs(at[ids["face"]] - [15.0, 55.0, 100.0]) < [12.0, 8.0, 30.0]).all(axis=1)]
    own = mesh.faces[np.isin(mesh.faces[:, :3], brow).all(axis=1)]
    assert len(own) > 20 and normals[brow][:, 2].min() > 0.4
    copy = np.full(len(at), -1)
    used = np.unique(own[:, :3])
    copy[used] = len(at) + np.arange(len(used))
    patch = np.column_stack([copy[own[:, [0, 2, 1] if turned else [0, 1, 2]]], np.full(len(own), -1)])
    faces, bare = np.concatenate([mesh.faces, patch]), np.full((len(mesh.faces) + len(patch), 4), -1)
    more = {"vertices": np.concatenate([at, at[used] - normals[used]]), "faces": faces, "face_uv": bare}
    more |= {"deltas": np.zeros((0, len(at) + len(used), 3)), "piece": np.append(mesh.piece, np.zeros(len(patch), int))}
    (moves,) = Carrier(FitMesh(**(vars(mesh) | more)), shipped().head).moves(["browInnerUp"])
    before, behind = np.linalg.norm(moves[used], axis=1), np.linalg.norm(moves[len(at) :], axis=1)
    assert before.max() > 2.0
    assert np.abs(behind - before).max() < 0.5 if follows else behind.max() < 1e-3


def test_eyes_stay(carried):
    _, ids, moves = carried
    assert not moves[:, np.concatenate([ids["eye_left"], ids["eye_right"]])].any()


def test_a_tongue_that_is_put_out_lies_where_the_heads_does():
    mesh, ids = part_mesh()
    own = ids["tongue"]
    vertices = mesh.vertices.copy()
    vertices[own] = vertices[own].mean(axis=0) + 0.6 * (vertices[own] - vertices[own].mean(axis=0)) + [0.0, 5.0, -6.0]
    moved = vertices + Carrier(FitMesh(**(vars(mesh) | {"vertices": vertices})), shipped().head).moves(["tongueOut"])[0]
    part = [p.name for p in shipped().parts].index("tongue")
    theirs = shipped().at_one("tongueOut")[part]
    np.testing.assert_allclose(moved[own].min(axis=0), theirs.min(axis=0), atol=1.5)
    np.testing.assert_allclose(moved[own].max(axis=0), theirs.max(axis=0), atol=1.5)


def test_what_is_not_known_moves_with_what_it_hangs_on():
    faces = np.array([[0, 1, 2, -1], [1, 3, 2, -1], [4, 5, 6, -1]])
    mesh = FitMesh(np.zeros((7, 3)), faces, np.zeros((0, 2)), np.full((3, 4), -1), (), np.zeros((0, 7, 3)))
    moves = np.zeros((7, 3))
    moves[:3] = [[1.0, 0, 0], [0, 2.0, 0], [0, 0, 4.0]]
    Continued(mesh, np.array([True, True, True, False, False, False, False])).fill(moves)
    np.testing.assert_allclose(moves[3], [0.0, 1.0, 2.0], atol=1e-5)
    np.testing.assert_allclose(moves[4:], 0.0, atol=1e-9)  # these hang on nothing


def test_normals_point_out_of_the_faces():
    faces = np.array([[0, 1, 2, 3]])
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [5, 5, 5]])
    mesh = FitMesh(square, faces, np.zeros((0, 2)), np.full((1, 4), -1), (), np.zeros((0, 5, 3)))
    np.testing.assert_allclose(vertex_normals(mesh), [[0, 0, 1.0]] * 4 + [[0, 0, 0]])
