"""Meshes without a recipe: eyes, face, back, what has a name."""

from dataclasses import replace

import ball_head
import numpy as np
import pytest
from meshfiles import remapped
from slit_sheet import SIZE_MM, slit_sheet

from surface.dcp import DCPSurface
from surface.fit.eyes.search import middle_x
from surface.fit.features import cavity, generic
from surface.fit.features.generic import MOST_ISLANDS, POINTS, make_plan
from surface.fit.measures.closest import ClosestTree
from surface.fit.source.islands import Island, boundary_loops, signed_areas
from surface.fit.source.mesh import FitMesh, check_manifold, face_areas
from surface.fit.source.owncharts import usable_islands
from surface.fit.source.repair import repaired
from surface.mesh.domain import Domain

NONE = np.zeros(0, np.int64)
EYES = {"eyeBlinkLeft": 32.7, "eyeBlinkRight": -32.7}  # where they are, mm


def islands_of(mesh: FitMesh, chosen: np.ndarray) -> list[Island]:
    return usable_islands(mesh, np.flatnonzero(chosen), 1.0, [], "mesh")


def joined(meshes: list[tuple[str, FitMesh]]) -> FitMesh:
    """Several meshes as pieces of one; the first one's shapes."""
    first = meshes[0][1]
    starts = np.cumsum([0] + [len(m.vertices) for _, m in meshes])
    coords = np.cumsum([0] + [len(m.uv) for _, m in meshes])
    deltas = np.zeros((len(first.names), int(starts[-1]), 3))
    deltas[:, : starts[1]] = first.deltas
    return FitMesh(
        np.vstack([m.vertices for _, m in meshes]),
        np.vstack([np.where(m.faces < 0, -1, m.faces + s) for (_, m), s in zip(meshes, starts, strict=False)]),
        np.vstack([m.uv for _, m in meshes]),
        np.vstack([np.where(m.face_uv < 0, -1, m.face_uv + s) for (_, m), s in zip(meshes, coords, strict=False)]),
        first.names, deltas, np.repeat(np.arange(len(meshes)), [len(m.faces) for _, m in meshes]),
        tuple(n for n, _ in meshes),
    )  # fmt: skip


def ball(centre, radius: float) -> FitMesh:
    points, _, tri = ball_head.ball(radius, 9, 12)
    uv, _ = ball_head.grid(9, 12)
    unique, inverse = np.unique(np.round(points, 9), axis=0, return_inverse=True)
    faces = np.column_stack([inverse.ravel()[tri], np.full(len(tri), -1)])
    good = np.array([len(set(f[:3])) == 3 for f in faces.tolist()])
    face_uv = np.column_stack([tri, np.full(len(tri), -1)])
    none = np.zeros((0, len(unique), 3))
    return FitMesh(unique + np.array(centre), faces[good], uv, face_uv[good], (), none)


def test_two_balls_are_eyes_and_what_lies_in_them_goes_with_them():
    head = joined([("face", slit_sheet()), ("EyeR", ball((-33, 40, 20), 12)), ("EyeL", ball((33, 40, 20), 12)),
                   ("Lens", ball((33, 40, 29), 3))])  # fmt: skip
    plan = make_plan(head)
    centres, radius = plan.eyes
    np.testing.assert_allclose(centres, [[33, 40, 20], [-33, 40, 20]], atol=1e-6)
    assert radius == pytest.approx(12.0)
    assert [p.name for p, _ in plan.parts] == ["face"] and "462 faces are eyes" in plan.notes[0]


def test_the_middle_of_a_mesh_beside_the_origin_is_its_own() -> None:
    mesh = ball([40.0, 5.0, -3.0], 10.0)
    assert middle_x(mesh) == pytest.approx(40.0, abs=1e-6)
    assert middle_x(replace(mesh, vertices=mesh.vertices - [100.0, 0.0, 0.0])) == pytest.approx(-60.0, abs=1e-6)


def test_names_tell_materials_and_a_crowd_of_pieces_is_left_out():
    tongue = ball((0, -20, 0), 8)
    cards = [("Hair", ball((x, 90, 0), 1)) for x in np.linspace(-90, 90, MOST_ISLANDS + 1)]
    plan = make_plan(joined([("face", slit_sheet()), ("MyTongue/pink", tongue), *cards]))
    assert [(p.name, p.material) for p, _ in plan.parts] == [("face", "skin"), ("tongue_1", "tongue")]
    assert any("'Hair': left out: 81 separate pieces" in n for n in plan.notes)


