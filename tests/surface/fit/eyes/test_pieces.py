"""Eyes as pieces: balls in pairs, names, halves of one piece, irises, and what is no pair of eyes."""

from dataclasses import replace

import eye_face
import numpy as np
import pytest
from eye_face import CENTRES, RADIUS, disc, joined, pair, shell

from surface.fit.eyes import pieces as eye_pieces
from surface.fit.eyes.pieces import (
    MAX_ASYMMETRY,
    MAX_FIT_ERROR,
    SIZE_DEVIATION,
    SIZE_RANGE,
    USUAL_SIZE,
    around,
    is_round,
    mirrored,
    named_sides,
    pieces_of,
    round_sides,
    weighted_points,
)
from surface.fit.points.ballfit import Ball
from surface.fit.source.mesh import FitMesh, face_areas

Z = np.array([0.0, 0.0, 1.0])


def every(mesh: FitMesh):
    return pieces_of(mesh, np.arange(len(mesh.faces)))


def test_pieces_are_connected_and_of_one_name() -> None:
    mesh = joined([("a", shell((0, 0, 0), 3.0)), ("b", shell((9, 0, 0), 2.0)), ("a", shell((20, 0, 0), 1.0))])
    mesh = replace(mesh, pieces=("a", "b", "a"), piece=np.where(mesh.piece == 2, 0, mesh.piece))
    found = every(mesh)
    assert sorted((p.name, round(float(p.ball.radius), 2)) for p in found) == [("a", 1.0), ("a", 3.0), ("b", 2.0)]
    assert sorted(np.concatenate([p.faces for p in found]).tolist()) == list(range(len(mesh.faces)))
    for p in found:
        np.testing.assert_allclose(p.middle, p.ball.centre, atol=0.25)
    assert pieces_of(mesh, np.zeros(0, int)) == []
    split = replace(shell((0, 0, 0)), pieces=("a", "b"), piece=(np.arange(len(shell((0, 0, 0)).faces)) % 2))
    names = {(p.name, len(p.faces)) for p in every(split)}
    assert {n for n, _ in names} == {"a", "b"}  # what hangs together under two names is two pieces
    assert len(every(replace(split, pieces=(), piece=split.piece[:0]))) == 1


def test_points_weigh_as_much_as_the_area_around_them() -> None:
    points = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0], [5, 0, 0.0]])
    mesh = FitMesh(points, np.array([[0, 1, 2, 3], [1, 4, 2, -1]]),
                   np.zeros((0, 2)), np.full((2, 4), -1), (), np.zeros((0, 5, 3)))  # fmt: skip
    points, weight = weighted_points(mesh, np.arange(2))
    np.testing.assert_allclose(points, mesh.vertices)
    np.testing.assert_allclose(weight, [0.5, 1.0, 1.0, 0.5, 0.5], atol=1e-6)
    assert weight.sum() == pytest.approx(face_areas(mesh.vertices, mesh.faces).sum(), rel=1e-6)
    flat = replace(mesh, vertices=0 * mesh.vertices)
    assert (weighted_points(flat, np.arange(2))[1] > 0).all()
    assert len(weighted_points(mesh, np.array([1]))[0]) == 3


@pytest.mark.parametrize(
    ("p", "q", "found"),
    [
        ((30, 0, 0), (-30, 0, 0), True), ((40, 0, 0), (-20, 0, 0), False), ((34, 0, 0), (-26, 0, 0), True),
        ((30, 17, 0), (-30, 0, 0), True), ((30, 19, 0), (-30, 0, 0), False), ((30, 0, 0), (-30, 0, 19), False),
        ((30, 0, 0), (-30, 0, -17), True), ((-30, 0, 0), (30, 0, 0), False), ((0, 0, 0), (0, 0, 0), False),
    ],
)  # fmt: skip
def test_what_mirrors_each_other(p, q, found: bool) -> None:
    assert mirrored(np.array(p, float), np.array(q, float), 0.0) == found
    assert (
        mirrored(np.array(p, float) + np.array([100, 5, 5]), np.array(q, float) + np.array([100, 5, 5]), 100.0) == found
    )
    assert MAX_ASYMMETRY * 60 == 18


def balls(*every_ball):
    return every(joined([(f"p{k}", shell(c, r)) for k, (c, r) in enumerate(every_ball)]))


