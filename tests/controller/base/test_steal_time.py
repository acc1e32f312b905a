"""controller.base.steal_time"""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from controller.base import steal_time
from controller.base.steal_time import StealTime, steal_time_s

TICK_S = 1 / os.sysconf("SC_CLK_TCK")


def told(tmp_path: Path, ticks: int) -> Path:
    """A file as proc(5) describes it: the steal time is the eighth of the numbers."""
    path = tmp_path / "stat"
    path.write_text(f"cpu  1 2 3 4 5 6 7 {ticks} 9 10\ncpu0 1 2 3 4 5 6 7 8 9 10\n", encoding="ascii")
    return path


def test_the_share_is_of_all_processors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(steal_time, "STAT", told(tmp_path, 1000))
    monkeypatch.setattr(os, "cpu_count", lambda: 4)
    now = iter([10.0, 12.0])
    monkeypatch.setattr(time, "monotonic", lambda: next(now))
    counted = StealTime()
    told(tmp_path, 1000 + round(0.8 / TICK_S))
    assert counted.fraction() == pytest.approx(0.8 / 2.0 / 4)


@pytest.mark.parametrize("text", ["", "cpu 1 2 3\n", "cpu a b c d e f g h\n"])
def test_a_system_that_does_not_tell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    path = tmp_path / "stat"
    monkeypatch.setattr(steal_time, "STAT", path)
    assert steal_time_s() is None
    path.write_text(text, encoding="ascii")
    assert steal_time_s() is None
    assert StealTime().fraction() is None


def test_a_report_that_comes_or_goes_while_it_is_measured_is_no_share(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = told(tmp_path, 1000)
    monkeypatch.setattr(steal_time, "STAT", path)
    counted = StealTime()
    path.unlink()
    assert counted.fraction() is None
    counted = StealTime()
    told(tmp_path, 1000)
    assert counted.fraction() is None


def test_a_short_time_has_a_share_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(steal_time, "STAT", told(tmp_path, 1000))
    monkeypatch.setattr(os, "cpu_count", lambda: None)  # not known: as one
    now = iter([10.0, 10.5])
    monkeypatch.setattr(time, "monotonic", lambda: next(now))
    counted = StealTime()
    told(tmp_path, 1000 + round(0.25 / TICK_S))
    assert counted.fraction() == pytest.approx(0.5)


def test_no_time_has_no_share(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(steal_time, "STAT", told(tmp_path, 1000))
    monkeypatch.setattr(time, "monotonic", lambda: 5.0)
    assert StealTime().fraction() is None
