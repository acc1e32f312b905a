"""surface.export.shapes"""

import numpy as np
import pytest
from small_head import all_points, part, sheet, small_head

from surface.export.shapes import MIN_MOVE_MM, export_parts, unit
from surface.head import Head
from surface.head.model.parameters import TONGUE_JAW


def one_part(**other) -> Head:
    return Head(small_head(parts=[part("a", -40, **other)], seams=[]))


def test_parts_are_those_of_the_head_at_rest_and_not_views_of_them():
    head = Head(small_head())
    parts = export_parts(head)
    assert [(p.name, p.material) for p in parts] == [("a", "skin"), ("b", "skin"), ("tooth", "skin")]
    for got, own in zip(parts, head.parts, strict=True):
        assert np.array_equal(got.vertices, own.vertices) and got.vertices is not own.vertices
        assert np.array_equal(got.triangles, own.triangles) and got.triangles is not own.triangles
        np.testing.assert_allclose(np.linalg.norm(got.normals, axis=1), 1.0, atol=1e-6)
        assert (got.pivot == 0).all()
    assert parts[1].colours is None


def test_a_pose_moves_the_parts_and_the_head_rests_afterwards():
    head = Head(small_head())
    head.pose(head.values({"jawOpen": 0.7}))
    posed = [p.vertices.copy() for p in head.parts]
    parts = export_parts(head, {"jawOpen": 0.7}, shapes=False)
    for got, wanted in zip(parts, posed, strict=True):
        np.testing.assert_allclose(got.vertices, wanted, atol=1e-5)
        assert got.displacements == {} and got.normal_changes == {}
    head_at_rest = Head(small_head())
    for part_, rest in zip(head.parts, head_at_rest.parts, strict=True):
        np.testing.assert_allclose(part_.vertices, rest.vertices, atol=1e-5)


def test_shapes_are_differences_of_poses():
    head = Head(small_head())
    parts = export_parts(head)
    assert [set(p.displacements) for p in parts][::2] == [{"mouthPucker"}, {"jawForward", "jawOpen"}]
    for name in ("mouthPucker", "jawForward", "jawOpen"):
        for values, sign in (({}, -1), ({name: 1.0}, 1)):
            head.pose(head.values(values))
            for got, own in zip(parts, head.parts, strict=True):
                moved = got.vertices + got.displacements.get(name, 0) if sign > 0 else got.vertices
                assert np.abs(moved - own.vertices).max() <= 1.01 * MIN_MOVE_MM
                turned = got.normals + got.normal_changes.get(name, 0) if sign > 0 else got.normals
                assert np.abs(turned - unit(own.normals)).max() <= 1.01e-4
        assert any(name in p.displacements for p in parts)


@pytest.mark.parametrize(("distance", "kept"), [(0.0015, False), (0.0025, True), (-0.0025, True)])
def test_displacements_below_two_micrometres_are_none(distance, kept):
    head = one_part(groups=[all_points("mouthPucker", (0, 0, distance))])
    assert ("mouthPucker" in export_parts(head)[0].displacements) == kept


def test_vertices_that_hardly_move_are_zero_where_others_move():
    (only,) = export_parts(Head(small_head(parts=[small_head().parts[0]], seams=[])))
    moved = only.displacements["mouthPucker"]
    length = np.abs(moved).max(axis=1)
    assert (length == 0).any() and length.max() > 1
    assert length[length > 0].min() >= MIN_MOVE_MM


@pytest.mark.parametrize(("name", "opened"), [("mouthClose", 1.0), ("tongueOut", TONGUE_JAW)])
def test_shapes_over_an_open_jaw_are_what_they_add_to_it(name, opened):
    head = one_part(groups=[all_points(name, (1, 5, 0)), all_points("jawOpen", (0, -7, 0))])
    head.pose(head.values({"jawOpen": opened}))
    before = head.parts[0].vertices.copy()
    head.pose(head.values({"jawOpen": opened, name: 1.0}))
    wanted = head.parts[0].vertices - before
    assert np.abs(wanted).max() > 1
    (only,) = export_parts(head)
    np.testing.assert_allclose(only.displacements[name], wanted, atol=1e-5)