def test_a_row_of_small_pieces_is_teeth():
    row = [("head", ball((x, -20, 0), 3)) for x in np.linspace(-40, 40, 14)]
    plan = make_plan(joined([("head", slit_sheet()), *row]))
    assert [(p.name, p.material, len(i)) for p, i in plan.parts] == [("face", "skin", 1), ("teeth_1", "teeth", 14)]
    assert [p.budget[2] for p, _ in plan.parts] == [9, 10]  # cells as small, though their roots are larger


def test_one_skin_for_face_and_back_gets_points_by_its_area():
    mesh = slit_sheet()
    around = {n: np.array([0, 0, 1.0]) * (np.abs(mesh.vertices[:, :1] - x) < 12) for n, x in EYES.items()}
    mesh = replace(mesh, names=tuple(around), deltas=np.stack(list(around.values())))
    (small, _), (large, _) = (make_plan(replace(mesh, vertices=mesh.vertices * [1, k, 1])).parts[0] for k in (1, 6))
    assert (small.request.points, large.request.points) == (POINTS, pytest.approx(1.85 * POINTS, rel=0.05))


def test_what_hardly_moves_is_the_back():
    mesh = slit_sheet()
    low = (mesh.vertices[mesh.faces].mean(axis=1)[:, 1] < -0.4 * SIZE_MM).astype(int)
    plan = make_plan(remapped(mesh, low, lambda k, uv: uv + 2.0 * k))
    assert [(p.name, sum(len(i.faces) for i in islands)) for p, islands in plan.parts] == [
        ("face", int((low == 0).sum())), ("back", int(low.sum())),
    ]  # fmt: skip


def test_the_chin_tells_the_hinge():
    mesh = slit_sheet()
    hinge, angle = np.array([0.0, 30.0, -60.0]), 0.35
    turn = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    below = mesh.vertices[:, 1] < 0
    swing = np.where(below[:, None], (mesh.vertices - hinge) @ turn.T + hinge - mesh.vertices, 0.0)
    plan = make_plan(replace(mesh, names=("jawOpen",), deltas=swing[None]))
    np.testing.assert_allclose(plan.hinge, hinge, atol=1e-6)
    assert len(plan.jaw) >= 12 and below[plan.jaw].all()
    assert len(make_plan(replace(mesh, names=(), deltas=mesh.deltas[:0])).jaw) == 0


def test_texture_coordinates_without_area_are_replaced():
    mesh = slit_sheet()
    plan = make_plan(replace(mesh, uv=mesh.uv * [1.0, 0.0]))
    (note,) = [n for n in plan.notes if "100 % of the surface squeezed" in n]
    assert "omote made its own, 1 chart" in note
    ((_, (island,)),) = plan.parts
    assert (signed_areas(island) > 0).all() and len(boundary_loops(island)) == 2


def squares(*corners: tuple[float, float, float, float], names: tuple[str, ...] = ()) -> FitMesh:
    """Squares apart from each other, each a piece of its own: x and y of its low corner, its size, its depth z."""
    one = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    vertices = np.vstack([one * size + [x, y, z] for x, y, size, z in corners])
    faces = np.arange(len(vertices)).reshape(-1, 4)
    uv = np.vstack([one[:, :2] + [2.0 * k, 0] for k in range(len(corners))])
    piece = np.arange(len(corners)) if names else np.zeros(0, np.int64)
    return FitMesh(vertices, faces, uv, faces, (), np.zeros((0, len(vertices), 3)), piece, names)


def moving(mesh: FitMesh, *amounts: list[float]) -> FitMesh:
    """The squares of ``mesh`` move forward: by so many mm in each of the shapes, one number for every square."""
    deltas = np.stack([np.repeat(np.array(row), 4)[:, None] * np.array([0.0, 0, 1]) for row in amounts])
    return replace(mesh, deltas=deltas, names=tuple(f"shape{k}" for k in range(len(amounts))))


