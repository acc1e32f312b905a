"""Eyes of every kind put into a face: where they turn and how large they are, and which faces are theirs."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from eye_face import CENTRES, RADIUS, disc, face, joined, looking, pair, shell, with_sockets

from surface.base.arrays import Bools, Floats, Ints
from surface.fit.eyes import search
from surface.fit.eyes.pieces import Side
from surface.fit.eyes.search import ADDED, MISSING
from surface.fit.features.generic import make_plan
from surface.fit.points.ballfit import Ball
from surface.fit.source.mesh import FitMesh, check_manifold

pytestmark = pytest.mark.usefixtures("given_charts")


def merged(pieces: list[tuple[str, FitMesh]], name: str) -> list[tuple[str, FitMesh]]:
    """Pieces as one of that name."""
    one = joined(pieces)
    return [(name, replace(one, piece=0 * one.piece, pieces=(name,)))]


def with_cornea(centre):
    return shell(centre, cornea=0.09)


def half(centre):
    return shell(centre, reach=np.pi / 2)


def pulled_to_its_apex(centre):
    """A half shell whose back is a fan to its centre."""
    made = shell(centre, reach=np.pi / 2 + 0.2)
    vertices = made.vertices.copy()
    vertices[-1] = np.array(centre)
    return replace(made, vertices=vertices)


def front(centre):
    """A cap of 50 degrees, as much as lids leave open."""
    return shell(centre, reach=np.radians(50))


def ahead(z: float, radius: float, centre) -> FitMesh:
    """A disc in front of an eye's centre."""
    return disc(centre + np.array([0.0, 0.0, z]), radius)


