"""Linings that a blink leaves where they are."""

from dataclasses import replace

import numpy as np
import pytest
from eye_face import CENTRES, RADIUS, face, with_sockets

from surface.fit.eyes.linings import linings

LINED = with_sockets(face())  # what goes on from the lids' edges does not move in a blink
SKIN = len(face().faces)
FIRST = ((LINED.faces >= 0) & (LINED.faces < len(face().vertices))).any(axis=1)  # skin, and a ring of either socket


@pytest.mark.parametrize(("side", "sign"), [("Left", 1.0), ("Right", -1.0)])
def test_what_stays_behind_in_a_blink_is_lining(side: str, sign: float) -> None:
    x = LINED.vertices[LINED.faces[:, 0], 0]
    gone = linings(LINED, FIRST, CENTRES[int(sign < 0)], RADIUS, side)
    ring = FIRST & (np.arange(len(FIRST)) >= SKIN) & (sign * x > 0)
    assert np.isin(gone, np.flatnonzero(ring)).sum() >= 0.8 * ring.sum()  # but at the corners, which hardly move
    assert (gone < SKIN).sum() <= 4 and (sign * x[gone] > 0).all()


def test_lids_whose_edges_move_furthest_have_no_lining() -> None:
    assert not len(linings(face(), np.ones(SKIN, bool), CENTRES[0], RADIUS, "Left"))


def test_without_a_blink_nothing_tells() -> None:
    still = replace(LINED, names=("jawOpen", "mouthLeft", "mouthRight"))
    assert not len(linings(still, FIRST, CENTRES[0], RADIUS, "Left"))