def test_pieces_hang_together_by_vertices_and_are_of_one_material() -> None:
    mesh = squares((0, 0, 1, 0), (5, 0, 2, 0), (9, 0, 3, 0), names=("skin", "Tongue", "Skin too"))
    label, sizes = generic._pieces(mesh)
    assert label.tolist() == [0, 1, 2] and sizes.tolist() == [1, 4, 9]
    faces = mesh.faces.copy()
    faces[1, 0] = faces[2, 0] = 2  # both others begin at a corner of the first
    label, sizes = generic._pieces(replace(mesh, faces=faces))
    assert label[0] == label[2] != label[1] and len(sizes) == 2
    faces[:, 3] = -1
    triangles = replace(squares((0, 0, 1, 0), (5, 0, 2, 0), (9, 0, 3, 0)), faces=faces)
    label, sizes = generic._pieces(triangles)
    assert label.tolist() == [0, 0, 0] and sizes[0] == pytest.approx(face_areas(triangles.vertices, faces).sum())


def test_a_piece_is_as_present_as_its_area_times_the_shapes_that_move_it() -> None:
    mesh = squares((0, 0, 1, 0), (5, 0, 2, 0), (9, 0, 3, 0))
    mesh = moving(mesh, [1.9, 2.1, 0.0], [-2.1, 9.0, 0.0], [0.0, -2.5, 1.0])
    mesh = replace(mesh, faces=np.vstack([mesh.faces[:2], [[8, 9, 10, -1]]]))
    label, sizes = np.array([0, 1, 2]), np.array([1.0, 4.0, 4.5])
    found = generic._presence(mesh, label, sizes, 2.0)  # what moves less than 2 mm here does not count
    assert found.tolist() == [2.0, 16.0, 4.5]
    odd = moving(squares((0, 0, 1, 0), (5, 0, 2, 0)), [0.0, 9.0])
    assert generic._presence(odd, np.array([0, 1]), np.array([1.0, 1.0]), 1.0).tolist() == [1.0, 2.0]


