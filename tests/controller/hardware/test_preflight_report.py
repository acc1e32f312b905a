"""The report of a preflight: what passes, what is left out as unknown, and how it reads."""

from __future__ import annotations

import hashlib
import json
import tomllib
from datetime import UTC, datetime
from pathlib import Path

import pytest

from controller.base.errors import ControllerError
from controller.hardware.preflight_report import (
    BusFindings,
    ChannelFindings,
    Preflight,
    check_report_path,
    preflight_table,
    write_preflight,
)


@pytest.fixture
def preflight(tmp_path: Path) -> Preflight:
    robot = tmp_path / "robot.toml"
    robot.write_text("name = 'r'\n")
    jaw = ChannelFindings(
        "jaw", "head", 4, "xl330-m288", "XL330-M288-T", 52, 5.04, 31.0, 1.23456, (-30.0, 30.0), (-180.0, 180.0), 12,
        10.0, 9.5, 31.6, 0.128, 0.4, 4.9, "right",
    )  # fmt: skip
    neck = ChannelFindings("neck", "head", 5, "xl330-m288")
    date = datetime(2026, 2, 3, 4, 5, 6, tzinfo=UTC)
    return Preflight(
        "r", robot, (robot,), [BusFindings("head", "dynamixel", "/dev/x", 1_000_000)], [jaw, neck], date=date
    )


@pytest.mark.parametrize(("what", "passed"), [("", True), ("bus", False), ("channel", False), ("skipped", False)])
def test_a_robot_passes_without_a_fault_and_without_a_servo_left_out(
    what: str, passed: bool, preflight: Preflight
) -> None:
    if what == "bus":
        preflight.buses[0].faults.append("is slow")
    elif what == "channel":
        preflight.channels[1].faults.append("is blocked")
    elif what:
        preflight.channels[1].skipped = "outside its limits"
    assert preflight.passed == passed == preflight.as_dict()["passed"]
    named = {"bus": ["head: is slow"], "channel": ["neck: is blocked"]}
    assert preflight.faults == named.get(what, []) == preflight.as_dict()["faults"]


@pytest.mark.parametrize("suffix", [".toml", ".json"])
def test_a_report_has_what_is_known_rounded_and_whose_files_it_was_about(
    suffix: str, preflight: Preflight, tmp_path: Path
) -> None:
    path = tmp_path / f"report{suffix}"
    preflight.signed_by = "Mia"
    write_preflight(preflight, path)
    table = json.loads(path.read_text()) if suffix == ".json" else tomllib.loads(path.read_text())
    assert (table["format"], table["kind"], table["robot"], table["signed_by"]) == (1, "preflight", "r", "Mia")
    assert table["date"] == "2026-02-03T04:05:06+00:00"
    assert table["sha256"] == {"robot.toml": hashlib.sha256(b"name = 'r'\n").hexdigest()}
    assert {"omote", "python", "system", "numpy"} <= set(table["versions"])
    jaw, neck = table["channels"]
    assert jaw["position_deg"] == 1.235 and jaw["limit_deg"] == [-30.0, 30.0] and jaw["firmware"] == 52
    assert neck == {"name": "neck", "bus": "head", "id": 5, "model": "xl330-m288", "seen": "not asked",
                    "faults": []}  # fmt: skip
    assert table["buses"] == [{"name": "head", "family": "dynamixel", "port": "/dev/x", "baud": 1000000, "faults": []}]


def test_measured_values_below_zero_are_in_the_report_too() -> None:
    row = ChannelFindings("jaw", "head", 1, "xl330-m288", position_deg=-1.0, homing_offset_ticks=-1)
    known = Preflight("r", Path("r.toml"), (), channels=[row]).as_dict()["channels"][0]
    assert (known["position_deg"], known["homing_offset_ticks"]) == (-1.0, -1)
    assert "firmware" not in known


def test_only_files_of_two_kinds_are_reports(tmp_path: Path) -> None:
    check_report_path(tmp_path / "a.toml")
    check_report_path(tmp_path / "a.json")
    with pytest.raises(ControllerError, match=r"a .toml or a .json") as caught:
        check_report_path(tmp_path / "a.txt")
    assert caught.value.hint == "-o a.toml"


def test_a_report_that_cannot_be_written_leaves_nothing(preflight: Preflight, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(ControllerError):
        write_preflight(preflight, tmp_path / "file" / "a.toml")
    assert (tmp_path / "file").read_text() == "mine"


def rows(preflight: Preflight) -> list[list[str]]:
    table = preflight_table(preflight)
    assert len(table.rows) == len(preflight.channels)
    columns = [list(map(str, column.cells)) for column in table.columns]
    return [list(row) for row in zip(*columns, strict=True)]


def test_the_table_has_a_row_a_servo_and_nothing_where_nothing_was_measured(preflight: Preflight) -> None:
    jaw, neck = rows(preflight)
    assert jaw == ["jaw", "4", "XL330-M288-T", "5.0 V", "1.2", "9.5", "10.0", "32 ms", "0.13 A", "right", "good"]
    assert neck == ["neck", "5", "xl330-m288", "", "", "", "", "", "", "not asked", "good"]
    preflight.channels[0].peak_current_a = float("nan")
    preflight.channels[0].skipped = "outside its limits"
    preflight.channels[1].faults += ["is blocked", "is hot"]
    jaw, neck = rows(preflight)
    assert jaw[8] == "40 %" and jaw[-1] == "outside its limits" and neck[-1] == "is blocked; is hot"
