"""Uniform against adaptive: the adaptive meshes deviate no more and are smaller."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from surface import DCPSurface
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


def test_the_error_bound_saves_vertices_at_no_more_deviation(variants: list[Variant]) -> None:
    uniform, by_error = variants[0], variants[-1]
    assert uniform.name == "uniform"
    assert by_error.name == "by chord error"
    assert all(v.deviation <= uniform.deviation for v in variants)
    assert by_error.saving > 0.5
    assert len(by_error.mesh.vertices) == round((1 - by_error.saving) * len(uniform.mesh.vertices))


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
