"""drivers.protocol1.startup: nothing moves while servos are brought up, and permanent registers are written rarely."""

from __future__ import annotations

import os
import signal
import time
from dataclasses import replace

import numpy as np
import pytest

from drivers import check_model, open_bus
from drivers.base.bus import Bus
from drivers.base.errors import CorruptReply, DriverError, NoReply, ServoFault, ServoRefused, WrongModel
from drivers.packets.packet1 import Error1
from drivers.sim import SimulatedBus
from drivers.sim.serving.virtual import VirtualBus
from tests.drivers import contract
from tests.drivers.programs import program

CALM = {"margin_s": 0.05, "watchdog_ms": 0}


def servos_of(model: str) -> tuple[contract.ServoSpec, ...]:
    return tuple(replace(servo, model=model) for servo in contract.SERVOS)


def kind_of(model: str) -> str:
    return "feetech" if model.startswith("s") else "dynamixel"


class Head:
    """Simulated servos of one model in time that does not pass by itself, and drivers for them."""

    def __init__(self, model: str) -> None:
        self.model, self.servos = model, servos_of(model)
        self.wire = VirtualBus(self.servos, kind_of(model), driver=CALM)

    def bus(self, model: str = "", **options: object) -> Bus:
        servos = servos_of(model) if model else self.servos
        link, clock = self.wire.link, self.wire.clock
        return open_bus(kind_of(self.model), servos, port=link, clock=clock, **(CALM | options))

    def registers(self, name: str) -> list[int]:
        return [self.wire.servo(servo.id).register(name) for servo in self.servos]

    def untouched(self) -> bool:
        """Limp, and nothing permanent was written."""
        views = [self.wire.servo(servo.id) for servo in self.servos]
        return not any(view.torque or view.eeprom_writes for view in views)


@pytest.fixture
def head(request: pytest.FixtureRequest) -> Head:
    return Head(request.param)


def over(*models: str) -> pytest.MarkDecorator:
    return pytest.mark.parametrize("head", models, indirect=True)


# ---------------------------------------------------------------------------- 5: an old goal


@over("sts3215", "sm8512bl", "scs0009", "scs15", "ax-12a", "mx1-28")
def test_5_an_old_goal_is_no_jump(head: Head) -> None:
    low, high = (300, 700) if head.model in ("ax-12a", "scs0009", "scs15") else (1800, 2300)
    for servo in head.servos:
        view = head.wire.servo(servo.id)
        view.put("Goal Position", high)
        view.place(low)
    with head.bus() as bus:
        bus.start()
        head.wire.clock.sleep(0.1)
        assert head.registers("Present Position") == [low] * 3
        assert head.registers("Goal Position") == [low] * 3
        assert bus.read().torque.all()


@over("sts3215", "ax-12a")
def test_speed_acceleration_and_torque_are_limited_before_torque(head: Head) -> None:
    with head.bus(torque_limit=0.5) as bus:
        bus.start()
        speed = "Goal Velocity" if head.model == "sts3215" else "Moving Speed"
        scale = 0.0015339807878856412 if head.model == "sts3215" else 0.0116228475
        top = {"sts3215": 3400, "ax-12a": 1023}[head.model]
        assert head.registers(speed) == [min(int(np.ceil(8.0 / scale)), top)] * 3
        assert head.registers("Torque Limit") == [{"sts3215": 500, "ax-12a": 512}[head.model]] * 3
        head.wire.chain.servo(2).registers.put(speed, 0)  # as after a dip of the supply
        bus.write(np.zeros(3))
        bus.read()
        assert 0 not in head.registers(speed)


# ---------------------------------------------------------------------------- 9: not who was expected


@over("sts3215", "ax-12a")
def test_9_another_model_moves_nothing(head: Head) -> None:
    with head.bus("sts3250" if head.model == "sts3215" else "mx1-28") as bus:
        with pytest.raises(WrongModel, match=rf"is {head.model}, configured is .* 3 servos: ids 1, 2, 7"):
            bus.start()
        assert head.untouched()


