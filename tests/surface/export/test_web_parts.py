"""Parts for pages: which vertices and shapes are kept, and what each material gets."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from small_head import all_points, part, small_head

from surface.export import web_parts as module
from surface.export.shapes import ExportPart
from surface.export.textures import EYE_RIM, materials
from surface.export.web_parts import BREATH, BREATH_MM, MIN_MOVE_MM, MIN_NORMAL, web_parts
from surface.head import Head
from surface.head.model.data import Neck


def export_part(vertices: Any, material: str = "skin", **other: Any) -> ExportPart:
    at = np.asarray(vertices, np.float32)
    fields: dict[str, Any] = {
        "normals": np.tile(np.float32([0, 0, 1]), (len(at), 1)), "uv": at[:, :2], "pivot": np.zeros(3),
        "triangles": np.array([[0, 1, 2]], np.int32), "colours": None, **other,
    }  # fmt: skip
    return ExportPart("a", material, at, **fields)


def own_part(count: int, uv: Any = None, **attributes: Any) -> Any:
    """What web_parts reads of a head's part."""
    places = np.zeros((count, 2)) if uv is None else np.asarray(uv)
    return SimpleNamespace(uv=places, attributes=attributes, material="brow")


def test_only_vertices_of_triangles_are_kept_and_only_shapes_that_move_them() -> None:
    moves = np.zeros((5, 3), np.float32)
    one, two, three, turn = moves.copy(), moves.copy(), moves.copy(), moves.copy()
    one[3] = [0, -2 * MIN_MOVE_MM, 0]
    one[4] = two[2] = [MIN_MOVE_MM, 0, 0]  # a vertex that is left out, and one that moves just enough
    three[1] = [0.9 * MIN_MOVE_MM, 0, 0]
    turn[1] = [0, 0, -MIN_NORMAL]
    whole = export_part(
        np.arange(15).reshape(5, 3), colours=np.arange(15, dtype=np.float32).reshape(5, 3),
        displacements={"one": one, "two": two, "three": three},
        normal_changes={"one": turn, "two": moves, "three": turn},
    )  # fmt: skip
    kept, small = module._reduce(whole, np.array([[3, 1, 2], [1, 3, 0]]))
    assert kept.tolist() == [0, 1, 2, 3] and small.triangles.tolist() == [[3, 1, 2], [1, 3, 0]]
    np.testing.assert_array_equal(small.vertices, whole.vertices[:4])
    assert small.colours is not None
    np.testing.assert_array_equal(small.colours, whole.colours[:4])  # type: ignore[index]
    assert list(small.displacements) == list(small.normal_changes) == ["one", "two"]
    np.testing.assert_array_equal(small.displacements["one"], one[:4])
    np.testing.assert_array_equal(small.normal_changes["one"], turn[:4])  # it turns a vertex that does not move
    np.testing.assert_array_equal(small.displacements["two"], two[:4])
    apart = module._reduce(whole, np.array([[0, 2, 4]]))[1]
    assert apart.triangles.tolist() == [[0, 1, 2]] and list(apart.displacements) == ["one", "two"]


def test_half_shapes_are_what_lies_between_arc_and_chord() -> None:
    """The jaw turns a tooth about its hinge: half way it lies off the chord by the sagitta of its arc."""
    head = Head(small_head(parts=[part("a", -40, groups=[all_points("mouthPucker", (0, 0, 5))]), part("b", 0, "jaw")],
                           seams=[]))  # fmt: skip
    skin, tooth = web_parts(head)
    assert "jawOpenHalf" in tooth.part.displacements and not any(n.endswith("Half") for n in skin.part.displacements)
    head.pose(head.values({"jawOpen": 0.5}))
    at_half = head.part("b").vertices.copy()
    head.pose(head.values({}))
    rest = head.part("b").vertices
    whole, half = tooth.part.displacements["jawOpen"], tooth.part.displacements["jawOpenHalf"]
    np.testing.assert_allclose(rest + 0.5 * whole + half, at_half, atol=MIN_MOVE_MM)
    assert 0.1 < np.abs(half).max() < 0.1 * np.abs(whole).max()