def test_a_pair_of_balls_are_eyes_the_left_one_first() -> None:
    for order in (1, -1):
        found = round_sides(balls(*[(c, RADIUS) for c in CENTRES[::order]]), 0.0, None)
        np.testing.assert_allclose([s.ball.centre for s in found], CENTRES, atol=0.01)
        np.testing.assert_allclose([s.middle for s in found], CENTRES, atol=0.01)
        assert all(len(s.pieces) == 1 and s.iris == 0.0 for s in found)


@pytest.mark.parametrize(
    ("radius", "found"), [(0.08, False), (0.12, True), (0.19, True), (0.44, True), (0.48, False)]
)  # in distances between both
def test_balls_of_no_eyes_size_are_none(radius: float, found: bool) -> None:
    apart = 64.0
    assert SIZE_RANGE[0] > 0.08 and SIZE_RANGE[1] < 0.48
    assert bool(round_sides(balls(*[(c, radius * apart) for c in CENTRES]), 0.0, None)) == found


def test_balls_of_different_sizes_or_far_from_what_blinks_are_none() -> None:
    assert round_sides(balls((CENTRES[0], 12.0), (CENTRES[1], 10.0)), 0.0, None)
    assert not round_sides(balls((CENTRES[0], 12.0), (CENTRES[1], 9.0)), 0.0, None)
    two = balls(*[(c, RADIUS) for c in CENTRES])
    assert round_sides(two, 0.0, CENTRES + np.array([0, 0, 28.0])) and not round_sides(
        two, 0.0, CENTRES + np.array([0, 0, 36.0])
    )
    assert not round_sides(two, 0.0, CENTRES + np.array([[0, 0, 0], [0, 36.0, 0]]))
    assert not round_sides(two, 70.0, None) and not round_sides(two[:1], 0.0, None) and not round_sides([], 0.0, None)


def test_of_several_pairs_the_one_most_like_eyes_is_taken() -> None:
    others = [((60.0, 90, 0), 34.0), ((-60.0, 90, 0), 34.0), ((70.0, 0, 10), 15.0), ((-70.0, 0, 10), 15.0)]
    found = round_sides(balls(*others, *[(c, RADIUS) for c in CENTRES]), 0.0, None)
    np.testing.assert_allclose([s.ball.centre for s in found], CENTRES, atol=0.01)


def test_more_than_a_few_balls_of_one_size_are_beads() -> None:
    row = [((x, -90.0, 40.0), 5.0) for x in (-40, -30, -20, -10, 10, 20, 30, 40)]
    assert not round_sides(balls(*row), 0.0, None)
    four = [((x, -90.0, 40.0), 5.0) for x in (-40, -20, 20, 40)]
    assert round_sides(balls(*four), 0.0, None)
    assert round_sides(balls(*row, *[(c, RADIUS) for c in CENTRES]), 0.0, None)


@pytest.mark.parametrize(("off", "spread", "found"), [(0.03, 0.7, True), (0.04, 0.7, False), (0.03, 0.5, False)])
def test_what_is_round(off: float, spread: float, found: bool) -> None:
    assert is_round(Ball(np.zeros(3), 1.0, off, spread)) == found


def test_pieces_named_as_eyes_are_eyes_and_an_iris_tells_its_radius() -> None:
    mesh = joined([*pair(shell), *pair(lambda c: disc(c + np.array([0, 0, 12.2]), 5.0), ("IrisLeft", "IrisRight")),
                   ("Ball", shell((0, -80, 0), 9.0))])  # fmt: skip
    left, right = named_sides(mesh, 0.0)
    np.testing.assert_allclose([left.ball.centre, right.ball.centre], CENTRES, atol=0.05)
    assert left.iris == pytest.approx(5.0, abs=0.05) and len(left.pieces) == 2
    used = np.concatenate([left.faces, right.faces])
    assert len(used) == (mesh.piece < 4).sum() == len(set(used.tolist()))
    assert named_sides(joined([("A", shell(CENTRES[0])), ("B", shell(CENTRES[1]))]), 0.0) == []
    assert named_sides(joined([("EyeLeft", shell(CENTRES[0]))]), 0.0) == []
    assert (
        named_sides(joined([("EyeLeft", shell(CENTRES[0])), ("EyeRight", shell(CENTRES[1] + [0, 40, 0]))]), 0.0) == []
    )


