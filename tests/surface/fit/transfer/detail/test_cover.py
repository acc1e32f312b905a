"""Skin is brought to pits that it spans and to closed surfaces behind which it has a cavity."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from surface.fit.measures.closest import ClosestTree
from surface.fit.transfer.detail import cover as module
from surface.fit.transfer.detail.cover import Sheet, bare_places, cover, heights_above
from surface.fit.transfer.skin import _steps

N = 41
X, Y = (a.ravel() for a in np.meshgrid(*2 * [np.linspace(-20.0, 20.0, N)], indexing="ij"))
AT = np.arange(N * N).reshape(N, N)
A, B, C, D = (k.ravel() for k in (AT[:-1, :-1], AT[1:, :-1], AT[1:, 1:], AT[:-1, 1:]))
TRIANGLES = np.vstack([np.column_stack([A, B, C]), np.column_stack([A, C, D])])
FLAT = np.column_stack([X, Y, 0.0 * X])
STEPS: csr_matrix = _steps(TRIANGLES, N * N)
BEYOND = np.hypot(X, Y)
CAVITY = 10.0 * np.clip((6.0 - BEYOND) / 2.0, 0.0, 1.0)  # depth; walls over 2 mm
UP = np.tile([0.0, 0.0, 1.0], (N * N, 1))


def sheet(free: np.ndarray | None = None) -> Sheet:
    return Sheet(TRIANGLES, STEPS, np.ones(N * N, bool) if free is None else free)


def farthest(at: np.ndarray, points: np.ndarray) -> float:
    return float(ClosestTree(at, TRIANGLES).distances(points, np.zeros(len(points), np.int64)).max())


def overhanging() -> np.ndarray:
    """Skin with a cavity that is wider inside than its opening, like a nostril."""
    wide = 1.0 + 1.2 * np.clip(CAVITY / 10.0, 0.0, 1.0)
    return FLAT * np.column_stack([wide, wide, wide]) - np.column_stack([0 * X, 0 * X, CAVITY])


@pytest.mark.parametrize("start", ["cavity", "overhanging", "lid over a pit"])
def test_skin_is_brought_to_what_it_does_not_reach(start: str) -> None:
    level = -8.0 * np.clip((7.0 - BEYOND) / 4.0, 0.0, 1.0) if start == "lid over a pit" else 0.0 * X
    skin = {"cavity": FLAT - np.column_stack([0 * X, 0 * X, CAVITY]), "overhanging": overhanging()}.get(start, FLAT)
    scan = np.column_stack([X, Y, level])
    off = np.abs(skin - scan).max(axis=1) > 0.5
    assert farthest(skin, scan) > 2.5
    made = cover(sheet(), skin, off, scan, UP)
    assert farthest(made, scan) < module.BARE_MM
    np.testing.assert_array_equal(made[BEYOND > 9.0], skin[BEYOND > 9.0])
    tri = made[TRIANGLES]
    turned = np.cross(tri[:, 1] - tri[:, 0], tri[:, 2] - tri[:, 0])[:, 2]
    assert turned.min() > -1e-9  # nothing is folded


def test_vertices_that_lie_on_the_scan_by_chance_do_not_hold_the_skin_back() -> None:
    skin = FLAT - np.column_stack([0 * X, 0 * X, CAVITY])
    off = CAVITY > 0.5
    off[AT[19:21, 19:21]] = False
    made = cover(sheet(), skin, off, FLAT, UP)
    assert np.abs(made[:, 2]).max() < 0.9


def test_skin_that_is_not_free_stays_and_skin_beside_a_place_too() -> None:
    skin = FLAT - np.column_stack([0 * X, 0 * X, CAVITY])
    assert cover(sheet(BEYOND > 8.0), skin, CAVITY > 0.5, FLAT, UP) is skin
    beside = FLAT[BEYOND < 3.0] + [0.0, 0.0, 40.0]  # nothing to do with the skin
    assert cover(sheet(), FLAT, np.ones(N * N, bool), beside, UP[: len(beside)]) is FLAT


def test_skin_that_would_come_hardly_nearer_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    skin = FLAT - np.column_stack([0 * X, 0 * X, CAVITY])
    monkeypatch.setattr(module, "LESS", 0.0)
    assert cover(sheet(), skin, CAVITY > 0.5, FLAT, UP) is skin


def test_places_of_few_samples_or_small_distances_are_none() -> None:
    assert bare_places(FLAT, TRIANGLES, FLAT + 0.9 * UP, UP) == []
    assert bare_places(FLAT, TRIANGLES, np.array([[0.0, 0.0, 3.0], [1.0, 0.0, 3.0]]), UP[:2]) == []
    two = np.concatenate([FLAT[np.hypot(X - d, Y) < 3.0] + [0, 0, h] for d, h in ((-10, 2.0), (10, 3.0))])
    places = bare_places(FLAT, TRIANGLES, two, UP[: len(two)])
    assert [round(float(p.points[:, 2].max())) for p in places] == [3, 2]  # the worst first


def test_heights_are_those_of_the_scan_along_the_places_direction() -> None:
    slope = np.array([0.3, 0.0, 1.0]) / np.hypot(0.3, 1.0)
    samples = FLAT[BEYOND < 8.0] * [1, 1, 0] + np.outer(-0.3 * FLAT[BEYOND < 8.0, 0], [0, 0, 1.0])
    place = module.Bare(samples, np.tile(slope, (len(samples), 1)))
    np.testing.assert_allclose(place.direction(), slope)
    at = samples[::7] - 4.0 * slope
    np.testing.assert_allclose(heights_above(at, place), 4.0, atol=1e-6)
    assert np.isnan(heights_above(np.array([[15.0, 0.0, 0.0]]), place)).all()
    assert np.isnan(heights_above(samples[:3] - 20.0 * slope, place)).all()
