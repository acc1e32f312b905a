"""surface.fit.wardrobe.styles: steps, directions along the skin, and the cap under all hair."""

from __future__ import annotations

import numpy as np
import pytest

from surface.fit.wardrobe.hairline import Hairline
from surface.fit.wardrobe.patches import BARE
from surface.fit.wardrobe.skin import CENTRE, Skin
from surface.fit.wardrobe.styles import cap, step, tangent, thinned
from tests.surface.fit.wardrobe.invariants import check_patches, heights, outward_share


def test_a_step_is_a_hermite_curve_between_its_ends() -> None:
    assert step(np.array([-5.0, 2.0, 3.0, 4.0, 9.0]), 2.0, 4.0).tolist() == [0.0, 0.0, 0.5, 1.0, 1.0]
    t = np.linspace(0.0, 1.0, 21)
    np.testing.assert_allclose(step(2.0 + 2.0 * t, 2.0, 4.0), 3.0 * t**2 - 2.0 * t**3)
    np.testing.assert_allclose(step(-t, -1.0, 0.0), step(1.0 - t, 0.0, 1.0))


def test_directions_along_a_skin_are_across_its_normals_and_as_near_as_can_be() -> None:
    rng = np.random.default_rng(2)
    wanted, normals = rng.normal(size=(30, 3)), rng.normal(size=(30, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    found = tangent(wanted, normals)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0)
    np.testing.assert_allclose((found * normals).sum(axis=1), 0.0, atol=1e-12)
    best = np.linalg.norm(wanted - (wanted * normals).sum(axis=1, keepdims=True) * normals, axis=1)
    np.testing.assert_allclose((found * wanted).sum(axis=1), best)  # the cosine is the greatest there is


def test_hair_of_any_cover_thins_out_evenly_over_the_whole_of_its_border() -> None:
    """A closed sheet fell from all to nothing within a fifth of it."""
    left = np.linspace(-2.0, 2.0, 401)
    for cover in (0.4, 1.8):
        found = thinned(np.full(401, cover), left)
        assert (np.diff(found) >= 0.0).all() and found[0] == -BARE
        np.testing.assert_allclose(found[left >= 1.0], cover)
        between = (left > -BARE) & (left < min(cover, 1.0) - 1e-9)
        np.testing.assert_allclose(found[between], left[between])


@pytest.mark.parametrize(("share", "short_mm"), [(0.5, 3.0), (0.93, 12.0)])
def test_a_cap_lies_over_the_scalp_at_its_share_of_the_thickness(skin: Skin, share: float, short_mm: float) -> None:
    line = Hairline(skin)
    patch = cap(skin, line, lambda at: np.full(len(at), 8.0), share=share, short_mm=short_mm)
    check_patches([patch])
    points = patch.points[0]
    toward = points - CENTRE
    far = np.linalg.norm(toward, axis=2)
    reach = skin.reach((toward / far[..., None]).reshape(-1, 3)).reshape(far.shape)
    np.testing.assert_allclose(np.delete(far - reach, 1, axis=1), 8.0 * share, atol=1e-6)
    pole = points[0, 0] - CENTRE
    level = (points[:-1, 1].mean(axis=0) - points[0, 0]) @ pole / np.linalg.norm(pole)
    assert level == pytest.approx(0.0, abs=0.05)  # the crown is no peak
    assert outward_share([patch], CENTRE) > 0.99
    np.testing.assert_allclose(points[0], points[-1], atol=1e-6)  # it is closed behind
    assert np.ptp(points[:, 0], axis=0).max() < 1.0  # all begin at the crown
    edge = CENTRE + toward[:, -1] * (reach[:, -1] / far[:, -1])[:, None]
    inside = line.inside(edge)
    assert inside.min() > 0.0 and np.median(inside) == pytest.approx(short_mm, rel=0.5)
    assert heights(skin, points.reshape(-1, 3)).min() > 0.0


def test_a_cap_thins_out_at_its_edge_and_stays_closed_above(skin: Skin) -> None:
    patch = cap(skin, Hairline(skin), lambda at: np.full(len(at), 8.0), openness=0.3)
    cover = patch.strands[0, ..., 2]
    assert cover[:, :-2].min() > 1.0 and cover[:, -1].max() < 0.5
    assert (np.diff(cover, axis=1) <= 1e-12).all()
    assert (patch.strands[..., 3] == 0.3).all() and not patch.sway.any() and not patch.tint.any()
