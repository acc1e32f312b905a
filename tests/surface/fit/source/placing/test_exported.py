"""What exports of omote say of where their heads lay."""

import json

import numpy as np
import pytest
from meshfiles import glb
from slit_sheet import slit_sheet

from surface.fit.source.placing.exported import exported_placement
from surface.head.model.placement import Placement

TURNED = Placement(np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]), 25.4, np.array([5.0, -1500.0, 20.0]), "in")


def written(folder, placement, suffix):
    """The path of a file in a mesh's own frame that says this of its placement."""
    path = folder / f"m{suffix}"
    if suffix == ".obj":
        said = json.dumps({"placement": placement})
        path.write_text(f"# ict, written by omote; in the frame of its source, {said}\nv 0 0 0\n")
        return path
    builder = glb(slit_sheet())
    extras = {"frame": "file", "placement": placement}
    builder.document["asset"] = {"version": "2.0", "generator": "omote", "extras": extras}
    path.write_bytes(builder.bytes())
    return path


@pytest.mark.parametrize("suffix", [".glb", ".obj"])
def test_a_file_in_a_meshs_own_frame_says_how_it_lies(tmp_path, suffix):
    found = exported_placement(written(tmp_path, TURNED.table(), suffix))
    assert found is not None and found.table() == TURNED.table()


@pytest.mark.parametrize("suffix", [".glb", ".obj"])
@pytest.mark.parametrize("change", [
    {"turn": [[1.0, 0, 0], [0, 1, 0], [0, 0, -1]]}, {"turn": [[2.0, 0, 0], [0, 1, 0], [0, 0, 1]]}, {"turn": "left"},
    {"scale": 0.0}, {"scale": -1.0}, {"scale": None}, {"shift": [1.0, 2.0]}, {"shift": [1.0, 2.0, 1e999]}, {"unit": 3},
])  # fmt: skip
def test_what_somebody_made_of_it_is_not_believed(tmp_path, suffix, change):
    assert exported_placement(written(tmp_path, TURNED.table() | change, suffix)) is None
    assert exported_placement(written(tmp_path, None, suffix)) is None


def test_files_in_head_space_need_not_say_it_and_others_say_nothing(tmp_path):
    path = tmp_path / "m.obj"
    path.write_text("# ict, written by omote; millimetres, y up, z forward\nv 0 0 0\n")
    assert exported_placement(path).table() == Placement(scale=1.0, unit="mm").table()
    path.write_text("# ict, written by omote; in the frame of its source\nv 0 0 0\n")
    assert exported_placement(path) is None
    path.write_text("# Blender\nv 0 0 0\n")
    assert exported_placement(path) is None
    builder = glb(slit_sheet())
    for generator, wanted in (("omote", Placement(scale=1000.0, unit="m").table()), ("Blender", None)):
        builder.document["asset"] = {"version": "2.0", "generator": generator}
        (tmp_path / "m.glb").write_bytes(builder.bytes())
        found = exported_placement(tmp_path / "m.glb")
        assert (found and found.table()) == wanted