KINDS = {
    "balls named in a node": pair(shell),
    "balls without a name": pair(shell, ("Mesh.001", "Mesh.002")),
    "one object": merged(pair(shell), "Eyes"),
    "names of materials": pair(shell, ("Body/Eye_L", "Body/Eye_R")),
    "left as the viewer sees it": pair(shell, ("eye_right", "eye_left")),
    "half shells": pair(half, ("eye_L", "eye_R")),
    "half shells without a name": pair(half, ("a", "b")),
    "half shells drawn to an apex": pair(pulled_to_its_apex),
    "caps": pair(front),
    "corneas in one piece": pair(with_cornea),
    "corneas of their own": pair(shell) + pair(lambda c: shell(c + np.array([0, 0, 4.6]), 8.6, reach=0.8),
                                               ("Cornea_L", "Cornea_R")),
    "a shell around": pair(shell) + pair(lambda c: shell(c, 12.4), ("EyeOcclusionL", "EyeOcclusionR")),
    "two materials, one mesh": merged(pair(shell), "Face/Sclera") + merged(
        pair(partial(ahead, 11.4, 5.5)), "Face/Iris"),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_round_eyes_are_found_to_a_millimetre(kind: str) -> None:
    mesh = joined([("Head", face()), *KINDS[kind]])
    plan = make_plan(mesh)
    centres, radius = plan.eyes
    np.testing.assert_allclose(centres, CENTRES, atol=0.5)
    assert radius == pytest.approx(RADIUS, rel=0.05)
    assert [p.name for p, _ in plan.parts] == ["face"]  # nothing of an eye is drawn as skin
    assert plan.found is not None and len(plan.found.openings) == 2


@pytest.mark.parametrize("factors", [(1, 1, 0.8), (1, 0.9, 0.8), (1, 1, 1.15)])
def test_an_eye_that_is_no_sphere_gets_one_that_lies_on_its_front(factors) -> None:
    mesh = joined([("Head", face()), *pair(lambda c: shell(c, factors=factors))])
    plan = make_plan(mesh)
    (x, y, z), radius = plan.eyes[0][0], plan.eyes[1]
    assert (x, y) == (pytest.approx(CENTRES[0, 0], abs=0.3), pytest.approx(CENTRES[0, 1], abs=0.3))
    assert 0.9 * RADIUS < radius < 1.5 * RADIUS
    assert z + radius == pytest.approx(CENTRES[0, 2] + RADIUS * factors[2], abs=1.0)
    assert [p.name for p, _ in plan.parts] == ["face"]


def test_flat_eyes_in_pieces_become_balls_that_fill_the_opening() -> None:
    """As VRoid's: a white, an iris and a highlight, each one piece for both sides."""
    pieces = [
        merged(pair(partial(ahead, z, r)), name)
        for name, z, r in (("Face/EyeWhite", 9.0, 12.0), ("Face/EyeIris", 9.5, 6.5), ("Face/EyeHighlight", 9.7, 2.0))
    ]
    plan = make_plan(joined([("Face/Skin", face()), *(p for piece in pieces for p in piece)]))
    centres, radius = plan.eyes
    np.testing.assert_allclose(centres, CENTRES, atol=2.0)
    assert radius == pytest.approx(RADIUS, rel=0.12)
    assert [p.name for p, _ in plan.parts] == ["face"]
    assert plan.found is not None and plan.found.iris == pytest.approx(6.5)


def in_one_mesh(*, blinks: bool = True, looks: bool = False, island: bool = False) -> FitMesh:
    """A face whose eyes are faces of the same object: caps welded to nothing, or islands of their own in (u, v)."""
    eyes = pair(lambda c: shell(c, reach=1.2))
    if looks:
        eyes = [(n, looking(m, c, n[3:])) for (n, m), c in zip(eyes, CENTRES, strict=True)]
    one = joined([("Head", face(shapes=blinks)), *eyes])
    uv = one.uv.copy()
    if island:
        uv[len(face().uv) :] += 2.0
    return replace(one, piece=0 * one.piece, pieces=("Head",), uv=uv)


def bridged(mesh: FitMesh) -> FitMesh:
    """The same with faces between the lids and the eyes, so that all of it hangs together."""
    count, extra = len(face().vertices), []
    for k, centre in enumerate(CENTRES):
        lid = np.flatnonzero(np.abs(np.linalg.norm(mesh.vertices[:count] - centre, axis=1) - RADIUS - 0.6) < 0.3)
        last = count + (k + 1) * (len(mesh.vertices) - count) // 2
        rim = np.arange(last - 24, last)
        for a, b in zip(rim, np.roll(rim, -1), strict=True):
            extra.append([a, b, lid[np.argmin(np.linalg.norm(mesh.vertices[lid] - mesh.vertices[a], axis=1))], -1])
    faces, face_uv = (np.vstack([rows, extra]) for rows in (mesh.faces, mesh.face_uv))
    return replace(mesh, faces=faces, face_uv=face_uv, piece=np.zeros(len(faces), np.int64))


@pytest.mark.parametrize("kind", [{"blinks": True}, {"looks": True}, {"blinks": False, "island": True}])
@pytest.mark.parametrize("joint", [False, True])
def test_eyes_in_the_faces_mesh_are_found(kind: dict, joint: bool) -> None:
    if joint and not kind.get("blinks", True):
        pytest.skip("an island in (u, v) that hangs together with the lids has no cut")
    mesh = in_one_mesh(**kind)
    plan = make_plan(bridged(mesh) if joint else mesh)
    np.testing.assert_allclose(plan.eyes[0], CENTRES, atol=1.0)
    assert plan.eyes[1] == pytest.approx(RADIUS, rel=0.05)
    assert [p.name for p, _ in plan.parts] == ["face"]
    assert plan.found is not None and len(plan.found.openings) == 2


def test_shapes_that_turn_an_eye_tell_its_centre() -> None:
    """An eye that is flatter than a sphere and turns about a point behind its middle."""
    about = CENTRES - np.array([0.0, 0.0, 1.5])
    eyes = [
        (f"Eye{side}", looking(shell(c, factors=(1, 1, 0.85)), p, side))
        for side, c, p in zip(("Left", "Right"), CENTRES, about, strict=True)
    ]
    plan = make_plan(joined([("Head", face()), *eyes]))
    np.testing.assert_allclose(plan.eyes[0], about, atol=0.2)


@pytest.mark.parametrize("shapes", [True, False])
def test_without_eyes_balls_are_fitted_into_the_openings(shapes: bool) -> None:
    plan = make_plan(face(shapes=shapes))
    np.testing.assert_allclose(plan.eyes[0], CENTRES, atol=2.5)
    assert plan.eyes[1] == pytest.approx(RADIUS, rel=0.12)
    assert ADDED in plan.notes


def test_a_face_without_eyes_and_openings_is_told_what_to_do() -> None:
    plan = make_plan(face(lids=False, shapes=False))
    assert plan.eyes[1] == 0 and MISSING in plan.notes
    assert all(word in MISSING for word in ("EyeLeft", "--without"))


def test_a_socket_behind_an_eye_is_left_out() -> None:
    """Skin that goes on from the lids around the back of the eye is not seen and makes no hole."""
    skin = with_sockets(face())
    check_manifold(skin, "face")
    plan = make_plan(joined([("Head", skin), *pair(shell)]))
    np.testing.assert_allclose(plan.eyes[0], CENTRES, atol=0.5)
    assert plan.found is not None and len(plan.found.openings) == 2
    assert any("sockets" in note for note in plan.notes)
    assert plan.parts[0][0].name == "face"
    kept = np.unique(np.concatenate([island.vertex for _, islands in plan.parts for island in islands]))
    assert len(kept) < len(skin.vertices) - 0.4 * (len(skin.vertices) - len(face().vertices))


def test_linings_are_searched_in_the_skin_that_no_socket_hides(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh, asked = face(), []
    count = len(mesh.faces)
    skin, eyeballs = np.arange(count) >= 5, np.arange(count) < 5
    monkeypatch.setattr(search, "hidden_faces", lambda mesh, skin, centre, radius: np.array([7, 8]))
    monkeypatch.setattr(search, "find_openings", lambda mesh, skin, middle, near: ["left", "right"])

    def linings(mesh: FitMesh, skin: Bools, centre: Floats, radius: float, side: str) -> Ints:
        asked.append((side, radius, np.flatnonzero(~skin).tolist()))
        return np.array([9 if side == "Left" else 10])

    monkeypatch.setattr(search, "linings", linings)
    eyes = search.Eyes(CENTRES, 12.0, eyeballs, eyeballs, skin)
    found = search._without_sockets(mesh, eyes, skin, 0.0, None)
    assert asked == [("Left", 12.0, [0, 1, 2, 3, 4, 7, 8]), ("Right", 12.0, [0, 1, 2, 3, 4, 7, 8, 9])]
    assert np.flatnonzero(found.faces).tolist() == [0, 1, 2, 3, 4, 7, 8, 9, 10]
    assert np.flatnonzero(~found.skin).tolist() == [0, 1, 2, 3, 4, 7, 8, 9, 10]
    assert found.openings == ["left", "right"] and found.notes == ["4 faces of sockets behind the eyes are left out"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("other", "found"),
    [
        (((-32, 40, 40), 12), True),
        (((-40, 40, 40), 12), True),  # a head that is turned a little, or not even
        (((-62, 40, 40), 12), False),
        (((-32, 70, 40), 12), False),
        (((-32, 40, 70), 12), False),
        (((-32, 40, 40), 11), True),
        (((-32, 40, 40), 8), False),
    ],
)
def test_balls_without_names_are_eyes_where_they_mirror_each_other(other, found: bool) -> None:
    mesh = joined([("Head", face(lids=False, shapes=False)), ("a", shell(CENTRES[0])), ("b", shell(*other))])
    assert (make_plan(mesh).eyes[1] > 0) == found


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, -1])
def test_of_several_pairs_of_balls_those_as_large_as_eyes_are_taken(order: int) -> None:
    others = [("Ring.L", shell((70, 0, 10), 4)), ("Ring.R", shell((-70, 0, 10), 4)), ("Bun.L", shell((60, 90, 0), 34)),
              ("Bun.R", shell((-60, 90, 0), 34))]  # fmt: skip
    pieces = [*pair(shell, ("a", "b")), *others][::order]
    plan = make_plan(joined([("Head", face(shapes=False)), *pieces]))
    np.testing.assert_allclose(plan.eyes[0], CENTRES, atol=0.5)


