"""surface.readers.gltf.materials: colours and textures of every piece; nothing in them refuses a mesh."""

import json

import numpy as np
import pytest
from meshfiles import GlbBuilder, glb
from slit_sheet import slit_sheet

from surface.readers.gltf.mesh import read_gltf
from surface.readers.meshdata import Material

PNG = b"\x89PNG\r\n\x1a\n and the rest"
WEBP = b"RIFF\x10\0\0\0WEBPVP8 and the rest"


def read(tmp_path, builder: GlbBuilder) -> Material | None:
    path = tmp_path / "m.glb"
    path.write_bytes(builder.bytes())
    return read_gltf(path).materials[0]


def coloured(material: dict, *images: bytes, **document) -> GlbBuilder:
    """A sheet with one material and with pictures inside the file."""
    out = glb(slit_sheet())
    out.document["meshes"][0]["primitives"][0]["material"] = 0
    out.document["materials"] = [material]
    out.document["images"] = [{"bufferView": out.view(np.frombuffer(x, np.uint8))} for x in images]
    out.document["textures"] = [{"source": k} for k in range(len(images))]
    out.document |= document
    return out


def test_every_piece_has_what_its_material_says(tmp_path):
    usual = {"baseColorFactor": [0.5, 0.25, 1, 0.75], "baseColorTexture": {"index": 0}}
    table = {"name": "Iris", "pbrMetallicRoughness": usual, "alphaMode": "MASK", "alphaCutoff": 0.3}
    assert read(tmp_path, coloured(table, PNG)) == Material(
        "Iris", (0.5, 0.25, 1.0, 0.75), PNG, "image/png", "MASK", 0.3, two_sided=False
    )
    assert read(tmp_path, coloured({})) == Material(two_sided=False)
    assert read(tmp_path, coloured({"doubleSided": True})) == Material()
    assert read(tmp_path, glb(slit_sheet())) is None


def test_webp_is_taken_by_its_extension_and_the_picture_for_others_where_that_is_missing(tmp_path):
    table = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    builder = coloured(table, PNG, WEBP, extensionsRequired=["EXT_texture_webp"])
    builder.document["textures"] = [{"source": 0, "extensions": {"EXT_texture_webp": {"source": 1}}}]
    assert (read(tmp_path, builder) or Material()).texture == WEBP
    builder.document["images"][1] = {"bufferView": builder.view(np.frombuffer(b"\xabKTX 20", np.uint8))}
    assert (read(tmp_path, builder) or Material()).texture == PNG


def test_a_texture_beside_a_text_file_is_read(tmp_path):
    builder = coloured({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}, PNG)
    (tmp_path / "skin 1.png").write_bytes(PNG)
    (tmp_path / "m.bin").write_bytes(builder.data)
    builder.document["images"] = [{"uri": "skin%201.png"}]
    builder.document["buffers"] = [{"byteLength": len(builder.data), "uri": "m.bin"}]
    path = tmp_path / "m.gltf"
    path.write_text(json.dumps(builder.document))
    (material,) = read_gltf(path).materials
    assert material is not None and (material.texture, material.mime) == (PNG, "image/png")


@pytest.mark.parametrize("moved", [
    {}, {"offset": [0.5, 0.25]}, {"scale": [2, 3]}, {"rotation": np.pi / 2, "offset": [0, 1]},
])  # fmt: skip
def test_places_in_the_picture_follow_the_extension(tmp_path, moved):
    # as in the extension's text: turned counter-clockwise about the picture's upper left corner, y down
    texture = {"index": 0, "extensions": {"KHR_texture_transform": moved}}
    material = read(tmp_path, coloured({"pbrMetallicRoughness": {"baseColorTexture": texture}}, PNG))
    assert material is not None
    u, v = 0.2, 0.7  # v up, as meshes have it
    x, y = np.array([u, 1 - v]) * moved.get("scale", [1, 1])
    if "rotation" in moved:
        x, y = y, -x
    want = np.array([x, y]) + moved.get("offset", [0, 0])
    np.testing.assert_allclose(material.in_picture(np.array([[u, v]])), [want], atol=1e-12)


