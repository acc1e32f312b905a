"""What is seen of eyes and skin from near: lamps in eyes that look down, and the shape of freckles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import ndimage

from surface.head import Head
from surface.head.model.look import Look
from surface.view import Camera, Offscreen

EYE = Camera.around(0, 0, distance=950, target=(32, 32, 70), fov_deg=2.2)
CHEEK = Camera.around(0, 0, distance=950, target=(25, 0, 75), fov_deg=3)
LEAST = 60  # pixels of a freckle whose shape is looked at


@pytest.fixture(scope="module")
def head(root: Path) -> Head:
    return Head.load(root / "configs" / "heads" / "ict")


@pytest.mark.parametrize("quality", ["full", "fast"])
def test_eyes_that_look_down_still_mirror_the_lamps(gl: None, head: Head, quality: str) -> None:
    """The panes of two windows, which are nearly white, hardly shrink."""
    bright = []
    with Offscreen(head, (320, 240), quality=quality) as screen:
        for amount in (0.0, 0.5, 0.8):
            picture = screen.render(head.values({"eyeLookDownLeft": amount, "eyeLookDownRight": amount}), EYE)
            bright.append(int((picture.min(axis=2) > 200).sum()))
    assert bright[0] > 60 and min(bright[1:]) > 0.5 * bright[0], bright


def test_freckles_are_spots_and_no_splinters(gl: None, root: Path) -> None:
    """The area of most is that of a disk with their border, counted in pixels; splinters have less."""
    pictures = []
    for freckles in (0.0, 0.9):
        freckled = Head.load(root / "configs" / "heads" / "ict", look=Look(freckles=freckles))
        with Offscreen(freckled, (900, 700)) as screen:
            pictures.append(screen.render(freckled.values({}), CHEEK).mean(axis=2))
    darker = pictures[0] - pictures[1]
    spots, count = ndimage.label(darker > 0.5 * np.percentile(darker[darker > 2], 90))
    round_ = []
    for k in range(1, count + 1):
        spot = spots == k
        if spot.sum() >= LEAST:
            border = (spot & ~ndimage.binary_erosion(spot)).sum()
            round_.append(4 * np.pi * spot.sum() / border**2)
    assert len(round_) > 30 and np.median(round_) > 1.04
