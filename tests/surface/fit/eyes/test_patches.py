"""Eyes within the face's mesh: patches that turn or do not blink, islands in (u, v), and what is no eye."""

import re
from dataclasses import replace

import numpy as np
import pytest
from eye_face import CENTRES, RADIUS, face, joined, looking, pair, shell
from scipy.spatial.transform import Rotation

from surface.fit.eyes import patches as module
from surface.fit.eyes.patches import bulges, grown, island_sides, shaped_sides, turns
from surface.fit.source.mesh import FitMesh

LOOKS = [f"eyeLook{k}Left" for k in ("Up", "Down", "In", "Out")]


def one_mesh(
    make=lambda c: shell(c, reach=1.2), *, looks: bool = False, shapes: bool = True, apart: bool = False
) -> FitMesh:
    """A face and eyes in one object; ``apart`` : the eyes are islands of their own in (u, v)."""
    eyes = pair(make)
    if looks:
        eyes = [(n, looking(m, c, n[3:])) for (n, m), c in zip(eyes, CENTRES, strict=True)]
    made = joined([("Head", face(shapes=shapes)), *eyes])
    uv = made.uv.copy()
    if apart:
        count = len(face().uv)
        uv[count:] = uv[count:] * 0.1 + 2.0
    return replace(made, piece=0 * made.piece, pieces=("Head",), uv=uv)


def skin(mesh: FitMesh) -> np.ndarray:
    return np.ones(len(mesh.faces), bool)


def eyes_faces(mesh: FitMesh) -> set[int]:
    return set(range(len(face().faces), len(mesh.faces)))


def inside_out(mesh: FitMesh) -> FitMesh:
    return replace(mesh, faces=np.array([f[[2, 1, 0, 3]] if f[3] < 0 else f[::-1] for f in mesh.faces]))


@pytest.mark.parametrize("looks", [False, True])
def test_patches_that_do_not_blink_or_turn_are_eyes(looks: bool) -> None:
    mesh = one_mesh(looks=looks)
    found = shaped_sides(mesh, skin(mesh), CENTRES + np.array([0, 0, 12.0]))
    np.testing.assert_allclose([s.ball.centre for s in found], CENTRES, atol=0.1)
    np.testing.assert_allclose([s.ball.radius for s in found], RADIUS, rtol=0.01)
    assert set(np.concatenate([s.faces for s in found]).tolist()) == eyes_faces(mesh)
    assert shaped_sides(mesh, skin(mesh), None) == []


def test_what_is_round_but_large_or_blinks_a_little_is_no_eye() -> None:
    """An island that is a good part of the skin; a patch that follows the lids."""
    mesh = one_mesh(shapes=False, apart=True)
    few = np.zeros(len(mesh.faces), bool)
    few[-len(eyes_faces(mesh)) - 60 :] = True  # with hardly any skin beside them
    assert island_sides(mesh, few, 0.0, None) == []
    blinking = one_mesh()
    deltas = blinking.deltas.copy()
    count = len(face().vertices)
    deltas[:2, count:] = 0.1 * np.abs(deltas[:2]).max() * np.array([0, -1.0, 0])
    assert shaped_sides(replace(blinking, deltas=deltas), skin(blinking), CENTRES + np.array([0, 0, 12.0])) == []
    deltas[:2, count:] *= 0.2
    assert shaped_sides(replace(blinking, deltas=deltas), skin(blinking), CENTRES + np.array([0, 0, 12.0]))


