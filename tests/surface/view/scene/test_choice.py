"""surface.view.scene.choice"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from surface.view.scene.choice import (
    DISSOLVE_S,
    FRAMES,
    HOLD_S,
    LEVELS,
    PATIENCE_S,
    STUTTER_FRAMES,
    QualityChoice,
)

RATE_HZ = 60.0


class Machine:
    """A renderer by a clock of its own: a frame of each quality takes so long (s), and no frame comes before its
    time. ``blink_s`` : the face moves quickly so often; between that slowly."""

    def __init__(self, full: float, fast: float, blink_s: float = 1.5) -> None:
        self.cost, self.blink_s = {"full": full, "fast": fast}, blink_s
        self.choice, self.now_s = QualityChoice(RATE_HZ), 0.0
        self.frames: list[tuple[float, str, float]] = []

    def run(self, seconds: float, *, moving: bool = True) -> list[str]:
        """The quality after each frame."""
        first, end = len(self.frames), self.now_s + seconds
        while self.now_s < end:
            blinks = self.now_s % self.blink_s < 0.1
            values = np.array([self.now_s % self.blink_s * 9.0 if blinks else 0.01 * np.sin(self.now_s)]) * moving
            cost = sum(self.cost[quality] for quality in self.choice.begin(values, self.now_s))
            self.choice.end(cost)
            self.frames.append((self.now_s, self.choice.level, self.choice.share))
            self.now_s += max(cost, 1.0 / RATE_HZ)
        return [level for _, level, _ in self.frames[first:]]

    def run_until(self, level: str) -> None:
        for _ in range(400):
            if self.run(0.5)[-1] == level:
                return
        raise AssertionError(f"{level} did not come")


def test_full_stays_where_it_is_in_time() -> None:
    machine = Machine(full=0.012, fast=0.005)
    assert set(machine.run(60.0)) == {"full"}
    assert machine.choice.switches == 0
    assert machine.choice.seconds["full"] == pytest.approx(60.0, abs=0.1) and machine.choice.seconds["fast"] == 0.0


def test_fast_holds_the_rate_where_full_is_late_and_does_not_swing() -> None:
    machine = Machine(full=0.024, fast=0.011)
    levels = machine.run(120.0)
    assert levels[0] == "full" and levels[-1] == "fast" and machine.choice.switches == 1
    assert sum(machine.choice.seconds.values()) == pytest.approx(120.0, abs=0.1)
    late = [b[0] - a[0] for a, b in pairwise(machine.frames) if a[0] > 10.0]
    assert max(late) == pytest.approx(1.0 / RATE_HZ)


def test_full_comes_back_when_the_machine_is_free_again() -> None:
    machine = Machine(full=0.024, fast=0.011)
    machine.run(10.0)
    machine.cost = {"full": 0.010, "fast": 0.0045}
    assert machine.run(2 * HOLD_S)[-1] == "full" and machine.choice.switches == 2


def test_returns_that_fail_become_rarer() -> None:
    """ "fast" promises more than "full" holds: each try waits twice as long as the one before."""
    machine = Machine(full=0.030, fast=0.011)
    machine.run(20.0)
    tries = []
    for _ in range(3):
        machine.cost["fast"] = 0.002  # load goes away: full looks possible
        machine.run_until("full")
        tries.append(machine.now_s)
        machine.cost["fast"] = 0.011
        machine.run_until("fast")
    waits = np.diff(tries)
    assert (waits[1:] > 1.5 * waits[:-1]).all()


def test_a_change_waits_for_a_quick_movement_but_not_for_ever() -> None:
    machine = Machine(full=0.024, fast=0.011, blink_s=2.3)
    machine.run(8.0)
    at = next(time for time, level, _ in machine.frames if level == "fast")
    assert at % 2.3 < 0.15, "it began within the blink"
    calm = Machine(full=0.024, fast=0.011, blink_s=1000.0)
    calm.run(8.0)
    at = next(time for time, level, _ in calm.frames if level == "fast")
    assert PATIENCE_S < at < PATIENCE_S + 2.0


def test_it_dissolves_in_even_steps() -> None:
    machine = Machine(full=0.024, fast=0.011)
    machine.run(10.0)
    shares = [share for _, level, share in machine.frames if level == "fast"]
    steps = np.diff([share for share in shares if share < 1.0])
    assert shares[0] == 1.0 / FRAMES and steps == pytest.approx((0.024 + 0.011) / DISSOLVE_S)
    assert set(shares[len(steps) + 1 :]) == {1.0}


def test_a_dissolve_lasts_no_longer_where_frames_are_slow() -> None:
    machine = Machine(full=0.060, fast=0.040)
    machine.run(4.0)
    times = [at for at, level, share in machine.frames if level == "fast" and share < 1.0]
    assert times[-1] - times[0] < DISSOLVE_S


def test_pictures_that_stutter_are_left_at_once() -> None:
    machine = Machine(full=0.060, fast=0.020, blink_s=1000.0)
    machine.run(4.0)
    at = next(time for time, level, _ in machine.frames if level == "fast")
    assert at < (STUTTER_FRAMES + 3) * 0.060 and machine.choice.switches == 1


def test_a_picture_whose_pixels_are_filled_on_other_threads_is_known_to_stutter_by_its_frames() -> None:
    choice, now_s = QualityChoice(RATE_HZ), 0.0
    for k in range(STUTTER_FRAMES + 2):
        choice.begin(np.array([0.01 * k]), now_s)
        choice.end(0.012)  # in time, but the next frame comes late
        now_s += 0.040
    assert choice.level == "fast"


@pytest.mark.parametrize(("drawing_s", "switches"), [(0.004, 0), (0.009, 2)])
def test_a_slow_screen_is_no_reason_to_draw_less(drawing_s: float, switches: int) -> None:
    """Where drawing might be to blame, "fast" is tried once."""
    choice, now_s = QualityChoice(RATE_HZ), 0.0
    for k in range(900):
        choice.begin(np.array([0.01 * k]), now_s)
        choice.end(drawing_s)
        now_s += 1.0 / 30.0
    assert (choice.level, choice.switches) == ("full", switches)
    assert choice.seconds["fast"] < 1.0


def test_stutters_with_pauses_between_them_are_no_stutters_in_a_row() -> None:
    choice, now_s, x = QualityChoice(RATE_HZ), 0.0, 0.0
    for _ in range(2 * STUTTER_FRAMES):
        for moves in (True, *[False] * 30):
            now_s, x = now_s + (0.05 if moves else 1.0 / RATE_HZ), x + 0.01 * moves
            choice.begin(np.array([x]), now_s)
            choice.end(0.010)
    assert choice.level == "full" and choice.switches == 0


def test_a_face_at_rest_changes_nothing() -> None:
    machine = Machine(full=0.024, fast=0.011)
    assert set(machine.run(20.0, moving=False)) == {"full"}


def test_both_are_drawn_while_it_dissolves() -> None:
    choice = QualityChoice(RATE_HZ)
    assert choice.drawn == ("full",) and choice.other == "fast"
    choice.level, choice.share = "fast", 0.5
    assert choice.drawn == LEVELS
