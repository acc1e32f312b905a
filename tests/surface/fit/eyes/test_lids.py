"""Lids of a mesh without a recipe: out of the eyeballs, along them, and shut by a blink."""

from dataclasses import replace

import eye_face
import numpy as np
import pytest
from eye_face import CENTRES, RADIUS, face, joined, pair, shell
from face_measures import Window

from surface.fit.eyes.lids import fit_lids
from surface.fit.features.generic import make_plan
from surface.fit.points.eyeball import surface_height
from surface.fit.source.mesh import FitMesh
from surface.head import Head

pytestmark = pytest.mark.usefixtures("given_charts")


def lazy(mesh: FitMesh, share: float) -> FitMesh:
    """The face with blinks that go only a share of their way."""
    return replace(mesh, deltas=mesh.deltas * np.array([share, share, 1.0])[:, None, None])


def head_mesh(share: float = 1.0, radius: float = RADIUS) -> FitMesh:
    return joined([("Head", lazy(face(), share)), *pair(lambda c: shell(c, radius))])


def fitted_lids(mesh: FitMesh) -> tuple[FitMesh, list[str]]:
    plan = make_plan(mesh)
    assert plan.found is not None
    return fit_lids(mesh, plan.found)


def lid_heights(mesh: FitMesh, shape: str | None, radius: float = RADIUS) -> np.ndarray:
    """Heights of the face's vertices in front of the left eye, looking ahead, above its surface, mm."""
    points = mesh.vertices + (0 if shape is None else mesh.deltas[mesh.names.index(shape)])
    local = (points - CENTRES[0])[: len(face().vertices)]
    length = np.linalg.norm(local, axis=1)
    off = length - radius * surface_height(local / length[:, None], np.array([0.0, 0.0, 1.0]))
    return off[local[:, 2] > 6.0]


@pytest.mark.parametrize("shape", [None, "eyeBlinkLeft"])
def test_lids_are_moved_out_of_a_larger_eyeball_in_every_shape(shape) -> None:
    mesh = head_mesh(radius=12.9)
    assert lid_heights(mesh, shape, 12.9).min() < -0.25
    moved, _ = fitted_lids(mesh)
    assert lid_heights(moved, shape, 12.9).min() > 0.05
    eyes = slice(len(face().vertices), None)
    np.testing.assert_array_equal(moved.vertices[eyes], mesh.vertices[eyes])
    far = np.linalg.norm(mesh.vertices[:, None] - CENTRES, axis=2).min(axis=1) > 2 * RADIUS
    np.testing.assert_array_equal(moved.vertices[far], mesh.vertices[far])


def gap(mesh: FitMesh, side: int = 0) -> float:
    """Greatest distance between the lids of a mesh in eyeBlink, mm."""
    shape = mesh.names.index(("eyeBlinkLeft", "eyeBlinkRight")[side])
    points = mesh.vertices + mesh.deltas[shape]
    found = make_plan(mesh).found
    assert found is not None
    edge = found.openings[side].edge
    upper = edge[mesh.vertices[edge, 1] > CENTRES[side, 1]]
    lower = edge[mesh.vertices[edge, 1] <= CENTRES[side, 1]]
    x = np.linspace(-8, 8, 17) + CENTRES[side, 0]
    up, low = (np.interp(x, points[np.sort(i), 0], points[np.sort(i), 1]) for i in (upper, lower))
    return float((up - low).max())


@pytest.mark.parametrize("side", [0, 1])
def test_a_blink_that_leaves_a_gap_is_lengthened(side: int) -> None:
    mesh = head_mesh(0.75)
    assert gap(mesh, side) > 2.0
    shut, notes = fitted_lids(mesh)
    assert gap(shut, side) < 0.0
    assert any("left open" in n or "open: its" in n for n in notes)
    ((jaw, before),) = [(m.deltas[m.names.index("jawOpen")], mesh.deltas[mesh.names.index("jawOpen")]) for m in (shut,)]
    far = np.abs(mesh.vertices[:, 1]) > 60
    np.testing.assert_array_equal(jaw[far], before[far])


def test_a_shape_that_hardly_shuts_the_eye_is_no_blink() -> None:
    mesh = head_mesh(0.2)
    shut, notes = fitted_lids(mesh)
    assert not any("open: its" in n for n in notes) and gap(shut) > 4.0


def seen(head: Head, side: int, **values: float) -> np.ndarray:
    """(h, w) where an eye is seen from the front, past the skin; a pixel is 0.25 mm."""
    head.pose(head.values(values))
    x, y, _ = CENTRES[side]
    window = Window((x - 16, x + 16), (y - 16, y + 16))
    eye = window.depth(head.part(("eye_left", "eye_right")[side]))
    skin = window.depth(*(p for p in head.parts if p.material == "skin"))
    return eye > skin


SIDES = ("Left", "Right")


@pytest.mark.slow
@pytest.mark.parametrize("side", [0, 1])
def test_eyes_are_seen_between_lids_that_shut(head: Head, side: int) -> None:
    open_eye = seen(head, side)
    assert 8.0 < 0.25 * open_eye.sum(axis=0).max() < 13.0  # of 11 mm
    assert 0.25 * seen(head, side, **{f"eyeBlink{SIDES[side]}": 1.0}).sum(axis=0).max() <= 0.5
    half = seen(head, side, **{f"eyeBlink{SIDES[side]}": 0.5})
    assert 0.2 < half.sum() / open_eye.sum() < 0.9


@pytest.mark.slow
@pytest.mark.parametrize("look", ["In", "Out"])
def test_eyes_that_turn_stay_behind_the_lids(head: Head, look: str) -> None:
    """What is seen of an eye that turns is what was seen of it before, but for lids that its cornea lifts."""
    before, after = seen(head, 0), seen(head, 0, **{f"eyeLook{look}Left": 1.0})
    assert (before != after).sum() < 0.12 * before.sum()


@pytest.mark.slow
@pytest.mark.parametrize(("look", "way", "share"), [("Down", -1, 0.7), ("Up", 1, 1.1)])
def test_lids_follow_an_eye_that_looks_down_and_up(head: Head, look: str, way: int, share: float) -> None:
    """The mesh has no such shapes. Both edges go the eye's way, and less of it is seen below."""
    before, after = seen(head, 0), seen(head, 0, **{f"eyeLook{look}Left": 1.0})
    middle = before.shape[1] // 2
    y = 0.25 * np.array([[rows.min(), rows.max()] for rows in (np.flatnonzero(k[:, middle]) for k in (before, after))])
    assert (way * (y[1] - y[0]) > 1.0).all()
    assert after.sum() / before.sum() == pytest.approx(share, abs=0.15)


@pytest.mark.slow
def test_no_part_of_an_eye_is_drawn_as_skin(head: Head) -> None:
    assert [(p.name, p.material) for p in head.parts] == [
        ("face", "skin"), ("eye_left", "eye"), ("eye_right", "eye"), ("eye_corners", "skin"),
    ]  # fmt: skip
    assert [c.name for c in sorted(head.data.contacts, key=lambda c: c.name)] == ["left_lids", "right_lids"]
    np.testing.assert_allclose(head.data.eyes, eye_face.CENTRES, atol=0.5)
