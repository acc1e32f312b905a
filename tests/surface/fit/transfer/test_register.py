"""Matches of points on a scan, nodes that carry the map, and the order of its iterations."""

from dataclasses import replace
from itertools import pairwise

import made_face
import numpy as np
import pytest
from scipy.spatial import cKDTree

from surface.fit.transfer import register as module
from surface.fit.transfer.place_parts import ScaleShift
from surface.fit.transfer.register import STAGES, Matcher, Registration, Stage, choose_nodes, register
from surface.fit.transfer.scan import Samples
from surface.head.model.data import Neck

Z = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def face():
    return made_face.template()


def plane(border=()) -> Samples:
    """A wall at z = 0 that faces +z, one sample at every whole place."""
    x, y = (a.ravel().astype(float) for a in np.meshgrid(np.arange(-9, 10), np.arange(-9, 10)))
    at_border = np.zeros(len(x), bool)
    at_border[list(border)] = True
    return Samples(np.column_stack([x, y, 0 * x]), np.tile(Z, (len(x), 1)), at_border)


@pytest.mark.parametrize("slide", [0.0, 0.35, 1.0])
def test_a_match_goes_along_the_normal_and_a_share_of_the_way_along_the_surface(slide: float) -> None:
    at = np.array([[0.3, -0.2, 4.0]])
    match = Matcher(plane()).find(at, Z[None], 6.0, slide)
    assert match.found.tolist() == [True]
    np.testing.assert_allclose(match.goals, [[0.3 * (1 - slide), -0.2 * (1 - slide), 0.0]], atol=1e-12)


def test_what_is_far_faces_elsewhere_or_is_at_a_border_has_no_match() -> None:
    match, at = Matcher(plane()), np.array([[0.0, 0.0, 3.0]])
    assert match.find(at, Z[None], 3.1, 0.0).found.all() and not match.find(at, Z[None], 2.9, 0.0).found.any()
    for degrees, found in ((50, True), (70, False), (180, False)):
        tilted = [[np.sin(np.radians(degrees)), 0.0, np.cos(np.radians(degrees))]]
        assert match.find(at, np.array(tilted), 5.0, 0.0).found[0] == found
    middle = 9 * 19 + 9
    assert not Matcher(plane([middle])).find(at, Z[None], 5.0, 0.0).found.any()


def test_of_two_near_surfaces_the_one_that_faces_the_same_way_is_matched() -> None:
    both = Samples(np.array([[0, 0, 0.0], [0, 0, 5.0]]), np.array([[0, 0, 1.0], [0, 0, -1.0]]), np.zeros(2, bool))
    match = Matcher(both).find(np.array([[0, 0, 3.5]]), Z[None], 9.0, 0.0)
    assert match.goals[0, 2] == 0.0


def test_nodes_are_dense_at_eyes_mouth_and_nose_and_each_is_taken_once(face) -> None:
    nodes = choose_nodes(face)
    assert len(nodes) == len(set(nodes.tolist()))
    marks = np.array([p for n, p in face.landmarks.items() if n != "chin"])
    near = cKDTree(marks).query(face.points)[0] < 26.0
    share = [np.isin(np.flatnonzero(own), nodes).mean() for own in (near, ~near)]
    assert share[0] > 0.6 and share[0] > 1.5 * share[1]
    rest = nodes[~near[nodes]]
    assert face.face[rest].sum() > 200 and cKDTree(face.points[nodes]).query(face.points)[0].max() < 30
    chin = np.linalg.norm(face.points - face.landmarks["chin"], axis=1) < 8
    assert not near[chin].all()  # the chin is no feature
    with_others = choose_nodes(replace(face, face=face.face & (face.points[:, 1] > -20)))
    assert (~near & ~face.face | (face.points[:, 1] <= -20))[with_others].sum() > 100
    assert len(set(with_others.tolist())) == len(with_others) > len(nodes)


class Recorder:
    """Stands for a map: keeps what it was made of and moves nothing."""

    def __init__(self, points, goals, weight, stiffness) -> None:
        self.points, self.goals, self.weight, self.stiffness = points, goals, weight, stiffness

    def __call__(self, points):
        return points.copy()

    def turned(self, points, normals):
        return points.copy(), normals


def made(face, monkeypatch, samples, given=None):
    monkeypatch.setattr(module, "Warp", Recorder)
    monkeypatch.setattr(module, "Finder", lambda *_: None)
    return Registration(face, samples, given or {})


