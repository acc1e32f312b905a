"""Margins of lids that lie inside an eyeball and would be crushed on it."""

import numpy as np
import pytest
from eye_face import CENTRES, RADIUS, face, joined, pair, shell, with_margins

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
