"""Strips of lashes are cut into hairs that grow from the border next to the eye, where no texture draws them."""

from dataclasses import replace

import numpy as np
import pytest
from lash_strip import LONG, mesh, strip

from surface.fit.features.combs import HAIR_MM, combed
from surface.mesh.loops import inside
from surface.readers.meshdata import Material


@pytest.mark.parametrize("below", [True, False])
@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_hairs_grow_from_the_border_next_to_the_eye_and_stay_within_the_strip(below: bool, scale: float) -> None:
    part, eyes = strip(below)
    (loop,) = combed(part, *mesh(), eyes, scale).loops
    assert loop.min() >= 0.0 and loop.max() <= 1.0
    u = np.linspace(0.1, 0.9, 4001)
    root, tip = (0.04, 0.6) if below else (0.96, 0.4)
    whole, cut = (inside(_edges(loop), np.column_stack([u, np.full_like(u, v)])) for v in (root, tip))
    assert whole.all()
    hairs = int((np.diff(cut.astype(int)) == 1).sum()) + int(cut[0])
    assert hairs == pytest.approx(0.8 * LONG / (HAIR_MM * scale), rel=0.2) and 0.05 < cut.mean() < 0.5


def test_strips_whose_texture_draws_the_hairs_or_that_have_holes_stay() -> None:
    part, eyes = strip()
    assert combed(part, *mesh(Material("m", (1.0, 1.0, 1.0, 1.0), texture=b"png")), eyes, 1.0) is part
    assert combed(part, *mesh(Material("m", (0.1, 0.1, 0.1, 1.0))), eyes, 1.0) is not part
    holed = replace(part, loops=[*part.loops, 0.3 + 0.1 * part.loops[0]])
    assert combed(holed, *mesh(), eyes, 1.0) is holed


def _edges(loop: np.ndarray) -> np.ndarray:
    return np.hstack([loop, np.roll(loop, -1, axis=0)])
