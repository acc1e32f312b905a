"""What formats say about unit and axes."""

import json

import pytest
from meshfiles import glb
from slit_sheet import slit_sheet

from surface.fit.source.load import load_mesh
from surface.fit.source.placing.conventions import GLTF, OBJ, VRM0, Convention, convention_of, is_export


@pytest.mark.parametrize(("change", "wanted"), [
    ({}, GLTF), ({"extensions": {"VRM": {}}}, VRM0), ({"extensions": {"VRMC_vrm": {}}}, GLTF),
    ({"asset": {"version": "2.0", "generator": "omote", "extras": {"frame": "file"}}}, Convention()),
])  # fmt: skip
def test_gltf_defines_its_own(tmp_path, change, wanted):
    builder = glb(slit_sheet())
    builder.document |= change
    path = tmp_path / "m.glb"
    path.write_bytes(builder.bytes())
    assert convention_of(path) == wanted
    text = tmp_path / "m.gltf"
    text.write_text(json.dumps({"asset": {"version": "2.0"}, **change}))
    assert convention_of(text) == wanted


def test_an_obj_of_omote_defines_its_own_and_others_nothing(tmp_path):
    path = tmp_path / "m.obj"
    path.write_text("# ict, written by omote; millimetres, y up, z forward\nv 0 0 0\n")
    assert convention_of(path) == OBJ
    path.write_text("# ict, written by omote; in the frame of its source\nv 0 0 0\n")
    assert convention_of(path) == Convention() == convention_of(tmp_path / "m.npz") == convention_of(tmp_path)


def test_exports_of_omote_are_known_in_any_frame(tmp_path):
    builder = glb(slit_sheet())
    path, text = tmp_path / "m.glb", tmp_path / "m.obj"
    for asset, own in (({"generator": "omote"}, True), ({"generator": "omote", "extras": {"frame": "file"}}, True),
                       ({"generator": "Khronos glTF Blender I/O"}, False), ({}, False)):  # fmt: skip
        builder.document["asset"] = {"version": "2.0", **asset}
        path.write_bytes(builder.bytes())
        assert is_export(path) == own == load_mesh(path).exported
    for line, own in (("# ict, written by omote; in the frame of its source", True), ("# Blender", False)):
        text.write_text(f"{line}\nv 0 0 0\n")
        assert is_export(text) == own
    assert not is_export(tmp_path / "m.npz") and not is_export(tmp_path)


def test_a_gltf_in_metres_is_not_guessed(tmp_path):
    path = tmp_path / "m.glb"
    path.write_bytes(glb(slit_sheet()).bytes())
    loaded = load_mesh(path)
    assert loaded.placement.scale == 1000.0 and loaded.notes == ()
