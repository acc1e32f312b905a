"""Skin shows where hair is parted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from surface.head import Head
from surface.head.model.look import Look, Worn
from surface.view import Camera, Offscreen

DARK = (0.02, 0.015, 0.012)
ABOVE = Camera.around(15.0, 35.0, distance=950.0, target=(0.0, 90.0, 40.0), fov_deg=12.0)


@pytest.mark.parametrize("quality", ["full", "fast"])
def test_a_parting_is_a_narrow_line_of_skin(root: Path, gl: None, quality: str) -> None:
    look = Look(worn=(Worn(root / "configs/wardrobe/hair-long.npz", DARK),))
    head = Head.load(root / "configs/heads/ict", look=look)
    pictures = []
    for bare in (True, False):
        if not bare:  # as dark as the hair
            head.part("tresses").attributes["scalp"] = np.ones((1, 3), np.float32)
        with Offscreen(head, (400, 400), quality=quality) as screen:
            pictures.append(screen.render(head.values({}), ABOVE).astype(int))
    shown, hidden = pictures
    brighter = (shown - hidden)[..., :3].sum(axis=-1)
    line = brighter > 60
    assert 60 < line.sum() < 0.01 * line.size
    rows = np.flatnonzero(line.any(axis=1))
    assert np.ptp(rows) > 60 and line.sum() / len(rows) < 8  # long and narrow
    red, _, blue = shown[line].mean(axis=0)[:3]
    assert red > 1.1 * blue
    assert brighter.min() > -20
