"""The table of events, and markers of LSL by a stand-in for its package."""

from __future__ import annotations

import csv
import sys
import time
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from controller.base.errors import ControllerError
from controller.body.event_log import EventLog
from surface.base.errors import MissingPackage


def test_events_are_written_with_their_times(tmp_path: Path) -> None:
    events, now_ns = EventLog(tmp_path / "events.csv"), time.monotonic_ns()
    events.note(now_ns, "mark", "1:smile:begin")
    events.note(now_ns + 1_500_000_000, "line", 'PING "a", b')
    events.close()
    with (tmp_path / "events.csv").open(newline="") as file:
        first, second = csv.DictReader(file)
    assert (first["time_s"], first["event"], first["text"]) == ("0.000000", "mark", "1:smile:begin")
    assert (second["time_s"], second["text"]) == ("1.500000", 'PING "a", b')
    assert float(first["unix_s"]) == pytest.approx(time.time(), abs=60.0)
    assert float(second["unix_s"]) - float(first["unix_s"]) == pytest.approx(1.5, abs=0.5)


def test_a_folder_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(ControllerError, match="cannot be written"):
        EventLog(tmp_path / "none" / "events.csv")


def test_a_full_disk_is_reported_once_and_the_show_goes_on() -> None:
    failed: list[Exception] = []
    events = EventLog(Path("/dev/full"), failed=failed.append)
    for k in range(3):
        events.note(time.monotonic_ns(), "line", f"SET jawOpen 0.{k}")
        time.sleep(0.25)
    events.close()
    assert [str(error) for error in failed] == ["[Errno 28] No space left on device: '/dev/full'"]


def test_marks_are_markers_of_lsl_and_lines_are_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pushed: list[Any] = []
    pylsl: Any = ModuleType("pylsl")
    pylsl.__spec__ = ModuleSpec("pylsl", None)
    pylsl.StreamInfo = lambda *given: given
    pylsl.StreamOutlet = lambda info: (
        pushed.append(info) or type("Outlet", (), {"push_sample": staticmethod(pushed.append)})
    )
    monkeypatch.setitem(sys.modules, "pylsl", pylsl)
    events = EventLog(tmp_path / "events.csv", lsl=True)
    events.note(1, "line", "NEUTRAL")
    events.note(2, "mark", "a")
    events.close()
    assert pushed == [("omote", "Markers", 1, 0, "string", "omote-marks"), ["a"]]


def test_a_missing_package_is_named_with_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("surface.base.extras.find_spec", lambda name: None)
    with pytest.raises(MissingPackage) as caught:
        EventLog(tmp_path / "events.csv", lsl=True)
    assert "omote[lsl]" in caught.value.hint and not (tmp_path / "events.csv").exists()


def test_a_real_inlet_of_lsl_hears_the_marks(tmp_path: Path) -> None:
    pylsl = pytest.importorskip("pylsl", reason="needs pylsl: pip install 'omote[lsl]'")
    events = EventLog(tmp_path / "events.csv", lsl=True)
    found = pylsl.resolve_byprop("source_id", "omote-marks", timeout=10.0)
    if not found:
        events.close()
        pytest.skip("no network here in which LSL finds streams")
    inlet = pylsl.StreamInlet(found[0])
    inlet.open_stream(timeout=10.0)
    for what, text in (("mark", "begin"), ("line", "NEUTRAL"), ("mark", "end")):
        events.note(1, what, text)
    assert [inlet.pull_sample(timeout=10.0)[0] for _ in range(2)] == [["begin"], ["end"]]
    inlet.close_stream()
    events.close()
