"""drivers.tools.find_stops: stops at known places are found, and the servo is left as it was."""

from __future__ import annotations

import math

import pytest

from drivers.base.bus import ServoSpec
from drivers.base.errors import ServoFault, ServoRefused, WrongModel
from drivers.servos.port import Port
from drivers.sim.serving.virtual import VirtualBus
from drivers.sim.servos.drive_x import XDrive
from drivers.sim.servos.plant import Plant
from drivers.tools import find_stops as module
from drivers.tools.find_stops import Found, find_stops, why_not

KINDS = {"xl330-m288": "dynamixel", "xm430-w350": "dynamixel", "xh540-w270": "dynamixel", "sts3215": "feetech"}
STOPS = (1650, 2500)
"""Steps of the shaft."""
REACH = (math.radians(-60), math.radians(60))


def servo(model: str = "xl330-m288", **changes: object) -> ServoSpec:
    return ServoSpec(3, "jaw", model, -0.5, 0.5, 4.0, 40.0, **changes)  # type: ignore[arg-type]


def wire(spec: ServoSpec, stops: tuple[int, int] | None = STOPS) -> VirtualBus:
    bus = VirtualBus([spec], KINDS.get(spec.model, "dynamixel"))
    if stops:
        bus.fault(f"stops:3:{stops[0]}..{stops[1]}")
    return bus


def angle_deg(steps: float) -> float:
    return (steps - 2048) * 360 / 4096


def search(bus: VirtualBus, spec: ServoSpec, **options: object) -> Found:
    return find_stops(bus.link, 1_000_000, spec, REACH, **options)  # type: ignore[arg-type]


def registers(bus: VirtualBus) -> dict[str, int]:
    """Everything that a search may change."""
    names = ("Operating Mode", "Drive Mode", "Goal Current", "Profile Velocity", "Profile Acceleration", "Bus Watchdog",
        "Homing Offset", "Torque Limit", "Goal Velocity", "Torque Enable")  # fmt: skip
    table = bus.chain.servo(3).table
    return {name: bus.servo(3).register(name) for name in names if name in table}


@pytest.mark.parametrize("model", KINDS)
@pytest.mark.parametrize("reverse", [False, True])
def test_both_stops_are_found_within_a_degree_and_all_is_as_before(model: str, reverse: bool) -> None:
    spec = servo(model, reverse=reverse, zero_rad=0.1)
    bus = wire(spec)
    before, here = registers(bus), bus.servo(3).position_ticks
    found = search(bus, spec)
    sign = -1 if reverse else 1
    wanted = sorted(sign * (angle_deg(step) - math.degrees(0.1)) for step in STOPS)
    assert found.low_rad is not None
    assert found.high_rad is not None
    assert [math.degrees(found.low_rad), math.degrees(found.high_rad)] == pytest.approx(wanted, abs=1.0)
    assert found.spread_rad < math.radians(0.5)
    assert not bus.servo(3).torque
    assert registers(bus) == before
    assert bus.servo(3).position_ticks == pytest.approx(here, abs=25)


@pytest.mark.parametrize("model", ["xl330-m288", "xm430-w350"])
def test_a_watchdog_that_trips_while_the_computer_is_busy_is_armed_again(model: str) -> None:
    spec = servo(model)
    bus = wire(spec)
    before = registers(bus)
    found = search(bus, spec, progress=lambda text: bus.clock.sleep(1.0))
    assert found.low_rad is not None and found.high_rad is not None
    stops = [math.degrees(found.low_rad), math.degrees(found.high_rad)]
    assert stops == pytest.approx([angle_deg(step) for step in STOPS], abs=1.0)
    assert not bus.servo(3).torque and registers(bus) == before


def test_the_current_stays_at_the_limit_that_was_asked_for() -> None:
    spec = servo("xm430-w350")
    bus = wire(spec)
    found = search(bus, spec, torque=0.1)
    limit_a = 0.1 * bus.servo(3).register("Current Limit") * 0.00269
    assert 0.5 * limit_a < found.peak_current_a <= 1.02 * limit_a


@pytest.mark.parametrize("offset", [300, -900, 2000])
def test_homing_offsets_are_counted_and_kept(offset: int) -> None:
    """One beyond 1024 does not act in position mode, in which the angles of a robot file are, but in the search's."""
    spec = servo()
    bus = wire(spec)
    bus.servo(3).put("Homing Offset", offset)
    found = search(bus, spec)
    acts = offset if abs(offset) <= 1024 else 0
    assert found.offset_ticks == offset
    reach = [math.degrees(angle) for angle in REACH]
    for found_rad, step in ((found.low_rad, STOPS[0]), (found.high_rad, STOPS[1])):
        where = angle_deg(step + acts)
        if reach[0] + 1 < where < reach[1] - 1:
            assert found_rad is not None
            assert math.degrees(found_rad) == pytest.approx(where, abs=1.0)
    assert bus.servo(3).register("Homing Offset") == offset


def test_a_side_without_a_stop_ends_where_it_was_told() -> None:
    spec = servo()
    bus = wire(spec, None)
    seen: list[int] = []
    found = search(bus, spec, progress=lambda text: seen.append(bus.servo(3).position_ticks))
    assert (found.low_rad, found.high_rad) == (None, None)
    assert not bus.servo(3).torque
    assert len(seen) == 2


@pytest.mark.parametrize(
    ("model", "reason"),
    [("xl430-w250", "measures no current"), ("ax-12a", "measures no current"), ("mx-28", "measures no current"),
     ("scs0009", "measures no current"), ("ph54-100-s500", "neither a position mode")],
)  # fmt: skip
def test_models_that_cannot_are_refused_with_the_reason(model: str, reason: str) -> None:
    assert reason in why_not(model)
    with pytest.raises(ServoRefused, match=reason):
        find_stops("/dev/null", 1_000_000, servo(model), REACH)


