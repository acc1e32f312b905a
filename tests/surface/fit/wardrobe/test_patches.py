"""Patches of several kinds as arrays of one surface, against the surface engine that evaluates them."""

from __future__ import annotations

import numpy as np
import pytest

from surface import DCPSurface
from surface.base.arrays import Floats
from surface.fit.wardrobe.patches import APART, BARE, Patches, arrays, knots


class Plane:
    """A skin in the plane y = 0: part 1, at u = x, v = z."""

    def anchors(self, points: Floats) -> tuple[Floats, Floats]:
        foot = points * [1.0, 0.0, 1.0]
        return np.column_stack([np.ones(len(points)), foot[:, 0], foot[:, 2]]), points - foot


def sheets(count: int, size: tuple[int, int], degrees: tuple[int, int], grid: tuple[int, int], **other) -> Patches:
    """Flat sheets at the heights 1, 2, ...: x runs from 0 to 1 along u, z along v."""
    nu, nv = size
    x, y, z = np.meshgrid(greville(nu, degrees[0]), 1.0 + np.arange(count), greville(nv, degrees[1]), indexing="ij")
    points = np.stack([x, y, z], axis=-1).swapaxes(0, 1)
    gu, gv = grid
    number = np.arange(count * gu * gv, dtype=float).reshape(count, gu, gv)
    strands = np.stack([number, number + 0.25, number + 0.5, number + 0.75], axis=-1)
    sway = np.arange(count * nu * nv).reshape(count, nu, nv) / 100.0
    return Patches(points, degrees, grid, (2, 2), strands, number / number.max(), 1.0 + number / 100.0, sway, **other)


def greville(count: int, degree: int) -> Floats:
    """Where control points lie on a line so that the spline is the line itself."""
    return knots(count, degree)[:, 1:-1].mean(axis=1)


KINDS = [sheets(2, (3, 5), (2, 3), (3, 4)), sheets(3, (4, 3), (3, 1), (2, 3), follow=0.5)]
COUNTS = [(2, 15, 12), (3, 12, 6)]  # of each kind: patches, control points and vertices of each


@pytest.fixture
def made() -> dict[str, np.ndarray]:
    return arrays(KINDS, Plane())  # type: ignore[arg-type]


def world(made: dict[str, np.ndarray]) -> Floats:
    """(n, 3) control points, offsets added to their anchors."""
    anchor = made["anchor"].astype(float)
    return np.column_stack([anchor[:, 1], 0.0 * anchor[:, 1], anchor[:, 2]]) + made["points"]


def test_knots_are_clamped_and_uniform() -> None:
    np.testing.assert_allclose(knots(4, 2), [[0, 0, 0, 0.5], [0, 0, 0.5, 1], [0, 0.5, 1, 1], [0.5, 1, 1, 1]])
    np.testing.assert_allclose(knots(3, 1), [[0, 0, 0.5], [0, 0.5, 1], [0.5, 1, 1]])


def test_every_vertex_lies_on_the_sheet_of_its_patch(made: dict[str, np.ndarray]) -> None:
    surface = DCPSurface(
        world(made), np.ones(len(made["points"])),
        *([row[: degree + 2] for row, degree in zip(made[f"knots_{x}"], made["degrees"][:, k], strict=True)]
          for k, x in enumerate("uv")),
    )  # fmt: skip
    assert made["knots_u"].shape[1] == made["knots_v"].shape[1] == 3 + 2  # as wide as the highest degree wants
    uv, inside = made["mesh_uv"], 1e-9
    side = made["mesh_side"]
    at = uv - inside * np.column_stack([side & 1, side >> 1])
    wanted = []
    for kind, first in zip(KINDS, (0, 2), strict=True):
        for k in range(len(kind.points)):
            x, z = np.meshgrid(*(np.linspace(0, 1, n) for n in kind.grid), indexing="ij")
            wanted.append(np.stack([x, np.full_like(x, 1.0 + k), z], axis=-1).reshape(-1, 3))
            own = slice(sum(map(len, wanted[:-1])), sum(map(len, wanted)))
            np.testing.assert_allclose(uv[own, 0], APART * (first + k) + wanted[-1][:, 0])
    np.testing.assert_allclose(surface.evaluate(at), np.concatenate(wanted), atol=1e-6)


