"""controller.hardware.preflight: each mistake that is put into a simulated head is found, and nothing stays on."""

from __future__ import annotations

import hashlib
import json
import math
import tomllib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import tomli_w

from controller.base.errors import ControllerError
from controller.base.parameters import PARAMETERS
from controller.hardware import moving
from controller.hardware.moving import Sampler, move_a_little
from controller.hardware.preflight import new_preflight, run_preflight, switch_off, towards
from controller.hardware.preflight_report import Preflight, check_report_path, preflight_table, write_preflight
from controller.robot.robot import load_robot
from controller.robot.settings import ChannelSettings
from drivers.base.bus import ServoSpec
from drivers.base.errors import NoReply
from drivers.sim import SimulatedBus
from drivers.sim.serving.virtual import VirtualBus
from drivers.tools.find_stops import StillOn

MODEL = "xm430-w350"


def channel(name: str, number: int, **changes: object) -> dict[str, Any]:
    plain = {
        "name": name, "bus": "head", "id": number, "model": MODEL, "mix": {"jawOpen": 1.0},
        "map": {"at": [0, 1], "deg": [0, 15]}, "limit_deg": [-5, 20], "max_speed_deg_s": 200, "max_accel_deg_s2": 2000,
    }  # fmt: skip
    return {**plain, **changes}