def test_eyeballs_turn_about_their_centres_and_by_their_own_shapes():
    parts = [part("left", 20, "left_eye"), part("right", -60, "right_eye"), part("a", -40)]
    left, right, skin = export_parts(Head(small_head(parts=parts, seams=[])))
    assert left.pivot.tolist() == [30, 30, 0] and right.pivot.tolist() == [-30, 30, 0]
    assert not skin.pivot.any()
    for own, side in ((left, "Left"), (right, "Right")):
        assert set(own.displacements) == {f"eyeLook{way}{side}" for way in ("Up", "Down", "In", "Out")}
        moved = own.vertices + own.displacements[f"eyeLookUp{side}"] - own.pivot
        rest = own.vertices - own.pivot
        np.testing.assert_allclose(np.linalg.norm(moved, axis=1), np.linalg.norm(rest, axis=1), atol=1e-3)
        assert (own.displacements[f"eyeLookUp{side}"][:, 1] > 0).all()
        inwards = own.displacements[f"eyeLookIn{side}"][:, 0]
        assert (inwards < 0).all() if side == "Left" else (inwards > 0).all()


def test_painted_colours_are_darkened_where_light_does_not_come():
    head = Head(small_head())
    (a, *_) = export_parts(head)
    np.testing.assert_allclose(a.colours, np.tile([0.1, 0.2, 0.3], (len(a.vertices), 1)), atol=1e-6)
    shade = np.linspace(0, 1, len(a.vertices), dtype=np.float32)[:, None]
    head.parts[0].attributes["occlusion"] = shade
    (a, *_) = export_parts(head)
    np.testing.assert_allclose(a.colours, np.array([[0.1, 0.2, 0.3]]) * np.sqrt(shade), atol=1e-6)
    assert a.colours.dtype == np.float32
    head.parts[0].attributes["albedo"] = np.full((len(a.vertices), 3), 1.5, np.float32)
    assert export_parts(head)[0].colours.max() == 1.0


@pytest.mark.parametrize(
    ("low", "high", "wanted"),
    [
        ((0, 0), (1, 1), (1.0, 1.0)),
        ((0, 0), (0.5, 1), (0.5, 1.0)),
        ((0, 0), (1.5, 1), (1.0, 2 / 3)),
        ((-0.5, 0), (0.5, 2), (0.5, 1.0)),
        ((3, 3), (4, 3.5), (1.0, 0.5)),
    ],
)
def test_texture_coordinates_are_shrunk_evenly_into_the_unit_square(low, high, wanted):
    head = one_part()
    own = head.parts[0]
    span = np.asarray(sheet(0).rect).reshape(2, 2)
    own.uv[:] = (own.uv - span[:, 0]) / np.ptp(span, axis=1) * np.subtract(high, low) + low
    before = own.uv.copy()
    (only,) = export_parts(head)
    shift = (0, 0) if min(low) >= 0 and max(high) <= 1 else low
    scale = wanted[0] / (high[0] - low[0])
    np.testing.assert_allclose(only.uv, (before - shift) * scale, atol=1e-6)
    np.testing.assert_allclose(np.ptp(only.uv, axis=0), wanted, atol=1e-6)


def test_unit_normals_and_those_without_a_direction():
    got = unit(np.float32([[3, 0, 4], [0, -2, 0], [0, 0, 0], [1e-7, 0, 0], [1e-5, 0, 0]]))
    np.testing.assert_allclose(got, [[0.6, 0, 0.8], [0, -1, 0], [0, 0, 1], [0, 0, 1], [1, 0, 0]], atol=1e-6)
    assert got.dtype == np.float32