@over("sts3032", "scs15")
def test_a_model_whose_number_nobody_knows_is_any_that_no_other_has(head: Head) -> None:
    with head.bus() as bus:
        bus.start()
        assert [info.model for info in bus.discover([1])] == [head.model]
        bus.stop()
        head.wire.servo(2).put("Model Number", 777)
        with pytest.raises(WrongModel, match=f"is sts3215, configured is {head.model}"):
            bus.start()


@over("sts3215", "scs0009", "ax-12a")
@pytest.mark.parametrize(("fault", "error"), [("dup:2", CorruptReply), ("baud:2:57600", NoReply), ("mute:2", NoReply)])
def test_9_a_double_id_and_a_servo_at_another_rate_are_told(head: Head, fault: str, error: type[Exception]) -> None:
    head.wire.servo(2).place(600 if head.model != "sts3215" else 1501)
    with head.bus() as bus:
        bus.discover([1])
        head.wire.fault(fault)
        with pytest.raises(error, match=r'"brow" \(id 2\)') as caught:
            bus.start()
        assert caught.value.servo_ids == (2,)
        assert not any(head.wire.servo(servo.id).torque for servo in head.servos)


@pytest.mark.parametrize(
    ("kind", "model", "hint"),
    [("feetech", "sts3216", "sts3215"), ("feetech", "xl330-m288", "scs0009"), ("dynamixel", "sts3215", "feetech")],
)
def test_models_of_other_families_are_refused(kind: str, model: str, hint: str) -> None:
    with pytest.raises(DriverError, match=model) as caught:
        check_model(kind, model)
    assert hint in caught.value.hint


@pytest.mark.parametrize(("kind", "model"), [("feetech", "STS3215"), ("dynamixel", "AX-12A"), ("dynamixel", "xl320")])
def test_models_of_the_family_are_taken(kind: str, model: str) -> None:
    check_model(kind, model)


# ---------------------------------------------------------------------------- 3: who holds already


@over("sts3215", "ax-12a")
@pytest.mark.parametrize("takeover", ["adopt", "release", "refuse"])
def test_3_servos_that_hold_are_taken_over_as_told(head: Head, takeover: str) -> None:
    for servo in head.servos:
        head.wire.servo(servo.id).put("Return Delay Time", 0)
        head.wire.servo(servo.id).put("Torque Enable", 1)
    with head.bus(takeover=takeover) as bus:
        if takeover == "refuse":
            with pytest.raises(ServoRefused, match="hold with torque already"):
                bus.start()
            return
        bus.start()
        assert head.registers("Torque Enable") == [1, 1, 1]


def test_options_that_cannot_be_are_refused() -> None:
    for options in ({"takeover": "grab"}, {"torque_limit": 0.0}, {"torque_limit": 1.5}):
        with pytest.raises(ValueError, match=next(iter(options))):
            open_bus("feetech", servos_of("sts3215"), port="unused", **options)


# ---------------------------------------------------------------------------- 8, 6: supply and faults


@over("sts3215", "ax-12a")
def test_8_too_little_supply_is_waited_for_and_told(head: Head) -> None:
    with head.bus(min_voltage_v=50.0, voltage_wait_s=0.0) as bus:
        with pytest.raises(ServoFault, match=r"needs 50\.0 V"):
            bus.start()
        assert head.untouched()


@over("sts3215", "ax-12a")
def test_6_a_servo_in_trouble_is_not_switched_on_unless_told_to(head: Head) -> None:
    head.wire.servo(2).latch(0x20)
    with head.bus() as bus:
        with pytest.raises(ServoFault, match=r'"brow" \(id 2\) 0x20'):
            bus.start()
        assert head.untouched()
    with head.bus(reboot_faulted=True) as bus:
        bus.start()
        assert bus.read().torque.all()


