"""Alignment of a scan with a template: similarities by pairs, rotations to try, starts, scores and the search."""

from dataclasses import replace

import made_face
import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from surface.base.errors import FitError
from surface.fit.transfer import align as module
from surface.fit.transfer.align import (
    Aligner,
    Similarity,
    align,
    axis_turns,
    face_region,
    foremost,
    from_pairs,
    thinned,
    tilted_turns,
)
from surface.fit.transfer.scan import Samples

TURN = Rotation.from_euler("xyz", [12, -8, 20], degrees=True).as_matrix()
POINTS = np.random.default_rng(0).normal(size=(30, 3)) * [9.0, 5.0, 3.0]
X, Y, Z = np.eye(3)


@pytest.fixture(scope="module")
def face():
    return made_face.template()


def test_a_similarity_is_recovered_from_pairs_and_points_without_weight_do_not_count() -> None:
    goals = 0.25 * POINTS @ TURN.T + [4.0, 5.0, -6.0]
    found = from_pairs(POINTS, goals)
    np.testing.assert_allclose(found.turn, TURN, atol=1e-12)
    assert found.scale == pytest.approx(0.25) and found.score == 0.0
    np.testing.assert_allclose(found.points(POINTS), goals, atol=1e-12)
    goals[:2] += 50.0
    weight = np.ones(30)
    weight[:2] = 0.0
    np.testing.assert_allclose(from_pairs(POINTS, goals, weight).points(POINTS)[2:], goals[2:], atol=1e-9)


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_no_similarity_near_the_found_one_is_better_and_a_mirror_image_is_never_a_rotation(mirror: float) -> None:
    weight = np.random.default_rng(2).uniform(0.5, 2.0, 30)
    goals = 2.0 * POINTS @ TURN.T * [mirror, 1, 1] + np.random.default_rng(1).normal(size=(30, 3))

    def off(s: Similarity) -> float:
        return float(weight @ ((s.points(POINTS) - goals) ** 2).sum(axis=1))

    found = from_pairs(POINTS, goals, weight)
    assert np.linalg.det(found.turn) == pytest.approx(1.0)
    for axis in np.vstack([np.eye(3), -np.eye(3)]):
        more = Rotation.from_rotvec(1e-3 * axis).as_matrix()
        assert off(replace(found, shift=found.shift + 1e-3 * axis)) > off(found)
        middle = found.points(weight @ POINTS / weight.sum())
        assert off(Similarity(more @ found.turn, found.scale, middle - more @ (middle - found.shift))) > off(found)
    for factor in (0.999, 1.001):
        shift = middle + factor * (found.shift - middle)
        assert off(Similarity(found.turn, factor * found.scale, shift)) > off(found)


def test_the_region_of_the_face_ends_below_the_chin_on_the_forehead_and_at_the_temples(face) -> None:
    h, marks = face.height, face.landmarks
    places = np.array([marks["nose_tip"], marks["left_eye_upper"], *np.zeros((11, 3))])
    front = [0.0, 0.0, 1.0]
    normals, own, eye = np.tile(front, (13, 1)), np.ones(13, bool), np.full(13, -1)
    tip, chin, bridge = marks["nose_tip"], marks["chin"], marks["nose_bridge"]
    places[2:6] = [[0, chin[1] - s * h, tip[2]] for s in (0.05, 0.3)] + [
        [0, bridge[1] + s * h, tip[2]] for s in (0.4, 0.6)
    ]
    places[6:8] = [[0, 0, tip[2] - s * h] for s in (0.8, 0.95)]
    places[8:13] = [0, 0, tip[2] - 5]
    normals[8:10, 2] = 0.0, -0.3
    own[10:13] = False
    eye[11:13] = 0, 1
    found = face_region(replace(face, points=places, normals=normals, face=own, eye=eye))
    assert found.tolist() == [True, True, True, False, True, False, True, False, True, False, False, True, True]


def test_thinned_points_are_about_as_many_and_spread_over_all() -> None:
    points = np.random.default_rng(4).uniform(0, [100, 60, 20], (4000, 3))
    for count in (100, 700):
        kept = thinned(points, count)
        assert 0.8 * count <= len(kept) <= 1.2 * count and (np.diff(kept) > 0).all()
        apart = cKDTree(points[kept]).query(points)[0].max()
        assert apart < 2.2 * (100 * 60 * 20 / count) ** (1 / 3)

    line = thinned(np.arange(200.0)[:, None] * np.ones(3), 50)  # along x = y = z
    assert 30 <= len(line) <= 60


