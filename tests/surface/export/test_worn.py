"""Accessories in exports, read by other programs' code: trimesh for .glb, and omote's fit again."""

from __future__ import annotations

import io
import json
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cards import RED, card, picture
from PIL import Image
from small_head import small_head

from surface.export import export_head
from surface.export.urdf import SKULL
from surface.export.worn import WEB_PIXELS, accessory_parts, web_texture
from surface.fit.features.accessories import make_accessories
from surface.fit.source.load import LoadOptions, load_mesh
from surface.head import Head
from surface.head.model.accessories import Accessory
from surface.head.posing.dressing import WornMesh

trimesh = pytest.importorskip("trimesh")
HAIR = replace(
    card(z=70.0), name="Wolf3D_Hair/Wolf3D_Hair", kind="hair", alpha="MASK", cutoff=0.25,
    texture=picture(RED, (1024, 512), hole=True), shade=np.array([0.5, 1, 1, 1], np.float32),
)  # fmt: skip
LENS = replace(card((0.0, 0.0), (9.0, 9.0)), name="Lens", kind="glasses", texture=b"", colour=(0.1, 0.2, 0.3, 0.4),
               alpha="BLEND", two_sided=False)  # fmt: skip


def wearing(*accessories: Accessory) -> Head:
    head = Head(small_head())
    head.accessories = tuple(WornMesh(one, head.data.neck) for one in accessories)
    return head


def document(path: Path) -> dict[str, Any]:
    raw = path.read_bytes()
    found: dict[str, Any] = json.loads(raw[20 : 20 + struct.unpack_from("<I", raw, 12)[0]])
    return found


def test_a_glb_has_them_with_texture_and_material(tmp_path: Path) -> None:
    export_head(wearing(HAIR, LENS), tmp_path / "h.glb")
    scene = trimesh.load(tmp_path / "h.glb")
    hair, lens = scene.geometry["Wolf3D_Hair"], scene.geometry["Lens"]
    np.testing.assert_allclose(hair.vertices, 0.001 * HAIR.vertices, atol=1e-6)
    np.testing.assert_array_equal(hair.faces, HAIR.triangles)
    np.testing.assert_allclose(hair.visual.uv[:, 1], 1.0 - HAIR.uv[:, 1], atol=1e-6)  # trimesh turns v up
    made = hair.visual.material
    assert (made.alphaMode, made.doubleSided, made.name) == ("MASK", True, "hair")
    assert made.alphaCutoff == pytest.approx(0.25) and made.baseColorTexture.size == (1024, 512)
    assert made.baseColorTexture.convert("RGBA").getpixel((3, 3)) == RED
    glass = lens.visual.material
    assert (glass.alphaMode, glass.doubleSided) == ("BLEND", False) and glass.baseColorTexture is None
    np.testing.assert_allclose(np.array(glass.baseColorFactor) / 255.0, LENS.colour, atol=0.003)


def test_a_head_without_any_is_exported_as_before(tmp_path: Path) -> None:
    export_head(Head(small_head()), tmp_path / "a.glb")
    plain = document(tmp_path / "a.glb")
    assert [node["name"] for node in plain["nodes"]] == ["small", "a", "b", "tooth"] and "images" not in plain


def test_the_fit_finds_them_again(tmp_path: Path) -> None:
    head = wearing(HAIR, LENS)
    export_head(head, tmp_path / "h.glb")
    found = make_accessories(load_mesh(tmp_path / "h.glb", LoadOptions(unit="m")))
    assert [(one.name.split("/")[0], one.kind) for one in found.accessories] == [
        ("Wolf3D_Hair", "hair"), ("Lens", "glasses"),
    ]  # fmt: skip
    again = found.accessories[0]
    assert (again.alpha, again.cutoff) == ("MASK", pytest.approx(0.25))
    size = np.ptp(again.vertices, axis=0)
    np.testing.assert_allclose(size, np.ptp(HAIR.vertices, axis=0), rtol=1e-3, atol=1e-3)


def test_the_web_file_has_them_smaller_and_bound_to_the_neck(tmp_path: Path) -> None:
    large = replace(HAIR, texture=picture((200, 20, 20), (1024, 512)), alpha="OPAQUE", colour=(0.5, 1.0, 1.0, 1.0))
    export_head(wearing(large, LENS), tmp_path / "w.glb", web=True)
    table = document(tmp_path / "w.glb")
    node = next(node for node in table["nodes"] if node["name"] == "Wolf3D_Hair")
    (primitive,) = table["meshes"][node["mesh"]]["primitives"]
    assert node["skin"] == 0 and {"JOINTS_0", "WEIGHTS_0", "TEXCOORD_0"} <= primitive["attributes"].keys()
    assert table["materials"][primitive["material"]]["name"] == "hair"
    scene = trimesh.load(tmp_path / "w.glb")
    assert max(scene.geometry["Wolf3D_Hair"].visual.material.baseColorTexture.size) == WEB_PIXELS
    colour = table["accessors"][primitive["attributes"]["COLOR_0"]]
    assert colour["count"] == 4
    lens = next(m for m in table["materials"] if m["name"] == "glasses")
    assert lens["alphaMode"] == "BLEND" and "baseColorTexture" not in lens["pbrMetallicRoughness"]


