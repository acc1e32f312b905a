"""surface.view.materials"""

from __future__ import annotations

import numpy as np
import pytest
from ball_head import skin

from surface.view.materials import MATERIALS, attribute, of, order
from surface.view.openings import Openings
from surface.view.theme import THEMES


def test_skin_is_drawn_before_what_it_hides() -> None:
    assert order("skin") < order("eye") < order("teeth") < order("mouth")


def test_an_unknown_material_draws_as_skin() -> None:
    assert of("velvet") is MATERIALS["skin"]


def test_painted_albedo_and_occlusion_are_packed() -> None:
    part = skin()
    count = len(part.rest)
    part.attributes = {"albedo": np.full((count, 3), 0.25, np.float32), "occlusion": np.full((count, 1), 0.5)}
    packed = of("skin").static(part, THEMES["skin"], Openings([part]))["albedo_occlusion"]
    assert packed.dtype == np.uint8
    assert packed[0] / 255.0 == pytest.approx([0.5, 0.5, 0.5, 0.5], abs=0.003)
    bare = of("skin").static(part, THEMES["mask"], Openings([part]))["albedo_occlusion"]
    assert (bare[0, :3] / 255.0) ** 2 == pytest.approx(THEMES["mask"].albedo, abs=0.006)


def test_missing_attributes_have_defaults() -> None:
    part = skin()
    assert attribute(part, "gloss", (0.3,)) == pytest.approx(np.full((len(part.rest), 1), 0.3))
    assert (of("skin").static(part, THEMES["skin"], Openings([part]))["albedo_occlusion"][:, 3] == 255).all()