def test_a_servo_that_holds_is_left_alone() -> None:
    spec = servo()
    bus = wire(spec)
    bus.servo(3).put("Torque Enable", 1)
    with pytest.raises(ServoRefused, match="holds with torque"):
        search(bus, spec)
    assert bus.servo(3).torque


def test_another_model_is_named_before_anything_moves() -> None:
    bus = wire(servo())
    with pytest.raises(WrongModel, match="is xl330-m288, configured is xm430-w350"):
        search(bus, servo("xm430-w350"))
    assert not bus.chain.servo(3).eeprom_writes


@pytest.mark.parametrize("model", ["xl330-m288", "sts3215"])
def test_an_error_in_the_middle_ends_with_torque_off_and_everything_put_back(model: str) -> None:
    spec = servo(model)
    bus = wire(spec)
    before = registers(bus)
    overheats = bus.clock() + 1.0
    with pytest.raises(ServoFault, match="hardware error"):
        bus.fault(f"temp:3:99:at={overheats}s")
        search(bus, spec)
    assert not bus.servo(3).torque
    after = registers(bus)
    assert {name for name in before if after[name] != before[name]} <= {"Torque Limit"}  # its own shutdown


def test_ctrl_c_ends_with_torque_off_and_everything_put_back(monkeypatch: pytest.MonkeyPatch) -> None:
    spec = servo()
    bus = wire(spec)
    before = registers(bus)
    steps = [0]
    plain = module._Search._step

    def interrupted(self: module._Search, goal: int) -> tuple[int, int]:
        steps[0] += 1
        if steps[0] == 20:
            raise KeyboardInterrupt
        return plain(self, goal)

    monkeypatch.setattr(module._Search, "_step", interrupted)
    with pytest.raises(KeyboardInterrupt):
        search(bus, spec)
    assert not bus.servo(3).torque
    assert registers(bus) == before


def test_a_shaft_that_is_stuck_from_the_beginning_is_no_pair_of_stops() -> None:
    spec = servo()
    bus = wire(spec, None)
    bus.fault("stall:3")
    found = search(bus, spec)
    assert found.low_rad is not None
    assert found.high_rad is not None
    assert found.high_rad - found.low_rad < math.radians(1.0)


def slow_steps(monkeypatch: pytest.MonkeyPatch, step_s: float, late: int = 0) -> None:
    """Let every step take so long, as on a machine that does other things, and its current be known steps late."""
    plain_step, plain_init = module._Search._step, Port.__init__
    pushes = [0] * late

    def step(self: module._Search, goal: int) -> tuple[int, int]:
        position, push = plain_step(self, goal)
        pushes.append(push)
        return position, pushes[-1 - late]

    def busy(self: Port, *arguments: object) -> None:
        plain_init(self, *arguments)
        sleep = self.sleep
        self.sleep = lambda span_s: sleep(span_s + step_s)

    monkeypatch.setattr(Port, "__init__", busy)
    monkeypatch.setattr(module._Search, "_step", step)


def soft(monkeypatch: pytest.MonkeyPatch, bus: VirtualBus, pushing_at_deg: float) -> None:
    """Let the motor at a stop push enough only so far from its goal."""
    drive = bus.chain.servo(3).drive
    full = drive.registers.get("Current Limit") / drive.full_current if isinstance(drive, XDrive) else 1.0
    steps = pushing_at_deg * 4096 / 360
    monkeypatch.setattr(Plant, "STIFFNESS", full * module.MIN_PUSH_FRACTION * module.TORQUE / steps)


@pytest.mark.parametrize(("step_s", "late"), [(0.3, 0), (0.5, 9)])
@pytest.mark.parametrize("model", ["xm430-w350", "sts3215"])
def test_a_busy_machine_and_a_soft_gear_do_not_end_the_search_early(
    monkeypatch: pytest.MonkeyPatch, model: str, step_s: float, late: int
) -> None:
    """The goal takes seconds to get as far ahead as it may be; a servo that stands still before need not push yet."""
    spec = servo(model)
    bus = wire(spec)
    if "Bus Watchdog" in bus.chain.servo(3).table:
        monkeypatch.setattr(module, "WATCHDOG_STEPS", 120)
    soft(monkeypatch, bus, 7.0)
    slow_steps(monkeypatch, step_s, late)
    found = search(bus, spec)
    assert found.low_rad is not None
    assert found.high_rad is not None
    assert [math.degrees(found.low_rad), math.degrees(found.high_rad)] == pytest.approx(
        [angle_deg(step) for step in STOPS], abs=1.0
    )
    assert not bus.servo(3).torque


@pytest.mark.parametrize("step_s", [0.0, 0.3])
def test_a_shaft_that_stands_still_and_does_not_push_ends_the_search(
    monkeypatch: pytest.MonkeyPatch, step_s: float
) -> None:
    spec = servo("xm430-w350")
    bus = wire(spec)
    before = registers(bus)
    monkeypatch.setattr(Plant, "STIFFNESS", 0.0)
    slow_steps(monkeypatch, step_s)
    began = bus.clock()
    with pytest.raises(ServoFault, match="does not move, and does not push either"):
        search(bus, spec)
    assert bus.clock() - began < 60.0
    assert not bus.servo(3).torque
    assert registers(bus) == before


@pytest.mark.parametrize("torque", [0.0, -0.1, 0.51, math.nan])
def test_more_torque_than_half_is_refused(torque: float) -> None:
    with pytest.raises(ValueError, match="torque"):
        find_stops("/dev/null", 1_000_000, servo(), REACH, torque=torque)
