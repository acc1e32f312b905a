"""drivers.dynamixel.startup over a simulated wire: nothing moves, nothing is written twice, nothing stays on.

Numbers are those of the fault list in docs/drivers.md.
"""

from __future__ import annotations

import numpy as np
import pytest

from drivers import open_bus
from drivers.base.bus import Bus, ServoSpec
from drivers.base.errors import BusError, CorruptReply, NoReply, ServoFault, ServoRefused, WrongModel
from drivers.dynamixel import startup
from drivers.dynamixel.startup import Policy
from drivers.servos import startup as shared_startup
from drivers.sim.serving.virtual import VirtualBus
from drivers.tables.tables import load_table
from tests.drivers.contract import SERVOS, settle

CALM = {"margin_s": 1.0, "watchdog_ms": 0}
IDS = [servo.id for servo in SERVOS]


@pytest.fixture
def wire() -> VirtualBus:
    return VirtualBus(SERVOS, driver=CALM)


def bus_on(wire: VirtualBus, **options: object) -> Bus:
    return open_bus("dynamixel", SERVOS, port=wire.link, clock=wire.clock, **{**CALM, **options})


def torques(wire: VirtualBus) -> list[bool]:
    return [wire.servo(i).torque for i in IDS]


def refuses(wire: VirtualBus, kind: type[BusError], match: str, **options: object) -> BusError:
    """Start-up fails with this error, and no servo is on afterwards."""
    with bus_on(wire, **options) as bus:
        with pytest.raises(kind, match=match) as caught:
            bus.start()
        assert not bus.running
    assert caught.value.hint
    return caught.value


# ---------------------------------------------------------------------------- 5: no jump


def test_an_old_goal_is_not_executed(wire: VirtualBus) -> None:
    for servo, position in zip(IDS, (1500, 2500, 2100), strict=True):
        wire.servo(servo).put("Goal Position", 2048)
        wire.servo(servo).place(position)
    before = [wire.servo(i).position_ticks for i in IDS]
    with bus_on(wire) as bus:
        bus.start()
        assert torques(wire) == [True] * 3
        for _ in range(20):
            bus.read()
            assert [wire.servo(i).position_ticks for i in IDS] == pytest.approx(before, abs=2)
        assert [wire.servo(i).goal for i in IDS] == before


def test_the_first_targets_ramp_from_a_pose_moved_by_hand(wire: VirtualBus) -> None:
    wire.servo(1).place(1700)
    with bus_on(wire) as bus:
        bus.start()
        here = bus.read().position_rad[0]
        sent = bus.write(np.zeros(3))
        assert abs(sent[0] - here) < 0.2
        settle(bus, [0.0, 0.0, 0.0])


# ---------------------------------------------------------------------------- 9: who is there


def test_a_missing_servo_is_named_and_nothing_is_written(wire: VirtualBus) -> None:
    wire.fault("mute:2")
    error = refuses(wire, NoReply, r'"brow" \(id 2\)')
    assert error.servo_ids == (2,)
    assert torques(wire) == [False] * 3
    assert not any(wire.servo(i).eeprom_writes for i in IDS)


def test_all_missing_servos_are_named_at_once(wire: VirtualBus) -> None:
    wire.fault("mute:1", "mute:7")
    assert refuses(wire, NoReply, "ids 1, 7").servo_ids == (1, 7)


def test_another_model_is_refused() -> None:
    others = [ServoSpec(i, "x", "xl430-w250" if i == 2 else "xl330-m288", -1, 1, 5, 50) for i in IDS]
    wire = VirtualBus(others)
    error = refuses(wire, WrongModel, "is xl430-w250, configured is xl330-m288")
    assert error.servo_ids == (2,)
    assert torques(wire) == [False] * 3


def test_two_servos_with_one_id_are_diagnosed(wire: VirtualBus) -> None:
    wire.fault("dup:2")
    error = refuses(wire, CorruptReply, "id 2")
    assert "two servos may have this id" in error.hint
    assert torques(wire) == [False] * 3


def test_a_servo_at_another_baud_rate_is_silent_and_the_hint_says_so(wire: VirtualBus) -> None:
    wire.fault("baud:2:57600")
    assert "baud" in refuses(wire, NoReply, "at 1000000 baud").hint


# ---------------------------------------------------------------------------- 3: somebody holds already