def test_a_breath_is_a_shape_of_what_it_lifts() -> None:
    data = small_head(neck=Neck((0.0, 20.0, 0.0), still=-30.0, whole=25.0))
    head = Head(data)
    head.live(1.5, 0.1)
    skin, _, tooth = web_parts(head)
    assert BREATH not in tooth.part.displacements, "the jaw follows the head"
    assert (head.rise_mm, head.pupil) == (0.0, 0.0)
    moved = head.part("a")
    pose = head.values({})
    seen = []
    for rise_mm in (0.0, BREATH_MM):
        head.live(rise_mm, 0.0)
        head.pose(pose)
        seen.append(moved.vertices.copy())
    lifted = skin.part.displacements[BREATH]
    assert lifted[:, 1].max() > 0.3 * BREATH_MM
    np.testing.assert_allclose(lifted, seen[1] - seen[0], atol=MIN_MOVE_MM)


def test_coarser_triangles_are_taken_where_the_head_has_them() -> None:
    head = Head(small_head())
    fine = [len(p.part.triangles) for p in web_parts(head)]
    triangles = head.parts[0].mesh.triangles[:7]
    head.parts[0].decimated["far"] = triangles
    coarse = web_parts(head, "far")
    assert [len(p.part.triangles) for p in coarse] == [7, *fine[1:]]
    assert len(coarse[0].colours) == len(coarse[0].part.vertices) == len(np.unique(triangles))


def test_strips_of_hair_lie_two_units_apart_and_have_their_tips_at_the_top() -> None:
    uv = [[0.0, 0.0], [1.0, 1.0], [2.25, 0.5], [5.0, 0.2], [4.0, -0.5]]
    found = module._strip_uv(own_part(5, uv), np.arange(5))
    np.testing.assert_allclose(found, [[0, 1], [1, 0], [0.25, 0.5], [1, 0.8], [0, 1]], atol=1e-6)
    np.testing.assert_allclose(module._strip_uv(own_part(5, uv), np.array([2])), [[0.25, 0.5]])


def test_lashes_of_the_lower_lid_are_fainter() -> None:
    uv = np.array([[0.0, 3.9], [0.9, 0.1], [2.0, 0.2], [2.7, 3.5], [4.0, 0.0]])
    vertices = np.float32([[0, 9, 0], [0, 11, 0], [0, 5, 0], [0, 6, 0], [0, 10, 0]])
    own = SimpleNamespace(**vars(own_part(5, uv)), vertices=vertices)
    found = module._lash_strength(own, np.arange(4))
    assert found.tolist() == [[1.0], [1.0], [0.42], [0.42]]


def test_an_eyeball_is_mapped_as_seen_from_its_front() -> None:
    pivot = np.array([30.0, 30.0, 0.0])
    away = 12.0 * np.array([[0, 0, 1.0], [1, 0, 0], [0, 0.6, 0.8], [0.6, 0, -0.8], [0, -1, 0]])
    found = module._eye_uv(export_part(pivot + away, "eye", pivot=pivot))
    wanted = [[0, 0], [1, 0], [0, -0.6], [1, 0], [0, 1]]
    np.testing.assert_allclose(found, 0.5 + EYE_RIM * np.array(wanted), atol=1e-6)
    apart = np.vstack([away, -away])  # without a pivot, about the middle of its vertices
    np.testing.assert_allclose(module._eye_uv(export_part(apart + 5.0, "eye"))[:5], found, atol=1e-6)


@pytest.mark.parametrize("material", ["teeth", "gums", "tongue", "mouth"])
def test_a_mouths_inside_darkens_with_its_depth_behind_the_teeth(material: str) -> None:
    vertices = [[0, 0, 70.0], [0, 0, 60.0], [0, 0, 34.0]]
    own = own_part(3, occlusion=np.array([1.0, 0.25, 1.0]))
    found = module._add_material_data(export_part(vertices, material), own, np.arange(3), 60.0)
    share = np.array([1.0, 0.5, np.exp(-1.0)])  # 26 mm
    np.testing.assert_allclose(found.colours[:, :3], np.outer(share, materials()[material]["colour"]), rtol=1e-5)
    assert (found.colours[:, 3] == 1).all() and found.uv is None and not found.baked


