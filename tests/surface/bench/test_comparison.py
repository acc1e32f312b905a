"""Uniform against adaptive: the adaptive meshes deviate no more and are smaller."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from surface import DCPSurface, Domain, Mesh, Slit
from surface.bench import comparison
from surface.bench.comparison import Variant, compare, deviation, draw
from tests.surface import shapes


def bump() -> DCPSurface:
    """A flat sheet with one hill, and control points close together only there."""
    surface = shapes.hills(24)
    points = surface.points.copy()
    points[:, 2] = 20 * np.exp(-((points[:, :2] - [70, 30]) ** 2).sum(axis=1) / 40)
    return surface.with_points(points).refine((0.6, 0.8, 0.2, 0.4)).surface


@pytest.fixture(scope="module")
def variants() -> list[Variant]:
    return compare(bump(), level=5)


@pytest.mark.slow
def test_the_error_bound_saves_vertices_at_no_more_deviation(variants: list[Variant]) -> None:
    uniform, by_error = variants[0], variants[-1]
    assert uniform.name == "uniform"
    assert by_error.name == "by chord error"
    assert all(v.deviation <= uniform.deviation for v in variants)
    assert by_error.saving > 0.5
    assert len(by_error.mesh.vertices) == round((1 - by_error.saving) * len(uniform.mesh.vertices))


@pytest.mark.slow
def test_only_the_domain_that_is_meant_is_compared() -> None:
    for domain, wide in ((None, 1.0), (Domain((0.25, 0.75, 0.0, 1.0)), 0.5)):
        for variant in compare(bump(), domain, level=3):
            assert np.ptp(variant.mesh.uv[:, 0]) == pytest.approx(wide)


def test_deviation_of_a_flat_sheet_is_nothing_and_of_a_coarse_bump_its_height() -> None:
    surface = bump()
    flat = surface.with_points(surface.points * [1, 1, 0])
    assert deviation(flat, flat.tessellate(chord_error=1.0), 1.0) < 1e-12
    coarse = surface.tessellate(chord_error=1e3, roots=(1, 1))
    height = surface.points[:, 2].max()
    assert 0.5 * height < deviation(surface, coarse, 2.5) < 1.5 * height
    assert deviation(surface, coarse, 2.5, quantile=0.5) < deviation(surface, coarse, 2.5)


def test_the_picture_shows_all(variants: list[Variant], tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    draw(variants, tmp_path / "quadtree.png", height=200)
    with image.open(tmp_path / "quadtree.png") as picture:
        assert picture.height == 200
        assert picture.width > 200 * len(variants) * 0.8
        assert np.asarray(picture.convert("L")).std() > 10


class Counted:
    """What stands for a mesh made with a limit: the coarser, the fewer vertices."""

    def __init__(self, limit: float) -> None:
        self.limit, self.vertices = limit, range(round(1e6 / limit))


def searched(coarse: float, fine: float, bound: float, off: Callable[[float], float]) -> tuple[list[float], object]:
    asked: list[float] = []

    def make(limit: float) -> Counted:
        asked.append(limit)
        return Counted(limit)

    found = comparison._search(make, lambda mesh: off(mesh.limit), coarse, fine, bound)  # type: ignore[arg-type]
    return asked, found


def test_the_coarsest_limit_within_the_bound_is_found_to_three_per_cent() -> None:
    for bound in (0.0123, 0.3, 0.97):
        asked, found = searched(1.0, 0.01, bound, lambda limit: limit)
        assert isinstance(found, tuple)
        mesh, reached = found
        assert bound / 1.03 < mesh.limit <= bound and reached == mesh.limit
        assert asked[0] == pytest.approx(0.1) and len(asked) == 8  # halves of the ratio of 100 down to 3 %
    _, found = searched(1.0, 0.01, 0.1, lambda limit: 0.1 if limit <= 0.1001 else 1.0)
    assert isinstance(found, tuple) and found[1] == 0.1  # the bound itself is within it


def test_nothing_is_found_where_no_mesh_is_within_the_bound_or_measured() -> None:
    assert searched(1.0, 0.01, 0.3, lambda limit: 0.4)[1] is None
    assert searched(1.0, 0.01, 0.3, lambda limit: 0.0)[1] is None  # too fine to be measured
    asked, found = searched(1e150, 1e-100, 1e140, lambda limit: limit)
    assert len(asked) == 14 and found is not None  # and no more than 14 are made
    # of several the one with the fewest vertices, whatever came last
    _, found = searched(1.0, 0.01, 0.3, lambda limit: 0.2 if limit < 0.2 or limit > 0.5 else 0.4)
    assert isinstance(found, tuple) and 0.19 < found[0].limit < 0.2


def test_the_root_mean_square_weighs_values() -> None:
    values, weights = np.array([3.0, np.nan, 1.0]), np.array([1.0, 99.0, 3.0])
    assert comparison._quantile(values, weights, None) == pytest.approx(np.sqrt(3.0))
    assert comparison._quantile(values[1:2], weights[1:2], None) == 0.0


def test_the_value_that_a_part_of_the_weight_does_not_exceed() -> None:
    values, weights = np.array([4.0, np.nan, 1.0, 3.0, 2.0]), np.array([1.0, 99.0, 2.0, 3.0, 4.0])
    for quantile, expected in (
        (1.0, 4.0),
        (0.95, 4.0),
        (0.89, 3.0),
        (0.61, 3.0),
        (0.59, 2.0),
        (0.21, 2.0),
        (0.19, 1.0),
    ):
        assert comparison._quantile(values, weights, quantile) == expected, quantile
    assert comparison._quantile(values[:0], weights[:0], 1.0) == 0.0
    assert comparison._quantile(values[1:2], weights[1:2], 0.5) == 0.0


@pytest.mark.parametrize("n", [2, 3, 7])
def test_samples_divide_the_edges_of_a_triangle_and_leave_its_corners_out(n: int) -> None:
    wanted = {(i, j, n - i - j) for i in range(n + 1) for j in range(n + 1 - i)} - {(n, 0, 0), (0, n, 0), (0, 0, n)}
    found = comparison._lattice(n) * n
    assert len(found) == len(wanted) and {tuple(np.rint(row).astype(int)) for row in found} == wanted


def arch() -> DCPSurface:
    """z = u^2 over the unit square: two triangles of it lie in the plane z = u."""
    net = np.array([[[x, y, z] for y in (0.0, 1.0)] for x, z in ((0.0, 0.0), (0.5, 0.0), (1.0, 1.0))])
    return DCPSurface.from_nurbs(2, 1, [0, 0, 0, 1, 1, 1], [0, 0, 1, 1], net)


def test_deviation_is_that_of_an_arch_from_its_chord() -> None:
    surface = arch()
    mesh = surface.tessellate(chord_error=1e9, roots=(1, 1))
    assert len(mesh.triangles) == 2
    assert deviation(surface, mesh, 9.0) == pytest.approx(0.25 / np.sqrt(2))
    for quantile in (0.25, 0.5, 0.9):  # |u - 1/2| is spread evenly
        wanted = (0.25 - (0.5 * (1 - quantile)) ** 2) / np.sqrt(2)
        assert deviation(surface, mesh, 0.01, quantile) == pytest.approx(wanted, rel=0.05)
    # a part of three quarters of the length bows most
    two = surface.tessellate(
        chord_error=1e9, roots=(1, 1), domain=Domain((0, 1, 0, 1), slits=[Slit("v", 0.25, -9, -8)])
    )
    assert len(two.triangles) == 4
    assert deviation(surface, two, 0.02) == pytest.approx(0.75**2 / 4 / np.sqrt(1 + 1.25**2), rel=0.01)


def test_samples_are_as_near_as_asked_and_forty_along_an_edge_at_most(monkeypatch: pytest.MonkeyPatch) -> None:
    surface, counts = arch(), []
    mesh = surface.tessellate(chord_error=1e9, roots=(1, 1))
    evaluate = DCPSurface.evaluate
    monkeypatch.setattr(
        DCPSurface, "evaluate", lambda self, uv, side=None: counts.append(len(uv)) or evaluate(self, uv, side=side)
    )
    longest = np.sqrt(3.0)  # the diagonal: 1 along each axis
    for spacing, parts in ((99.0, 2), (longest / 2.5, 3), (longest / 6.99, 7), (longest / 39.5, 40), (1e-3, 40)):
        counts.clear()
        deviation(surface, mesh, spacing)
        assert counts == [2 * ((parts + 1) * (parts + 2) // 2 - 3)]


def test_samples_beside_a_slit_are_compared_with_their_own_side() -> None:
    domain = Domain((0, 1, 0, 1), slits=[Slit("u", 0.5, -1.0, 2.0)])
    for turned in (False, True):
        surface = shapes.torn()
        mesh = surface.tessellate(chord_error=1.0, domain=domain, flip=turned)
        assert deviation(surface, mesh, 1.0) < 1e-9


def test_meshes_are_made_and_measured_as_said(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[dict[str, Any]] = []
    measured: list[tuple[int, float, float]] = []
    tessellate, deviate = DCPSurface.tessellate, comparison.deviation

    def record(self: DCPSurface, **given: Any) -> Mesh:
        mesh = tessellate(self, **given)
        made.append({**given, "vertices": len(mesh.vertices)})
        return mesh

    def measure(surface: DCPSurface, mesh: Mesh, spacing: float, quantile: float = 1.0) -> float:
        measured.append((len(mesh.vertices), spacing, quantile))
        return deviate(surface, mesh, spacing, quantile)

    monkeypatch.setattr(DCPSurface, "tessellate", record)
    monkeypatch.setattr(comparison, "deviation", measure)
    surface, said = bump(), []
    size = np.linalg.norm(np.ptp(surface.points, axis=0))
    variants = compare(surface, Domain((0, 1, 0, 1)), level=2, quantile=0.9, report=said.append)
    assert said == ["uniform", "by control points", "by chord error"]
    uniform = made[0]
    assert uniform["min_depth"] == uniform["max_depth"] == 2
    assert uniform["chord_error"] > 1e6 < uniform["loop_error"]
    a, b = (variants[0].mesh.vertices[variants[0].mesh.triangles[:, k]] for k in (0, 1))
    edge = np.median(np.linalg.norm(b - a, axis=1))
    assert {(spacing, quantile) for _, spacing, quantile in measured} == {(edge / 4, 0.9)}
    by_points, by_error = ([way for way in made[1:] if name in way] for name in ("max_points", "chord_error"))
    assert all(way["max_depth"] == 4 for way in made[1:])
    assert all(way["loop_error"] == max(variants[0].deviation, 0.1 * edge) for way in made[1:])
    assert by_points[0]["max_points"] == round(np.sqrt(surface.n * 4.0))
    assert by_error[0]["chord_error"] == pytest.approx(np.sqrt(1e-7) * size)
    total = uniform["vertices"]
    assert [n for n, *_ in measured] == [way["vertices"] for way in made if way["vertices"] <= 4 * total]
    assert any(way["vertices"] > 4 * total for way in made)  # finer ones are not measured
    assert variants[0].saving == 0.0
    for variant in variants[1:]:
        assert variant.saving == pytest.approx(1 - len(variant.mesh.vertices) / total)


def card(at: np.ndarray) -> Mesh:
    """A mesh of triangles with the given corners (3 t, 3)."""
    whole = arch().tessellate(chord_error=1e9, roots=(1, 1))
    return replace(whole, vertices=at, triangles=np.arange(len(at)).reshape(-1, 3))


def test_pictures_stand_side_by_side_at_one_scale_and_fill_their_height(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    square = np.array([[0.0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 0, 0], [2, 1, 0], [0, 1, 0]])
    steep = square[:, [0, 1, 2]] @ np.array([[1.0, 0, -0.75], [0, 1, 0], [0, 0, 1]]) - [0, 0, 5.0]
    shift = np.array([3.0, 7, 0])
    meshes = card(square + shift), card(np.vstack([square, steep]) * [0.5, 1, 1] + shift)
    draw([Variant(str(k), mesh, 0.0, 0.0) for k, mesh in enumerate(meshes)], tmp_path / "two.png", height=400)
    with image.open(tmp_path / "two.png") as picture:
        pixels = np.asarray(picture.convert("RGB")).astype(int)
    high, wide = 400, pixels.shape[1] // 2
    scale = 0.86 * high  # pixels per unit
    assert pixels.shape[0] == high and wide == pytest.approx(2 * scale + 0.05 * high, abs=1)
    body = pixels[int(0.13 * high) // 2 + 1 :]  # under the captions
    for column, width in enumerate((2.0, 1.0)):
        inked = (body[:, column * wide : (column + 1) * wide] < 200).any(axis=(0, 2))
        across = np.flatnonzero(inked)
        assert across[0] == pytest.approx(0.025 * high, abs=2)
        assert across[-1] == pytest.approx(0.025 * high + width * scale, abs=2)
        rows = np.flatnonzero((pixels[:, int(column * wide + 0.025 * high + 40)] < 253).any(axis=1))
        assert rows[-1] == pytest.approx(0.06 * high + scale, abs=2)
        # faces that look along z get 150 + 95 times 0.9, however many others lie behind them
        at = pixels[int(0.06 * high + 0.7 * scale), int(column * wide + 0.025 * high + 0.8 * width * scale)]
        assert at.tolist() == [235, 235, 235]


def test_edges_are_dark_blue() -> None:
    class Pen:
        def polygon(self, points: object, *, fill: object, outline: object) -> None:
            calls.append((points, fill, outline))

    calls: list[tuple[object, object, object]] = []
    corners = np.array([[0.0, 0, 2], [1, 0, 2], [0, 1, 2], [0, 0, 1], [2, 0, 1], [0, 2, 1]])
    comparison._draw_mesh(Pen(), card(corners), 10.0 * corners[:, :2])
    assert calls == [
        ([(0.0, 0.0), (20.0, 0.0), (0.0, 20.0)], (235, 235, 235), (40, 60, 90)),  # the farther one first
        ([(0.0, 0.0), (10.0, 0.0), (0.0, 10.0)], (235, 235, 235), (40, 60, 90)),
    ]


def test_faces_are_lit_from_the_right_above_and_the_nearest_hide_the_others(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    flat = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0]])
    for slope, axis in ((0.5, 0), (-0.5, 0), (0.5, 1)):
        tilted = flat.copy()
        tilted[:, 2] = slope * (flat[:, axis] - 2) + 3.0
        normal = np.array([0.0, 0, 1])
        normal[axis] = -slope
        grey = int(150 + 95 * min(abs(normal @ [0.3, 0.3, 0.9]) / np.linalg.norm(normal), 1.0))
        for order in (np.vstack([flat, tilted]), np.vstack([tilted, flat])):
            draw([Variant("one", card(order), 0.0, 0.25)], tmp_path / "tilted.png", height=200)
            with image.open(tmp_path / "tilted.png") as picture:
                at = picture.convert("RGB").getpixel((25, 170))
            assert at == (grey, grey, grey), (slope, axis)


def test_captions_tell_what_is_saved_or_needed_more(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("PIL.Image")
    from PIL import ImageDraw

    said: list[tuple[tuple[float, float], str, Any, float]] = []

    def write(pen: Any, at: tuple[float, float], text: str, *, fill: Any, font_size: float) -> None:
        said.append((at, text, fill, font_size))

    monkeypatch.setattr(ImageDraw.ImageDraw, "multiline_text", write)
    mesh = card(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]))
    savings = {"uniform": 0.0, "by points": -0.123, "by error": 0.4567}
    draw([Variant(name, mesh, 0.0, saving) for name, saving in savings.items()], tmp_path / "three.png", height=400)
    assert [text for _, text, *_ in said] == [
        "uniform\n3 vertices", "by points\n3 vertices, 12.3 % more", "by error\n3 vertices, 45.7 % saved",
    ]  # fmt: skip
    wide = int(2 * 0.86 * 400 + 40)  # of twice the size; halved at the end
    np.testing.assert_allclose([at for at, *_ in said], [(k * wide + 20.0, 4.0) for k in range(3)])
    assert {(fill, size) for *_, fill, size in said} == {("black", 18.0)}