class Head:
    """A robot file whose bus is served from this process."""

    def __init__(self, folder: Path, *, family: str = "dynamixel", **wire: Any) -> None:
        self.path, self.family, self.wire = folder / "head.toml", family, wire
        self.channels = [channel("jaw", 1), channel("brow", 2)]
        self.models: dict[int, str] = {}
        self.changes: dict[int, dict[str, int]] = {}
        self.places: dict[int, int] = {}
        self.faults: list[str] = []
        self.bus_keys: dict[str, object] = {"margin_s": 0.5}  # a busy machine answers late
        self.on: list[int] = []

    def check(self, **options: Any) -> Preflight:
        """Serve the servos, run a preflight, and note which motors are on afterwards."""
        servos = [
            ServoSpec(row["id"], row["name"], self.models.get(row["id"], row["model"]), -1, 1, 1, 1)
            for row in self.channels
        ]
        with SimulatedBus(servos, self.path.parent / "port", family=self.family, **self.wire) as bus:
            self.serving = bus
            for number, registers in self.changes.items():
                for name, value in registers.items():
                    bus.servo(number).put(name, value)
            for number, ticks in self.places.items():
                bus.servo(number).place(ticks)
            bus.fault(*self.faults)
            head = {"name": "head", "kind": self.family, "port": bus.path, **self.bus_keys}
            table = {"name": "test head", "buses": [head], "channels": self.channels}
            self.path.write_text(tomli_w.dumps(table), encoding="utf-8")
            robot = load_robot(self.path, PARAMETERS)
            found = self.preflight = new_preflight(robot, self.path)
            run_preflight(robot, robot.channels, found, PARAMETERS, **options)
            bus.clear()
            self.on = [servo.id for servo in servos if bus.servo(servo.id).torque]
        return found


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A busy machine may stop the simulated servos for a while; the movements are quicker than those of real ones."""
    monkeypatch.setattr(moving, "STALE_S", 5.0)
    monkeypatch.setattr("controller.hardware.preflight.SPEED_DEG_S", 40.0)


@pytest.fixture
def head(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Head]:
    monkeypatch.setattr("drivers.port.latency.LATE_S", 0.5)  # the servos are simulated beside busy programs
    made = Head(tmp_path)
    yield made
    assert made.on == []


def of(found: Preflight, name: str) -> str:
    (row,) = [row for row in found.channels if row.name == name]
    return "; ".join(row.faults)


def test_a_head_as_its_file_says_passes_and_is_measured(head: Head) -> None:
    found = head.check(ask=lambda channel, text: True)
    assert found.faults == []
    assert found.passed
    for row in found.channels:
        assert row.wanted_deg == pytest.approx(6.0, abs=0.1)
        assert row.moved_deg == pytest.approx(6.0, abs=0.4)
        assert row.voltage_v == pytest.approx(12.0, abs=0.5)
        assert 0.0 <= row.lag_ms < 250.0
        assert 0.0 < row.peak_load < 0.4
        assert row.seen == "right"
    assert found.buses[0].answer_ms < 500.0


def test_a_servo_that_its_own_drive_mode_reverses_is_found_and_not_moved(head: Head) -> None:
    head.changes[1] = {"Drive Mode": 1}
    found = head.check()
    assert "drive mode reverses it" in of(found, "jaw")
    assert math.isnan(found.channels[0].moved_deg)
    assert of(found, "brow") == ""


def test_who_looks_finds_a_servo_that_goes_the_wrong_way(head: Head) -> None:
    asked: list[str] = []

    def ask(channel: Any, text: str) -> bool:
        asked.append(text)
        return channel.name != "jaw"

    found = head.check(ask=ask)
    assert "the wrong way" in of(found, "jaw")
    assert found.channels[0].seen == "wrong"
    assert of(found, "brow") == ""
    assert asked == ["first as if jawOpen grew"] * 2


def test_a_range_that_the_servo_does_not_have_is_found(head: Head) -> None:
    head.changes[2] = {"Max Position Limit": 2048 + 100}
    found = head.check()
    assert "own limits" in of(found, "brow")
    assert "limit_deg is -5 to 20" in of(found, "brow")


def test_a_servo_outside_its_limits_is_not_moved(head: Head) -> None:
    head.places[1] = 2048 + 400
    found = head.check()
    assert "stands at 35.2, outside limit_deg" in of(found, "jaw")
    assert found.channels[0].skipped == "not moved"


@pytest.mark.parametrize("by", ["model", "place"])
def test_swapped_ids_are_found(head: Head, by: str) -> None:
    if by == "model":
        head.channels[1]["model"] = "xl330-m288"
        head.models = {1: "xl330-m288", 2: MODEL}
    else:
        head.channels[0]["limit_deg"], head.channels[0]["map"]["deg"] = [-60, -30], [-50, -40]
        head.channels[1]["limit_deg"], head.channels[1]["map"]["deg"] = [30, 60], [40, 50]
        head.places = {1: 2048 + 512, 2: 2048 - 512}
    found = head.check()
    assert "that of 'brow' (2) look swapped" in of(found, "jaw")
    assert "that of 'jaw' (1) look swapped" in of(found, "brow")


def test_a_low_supply_is_found_before_anything_moves(head: Head) -> None:
    head.faults = ["volts:*:8.5"]
    found = head.check()
    assert "its supply is 8.5 V, it needs 9.5 V" in of(found, "jaw")
    assert all(row.skipped for row in found.channels)


def test_the_supply_that_the_file_asks_for_counts(head: Head) -> None:
    head.bus_keys["min_voltage_v"] = 13.0
    assert "it needs 13.0 V" in of(head.check(), "brow")


def test_a_blocked_servo_is_stopped_and_the_next_one_goes_on(head: Head) -> None:
    head.faults = ["stall:1"]
    found = head.check()
    assert "stopped" in of(found, "jaw")
    assert "block" in of(found, "jaw")
    assert found.channels[0].peak_load < 0.8
    assert of(found, "brow") == ""


def test_a_slow_adapter_is_found(tmp_path: Path) -> None:
    slow = Head(tmp_path, wire=True, latency_s=0.016)
    slow.channels = slow.channels[:1]
    found = slow.check()
    assert "latency timer" in found.faults[0]
    assert found.buses[0].answer_ms > 14.0
    assert slow.on == []


@pytest.mark.parametrize(
    ("faults", "changes", "why"),
    [
        (["mute:1"], {}, "does not answer"),
        (["hw:1:0x20"], {}, "hardware error 0x20"),
        ([], {"Torque Enable": 1}, "its torque is on"),
    ],
)
def test_what_else_speaks_against_a_movement(head: Head, faults: list[str], changes: dict[str, int], why: str) -> None:
    head.channels = head.channels[:1]
    head.faults, head.changes = faults, {1: changes}
    found = head.check()
    assert why in of(found, "jaw")
    assert not found.passed
    head.on = []  # one was on before, and is left so


def test_nothing_moves_beside_a_servo_that_holds(head: Head) -> None:
    """As after a program that was killed: the servos before it would move against it."""
    head.changes = {2: {"Torque Enable": 1}}
    found = head.check()
    assert found.buses[0].faults == ["the torque of brow is on: stop the program that drives them"]
    assert of(found, "jaw") == "" and found.channels[0].skipped == "not moved"
    assert math.isnan(found.channels[0].moved_deg) and not found.passed
    head.on = []  # it was on before, and is left so


def test_a_servo_that_is_not_confirmed_off_ends_the_preflight(head: Head, monkeypatch: pytest.MonkeyPatch) -> None:
    """It falls silent as it moves: nothing else moves, and what was found is kept."""
    plain, steps = Sampler.step, [0]

    def silenced(self: Sampler, goal: float) -> float:
        steps[0] += 1
        if steps[0] == 10:
            head.serving.fault("mute:1")
        return plain(self, goal)

    monkeypatch.setattr(Sampler, "step", silenced)
    monkeypatch.setattr(moving, "STALE_S", 0.3)
    with pytest.raises(StillOn) as caught:
        head.check()
    assert caught.value.servo_ids == (1,) and "power off" in caught.value.hint
    assert [row.name for row in head.preflight.channels] == ["jaw"]
    assert "no longer says where it is" in of(head.preflight, "jaw")
    head.on = []  # it cannot be reached


def test_one_lost_confirmation_is_asked_for_again() -> None:
    answers = iter([NoReply("no answer"), None])

    def stop() -> None:
        if (error := next(answers)) is not None:
            raise error

    switch_off(SimpleNamespace(stop=stop))  # type: ignore[arg-type]
    assert next(answers, "asked twice") == "asked twice"


def test_feetech_servos_are_checked_by_their_load(tmp_path: Path) -> None:
    feetech = Head(tmp_path, family="feetech")
    for row in feetech.channels:
        row["model"] = "sts3215"
    feetech.bus_keys["watchdog_ms"] = 0
    feetech.faults = ["stall:2"]
    found = feetech.check()
    assert of(found, "jaw") == ""
    assert 0.0 < found.channels[0].peak_load < 0.4
    assert "stopped" in of(found, "brow")
    assert feetech.on == []


def test_ctrl_c_switches_off(head: Head, monkeypatch: pytest.MonkeyPatch) -> None:
    steps = [0]
    plain = Sampler.step

    def interrupted(self: Sampler, goal: float) -> float:
        steps[0] += 1
        if steps[0] == 10:
            raise KeyboardInterrupt
        return plain(self, goal)

    monkeypatch.setattr(Sampler, "step", interrupted)
    with pytest.raises(KeyboardInterrupt):
        head.check()
    assert steps[0] == 10


def test_a_servo_that_runs_from_its_goals_is_told_apart() -> None:
    spec = ServoSpec(1, "jaw", MODEL, -0.5, 0.5, 4.0, 40.0)
    wire = VirtualBus([spec])
    with wire.bus() as bus:
        bus.start()
        moved = move_a_little(Sampler(bus, 0.4, 2.3, wire.clock.sleep, wire.clock), 0.05, 0.2, -0.5, 0.5)
        assert moved.along > 0.0
        assert moved.lag_s < 0.1


def test_the_report_says_whose_file_it_was_and_who_signed(head: Head, tmp_path: Path) -> None:
    found = replace(head.check(), signed_by="the operator")
    for name, read in (("report.toml", tomllib.loads), ("report.json", json.loads)):
        write_preflight(found, tmp_path / name)
        table: dict[str, Any] = read((tmp_path / name).read_text(encoding="utf-8"))
        assert table["format"] == 1
        assert table["passed"] is True
        assert table["signed_by"] == "the operator"
        assert table["sha256"] == {"head.toml": hashlib.sha256(head.path.read_bytes()).hexdigest()}
        assert {"omote", "python", "pyserial"} <= set(table["versions"])
        assert [row["moved_deg"] for row in table["channels"]] == pytest.approx([6.0, 6.0], abs=0.4)
        assert table["date"].endswith("+00:00")
    assert preflight_table(found).row_count == 2
    with pytest.raises(ControllerError, match="toml"):
        check_report_path(tmp_path / "report.txt")


def test_where_a_growing_angle_leads() -> None:
    def shown(**changes: object) -> str:
        return towards(ChannelSettings.model_validate(channel("jaw", 1, **changes)), PARAMETERS)

    assert shown() == "jawOpen grows"
    assert shown(map={"at": [0, 1], "deg": [0, -5]}) == "jawOpen falls"
    assert shown(mix={"jawOpen": 0.1, "headYaw": -1.0}) == "headYaw falls"
    assert shown(mix={"jawLeft": -1.0}) == ""


@pytest.mark.parametrize(("own_deg_s", "asked_deg_s"), [(200, 80.0), (50, 50.0)])
def test_a_servo_may_be_twice_as_fast_as_it_is_moved_but_no_faster_than_its_file_says(
    head: Head, monkeypatch: pytest.MonkeyPatch, own_deg_s: int, asked_deg_s: float
) -> None:
    speeds: list[float] = []

    def noted(spec: ServoSpec, **changes: Any) -> ServoSpec:
        speeds.extend(changes[name] for name in changes if name == "max_speed_rad_s")
        return replace(spec, **changes)

    monkeypatch.setattr("controller.hardware.preflight.replace", noted)
    head.channels = [channel("jaw", 1, max_speed_deg_s=own_deg_s)]
    head.check()
    assert speeds == [pytest.approx(math.radians(asked_deg_s))]