def test_a_string_of_beads_is_no_eyes() -> None:
    beads = [("Chain", shell((x, -90, 40), 5, rows=9, columns=12)) for x in np.linspace(-40, 40, 10)]
    assert make_plan(joined([("Head", face(lids=False, shapes=False)), *beads])).eyes[1] == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "size", "gone"),
    [("Lens", 1.1, True), ("Lens", 1.35, False), ("Cornea", 0.5, True), ("Eyelid", 0.5, False), ("Lash", 0.5, False),
     ("EyeSocket", 0.5, False), ("Brow", 0.5, False)],
)  # fmt: skip
def test_what_lies_within_a_ball_goes_with_it_unless_its_name_is_of_skin_or_hair(name, size, gone) -> None:
    inside = shell(CENTRES[0], RADIUS * size, factors=(1, 1, 0.5))
    plan = make_plan(joined([("Head", face()), *pair(shell, ("a", "b")), (name, inside)]))
    assert plan.eyes[1] == pytest.approx(RADIUS, rel=0.01)
    assert (len(plan.parts) == 1) == gone


def bare(vertices: Floats, **shapes: Floats) -> FitMesh:
    none: Ints = np.zeros((0, 4), np.int64)
    deltas = np.array([*shapes.values()]).reshape(len(shapes), len(vertices), 3)
    return FitMesh(vertices, none, np.zeros((0, 2)), none, tuple(shapes), deltas)


