"""surface.head.model.light: control points that are added to a head."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import BSpline

from controller.base.paths import find_config
from surface.head import Head
from surface.head.model.furrow import Furrow, even_moves, furrow_knots
from surface.head.model.light import WEIGHT, LightPoints, Refined, with_light
from surface.head.model.meshes import make_surface
from surface.mesh.mesh import border_edges
from surface.mesh.splitedges import split_edges

PLACE = np.array([[45.0, -25.0, 85.0]])


@pytest.fixture(scope="module")
def folder() -> Path:
    return find_config("heads", "ict")


@pytest.fixture(scope="module")
def plain(folder: Path) -> Head:
    return Head.load(folder)


@pytest.fixture(scope="module")
def light(plain: Head) -> LightPoints:
    """Eleven points across the left cheek."""
    part = plain.part("face")
    near = part.mesh.uv[np.argmin(np.linalg.norm(part.mesh.vertices * 0 + part.vertices - PLACE, axis=1))]
    _, along_u, along_v = part.surface.derivatives(near[None])
    step = np.linalg.pinv(np.stack([along_u[0], along_v[0]], axis=1)) @ np.array([0.3, -1.0, -0.3])
    line = near + np.linspace(-9.0, 9.0, 11)[:, None] * step
    return LightPoints("face", *furrow_knots(Furrow(line, 1.0, 3.0), part.surface))


@pytest.fixture(scope="module")
def grown(folder: Path, light: LightPoints) -> Head:
    return Head.load(folder, light=[light])


def poses(head: Head, count: int) -> np.ndarray:
    rng = np.random.default_rng(5)
    found: np.ndarray = rng.uniform(0, 1, (count, len(head.parameters))) * (
        rng.uniform(size=(count, len(head.parameters))) < 0.3
    )
    found[0] = 0.0
    return found


def test_added_points_leave_the_surface_in_every_pose(plain: Head, grown: Head) -> None:
    n = len(plain.part("face").mesh.uv)
    for pose in poses(plain, 5):
        plain.pose(pose)
        grown.pose(pose)
        for one, two in zip(plain.parts, grown.parts, strict=True):
            rows = n if one.name == "face" else len(one.vertices)
            assert np.abs(one.vertices[:rows] - two.vertices[:rows]).max() < 2e-4, one.name  # mm
            assert np.abs(one.normals[:rows] - two.normals[:rows]).max() < 1e-4, one.name


def blend(knots: np.ndarray, at: np.ndarray | float) -> np.ndarray:
    """A blending function by SciPy."""
    return np.nan_to_num(BSpline.basis_element(knots, extrapolate=False)(at))


def test_a_move_adds_b_w_d_to_the_numerator(plain: Head, grown: Head, light: LightPoints) -> None:
    """Against SciPy's B-splines: the skin goes by b w D / W, W the sum of the weights of the head's own points."""
    part, n = grown.part("face"), plain.part("face").surface.n
    move = np.array([300.0, -2000.0, 5000.0])
    grown.pose(np.zeros(len(grown.parameters)))
    before = part.vertices.astype(np.float64)
    part.rig.rest[n + 4] += move
    part.rig.invalidate()
    grown.pose(np.zeros(len(grown.parameters)))
    after = part.vertices.astype(np.float64)
    part.rig.rest[n + 4] -= move
    part.rig.invalidate()
    b = blend(light.knots_u[4], part.mesh.uv[:, 0]) * blend(light.knots_v[4], part.mesh.uv[:, 1])
    reached = np.flatnonzero(b > 1e-6)
    assert len(reached) > 30 and not (after - before)[b == 0.0].any()
    data = next(each for each in plain.data.parts if each.name == "face")
    for vertex in reached[:: len(reached) // 12]:
        u, v = part.mesh.uv[vertex]
        whole = sum(
            w * blend(ku[: p + 2], u) * blend(kv[: q + 2], v)
            for w, ku, kv, (p, q) in zip(data.weights, data.knots_u, data.knots_v, data.degrees, strict=True)
            if ku[0] < u < ku[p + 1] and kv[0] < v < kv[q + 1]
        )
        assert after[vertex] - before[vertex] == pytest.approx(b[vertex] * WEIGHT / whole * move, abs=1e-3)


def test_the_mesh_is_fine_where_they_reach_and_whole(plain: Head, grown: Head, light: LightPoints) -> None:
    part, before = grown.part("face"), plain.part("face")
    inside = (np.abs(part.mesh.uv[:, None] - light.centres) < 2 * np.diff(light.knots_u).mean()).all(axis=2).any(axis=1)
    edges = part.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    edges = edges[inside[edges].all(axis=1)]
    length = np.linalg.norm(part.vertices[edges[:, 0]] - part.vertices[edges[:, 1]], axis=1)
    assert np.percentile(length, 95) < 2.0 and len(part.mesh.uv) - len(before.mesh.uv) < 4000
    assert len(part.borders) == len(before.borders)
    for level, triangles in part.decimated.items():
        assert len(border_edges(triangles)) == len(border_edges(before.decimated[level]))
        assert triangles.max() < len(part.vertices) and len(triangles) > len(before.decimated[level])
    for name, values in before.attributes.items():
        assert np.array_equal(part.attributes[name][: len(before.mesh.uv)], values), name
        assert np.isfinite(part.attributes[name]).all() and len(part.attributes[name]) == len(part.vertices)


def test_a_line_sinks_by_its_depth_and_hardly_ripples(plain: Head, grown: Head, light: LightPoints) -> None:
    data = next(part for part in grown.data.parts if part.name == "face")
    surface, n = make_surface(data), plain.part("face").surface.n
    furrow = Furrow(light.centres, 1.2, 3.0)
    moves = even_moves(furrow, surface, n + np.arange(len(light)))
    at = np.column_stack([np.interp(np.linspace(3, 7, 81), np.arange(11), x) for x in light.centres.T])
    shift = np.zeros((surface.n, 3))
    shift[n:] = moves
    sunk = np.linalg.norm(surface.basis_matrix(at) @ shift, axis=1)
    assert np.abs(sunk - 1.2).max() < 0.15 and np.abs(np.diff(sunk, 2)).max() < 0.01


def test_points_that_cannot_be_added_are_refused(plain: Head, light: LightPoints) -> None:
    for bad, why in [
        (replace(light, part="hat"), "no part 'hat'"),
        (replace(light, part="teeth_upper"), "takes no control points"),
        (replace(light, knots_u=light.knots_u[:, :4]), "rows of 5"),
        (replace(light, knots_v=light.knots_v[:, ::-1]), "rise"),
        (replace(light, knots_u=light.knots_u + 9.0), "no surface"),
    ]:
        with pytest.raises(ValueError, match=why):
            with_light(plain.data, [bad])


def test_no_points_leave_the_head_as_it_is(plain: Head) -> None:
    data, refined = with_light(plain.data, [])
    assert not refined and data.parts == plain.data.parts


def test_only_triangles_that_points_reach_are_looked_at_and_all_of_these(
    folder: Path, light: LightPoints, monkeypatch: pytest.MonkeyPatch
) -> None:
    looked: list[int] = []
    monkeypatch.setattr(
        "surface.head.model.light.split_edges",
        lambda triangles, *words: looked.append(len(triangles)) or split_edges(triangles, *words),
    )
    one = Head.load(folder, light=[light]).part("face")
    few = max(looked)
    monkeypatch.setattr(Refined, "_near", lambda self, places: np.ones(len(places), bool))
    two = Head.load(folder, light=[light]).part("face")
    assert few < 0.2 * len(one.triangles) < max(looked)
    assert one.vertices.tobytes() == two.vertices.tobytes()
    for a, b in ((one.triangles, two.triangles), *((one.decimated[k], two.decimated[k]) for k in one.decimated)):
        assert sorted(map(tuple, a.tolist())) == sorted(map(tuple, b.tolist()))