def test_older_kinds_of_materials_tell_colours_too(tmp_path):
    old = {"diffuseFactor": [0.1, 0.2, 0.3, 1], "diffuseTexture": {"index": 0}}
    material = read(tmp_path, coloured({"extensions": {"KHR_materials_pbrSpecularGlossiness": old}}, PNG))
    assert material is not None and material.colour == (0.1, 0.2, 0.3, 1.0) and material.texture == PNG
    own = {"vectorProperties": {"_Color": [0.5, 0, 1, 1]}, "textureProperties": {"_MainTex": 0}}
    vrm = read(tmp_path, coloured({}, PNG, extensions={"VRM": {"materialProperties": [own]}}))
    assert vrm is not None and vrm.texture == PNG
    assert vrm.colour == pytest.approx((0.21404, 0.0, 1.0, 1.0), abs=1e-4)  # sRGB 0.5 in linear light


@pytest.mark.parametrize("material", [
    {"name": 3, "alphaMode": 7, "alphaCutoff": "x"}, {"pbrMetallicRoughness": []},
    {"pbrMetallicRoughness": {"baseColorFactor": ["a", None, 1e300]}},
    {"pbrMetallicRoughness": {"baseColorTexture": {"index": 9}}},
    {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 1}}},
    {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform": 1}}}},
])  # fmt: skip
def test_damage_in_colours_refuses_no_mesh(tmp_path, material):
    found = read(tmp_path, coloured(material, b"no picture"))
    assert found is not None and found.texture is None and found.colour == (1.0, 1.0, 1.0, 1.0)


def test_a_texture_that_cannot_be_read_is_said(tmp_path):
    for number, coordinates, data, why in (
        (9, 0, PNG, "its picture is missing"), (0, 0, b"no picture", "no PNG, JPEG or WebP"),
        (0, 1, PNG, "second texture"), (0, 0, PNG, ""),
    ):  # fmt: skip
        table = {"pbrMetallicRoughness": {"baseColorTexture": {"index": number, "texCoord": coordinates}}}
        found = read(tmp_path, coloured(table, data))
        assert found is not None and why in found.lost and bool(why) == bool(found.lost) == (found.texture is None)
    bare = read(tmp_path, coloured({}))
    assert bare is not None and bare.lost == ""


def test_a_picture_outside_the_folder_is_not_opened(tmp_path):
    builder = coloured({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}, PNG)
    builder.document["images"] = [{"uri": "../secret.png"}]
    (tmp_path / "in").mkdir()
    (tmp_path / "secret.png").write_bytes(PNG)
    found = read(tmp_path / "in", builder)
    assert found is not None and found.texture is None


def test_a_picture_of_many_materials_is_kept_once(tmp_path):
    """Ten thousand materials that share a picture of 20 MB would take 200 GB."""
    table = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    builder = coloured(table, PNG)
    builder.document["materials"] = [table] * 3
    primitive = builder.document["meshes"][0]["primitives"][0]
    builder.document["meshes"][0]["primitives"] = [{**primitive, "material": k} for k in range(3)]
    path = tmp_path / "m.glb"
    path.write_bytes(builder.bytes())
    first, *others = (material.texture for material in read_gltf(path).materials)
    assert first == PNG and len(others) == 2 and all(each is first for each in others)


def test_pictures_beyond_what_a_file_may_hold_are_left_out(tmp_path, monkeypatch):
    monkeypatch.setattr("surface.readers.gltf.materials.DATA_LIMIT", len(PNG) + 10)
    table = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    second = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 1}}}
    builder = coloured(table, PNG, PNG)
    builder.document["materials"] = [table, second]
    primitive = builder.document["meshes"][0]["primitives"][0]
    builder.document["meshes"][0]["primitives"] = [{**primitive, "material": k} for k in range(2)]
    path = tmp_path / "m.glb"
    path.write_bytes(builder.bytes())
    assert [material.texture for material in read_gltf(path).materials] == [PNG, None]