@over("sts3215", "ax-12a")
def test_6_a_servo_that_stays_in_trouble_leaves_nobody_on(head: Head) -> None:
    head.wire.fault("temp:2:95")
    with head.bus(reboot_faulted=True) as bus:
        head.wire.clock.sleep(0.12)
        with pytest.raises(ServoFault):
            bus.start()
        assert not any(head.wire.servo(servo.id).torque for servo in head.servos)


# ---------------------------------------------------------------------------- 12, 15: what is permanent


@over("sts3215", "ax-12a")
def test_12_15_permanent_registers_are_written_once_with_torque_off_and_locked_again(head: Head) -> None:
    for servo in head.servos:
        head.wire.servo(servo.id).put("Return Delay Time", 250)
    before = [head.wire.servo(servo.id).eeprom_writes for servo in head.servos]
    with head.bus() as bus:
        bus.start()
        assert head.registers("Return Delay Time") == [0, 0, 0]
        lines = bus.report().eeprom_writes
        assert [("Return Delay Time 250 -> 0" in line) for line in lines] == [True] * 3
        once = [head.wire.servo(servo.id).eeprom_writes for servo in head.servos]
        assert [sum(new.values()) - sum(old.values()) for new, old in zip(once, before, strict=True)] == [1] * 3
        bus.stop()
        bus.start()
        assert [head.wire.servo(servo.id).eeprom_writes for servo in head.servos] == once
        if head.model == "sts3215":
            assert head.registers("Lock") == [1, 1, 1]


@over("sts3215", "ax-12a")
def test_15_a_deaf_while_after_a_permanent_write_is_waited_out(head: Head) -> None:
    for servo in head.servos:
        head.wire.servo(servo.id).put("Return Delay Time", 250)
    head.wire.fault("eeprom-busy:*:120ms")
    with head.bus() as bus:
        bus.start()
        assert head.registers("Return Delay Time") == [0, 0, 0]


@over("sts3215")
def test_15_settings_of_a_servo_that_holds_are_not_touched(head: Head) -> None:
    head.wire.servo(2).put("Operating Mode", 1)
    head.wire.servo(2).put("Torque Enable", 1)
    with head.bus() as bus, pytest.raises(ServoRefused, match="Operating Mode must change from 1 to 0"):
        bus.start()
    with head.bus(takeover="release") as bus:
        bus.start()
        assert head.registers("Operating Mode") == [0, 0, 0]


@over("sts3215")
def test_a_servo_left_unlocked_is_locked(head: Head) -> None:
    head.wire.servo(2).put("Lock", 0)
    with head.bus() as bus:
        bus.start()
        assert head.registers("Lock") == [1, 1, 1]
        assert bus.report().eeprom_writes == []


@over("sts3215", "scs0009", "ax-12a")
def test_a_servo_set_to_turn_for_ever_gets_its_limits_back(head: Head) -> None:
    feetech = head.model != "ax-12a"
    top = 4095 if head.model == "sts3215" else 1023
    head.wire.servo(2).put("Max Position Limit" if feetech else "CCW Angle Limit", 0)
    with head.bus() as bus:
        bus.start()
        assert head.registers("Max Position Limit" if feetech else "CCW Angle Limit") == [top] * 3


@over("mx1-28")
def test_a_servo_set_to_several_turns_gets_one(head: Head) -> None:
    head.wire.servo(2).put("CW Angle Limit", 4095)
    with head.bus() as bus:
        bus.start()
        assert head.registers("CW Angle Limit") == [0, 0, 0]


@over("ax-12a")
def test_a_locked_servo_is_told_how_it_opens(head: Head) -> None:
    head.wire.servo(2).put("Lock", 1)
    with head.bus() as bus, pytest.raises(ServoRefused, match="did not take Return Delay Time") as caught:
        bus.start()
    assert "power off and on" in caught.value.hint


