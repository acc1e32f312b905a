"""Saccades, micro-saccades and drift."""

from __future__ import annotations

import math

import numpy as np
import pytest

from controller.layers.idle.attention import Shift
from controller.layers.idle.draws import generator
from controller.layers.idle.eyes import Eyes
from controller.layers.idle.settings import IdleSettings


@pytest.fixture
def eyes(settings: IdleSettings) -> Eyes:
    found = Eyes(settings.eyes, generator(1, "eyes"))
    found.begin(0.0)
    return found


@pytest.mark.parametrize("size_deg", [2.0, 10.0, 20.0])
def test_saccades_are_on_the_main_sequence(eyes: Eyes, size_deg: float) -> None:
    assert eyes.look(Shift(1.0, size_deg * 0.6, size_deg * 0.8)) == pytest.approx(math.radians(size_deg))
    times = np.arange(0.9, 1.2, 0.0005)
    way = np.degrees(np.linalg.norm([eyes.direction(t) for t in times], axis=1))
    assert way[0] == 0.0 and way[-1] == pytest.approx(size_deg)
    moving = np.flatnonzero((way > 0.0) & (way < size_deg))
    assert (moving[-1] - moving[0]) * 0.0005 == pytest.approx(0.025 + 0.0024 * size_deg, abs=0.002)  # Lee et al. 2002
    peak = np.diff(way).max() / 0.0005
    assert peak == pytest.approx({2.0: 126.0, 10.0: 383.0, 20.0: 514.0}[size_deg], rel=0.03)  # deg/s; 500 at 20 deg


def test_micro_saccades_are_small_and_one_or_two_a_second(eyes: Eyes, settings: IdleSettings) -> None:
    times = np.arange(0.0, 300.0, 0.01)
    path = []
    for t in times:
        eyes.advance(t)
        path.append(eyes.fixational_offset(t))
    size = np.degrees(np.abs(path))
    assert 0.2 < size.max() <= settings.eyes.micro_deg + settings.eyes.drift_deg
    speed = np.degrees(np.linalg.norm(np.diff(path, axis=0), axis=1)) / 0.01
    begun = np.count_nonzero(np.diff((speed > 1.5).astype(int)) > 0) / 300
    assert 0.8 <= begun <= 2.0  # a second: Martinez-Conde et al. 2004
    assert 0.0 < np.median(speed) < 0.5  # drift, deg/s: Rolfs 2009
