"""drivers.protocol1.bus over simulated wires: the contract for every family that has its framing."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from drivers import open_bus
from drivers.base.bus import Bus
from drivers.packets import packet1 as v1
from drivers.port.serialport import SerialPort
from drivers.protocol1 import bus as module
from drivers.servos.exchange import Exchange
from drivers.sim.serving.virtual import VirtualBus
from drivers.testing import ServoBus
from tests.drivers import contract
from tests.drivers.contract import BusContract, settle

CALM = {"margin_s": 0.5, "watchdog_ms": 0}


def servos_of(*models: str) -> tuple[contract.ServoSpec, ...]:
    return tuple(replace(servo, model=model) for servo, model in zip(contract.SERVOS, models, strict=True))


def limit_ticks(servo: contract.ServoSpec) -> tuple[int, int]:
    """Steps of 4096 a turn within which a servo's limits lie, widened to whole ones."""
    sign = -1 if servo.reverse else 1
    ends = [2048 + (servo.zero_rad + sign * angle) * 4096 / (2 * np.pi) for angle in (servo.min_rad, servo.max_rad)]
    return int(np.floor(min(ends))), int(np.ceil(max(ends)))


class Family(BusContract):
    """The contract over a simulated wire of ``SERVOS``."""

    KIND: ClassVar[str] = "feetech"

    @pytest.fixture
    def bus(self) -> Bus:
        return VirtualBus(self.SERVOS, self.KIND).bus(**CALM)


class TestFeetechSts(Family):
    MODELS = ("sts3215",) * 3
    SERVOS = servos_of(*MODELS)
    VOLTS = 7.4

    @pytest.fixture
    def bus(self, tmp_path: Path, servo_bus: Callable[..., ServoBus]) -> Iterator[Bus]:
        """Over a real pseudo-terminal, in time that passes by itself; no goal may leave the limits of its servo."""
        wire = servo_bus("sts3215", [servo.id for servo in self.SERVOS], link=tmp_path / "by-id")
        yield open_bus(self.KIND, self.SERVOS, port=wire.port, **CALM)
        wire.never_beyond_limits({servo.id: limit_ticks(servo) for servo in self.SERVOS})


class TestFeetechStsInVirtualTime(Family):
    MODELS = ("sts3215",) * 3
    SERVOS = servos_of(*MODELS)
    VOLTS = 7.4


class TestDynamixelMx(Family):
    KIND = "dynamixel"
    MODELS = ("mx1-28",) * 3
    SERVOS = servos_of(*MODELS)
    VOLTS = 12.0


class TestFeetechScs(Family):
    MODELS = ("scs0009",) * 3
    SERVOS = servos_of(*MODELS)
    VOLTS = 6.0
    STEP_RAD = np.deg2rad(300) / 1024


class TestDynamixelAx(Family):
    KIND = "dynamixel"
    MODELS = ("ax-12a",) * 3
    SERVOS = servos_of(*MODELS)
    VOLTS = 12.0
    STEP_RAD = np.deg2rad(300) / 1024


class TestDynamixelOfBothProtocols(Family):
    KIND = "dynamixel"
    MODELS = ("ax-12a", "xm430-w350", "mx1-28")
    SERVOS = servos_of(*MODELS)
    VOLTS = 12.0
    STEP_RAD = np.deg2rad(300) / 1024


def test_simulated_servos_come_with_the_driver_and_need_no_dead_man_switch() -> None:
    servos = servos_of(*("sts3215",) * 3)
    with open_bus("simulated", servos, simulates="feetech", margin_s=0.5) as bus:
        bus.start()
        settle(bus, [0.2, -0.3, 0.5])
        assert [info.model for info in bus.discover([1, 7])] == ["sts3215"] * 2
        assert bus._switch is None


def test_everybody_is_found_when_nobody_is_named() -> None:
    servos = servos_of(*("scs0009",) * 3)
    with VirtualBus(servos, "feetech", faults=["baud:7:57600"]).bus(margin_s=0.002) as bus:
        assert [info.id for info in bus.discover()] == [1, 2]
        assert [info.id for info in bus.discover([0, 1, 2, 7])] == [1, 2]


@pytest.mark.parametrize(("model", "tells"), [("sts3215", True), ("ax-12a", False)])
def test_load_and_motion_are_told_where_the_model_does(model: str, tells: bool) -> None:
    servos = servos_of(*(model,) * 3)
    kind = "feetech" if tells else "dynamixel"
    wire = VirtualBus(servos, kind)
    with wire.bus(**CALM) as bus:
        bus.start()
        assert np.isnan(bus.load).all()
        settle(bus, [0.4, -0.3, 0.4], 0.011)
        contract.read_until(bus, lambda state: not state.velocity_rad_s.any())
        assert np.sign(bus.load).tolist() == [1, -1, 1], "the skin pulls back"
        for _ in range(15):  # its motor runs through the play of the gear first
            bus.write([-0.3, 0.4, -0.3])
            state = bus.read()
        assert bus.moving.tolist() == [tells] * 3
        assert np.sign(state.velocity_rad_s).tolist() == [-1, 1, -1]


