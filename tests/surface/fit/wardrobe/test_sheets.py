"""surface.fit.wardrobe.sheets: guides become smooth surfaces whose strands thin out at their tips."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BSpline

from surface.fit.wardrobe import sheets as module
from surface.fit.wardrobe.patches import BARE, Patches, knots
from surface.fit.wardrobe.sheets import Comb, Layer, Weave, sheet, sheets
from surface.fit.wardrobe.skin import Skin
from surface.fit.wardrobe.styles import ACROSS, ALONG, tangent
from tests.surface.fit.wardrobe.invariants import check_patches

WEAVE = Weave((9, 6), (17, 11), (5, 3))
PLAIN = Layer(1.0, 0.8, 0.9, fray_mm=20.0)


def flat(long: float = 100.0) -> np.ndarray:
    """(9, 6, 3) control points of a flat sheet, 64 mm wide, whose strands run along y."""
    x, y = np.meshgrid(np.linspace(0, 64, 9), np.linspace(0, -long, 6), indexing="ij")
    return np.stack([x, y, 0 * x], axis=-1)


def made(layer: Layer = PLAIN, *, closed: bool = False, sway: float = 0.0) -> module.Patches:
    return sheet(flat(), layer, WEAVE, np.random.default_rng(3), closed, sway)


def test_strands_run_from_roots_to_tips_in_tiles_of_the_noise() -> None:
    patch = made(sway=0.5)
    check_patches([patch])
    strands = patch.strands[0]
    across, along = strands[..., 0] - strands[0, 0, 0], strands[..., 1] - strands[0, 0, 1]
    np.testing.assert_allclose(across, np.linspace(0, 64 * ACROSS, 17)[:, None] + 0 * across)
    np.testing.assert_allclose(along, np.linspace(0, 100 * ALONG, 11)[None] + 0 * along)
    np.testing.assert_allclose(patch.tint[0], np.linspace(0, 1, 11)[None] ** 1.5 + 0 * across)
    np.testing.assert_allclose(patch.sway[0], 0.5 * np.linspace(0, 1, 6)[None] ** 1.5 + np.zeros((9, 6)))
    assert patch.degrees == (3, 3) and (patch.grid, patch.fast) == (WEAVE.grid, WEAVE.fast)
    np.testing.assert_array_equal(patch.points[0], flat())


def test_strands_end_one_after_the_other_at_the_tips_alone() -> None:
    cover = made().strands[0, ..., 2]
    assert (cover[:, -1] < 0.1).all() and (cover[:, -1] < cover[:, -2]).all()
    np.testing.assert_allclose(cover[:, 0], cover[:, 6])  # 60 mm on: nothing ends before 70 mm
    assert cover[:, 0].mean() == pytest.approx(PLAIN.cover, rel=0.1)
    short = sheet(flat(5.0), PLAIN, WEAVE, np.random.default_rng(3), False, 0.0).strands[0, ..., 2]
    np.testing.assert_allclose(short[:, 1], short[:, 0])  # however short, a tenth stays whole


def test_roots_are_sparse_where_they_shall_be() -> None:
    full = made().strands[0, ..., 2]
    rooted = made(Layer(1.0, 0.8, 0.9, 20.0, roots=0.5)).strands[0, ..., 2]
    np.testing.assert_allclose(full[:, 0] - rooted[:, 0], 0.5)
    np.testing.assert_allclose(rooted[:, 4:], full[:, 4:])
    sparse = full[:, 1] - rooted[:, 1]
    assert np.ptp(sparse) > 0.05, "a hairline is uneven"


def test_a_closed_sheet_has_whole_tiles_and_locks_that_meet() -> None:
    strands, shade = made(closed=True).strands[0], made(closed=True).shade[0]
    turns = strands[-1, 0, 0] - strands[0, 0, 0]
    assert turns == pytest.approx(round(turns)) and turns >= 1.0
    np.testing.assert_allclose(strands[-1, :, 2:], strands[0, :, 2:])
    np.testing.assert_allclose(shade[-1], shade[0])


def test_waves_are_smooth_noise_about_nothing() -> None:
    waves = module._waves(4000, np.random.default_rng(1), False)
    assert abs(waves.mean()) < 0.06 and waves.std() == pytest.approx(1.0, abs=0.15) and np.abs(waves).max() <= 1.8
    assert np.corrcoef(waves[:-1], waves[1:])[0, 1] > 0.5
    ring = module._waves(40, np.random.default_rng(1), True)
    assert ring[0] == ring[-1]


@pytest.mark.parametrize(("left", "end"), [([3.0, 1.0, -1.0, -2.0], 1.5), ([3.0, 2.0, 1.0, 0.5], 3.0),
                                           ([-1.0, -2.0, -3.0, -4.0], 3.0), ([3.0, 0.0, 0.0, -1.0], 1.0)])  # fmt: skip
def test_a_guide_ends_where_nothing_of_it_is_left(left: list[float], end: float) -> None:
    """One of which nothing is left from the beginning is kept whole."""
    row = np.array([[0.0, 0, 0], [1, 2, 0], [2, 4, 0], [3, 6, 0]])
    found = module._until(row, np.array(left))
    assert found.shape == (64, 3)
    np.testing.assert_allclose(found, np.linspace(0.0, end, 64)[:, None] * [1.0, 2.0, 0.0])


def test_a_surface_goes_through_guides_and_does_not_sink_into_what_they_lie_on() -> None:
    """Guides on a cylinder: control points that lie on it would make a surface within it."""
    round_it, down = np.linspace(-1.0, 1.0, 9), np.linspace(0.0, 1.5, 24)
    on = 80.0 * np.stack([np.sin(down), np.cos(down)], axis=-1)
    paths = np.stack([np.concatenate([on, np.full((24, 1), 80.0 * r)], axis=1) for r in round_it])
    weave = Weave((9, 8), (9, 8), (9, 8), 0.3)
    found = module._control_points(paths, weave)
    every = [np.concatenate([own[:, 0], own[-1, 1:]]) for own in (knots(9, 3), knots(8, 3))]
    at = np.linspace(0.0, 1.0, 30)
    across = BSpline(every[0], found, 3)(at)
    surface = BSpline(every[1], across.swapaxes(0, 1), 3)(at)  # (along, across, 3)
    np.testing.assert_allclose(np.hypot(surface[..., 0], surface[..., 1]), 80.0, atol=0.1)
    np.testing.assert_allclose(surface[..., 2], np.broadcast_to(160.0 * (at - 0.5), (30, 30)), atol=0.05)
    angle = np.arctan2(surface[:, 0, 0], surface[:, 0, 1]) / 1.5
    np.testing.assert_allclose(angle, weave.length(at), atol=0.02)  # denser at the tips
    assert angle[-1] - angle[-2] < 0.65 * (angle[1] - angle[0])


def _sheet(layer: Layer) -> Patches:
    points = np.stack(np.meshgrid(np.linspace(0, 80, 8), np.linspace(0, 150, 10), [0.0], indexing="ij"), axis=-1)
    return module.sheet(points[:, :, 0], layer, Weave((8, 10), (9, 31), (9, 31)), np.random.default_rng(1), False, 0.0)


def test_cropped_hairs_are_seen_in_short_pieces_at_the_tips_only() -> None:
    long, cropped = (_sheet(Layer(1.0, 0.8, 1.0, cropped_mm=mm)).strands[0, 4] for mm in (0.0, 7.0))
    pace = np.diff(cropped[:, 1]) / np.diff(long[:, 1])
    assert pace[-1] > 5.0 and pace[0] == pytest.approx(1.0, abs=1e-3)
    np.testing.assert_allclose(cropped[:, 2], long[:, 2])  # their cover is the same
    assert cropped[-1, 3] < 0.7 * long[-1, 3] and cropped[0, 3] == pytest.approx(long[0, 3])


def test_roots_are_sparse_along_their_length_in_millimetres_and_tips_fade_to_nothing() -> None:
    cover = _sheet(Layer(1.0, 0.8, 1.0, 5.0, roots=0.7, roots_mm=30.0)).strands[0, 4, :, 2]  # 5 mm from row to row
    assert cover[0] < 0.2 < cover[3] < cover[7] and cover[7] == pytest.approx(cover[12])
    assert cover[-1] == pytest.approx(-BARE, abs=0.1)


def falling(skin: Skin) -> Comb:
    """Nine guides that fall over the forehead, cut at a height."""
    side = np.linspace(-30.0, 30.0, 9)
    roots = np.column_stack([side, np.full(9, 110.0), np.zeros(9)])
    toward = roots - [0.0, 40.0, 0.0]
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    roots = np.array([0.0, 40.0, 0.0]) + toward * skin.reach(toward)[:, None]

    def flow(at: np.ndarray, normals: np.ndarray, share: float) -> np.ndarray:
        return tangent(np.tile([0.0, -0.3, 1.0], (len(at), 1)), normals)

    return Comb(roots, np.full(9, 120.0), lambda at: np.full(len(at), 10.0), flow, lambda at: at[:, 1] - 95.0, 0.0, 0.0)


def test_inner_sheets_back_the_frayed_edges_of_outer_ones(skin: Skin) -> None:
    """Through the gaps between strands of an edge one sees hair, not a dotted line of skin."""
    layers = tuple(Layer(share, 0.8, 1.0) for share in (1.0, 0.9, 0.8))
    found = sheets(skin, falling(skin), layers, WEAVE, seed=1, edges=(lambda at: np.full(len(at), 30.0), None))
    outer, middle, inner = (float(patch.strands[0, 1:, 1, 2].mean()) for patch in found)
    assert outer + 0.005 < middle < inner - 0.05 and inner < 0.79


def test_sheets_lie_over_each_other_in_the_order_of_their_layers(skin: Skin) -> None:
    """The outer sheet lies further out."""
    comb = falling(skin)
    outer, inner = sheets(skin, comb, (Layer(1.0, 0.5, 1.0), Layer(0.3, 1.0, 0.7)), WEAVE, seed=7)
    check_patches([outer, inner])
    out, low = (skin.nearest(patch.points[0, :, 2:].reshape(-1, 3))[1] for patch in (outer, inner))
    assert low.min() > -0.5 and out.mean() > low.mean() + 3.0
    np.testing.assert_allclose(outer.points[0, :, -1, 1], 95.0, atol=1.5)
    again = sheets(skin, comb, (Layer(1.0, 0.5, 1.0), Layer(0.3, 1.0, 0.7)), WEAVE, seed=7)
    np.testing.assert_array_equal(again[0].points, outer.points)  # the same seed, the same hair
    other = sheets(skin, comb, (Layer(1.0, 0.5, 1.0),), WEAVE, seed=8)[0]
    assert (other.strands != outer.strands).any()