def test_at_first_landmarks_that_are_given_pull_and_nothing_else(face, monkeypatch) -> None:
    run = made(face, monkeypatch, made_face.samples(50), {"chin": np.array([1.0, 2.0, 3.0])})
    names, count = list(face.landmarks), len(run.warp.points) - len(face.landmarks)
    chin = count + names.index("chin")
    np.testing.assert_array_equal(run.warp.goals[chin], [1, 2, 3])
    others = np.arange(len(run.warp.points)) != chin
    np.testing.assert_array_equal(run.warp.goals[others], run.warp.points[others])
    np.testing.assert_array_equal(run.warp.points[count:], list(face.landmarks.values()))
    assert run.warp.weight[chin] > 100 * run.warp.weight[others].max() > 0
    assert run.warp.stiffness == STAGES[0].stiffness


def test_a_match_weighs_less_the_further_it_is(face, monkeypatch) -> None:
    """Cauchy's weights: a half at half of the farthest distance."""
    shifted = made_face.samples(1)
    points = face.points + 2.0 * face.normals
    run = made(face, monkeypatch, Samples(points, face.normals, np.zeros(len(points), bool)))
    run.step(77.0, 4.0)
    count = len(run._nodes)
    np.testing.assert_allclose(run.warp.weight[:count], 0.5, atol=1e-6)
    np.testing.assert_allclose(
        run.warp.goals[:count] - run.warp.points[:count], 2 * face.normals[run._nodes], atol=1e-6
    )
    assert run.warp.stiffness == 77.0 and (run.warp.weight[count:] < 0.1).all()
    assert len(shifted.points) == 1


def test_without_matches_nodes_keep_their_places_near_others_and_far_away_go_as_a_whole(face, monkeypatch) -> None:
    run = made(face, monkeypatch, made_face.samples(20))
    p = face.points[run._nodes]
    found = p[:, 1] > 20
    goals = 1.1 * p + [0.0, 0.0, 9.0]
    run._stiffer = lambda points: points + np.array([0.0, 0.0, 2.0])
    out, weight = run._unmatched(goals, np.ones(len(p)), found)
    away = cKDTree(p[found]).query(p)[0]
    near, far = ~found & (away < 12), away > 41
    assert near.sum() > 5 and far.sum() > 5
    np.testing.assert_allclose(out[found | far], goals[found | far], atol=1e-9)
    np.testing.assert_allclose(out[near], p[near] + [0, 0, 2.0], atol=1e-9)
    assert (weight[found] == 1).all() and (weight[far] > 10 * weight[near].max()).all() and weight[far].max() < 0.2
    few = np.zeros(len(p), bool)
    few[:3] = True
    np.testing.assert_array_equal(run._unmatched(goals, np.ones(len(p)), few)[0], p)
    few[3] = True
    assert not np.array_equal(run._unmatched(goals, np.ones(len(p)), few)[0], p)


@pytest.mark.parametrize("single", [False, True])
def test_landmarks_that_are_found_pull_as_much_as_they_are_sure_unless_they_are_given(
    face, monkeypatch, single
) -> None:
    run = made(face, monkeypatch, made_face.samples(20), {"chin": np.zeros(3)})
    heard = []

    class Found:
        def find(self, at, marks, search):
            heard.append((at, marks, search, False))
            return {"chin": (np.ones(3), 1.0), "nose_tip": (np.full(3, 7.0), 0.5), "mouth_left": (np.full(3, 8.0), 1.0)}

        def refine(self, at, marks, search):
            result = self.find(at, marks, search)
            heard[-1] = (at, marks, search, True)
            return result

    run._finder = Found()
    run.find_landmarks(4.5, single)
    at, marks, search, alone = heard[0]
    assert alone == single and search == 4.5
    np.testing.assert_array_equal(at, face.points)
    np.testing.assert_array_equal(marks["mouth_left"], face.landmarks["mouth_left"])
    run.step(1.0, 5.0)
    k = {n: len(run._nodes) + i for i, n in enumerate(face.landmarks)}
    goals, weight = run.warp.goals, run.warp.weight
    assert (goals[k["chin"]] == 0).all() and (goals[k["nose_tip"]] == 7).all()
    assert weight[k["nose_tip"]] == pytest.approx(0.25 * weight[k["mouth_left"]])
    assert weight[k["chin"]] > weight[k["mouth_left"]] >= 1
    alone_weight = weight[k["mouth_left"]]
    run.find_landmarks(4.5, not single)
    run.step(1.0, 5.0)
    other = run.warp.weight[k["mouth_left"]]
    assert (alone_weight < other) == single  # one by itself is less sure


