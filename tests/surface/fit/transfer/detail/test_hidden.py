"""What lies inside a scan is not in sight; its outside is."""

import numpy as np
import pytest
import trimesh

from surface.fit.transfer.detail import hidden as module
from surface.fit.transfer.detail.hidden import in_sight
from surface.fit.transfer.scan import make_scan


def joined(*meshes: trimesh.Trimesh):
    whole = trimesh.util.concatenate(meshes)
    return make_scan(np.array(whole.vertices), np.array(whole.faces, np.int64), "scan")


def test_the_front_of_a_shell_is_in_sight_and_what_it_encloses_is_not() -> None:
    shell, inner = trimesh.creation.icosphere(3, 60.0), trimesh.creation.icosphere(2, 20.0)
    scan = joined(shell, inner)
    front = shell.triangles_center[shell.triangles_center[:, 2] > 20.0]
    assert in_sight(scan, front).all()
    assert not in_sight(scan, np.array(inner.triangles_center)).any()
    assert in_sight(joined(inner), inner.triangles_center[inner.triangles_center[:, 2] > 5.0]).all()


def test_the_floor_of_a_pit_is_in_sight_and_teeth_behind_closed_lips_are_not() -> None:
    at = np.linspace(-60.0, 60.0, 61)
    x, y = (a.ravel() for a in np.meshgrid(at, at, indexing="ij"))
    k = np.arange(61 * 61).reshape(61, 61)
    a, b, c, d = (n.ravel() for n in (k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]))
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    floor = np.column_stack([x, y, np.where(np.hypot(x, y) < 8.0, -6.0, 0.0)])
    teeth = trimesh.creation.box((10.0, 6.0, 2.0), trimesh.transformations.translation_matrix([0, 20.0, -5.0]))
    scan = joined(trimesh.Trimesh(floor, faces, process=False), teeth)
    assert in_sight(scan, floor[np.hypot(x, y) < 6.0]).all()
    assert not in_sight(scan, np.array([[0.0, 20.0, -4.0], [3.0, 21.0, -4.0]])).any()


def test_steep_slopes_are_in_sight_in_a_single_view(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "VIEWS", ((0.0, 0.0),))
    ball = trimesh.creation.icosphere(4, 60.0)
    places = ball.triangles_center
    assert in_sight(joined(ball), places[places[:, 2] > 20.0]).all()
    assert not in_sight(joined(ball), places[places[:, 2] < -20.0]).any()


def test_a_scan_of_no_triangles_shows_nothing() -> None:
    scan = joined(trimesh.creation.icosphere(1, 60.0))
    assert not in_sight(scan.kept(np.zeros(len(scan.triangles), bool)), np.zeros((2, 3))).any()