def test_what_blinks_has_its_middle_by_the_square_of_its_motion() -> None:
    at = np.array([[30.0, 0, 0], [36.0, 0, 6], [-30.0, 3, 0], [-40.0, 0, 0]])
    left, right = np.zeros((4, 3)), np.zeros((4, 3))
    left[:2, 1], right[2, 2] = (-1.0, -2.0), 0.5
    wanted = [[34.8, 0.0, 4.8], [-30.0, 3.0, 0.0]]
    for one, two in ((left, right), (right, left)):  # named by the viewer, too
        np.testing.assert_allclose(search.blink_middles(bare(at, eyeBlinkLeft=one, eyeBlinkRight=two)), wanted)
    assert search.blink_middles(bare(at, eyeBlinkLeft=left)) is None
    assert search.blink_middles(bare(at, eyeBlinkLeft=left, eyeBlinkRight=0 * left)) is None
    assert search.blink_middles(bare(at, eyeBlinkLeft=left, eyeBlinkRight=left)) is None
    assert search.middle_x(bare(at)) == -2.0


@pytest.mark.parametrize(("off", "turned"), [(0.039, False), (0.041, True), (0.399, True), (0.401, False)])
def test_a_pivot_near_the_spheres_centre_or_far_from_it_is_not_taken(
    monkeypatch: pytest.MonkeyPatch, off: float, turned: bool
) -> None:
    radius, centre = 10.0, np.array([1.0, 2.0, 3.0])
    pivot = np.add(centre, [0.0, off * radius, 0.0])
    points = pivot + np.array([[0.0, 0.0, 9.0], [0.0, 8.0, 5.1], [0.0, 0.0, 11.0], [50.0, 0.0, 4.9], [0.0, 0.0, -9.0]])
    side = Side(np.arange(3), Ball(centre, radius, 0.0, 1.0), points, np.ones(5))
    monkeypatch.setattr(search, "turns", lambda mesh, faces, names: names)
    monkeypatch.setattr(search, "turning_centre", lambda names: pivot if names else None)
    mesh = bare(np.zeros((1, 3)), eyeLookInLeft=np.zeros((1, 3)))
    found = search._turned(mesh, side, 0)
    assert (found is side.ball) != turned
    if turned:
        np.testing.assert_array_equal(found.centre, pivot)
        assert found.radius == pytest.approx(np.hypot(8.0, 5.1))  # the median of what lies half a radius in front
    assert search._turned(mesh, side, 1) is side.ball  # no shape turns the right eye


def test_flat_eyes_in_a_whole_face_get_balls_as_large_as_peoples_behind_them() -> None:
    sides = [Side(np.arange(1), None, np.array([[x, 5.0, 70.0]]), np.ones(1)) for x in (32.0, -32.0)]
    for side, ball in zip(sides, search._behind_flat(sides), strict=True):
        assert ball.radius == pytest.approx(0.19 * 64)
        np.testing.assert_allclose(ball.centre, side.middle - [0.0, 0.0, 0.19 * 64])
