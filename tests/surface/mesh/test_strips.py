"""Coordinates of strips of hair: those that omote makes, and those that are charts of a mesh."""

from dataclasses import dataclass

import numpy as np
import pytest

from surface.mesh.strips import lower_strips, strip_uv

BAND = np.array([(0.1, 0.0), (0.9, 0.0), (0.9, 0.2), (0.1, 0.2)])


@dataclass
class Part:
    """A part of strips."""

    material: str
    uv: np.ndarray
    triangles: np.ndarray
    vertices: np.ndarray


def comb(hairs: int, height: float) -> tuple[np.ndarray, np.ndarray]:
    """A strip of hairs that stand side by side on a root, in (u, v), and its triangles."""
    u = np.linspace(0.0, 1.0, 2 * hairs + 1)
    root = np.column_stack([u, np.zeros(len(u))])
    tips = np.column_stack([u[1::2], np.full(hairs, height)])
    triangles = [(2 * k, 2 * k + 2, len(u) + k) for k in range(hairs)]
    return np.vstack([root, tips]), np.array(triangles, np.int32)


def part_of(material: str, *strips: tuple[np.ndarray, np.ndarray, float]) -> Part:
    """A part of strips, each (u, v), triangles and height, side by side."""
    uv = np.vstack([own + np.array([2.0 * k, 0.0]) for k, (own, _, _) in enumerate(strips)]).astype(np.float32)
    start = np.cumsum([0, *(len(own) for own, _, _ in strips)])
    triangles = np.vstack([t + n for (_, t, _), n in zip(strips, start, strict=False)])
    vertices = np.vstack([np.column_stack([40 * own[:, 0], y + 40 * own[:, 1], 0 * own[:, 0]]) for own, _, y in strips])
    return Part(material, uv, triangles, vertices)


def test_strips_of_hair_are_told_apart_by_their_tiles() -> None:
    uv = np.array([(0.0, 0.2), (1.0, 0.5), (2.25, 1.0), (7.0, 0.0)], np.float32)
    part = Part("brow", uv, np.zeros((0, 3), np.int32), np.zeros((4, 3)))
    assert strip_uv(part) == pytest.approx(np.array([(0.0, 0.2), (1.0, 0.5), (0.25, 1.0), (1.0, 0.0)]))


def test_a_brow_that_is_a_chart_fills_its_tile() -> None:
    """Else all of it would lie where brows of omote begin, in their sparsest hairs."""
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    part = part_of("brow", (BAND, faces, 60.0), (0.5 * BAND, faces, 60.0))
    assert strip_uv(part) == pytest.approx(np.tile([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)], (2, 1)))


def test_lashes_of_hairs_fill_their_tile_from_the_roots_on() -> None:
    upper, lower = (*comb(12, 0.2), 40.0), (*comb(12, 0.2), 30.0)
    part = part_of("lash", upper, lower)
    found, half = strip_uv(part), len(upper[0])
    assert found[:half, 1].max() == pytest.approx(1.0) and found[0, 1] == pytest.approx(0.0)
    assert found[half, 1] == pytest.approx(1.0) and found[-1, 1] == pytest.approx(0.0)  # they hang: roots are above
    assert found[half:, 0] == pytest.approx(found[:half, 0], abs=1e-6)


def test_lashes_that_a_mesh_draws_whole_stay_whole() -> None:
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    part = part_of("lash", (BAND, faces, 40.0), (BAND, faces, 30.0))
    assert strip_uv(part)[:4] == pytest.approx(BAND)


def test_lashes_of_one_lid_alone_are_not_of_the_lower_one() -> None:
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    part = part_of("lash", (BAND, faces, 40.0), (BAND, faces, 40.5), (BAND, faces, 30.0))
    assert lower_strips(part).tolist() == [False] * 8 + [True] * 4
    assert not lower_strips(part_of("lash", (BAND, faces, 40.0), (BAND, faces, 40.5))).any()
