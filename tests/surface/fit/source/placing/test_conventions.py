"""What formats say about unit and axes."""

import json

import pytest
from meshfiles import glb
from slit_sheet import slit_sheet

from surface.fit.source.load import load_mesh
from surface.fit.source.placing.conventions import GLTF, OBJ, VRM0, Convention, convention_of


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


def test_a_gltf_in_metres_is_not_guessed(tmp_path):
    path = tmp_path / "m.glb"
    path.write_bytes(glb(slit_sheet()).bytes())
    loaded = load_mesh(path)
    assert loaded.placement.scale == 1000.0 and loaded.notes == ()
