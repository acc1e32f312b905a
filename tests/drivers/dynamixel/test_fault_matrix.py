"""The 20 faults of servo buses over the Dynamixel driver, each with what must hold. One row each.

Every fault that bytes can show runs here over a wire-timed bus in virtual time, under the same conditions: no value is
attributed to the wrong servo, no goal jumps above the ramp, those who can be reached go on and are off at the end, and
one dead servo costs the others one bounded wait a second at the most. ``TESTS`` names what looks closer at each.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from drivers import open_bus
from drivers.base.bus import BusState, ServoSpec
from drivers.base.errors import DriverError, PortLost
from drivers.core.limits import BURST_S
from drivers.dynamixel.bus import MAX_POINTER_RESTORES, DynamixelBus
from drivers.sim.serving.virtual import VirtualClock, VirtualLink
from drivers.sim.servos.chain import Chain
from drivers.sim.servos.device import SimulatedServo

IDS = tuple(range(1, 7))
SICK = 3
SPEED = 6.0
PERIOD_S = 0.02
MARGIN_S = 0.01
WAIT_S = 3 * MARGIN_S + 0.004
"""Longest stall: a cut joint reply, a plain read and a ping, each with its margin."""

NAMES = {
    1: "a servo is silent",
    2: "the adapter is unplugged",
    3: "the program crashes, is interrupted or killed",
    4: "a servo is dead at shutdown",
    5: "an old goal at torque on",
    6: "overload",
    7: "alert bit with valid data",
    8: "torque gone without a word",
    9: "wrong model, double id, wrong rate",
    10: "port busy; interrupt in a transaction",
    11: "no permission, no port",
    12: "slow adapter",
    13: "late or short reply",
    14: "damaged bytes",
    15: "EEPROM",
    16: "watchdog tripped",
    17: "position outside one turn",
    18: "overheating",
    19: "echo of own bytes",
    20: "stalled host",
}
TESTS = {
    1: ("test_telemetry", "test_a_silent_servo_costs_the_others_nothing_but_a_bounded_wait"),
    2: ("test_bus", "test_unplugging_is_told_once_and_the_bus_comes_back_where_the_servos_are"),
    3: ("test_bus", "test_every_way_out_switches_all_servos_off"),
    4: ("test_startup", "test_a_dead_servo_does_not_keep_the_others_on"),
    5: ("test_startup", "test_an_old_goal_is_not_executed"),
    6: ("test_telemetry", "test_an_overload_is_seen_while_the_others_move_on"),
    7: ("test_telemetry", "test_data_with_the_alert_bit_is_used"),
    8: ("test_telemetry", "test_torque_that_goes_without_a_word_is_noticed"),
    9: ("test_startup", "test_two_servos_with_one_id_are_diagnosed"),
    10: ("test_bus", "test_an_interrupt_in_a_transaction_leaves_the_bus_usable"),
    11: ("../port/test_serialport", "test_permission_is_told_with_the_group_to_join"),
    12: ("test_startup", "test_permanent_settings_are_written_only_when_they_differ_and_said"),
    13: ("test_telemetry", "test_late_answers_are_never_taken_for_others"),
    14: ("test_telemetry", "test_damaged_answers_cost_a_cycle_and_give_no_wrong_value"),
    15: ("test_startup", "test_servos_that_are_deaf_after_a_permanent_write_are_waited_for"),
    16: ("test_bus", "test_a_tripped_watchdog_is_cleared_without_a_jump"),
    17: ("test_startup", "test_a_position_outside_one_turn_is_refused"),
    18: ("test_fault_matrix", "test_bytes_on_the_wire"),
    19: ("test_telemetry", "test_an_adapter_that_echoes_loses_nothing"),
    20: ("test_bus", "test_a_stalled_host_sends_no_burst"),
}


@pytest.mark.parametrize("number", NAMES, ids=[f"{n}: {name}" for n, name in NAMES.items()])
def test_every_fault_has_a_test_of_its_own(number: int) -> None:
    module, name = TESTS[number]
    tree = ast.parse((Path(__file__).parent / f"{module}.py").read_text(encoding="utf-8"))
    assert name in [node.name for node in tree.body if isinstance(node, ast.FunctionDef)]


class Rig:
    """The driver on a virtual wire, driven at 50 Hz, with every cycle looked at."""

    def __init__(self) -> None:
        self.clock = VirtualClock()
        self.chain = Chain([SimulatedServo(i) for i in IDS])
        specs = [ServoSpec(i, f"servo{i}", "xl330-m288", -1.0, 1.0, SPEED, 60.0) for i in IDS]
        link = VirtualLink(self.chain, self.clock)
        bus = open_bus("dynamixel", specs, port=link, clock=self.clock, margin_s=MARGIN_S)
        assert isinstance(bus, DynamixelBus)
        self.bus = bus
        self.last: np.ndarray | None = None
        self.stalls: list[float] = []

    def run(self, seconds: float) -> BusState:
        """Cycles for some time; returns the last state."""
        end = self.clock() + seconds
        while self.clock() < end:
            began = self.clock()
            sent = self.bus.write(np.array([0.8 * np.sin(began + i) for i in IDS]))
            self._no_jump(sent, began)
            state = self.bus.read()
            self.stalls.append(self.clock() - began)
            self._right_values(state, began)
            self.clock.wait_until(began + PERIOD_S)
        return state

    def _no_jump(self, sent: np.ndarray, began: float) -> None:
        here = self.bus.scale.radians(np.array([servo.position_ticks(began) for servo in self.chain.servos]))
        reach = SPEED * (PERIOD_S + WAIT_S + BURST_S) + 2e-3
        last = here if self.last is None else self.last
        assert np.minimum(abs(sent - last), abs(sent - here)).max() <= reach
        self.last = sent

    def _right_values(self, state: BusState, began: float) -> None:
        for at in np.flatnonzero(state.fresh):
            plant = self.chain.servos[at].plant
            places = [plant.motion(t).position for t in (began, self.clock())]
            ticks = self.bus.scale.ticks(state.position_rad)[at]
            slack = 3 + 2048 / np.pi * SPEED * (self.clock() - began)
            assert min(places) - slack <= ticks <= max(places) + slack, f"servo {IDS[at]}"


@pytest.fixture
def rig() -> Iterator[Rig]:
    rig = Rig()
    rig.bus.open()
    rig.bus.start()
    rig.run(1.0)
    yield rig
    rig.chain.faults.clear(None, rig.clock())
    rig.clock.sleep(1.0)
    rig.bus.close()
    assert not any(servo.torque for servo in rig.chain.servos)


class Row(NamedTuple):
    """A fault of the wire, and what must be so while it lasts."""

    number: int
    spec: str
    holds: Callable[[Rig, BusState], bool]


def errors(rig: Rig) -> dict[str, int]:
    return rig.bus.report().errors_by_servo.get(SICK, {})


def others_fresh(rig: Rig, state: BusState) -> bool:
    return bool(np.delete(state.fresh, SICK - 1).all())


def dead(rig: Rig, state: BusState) -> bool:
    waited = sum(stall > PERIOD_S / 2 for stall in rig.stalls)
    return others_fresh(rig, state) and rig.bus.report().silent == (SICK,) and waited <= 5 and max(rig.stalls) < WAIT_S


def latched(bit: int) -> Callable[[Rig, BusState], bool]:
    def holds(rig: Rig, state: BusState) -> bool:
        at = SICK - 1
        seen = state.hardware_error[at] == bit and bool(state.error[at] & 0x80) and not state.torque[at]
        return bool(seen and state.fresh.all() and np.delete(state.torque, at).all() and errors(rig)["alert"] == 1)

    return holds


def dropped(rig: Rig, state: BusState) -> bool:
    """Short answers in a joint reply move all behind them: they may cost their own cycle, of whoever it is."""
    return set(rig.bus.report().errors) <= {"corrupt", "no_reply"} and bool(errors(rig))


def only(*kinds: str) -> Callable[[Rig, BusState], bool]:
    def holds(rig: Rig, state: BusState) -> bool:
        return (
            others_fresh(rig, state) and set(errors(rig)) == set(kinds) and set(rig.bus.report().errors) == set(kinds)
        )

    return holds


ROWS = (
    Row(1, f"mute:{SICK}", dead),
    Row(1, f"silent:{SICK}", dead),
    Row(1, f"mute:{SICK} chain-stop", dead),
    Row(6, f"hw:{SICK}:0x20", latched(0x20)),
    Row(6, f"stall:{SICK}", lambda rig, state: others_fresh(rig, state)),
    Row(7, f"alert:{SICK}", lambda rig, state: bool(state.fresh.all()) and errors(rig) == {"alert": 1}),
    Row(8, "volts:*:3.0", lambda rig, state: bool(state.hardware_error.all() and not state.torque.any())),
    Row(13, f"late:{SICK}:12ms:every=3", only("no_reply")),
    Row(13, f"short:{SICK}:1:every=3", dropped),
    Row(14, f"crc:{SICK}:every=3", only("corrupt")),
    Row(14, f"flip:{SICK}:every=3", only("corrupt")),
    Row(14, "noise:*:5:p=0.1", lambda rig, state: "corrupt" in rig.bus.report().errors),
    Row(14, f"wrongid:{SICK}:4:every=3", lambda rig, state: len(errors(rig)) > 0),
    Row(15, "eeprom-busy:*:20ms", lambda rig, state: bool(state.fresh.all()) and not rig.bus.report().errors),
    Row(18, f"temp:{SICK}:75", latched(0x04)),
    Row(
        13,
        "slow-reader:200ms",
        lambda rig, state: not state.fresh.any() and set(rig.bus.report().errors) == {"no_reply"},
    ),
    Row(19, "echo", lambda rig, state: bool(state.fresh.all()) and not rig.bus.report().errors),
)


@pytest.mark.slow
@pytest.mark.parametrize("row", ROWS, ids=[f"{row.number}: {row.spec}" for row in ROWS])
def test_bytes_on_the_wire(rig: Rig, row: Row) -> None:
    rig.stalls.clear()
    rig.chain.faults.add(row.spec.split(), rig.clock())
    state = rig.run(2.0)
    assert row.holds(rig, state), (state, rig.bus.report())
    rig.chain.faults.clear(None, rig.clock())
    assert rig.run(1.5).fresh.all(), "everybody is back when the fault is over"


def test_2_a_port_that_goes_and_comes_back(rig: Rig) -> None:
    rig.chain.faults.add(["unplug:for=1s"], rig.clock())
    with pytest.raises(PortLost):
        rig.run(1.0)
    with pytest.raises(DriverError):
        rig.bus.reconnect()
    rig.clock.sleep(1.1)
    rig.last = None
    rig.bus.reconnect()
    assert rig.run(0.5).fresh.all()


def test_5_a_servo_outside_its_limits_is_led_in_and_not_thrown() -> None:
    rig = Rig()
    rig.chain.servos[0].place(2048 + 1500, 0.0)
    rig.bus.open()
    rig.bus.start()
    first = rig.bus.write(np.zeros(len(IDS)))
    assert first[0] > 2.2, "2.3 rad is where it stands, 1.0 rad its limit"
    path = []
    for _ in range(60):
        rig.clock.sleep(PERIOD_S)
        path.append(rig.bus.write(np.full(len(IDS), 0.5))[0])
        rig.bus.read()
    assert np.diff([first[0], *path]).min() >= -SPEED * (PERIOD_S + BURST_S) - 2e-3
    assert path[-1] == pytest.approx(0.5, abs=2e-3)
    assert rig.bus.write(np.full(len(IDS), 2.0))[0] <= 1.0 + 1e-6
    rig.bus.close()


def test_16_and_20_a_stall_that_trips_the_watchdogs(rig: Rig) -> None:
    rig.clock.sleep(0.5)
    state = rig.run(0.5)
    assert rig.bus.report().errors == {"watchdog": len(IDS)}
    assert state.fresh.all()
    assert state.torque.all()


def test_8_a_servo_that_restarts_is_not_believed_until_it_is_mapped_again(rig: Rig) -> None:
    """Its pointers are gone with its RAM: through them all reads as 0, which is a position too."""
    rig.chain.servos[SICK - 1].reboot(rig.clock())
    state = rig.run(2.0)
    assert errors(rig)["reset"] == 1
    assert errors(rig)["torque_lost"] == 1
    assert state.fresh.all()
    assert not state.torque[SICK - 1]


def test_8_a_servo_that_does_not_keep_its_pointers_is_read_without_in_the_end(rig: Rig) -> None:
    for _ in range(MAX_POINTER_RESTORES + 1):
        assert set(rig.bus._indirect_blocks) == set(IDS)
        rig.bus._telemetry.unmapped.add(SICK)
        state = rig.run(0.1)
        assert state.fresh.all()
    assert set(rig.bus._indirect_blocks) == set(IDS) - {SICK}
