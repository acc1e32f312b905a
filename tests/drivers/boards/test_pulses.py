"""drivers.boards.pulses: what a board says of a pulse counts only where the pulse can be."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.boards.pulses import PulseTrack


def track(seen: float, *goals: float) -> PulseTrack:
    out = PulseTrack(1)
    out.begin(np.array([seen]))
    for goal in goals:
        out.go(np.array([goal]))
    return out


@pytest.mark.parametrize(
    ("seen", "goals", "said", "believed"),
    [
        (1500, (1600,), 1550, True),
        (1500, (1600,), 1602, True),  # the board's own rounding
        (1500, (1600,), 1610, False),
        (1500, (1600,), 1490, False),
        (1500, (1600, 1400), 1590, True),  # it may have got that far before it turned
        (1500, (np.nan,), 1500, True),
        (1500, (1600,), 0, True),  # off is always possible
        (np.nan, (1600,), 1600, True),
        (np.nan, (1600,), 1500, False),
        (np.nan, (), 1500, False),
    ],
)
def test_a_pulse_lies_between_what_was_seen_and_told(
    seen: float, goals: tuple[float, ...], said: float, believed: bool
) -> None:
    assert track(seen, *goals).believes(0, said, 2.0) is believed


def test_arrived_the_past_no_longer_counts() -> None:
    pulses = track(1500, 1600)
    assert pulses.believes(0, 1599.0, 2.0)
    assert not pulses.believes(0, 1550.0, 2.0)
    pulses.go(np.array([1700.0]))
    assert pulses.believes(0, 1650.0, 2.0)
