"""surface.fit.wardrobe.clothes: a trunk with a collar, clear of the skin, and what of the skin it hides."""

from __future__ import annotations

import numpy as np
import pytest

from surface.fit.wardrobe import clothes as module
from surface.fit.wardrobe.clothes import NECKS, garment, hidden_below
from surface.fit.wardrobe.patches import Patches
from surface.fit.wardrobe.skin import Skin
from tests.surface.fit.wardrobe.invariants import asymmetry, check_patches, heights, outward_share, points_of


@pytest.fixture(scope="module", params=NECKS)
def made(request: pytest.FixtureRequest, skin: Skin) -> tuple[str, list[Patches]]:
    return request.param, garment(skin, NECKS[request.param])


def test_a_garment_is_one_closed_patch_and_a_folded_collar_another(made: tuple[str, list[Patches]]) -> None:
    name, patches = made
    check_patches(patches)
    assert len(patches) == 1 + NECKS[name].fold and (name == "clothes-shirt") is NECKS[name].fold
    for patch in patches:
        np.testing.assert_allclose(patch.points[0, 0], patch.points[0, -1], atol=1e-6)
        assert patch.follow == 0.0 and not patch.sway.any() and (patch.strands[..., 2] == 1.0).all()


def test_cloth_is_clear_of_the_skin_from_the_shoulders_down(made: tuple[str, list[Patches]], skin: Skin) -> None:
    _, patches = made
    trunk = patches[-1].points[0][:, -8:]
    foot = skin.points[::1]
    near = np.array([np.linalg.norm(foot - p, axis=1).min() for p in trunk.reshape(-1, 3)]) < 40.0
    over = heights(skin, trunk.reshape(-1, 3))[near]
    assert len(over) > 40 and over.min() > 0.5
    assert outward_share([patches[-1]], np.array([0.0, -180.0, -10.0])) > 0.8
    assert patches[-1].points[0][:, -1, 1].max() < -250.0  # it closes the bust far below


def test_cloth_is_the_same_on_both_sides(made: tuple[str, list[Patches]]) -> None:
    assert asymmetry(points_of(made[1])) < 6.0


def test_a_collar_rises_from_its_line_as_high_as_it_stands(skin: Skin) -> None:
    angle = np.linspace(np.pi, -np.pi, 40)
    for neck in NECKS.values():
        ring = module._ring(skin, neck, angle)
        front, back = (ring[np.abs(angle - at).argmin()] for at in (0.0, np.pi))
        assert front[1] == pytest.approx(neck.front, abs=0.6) and back[1] == pytest.approx(neck.back, abs=0.6)
        assert ring[10, 1] == pytest.approx(neck.side + (neck.front + neck.back - 2 * neck.side) / 8.0, abs=1.5)
        assert front[2] > back[2] and ring[10, 0] > 0.0 > ring[-11, 0]
        assert np.abs(heights(skin, ring)).max() < 6.0
        rows = module._collar(skin, ring, neck)
        tall = rows[2][:, 1] - module._smooth(ring)[:, 1]
        np.testing.assert_allclose(tall, neck.stand + 1.0, atol=3.0)


def test_a_closed_row_is_smoothed_round_and_keeps_its_middle() -> None:
    angle = np.linspace(0, 2 * np.pi, 25)
    row = np.column_stack([np.cos(angle), np.sin(angle), (-1.0) ** np.arange(25)])
    found = module._smooth(row, 1)
    np.testing.assert_array_equal(found[0], found[-1])
    np.testing.assert_allclose(found[:-1].mean(axis=0), row[:-1].mean(axis=0), atol=1e-12)
    np.testing.assert_allclose(found[:, 2], 0.0, atol=1e-12)  # what changes from place to place is gone
    share = 0.5 + 0.5 * np.cos(2 * np.pi / 24)
    np.testing.assert_allclose(np.hypot(found[:, 0], found[:, 1]), share)
    np.testing.assert_allclose(module._smooth(row, 3)[:, 0], share**3 * row[:, 0], atol=1e-12)


def test_skin_below_the_line_is_hidden_and_above_it_is_not(skin: Skin) -> None:
    for neck in NECKS.values():
        hidden = hidden_below(skin, neck)
        assert hidden.min() == 0.0 and hidden.max() == 1.0
        y = skin.points[:, 1]
        highest, lowest = max(neck.front, neck.side, neck.back), min(neck.front, neck.side, neck.back)
        assert not hidden[y > highest].any() and (hidden[y < lowest - 12.5] == 1.0).all()
        front = np.abs(np.arctan2(skin.points[:, 0], skin.points[:, 2] + 14.0)) < 0.02
        shown = y[front & (hidden < 0.5)]
        assert shown.min() == pytest.approx(neck.front - 10.0, abs=6.0)


def test_cloth_has_no_edge_down_the_back_where_it_is_closed(made: tuple[str, list[Patches]]) -> None:
    for patch in made[1]:
        points = patch.points[0]
        np.testing.assert_allclose(points[0], 0.5 * (points[1] + points[-2]), atol=1e-9)


def test_a_turtlenecks_collar_is_rolled_down_over_itself(skin: Skin) -> None:
    neck = NECKS["clothes-turtleneck"]
    angle = np.linspace(np.pi, -np.pi, 40)
    ring = module._ring(skin, neck, angle)
    rows = np.stack(module._collar(skin, ring, neck))
    _, off = skin.nearest(rows.reshape(-1, 3))
    out = off.reshape(rows.shape[:2]).mean(axis=1)
    fold = int(out.argmax())
    assert 0 < fold < len(rows) - 1
    assert out[fold] > out[0] + neck.roll and out[fold] > out[-1] + 0.8 * neck.roll  # a band over what is below it
    below = garment(skin, neck)[0].strands[0, 0, :, 3]
    dark = below[6:].argmin() + 6  # past the inside, where little light gets
    assert below[:dark].max() > below[dark] + 0.3 < below[-1]  # and in its shade
    assert below[:3].max() < 0.4


def test_a_folded_collar_lies_against_the_neck_where_its_edges_meet(skin: Skin) -> None:
    """Seen from the side it does not jut out there as a board: it stands out less than over its points."""
    angle = module._dense_in_front(module._FOLDED)
    ring = module._ring(skin, NECKS["clothes-shirt"], angle)
    rows = np.array(module._folded(skin, ring, angle))
    front, point = (int(np.abs(np.abs(angle) - at).argmin()) for at in (0.0, 0.4))
    out = rows[..., 2] - rows[0, :, 2]
    assert 0.0 < out[:, front].max() < 5.0
    assert out[-1, front] < out[-1, point]