def test_textures_for_pages_are_kept_where_they_cannot_be_made_smaller(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = picture((200, 20, 20), (1024, 512))
    for data in (whole[:-200], b"", b"\x89PNG"):
        assert web_texture(replace(HAIR, texture=data))[0] == data
    assert web_texture(replace(HAIR, texture=whole))[0] != whole
    monkeypatch.setattr("surface.base.pictures.decoded.__defaults__", (1024 * 512 - 1,))
    assert web_texture(replace(HAIR, texture=whole))[0] == whole


def obj_points(path: Path, name: str) -> np.ndarray:
    """The vertices (m, 3) of an object of an OBJ that its faces use."""
    lines = path.read_text().splitlines()
    points = np.array([line.split()[1:] for line in lines if line.startswith("v ")], float)
    faces = [line for line in lines[lines.index(f"o {name}") + 1 :] if line.startswith("f ")]
    used = {int(corner.split("/")[0]) - 1 for line in faces for corner in line.split()[1:]}
    return points[sorted(used)]


def test_an_obj_has_their_geometry_and_turns_them_with_the_head(tmp_path: Path) -> None:
    head = wearing(card(z=70.0))
    export_head(head, tmp_path / "h.obj")
    export_head(head, tmp_path / "t.obj", {"headYaw": 1.0})
    own = [obj_points(tmp_path / f"{name}.obj", "Card") for name in "ht"]
    np.testing.assert_allclose(own[0], card(z=70.0).vertices, atol=1e-4)
    assert own[1][:, 0].mean() > own[0][:, 0].mean() + 20
    text = (tmp_path / "h.obj").read_text()
    assert "o Card\nusemtl hat\n" in text and "newmtl hat" in (tmp_path / "h.mtl").read_text()


def test_a_urdf_puts_them_on_the_skull(tmp_path: Path) -> None:
    written = export_head(wearing(card(z=70.0), LENS), tmp_path / "h.urdf")
    names = {path.name for path in written if path.suffix == ".stl"}
    assert {f"{SKULL}-hat_1.stl", f"{SKULL}-glasses_2.stl"} <= names
    mesh = trimesh.load(next(path for path in written if path.name.endswith("hat_1.stl")))
    np.testing.assert_allclose(mesh.extents, [0.0, 0.04, 0.04], atol=1e-6)


def test_names_are_on_one_line_and_none_is_there_twice(tmp_path: Path) -> None:
    twice = [replace(card(), name=name) for name in ("Hair/a", "Hair/b", "x\ny/c", "\n/d")]
    export_head(wearing(*twice), tmp_path / "h.glb")
    names = [node["name"] for node in document(tmp_path / "h.glb")["nodes"]]
    assert names[-4:] == ["Hair", "Hair 2", "x y", "hat"]


def test_a_name_that_another_object_or_a_part_of_the_head_has_gets_the_next_free_number() -> None:
    named = [replace(card(), name=name) for name in ("A 2", "A", "A", "A", "tooth", "Hair band", "Hair")]
    assert [part.name for part in accessory_parts(wearing(*named))] == [
        "A 2", "A", "A 3", "A 4", "tooth 2", "Hair band", "Hair",
    ]  # fmt: skip


def noisy(palette: bool = False) -> bytes:
    """A large picture of reds whose right half is clear, and as red; with a palette, of which one entry is clear."""
    reds = np.random.default_rng(0).integers(180, 220, (1024, 1024)).astype(np.uint8)
    pixels = np.dstack([reds, reds // 8, reds // 8, np.full_like(reds, 255)])
    pixels[:, 512:, 3] = 0
    image, out = Image.fromarray(pixels), io.BytesIO()
    if palette:
        own = image.convert("RGB").quantize(200).point(lambda index: max(index, 1))
        own.paste(0, (512, 0, 1024, 1024))
        own.save(out, "PNG", transparency=0)
    else:
        image.save(out, "PNG")
    return out.getvalue()


def test_clear_texels_of_the_web_file_keep_their_colour() -> None:
    packed, kind = web_texture(replace(card(), alpha="MASK", texture=noisy()))
    pixels = np.asarray(Image.open(io.BytesIO(packed)))
    assert (kind, pixels.shape) == ("image/png", (WEB_PIXELS, WEB_PIXELS, 4))
    assert not pixels[:, 300:, 3].any() and pixels[..., 0].min() > 170


def test_what_a_palette_leaves_clear_is_clear_in_the_web_file() -> None:
    packed, kind = web_texture(replace(card(), alpha="MASK", texture=noisy(palette=True)))
    pixels = np.asarray(Image.open(io.BytesIO(packed)).convert("RGBA"))
    assert (kind, pixels.shape) == ("image/png", (WEB_PIXELS, WEB_PIXELS, 4))
    assert pixels[:, :200, 3].all() and not pixels[:, 300:, 3].any()
