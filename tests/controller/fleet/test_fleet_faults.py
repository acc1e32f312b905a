"""benchmarks/fleet_faults.py: what it judges is found in rows that were made to have it, and in no others."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("zenoh", reason="pip install 'omote[zenoh]'")

from controller.base.parameters import PARAMETERS as P

sys.path.insert(0, str(Path(__file__).parents[3] / "benchmarks"))
from fleet_faults import (
    IN_STEP_S,
    PLACES,
    RECORD,
    judged_events,
    lives,
    mark_spreads,
    out_of_step,
    over_limits,
    steps_back,
    why_late,
)

TICK_S = 0.01
JAW = P.index("jawOpen")


def rows_of(place: int, values: np.ndarray, *, fence: int = 1, begin: int = 1) -> np.ndarray:
    """Ticks of one head that shows a conductor's faces, whose jaw is open by ``values`` : (k,)."""
    rows = np.zeros(len(values), RECORD)
    numbers = begin + np.arange(len(values))
    rows["place"], rows["head"] = place, place
    rows["conducted"], rows["exact"], rows["fence"] = True, True, fence
    rows["sequence"], rows["mixed_ns"] = numbers, 10_000_000 * numbers
    rows["shown_ns"], rows["passed_s"] = 10_000_000 * numbers + 80_000_000, TICK_S * numbers
    rows["values"][:, JAW] = values
    return rows


def ramp(speed: float, count: int = 60) -> np.ndarray:
    """The jaw's values at a constant speed after a start and before a stop, both soft."""
    bell = np.convolve(np.ones(count - 30), np.hanning(31) / np.hanning(31).sum())
    return np.cumsum(speed * bell) * TICK_S


def test_motion_at_its_limits_is_no_fault_and_beyond_them_it_is() -> None:
    at_limit = rows_of(0, ramp(0.99 * P.max_speed[JAW], 80))
    speed, acceleration = over_limits(at_limit)
    assert 0.9 < speed < 1.0 and acceleration < 1.0
    over = at_limit.copy()
    over["values"][45:, JAW] += 0.2
    speed, acceleration = over_limits(over)
    assert speed > 1.05 and acceleration > 1.05


def test_a_head_that_stands_at_once_where_a_face_is_late_passes_a_limit() -> None:
    late = rows_of(0, ramp(0.9 * P.max_speed[JAW]))
    late[30:32] = late[29]
    late["passed_s"] = TICK_S * np.arange(len(late))
    speed, acceleration = over_limits(late)
    assert speed > 1.05 and acceleration > 1.05


def test_ticks_of_a_head_are_as_long_as_those_of_its_conductor_but_for_five_ms() -> None:
    near = rows_of(0, ramp(0.99 * P.max_speed[JAW], 80))
    near["passed_s"] += 1e-3 * (np.arange(len(near)) % 2)  # 9 and 11 ms, of faces that are 10 ms apart
    assert max(over_limits(near)) < 1.0
    near["conducted"] = False
    assert over_limits(near)[0] > 1.05
    missed = np.delete(rows_of(0, ramp(0.9 * P.max_speed[JAW])), [30])  # two of its ticks in one
    missed["passed_s"] = TICK_S * np.arange(len(missed))
    assert over_limits(missed)[0] > 1.05


def test_a_start_cuts_the_life_of_a_head() -> None:
    rows = np.concatenate([rows_of(0, np.zeros(20)), rows_of(1, np.zeros(9)), rows_of(0, np.ones(30))])
    assert [len(life) for life in lives(rows[rows["place"] == 0])] == [20, 30]


def test_who_obeys_a_replaced_conductor_again_is_found() -> None:
    first, second, again = (rows_of(0, np.zeros(5), fence=k, begin=b) for k, b in ((1, 1), (2, 6), (1, 11)))
    assert steps_back(np.concatenate([first, second])) == 0
    assert steps_back(np.concatenate([first, second, again])) == 1
    again["fence"], again["holder"], second["holder"] = 2, 3, 4  # as high a number, of another one
    assert steps_back(np.concatenate([first, second, again])) == 1


def test_who_does_not_join_the_newest_conductor_in_time_is_found() -> None:
    ticks = round(IN_STEP_S / TICK_S)
    joins = rows_of(0, np.zeros(ticks), fence=2)
    stays = rows_of(1, np.zeros(ticks), fence=1)
    blends = rows_of(2, np.zeros(ticks), fence=2)
    blends["exact"] = False
    rows = np.concatenate([joins, stays, blends])
    assert out_of_step(rows, 0) == {1, 2}
    blends["exact"][-20] = True
    assert out_of_step(np.concatenate([joins, blends]), 0) == set()


def test_the_spread_of_a_face_is_from_the_first_head_to_the_last() -> None:
    rows = np.concatenate([rows_of(place, np.zeros(10)) for place in range(len(PLACES))])
    assert mark_spreads(rows).max() == 0.0
    rows["shown_ns"][rows["place"] == 2] += 3_000_000
    np.testing.assert_allclose(mark_spreads(rows), 3.0)
    assert not len(mark_spreads(rows[rows["place"] != 1]))


def test_what_a_late_head_waited_for_is_said() -> None:
    blends = rows_of(2, np.zeros(300), fence=2)
    blends["exact"] = False
    blends["exact"][250:] = True
    blends["fence"][:30] = 1
    blends["shown_ns"][100:] += 90_000_000
    process, head = PLACES[2]
    assert why_late(blends, 80_000_000, 2) == (
        f"{head} in {process}: a face of the newest conductor after 0.31 s, exactly that after 2.60 s; "
        "its longest tick 100 ms"
    )
    never = "a face of the newest conductor after 0.01 s, exactly that after more than 4 s"
    assert never in why_late(blends[30:200], 380_000_000, 2)


def test_only_events_are_judged_that_leave_time_to_join_and_a_router() -> None:
    seconds = 10**9
    events = [(0, "kill one"), (seconds, "start one"), (4 * seconds, "kill router"), (7 * seconds, "start router")]
    assert judged_events(events, 10 * seconds) == [events[1], events[3]]
    assert judged_events(events, 8 * seconds) == [events[1]]
