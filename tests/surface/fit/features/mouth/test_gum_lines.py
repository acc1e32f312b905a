"""Gums are laid over the inner sides of lower teeth, and the outer ones of upper teeth, up to their necks."""

from __future__ import annotations

import numpy as np
import pytest

from surface.dcp import DCPSurface
from surface.fit.features.mouth.gum_lines import LOWER_INNER, UPPER_OUTER, Side, laid_to_necks

TEETH, ARCH_MM, TIP_MM = 14, 30.0, -30.0
HALF_MM, HIGH_MM = 4.2, 16.0  # of a tooth: half its width and thickness, its height


def tooth(angle: float) -> np.ndarray:
    """Samples (s, 3) of a round tooth, upright on the arch."""
    turn, height = (a.ravel() for a in np.meshgrid(np.linspace(0, 2 * np.pi, 48), np.linspace(0.0, HIGH_MM, 40)))
    ring = np.column_stack([HALF_MM * np.cos(turn), TIP_MM - height, HALF_MM * np.sin(turn)])
    return ring + ARCH_MM * np.array([np.sin(angle), 0.0, np.cos(angle)])


ANGLES = np.linspace(-1.35, 1.35, TEETH)


def low_gum(side: Side, along: int = 90, across: int = 14) -> DCPSurface:
    """A strip over the arch: from its middle, low between the teeth, along the roots; tips are up."""
    turn = np.linspace(-1.5, 1.5, along)
    away = np.linspace(0.0, 3.4, across) * (1.0 if side.outer else -1.0)
    y = np.linspace(TIP_MM - side.papilla_mm - 2.5, TIP_MM - side.papilla_mm - 13.0, across)
    reach = ARCH_MM + away
    points = np.stack(
        [np.sin(turn)[:, None] * reach, np.broadcast_to(y, (along, across)), np.cos(turn)[:, None] * reach], axis=2
    )
    knots = [np.pad(np.linspace(0.0, 1.0, n - 2), 3, mode="edge") for n in (along, across)]
    return DCPSurface.from_nurbs(3, 3, *knots, points * upright(side), np.ones((along, across)))


def upright(side: Side) -> np.ndarray:
    return np.array([1.0, -1.0 if side.upper else 1.0, 1.0])


@pytest.fixture(scope="module", params=[LOWER_INNER, UPPER_OUTER], ids=["lower, inside", "upper, outside"])
def strips(request: pytest.FixtureRequest) -> tuple[np.ndarray, np.ndarray, Side]:
    """The gum before and after, each (angle, across, 3), tips up; and the side."""
    side = request.param
    surface, rows = low_gum(side), [tooth(a) * upright(side) for a in ANGLES]
    uv = np.stack(np.meshgrid(np.linspace(0, 1, 400), np.linspace(0, 1, 60), indexing="ij"), axis=-1)
    points = laid_to_necks(surface.points, surface, uv.reshape(-1, 2), rows, side)
    basis = surface.basis_matrix(uv.reshape(-1, 2))
    before, after = ((basis @ p).reshape(400, 60, 3) * upright(side) for p in (surface.points, points))
    return before, after, side


def away(at: np.ndarray, angle: float, side: Side) -> tuple[np.ndarray, np.ndarray]:
    """How far from the arch's middle towards the side, and how far below the tips, the gum lies at an angle."""
    turn = np.arctan2(at[..., 0], at[..., 2])
    column = at[np.abs(turn - angle).argmin(axis=0), np.arange(at.shape[1])]
    out = np.hypot(column[:, 0], column[:, 2]) - ARCH_MM
    return (out if side.outer else -out), TIP_MM - column[:, 1]


@pytest.mark.parametrize("k", [3, 6, 10])
def test_roots_are_covered_and_crowns_are_free(strips: tuple[np.ndarray, np.ndarray, Side], k: int) -> None:
    before, after, side = strips
    (bare, _), (deep, low) = (away(at, ANGLES[k], side) for at in (before, after))
    assert bare.max() < HALF_MM, "before, all of the tooth stands free"
    assert (deep[(low > side.crown_mm[0] + 2.3) & (low < side.crown_mm[0] + 3.2)] > HALF_MM).all()
    assert (deep[low < side.crown_mm[0] - 1.0] < HALF_MM).all()


def test_between_teeth_the_gum_ends_higher(strips: tuple[np.ndarray, np.ndarray, Side]) -> None:
    before, after, side = strips
    low, high = (away(at, 0.5 * (ANGLES[5] + ANGLES[6]), side)[1].min() for at in (before, after))
    assert low > side.papilla_mm + 2.0
    assert high == pytest.approx(side.papilla_mm, abs=0.6)


def test_what_lies_far_below_the_necks_stays(strips: tuple[np.ndarray, np.ndarray, Side]) -> None:
    before, after, _ = strips
    assert np.abs(after[:, -2:] - before[:, -2:]).max() < 0.8
