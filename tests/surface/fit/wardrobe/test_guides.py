"""Guides of hair over a flat skin, and sheets through them."""

from __future__ import annotations

import numpy as np
import pytest

from surface.base.arrays import Floats
from surface.fit.wardrobe.guides import grow, resampled
from surface.fit.wardrobe.patches import greville
from surface.fit.wardrobe.sheets import Comb, Layer, Weave, sheets

THICK_MM = 10.0
WEAVE = Weave((9, 8), (17, 9), (5, 5))


class Plane:
    """A skin in the plane y = 0."""

    def nearest(self, points: Floats, *, ears: bool = False) -> tuple[Floats, Floats]:
        return np.tile([0.0, 1.0, 0.0], (len(points), 1)), points[:, 1]


def thickness(at: Floats) -> Floats:
    return np.full(len(at), THICK_MM)


def to_x(at: Floats, normals: Floats, share: float) -> Floats:
    return np.tile([1.0, 0.0, 0.0], (len(at), 1))


def comb(**other: object) -> Comb:
    """Nine guides side by side along z that grow to x and are cut at x = 50."""
    roots = np.column_stack([np.zeros(9), np.zeros(9), np.linspace(0.0, 40.0, 9)])
    given = {"ragged_mm": 0.0, "wave_mm": 0.0, **other}
    return Comb(roots, np.full(9, 90.0), thickness, to_x, lambda at: 50.0 - at[:, 0], **given)  # type: ignore[arg-type]


def test_a_guide_rises_to_its_share_of_the_hair() -> None:
    paths, normals = grow(
        Plane(), np.zeros((2, 3)), np.full(2, 60.0), thickness, to_x, lift=np.array([0.8, 1.2]), slack=0.0,  # type: ignore[arg-type]
    )  # fmt: skip
    np.testing.assert_allclose(paths[:, -1, 1], [8.0, 12.0])
    np.testing.assert_allclose(paths[:, 0, 1], 7.0)
    assert normals.shape == paths.shape == (2, 15, 3)


def test_where_there_is_slack_a_guide_may_lie_higher() -> None:
    def falling(at: Floats, normals: Floats, share: float) -> Floats:
        return np.tile([1.0, 0.5, 0.0], (len(at), 1))

    def free(at: Floats) -> Floats:
        return np.where(at[:, 2] > 1.0, 100.0, 0.0)

    roots = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 5.0]])
    paths, _ = grow(Plane(), roots, np.full(2, 60.0), thickness, falling, lift=np.ones(2), slack=free)  # type: ignore[arg-type]
    assert paths[0, -1, 1] == pytest.approx(THICK_MM) and paths[1, -1, 1] > 2 * THICK_MM


def test_resampled_places_lie_evenly() -> None:
    bent = np.array([[[0.0, 0, 0], [1, 0, 0], [1, 5, 0], [1, 9, 0]]])
    steps = np.linalg.norm(np.diff(resampled(bent, 11), axis=1), axis=2)
    np.testing.assert_allclose(steps, 1.0)
    near_the_end = resampled(bent, 3, np.array([0.0, 0.9, 1.0]))
    np.testing.assert_allclose(near_the_end[0], [[0.0, 0, 0], [1, 8, 0], [1, 9, 0]])


def test_sheets_lie_over_one_another_and_end_where_they_are_cut() -> None:
    inner, outer = Layer(0.6, 1.2, 0.7), Layer(1.0, 0.5, 1.0)
    above, below = sheets(Plane(), comb(), (outer, inner), WEAVE, seed=3)  # type: ignore[arg-type]
    for patch, height in ((above, 10.0), (below, 6.0)):
        x, y, z = np.moveaxis(patch.points[0], -1, 0)
        np.testing.assert_allclose(x[:, -1], 50.0, atol=0.1)
        np.testing.assert_allclose(y[:, -1], height, atol=0.1)
        np.testing.assert_allclose(z[:, 0], 40.0 * greville(9, 3), atol=0.1)
    assert above.strands[..., 2].max() < below.strands[..., 2].max()  # gaps in the outer show the inner
    assert (above.strands[..., 3] > below.strands[..., 3] + 0.1).all()  # which is darker


def test_ends_are_ragged_and_strands_sparse_there() -> None:
    (even,) = sheets(Plane(), comb(), (Layer(1.0, 0.8, 1.0, fray_mm=20.0),), WEAVE, seed=3)  # type: ignore[arg-type]
    (ragged,) = sheets(Plane(), comb(ragged_mm=5.0), (Layer(1.0, 0.8, 1.0),), WEAVE, seed=3)  # type: ignore[arg-type]
    assert np.ptp(even.points[0, :, -1, 0]) < 0.1 and np.ptp(ragged.points[0, :, -1, 0]) > 5.0
    cover = even.strands[0, :, :, 2]
    assert (cover[:, -1] < 0.05).all() and (cover[:, 2] > 0.6).all()


def test_an_edge_that_is_frayed_has_fewer_strands() -> None:
    edges = (lambda at: np.full(len(at), 12.0), None)
    (patch,) = sheets(Plane(), comb(), (Layer(1.0, 0.8, 1.0),), WEAVE, seed=3, edges=edges)  # type: ignore[arg-type]
    across = patch.strands[0, :, 2, 2]
    assert across[0] < 0.25 < 0.6 < across[-1]


def test_the_edges_of_a_closed_sheet_show_the_same_strands() -> None:
    """The noise of strands repeats at whole numbers of its coordinate."""
    (patch,) = sheets(Plane(), comb(), (Layer(1.0, 0.8, 1.0),), WEAVE, seed=3, closed=True)  # type: ignore[arg-type]
    tiles = patch.strands[0, -1, :, 0] - patch.strands[0, 0, :, 0]
    assert (tiles > 0.5).all()
    np.testing.assert_allclose(tiles, np.rint(tiles), atol=1e-9)