def test_skin_has_its_light_gloss_and_thinness_baked() -> None:
    own = own_part(
        3, albedo=np.array([[0.4, 0.2, 0.1]] * 3), occlusion=np.array([1.0, 0.25, 0.0]),
        gloss=np.array([0.0, 0.2, 2.0]), thin=np.array([1.0, 0.4, 0.0]), visible=np.array([[1.0, 0.8, 0.6, 0.4]] * 3),
    )  # fmt: skip
    found = module._add_material_data(export_part(np.eye(3)), own, np.array([2, 1]), 0.0)
    np.testing.assert_allclose(found.colours, [[0, 0, 0, 0], [0.2, 0.1, 0.05, 0.25]], atol=1e-6)
    assert found.baked["_SKIN"].tolist() == [[255, 0, 0, 0], [51, 102, 0, 0]]
    assert found.baked["_VISIBLE"].tolist() == [[255, 204, 153, 102]] * 2
    bare = module._add_material_data(export_part(np.eye(3)), own_part(3), np.arange(3), 0.0)
    np.testing.assert_allclose(bare.colours, np.tile([*materials()["skin"]["colour"], 1.0], (3, 1)), atol=1e-6)
    assert bare.baked["_VISIBLE"].tolist() == [[191, 128, 128, 128]] * 3
    assert bare.baked["_SKIN"].tolist() == [[76, 0, 0, 0]] * 3


def test_cloth_has_colours_alone() -> None:
    own = own_part(3, albedo=np.array([[0.4, 0.2, 0.1]] * 3))
    found = module._add_material_data(export_part(np.eye(3), "cloth"), own, np.arange(3), 0.0)
    np.testing.assert_allclose(found.colours, [[0.4, 0.2, 0.1, 1.0]] * 3, atol=1e-6)
    assert found.uv is None and not found.baked


def test_brows_are_as_strong_as_they_are_painted_and_lashes_by_their_lid() -> None:
    uv = np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 0.0]])
    own = own_part(3, uv, strength=np.array([0.5, 1.0, 0.5]), albedo=np.array([[0.1, 0.2, 0.3]] * 3))
    vertices = [[0, 9, 0], [0, 9, 0], [0, 2, 0.0]]
    own.vertices = np.array(vertices)
    brow = module._add_material_data(export_part(vertices, "brow"), own, np.arange(3), 0.0)
    np.testing.assert_allclose(brow.colours, [[0.1, 0.2, 0.3, a] for a in (0.5, 1.0, 0.5)], atol=1e-6)
    lash = module._add_material_data(export_part(vertices, "lash"), own, np.arange(3), 0.0)
    np.testing.assert_allclose(lash.colours[:, 3], [0.5, 1.0, 0.21], atol=1e-6)
    np.testing.assert_allclose(lash.uv, [[0, 1], [1, 0], [0, 1]])


@pytest.mark.parametrize("material", ["strand", "tress"])
def test_locks_are_covered_by_their_strands_and_shaded_as_a_whole(material: str) -> None:
    strands = np.array([[0.1, 0.2, 0.3, 0.25], [0.5, 0.6, 0.7, 1.0]])
    own = own_part(2, strands=strands, albedo=np.array([[0.8, 0.4, 0.2]] * 2))
    found = module._add_material_data(export_part([[10.0, 15, 0], [0, 15, 30.0]], material), own, np.arange(2), 0.0)
    np.testing.assert_allclose(found.colours, [[0.4, 0.2, 0.1, 0.3], [0.8, 0.4, 0.2, 0.7]], atol=1e-6)
    np.testing.assert_allclose(found.uv, strands[:, :2], atol=1e-6)
    slanted = np.array([1.1, 0, 1]) / np.hypot(1.1, 1)
    np.testing.assert_allclose(found.part.normals, [slanted, [0, 0, 1]], atol=1e-6)
