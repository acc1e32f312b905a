"""What omote exports, omote fits again: the same place, unit and axes, and a mesh that can be fitted."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from surface.export import export_head
from surface.fit.features.generic import make_plan
from surface.fit.source.load import load_mesh
from surface.fit.source.mesh import check_manifold
from surface.fit.source.naming.shapes import to_arkit
from surface.fit.source.placing.place import place
from surface.head import Head
from surface.head.model.file import load_data
from surface.head.model.placement import Placement

SHIPPED = Path(__file__).parents[3] / "configs" / "heads" / "ict"
SHAPES = ("eyeBlinkLeft", "eyeBlinkRight", "jawOpen", "mouthPucker")
PARTS = ("face", "back", "cavity", "sockets", "eye_left", "eye_right")
SIDEWAYS = Placement(np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]), 25.4, np.array([5.0, -1500.0, 20.0]), "in")


@pytest.fixture(scope="module")
def head() -> Head:
    """The shipped head with a few of its shapes, as if it came from a mesh in inches, x forward, z up, feet at 0."""
    data = load_data(SHIPPED)
    parts = [replace(p, groups=[g for g in p.groups if g.name in SHAPES]) for p in data.parts if p.name in PARTS]
    seams = [s for s in data.seams if {s.part_a, s.part_b} <= set(PARTS)]
    paint = [p for p in data.paint if p["part"] in PARTS]
    contacts = [replace(c, followers=tuple(f for f in c.followers if f in PARTS)) for c in data.contacts]
    return Head(replace(data, parts=parts, seams=seams, paint=paint, contacts=contacts, rules=[], placement=SIDEWAYS))


@pytest.mark.slow
@pytest.mark.parametrize(("suffix", "frame"), [(".glb", "head"), (".glb", "file"), (".obj", "head")])
def test_an_export_comes_back_to_its_place(tmp_path, head, suffix, frame):
    export_head(head, tmp_path / f"head{suffix}", frame=frame)
    loaded = place(load_mesh(tmp_path / f"head{suffix}"))
    check_manifold(loaded.mesh, suffix)
    eyes = head.data.eyes
    np.testing.assert_allclose(loaded.marks.eyes.centres.mean(axis=0), [0.0, 36.1, 84.2], atol=0.02)
    np.testing.assert_allclose(np.abs(loaded.marks.eyes.centres[:, 0]), np.abs(eyes[:, 0]), atol=0.02)
    every = np.concatenate([p.vertices for p in head.parts])
    np.testing.assert_allclose(loaded.mesh.vertices.min(axis=0), every.min(axis=0), atol=0.05)
    np.testing.assert_allclose(loaded.mesh.vertices.max(axis=0), every.max(axis=0), atol=0.05)
    if frame == "file":
        np.testing.assert_allclose(loaded.placement.turn, SIDEWAYS.turn)
        assert loaded.placement.unit == "in"
    else:
        assert not loaded.notes and np.abs(loaded.placement.shift).max() < 0.05


@pytest.mark.slow
def test_its_plan_has_a_face_and_eyes(tmp_path, head):
    export_head(head, tmp_path / "head.glb")
    loaded = place(load_mesh(tmp_path / "head.glb"))
    plan = make_plan(to_arkit(loaded.mesh, loaded.named))
    centres, radius = plan.eyes
    assert plan.parts[0][0].name == "face" and radius == pytest.approx(12.1, rel=0.03)
    np.testing.assert_allclose(centres, head.data.eyes, atol=0.5)
