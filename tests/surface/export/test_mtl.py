"""surface.export.mtl: trimesh and omote's own reader find the colours and pictures that an exported OBJ names."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from small_head import part, small_head
from textured_head import ramp, textured

from surface.export import export_head
from surface.export.mtl import ObjMaterials
from surface.export.shapes import ExportPart, export_parts
from surface.head import Head
from surface.head.model.accessories import Accessory
from surface.readers.mtl import read_mtl


def blocks(path: Path) -> dict[str, dict[str, str]]:
    """The lines of each material by their first word."""
    found: dict[str, dict[str, str]] = {}
    for line in path.read_text().splitlines():
        word, _, rest = line.partition(" ")
        if word == "newmtl":
            found[rest] = own = {}
        elif word:
            own[word] = rest
    return found


def worn(name: str, alpha: str, picture: bytes = b"") -> ExportPart:
    corner = np.eye(3, dtype=np.float32)
    face, uv = np.array([[0, 1, 2]], np.int32), corner[:, :2].copy()
    own = Accessory(
        name=name, kind="hair", vertices=corner, normals=corner, uv=uv, triangles=face,
        colour=(0.5, 0.25, 0.125, 0.75), texture=picture, alpha=alpha,
        shade=np.ones(3, np.float32),
    )  # fmt: skip
    return ExportPart(name, "hair", corner, corner, uv, face, np.zeros(3), None, worn=own)


def test_another_program_finds_the_textures_at_the_same_places(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh", reason="needs trimesh (development only)")
    head = textured(tmp_path / "head")
    written = export_head(head, tmp_path / "h.obj")
    assert written[-1] == tmp_path / "h_textures"
    assert sorted(p.name for p in written[-1].iterdir()) == ["eye_2.png", "skin.png"]
    scene = trimesh.load(tmp_path / "h.obj", process=False, split_object=True, group_material=False)
    for part_ in export_parts(head):
        if part_.texture is None:
            continue
        (mesh,) = (m for m in scene.geometry.values() if np.isclose(m.bounds[0], part_.vertices.min(axis=0)).all())
        wanted = np.asarray(Image.open(io.BytesIO(part_.texture.picture)).convert("RGB"))
        np.testing.assert_array_equal(np.asarray(mesh.visual.material.image.convert("RGB")), wanted)
        np.testing.assert_allclose(mesh.visual.uv, part_.texture.uv, atol=2e-6)


def test_the_reader_takes_the_pictures_back(tmp_path: Path) -> None:
    export_head(textured(tmp_path / "head"), tmp_path / "h.obj")
    found = read_mtl(tmp_path, "h.mtl")
    assert found["skin"].texture == ramp() and found["eye"].texture
    assert [blocks(tmp_path / "h.mtl")[name]["Kd"] for name in ("skin", "eye")] == ["1.0000 1.0000 1.0000"] * 2
    assert not found["skin_2"].texture


def test_painted_skin_is_the_mean_of_what_is_painted_as_a_display_shows_it(tmp_path: Path) -> None:
    head = Head(small_head())
    export_head(head, tmp_path / "h.obj")
    painted = np.concatenate([p.colours for p in export_parts(head) if p.colours is not None]).mean(axis=0)
    found = [float(x) for x in blocks(tmp_path / "h.mtl")["skin"]["Kd"].split()]
    np.testing.assert_allclose(found, 1.055 * painted ** (1 / 2.4) - 0.055, atol=2e-4)


def test_eyes_without_a_texture_of_their_own_get_a_drawn_one(tmp_path: Path) -> None:
    eye = replace(part("eye_left", 10, "left_eye"), material="eye")
    written = export_head(Head(small_head(parts=[part("a", -40), eye], seams=[])), tmp_path / "h.obj")
    assert [p.name for p in written[-1].iterdir()] == ["eye.png"]
    column = np.asarray(Image.open(written[-1] / "eye.png").convert("RGB"), int)
    assert column[-1].max() < 30 < column[0].min()  # from the pupil, below, to the white


def test_accessories_show_through_where_their_picture_is_clear() -> None:
    looks = ObjMaterials([worn("cap", "OPAQUE", ramp()), worn("curls", "MASK", ramp()), worn("veil", "BLEND")])
    text = "\n".join(looks.lines("h_textures"))
    cap, curls, veil = (text.split("newmtl ")[k] for k in (1, 2, 3))
    assert looks.names == ["hair", "hair_2", "hair_3"] and list(looks.pictures) == ["hair.png"]
    assert "map_Kd h_textures/hair.png" in cap and "map_d" not in cap
    assert "map_d h_textures/hair.png" in curls
    assert "d 0.7500" in veil and "map_Kd" not in veil
    assert "Kd 0.7354 0.5371 0.3886" in veil  # linear 0.5, 0.25, 0.125 in sRGB, IEC 61966-2-1
