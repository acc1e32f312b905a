"""Visemes as they are seen on the shipped head."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from face_measures import Window

from controller.base.parameters import PARAMETERS as P
from controller.face.still import for_head
from controller.stage.stage import find_persons, load_head
from controller.vocabulary.visemes import Visemes
from surface.head import Head
from surface.view import Camera, Offscreen

VISEMES = Visemes.load(P)
VIEWS = [
    Camera.around(yaw, 0, distance=950, target=(x, -45, z), fov_deg=5.5) for yaw, x, z in ((0, 0, 80), (38, 5, 75))
]
MOUTH = Window((-26.0, 26.0), (-80.0, -10.0), 0.25)


@pytest.fixture(scope="module")
def head(root: Path) -> Head:
    folder = root / "configs" / "heads" / "ict"
    return load_head(folder, {}, (), find_persons("maple", folder))


def values(head: Head, name: str) -> np.ndarray:
    return for_head(np.clip(P.rest + VISEMES.matrix @ VISEMES.weights(name), P.low, P.high), head.parameters)


@pytest.mark.slow
def test_every_pair_differs_from_the_front_and_from_the_side(gl: None, head: Head) -> None:
    """The share of the picture of a mouth that changes clearly, at least as between closed lips and pressed ones."""
    with Offscreen(head, (300, 220)) as screen:
        seen = {
            name: np.stack([screen.render(values(head, name), view) for view in VIEWS]).astype(int)
            for name in VISEMES.names
        }
    apart = {
        (one, other): (np.abs(seen[one] - seen[other]).max(axis=3) > 32).mean()
        for one, other in combinations(VISEMES.names, 2)
    }
    nearest = min(apart, key=lambda pair: apart[pair])
    assert apart[nearest] > 0.038, (nearest, apart[nearest])


def opening(head: Head, name: str) -> tuple[float, float, float]:
    """Width and height between the lips in mm, seen from the front, and the share of teeth in what is seen there."""
    head.pose(values(head, name))
    skin = MOUTH.depth(head.part("face"))
    teeth = MOUTH.depth(head.part("teeth_upper"), head.part("teeth_lower"))
    behind = MOUTH.depth(head.part("cavity"), head.part("tongue"))
    seen = np.maximum(teeth, behind) > skin
    rows, columns = np.nonzero(seen)
    share = float((seen & (teeth > behind)).sum() / seen.sum())
    return float(np.ptp(columns)) * MOUTH.step, float(np.ptp(rows)) * MOUTH.step, share


def test_rounded_vowels_show_hardly_any_teeth(head: Head) -> None:
    for name, most in (("O", 0.12), ("U", 0.03)):
        width, height, teeth = opening(head, name)
        assert teeth < most and height > 4.0 and width < 26.5, (name, width, height, teeth)


def test_teeth_stand_on_the_lip_for_f_and_lips_seal_for_p(head: Head) -> None:
    _, height, teeth = opening(head, "FF")
    assert 1.0 < height < 6.0 and teeth > 0.6
    head.pose(values(head, "PP"))
    skin = MOUTH.depth(head.part("face"))
    behind = MOUTH.depth(*(head.part(n) for n in ("teeth_upper", "teeth_lower", "cavity", "tongue")))
    assert ((behind > skin).sum(axis=0) * MOUTH.step).max() < 0.6