def test_the_map_becomes_less_stiff_and_its_reach_smaller() -> None:
    for before, after in pairwise(STAGES):
        assert after.stiffness < before.stiffness and after.farthest < before.farthest
        assert after.steps >= before.steps and not (before.single and after.search and not after.single)
    assert STAGES[0].search == 0 == STAGES[-1].search  # first the whole, at last only the surface
    searches = [s.search for s in STAGES if s.search]
    assert searches == sorted(searches, reverse=True)


def test_stages_follow_each_other_and_the_smooth_map_is_the_last_stiff_one(monkeypatch) -> None:
    heard: list[object] = []

    class Run:
        def __init__(self, *_) -> None:
            self.warp = "start"

        def keep_unmatched(self) -> None:
            heard.append("hold")

        def marks(self) -> dict[str, object]:
            return {"chin": self.warp}

        def find_landmarks(self, search, single) -> None:
            heard.append((search, single))

        def step(self, stiffness, farthest) -> None:
            self.warp = stiffness
            heard.append((stiffness, farthest, "step"))

    monkeypatch.setattr(module, "Registration", Run)
    monkeypatch.setattr(module, "STAGES", (Stage(900.0, 9.0, 2), Stage(500.0, 8.0, 1, 4.0, True), Stage(60.0, 6.0, 1)))
    shares: list[float] = []
    found = register(None, None, {}, shares.append)
    assert (found.warp, found.smooth, found.marks) == (60.0, 500.0, {"chin": 60.0})
    assert heard == ["hold", (900.0, 9.0, "step"), (900.0, 9.0, "step"), "hold", (4.0, True), (500.0, 8.0, "step"),
                     "hold", (60.0, 6.0, "step")]  # fmt: skip
    assert shares == pytest.approx([1 / 3, 2 / 3, 1])


def test_a_known_map_is_found_between_a_template_and_a_scan(face, monkeypatch) -> None:
    for name, count in (("FEATURES", 150), ("FACE", 120), ("REST", 60)):
        monkeypatch.setattr(module, name, count)
    monkeypatch.setattr(module, "Finder", lambda *_: None)
    monkeypatch.setattr(module, "STAGES", (Stage(3000.0, 15.0, 2), Stage(100.0, 8.0, 2)))
    scan = made_face.samples(6000)

    def bent(p):
        return p * [1.04, 1.0, 1.0] + np.column_stack([0 * p[:, 0], 0 * p[:, 0], 3.0 * np.sin(p[:, 1] / 40)])

    moved = Samples(bent(scan.points), scan.normals, scan.border)
    done = register(face, moved, {}, lambda _: None)
    warp, smooth = done.warp, done.smooth
    inner = (np.abs(face.points) < [55, 85, 999]).all(axis=1)
    tree = cKDTree(moved.points)
    off = [tree.query(w(face.points[inner]))[0].mean() for w in (warp, smooth, lambda p: p)]
    assert off[0] < 1.3 < off[2] and off[0] < off[1] < off[2]


@pytest.mark.parametrize("known", [True, False])
def test_what_is_below_the_end_of_a_neck_follows_that_end(face, monkeypatch, known: bool) -> None:
    """Where the head's neck is known; the end stands 12 mm further forward than the rest of the head."""
    own = replace(face, neck=Neck((0.0, 0.0, 0.0), 0.0, -100.0, -20.0) if known else None)
    run = made(own, monkeypatch, made_face.samples(50))
    angle, y = (a.ravel() for a in np.meshgrid(np.arange(24) * np.pi / 12, np.arange(-300.0, 100.0, 5.0)))
    points = np.column_stack([50.0 * np.sin(angle), y, 50.0 * np.cos(angle)])
    found = y > -60.0
    goals = np.where(found[:, None], points + 12.0 * Z, 0.0)
    placed = run._placed(points, goals, found, ScaleShift(1.0, np.zeros(3)))
    forward = (placed - points)[:, 2]
    np.testing.assert_allclose(forward[y < -20.0], 12.0 if known else 0.0, atol=1e-9)
    np.testing.assert_allclose(forward[y >= 0.0], 0.0, atol=1e-9)
