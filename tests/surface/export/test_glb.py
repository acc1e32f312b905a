"""surface.export.glb: weights of a pose, and trimesh reads what was written."""

import numpy as np
import pytest
from small_head import part, small_head

from surface.base.errors import ExportError
from surface.export import export_head
from surface.export.glb import write_glb, write_web_glb
from surface.head import Head
from tests.surface.export.test_glb_document import exported


def test_weights_hold_the_pose_and_zero_angles_are_allowed(tmp_path):
    file = exported(tmp_path, Head(small_head()), {"jawOpen": 0.25, "headYaw": 0.0})
    weights = {m["name"]: dict(zip(m["extras"]["targetNames"], m["weights"], strict=True))
               for m in file.document["meshes"] if "extras" in m}  # fmt: skip
    assert weights["tooth"] == {"jawForward": 0.0, "jawOpen": 0.25} and weights["a"] == {"mouthPucker": 0.0}


def test_trimesh_reads_the_same_triangles(tmp_path):
    trimesh = pytest.importorskip("trimesh", reason="needs trimesh (development only)")
    parts = [part("a", -40), part("eye", 20, "left_eye")]
    head = Head(small_head(parts=parts, seams=[]))
    (path,) = export_head(head, tmp_path / "h.glb")
    scene = trimesh.load(path, process=False)
    for own in head.parts:
        matrix, name = scene.graph.get(own.name)
        mesh = scene.geometry[name].copy().apply_transform(matrix)
        assert mesh.faces.tolist() == own.triangles.tolist()
        np.testing.assert_allclose(1000 * mesh.vertices, own.vertices, atol=1e-3)


def test_angles_are_no_weights_and_files_for_the_web_have_no_pose(tmp_path):
    head, path = Head(small_head()), tmp_path / "h.glb"
    with pytest.raises(ExportError, match="headYaw: angles are no morph targets") as caught:
        write_glb(head, path, {"jawOpen": 0.5, "headYaw": 0.1})
    assert caught.value.hint == "export an .obj in this pose"
    with pytest.raises(ExportError, match="is written at rest"):
        write_web_glb(head, path, {"jawOpen": 0.5})
    assert not path.exists()
