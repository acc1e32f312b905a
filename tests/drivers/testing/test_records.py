"""drivers.testing.records: writes, pieces of motion, traffic and outputs, each with its time, and none too many."""

from __future__ import annotations

from typing import Any

import pytest

from drivers.sim.wire.simulator import make_line, simulator_of
from drivers.testing import records
from drivers.testing.records import BoardRecord, Output, Record, Traffic, Write, outputs
from tests.drivers.testing.lines import START_S, Line


def test_entries_beyond_the_most_are_left_out_and_that_is_noted(monkeypatch: pytest.MonkeyPatch) -> None:
    assert records.MAX_ENTRIES == 1_000_000
    monkeypatch.setattr(records, "MAX_ENTRIES", 2)
    record = Record(5.0)
    for k in range(2):
        record.passed(k == 0, 10 + k, 7.0 + k)
    assert record.traffic == [Traffic(7.0, True, 10), Traffic(8.0, False, 11)] and not record.left_out
    record.passed(True, 1, 9.0)
    assert len(record.traffic) == 2 and record.left_out
    fresh = Record(0.0)
    fresh.keep(fresh.writes, Write(0.0, 1, "LED", 1.0))
    assert not fresh.left_out


def test_writes_are_there_with_their_times_since_the_record_began_and_why_they_were_refused() -> None:
    line = Line("xl330-m288", "xl330-m288")
    line.write(2, "Profile Velocity", 50, 0.25)
    line.write(1, "Goal Position", 5000, 0.5)
    line.write(1, "Present Position", 3, 0.75)
    assert line.record.writes == [
        Write(0.25, 2, "Profile Velocity", 50),
        Write(0.5, 1, "Goal Position", 5000, "data limit"),
        Write(0.75, 1, "Present Position", 3, "access"),
    ]


def test_one_packet_that_writes_several_registers_is_several_writes() -> None:
    line = Line()
    servo = line.chain.servo(1)
    servo.write(servo.table["Profile Acceleration"].address, bytes((7, 0, 0, 0, 9, 0, 0, 0)), START_S)
    assert [(each.register, each.value) for each in line.record.writes] == [
        ("Profile Acceleration", 7), ("Profile Velocity", 9),
    ]  # fmt: skip


def test_a_refused_write_of_no_register_or_of_half_a_register_is_there() -> None:
    line = Line()
    servo = line.chain.servo(1)
    servo.write(3, bytes((2, 1)), START_S + 1.0)
    servo.write(servo.table["Goal Position"].address, bytes((2, 1)), START_S + 1.0)
    servo.write(servo.table["Goal Position"].address, b"\xff\xff\xff\xff", START_S + 1.0)
    first, second, third = line.record.writes
    assert (first.register, first.value) == ("address 3", 258) and first.refused
    assert (second.register, second.value) == ("Goal Position", 258) and second.refused
    assert (third.register, third.value) == ("Goal Position", -1)  # in the register's own sign


def places(line: Line) -> list[tuple[float, float, bool]]:
    """When every piece of the first servo's motion begins, since the record began; where it leads; its power."""
    return [(piece.start_s - START_S, piece.trajectory.end, piece.powered) for piece in line.record.pieces[0]]


def test_motion_is_kept_in_pieces_by_what_was_commanded() -> None:
    line = Line("xl330-m288", "xl330-m288")
    line.write(1, "Torque Enable", 1, 0.25)
    line.write(1, "LED", 1, 0.5)  # moves nothing
    line.write(1, "Goal Position", 3000, 0.75)
    line.write(2, "Torque Enable", 1, 0.8)
    found = places(line)
    assert [(at, powered) for at, _, powered in found] == [(0.0, False), (0.25, True), (0.75, True)]
    assert [end for _, end, _ in found] == [2048, 2048, 3000]
    assert len(line.record.pieces[1]) == 2


def test_a_shaft_that_is_stuck_begins_a_piece() -> None:
    line = Line()
    line.write(1, "Torque Enable", 1, 0.0)
    line.write(1, "Goal Position", 3000, 0.0)
    line.chain.servo(1).plant.jammed_at = 2100.0
    line.record.notice(START_S + 0.5)
    line.record.notice(START_S + 0.6)
    assert [piece.jammed_at for piece in line.record.pieces[0]][-2:] == [None, 2100.0]
    assert line.record.pieces[0][-1].start_s == START_S + 0.5


def test_a_watchdog_s_stop_begins_when_it_tripped_however_late_that_is_noticed() -> None:
    line = Line()
    line.write(1, "Torque Enable", 1, 0.0)
    line.write(1, "Bus Watchdog", 1, 0.0)
    line.write(1, "Goal Position", 4095, 0.0)
    line.settle(5.0)
    last = line.record.pieces[0][-1]
    assert last.start_s - START_S == pytest.approx(0.02, abs=0.005)
    assert last.powered and last.trajectory.end < 2300


# ---------------------------------------------------------------- boards
def maestro() -> Any:
    options = simulator_of("maestro").options
    assert options is not None
    return make_line("maestro", [], 0.0)


class Plain:
    """A board that says of its outputs what a test gives it."""

    def __init__(self, *rows: dict[str, Any]) -> None:
        self.rows = list(rows)

    def describe(self, now_s: float) -> list[dict[str, Any]]:
        """What it says."""
        return self.rows


def test_outputs_are_pulses_or_the_last_thing_that_a_board_says_of_a_channel() -> None:
    board: Any = Plain(
        {"id": 3, "pulse_us": 1400.0, "target_us": 1500.0},
        {"id": 4, "pulse_us": 0.0, "target_us": 0.0},
        {"id": 5, "pulse_us": 0.0, "target_us": 1500.0},
        {"id": 0, "name": "jawOpen", "value": 0.5},
        {"id": 1, "value": None, "name": "brow"},
    )
    assert outputs(board, 1.0) == [
        Output(3, "target_us", 1500.0, 1400.0),
        Output(4, "target_us", None, None),
        Output(5, "target_us", 1500.0, None),
        Output(0, "value", 0.5, 0.5),
        Output(1, "value", None, None),
    ]


def test_only_outputs_whose_target_a_packet_changed_are_kept_with_what_was_put_out_before_and_after() -> None:
    board: Any = Plain({"id": 0, "pulse_us": 1000.0, "target_us": 1000.0}, {"id": 1, "name": "brow", "value": 0.5})
    record = BoardRecord(board, 10.0)
    record.before(11.0)
    board.rows = [{"id": 0, "pulse_us": 1100.0, "target_us": 1200.0}, {"id": 1, "name": "brow", "value": 0.5}]
    record.after(11.5)
    record.before(12.0)
    record.after(12.5)  # nothing changed
    record.before(13.0)
    board.rows = [{"id": 0, "pulse_us": 1150.0, "target_us": 1200.0}, {"id": 1, "name": "brow", "value": None}]
    record.after(13.5)
    assert record.writes == [Write(1.5, 0, "target_us", 1200.0), Write(3.5, 1, "value", None)]
    assert [(step.write, step.before, step.after) for step in record.steps] == [
        (record.writes[0], 1000.0, 1100.0), (record.writes[1], 0.5, None),
    ]  # fmt: skip
