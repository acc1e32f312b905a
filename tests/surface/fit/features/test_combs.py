"""Strips of lashes are cut into hairs that grow from the border next to the eye, where no texture draws them."""

from dataclasses import replace

import numpy as np
import pytest
from lash_strip import LONG, mesh, strip

from surface.fit.features import combs
from surface.fit.features.combs import HAIR_MM, combed
from surface.head.model.meshes import make_surface
from surface.mesh.loops import inside
from surface.readers.meshdata import Material


@pytest.mark.parametrize("below", [True, False])
@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_hairs_grow_from_the_border_next_to_the_eye_and_stay_within_the_strip(below: bool, scale: float) -> None:
    part, eyes = strip(below)
    (loop,) = combed(part, *mesh(), eyes, scale).loops
    assert loop.min() >= 0.0 and loop.max() <= 1.0
    u = np.linspace(0.1, 0.9, 4001)
    root, tip = (0.04, 0.6) if below else (0.96, 0.4)
    whole, cut = (inside(_edges(loop), np.column_stack([u, np.full_like(u, v)])) for v in (root, tip))
    assert whole.all()
    hairs = int((np.diff(cut.astype(int)) == 1).sum()) + int(cut[0])
    assert hairs == pytest.approx(0.8 * LONG / (HAIR_MM * scale), rel=0.2) and 0.05 < cut.mean() < 0.5


def test_strips_whose_texture_draws_the_hairs_or_that_have_holes_stay() -> None:
    part, eyes = strip()
    assert combed(part, *mesh(Material("m", (1.0, 1.0, 1.0, 1.0), texture=b"png")), eyes, 1.0) is part
    assert combed(part, *mesh(Material("m", (0.1, 0.1, 0.1, 1.0))), eyes, 1.0) is not part
    holed = replace(part, loops=[*part.loops, 0.3 + 0.1 * part.loops[0]])
    assert combed(holed, *mesh(), eyes, 1.0) is holed


def _edges(loop: np.ndarray) -> np.ndarray:
    return np.hstack([loop, np.roll(loop, -1, axis=0)])


@pytest.mark.parametrize(("length", "scale", "count"), [
    (26.5, 1.0, 20), (26.5, 2.0, 10), (5.0, 1.0, 8), (200.0, 1.0, 40), (26.5, 0.25, 40),
])  # fmt: skip
@pytest.mark.parametrize("below", [True, False])
def test_hairs_are_1_3_mm_apart_and_8_to_40_in_a_strip(
    monkeypatch: pytest.MonkeyPatch, length: float, scale: float, count: int, below: bool
) -> None:
    asked: list[tuple[int, float, float]] = []

    def comb(hairs: int, *, lean: float, thick: float) -> np.ndarray:
        asked.append((hairs, lean, thick))
        return np.array([[0.0, 0.0], [0.5, 0.5], [0.5, 1.0], [1.0, 0.0]])

    monkeypatch.setattr(combs, "comb", comb)
    part, eyes = strip(below)
    ends = make_surface(part).evaluate(np.array([[0.02, 0.5], [0.98, 0.5]]))  # what lies beyond is left out
    part = replace(part, points=part.points * [length / np.ptp(ends[:, 0]), 1.0, 1.0])
    (loop,) = combed(part, *mesh(), eyes, scale).loops
    assert asked == [(count, 0.015, 0.45)]
    v = np.array([0.02, 0.5, 0.98, 0.02])
    np.testing.assert_allclose(loop, np.column_stack([[0.02, 0.5, 0.5, 0.98], v if below else 1.0 - v]))


def test_the_ends_of_a_strip_where_it_is_low_are_left_out() -> None:
    loop = np.array([[1.0, 2.0], [3.0, 1.0], [5.0, 2.0], [3.0, 3.0]])  # a diamond
    u, low, high = combs._ends(loop)
    every = np.linspace(1.08, 4.92, 41)
    assert (u == every).all() and len(u) == 41  # a fiftieth is inset, where it is 4 % of its height already
    np.testing.assert_allclose(high - low, 2.0 - np.abs(u - 3.0))
    np.testing.assert_allclose(0.5 * (low + high), 2.0)
    thin = np.array([[0.0, 0.5], [2.0, 0.481], [2.0, 0.0], [4.0, 0.0], [4.0, 1.0], [2.0, 1.0], [2.0, 0.519]])
    u, low, high = combs._ends(thin)
    assert u.min() >= 2.0 and np.allclose(high - low, 1.0)
    end = [[2.0, 0.0], [4.0, 0.0], [4.0, 1.0], [2.0, 1.0]]
    thick = np.array([[0.0, 0.45], [2.0, 0.45], *end, [2.0, 0.55], [0.0, 0.55]])
    assert combs._ends(thick)[0].min() == pytest.approx(0.08)


def test_faces_of_islands_are_those_with_all_corners_in_them() -> None:
    whole, islands = mesh()
    faces = np.array([[0, 1, 2, 3], [0, 1, 2, -1], [1, 2, 4, -1], [4, 5, 6, -1]])
    more = replace(whole, vertices=np.zeros((7, 3)), faces=faces)
    assert combs._faces(more, islands).tolist() == [0, 1]
