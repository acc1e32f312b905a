"""What omote exports, omote fits again: the same place, unit and axes, and a mesh that can be fitted."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

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
HAIR = {"brows": "brow", "lashes": "lash"}
PARTS = ("face", "back", "cavity", "sockets", "eye_left", "eye_right", *HAIR)
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


def moved(head: Head, shift: np.ndarray) -> Head:
    """The head elsewhere in head space, as one is whose eyeballs are others than those by which it was placed."""
    data = head.data
    parts = [replace(p, points=p.points + shift) for p in data.parts]
    jaw, neck = replace(data.jaw, centre=data.jaw.centre + shift), data.neck
    return Head(replace(data, parts=parts, eyes=data.eyes + shift, jaw=jaw, neck=neck))


@pytest.mark.slow
@pytest.mark.parametrize(("suffix", "frame"), [(".glb", "head"), (".glb", "file"), (".obj", "head"), (".obj", "file")])
def test_an_export_lies_where_its_head_lay_and_not_where_its_eyes_would_put_it(tmp_path, head, suffix, frame):
    shift = np.array([0.0, -7.0, -18.0])
    export_head(moved(head, shift), tmp_path / f"head{suffix}", frame=frame)
    loaded = place(load_mesh(tmp_path / f"head{suffix}"))
    np.testing.assert_allclose(loaded.marks.eyes.middle, head.data.eyes.mean(axis=0) + shift, atol=0.05)
    every = np.concatenate([p.vertices for p in head.parts])
    np.testing.assert_allclose(loaded.mesh.vertices.max(axis=0), every.max(axis=0) + shift, atol=0.05)
    own = SIDEWAYS if frame == "file" else Placement(scale=1000.0 if suffix == ".glb" else 1.0)
    np.testing.assert_allclose(loaded.placement.turn, own.turn, atol=1e-6)
    np.testing.assert_allclose([loaded.placement.scale, *loaded.placement.shift], [own.scale, *own.shift], atol=1e-6)


@pytest.mark.slow
def test_an_export_of_a_head_far_from_its_place_comes_there(tmp_path, head):
    export_head(moved(head, np.array([0.0, 400.0, 0.0])), tmp_path / "head.glb")
    loaded = place(load_mesh(tmp_path / "head.glb"))
    np.testing.assert_allclose(loaded.marks.eyes.middle, [0.0, 36.1, 84.2], atol=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".glb", ".obj"])
def test_an_export_has_the_hairs_of_brows_and_lashes(tmp_path, head, suffix):
    export_head(head, tmp_path / f"head{suffix}")
    loaded = load_mesh(tmp_path / f"head{suffix}")
    for name, kind in HAIR.items():
        (piece,) = [piece for piece in loaded.pieces if piece.split("/")[0] == name]
        assert loaded.pieces[piece] == kind
    notes = make_plan(to_arkit(place(loaded).mesh, loaded.named)).notes
    assert all(any(f": {kind}: {strips} islands as {kind}" in n for n in notes) for kind, strips in
               (("brow", 2), ("lash", 4)))  # fmt: skip


@pytest.mark.slow
def test_an_independent_reader_finds_the_hairs_where_they_are_drawn(tmp_path, head):
    """Trimesh: each strip in one piece, on its material, with the triangles and the place that they are drawn with."""
    export_head(head, tmp_path / "head.glb")
    scene = trimesh.load(tmp_path / "head.glb")
    for name, kind in HAIR.items():
        found, part = scene.geometry[name], head.part(name)
        assert found.visual.material.name == kind
        assert len(found.faces) > 0.98 * len(part.triangles)
        np.testing.assert_allclose(1000.0 * found.bounds, [part.vertices.min(axis=0), part.vertices.max(axis=0)],
                                   atol=1e-3)  # fmt: skip
        corner = part.vertices[part.triangles]
        area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum() / 2
        assert 1e6 * found.area == pytest.approx(area, rel=1e-3)
