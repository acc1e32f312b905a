"""Meshes without a recipe: eyes, face, back, what has a name."""

from dataclasses import replace

import ball_head
import numpy as np
import pytest
from meshfiles import remapped
from slit_sheet import SIZE_MM, slit_sheet

from surface.base.errors import FitError
from surface.fit.features.generic import MOST_ISLANDS, POINTS, make_plan
from surface.fit.source.mesh import FitMesh

EYES = {"eyeBlinkLeft": 32.7, "eyeBlinkRight": -32.7}  # where they are, mm


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
    assert [p.name for p, _ in plan.parts] == ["face"] and "3 pieces are eyeballs" in plan.notes[0]


@pytest.mark.parametrize("other", [ball((33, 40, 20), 6.0), ball((20, -60, 20), 12), ball((-33, 60, 20), 12)])
def test_balls_that_do_not_mirror_each_other_are_none(other):
    plan = make_plan(joined([("face", slit_sheet()), ("a", ball((33, 40, 20), 12)), ("b", other)]))
    assert plan.eyes[1] == 0 and len(plan.parts) > 1


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
    assert [p.budget[2] for p, _ in plan.parts] == [8, 9]  # cells as small, though their roots are larger


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


def test_texture_coordinates_without_area_are_refused():
    mesh = slit_sheet()
    with pytest.raises(FitError, match="texture coordinates have no area"):
        make_plan(replace(mesh, uv=mesh.uv * [1.0, 0.0]))