def test_without_one_of_both_there_is_none() -> None:
    mesh = one_mesh()
    left_only = skin(mesh)
    left_only[-(len(eyes_faces(mesh)) // 2) :] = False
    assert shaped_sides(mesh, left_only, CENTRES + np.array([0, 0, 12.0])) == []
    assert shaped_sides(face(), skin(face()), CENTRES + np.array([0, 0, 12.0])) == []


@pytest.mark.parametrize(
    "make",
    [
        lambda c: shell(c, reach=1.2, factors=(1, 0.4, 1)),  # not round
        lambda c: shell(c, 4.0, reach=1.2), lambda c: shell(c, 34.0, reach=0.5),  # too small, too large
        lambda c: inside_out(shell(c, reach=1.2)),
    ],
)  # fmt: skip
def test_patches_that_are_not_round_of_an_eyes_size_or_look_inwards_are_none(make) -> None:
    mesh = one_mesh(make)
    assert shaped_sides(mesh, skin(mesh), CENTRES + np.array([0, 0, 12.0])) == []


def test_turns_are_the_rotations_of_the_shapes_that_turn_faces_as_a_whole() -> None:
    eye = looking(shell(CENTRES[0]), CENTRES[0], "Left", 0.3)
    faces = np.arange(len(eye.faces))
    found = turns(eye, faces, LOOKS)
    assert len(found) == 4
    for turn, shift in found:
        np.testing.assert_allclose(turn @ CENTRES[0] + shift, CENTRES[0], atol=1e-6)
        assert Rotation.from_matrix(turn).magnitude() == pytest.approx(0.3)
    bent = replace(eye, deltas=eye.deltas * (eye.vertices[:, :1] > CENTRES[0, 0]))  # only a half of it moves
    assert turns(bent, faces, LOOKS) == []
    assert turns(replace(eye, deltas=0 * eye.deltas), faces, LOOKS) == []
    hardly = looking(shell(CENTRES[0]), CENTRES[0], "Left", 0.015)
    assert turns(hardly, faces, LOOKS) == [] and len(turns(eye, faces, LOOKS[:1])) == 1
    shifted = replace(eye, deltas=np.zeros_like(eye.deltas) + np.array([0.0, 2.0, 0.0]))
    assert turns(shifted, faces, LOOKS) == []  # moved as a whole, but not turned
    apex = eye.deltas.copy()
    apex[:, eye.vertices[:, 2] < CENTRES[0, 2] - 11.9] = 0
    (turn, _), *_ = turns(replace(eye, deltas=apex), faces, LOOKS)
    assert Rotation.from_matrix(turn).magnitude() == pytest.approx(0.3, rel=0.01)


def test_what_bulges_looks_away_from_its_centre() -> None:
    ball = shell((5, 5, 5), reach=1.2)
    every = np.arange(len(ball.faces))
    assert bulges(ball, every, np.array([5.0, 5, 5])) and not bulges(ball, every, np.array([5.0, 5, 25]))
    assert not bulges(replace(ball, vertices=ball.vertices * [1, 1, -1]), every, np.array([5.0, 5, -5]))


def test_faces_that_share_a_vertex_with_a_patch_go_with_it() -> None:
    ball = shell((0, 0, 0), rows=7, columns=8)
    first = np.arange(8)  # the cap
    found = grown(ball, first)
    np.testing.assert_array_equal(found, np.arange(16))
    np.testing.assert_array_equal(grown(ball, np.arange(len(ball.faces))), np.arange(len(ball.faces)))


def test_eyes_are_islands_of_the_texture_coordinates_where_shapes_do_not_tell() -> None:
    mesh = one_mesh(shapes=False, apart=True)
    found = island_sides(mesh, skin(mesh), 0.0, None)
    np.testing.assert_allclose([s.ball.centre for s in found], CENTRES, atol=0.1)
    assert set(np.concatenate([s.faces for s in found]).tolist()) == eyes_faces(mesh)
    assert island_sides(mesh, skin(mesh), 0.0, CENTRES) and not island_sides(
        mesh, skin(mesh), 0.0, CENTRES + np.array([0, 40, 0])
    )
    none = skin(mesh) & False
    assert island_sides(mesh, none, 0.0, None) == []
    assert island_sides(replace(mesh, uv=mesh.uv[:0]), skin(mesh), 0.0, None) == []
    alone = face(shapes=False)
    assert island_sides(alone, skin(alone), 0.0, None) == []


def test_a_face_is_told_by_its_vertices_whatever_corner_it_begins_with() -> None:
    rows = np.array([[3, 9, 4, 7], [7, 3, 9, 4], [3, 9, 4, -1], [9, 4, 3, -1], [3, 9, 5, 7], [2, 9, 4, 7]])
    key = module._face_keys(rows)
    assert key[0] == key[1] and key[2] == key[3] and len(set(key.tolist())) == 4
    many = np.sort(np.random.default_rng(0).integers(0, 60_000, (20_000, 4)), axis=1)
    many = np.unique(many, axis=0)
    assert len(set(module._face_keys(many).tolist())) == len(many)


def test_clusters_end_at_what_is_near_and_the_nearest_comes_first() -> None:
    mesh = joined(
        [("a", shell((0, 0, 0), 3.0)), ("b", shell((20, 0, 0), 3.0)), ("c", shell((9, 0, 0), 3.0, rows=3, columns=3))]
    )
    chosen, near = np.ones(len(mesh.vertices), bool), np.ones(len(mesh.vertices), bool)
    middle = np.array([15.0, 0, 0])
    found = module._clusters(mesh, skin(mesh), chosen, near, middle)
    at = [mesh.vertices[mesh.faces[f, :3]].mean(axis=(0, 1))[0] for f in found]
    np.testing.assert_allclose(at, [20, 0], atol=0.3)  # the third has too few vertices
    chosen[-1] = False  # a vertex of the third; the missing corner of triangles is none of it
    assert [len(f) for f in module._clusters(mesh, skin(mesh), chosen, near, middle)] == [len(f) for f in found]
    near = mesh.vertices[:, 0] < 19
    assert len(module._clusters(mesh, skin(mesh), chosen & near, near, middle)) == 1
    chosen[mesh.vertices[:, 0] > 10] = False
    assert len(module._clusters(mesh, skin(mesh), chosen, near | True, middle)) == 1
    assert module._clusters(mesh, skin(mesh) & False, chosen, near, middle) == []


@pytest.mark.parametrize(("looks", "found"), [(4, 0.0), (2, 0.0), (1, 15.0), (0, 15.0)])
def test_an_eye_is_told_by_how_it_turns_where_two_shapes_or_more_turn_it(looks: int, found: float) -> None:
    """A ball that keeps still beside each eye lies nearer to the middle of what blinks."""
    beside = CENTRES + np.array([0.0, 15.0, 0.0])
    eyes = [looking(m, c, n[3:]) for (n, m), c in zip(pair(lambda c: shell(c, 7.0, reach=1.2)), CENTRES, strict=True)]
    still = [(f"Still{k}", shell(c, 7.0, reach=1.2)) for k, c in enumerate(beside)]
    made = joined([("Head", face()), ("EyeLeft", eyes[0]), ("EyeRight", eyes[1]), *still])
    unknown = re.compile(f"eyeLook({'|'.join(('Up', 'Down', 'In', 'Out')[looks:])})(Left|Right)$")
    mesh = replace(made, names=tuple(unknown.sub(r"other\1\2", n) if looks < 4 else n for n in made.names))
    sides = shaped_sides(mesh, skin(mesh), beside + np.array([0.0, 0.0, 7.0]))
    np.testing.assert_allclose([s.ball.centre for s in sides], CENTRES + np.array([0.0, found, 0.0]), atol=0.1)
