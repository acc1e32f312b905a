"""A head is cut from its body."""

from dataclasses import replace

import numpy as np
import pytest
from traps import _tube, good_head, grid, joined, on_body, transformed

from surface.fit.source.mesh import FitMesh, check_manifold, check_mesh, triangles
from surface.fit.source.placing import bust
from surface.fit.source.placing.bust import cut, cut_bust, outline
from surface.fit.source.placing.frame import EYES_AT

HEAD = good_head()


def body() -> FitMesh:
    """The head on its body with the eyes in their place."""
    whole = on_body(HEAD)
    return transformed(whole, np.eye(3), 1.0, tuple(HEAD.vertices[0] - whole.vertices[0]))


def quad(mirrored: bool = False) -> FitMesh:
    """Two quads side by side, x 0..2, whose texture coordinates may lie on each other."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0]])
    faces = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])
    deltas = np.zeros((1, 6, 3))
    deltas[0, :, 2] = points[:, 1]
    uv = np.abs(points[:, :2] - [1, 0]) if mirrored else points[:, :2] / 2
    return FitMesh(points, faces, uv, faces.copy(), ("s",), deltas, np.array([0, 1]), ("a", "b"))


def area(mesh: FitMesh) -> float:
    t = mesh.vertices[triangles(mesh.faces)]
    return float(0.5 * np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1).sum())


def test_a_cut_keeps_exactly_the_inner_part_with_texture_and_shapes():
    for mirrored in (False, True):
        mesh = quad(mirrored)
        got = cut(mesh, mesh.vertices[:, 1] - 0.25)
        check_mesh(got, "cut")
        check_manifold(got, "cut")
        used = np.unique(got.faces[got.faces >= 0])
        assert np.isclose(area(got), 0.5) and got.vertices[used, 1].max() == 0.25
        np.testing.assert_allclose(got.deltas[0, used, 2], got.vertices[used, 1])
        for f, t in zip(got.faces[:, :3], got.face_uv[:, :3], strict=True):
            x, y, _ = got.vertices[f].T
            wanted = np.column_stack([np.abs(x - 1), y]) if mirrored else np.column_stack([x, y]) / 2
            np.testing.assert_allclose(got.uv[t], wanted)
        assert sorted(set(got.piece.tolist())) == [0, 1]


def test_a_cut_near_a_vertex_makes_no_sliver():
    mesh = quad()
    got = cut(mesh, mesh.vertices[:, 1] - 0.95)  # nearer to the upper vertices than a cut is worth
    np.testing.assert_array_equal(got.faces, mesh.faces)
    slanted = mesh.vertices[:, 0] + 0.2 * mesh.vertices[:, 1] - 1.02
    assert np.isclose(area(cut(mesh, slanted)), 0.92, atol=0.1)


def test_a_body_is_left_out_and_the_head_stays_as_it_is():
    mesh, notes = cut_bust(body(), EYES_AT, 1.0)
    check_mesh(mesh, "bust")
    check_manifold(mesh, "bust")
    (note,) = notes
    assert "a body" in note and all(f"'{n}'" in note for n in ("Trousers", "Boots", "Arm1", "Arm-1"))
    assert "'Head'" not in note and "EyeL" not in note
    kept = mesh.vertices[:, 1] > -80
    before = HEAD.vertices[HEAD.vertices[:, 1] > -80]
    assert kept.sum() == len(before) and np.abs(mesh.deltas).max() > 13
    assert outline(mesh.vertices, EYES_AT, 1.0).max() < 2.0  # a vertex near the outline may stay outside


@pytest.mark.parametrize(("name", "top", "kept"), [
    ("Wolf3D_Body", -75.0, True), ("Wolf3D_Body", -190.0, False), ("Dress", -75.0, False), ("Object7", -75.0, False),
])  # fmt: skip
def test_skin_that_reaches_up_to_the_neck_is_cut_like_the_head_and_not_left_out(name, top, kept):
    neck = _tube((0, top + 36.1, -10), (0, -820, -10), 60, name)
    legs = [_tube((s * 80, -760, -10), (s * 80, -1500, -10), 80, name) for s in (1, -1)]
    whole = joined(HEAD, neck, *legs)
    mesh, notes = cut_bust(whole, EYES_AT, 1.0)
    own = [k for k, n in enumerate(mesh.pieces) if n == name]
    at = mesh.vertices[np.unique(mesh.faces[np.isin(mesh.piece, own)])]
    assert (len(at) > 0) == kept and (f"'{name}'" in notes[0]) == (not kept or len(own) > 1)
    if kept:
        assert at[:, 1].max() > top + 36.0 and at[:, 1].min() > -196


@pytest.mark.parametrize(("name", "kept"), [("model", True), ("Hood", False)])
def test_a_body_in_one_piece_with_its_head_stays_beside_eyes_of_their_own(name, kept):
    """As MakeHuman exports persons: most of the skin is that of the body, and only the eyes are pieces apart."""
    rest = body()
    eyes = np.isin(rest.piece, [k for k, n in enumerate(rest.pieces) if n.startswith("Eye")])
    assert eyes.any() and not eyes.all()
    pieces = (name, *(f"high-poly{side}" for side in (0, 1)))
    still = replace(rest, names=(), deltas=rest.deltas[:0], pieces=pieces, piece=np.where(eyes, 1, 0))
    mesh, (note,) = cut_bust(still, EYES_AT, 1.0)
    assert (mesh.piece == 0).any() == kept and (f"'{name}'" in note) != kept and (mesh.piece == 1).any()
    assert mesh.vertices[:, 1].min() > -196


def test_a_head_of_its_own_is_kept_without_what_else_reaches_above_the_eyes():
    mesh = replace(
        quad(), pieces=("abc", "robe"), faces=np.array([[3, 0, 1, -1], [3, 1, 4, -1]]), piece=np.array([0, 1])
    )
    inside, top = -np.ones(6), mesh.vertices[3, 1]
    for gone, held in ((np.array([True, True]), [True, True]), (np.array([False, True]), [False, False])):
        assert bust._heads(replace(mesh, pieces=("abc", "def")), inside, gone, top - 0.01).tolist() == held
    assert bust._heads(mesh, inside, np.array([True, True]), top).tolist() == [False, False]
    assert bust._heads(mesh, inside, np.array([True, True]), top - 0.01).tolist() == [True, False]  # clothes are none


def test_a_bust_is_no_body():
    mesh, notes = cut_bust(HEAD, EYES_AT, 1.0)
    assert mesh is HEAD and notes == []


def test_one_object_with_a_face_and_a_body_is_cut_not_dropped():
    whole = body()
    one = FitMesh(whole.vertices, whole.faces, whole.uv, whole.face_uv, whole.names, whole.deltas,
                  np.zeros(len(whole.faces), np.int64), ("Everything",))  # fmt: skip
    mesh, notes = cut_bust(one, EYES_AT, 1.0)
    assert "left out" not in notes[0] and mesh.vertices[:, 1].min() > -194
    assert len(mesh.faces) > len(HEAD.faces) * 0.9


@pytest.mark.parametrize(("name", "clear"), [("Body_SKIN", True), ("Dress", False)])
def test_a_ragged_border_of_skin_under_clothes_is_cut_off(name, clear):
    """Skin that a dress hides is often left out of a mesh, from face to face, up to the shoulders."""
    u, v, faces = grid(25, 41)
    points = np.column_stack([60 * np.cos(2 * np.pi * u), EYES_AT[1] - 90.0 - 160.0 * v, 60 * np.sin(2 * np.pi * u)])
    left = points[faces[:, :3], 1].min(axis=1) > EYES_AT[1] - 165.0 - 20.0 * (np.arange(len(faces)) % 3)
    skirt = FitMesh(points, faces[left], np.column_stack([u, v]), faces[left], (), np.zeros((0, len(u), 3)),
                    np.zeros(int(left.sum()), np.int64), (name,))  # fmt: skip
    legs = [_tube((s * 80, -760, -10), (s * 80, -1500, -10), 80, "Trousers") for s in (1, -1)]
    mesh, _ = cut_bust(joined(HEAD, skirt, *legs), EYES_AT, 1.0)
    own = np.unique(mesh.faces[mesh.piece == list(mesh.pieces).index(name)][:, :3])
    assert (mesh.vertices[own, 1].min() > EYES_AT[1] - 165.0) == clear


def test_the_outline_is_a_bust():
    at = EYES_AT + np.array([[0, 0, 0], [300, 0, 0], [0, -228, 0], [0, -231, 0], [149, -131, 0], [151, -131, 0]], float)
    assert (outline(at, EYES_AT, 1.0) > 0).tolist() == [False, False, False, True, False, True]
    large = EYES_AT + 2.0 * (at - EYES_AT)
    np.testing.assert_allclose(outline(large, EYES_AT, 2.0), 2.0 * outline(at, EYES_AT, 1.0))


@pytest.mark.parametrize(
    ("off", "outside"),
    [
        ((500.0, -78.0, 0.0), -150.0),  # hair and ears may be as wide as they are
        ((140.0, -79.0, 0.0), -10.0), ((-160.0, -130.0, 0.0), 10.0),
        ((0.0, -180.0, 50.0), -49.0), ((0.0, -229.0, 50.0), 0.0), ((0.0, -278.0, 0.0), 49.0),
        ((75.0, -180.0, 0.0), (2**0.25 * 0.5 - 1.0) * 98.0),
    ],
)  # fmt: skip
def test_the_outline_is_a_superellipse_below_the_shoulders(off, outside):
    at = EYES_AT + np.array([off])
    assert outline(at, EYES_AT, 1.0)[0] == pytest.approx(outside)
    assert outline(EYES_AT + 0.5 * np.array([off]), EYES_AT, 0.5)[0] == pytest.approx(0.5 * outside)


@pytest.mark.parametrize(("low", "has_body"), [(-299.0, False), (-300.0, True), (-301.0, True)])
def test_a_mesh_300_mm_below_the_eyes_has_a_body(low, has_body):
    mesh = quad()
    whole = replace(mesh, vertices=EYES_AT + np.array([[0, low, 0]]) * (mesh.vertices[:, :1] == 2),
                    deltas=5.0 + mesh.deltas)  # fmt: skip
    found, notes = cut_bust(whole, EYES_AT, 1.0)
    assert (found is not whole) == has_body and len(notes) == has_body
    assert (cut_bust(whole, EYES_AT, 1.02)[0] is whole) == (low > -306.0)


def test_zeros_near_a_vertex_are_put_onto_it():
    mesh = quad()
    for share, settled in ((0.11, True), (0.13, False)):
        value = np.array([share - 1.0, 5.0, 5.0, share, 5.0, 5.0])  # between the first and the fourth vertex
        found = bust._settled(mesh, value)
        assert (found[3] == 0.0) == settled and found[0] == value[0]
        other = np.array([-share, -1.0, -1.0, 1.0 - share, -1.0, -1.0])
        assert (bust._settled(mesh, other)[0] == 0.0) == settled
    inside = np.full(6, -1.0)
    np.testing.assert_array_equal(bust._settled(mesh, inside), inside)


@pytest.mark.parametrize(("inside", "moves", "gone"), [(0.49, 0.9, True), (0.51, 0.9, False), (0.49, 1.0, False)])
def test_an_object_belongs_to_the_body_with_less_than_half_of_its_area_inside(monkeypatch, inside, moves, gone):
    mesh = replace(quad(), faces=np.array([[0, 1, 4, -1], [1, 2, 5, -1], [3, 4, 0, -1]]), piece=np.array([0, 1, 1]))
    deltas = np.zeros((1, 6, 3))
    deltas[0, 1, 1] = -moves
    mesh = replace(mesh, deltas=deltas)
    monkeypatch.setattr(bust, "face_areas", lambda *_: np.array([7.0, inside, 1.0 - inside]))
    outside = np.array([-1.0, -1, -1, 1, 1, 1])
    assert bust._body_objects(mesh, outside).tolist() == [False, gone]
    every = [False, False] if moves < 1.0 else [True, False]  # never all of them
    assert bust._body_objects(mesh, np.ones(6)).tolist() == every
    assert bust._body_objects(replace(mesh, pieces=("a",)), outside).tolist() == [False]


def test_skin_that_reaches_above_a_height_inside_the_outline_holds_the_neck():
    mesh = replace(quad(), pieces=("Body_SKIN", "Body_SKIN"), faces=np.array([[3, 0, 1, -1], [1, 2, 5, -1]]))
    outside = np.array([-1.0, -1, -1, -1, -1, -1])
    assert bust._necks(mesh, outside, 0.99).tolist() == [True, False]
    assert bust._necks(mesh, outside, 1.0).tolist() == [False, False]
    assert bust._necks(mesh, -outside, -9.0).tolist() == [False, False]
    assert bust._necks(replace(mesh, pieces=("Shirt", "abc")), outside, -9.0).tolist() == [False, False]
    assert bust._named_skin(replace(mesh, pieces=("Body_SKIN", "abc"))).tolist() == [True, False]


def test_borders_of_skin_below_the_chin_that_touch_no_other_are_told():
    low = EYES_AT[1] - 95.0
    mesh = replace(quad(), pieces=("Body_SKIN", "Shirt"))
    for height, told in ((-1.1, {0, 1, 3, 4}), (-0.5, {0, 1}), (0.1, set())):
        at = np.add(mesh.vertices, [0.0, low + height, 0.0])
        assert set(bust._skin_borders(replace(mesh, vertices=at), EYES_AT, 1.0).tolist()) == told
    for apart, alone in ((0.29, False), (0.31, True)):
        beside = np.array([[0.0, -9.0, 0.0], [5, -9, 0], [0, -5, 0], [-apart, -9, 0], [-5, -9, 0], [0, -3, 0]])
        two = replace(mesh, vertices=np.add(beside, [0.0, low, 0.0]), faces=np.array([[0, 1, 2, -1], [3, 4, 5, -1]]))
        two = replace(two, pieces=("Body_SKIN", "Body_SKIN"))
        assert (0 in bust._skin_borders(two, EYES_AT, 1.0)) == alone
    assert len(bust._skin_borders(replace(mesh, piece=mesh.piece[:0]), EYES_AT, 1.0)) == 0


def test_a_body_is_said_with_what_went_with_it():
    mesh = replace(quad(), pieces=("a", "b", "b"))
    note = "a body, 1234 mm below the eyes: the head is cut from it below the neck"
    assert bust._notes(mesh, np.array([False, True, True]), 1234.4) == [f"{note}; left out with it: 'b'"]
    assert bust._notes(mesh, np.zeros(3, bool), 1234.4) == [note]
