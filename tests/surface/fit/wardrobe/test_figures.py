"""Garments of a head of smooth forms have the figures they had when they were last looked at."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.surface.fit.wardrobe.figures import NAMES, figures

KNOWN = json.loads(Path(__file__).with_name("figures.json").read_text())


@pytest.mark.parametrize("name", NAMES)
def test_a_garment_has_its_figures(name: str) -> None:
    """A thousandth of a column's spread is more than another processor's rounding makes and less than a change."""
    found, wanted = figures(name), KNOWN[name]
    assert found.keys() == wanted.keys()
    for key, (shape, mean, spread, most) in wanted.items():
        assert found[key][0] == shape, key
        least = np.maximum(1e-3 * np.array(spread), 1e-5)
        for own, known in zip(found[key][1:], (mean, spread, most), strict=True):
            assert (np.abs(np.subtract(own, known)) <= least).all(), (key, own, known)


def test_every_garment_has_figures() -> None:
    assert KNOWN.keys() == set(NAMES)
