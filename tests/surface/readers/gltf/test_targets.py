"""surface.readers.gltf.targets: names of morph targets, and expressions of VRM files, both versions."""

from dataclasses import replace
from time import process_time

import numpy as np
import pytest
from meshfiles import GlbBuilder, glb
from slit_sheet import slit_sheet

from surface.fit.source.load import load_mesh
from surface.readers.gltf.mesh import read_gltf
from surface.readers.meshdata import Expression, MeshData


def read(tmp_path, builder: GlbBuilder) -> MeshData:
    path = tmp_path / "m.vrm"
    path.write_bytes(builder.bytes())
    return read_gltf(path)


def vrm_0(*groups: dict, **other) -> GlbBuilder:
    out = glb(slit_sheet(), **other)
    out.document["extensions"] = {"VRM": {"blendShapeMaster": {"blendShapeGroups": list(groups)}}}
    return out


def bind(index: int, weight: float, **place) -> dict:
    return {"index": index, "weight": weight, **(place or {"mesh": 0})}


def test_vrm_0_gives_presets_in_percent(tmp_path):
    builder = vrm_0(
        {"name": "Joy!", "presetName": "joy", "binds": [bind(1, 100.0), bind(0, 25.0)]},
        {"name": "Wink", "presetName": "unknown", "binds": [bind(1, 50)]}, {"presetName": "neutral", "binds": []},
    )  # fmt: skip
    assert read(tmp_path, builder).expressions == (
        Expression("joy", (("mouthSmile_L", 1.0), ("jawOpen", 0.25))), Expression("Wink", (("mouthSmile_L", 0.5),)),
    )  # fmt: skip


def test_a_group_whose_preset_is_null_keeps_its_own_name(tmp_path):
    mesh = read(tmp_path, vrm_0({"name": "Smirk", "presetName": None, "binds": [bind(0, 100)]},
                                {"name": None, "presetName": "none", "binds": [bind(1, 100)]}))  # fmt: skip
    assert [expression.name for expression in mesh.expressions] == ["Smirk", "none"]


def test_vrm_1_binds_by_node(tmp_path):
    builder = glb(slit_sheet())
    builder.document["nodes"] = [{"name": "root", "children": [1]}, {"mesh": 0}]
    builder.document["extensions"] = {"VRMC_vrm": {"expressions": {
        "preset": {
            "happy": {"morphTargetBinds": [bind(1, 1.0, node=1)]}, "aa": {"morphTargetBinds": [bind(0, 1, node=0)]},
        },
        "custom": {"MyGrin": {"morphTargetBinds": [bind(0, 0.4, node=1)]}},
    }}}  # fmt: skip
    assert read(tmp_path, builder).expressions == (
        Expression("happy", (("mouthSmile_L", 1.0),)), Expression("MyGrin", (("jawOpen", 0.4),)),
    )  # fmt: skip


@pytest.mark.parametrize("binds", [
    [bind(7, 100, mesh=3)], [bind(-1, 100)], [bind(0, "x")], [bind(0, 0)], [3], "none", [{"mesh": True, "weight": 1}],  # type: ignore[arg-type]
])  # fmt: skip
def test_damaged_binds_are_left_out(tmp_path, binds):
    assert read(tmp_path, vrm_0({"presetName": "a", "binds": binds})).expressions == ()


def test_targets_of_two_meshes_without_names_are_not_mixed_up(tmp_path):
    builder = vrm_0({"presetName": "a", "binds": [bind(0, 100, mesh=1)]}, names=False)
    builder.document["meshes"].append({"primitives": builder.document["meshes"][0]["primitives"]})
    builder.document["nodes"] = [{"mesh": 0}, {"mesh": 1, "translation": [1, 0, 0]}]
    builder.document["scenes"] = [{"nodes": [0, 1]}]
    mesh = read(tmp_path, builder)
    assert mesh.names == ("mesh0_target0", "mesh0_target1", "mesh1_target0", "mesh1_target1")
    assert mesh.expressions == (Expression("a", (("mesh1_target0", 1.0),)),)
    assert np.abs(mesh.deltas[0][mesh.vertices[:, 0] > 0.5]).max() == 0


def test_a_vrm_without_names_of_shapes_speaks_and_smiles(tmp_path):
    mesh = slit_sheet()
    path = tmp_path / "avatar.vrm"
    groups = [
        {"presetName": "a", "binds": [bind(0, 100)]}, {"presetName": "o", "binds": [bind(0, 60), bind(1, 40)]},
        {"presetName": "blink", "binds": [bind(1, 100)]},
    ]  # fmt: skip
    path.write_bytes(vrm_0(*groups, names=False).bytes())
    found = load_mesh(path)
    assert found.named.missing and {"jawOpen", "mouthFunnel", "eyeBlinkLeft", "eyeBlinkRight"} == {*found.named.sources}
    assert found.mesh.names == ("target0", "target1", "expression:o")
    mixed = 0.6 * found.mesh.deltas[0] + 0.4 * found.mesh.deltas[1]
    np.testing.assert_allclose(found.mesh.deltas[2], mixed, atol=1e-9)
    assert any(n.startswith("jawOpen is made from 'a' (target0)") for n in found.notes)
    assert len(found.mesh.vertices) == len(mesh.vertices)


def test_expressions_of_arkit_names_need_no_shapes_of_such_names(tmp_path):
    groups = [{"name": "JawOpen", "presetName": "unknown", "binds": [bind(0, 100)]},
              {"name": "EyeBlinkLeft", "presetName": "unknown", "binds": [bind(1, 100)]}]  # fmt: skip
    path = tmp_path / "perfect.vrm"
    path.write_bytes(vrm_0(*groups, names=False).bytes())
    found = load_mesh(path).named
    assert {n: s[0].index for n, s in found.sources.items()} == {"eyeBlinkLeft": 1, "jawOpen": 0}
    assert found.stand_ins == ()


def test_a_name_that_occurs_again_is_numbered(tmp_path):
    mesh = slit_sheet()
    builder = glb(replace(mesh, names=("a", "a", "a (2)"), deltas=np.concatenate([mesh.deltas, mesh.deltas[:1]])))
    found = read(tmp_path, builder)
    assert found.names == ("a", "a (2)", "a (2) (2)")
    np.testing.assert_array_equal(found.deltas[0], found.deltas[2])
    assert np.abs(found.deltas[0] - found.deltas[1]).max() > 0


def test_thousands_of_equal_names_and_of_binds_take_no_time(tmp_path):
    """A file of 500 kB; with the names made again for every bind, and counted from 2 for every name, it took hours."""
    builder = vrm_0({"name": "x", "presetName": "", "binds": [bind(k % 2, 100.0) for k in range(10_000)]})
    builder.document["meshes"][0]["extras"] = {"targetNames": ["a"] * 20_000}
    begin_s = process_time()
    mesh = read(tmp_path, builder)
    assert process_time() - begin_s < 5.0
    assert mesh.expressions == (Expression("x", (("a", 1.0), ("a (2)", 1.0))),) and mesh.names == ("a", "a (2)")
