"""What a breath moves, by place."""

import numpy as np
import pytest

from surface.head.model.data import Neck
from surface.head.model.sway import breath_moves

NECK = Neck((0.0, -55.0, -5.0))


def move(x: float, y: float, z: float) -> np.ndarray:
    return breath_moves(np.array([[x, y, z]]), NECK)[0]


def test_what_follows_the_head_stays():
    rng = np.random.default_rng(2)
    points = rng.uniform([-90, -60, -90], [90, 140, 130], (500, 3))
    head = points[NECK.share(points) == 1.0]
    assert len(head) > 300 and not breath_moves(head, NECK).any()


def test_the_chest_rises_and_comes_forwards_the_back_only_rises_and_shoulders_part():
    chest = move(0, -185, 70)
    assert chest == pytest.approx([0.0, 1.0, 1.0])
    back = move(0, -190, -90)
    assert 0.4 < back[1] < 0.8 and back[2] == 0.0
    left, right = move(110, -180, 0), move(-110, -180, 0)
    assert 0.2 < left[0] < 0.5 and right == pytest.approx(left * [-1, 1, 1])
    assert left[2] < chest[2]


def test_it_grows_down_the_neck_without_a_step():
    down = np.column_stack([np.zeros(400), np.linspace(-60, -180, 400), np.full(400, 30.0)])
    moves = breath_moves(down, NECK)
    assert not moves[0].any() and (np.diff(moves[:, 1]) >= 0).all() and moves[-1, 1] > 0.9
    assert np.abs(np.diff(moves, axis=0)).max() < 0.012  # for 0.3 mm
    assert moves[np.searchsorted(-down[:, 1], 110), 1] < 0.25  # the base of the neck a little


def test_a_head_without_a_bust_does_not_breathe():
    assert not breath_moves(np.array([[0.0, -60, 0], [0, 90, 40]]), NECK).any()
    assert breath_moves(np.zeros((0, 3)), NECK).shape == (0, 3)