def test_one_piece_of_both_eyes_is_cut_in_two() -> None:
    """A mask-like strip that bears both eyes, connected."""
    mesh = eye_face.face(lids=False, shapes=False)
    strip = np.flatnonzero(np.abs(mesh.vertices[mesh.faces[:, :3]].mean(axis=1)[:, 1] - 40) < 9)
    own = replace(
        mesh, faces=mesh.faces[strip], face_uv=mesh.face_uv[strip], piece=0 * mesh.piece[strip], pieces=("Eyes",)
    )
    found = named_sides(own, 0.0)
    assert sum(len(s.faces) for s in found) == len(strip)
    x = [own.vertices[own.faces[s.faces, :3]].mean(axis=1)[:, 0] for s in found]
    assert x[0].min() > 0 >= x[1].max()


def test_a_cover_does_not_tell_how_large_the_eyeball_is() -> None:
    with_cover = [*pair(shell), *pair(lambda c: shell(c, 13.5), ("EyeHighlightLeft", "EyeHighlightRight"))]
    left, _ = named_sides(joined(with_cover), 0.0)
    assert left.ball.radius == pytest.approx(RADIUS, rel=0.01)
    only = joined(pair(lambda c: shell(c, 13.5), ("EyeHighlightLeft", "EyeHighlightRight")))
    assert named_sides(only, 0.0)[0].ball.radius == pytest.approx(13.5, rel=0.01)


def test_flat_eyes_have_no_sphere_but_a_middle() -> None:
    left, right = named_sides(joined(pair(lambda c: disc(c, 9.0))), 0.0)
    assert left.ball is None and right.ball is None
    np.testing.assert_allclose(left.middle, CENTRES[0], atol=0.3)


def test_what_lies_in_a_ball_a_little_larger_than_an_eye_belongs_to_it() -> None:
    mesh = joined([*pair(shell, ("a", "b")), ("lens", shell(CENTRES[0], 15.0)), ("big", shell(CENTRES[0], 16.0)),
                   ("spot", disc(CENTRES[1] + Z * 13.0, 3.0)), ("far", disc(CENTRES[1] + Z * 16.5, 3.0))])  # fmt: skip
    pieces = every(mesh)
    sides = round_sides([p for p in pieces if p.name in "ab"], 0.0, None)
    found = {mesh.pieces[mesh.piece[f]] for f in around(pieces, sides)}
    assert found == {"a", "b", "lens", "spot"} and len(around(pieces, [])) == 0


def test_a_pair_is_less_likely_the_further_its_size_and_its_form_are_from_eyes() -> None:
    def like(radius: float, off: float = 0.0) -> float:
        a, b = (Ball(c, radius, off, 1.0) for c in CENTRES)
        return eye_pieces._likeness(a, b, 0.0, None)

    usual = USUAL_SIZE * 64.0
    assert like(usual) == pytest.approx(1.0)
    smaller, larger = (
        like(usual / np.exp(SIZE_DEVIATION)),
        like(usual * np.exp(SIZE_DEVIATION)),
    )  # a standard deviation off
    assert smaller == pytest.approx(np.exp(-0.5)) == larger
    assert like(usual, MAX_FIT_ERROR) == pytest.approx(0.5) and like(usual, 0.5 * MAX_FIT_ERROR) == pytest.approx(0.75)


@pytest.mark.parametrize(
    ("low", "high", "halves"), [(-40, 40, 2), (-8, 40, 1), (-40, 8, 1), (-14, 40, 2), (-40, 14, 2)]
)
def test_only_a_piece_that_lies_well_on_both_sides_is_cut(low: float, high: float, halves: int) -> None:
    strip = disc((0.5 * (low + high), 0.0, 0.0), 0.5 * (high - low))
    (piece,) = every(strip)
    assert len(eye_pieces._halves(strip, piece, 0.0)) == halves
    aside = replace(strip, vertices=strip.vertices + 100.0 * np.eye(3)[0])
    assert len(eye_pieces._halves(aside, every(aside)[0], 100.0)) == halves


def test_the_radius_of_an_iris_is_its_largest_whichever_way_it_is_long() -> None:
    for wide, tall in ((4.0, 6.0), (6.0, 4.0)):
        flat = disc(CENTRES[0], 1.0)
        oval = replace(flat, vertices=CENTRES[0] + (flat.vertices - CENTRES[0]) * np.array([wide, tall, 1.0]))
        irises = [("IrisLeft", oval), ("IrisRight", replace(oval, vertices=oval.vertices * np.array([-1.0, 1, 1])))]
        left, _ = named_sides(joined([*pair(shell), *irises]), 0.0)
        assert left.iris == pytest.approx(6.0, rel=0.02)
