"""End stops against the limits of a robot's file: what fits, what does not, and limits with a margin."""

from __future__ import annotations

import math
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import pytest

from controller.hardware import stops
from controller.hardware.stops import ChannelStops, checked_stops, find_robot_stops, stops_table
from drivers.base.errors import BusError, DriverError, PortLost
from drivers.tools.find_stops import Found, StillOn


def channel(name: str = "jaw", low: float = -20.0, high: float = 30.0, **other: Any) -> Any:
    fields = {"name": name, "bus": "b", "model": "xl330-m288", "limit_deg": (low, high), **other}
    return SimpleNamespace(**fields)


def found(low: float | None, high: float | None, spread: float = 0.2, current: float = 0.3) -> Found:
    ends = [None if each is None else math.radians(each) for each in (low, high)]
    return Found(
        low_rad=ends[0], high_rad=ends[1], spread_rad=math.radians(spread), peak_current_a=current, offset_ticks=0
    )


def test_limits_inside_both_stops_are_as_the_file_says() -> None:
    row = checked_stops(channel(), found(-21.0, 30.4), 15.0)
    assert (row.channel, row.peak_current_a, row.faults) == ("jaw", 0.3, ())
    assert (row.low_deg, row.high_deg) == (pytest.approx(-21.0), pytest.approx(30.4))


@pytest.mark.parametrize(
    ("ends", "fault"),
    [
        ((-19.0, 40.0), "limit_deg begins at -20, beyond the stop at -19.0"),
        ((-25.0, 29.5), "limit_deg ends at 30, beyond the stop at 29.5"),
        ((None, 40.0), "no stop on the low side, up to 12.5 degrees beyond limit_deg or the end of its turn"),
        ((-25.0, None), "no stop on the high side, up to 12.5 degrees beyond limit_deg or the end of its turn"),
        ((None, None), "no stop on either side, up to 12.5 degrees beyond limit_deg or the end of its turn"),
    ],
)
def test_what_does_not_fit_is_named(ends: tuple[float | None, float | None], fault: str) -> None:
    assert checked_stops(channel(), found(*ends), 12.5).faults == (fault,)


def test_approaches_that_differ_and_servos_that_are_stuck() -> None:
    assert checked_stops(channel(), found(-25, 40, spread=1.5), 15).faults == (
        "two approaches of one stop differ by 1.5 degrees",
    )
    assert checked_stops(channel(), found(-25, 40, spread=0.9), 15).faults == ()
    stuck = checked_stops(channel(), found(4.0, 4.9), 15)
    assert stuck.faults == ("it is stuck: it moved to neither side",) and stuck.low_deg is stuck.high_deg is None
    assert stuck.peak_current_a == 0.3 and stuck.limit_deg(0.0) is None


def test_limits_keep_a_margin_and_nothing_is_left_between_near_stops() -> None:
    row = ChannelStops("jaw", -20.04, 31.26)
    assert row.limit_deg(2.0) == (-18.0, 29.3) and row.limit_deg(25.6) == (5.6, 5.7)
    assert row.limit_deg(25.7) is None and ChannelStops("jaw", None, 3.0).limit_deg(0.0) is None
    assert ChannelStops("jaw", 1.0, None).limit_deg(0.0) is None