def test_the_back_is_what_less_than_four_tenths_as_many_shapes_move() -> None:
    # five islands of one skin; the most mobile is moved by five shapes
    corners = [(300.0 * k, 0.0, 200.0, 0.0) for k in range(5)]
    amounts = [[9.0, 9.0 if k < 2 else 0.5, 9.0 if k < 1 else 0.5, 0.0, 1.5] for k in range(5)]
    mesh = moving(squares(*corners), *amounts)
    parts = generic._skin(mesh, np.ones(5, bool), 1.0, NONE, [])
    sizes = {part.name: [int(i.vertex.min()) // 4 for i in islands] for part, islands in parts}
    assert sizes == {"face": [0, 1, 4], "back": [2, 3]}
    (face, _), (back, _) = parts
    assert face.request.points == 2450  # three times 40,000 mm^2 are less than a face has
    assert back.request.points == round(2450 * 2 / 3 - 0.5)
    assert (face.request.coarse, face.request.neutral_mm) == (0.1, 0.25)
    assert (back.request.coarse, back.request.neutral_mm) == (0.1, 0.4)
    still = generic._skin(replace(mesh, deltas=0 * mesh.deltas), np.ones(5, bool), 1.0, NONE, [])
    assert [part.name for part, _ in still] == ["face"]
    small = generic._skin(moving(squares((0, 0, 200, 0), (300, 0, 10, 0)), [9.0, 0.0]), np.ones(2, bool), 1.0, NONE, [])
    assert small[1][0].request.points == 560
    many = squares((0, 0, 200, 0), *((300 + 20 * k, 0, 10, 0) for k in range(20)))
    assert generic._skin(moving(many, [9.0] + [0.0] * 20), np.ones(21, bool), 1.0, NONE, [])[1][0].request.points == 800
    wide = squares((0, 0, 200, 0), (300, 0, 900, 0))
    assert generic._skin(moving(wide, [9.0, 0.0]), np.ones(2, bool), 1.0, NONE, [])[1][0].request.points == 2450


@pytest.mark.parametrize(("scale", "points"), [(1.0, 3769), (0.5, 4900), (2.0, 2450)])
def test_a_face_larger_than_a_head_of_that_size_has_gets_up_to_twice_the_points(scale: float, points: int) -> None:
    mesh = moving(squares((0, 0, 447.2136, 0)), [9.0])  # 200,000 mm^2, 130,000 is a face
    assert generic._skin(mesh, np.ones(1, bool), scale, NONE, [])[0][0].request.points == pytest.approx(points, abs=1)


def test_limits_of_a_part_are_those_of_a_head_of_its_size() -> None:
    mesh, islands = slit_sheet(), islands_of(slit_sheet(), np.ones(len(slit_sheet().faces), bool))
    for scale in (1.0, 0.1):
        given = "skin", 500, 0.1, 0.25, scale, islands, mesh
        (face, _), (other, _) = generic._part("face", *given), generic._part("back", *given)
        for part in (face, other):
            assert part.request.neutral_mm == pytest.approx(0.25 * scale)
            assert part.request.shape_mm == pytest.approx(0.45 * scale)
            assert (part.request.points, part.request.coarse, part.request.finest) == (500, 0.1, 0.3)
            assert part.downweight_slivers and (part.budget[0], part.budget[2]) == (0, 9)
        assert (face.request.growth, other.request.growth) == (1.12, 1.25)
        assert (face.request.spare, other.request.spare) == (generic.SPARE, 0)
        assert face.request.astray_mm == other.request.astray_mm == pytest.approx(generic.ASTRAY_MM * scale)
        assert (face.budget[1], other.budget[1]) == (pytest.approx(0.24 * scale), pytest.approx(0.5 * scale))


@pytest.mark.parametrize(("count", "depth"), [(1, 9), (12, 9), (13, 10), (24, 10), (25, 11)])
def test_cells_get_deeper_where_more_islands_share_the_24_roots(count: int, depth: int) -> None:
    mesh = squares(*((300.0 * k, 0.0, 200.0, 0.0) for k in range(count)))
    islands = islands_of(mesh, np.ones(count, bool))
    assert len(islands) == count
    assert generic._part("back", "skin", 500, 0.1, 0.25, 1.0, islands, mesh)[0].budget[2] == depth


def test_islands_without_area_in_uv_get_charts_of_their_own() -> None:
    mesh = squares((0, 0, 1, 0), (5, 0, 1, 0), (9, 0, 1, 0))
    for factors in ((1.0, 1.0), (1.0, 0.0), (0.0, 1.0), (1e-2, 1e-2)):
        islands = islands_of(replace(mesh, uv=mesh.uv * factors), np.ones(3, bool))
        assert len(islands) == 3
        assert all((signed_areas(i) > 0).all() for i in islands)
    assert len(islands_of(mesh, np.array([True, False, True]))) == 2


def test_the_area_of_an_island_is_that_of_its_faces() -> None:
    mesh = joined([("a", slit_sheet())])
    (island,) = islands_of(mesh, np.ones(len(mesh.faces), bool))
    assert generic._area(mesh, island) == pytest.approx(face_areas(mesh.vertices, mesh.faces).sum(), rel=1e-3)
    turned = squares((3, 4, 2, 5))
    turned = replace(turned, vertices=turned.vertices @ np.linalg.qr(np.arange(9.0).reshape(3, 3) ** 2 + np.eye(3))[0])
    assert generic._area(turned, islands_of(turned, np.ones(1, bool))[0]) == pytest.approx(4.0)


def test_what_lines_the_mouth_is_fitted_alike_as_a_piece_of_its_own() -> None:
    """As closely as what lines it within the skin, also between the mesh's vertices."""
    mesh = squares((0.0, 0, 100.0, 0), (300.0, 0, 100.0, 0), names=("Mouth Bag", "Tongue"))
    (own, _), (tongue, _) = generic._others(mesh, np.arange(2), [0, 1], 40_000.0, 2.0, [])
    assert (own.name, own.material, tongue.material) == ("mouth_1", cavity.MATERIAL, "tongue")
    assert own.request.points == cavity.POINTS + cavity.SPARE and own.request.spare == cavity.SPARE
    assert own.request.dense and not tongue.request.dense
    assert own.request.neutral_mm == 2.0 * cavity.ERROR_MM and own.request.coarse == cavity.COARSE
    assert own.budget[1] == 2.0 * cavity.CHORD_MM < tongue.budget[1]


def test_only_skin_is_calmer_than_its_mesh() -> None:
    mesh = squares(*((300.0 * k, 0, 100.0, 0) for k in range(3)), names=("Tongue", "Box", "Mouth"))
    parts = generic._others(mesh, np.arange(3), [0, 1, 2], 40_000.0, 2.0, [])
    assert [p.request.calm_mm for p, _ in parts] == [0.0, 2.0 * generic.CALM_MM, 0.0]


def test_a_tongue_whose_texture_is_cut_up_gets_one_skin() -> None:
    """But not two tongues, or gums, or a tongue that is in one island."""
    whole = ball((0.0, -20, 0), 8)
    corner = np.arange(whole.faces.size).reshape(whole.faces.shape)
    halves = corner + 0 * whole.faces
    uv = whole.vertices[whole.faces.ravel()][:, :2] / 100.0
    uv[(whole.vertices[whole.faces].mean(axis=1)[:, 2] > 0.0).repeat(whole.faces.shape[1])] += [2.0, 0.0]
    cut = replace(whole, uv=uv, face_uv=np.where(whole.faces >= 0, halves, -1))
    for name, body, count, wanted in (
        ("Tongue", cut, 1, True),
        ("Gum", cut, 1, False),
        ("Tongue", cut, 2, False),
        ("Tongue", squares((0.0, 0, 100.0, 0)), 1, False),
    ):
        mesh = joined(
            [(name, replace(body, vertices=body.vertices + np.array([40.0 * k, 0.0, 0.0]))) for k in range(count)]
        )
        label, sizes = generic._pieces(mesh)
        ((part, islands),) = generic._others(mesh, label, list(range(len(sizes))), 40_000.0, 1.0, [])
        assert (part.wrapped, part.even) == (wanted, wanted)
        assert not wanted or (len(islands) > 1 and part.request.points == 300)


def test_others_get_points_by_their_share_of_the_skin() -> None:
    mesh = squares(*((300.0 * k, 0, 100.0, 0) for k in range(4)), names=("Tongue", "Gum", "Box", "Iris"))
    label, notes = np.arange(4), list[str]()
    parts = generic._others(mesh, label, [0, 1, 2], 40_000.0, 1.0, notes)
    assert [(p.name, p.material, p.request.points) for p, _ in parts] == [
        ("tongue_1", "tongue", 918), ("gums_2", "gums", 918), ("piece_3", "skin", 918),
    ]  # fmt: skip
    assert notes == [
        "'Tongue': tongue: 1 islands as tongue_1", "'Gum': gums: 1 islands as gums_2",
        "'Box': skin: 1 islands as piece_3",
    ]  # fmt: skip
    assert generic._others(mesh, label, [3], 40_000.0, 1.0, notes) == []
    assert notes.pop() == "'Iris': left out: iris, part of an eye"
    assert {(p.request.coarse, p.request.neutral_mm) for p, _ in parts} == {(0.34, 0.5)}
    assert generic._others(mesh, label, [0], 4e6, 1.0, [])[0][0].request.points == 120
    assert generic._others(mesh, label, [0], 1e3, 1.0, [])[0][0].request.points == 2450
    flat = replace(mesh, vertices=mesh.vertices * [1, 0, 0], uv=mesh.uv * [1, 0])
    assert generic._others(flat, label, [0], 1e3, 1.0, notes) == []
    assert notes[-1] == "'Tongue': left out: no area"
    made = list[str]()
    assert len(generic._others(replace(mesh, uv=mesh.uv * [1, 0]), label, [0], 1e3, 1.0, made)) == 1
    assert made[0].startswith("'Tongue': the file has no usable texture coordinates")


def swinging(angle_deg: float, mm: float = 90.0, rows: float = 0.0) -> tuple[FitMesh, dict[str, np.ndarray]]:
    """The sheet; what lies below turns about an axis so far above it that it moves by about so many mm."""
    mesh, angle = slit_sheet(), np.radians(angle_deg)
    turn = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    below = mesh.vertices[:, 1] < rows
    hinge = np.array([0.0, mm / angle - 60.0, 0.0])
    swing = np.where(below[:, None], (mesh.vertices - hinge) @ turn.T + hinge - mesh.vertices, 0.0)
    return mesh, {"jawOpen": swing}


@pytest.mark.parametrize(("angle", "found"), [(3.9, False), (4.1, True), (49.0, True), (51.0, False)])
def test_a_jaw_turns_by_4_to_50_degrees(angle: float, found: bool) -> None:
    mesh, shapes = swinging(angle)
    hinge, chin = generic._hinge(mesh, shapes, 1.0)
    assert (len(chin) > 0) == found
    if found:
        np.testing.assert_allclose(hinge, [0.0, 90.0 / np.radians(angle) - 60.0, 0.0], atol=1e-4)
        length = np.linalg.norm(shapes["jawOpen"], axis=1)
        assert chin.tolist() == np.flatnonzero(length > 0.8 * length.max()).tolist()


def test_a_jaw_moves_by_three_millimetres_and_twelve_vertices_at_least() -> None:
    mesh, shapes = swinging(10.0, mm=20.0)
    most = np.linalg.norm(shapes["jawOpen"], axis=1).max()
    assert len(generic._hinge(mesh, shapes, most / 3.01)[1]) > 0
    assert len(generic._hinge(mesh, shapes, most / 2.99)[1]) == 0
    moved = np.argsort(np.linalg.norm(shapes["jawOpen"], axis=1))
    for count in (11, 12):
        few = {"jawOpen": np.zeros_like(shapes["jawOpen"])}
        few["jawOpen"][moved[-count:]] = shapes["jawOpen"][moved[-count:]]
        assert len(generic._hinge(mesh, few, 1.0)[1]) == (12 if count == 12 else 0)
    assert len(generic._hinge(mesh, {"mouthClose": shapes["jawOpen"]}, 1.0)[1]) == 0


def test_bad_hair_is_no_reason_to_refuse_a_face() -> None:
    cards = joined([("face", slit_sheet()), ("Hair", ball((0, 95, 0), 8)), ("Top", ball((0, -95, 0), 8))])
    rows = np.flatnonzero(cards.piece == 1)
    wall = cards.faces[rows[:3]][:, [0, 2, 1, 3]]  # doubled the other way round, and a fin on an edge of three faces
    fin = np.array([[*cards.faces[rows[0], :2], cards.faces[rows[9], 2], -1]])
    bad = replace(
        cards, faces=np.vstack([cards.faces, wall, fin]),
        face_uv=np.vstack([cards.face_uv, cards.face_uv[rows[:3]], cards.face_uv[rows[:1]]]),
        piece=np.concatenate([cards.piece, np.full(4, 1)]),
    )  # fmt: skip
    mesh, notes = repaired(bad)
    check_manifold(mesh, "m")
    assert len(notes) >= 2 and all("Hair" in n for n in notes)
    plan = make_plan(mesh)
    assert plan.parts[0][0].name == "face" and "brow" in {p.material for p, _ in plan.parts}
    face = mesh.vertices[np.unique(mesh.faces[mesh.piece == 0])]
    np.testing.assert_array_equal(face, slit_sheet().vertices)


def pitted(width: float) -> DCPSurface:
    """A sheet of 150 mm with one pit like a nostril: a control point whose four spans are ``width`` each in (u, v)."""
    at, steps = np.linspace(-0.3, 1.3, 17), np.arange(-2, 3)
    u, v = (a.ravel() for a in np.meshgrid(at, at))
    points = np.vstack([np.column_stack([150.0 * u, 150.0 * v, 0.0 * u]), [77.5, 80.0, -60.0]])
    knots = [[c + 0.1 * steps for c in own] + [at_pit + width * steps] for own, at_pit in ((u, 0.517), (v, 0.533))]
    return DCPSurface(points, np.ones(len(points)), *knots)


def test_triangles_reach_to_the_ground_of_a_nostril() -> None:
    """As deep as a nostril, 1.5 % of a face wide: cells of 1/256 missed its ground by more than 3 mm."""
    surface, budget = pitted(0.0033), make_plan(slit_sheet()).parts[0][0].budget
    side = np.linspace(-0.006, 0.006, 61)
    ground = surface.evaluate(np.stack(np.meshgrid(0.517 + side, 0.533 + side), axis=-1).reshape(-1, 2))
    unit = Domain((0.0, 1.0, 0.0, 1.0), [])

    def missed(depth: int) -> float:
        mesh = surface.tessellate(chord_error=0.24, max_depth=depth, domain=unit, measured=False)
        tree = ClosestTree(mesh.vertices.astype(float), mesh.triangles.astype(np.int64))
        return float(tree.distances(ground, np.zeros(len(ground), np.int64)).max())

    assert missed(budget[2]) < 2.0
    assert missed(8) > 3.0  # the pit is as narrow as it says
