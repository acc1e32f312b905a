"""Margins of lids that lie inside an eyeball and would be crushed on it."""

import numpy as np
import pytest
from eye_face import CENTRES, RADIUS, face, joined, pair, shell, with_margins

from surface.fit.eyes import margins as margins_module
from surface.fit.eyes.lids import fit_lids
from surface.fit.eyes.margins import _without_teeth, margins
from surface.fit.eyes.search import Eyes, find_eyes
from surface.fit.source.mesh import FitMesh, face_areas

SKIN = len(face().faces)


def skin_of(mesh: FitMesh) -> np.ndarray:
    return np.ones(len(mesh.faces), bool)


def test_margins_inside_the_eyeballs_go_ring_by_ring_and_nothing_else() -> None:
    mesh = with_margins(face())
    gone = margins(mesh, skin_of(mesh), CENTRES, RADIUS)
    added = np.flatnonzero(np.arange(len(mesh.faces)) >= SKIN)
    assert np.isin(gone, added).all() and len(gone) >= 0.8 * len(added)  # the corners may stay
    x = mesh.vertices[mesh.faces[gone, 0], 0]
    assert abs((x > 0).mean() - 0.5) < 0.05


@pytest.mark.parametrize("steps", [(), (0.8, 1.6)], ids=["thin lids", "lids that turn outwards"])
def test_lids_that_lie_on_the_eyeball_keep_their_edges(steps: tuple[float, ...]) -> None:
    mesh = with_margins(face(), steps)
    assert not len(margins(mesh, skin_of(mesh), CENTRES, RADIUS))


def test_margins_before_smaller_eyeballs_stay() -> None:
    mesh = with_margins(face())
    assert not len(margins(mesh, skin_of(mesh), CENTRES, RADIUS - 2.5))


def eyes_of(mesh: FitMesh) -> Eyes:
    return find_eyes(mesh, lambda gone: ~gone)


def test_lids_end_at_the_edge_that_is_seen_and_do_not_fold() -> None:
    """Lifted out of the eyeball, a margin lay on the lid before it: faces without area, and turned over in blinks."""
    whole = joined([("Head", with_margins(face())), *pair(shell)])
    eyes = eyes_of(whole)
    assert any("margins inside the eyeballs are left out" in note for note in eyes.notes)
    assert np.isin(np.concatenate([o.edge for o in eyes.openings]), np.arange(len(face().vertices))).mean() > 0.8
    seated, _ = fit_lids(whole, eyes)
    rows = np.flatnonzero(eyes.skin)
    before, after = (face_areas(m.vertices, m.faces[rows]) for m in (whole, seated))
    assert (after / before).min() > 0.4


def test_a_triangle_that_stands_out_alone_is_one_between_faces_that_are_gone() -> None:
    """The place of a triangle that -1 fills is no vertex, and not the last one either."""
    faces = np.array([[0, 1, 2, -1], [1, 0, 3, -1], [0, 3, 4, -1], [3, 1, 5, -1]])
    mesh = FitMesh(np.zeros((7, 3)), faces, np.zeros((1, 2)), np.full_like(faces, -1), (), np.zeros((0, 7, 3)))
    kept = np.array([False, True, False, False])
    assert _without_teeth(mesh, kept, ~kept).sum() == 0, "all round it faces are gone"
    beside = np.array([True, False, False, False])
    again = FitMesh(mesh.vertices[:4], faces[:2], mesh.uv, mesh.face_uv[:2], (), np.zeros((0, 4, 3)))
    assert _without_teeth(again, kept[:2], beside[:2]).tolist() == [False, True], "only one of its edges is beside one"


def eye(local: list[list[float]], radius: float = 10.0) -> margins_module._Eye:
    return margins_module._Eye(np.array(local, float), radius)


def test_the_rim_before_an_eye_is_an_upper_and_a_lower_lid() -> None:
    """By the line between its corners, within 1.4 radii in front of the centre."""
    at = [[-8.0, -1.0, 5.0], [8.0, 1.0, 5.0], [0.0, 3.0, 9.0], [0.0, -3.0, 9.0], [4.0, 0.6, 9.0], [4.0, 0.4, 9.0]]
    beyond = [[0.0, 13.9, 2.0], [0.0, 13.7, 2.0], [0.0, 5.0, -1.0], [0.0, 5.0, 0.0], [0.0, 4.0, 9.0]]
    many = [[x, 4.0, 8.0] for x in np.linspace(-5, 5, 30)]
    local = at + beyond + many
    rim = np.ones(len(local), bool)
    rim[10] = False
    upper, lower = eye(local).lids(rim)
    assert sorted(upper.tolist()) == [2, 4, 7, *range(11, 41)] and sorted(lower.tolist()) == [0, 1, 3, 5]
    assert (np.diff(np.array(local)[upper, 0]) >= 0).all()
    few = np.arange(len(local)) < 3
    assert [len(ids) for ids in eye(local).lids(few)] == [0, 0]


def test_corners_are_six_per_cent_of_the_width() -> None:
    local = [[-10.0, 0, 5], [10.0, 0, 5], [-8.79, 1, 5], [-8.81, 1, 5], [8.79, 1, 5], [8.81, 1, 5], [0.0, 1, 5]]
    found = eye(local).between_corners(np.arange(2, 7), np.arange(7))
    assert found.tolist() == [True, False, True, False, True]


@pytest.mark.parametrize(("lift", "rise", "crushed"), [
    (0.36, 0.61, True), (0.34, 0.61, False), (0.36, 0.59, False),
])  # fmt: skip
@pytest.mark.parametrize("forwards", [True, False])
def test_a_rim_is_crushed_that_is_lifted_as_high_as_the_next_ring(
    lift: float, rise: float, crushed: bool, forwards: bool
) -> None:
    """An edge of 2 mm from the rim, of which so much leads away from the centre."""
    towards = np.array([0.0, 0.8, 0.6])
    probe = eye([[0.0, 8.0, 6.0]])
    height = float(probe._lift[0] + probe._away[0])
    start = (height - 2.0 * lift) * towards
    reach = np.linalg.norm(start) + 2.0 * rise
    # the place at that distance whose edge is 2 mm long, off to the side
    along = (reach**2 - 4.0 + np.linalg.norm(start) ** 2) / (2.0 * np.linalg.norm(start))
    end = along * towards + np.sqrt(reach**2 - along**2) * np.array([1.0, 0.0, 0.0])
    a, b = np.array([0, 1]), np.array([1, 2])
    if not forwards:
        a, b = b, a
    found = eye([start.tolist(), end.tolist(), [0.0, 30.0, 0.0]]).crushed(a, b, np.array([True, False, False]))
    assert found.tolist() == [crushed, False, False]
    both = eye([start.tolist(), end.tolist()]).crushed(np.array([0]), np.array([1]), np.array([True, True]))
    assert not both.any()  # along the rim