def test_each_patch_is_a_cell_with_its_own_vertices_and_control_points(made: dict[str, np.ndarray]) -> None:
    vertices = [0, *np.cumsum([v for count, _, v in COUNTS for _ in range(count)])]
    points = [0, *np.cumsum([p for count, p, _ in COUNTS for _ in range(count)])]
    assert made["mesh_cell_start"].tolist() == vertices and made["mesh_list_start"].tolist() == points
    assert made["mesh_list_ids"].tolist() == list(range(points[-1]))
    assert made["mesh_made"][3] == 5
    cell = np.searchsorted(vertices, np.arange(vertices[-1]), side="right")
    for key in ("mesh_triangles", "fast"):
        assert (np.ptp(cell[made[key]], axis=1) == 0).all()  # no triangle joins two patches
    assert len(made["fast"]) == 2 * 5  # two triangles of each patch
    assert len(made["mesh_triangles"]) == 2 * (2 * (2 * 3) + 3 * (1 * 2))


def test_a_cell_of_a_wide_sheet_lists_just_the_points_that_reach_it() -> None:
    """One list for the whole sheet would hold mostly points that do not reach a vertex; each of them costs time."""
    made = arrays([sheets(1, (40, 4), (3, 3), (61, 5))], Plane())  # type: ignore[arg-type]
    vertices, lists = made["mesh_cell_start"], made["mesh_list_start"]
    assert len(vertices) == len(lists) == 6 and (vertices[0], vertices[-1], lists[-1]) == (
        0,
        305,
        len(made["mesh_list_ids"]),
    )
    for k in range(5):
        u = made["mesh_uv"][vertices[k] : vertices[k + 1], 0]
        ids, (low, high) = made["mesh_list_ids"][lists[k] : lists[k + 1]], made["knots_u"][:, [0, -1]].T
        assert set(ids) == set(np.flatnonzero((low <= u.max()) & (high >= u.min())))
    assert lists[-1] < 2 * 160  # not 5 times all


@pytest.mark.parametrize("key", ["mesh_triangles", "fast"])
def test_triangles_cover_each_sheet_once_and_turn_alike(made: dict[str, np.ndarray], key: str) -> None:
    a, b, c = made["mesh_uv"][made[key]].swapaxes(0, 1)
    area = 0.5 * np.linalg.det(np.stack([b - a, c - a], axis=1))
    assert (area > 0).all() and area.sum() == pytest.approx(5.0)


def test_where_no_hair_grows_no_triangle_is_drawn() -> None:
    patch = sheets(1, (3, 5), (2, 3), (3, 4))
    patch.strands[0, :2, :, 2], patch.strands[0, 2, :, 2] = -BARE, [-BARE, 0.1, -BARE, -BARE]
    wanted = {"fast": 0, "mesh_triangles": 12}  # of four corners all are bare; the whole mesh is that of the surface
    assert {key: len(arrays([patch], Plane())[key]) for key in wanted} == wanted  # type: ignore[arg-type]
    patch.strands[0, 2, 3, 2] = 0.01 - BARE
    assert len(arrays([patch], Plane())["fast"]) == 2  # type: ignore[arg-type]


def test_what_hair_has_at_its_vertices_and_points_comes_in_their_order(made: dict[str, np.ndarray]) -> None:
    for key, wanted in (
        ("strands", np.concatenate([kind.strands.reshape(-1, 4) for kind in KINDS])),
        ("sway", np.concatenate([kind.sway.ravel() for kind in KINDS])),
        ("follow", np.repeat([0.0, 0.5], [30, 36])),
    ):
        np.testing.assert_allclose(made[key], wanted, rtol=1e-6)
    tint, shade = (np.concatenate([getattr(kind, key).ravel() for kind in KINDS]) for key in ("tint", "shade"))
    np.testing.assert_allclose(made["tint"] / 255, tint, atol=0.002)
    np.testing.assert_allclose(made["shade"] / 128, shade, atol=0.004)
    assert made["degrees"].tolist() == [[2, 3]] * 30 + [[3, 1]] * 36


def test_a_patch_that_goes_as_a_whole_is_anchored_at_its_root(made: dict[str, np.ndarray]) -> None:
    """The root is the middle of the first row of control points: x 0.5, z 0."""
    np.testing.assert_allclose(made["anchor"][30:], np.tile([1.0, 0.5, 0.0], (36, 1)))
    np.testing.assert_allclose(world(made)[30:], KINDS[1].points.reshape(-1, 3), atol=1e-6)
    apart = arrays([sheets(1, (4, 3), (3, 1), (2, 3), follow=0.5, whole=False)], Plane())  # type: ignore[arg-type]
    np.testing.assert_allclose(apart["anchor"][:, 1:], sheets(1, (4, 3), (3, 1), (2, 3)).points.reshape(-1, 3)[:, ::2])
