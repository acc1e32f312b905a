"""A face found by its form alone."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from slit_sheet import slit_sheet
from traps import joined, on_body, placed, transformed

from surface.fit.source.mesh import FitMesh
from surface.fit.source.placing.match import match_face
from surface.fit.source.placing.orient import SQUARE
from surface.fit.source.placing.symmetry import find_mirrors
from surface.head import Head

EYES = np.array([[31.8, 36.1, 84.2], [-31.8, 36.1, 84.2]])


@pytest.fixture(scope="module")
def bare() -> FitMesh:
    """The shipped head's skin as a scan would have it: no shapes, no eyeballs, one object."""
    head = Head.load(Path(__file__).parents[5] / "configs" / "heads" / "ict")
    parts = []
    for name in ("face", "back"):
        part = head.part(name)
        faces = np.column_stack([part.triangles, np.full(len(part.triangles), -1)]).astype(np.int64)
        n = len(part.vertices)
        parts.append(FitMesh(part.vertices.astype(float), faces, np.zeros((n, 2)), faces.copy(), (),
                             np.zeros((0, n, 3)), np.zeros(len(faces), np.int64), ("Scan",)))  # fmt: skip
    return joined(*parts)


def askew(degrees: float, axis: tuple[float, float, float]) -> np.ndarray:
    a = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    angle = np.radians(degrees)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


@pytest.mark.parametrize(("turn", "scale"), [
    (SQUARE[18], 1 / 304.8), (askew(140, (-2, 1, 1)), 0.37),
])  # fmt: skip
def test_a_scan_comes_to_its_place(bare, turn, scale):
    mesh = transformed(bare, turn, scale, (1.0, 2.0, 3.0))
    face = match_face(mesh.vertices, mesh.faces)
    assert face is not None and face.scale == pytest.approx(scale, rel=0.05)
    np.testing.assert_allclose((face.at(EYES) - [1, 2, 3]) / scale @ turn.T, EYES, atol=4.0)
    got = placed(mesh)
    assert any("by its form" in note for note in got.notes)
    assert np.abs(got.mesh.vertices - bare.vertices).max() < 15.0  # of 340 mm: pitch and size are known that well


def test_a_face_is_found_on_a_body_without_shapes(bare):
    mesh = transformed(on_body(bare), SQUARE[4], 0.01)
    got = placed(mesh)
    assert any("a body" in note for note in got.notes) and got.placement.unit == "dm"
    assert got.mesh.vertices[:, 1].min() > -215 and abs(got.mesh.vertices[:, 1].max() - 145) < 12


def test_a_mask_without_the_back_of_the_head_is_found(bare):
    front = bare.vertices[bare.faces[:, 0], 2] > 35.0
    mask = replace(bare, faces=bare.faces[front], face_uv=bare.face_uv[front], piece=bare.piece[front])
    used = np.unique(mask.faces[mask.faces >= 0])
    at = np.full(len(bare.vertices), -1)
    at[used] = np.arange(len(used))
    faces = np.where(mask.faces >= 0, at[mask.faces], -1)
    face = match_face(bare.vertices[used] @ SQUARE[6], faces)
    assert face is not None
    np.testing.assert_allclose(face.at(EYES) @ SQUARE[6].T, EYES, atol=4.0)


def test_what_is_no_face_is_not_taken_for_one():
    sheet = slit_sheet()
    assert match_face(sheet.vertices, sheet.faces) is None
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 33), np.linspace(-1.5, 1.5, 21))
    ball = np.column_stack(
        [(np.cos(v) * np.cos(u)).ravel(), (1.3 * np.sin(v)).ravel(), (np.cos(v) * np.sin(u)).ravel()]
    )
    at = np.arange(33 * 21).reshape(21, 33)
    faces = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]], axis=-1).reshape(-1, 4)
    assert match_face(100 * ball, faces) is None
    assert match_face(np.zeros((4, 3)), np.zeros((1, 4), np.int64)) is None


def test_the_mirror_plane_of_a_face_is_found_in_any_direction(bare):
    points = bare.vertices[::9] @ askew(75, (1, 1, 0.4))
    best = find_mirrors(points)[0]
    assert abs(best.normal @ ([1, 0, 0] @ askew(75, (1, 1, 0.4)))) > 0.9995
    assert abs(best.centre @ best.normal) < 1.0 and best.error < 0.05
