"""Assertions about a record of a board: which channel, when, and what."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from drivers.testing import boardchecks
from drivers.testing.records import Output, Step, Write


def record(*writes: Write, steps: tuple[Step, ...] = ()) -> Any:
    return SimpleNamespace(writes=list(writes), steps=list(steps), board="the board")


WRITES = (
    Write(0.5, 1, "target_us", 1000.0),
    Write(0.75, 1, "target_us", None),
    Write(1.25, 2, "target_us", 2000.5),
    Write(1.5, 2, "target_us", 2000.0),
)


@pytest.mark.parametrize(
    ("limits", "faults"),
    [
        ((1000.0, 2000.5), []),
        ((1001, 2000), [
            "channel 1 got target_us = 1000 at 0.500 s; its limits are 1001 to 2000",
            "channel 2 got target_us = 2000.5 at 1.250 s; its limits are 1001 to 2000",
        ]),
        ({2: (0, 2000)}, ["channel 2 got target_us = 2000.5 at 1.250 s; its limits are 0 to 2000"]),
        ({1: (1000, 1000)}, []),
    ],
)  # fmt: skip
def test_targets_beyond_limits_are_named_and_off_is_none(limits: Any, faults: list[str]) -> None:
    assert boardchecks.beyond_limits(record(*WRITES), limits) == faults


def test_without_limits_every_target_counts() -> None:
    assert len(boardchecks.beyond_limits(record(*WRITES), None)) == 3


def test_outputs_that_are_on_are_named_with_their_last_write(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def outputs(board: Any, now_s: float) -> list[Output]:
        asked.append((board, now_s))
        return [
            Output(1, "target_us", None, None),
            Output(2, "target_us", 2000.0, 1900.0),
            Output(3, "value", 0.0, 0.0),
        ]

    monkeypatch.setattr(boardchecks, "outputs", outputs)
    assert boardchecks.still_on(record(*WRITES), 2.0) == [
        "channel 2 is still on with target_us = 2000, since 1.500 s",
        "channel 3 is still on with value = 0",
    ]
    assert asked == [("the board", 2.0)]


def test_only_changes_by_more_than_is_allowed_are_jumps() -> None:
    write = WRITES[2]
    steps = tuple(Step(write, *ends) for ends in ((1500, 1600), (1600, 1499.5), (None, 900), (900, None), (1500, 1400)))
    assert boardchecks.jumps(record(steps=steps), 100) == ["channel 2 went from 1600 to 1499.5 at once at 1.250 s"]
    assert len(boardchecks.jumps(record(steps=steps), 99.9)) == 3
