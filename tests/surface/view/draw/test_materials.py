"""surface.view.draw.materials"""

from __future__ import annotations

import numpy as np
import pytest
from ball_head import skin

from surface.view.draw.materials import MATERIALS, attribute, detail_uv, of, strip_uv
from surface.view.scene.openings import Openings
from surface.view.scene.theme import THEMES


def test_skin_is_drawn_before_what_it_hides() -> None:
    assert of("skin").order < of("eye").order < of("teeth").order < of("mouth").order


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


def test_detail_is_even_in_millimetres_and_closes_behind_the_head() -> None:
    part = skin()
    uv = detail_uv(part)
    front = np.argmin(np.linalg.norm(part.rest - [0, 10, 90], axis=1))
    near = np.flatnonzero(np.linalg.norm(part.rest - part.rest[front], axis=1) < 12)
    moved = np.linalg.norm(part.rest[near] - part.rest[front], axis=1)
    scale = np.linalg.norm(uv[near] - uv[front], axis=1)[moved > 3] / moved[moved > 3]
    assert scale.max() / scale.min() < 1.3
    back = uv[part.rest[:, 2] < -0.9 * part.rest[:, 2].max()]
    assert np.ptp(back[:, 0]) == pytest.approx(round(np.ptp(back[:, 0])), abs=1e-6)


def test_strips_of_hair_are_told_apart_by_their_tiles() -> None:
    part = skin()
    part.uv[:4] = [(0.0, 0.2), (1.0, 0.5), (2.25, 1.0), (7.0, 0.0)]
    assert strip_uv(part)[:4] == pytest.approx(np.array([(0.0, 0.2), (1.0, 0.5), (0.25, 1.0), (1.0, 0.0)]))