def held(wire: VirtualBus) -> None:
    for i in IDS:
        wire.servo(i).put("Torque Enable", 1)


def test_servos_that_hold_are_taken_over_without_letting_go(wire: VirtualBus) -> None:
    killed = bus_on(wire)
    killed.open()
    killed.start()
    settle(killed, [0.2, 0.2, 0.2])
    before = [wire.servo(i).position_ticks for i in IDS]
    killed._release()  # what the system does for a program that is killed
    with bus_on(wire) as bus:
        bus.start()
        assert torques(wire) == [True] * 3
        assert [wire.servo(i).position_ticks for i in IDS] == pytest.approx(before, abs=2)
    assert torques(wire) == [False] * 3


def test_taking_over_can_be_refused_or_let_go_first(wire: VirtualBus) -> None:
    held(wire)
    assert refuses(wire, ServoRefused, "hold with torque already", takeover="refuse").servo_ids == tuple(IDS)
    assert torques(wire) == [True] * 3
    with bus_on(wire, takeover="release") as bus:
        bus.start()
        assert torques(wire) == [True] * 3


def test_a_servo_that_holds_with_wrong_settings_is_not_dropped(wire: VirtualBus) -> None:
    wire.servo(2).put("Operating Mode", 4)
    held(wire)
    error = refuses(wire, ServoRefused, "Operating Mode must change from 4 to 3")
    assert 'takeover="release"' in error.hint
    assert wire.servo(2).torque


# ---------------------------------------------------------------------------- 15: permanent settings


def test_permanent_settings_are_written_only_when_they_differ_and_said(wire: VirtualBus) -> None:
    wire.servo(2).put("Drive Mode", 13)
    wire.servo(2).put("Operating Mode", 4)
    with bus_on(wire) as bus:
        bus.start()
        written = bus.report().eeprom_writes
        assert [line for line in written if "id 2" in line] == [
            'servo "brow" (id 2): Operating Mode 4 -> 3',
            'servo "brow" (id 2): Drive Mode 13 -> 0',
            'servo "brow" (id 2): Return Delay Time 250 -> 0',
        ]
        assert len(written) == 5
    counts = [dict(wire.servo(i).eeprom_writes) for i in IDS]
    with bus_on(wire) as bus:
        bus.start()
        assert bus.report().eeprom_writes == []
    assert [dict(wire.servo(i).eeprom_writes) for i in IDS] == counts


def test_servos_that_are_deaf_after_a_permanent_write_are_waited_for(wire: VirtualBus) -> None:
    wire.fault("eeprom-busy:*:60ms")
    with bus_on(wire, margin_s=0.03) as bus:
        bus.start()
        assert torques(wire) == [True] * 3


def test_a_goal_write_cannot_switch_torque_on_by_itself(wire: VirtualBus) -> None:
    wire.servo(1).put("Drive Mode", 8)
    with bus_on(wire) as bus:
        bus.start()
    assert wire.servo(1).register("Drive Mode") == 0


# ---------------------------------------------------------------------------- 6, 8: supply and latched errors


def test_too_little_voltage_is_waited_for_and_then_told(wire: VirtualBus) -> None:
    wire.fault("volts:2:3.2")
    error = refuses(wire, ServoFault, r'"brow" \(id 2\) reads 3.2 V, needs 3.5 V', voltage_wait_s=0.2)
    assert error.servo_ids == (2,)
    wire.clear("volts")
    error = refuses(wire, ServoFault, "reads 5.0 V, needs 6.0 V", voltage_wait_s=0.1, min_voltage_v=6.0)
    assert error.servo_ids == tuple(IDS)


def test_a_supply_that_comes_up_in_time_is_enough(wire: VirtualBus) -> None:
    wire.fault("volts:2:3.6:for=0.4s")
    with bus_on(wire, min_voltage_v=4.5) as bus:
        bus.start()
        assert torques(wire) == [True] * 3


def test_a_latched_error_needs_leave_to_reboot(wire: VirtualBus) -> None:
    wire.servo(2).latch(0x20)
    error = refuses(wire, ServoFault, r'"brow" \(id 2\) 0x20')
    assert error.servo_ids == (2,)
    assert torques(wire) == [False] * 3
    with bus_on(wire, reboot_faulted=True) as bus:
        bus.start()
        assert torques(wire) == [True] * 3
        assert wire.servo(2).register("Hardware Error Status") == 0
        settle(bus, [0.1, 0.1, 0.1])