def test_what_is_foremost_agrees_with_a_search_column_by_column() -> None:
    points, size = np.random.default_rng(5).uniform(-6, 6, (400, 3)), 1.5
    columns: dict[tuple[int, ...], float] = {}
    for p in points:
        key = tuple(np.floor(p[:2] / size).astype(int))
        columns[key] = max(columns.get(key, -np.inf), p[2])
    wanted = [p[2] > columns[tuple(np.floor(p[:2] / size).astype(int))] - 2 * size for p in points]
    assert not len(foremost(np.zeros((0, 3)), size))
    assert foremost(points, size).tolist() == wanted and 0 < sum(wanted) < 400


def test_rotations_of_axes_are_all_different_and_agree_with_what_is_known() -> None:
    every = list(axis_turns(None, None))
    assert len({tuple(t.ravel()) for t in every}) == 24
    np.testing.assert_array_equal(every[0], np.eye(3))
    assert all(np.linalg.det(t) == pytest.approx(1) for t in every)
    up = list(axis_turns(Z, None))
    assert len(up) == 4 and all((t @ Z == Y).all() for t in up)
    (both,) = axis_turns(Z, -Y)
    np.testing.assert_allclose([both @ Z, both @ -Y], [Y, Z])


def test_tilted_rotations_are_about_forty_degrees_from_others() -> None:
    tilted = np.stack(list(tilted_turns()))
    asked = Rotation.random(200, rng=np.random.default_rng(9)).as_matrix()
    cosine = 0.5 * (np.einsum("aij,bij->ab", asked, tilted).max(axis=1) - 1.0)
    assert np.degrees(np.arccos(np.median(cosine))) < 40 and np.degrees(np.arccos(cosine.min())) < 80
    assert np.array_equal(tilted, np.stack(list(tilted_turns())))  # the same ones every time


def scan_of(face, hat: float = 0.0):
    """The face, and what else may stand out in front: a brim at its top, a foot far below it, a hand beside it."""
    made = made_face.samples(1500)
    top, h = made.points[:, 1].max(), face.height
    extra = [[0, top, 300], [0, top - 3.0 * h, 300], [70, 0, 300], [-70, 0, 0]] if hat else [[0, 0, 0]] * 0
    points = np.vstack([made.points, np.reshape(extra, (-1, 3))])
    return replace(made, points=points, normals=np.vstack([made.normals, np.tile(Z, (len(extra), 1))]))


def test_starts_put_what_stands_out_of_the_middle_at_the_nose_in_every_size(face) -> None:
    made = scan_of(face, hat=1.0)
    height, tip = np.ptp(made.points[:, 1]), face.landmarks["nose_tip"]
    starts = list(Aligner(face, made)._starts(np.eye(3)))
    assert [round(s.scale * height / face.height, 9) for s in starts] == list(module.EXTENTS)
    fits = min(starts, key=lambda s: abs(np.log(s.scale)))
    nose = made.points[:-4][made.points[:-4, 2].argmax()]
    np.testing.assert_allclose(fits.points(nose), tip, atol=1e-9)
    aside = replace(made, points=made.points + np.array([500.0, 0, 0]))
    beside = min(Aligner(face, aside)._starts(np.eye(3)), key=lambda s: abs(np.log(s.scale)))
    np.testing.assert_allclose(beside.points(nose + np.array([500.0, 0, 0])), tip, atol=1e-9)
    turned = min(
        Aligner(face, replace(made, points=made.points @ TURN))._starts(TURN), key=lambda s: abs(np.log(s.scale))
    )
    np.testing.assert_allclose(turned.points(nose @ TURN), tip, atol=1e-6)


def test_the_score_is_small_only_where_the_face_is(face) -> None:
    made = made_face.samples(6000)
    aligner = Aligner(face, made)
    h, chosen = face.height, aligner._coarse
    scores = [aligner.score(Similarity(np.eye(3), 1.0, np.array([0.0, s * h, 0.0])), chosen) for s in (0, 0.05, 0.15)]
    assert scores[0] < 0.06 and scores == sorted(scores)
    assert aligner.score(Similarity(np.eye(3), 1.0, np.array([900.0, 0, 0])), chosen) == 1.0
    tip = face.landmarks["nose_tip"]
    others = np.vstack([[[x, 0, tip[2] + 0.8 * h]] * 300 for x in (-9, 0, 9)] + [[[30, 0, 50]] * 300])
    facing = np.vstack([[[0, 0, 1.0]] * 900, [[0, 0.8, -0.6]] * 300])  # a hand far before it, a lining behind it
    more = replace(made, points=np.vstack([made.points, others]), normals=np.vstack([made.normals, facing]))
    assert Aligner(face, more).score(Similarity(np.eye(3), 1.0, np.zeros(3)), chosen) == pytest.approx(scores[0])
    deep = aligner.score(Similarity(np.eye(3), 1.0, np.array([0.0, 0, 0.2 * h])), chosen)
    assert scores[0] < deep <= 2 * module.CLIP
    assert (
        aligner.score(Similarity(np.diag([-1.0, 1.0, -1.0]), 1.0, np.zeros(3)), chosen) == 1.0
    )  # the back of its head