def test_the_table_shows_stops_beside_limits() -> None:
    rows = [ChannelStops("jaw", -21.04, 31.0, 0.256), ChannelStops("brow", faults=("one", "two"))]
    table = stops_table(rows, [channel(), channel("brow", 0.0, 7.5)], 1.0)
    assert [column.header for column in table.columns][:6] == [
        "channel", "low stop", "high stop", "limit_deg", "with margin", "current"
    ]  # fmt: skip
    assert [list(column.cells) for column in table.columns] == [
        ["jaw", "brow"], ["-21.0", ""], ["31.0", ""], [r"\[-20, 30]", r"\[0, 7.5]"], [r"\[-20, 30]", ""],
        ["0.26 A", ""], ["as the file says", "one; two"],
    ]  # fmt: skip


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What was searched: name of the servo, reach in degrees, torque."""
    calls: list[Any] = []

    @contextmanager
    def serve(bus: Any, specs: Any) -> Any:
        holding = ["neck"] if bus.name == "held" else []
        yield SimpleNamespace(
            family=bus.kind, port=bus.name, baud=1_000_000, options={}, holding=lambda servos: holding
        )  # fmt: skip

    def search(
        port: str, baud: int, servo: Any, reach: Any, *, torque: float, progress: Any, margin_s: float | None
    ) -> Found:
        calls.append((servo, tuple(round(math.degrees(each), 6) for each in reach), torque))
        return found(-25.0, 40.0)

    monkeypatch.setattr(stops, "serve_bus", serve)
    monkeypatch.setattr(stops, "servo_specs", lambda channels: [each.name for each in channels])
    monkeypatch.setattr(stops, "why_not", lambda model: "it measures no current" if model == "ax-12" else "")
    monkeypatch.setattr(stops, "find_stops", search)
    return calls


def robot(*buses: tuple[str, str]) -> Any:
    every = [SimpleNamespace(name=name, kind=kind) for name, kind in buses]
    return SimpleNamespace(buses=every, on_bus=lambda name: [])


def test_each_channel_is_searched_beyond_its_limits_on_its_own_bus(asked: list[Any]) -> None:
    channels = [channel("a"), channel("b", 0.0, 5.0, bus="c"), channel("x", bus="none")]
    rows = find_robot_stops(
        robot(("b", "dynamixel"), ("unused", "dynamixel"), ("c", "dynamixel")), channels, torque=0.2
    )
    assert [row.channel for row in rows] == ["a", "b"] and not rows[0].faults
    assert asked == [("a", (-35.0, 45.0), 0.2), ("b", (-15.0, 20.0), 0.2)]


def test_nothing_moves_on_a_bus_with_a_servo_that_holds(asked: list[Any]) -> None:
    rows = find_robot_stops(robot(("held", "dynamixel"), ("b", "dynamixel")), [channel(bus="held"), channel("a")])
    assert rows[0].faults == (
        "not looked for: the torque of neck is on; stop the program that drives them",
    )  # fmt: skip
    assert [call[0] for call in asked] == ["a"]


def test_what_cannot_be_searched_is_said_and_nothing_moved(asked: list[Any]) -> None:
    rows = find_robot_stops(
        robot(("b", "dynamixel"), ("m", "maestro")), [channel(model="ax-12"), channel("h", bus="m")]
    )
    assert [row.faults for row in rows] == [
        ("it measures no current",), ("a hobby servo measures neither its position nor its current",)
    ]  # fmt: skip
    assert not asked


@pytest.mark.parametrize(
    ("error", "fault"),
    [
        (BusError("no answer", hint="look at its cable"), "no answer (look at its cable)"),
        (BusError("no answer"), "no answer"),
        (DriverError("unknown model"), "unknown model"),
    ],
)
def test_a_servo_that_fails_leaves_the_others(
    asked: list[Any], monkeypatch: pytest.MonkeyPatch, error: DriverError, fault: str
) -> None:
    good = stops.find_stops

    def search(port: str, baud: int, servo: Any, reach: Any, **other: Any) -> Found:
        if servo == "bad":
            raise error
        return good(port, baud, servo, reach, **other)

    monkeypatch.setattr(stops, "find_stops", search)
    rows = find_robot_stops(robot(("b", "dynamixel")), [channel("bad"), channel("good")])
    assert [row.faults for row in rows] == [(fault,), ()] and rows[0].low_deg is None


@pytest.mark.parametrize("error", [StillOn("torque is on"), PortLost("gone")])
def test_a_servo_that_may_be_on_and_a_lost_port_end_the_search(
    asked: list[Any], monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    def search(*words: Any, **other: Any) -> Found:
        raise error

    monkeypatch.setattr(stops, "find_stops", search)
    with pytest.raises(type(error)):
        find_robot_stops(robot(("b", "dynamixel")), [channel()])
