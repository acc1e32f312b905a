"""surface.export.head_texture: exported parts show the head's texture where omote draws it, as trimesh reads them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_head import small_head
from textured_head import textured

from surface.export import export_head
from surface.export.head_texture import texture_of, tinted
from surface.head import Head
from surface.head.posing.paint import BASE


def mesh_of(scene: Any, name: str) -> Any:
    return scene.geometry[scene.graph.get(name)[1]]


def test_another_program_finds_the_same_picture_at_the_same_places(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh", reason="needs trimesh (development only)")
    head = textured(tmp_path / "head")
    (path,) = export_head(head, tmp_path / "h.glb")
    scene = trimesh.load(path, process=False)
    own = head.part("a")
    mesh = mesh_of(scene, "a")
    image = np.asarray(mesh.visual.material.baseColorTexture.convert("RGB"), float)
    assert image.shape == (64, 64, 3)
    u, v = np.asarray(mesh.visual.uv, float).T  # trimesh has v up
    at = np.column_stack([u, 1.0 - v])
    np.testing.assert_allclose(at, own.uv * [1.0, 0.5] + [0.0, 0.5], atol=1e-5)
    assert mesh_of(scene, "b").visual.material.baseColorTexture is None


def test_an_eye_shows_its_own_rectangle_from_the_front(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh", reason="needs trimesh (development only)")
    head = textured(tmp_path / "head")
    (path,) = export_head(head, tmp_path / "h.glb")
    mesh = mesh_of(trimesh.load(path, process=False), "eye_left")
    image = np.asarray(mesh.visual.material.baseColorTexture.convert("RGB"), float)
    np.testing.assert_array_equal(image[[0, 0, -1], [0, -1, 0], 0], np.rint(np.linspace(0, 255, 64))[[16, 47, 16]])
    assert image[0, 0, 1] == 0 and image.shape[0] == 32
    rest = head.part("eye_left").mesh.vertices
    u, v = np.asarray(mesh.visual.uv).T
    order = np.argsort(rest[:, 0])
    assert (np.diff(u[order]) >= -1e-6).all() and u.max() == pytest.approx(1.0) and u.min() == pytest.approx(0.0)
    assert np.corrcoef(v, rest[:, 1])[0, 1] > 0.99, "v is up where y is"


def test_colours_are_relative_to_the_textures_tone(tmp_path: Path) -> None:
    """Colours multiply the texture: skin as it is painted, (0.1, 0.2, 0.3), is less than the tone in red."""
    head = textured(tmp_path)
    worn = texture_of(head, head.part("a"))
    assert worn is not None and worn.mime == "image/png"
    np.testing.assert_allclose(tinted(np.array([[0.1, 0.2, 0.3]], np.float32), worn), [[0.2, 0.8, 2.4]], rtol=1e-6)
    given = np.array([BASE["albedo"]], np.float32)
    assert tinted(given, None) is given
    eye = texture_of(head, head.part("eye_left"))
    assert eye is not None and tinted(given, eye) is given


def test_without_a_texture_or_a_picture_that_can_be_read_there_is_none(tmp_path: Path) -> None:
    plain = Head(small_head())
    assert texture_of(plain, plain.part("a")) is None
    damaged = textured(tmp_path, b"\x89PNG damaged")
    assert texture_of(damaged, damaged.part("eye_left")) is None
    assert texture_of(damaged, damaged.part("b")) is None


def test_files_for_pages_have_it_too(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh", reason="needs trimesh (development only)")
    head = textured(tmp_path / "head")
    (path,) = export_head(head, tmp_path / "h.glb", web=True)
    scene = trimesh.load(path, process=False)
    names = {mesh.visual.material.name for mesh in scene.geometry.values()}
    assert names == {"skin", "eye"}, "pages look their shaders up by these names"
    u, v = np.asarray(mesh_of(scene, "a").visual.uv, float).T
    assert v.max() <= 0.5 + 1e-5 and u.min() >= 0.0 and u.max() <= 1.0
    with_picture = [m.visual.material.baseColorTexture is not None for m in scene.geometry.values()]
    assert sorted(with_picture) == [False, True, True]
    u, v = np.asarray(mesh_of(scene, "eye_left").visual.uv, float).T
    assert u.min() == pytest.approx(0.0, abs=1e-3) and u.max() == pytest.approx(1.0, abs=1e-3)
