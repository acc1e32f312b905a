"""surface.fit.wardrobe.edges: strands grow sparse along the edges of a flat sheet."""

from __future__ import annotations

import numpy as np
import pytest

from surface.base.arrays import Floats
from surface.fit.wardrobe import edges as module
from surface.fit.wardrobe.edges import Edges, frayed
from surface.fit.wardrobe.patches import BARE, Patches
from tests.surface.fit.wardrobe.invariants import check_patches

WIDE, LONG, GRID, COVER, OPEN = 64.0, 200.0, (33, 21), 1.6, 0.6  # mm; 2 mm from line to line of strands


def flat() -> Patches:
    """A closed sheet in the plane z = 0, whose strands run down along y from x = 0 to 64 mm."""
    x, y = np.meshgrid(np.linspace(0.0, WIDE, 9), np.linspace(0.0, -LONG, 6), indexing="ij")
    zero = np.zeros((1, *GRID))
    strands = np.stack([zero, zero, zero + COVER, zero + OPEN], axis=-1)
    return Patches(
        np.stack([x, y, 0 * x], axis=-1)[None], (1, 1), GRID, (5, 5), strands, zero, zero + 1.0, zero[:, :9, :6]
    )


def by_height(at: Floats) -> Floats:
    """20 mm in the upper half, 6 below."""
    return np.where(at[:, 1] > -0.5 * LONG, 20.0, 6.0)


def made(edges: Edges, share: float = 1.0, seed: int = 4) -> Floats:
    """(gu, gv, 2) cover and openness."""
    patch = frayed(flat(), edges, share, np.random.default_rng(seed))
    check_patches([patch])
    return np.asarray(patch.strands[0, ..., 2:])


def test_a_sheet_without_frayed_edges_stays_as_it_is() -> None:
    patch = flat()
    assert frayed(patch, (None, None), 1.0, np.random.default_rng(4)) is patch


@pytest.mark.parametrize("first", [True, False])
def test_strands_grow_sparse_over_the_width_of_each_place_at_that_edge_alone(first: bool) -> None:
    found = made((by_height, None) if first else (None, by_height))
    cover, opened = np.moveaxis(found if first else found[::-1], 2, 0)
    np.testing.assert_allclose(cover[0], -BARE)  # a film would end in a line there
    for rows, wide in ((slice(0, 10), 20.0), (slice(11, None), 6.0)):
        whole = int(np.ceil(wide * (1.0 + module._WANDERS) / 2.0))
        assert (cover[1 : round(wide / 2.0), rows] < 1.0).all()
        np.testing.assert_allclose(cover[whole + 1 :, rows], COVER)
        np.testing.assert_allclose(opened[whole + 1 :, rows], OPEN)
    assert (np.diff(cover[:, 3]) > -0.3).all() and cover[8, :10].mean() > cover[3, :10].mean() + 0.2


def test_edges_wander_along_strands_so_that_single_ones_come_out_and_end() -> None:
    cover = made((by_height, None))[..., 0]
    upper = cover[4, :10]
    assert np.ptp(upper) > 0.4 * module._WANDERS
    assert (np.abs(made((by_height, None), seed=5)[4, :10, 0] - upper) > 1e-3).any()  # sheets differ
    np.testing.assert_array_equal(made((by_height, None))[..., 0], cover)


def test_a_share_of_the_width_makes_a_narrower_edge() -> None:
    """Inner sheets back the edges of outer ones."""
    whole, half = (made((by_height, None), share)[..., 0] for share in (1.0, 0.5))
    assert (half >= whole).all() and (half[5, :10] > whole[5, :10] + 0.1).all()


def test_light_reaches_inner_sheets_where_outer_ones_fray() -> None:
    """Else the edge of light hair is a dark band."""
    opened = made((by_height, None))[..., 1]
    assert (opened[0] > OPEN + 0.2).all() and opened.max() <= 1.0