def test_positions_alone_are_shorter_and_the_rest_comes_in_turn() -> None:
    servos = servos_of("sts3215", "scs0009", "sts3215")
    wire = VirtualBus(servos, "feetech")
    with wire.bus(feedback="position", **CALM) as bus:
        bus.start()
        state = contract.read_until(bus, lambda s: bool(np.isfinite(s.voltage_v + s.temperature_c).all()))
        assert state.fresh.all()
        np.testing.assert_allclose(state.voltage_v, [7.4, 6.0, 7.4], atol=0.2)


def test_servos_read_one_by_one_take_turns() -> None:
    servos = servos_of(*("ax-12a",) * 3)
    wire = VirtualBus(servos, "dynamixel")
    with wire.bus(singles=2, **CALM) as bus:
        bus.start()
        fresh = [bus.read().fresh.tolist() for _ in range(3)]
        assert fresh == [[True, True, False], [True, False, True], [False, True, True]]
        assert bus.read().age_s.max() < 1.0


@pytest.mark.parametrize("how", ["hw:2:0x20", "mute:2"])
def test_a_servo_in_trouble_is_looked_at_without_waiting_for_its_turn(how: str) -> None:
    """Without turns, torque is only asked of servos that raise an alert or come back from silence."""
    servos = servos_of(*("sts3215",) * 3)
    wire = VirtualBus(servos, "feetech")
    with wire.bus(slow_group=0, margin_s=0.05, watchdog_ms=0) as bus:
        bus.start()
        wire.fault(how)
        if how == "mute:2":
            contract.read_until(bus, lambda state: bool(state.silent[1]))
            wire.servo(2).put("Torque Enable", 0)
            wire.clear()
        contract.read_until(bus, lambda state: not state.torque[1])
        assert bus.report().errors_by_servo[2]["torque_lost"] == 1


class Switch:
    """A dead man's switch that only keeps what it was told."""

    made: ClassVar[list[Switch]] = []

    def __init__(self, path: str, baud: int, frames: Iterable[bytes]) -> None:
        self.orders = (path, baud, list(frames))
        self.watching, self.dismissed = True, 0
        self.made.append(self)

    def dismiss(self) -> None:
        self.dismissed += 1


def test_a_dead_mans_switch_is_made_once_checked_and_made_anew_when_it_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "DeadManSwitch", Switch)
    monkeypatch.setattr(module, "_outlives_us", lambda link: True)
    monkeypatch.setattr(Switch, "made", [])
    wire = VirtualBus(servos_of(*("sts3215",) * 3), "feetech")
    with wire.bus(margin_s=0.5, watchdog_ms=1) as bus:
        bus.start()
        bus.stop()
        bus.start()
        (first,) = Switch.made
        path, baud, frames = first.orders
        assert (path, baud) == ("virtual", 1_000_000)
        assert [v1.Reader1().feed(frame)[0].params for frame in frames] == [bytes((40, 1, 1, 0, 2, 0, 7, 0))]
        for _ in range(3):
            wire.clock.sleep(2.0)
            bus.read()
        assert "unkept" not in bus.report().errors
        first.watching = False
        wire.clock.sleep(0.5)
        bus.read()
        assert "unkept" not in bus.report().errors, "it is checked once a second"
        for _ in range(3):
            wire.clock.sleep(1.0)
            bus.read()
        assert bus.report().errors["unkept"] == 1
        bus.stop()
        bus.start()
        assert (first.dismissed, len(Switch.made)) == (1, 2)
    assert Switch.made[1].dismissed == 1


@pytest.mark.parametrize(("watchdog_ms", "link"), [(0, True), (200, False)])
def test_no_dead_mans_switch_where_none_is_wanted_or_nothing_outlives_the_program(
    monkeypatch: pytest.MonkeyPatch, watchdog_ms: int, link: bool
) -> None:
    monkeypatch.setattr(module, "DeadManSwitch", Switch)
    monkeypatch.setattr(module, "_outlives_us", lambda _: link)
    monkeypatch.setattr(Switch, "made", [])
    with VirtualBus(servos_of(*("sts3215",) * 3), "feetech").bus(margin_s=0.5, watchdog_ms=watchdog_ms) as bus:
        bus.start()
        assert Switch.made == []


def test_servos_outlive_a_program_behind_a_serial_port_and_not_in_its_memory() -> None:
    assert module._outlives_us(SerialPort("/dev/ttyUSB0"))
    assert not module._outlives_us(SerialPort("memory://head"))
    assert not module._outlives_us(VirtualBus(servos_of(*("sts3215",) * 3), "feetech").link)


def test_six_servos_that_must_be_read_one_by_one_are_read_a_cycle() -> None:
    servos = tuple(contract.ServoSpec(i, f"s{i}", "ax-12a", -0.5, 0.5, 8.0, 200.0) for i in range(1, 9))
    with VirtualBus(servos, "dynamixel").bus(**CALM) as bus:
        bus.start()
        assert [int(bus.read().fresh.sum()) for _ in range(4)] == [6] * 4


@pytest.mark.parametrize(("family", "model"), [("dynamixel", "ax-12a"), ("feetech", "sts3215")])
def test_a_servo_that_answers_only_with_an_error_is_passed_over(
    family: str, model: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    servos = [replace(servo, model=model) for servo in contract.SERVOS]
    with VirtualBus(servos, family).bus() as bus:
        refusal = Exchange({1: v1.Packet1(1, v1.Error1.INSTRUCTION, b"")}, (), False)
        monkeypatch.setattr(type(bus._registers.packets), "hello", lambda self, port, servo: refusal)
        assert bus.discover([1]) == []
