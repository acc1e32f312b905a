"""Neighbouring teeth touch."""

from pathlib import Path

import numpy as np
import pytest

from surface.fit.features import tooth_rows
from surface.fit.features.tooth_rows import close_gaps, row_gaps, row_order, tooth_samples
from surface.head import Head

HEAD = Path(__file__).parents[4] / "configs/heads/ict"
CONTACT_MM = 0.05  # gaps of less are a dark line in every picture


def egg(x: float, z: float, *, taper: float = 0.0) -> np.ndarray:
    """Samples of a crown 8 mm wide and 10 mm high, which the gum above makes narrower."""
    a, b = np.meshgrid(np.linspace(0.0, np.pi, 41), np.linspace(0.0, 2.0 * np.pi, 61), indexing="ij")
    p = np.stack([4.0 * np.sin(a) * np.cos(b), 5.0 * np.cos(a), 3.0 * np.sin(a) * np.sin(b)], axis=-1).reshape(-1, 3)
    p[:, 0] *= 1.0 - taper * np.maximum(p[:, 1], 0.0) / 5.0
    return p + np.array([x, 0.0, z])


def test_gaps_are_closed_where_teeth_are_near_and_stay_where_one_is_missing() -> None:
    row = [egg(-9.0, 60.0), egg(0.0, 61.0), egg(9.0, 60.0), egg(30.0, 52.0)]
    new = close_gaps(row, row, upper=True)
    assert row_gaps(row) == pytest.approx([1.0, 1.0, 14.7], abs=0.3)
    near, other, missing = row_gaps(new)
    assert -0.6 < near < 0.0 and -0.6 < other < 0.0, "they touch, and hardly lie in each other"
    assert missing > 13.0
    assert np.allclose(new[3][:, 0].max(), row[3][:, 0].max()), "the last one has no neighbour on its other side"
    for one, before in zip(new, row, strict=True):
        assert np.array_equal(one[:, 1], before[:, 1]), "heights stay"


def test_the_order_of_the_pieces_does_not_matter() -> None:
    row = [egg(9.0, 60.0), egg(-9.0, 60.0), egg(0.0, 61.0)]
    assert row_order(row).tolist() == [1, 2, 0]
    straight = close_gaps([row[k] for k in (1, 2, 0)], [row[k] for k in (1, 2, 0)], upper=True)
    for one, other in zip(close_gaps(row, row, upper=True), [straight[k] for k in (2, 0, 1)], strict=True):
        assert np.allclose(one, other)


def test_triangles_at_the_gum_become_narrower_and_the_edges_stay_round(monkeypatch: pytest.MonkeyPatch) -> None:
    row = [egg(-4.6, 60.0, taper=0.5), egg(4.6, 60.0, taper=0.5)]

    def apart(teeth: list[np.ndarray], height: float) -> float:
        left, right = (t[np.abs(t[:, 1] - height) < 0.5] for t in teeth)
        return float(right[:, 0].min() - left[:, 0].max())

    filled = close_gaps(row, row, upper=True)
    monkeypatch.setattr(tooth_rows, "FILLED", 0.0)
    only_touching = close_gaps(row, row, upper=True)
    assert apart(filled, 2.0) < apart(only_touching, 2.0) - 0.3
    assert apart(filled, -3.0) == pytest.approx(apart(only_touching, -3.0), abs=0.1)


@pytest.mark.parametrize("name", ["teeth_upper", "teeth_lower"])
def test_neighbouring_teeth_of_the_shipped_head_touch(name: str) -> None:
    part = next(part for part in Head.load(HEAD).data.parts if part.name == name)
    samples = tooth_samples(Head.load(HEAD).part(name).surface, part.loops)
    row = [samples[k] for k in row_order(samples)]
    gaps = row_gaps(row)
    assert len(row) == 16
    assert gaps.max() < CONTACT_MM
    assert gaps.min() > -1.0, "teeth lie beside each other, not in each other"
