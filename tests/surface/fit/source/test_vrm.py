"""Avatars in VRM 0 and VRM 1 whose shapes have no names of their own: only presets say what they do."""

from dataclasses import replace

import numpy as np
import pytest
from eye_face import face
from meshfiles import glb

from surface.fit.source.load import load_mesh
from surface.fit.source.mesh import FitMesh
from surface.fit.source.placing.place import place

PRESETS = {"aa": ("a", "jawOpen"), "blinkLeft": ("blink_l", "eyeBlinkLeft"), "blinkRight": ("blink_r", "eyeBlinkRight")}


def avatar() -> FitMesh:
    """A face in metres with two blinks and an open vowel, all without a name that says so."""
    mesh = face()
    low = np.clip((-30.0 - mesh.vertices[:, 1]) / 30.0, 0.0, 1.0)
    vowel = np.outer(low, [0.0, -15.0, -5.0])
    deltas = np.stack([vowel, *(mesh.deltas[mesh.names.index(n)] for n in ("eyeBlinkLeft", "eyeBlinkRight"))])
    return replace(mesh, vertices=0.001 * mesh.vertices, names=("morph0", "morph1", "morph2"), deltas=0.001 * deltas)


def write(path, version: int, *, backwards: bool) -> None:
    builder = glb(avatar())
    document = builder.document
    document["nodes"].append(
        {"children": document["scenes"][0]["nodes"], "rotation": [0, float(backwards), 0, float(not backwards)]}
    )
    document["scenes"][0]["nodes"] = [len(document["nodes"]) - 1]
    if version == 0:
        groups = [
            {"presetName": old, "binds": [{"mesh": 0, "index": k, "weight": 100}]}
            for k, (old, _) in enumerate(PRESETS.values())
        ]
        document["extensions"] = {"VRM": {"blendShapeMaster": {"blendShapeGroups": groups}}}
    else:
        node = next(k for k, n in enumerate(document["nodes"]) if "mesh" in n)
        presets = {
            new: {"morphTargetBinds": [{"node": node, "index": k, "weight": 1.0}]} for k, new in enumerate(PRESETS)
        }
        document["extensions"] = {"VRMC_vrm": {"expressions": {"preset": presets}}}
    path.write_bytes(builder.bytes())


@pytest.mark.parametrize(("version", "backwards"), [(0, True), (0, False), (1, False), (1, True)])
def test_presets_alone_tell_what_shapes_do_and_which_way_the_face_looks(tmp_path, version, backwards):
    """VRM 0 looks along -z, VRM 1 along z; exporters that get it wrong are seen through by eyes and mouth."""
    write(tmp_path / "a.vrm", version, backwards=backwards)
    loaded = place(load_mesh(tmp_path / "a.vrm"))
    assert {shape for _, shape in PRESETS.values()} <= set(loaded.named.sources)
    np.testing.assert_allclose(loaded.placement.turn[2], [0.0, 0.0, -1.0 if backwards else 1.0], atol=1e-6)
    left, right = loaded.marks.eyes.centres
    assert left[0] > 0.0 > right[0] and loaded.marks.eyes.middle[2] > 0.0
    contradicts = backwards == (version == 1)
    assert any(note.startswith("turned:") for note in loaded.notes) == contradicts