@over("ax-12a", "sts3215")
@pytest.mark.parametrize("level", [0, 1])
def test_a_servo_told_to_keep_quiet_is_told_to_speak(head: Head, level: int) -> None:
    name = "Response Level" if head.model == "sts3215" else "Status Return Level"
    head.wire.servo(2).put(name, level)
    with head.bus() as bus:
        bus.start()
        wanted = 1 if head.model == "sts3215" else 2
        assert head.registers(name) == [wanted] * 3
        assert bus.read().fresh.all()
        written = [line for line in bus.report().eeprom_writes if "(id 2)" in line and name in line]
        assert [line.partition(": ")[2] for line in written] == [f"{name} {level} -> {wanted}"] * (level != wanted)


# ---------------------------------------------------------------------------- 17: out of the turn


@over("sts3215")
def test_17_feedback_over_several_turns_is_switched_off(head: Head) -> None:
    head.wire.servo(2).put("Phase", 0x1C)
    with head.bus() as bus:
        bus.start()
        assert head.registers("Phase") == [12, 12, 12]


@over("sts3215")
@pytest.mark.parametrize("position", [5568, 4096, -30, -30 - 4096])
def test_17_a_position_outside_one_turn_is_never_a_goal(
    head: Head, position: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    with head.bus() as bus:
        get_all = bus._registers.get_all

        def far(ids: list[int], name: str) -> dict[int, int]:
            return get_all(ids, name) | ({2: position} if name == "position" else {})

        monkeypatch.setattr(bus._registers, "get_all", far)
        with pytest.raises(ServoFault, match="outside one turn of 4096"):
            bus.start()
        assert head.untouched()


# ---------------------------------------------------------------------------- 3: every way out


@pytest.mark.parametrize(("model", "how"), [("sts3215", "SIGTERM"), ("ax-12a", "SIGKILL")])
def test_3_every_way_out_switches_all_servos_off(model: str, how: str) -> None:
    """A switch sees to it where the program cannot: these servos have no watchdog."""
    servos = servos_of(model)
    with SimulatedBus(servos) as wire, program(kind_of(model), servos, wire.path, margin_s=0.5) as child:
        assert child.pid is not None
        os.kill(child.pid, getattr(signal, how))
        child.join(20)
        assert child.exitcode not in (0, None)
        end = time.monotonic() + (10.0 if how == "SIGKILL" else 0.0)
        while any(wire.servo(servo.id).torque for servo in servos):
            assert time.monotonic() < end
            time.sleep(0.01)


@over("sts3215", "ax-12a")
def test_the_slowest_servo_still_moves(head: Head) -> None:
    """A speed of 0 would be the fastest, so a step of 1 is the least."""
    servos = [replace(servo, max_speed_rad_s=1e-6, max_accel_rad_s2=1e-6) for servo in head.servos]
    with open_bus(kind_of(head.model), servos, port=head.wire.link, clock=head.wire.clock, **CALM) as bus:
        bus.start()
        feetech = head.model == "sts3215"
        assert head.registers("Goal Velocity" if feetech else "Moving Speed") == [1, 1, 1]
        if feetech:
            assert head.registers("Acceleration") == [1, 1, 1]


@over("ax-12a")
def test_input_voltage_alone_is_a_fault_only_where_it_switches_off(head: Head) -> None:
    volts, heat = Error1.INPUT_VOLTAGE, Error1.OVERHEATING
    with head.bus() as bus:
        bus.start()
        startup = bus._startup()
        for flags, shutdown, bad in (
            (volts, heat, {}),
            (volts, volts, {2: volts}),
            (heat, 0, {2: heat}),
            (volts | heat, 0, {2: volts | heat}),
            (0, volts | heat, {}),
        ):
            head.wire.servo(2).put("Shutdown", shutdown)
            bus._registers.flags[2] = flags
            assert startup._faults([2]) == bad