def test_a_scan_of_any_size_and_place_is_found_and_its_score_says_so(face) -> None:
    made, shift = made_face.samples(1600), np.array([1.0, 2.0, 3.0])
    tilt = Rotation.from_euler("xyz", [8, -6, 5], degrees=True).as_matrix()
    moved = replace(made, points=0.001 * made.points @ tilt + shift, normals=made.normals @ tilt)
    found = Aligner(face, moved).search(Y, Z)
    assert found is not None
    assert found.scale == pytest.approx(1000, rel=0.02) and found.score < module.GOOD
    assert np.linalg.norm(found.points(moved.points) - made.points, axis=1).mean() < 3.0


def test_a_start_is_improved_to_the_place_although_the_scan_has_a_hole(face) -> None:
    made = made_face.samples(4000)
    lost = (np.abs(made.points[:, 0] - 30) < 25) & (np.abs(made.points[:, 1] + 30) < 25)  # a hole in the scan
    made = replace(made, points=0.01 * made.points[~lost], normals=made.normals[~lost])
    aligner = Aligner(face, made)
    turn = Rotation.from_rotvec([0.1, -0.08, 0.05]).as_matrix()
    found = aligner.refine(Similarity(turn, 106.0, np.array([4.0, -3.0, 2.0])), aligner._fine, 40)
    assert np.linalg.norm(found.points(made.points) - 100 * made.points, axis=1).mean() < 2.5
    assert found.score == aligner.score(found, aligner._fine)


def test_no_start_changes_its_size_without_bounds(face) -> None:
    aligner = Aligner(face, replace(made_face.samples(1000), points=0.01 * made_face.samples(1000).points))
    large, small = (aligner.refine(Similarity(np.eye(3), s, np.zeros(3)), aligner._coarse, 8) for s in (600.0, 20.0))
    assert large.scale >= 0.5 * 600 and small.scale <= 2 * 20 and large.scale < 600 and small.scale > 20


@pytest.mark.parametrize(("good", "tried"), [(0, 1), (5, 24), (30, 120), (None, 120)])
def test_every_rotation_is_tried_until_one_fits_well(face, monkeypatch, good, tried) -> None:
    heard: list[np.ndarray] = []

    def best(_, turns):
        heard.extend(turns)
        score = 0.05 if good is not None and len(heard) > good else 0.3
        return Similarity(turns[0], 1.0, np.zeros(3), score)

    monkeypatch.setattr(Aligner, "_best", best)
    found = Aligner(face, made_face.samples(100)).search(None, None)
    assert len(heard) == len({tuple(t.ravel()) for t in heard}) == tried
    assert found.score == (0.3 if good is None else 0.05)


def test_a_poor_score_is_no_face(face, monkeypatch) -> None:
    results = iter([0.1, 0.2])
    monkeypatch.setattr(Aligner, "search", lambda *_: Similarity(np.eye(3), 1.0, np.zeros(3), next(results)))
    assert align(face, made_face.samples(100), None, None, "x.ply").score == 0.1
    with pytest.raises(FitError, match=r"x\.ply: no face") as caught:
        align(face, made_face.samples(100), None, None, "x.ply")
    assert "--landmarks" in str(caught.value.hint)


@pytest.mark.parametrize(("up", "forward"), [(Y, Z), (Y, None), (None, None)])
def test_a_sheet_that_lies_flat_has_no_face(face, up, forward) -> None:
    x, z = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, 12), np.linspace(0, 1, 12)))
    points = np.column_stack([x, 0.0 * x, z])
    flat = Samples(points, np.tile(Y, (len(x), 1)), np.zeros(len(x), bool))
    with pytest.raises(FitError, match=r"flat\.obj: no face was found"):
        align(face, flat, up, forward, "flat.obj")