def test_a_rebooted_servo_is_awaited_also_where_no_time_is_granted_beyond_the_wires(
    wire: VirtualBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    for servo in IDS:
        wire.servo(servo).put("Return Delay Time", 0)
    wire.servo(2).latch(0x20)
    with bus_on(wire, reboot_faulted=True) as bus:
        registers, port = bus._registers, bus._port
        reboot, put_all = registers.packets.reboot, registers.put_all

        def without_margin(*given: object) -> None:
            reboot(*given)
            port.margin_s = 0.0

        def with_margin(*given: object) -> None:
            port.margin_s = 1.0
            put_all(*given)

        monkeypatch.setattr(registers.packets, "reboot", without_margin)
        monkeypatch.setattr(registers, "put_all", with_margin)
        bus.start()
        assert torques(wire) == [True] * 3


def test_a_voltage_error_that_leaves_torque_alone_is_no_reason_to_reboot(wire: VirtualBus) -> None:
    wire.servo(2).put("Shutdown", 52)
    wire.servo(2).latch(0x01)
    with bus_on(wire) as bus:
        bus.start()
        assert torques(wire) == [True] * 3


def test_a_voltage_error_alone_is_cleared_where_the_supply_is_good_again(wire: VirtualBus) -> None:
    """XL330 servos switch their motor off for it (Shutdown 53), so that a reboot drops nothing."""
    wire.servo(2).latch(0x01)
    assert wire.servo(2).register("Shutdown") & 0x01
    with bus_on(wire) as bus:
        bus.start()
        assert torques(wire) == [True] * 3
        assert wire.servo(2).register("Hardware Error Status") == 0
    wire.servo(2).latch(0x21)
    refuses(wire, ServoFault, r'"brow" \(id 2\) 0x21')


# ---------------------------------------------------------------------------- 17: positions out of turn


@pytest.mark.parametrize("offset", [-512, 512])
def test_the_turn_of_a_limp_servo_begins_at_its_homing_offset(wire: VirtualBus, offset: int) -> None:
    """Beyond it, the servo would count from the other end once it is on, and a goal where it was would spin it."""
    wire.servo(2).put("Homing Offset", offset)
    wire.servo(2).place(offset + (4095 if offset < 0 else 0))
    with bus_on(wire) as bus:
        bus.start()
        here = wire.servo(2).position_ticks
        assert abs(wire.servo(2).goal - here) <= 1, "nothing moves at the start"
    wire.servo(2).place(offset + (4096 if offset < 0 else -1))
    assert "by hand" in refuses(wire, ServoFault, "outside one turn of 4096 steps").hint


@pytest.mark.parametrize("position", [-30, -1, 4096, 5568, -300, -(2**31)])
def test_a_position_outside_one_turn_is_refused(
    wire: VirtualBus, position: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    servo = wire.chain.servo(2)
    monkeypatch.setattr(servo, "position_ticks", lambda now: position)
    original = servo.read

    def read(address: int, length: int, now: float) -> tuple[int, bytes]:
        error, data = original(address, length, now)
        return (error, position.to_bytes(4, "little", signed=True)) if (address, length) == (132, 4) else (error, data)

    monkeypatch.setattr(servo, "read", read)
    error = refuses(wire, ServoFault, f"reads position {position}, outside one turn")
    assert error.servo_ids == (2,)
    assert torques(wire) == [False] * 3


def test_goals_stay_inside_the_servos_own_limits(wire: VirtualBus) -> None:
    wire.servo(1).put("Max Position Limit", 2148)
    with bus_on(wire) as bus:
        bus.start()
        for _ in range(60):
            sent = bus.write([0.4, 0.0, 0.0])
            bus.read()
        assert bus.scale.ticks(sent)[0] <= 2148


# ---------------------------------------------------------------------------- what is set before torque


def test_speed_acceleration_and_watchdog_are_set(wire: VirtualBus) -> None:
    with bus_on(wire, watchdog_ms=2000) as bus:
        bus.start()
        servo = wire.servo(1)
        assert servo.register("Profile Velocity") == np.ceil(8.0 / 0.0239691227)
        assert servo.register("Profile Acceleration") == np.ceil(200.0 / 0.37450752)
        assert servo.register("Bus Watchdog") == 100
        bus.stop()
        assert servo.register("Bus Watchdog") == 0


def test_a_watchdog_somebody_left_tripped_is_cleared(wire: VirtualBus) -> None:
    wire.servo(1).put("Bus Watchdog", 255)
    with bus_on(wire) as bus:
        bus.start()
        settle(bus, [0.1, 0.1, 0.1])


@pytest.mark.parametrize(("period", "steps"), [(0, 0), (1, 1), (20, 1), (21, 2), (200, 10), (99999, 127)])
def test_the_watchdogs_period_is_rounded_up(period: int, steps: int) -> None:
    assert Policy(watchdog_ms=period).watchdog_steps == steps


def test_a_status_level_somebody_changed_is_put_back(wire: VirtualBus) -> None:
    wire.servo(2).put("Status Return Level", 0)
    with bus_on(wire) as bus:
        bus.start()
        settle(bus, [0.1, 0.1, 0.1])


# ---------------------------------------------------------------------------- 4: switching off


@pytest.mark.parametrize("mute", [1, 2, 7])
def test_a_dead_servo_does_not_keep_the_others_on(wire: VirtualBus, mute: int) -> None:
    bus = bus_on(wire, margin_s=0.05)
    bus.open()
    bus.start()
    wire.fault(f"mute:{mute}")
    with pytest.raises(NoReply, match="not confirmed off") as caught:
        bus.close()
    assert caught.value.servo_ids == (mute,)
    assert not bus.is_open
    assert [wire.servo(i).torque for i in IDS if i != mute] == [False, False]
    wire.clear()


def test_a_servo_whose_answers_are_lost_is_off_and_reported(wire: VirtualBus) -> None:
    bus = bus_on(wire, margin_s=0.05)
    bus.open()
    bus.start()
    wire.fault("silent:2")
    with pytest.raises(NoReply) as caught:
        bus.close()
    assert caught.value.servo_ids == (2,)
    assert torques(wire) == [False] * 3


def test_lost_answers_are_asked_for_again_when_switching_off(wire: VirtualBus) -> None:
    with bus_on(wire, margin_s=0.05) as bus:
        bus.start()
        wire.fault("drop:*:every=3")
        bus.stop()
        wire.clear()
    assert torques(wire) == [False] * 3


def test_a_torque_that_does_not_come_on_leaves_nobody_on(wire: VirtualBus, monkeypatch: pytest.MonkeyPatch) -> None:
    wire.servo(7).latch(0x20)  # as if it happened after the check
    monkeypatch.setattr(startup.Startup, "_clear_faults", lambda *_: [])
    error = refuses(wire, ServoFault, r'did not switch their motor on: "neck" \(id 7\) \(hardware error 0x20\)')
    assert error.servo_ids == (7,)
    assert torques(wire) == [False] * 3


def test_a_policy_nobody_knows_is_named() -> None:
    with pytest.raises(ValueError, match="takeover"):
        Policy(takeover="maybe")


def test_old_firmware_is_not_asked_for_what_it_lacks(wire: VirtualBus, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    original = startup.Registers.get
    monkeypatch.setattr(
        startup.Registers, "get", lambda self, servo, name, **o: asked.append(name) or original(self, servo, name, **o)
    )
    for firmware, expected in ((45, False), (52, True)):
        del asked[:]
        monkeypatch.setattr(shared_startup, "load_table", lambda model, _=None, f=firmware: load_table(model, f))
        with bus_on(wire) as bus:
            bus.start()
        assert ("startup" in asked) is expected


def test_limits_of_speed_and_acceleration_are_a_step_at_least_and_what_fits_at_most(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    models, most = ("xl330-m288", "xl320"), {"speed_limit": [32767, 1023], "accel_limit": [32767]}
    for limit, steps in ((1e-9, {"speed_limit": [1, 1], "accel_limit": [1]}), (1e9, most)):
        servos = [ServoSpec(i, f"s{i}", model, -0.5, 0.5, limit, limit) for i, model in enumerate(models)]
        with VirtualBus(servos, driver=CALM | {"indirect": False}).bus() as bus:
            written: dict[str, dict[int, int]] = {}
            monkeypatch.setattr(
                bus._registers, "set_all", lambda values, name, into=written: into.update({name: values})
            )
            bus._startup()._prepare(servos)
            assert {name: list(written[name].values()) for name in steps} == steps
