"""drivers.servos.startup: start-up and stop in every protocol, in the order that moves nothing and leaves nobody on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.base.errors import BusError, NoReply, PortLost, ServoFault, ServoRefused, WrongModel
from drivers.servos.startup import MAX_OFF_RETRIES, Policy
from drivers.sim.serving.virtual import VirtualBus
from drivers.tables.tables import ControlTable, load_table
from tests.drivers.contract import SERVOS

MODELS = {"xl330-m288": "dynamixel", "mx1-28": "dynamixel", "ax-12a": "dynamixel", "sts3215": "feetech"}
IDS = [servo.id for servo in SERVOS]


@pytest.fixture(params=MODELS)
def wire(request: pytest.FixtureRequest) -> VirtualBus:
    servos = [replace(servo, model=request.param) for servo in SERVOS]
    return VirtualBus(servos, MODELS[request.param], driver={"margin_s": 0.05, "watchdog_ms": 0})


def torques(wire: VirtualBus) -> list[bool]:
    return [wire.servo(i).torque for i in IDS]


def refused(wire: VirtualBus, kind: type[BusError], match: str, **options: object) -> BusError:
    """Start-up fails with this error, and leaves no servo on that was off before."""
    before = torques(wire)
    with wire.bus(**options) as bus, pytest.raises(kind, match=match) as caught:
        bus.start()
    assert torques(wire) == before
    return caught.value


def hold(wire: VirtualBus) -> None:
    """A program before this one left its servos on, at goals where they are."""
    for servo in IDS:
        view = wire.servo(servo)
        view.put("Goal Position", view.position_ticks)
        view.put("Torque Enable", 1)


@pytest.mark.parametrize("takeover", ["adopt", "release", "refuse"])
def test_servos_that_hold_are_taken_over_as_the_policy_says(wire: VirtualBus, takeover: str) -> None:
    with wire.bus() as first:
        first.start()  # permanent settings are right from now on
    hold(wire)
    if takeover == "refuse":
        error = refused(wire, ServoRefused, "hold with torque already", takeover=takeover)
        assert error.servo_ids == tuple(IDS)
        return
    off: list[int] = []
    with wire.bus(takeover=takeover) as bus:
        wire.link.tap = lambda sent, data: off.append(sum(not on for on in torques(wire)))
        bus.start()
        wire.link.tap = None
        assert torques(wire) == [True] * 3
    assert (max(off) > 0) is (takeover == "release"), "only release switches them off for a moment"


def test_policies_that_do_not_exist_are_named() -> None:
    with pytest.raises(ValueError, match="takeover: must be"):
        Policy(takeover="maybe")


def test_a_wrong_model_is_named_before_anything_is_written(wire: VirtualBus) -> None:
    others = {"xl330-m288": "xm430-w350", "mx1-28": "ax-12a", "ax-12a": "mx1-28", "sts3215": "scs0009"}
    wire.servos = tuple(replace(s, model=others[s.model]) if s.id == 2 else s for s in wire.servos)
    error = refused(wire, WrongModel, f'"brow" .id 2. is .*, configured is {wire.servos[1].model}')
    assert error.servo_ids == (2,)
    assert wire.servo(1).eeprom_writes == {}


def test_servos_that_do_not_answer_are_named_at_once(wire: VirtualBus) -> None:
    wire.fault("mute:2", "mute:7")
    error = refused(wire, NoReply, "did not answer")
    assert error.servo_ids == (2, 7)


def test_too_little_voltage_is_waited_for_until_the_time_is_over(wire: VirtualBus) -> None:
    wire.fault("volts:2:3.0")
    begin_s = wire.clock()
    match = r'"brow" .id 2. reads 3\.0 V, needs 4\.0 V'
    error = refused(wire, ServoFault, match, min_voltage_v=4.0, voltage_wait_s=2.0)
    assert error.servo_ids == (2,)
    assert 2.0 < wire.clock() - begin_s < 3.5


def test_voltage_that_comes_in_time_is_enough(wire: VirtualBus) -> None:
    usual_v = table(wire).voltage / 10
    wire.fault(f"volts:2:{usual_v - 0.5}:for=1s")
    with wire.bus(min_voltage_v=usual_v - 0.3, voltage_wait_s=5.0) as bus:
        bus.start()
        assert wire.clock() > 1.0
        assert torques(wire) == [True] * 3


def test_nothing_moves_and_goals_are_at_the_positions(wire: VirtualBus) -> None:
    places = {servo: wire.servo(servo).position_ticks + 20 * servo for servo in IDS}
    for servo, place in places.items():
        wire.servo(servo).place(place)
        wire.servo(servo).put("Goal Position", 700)
    with wire.bus() as bus:
        bus.start()
        wire.clock.sleep(0.5)
        assert [abs(wire.servo(i).position_ticks - places[i]) <= 1 for i in IDS] == [True] * 3
        assert [abs(wire.servo(i).register("Goal Position") - places[i]) <= 1 for i in IDS] == [True] * 3
        state = bus.read()
        ticks = [places[i] for i in IDS]
        np.testing.assert_allclose(state.position_rad, bus.scale.radians(np.array(ticks)), atol=0.02)


def test_limits_in_the_servos_narrow_the_goals(wire: VirtualBus) -> None:
    names = ("Min Position Limit", "Max Position Limit") if "Max Position Limit" in table(wire) else (
        "CW Angle Limit", "CCW Angle Limit")  # fmt: skip
    middle = wire.servo(1).position_ticks
    wire.servo(1).put(names[0], middle - 10)
    wire.servo(1).put(names[1], middle + 12)
    with wire.bus() as bus:
        bus.start()
        assert (bus.scale.lowest[0], bus.scale.highest[0]) == (middle - 10, middle + 12)
        for _ in range(100):
            bus.write([0.4, 0.0, 0.0])
            wire.clock.sleep(0.02)
        assert wire.servo(1).register("Goal Position") == middle + 12


def table(wire: VirtualBus) -> ControlTable:
    return load_table(wire.servos[0].model)


def test_a_torque_that_does_not_come_on_leaves_no_servo_on(wire: VirtualBus, monkeypatch: pytest.MonkeyPatch) -> None:
    with wire.bus() as bus:
        original = bus._registers.get_all

        def off(ids: list[int], name: str) -> dict[int, int]:
            values = original(ids, name)
            return values | {2: 0} if name == "torque" and all(torques(wire)) else values

        monkeypatch.setattr(bus._registers, "get_all", off)
        with pytest.raises(ServoFault, match='did not switch their motor on: "brow"') as caught:
            bus.start()
        assert caught.value.servo_ids == (2,)
        assert torques(wire) == [False] * 3


@pytest.mark.parametrize("held", [True, False])
@pytest.mark.parametrize("where", ["below", "above"])
def test_a_position_outside_of_a_turn_is_no_goal(
    wire: VirtualBus, where: str, held: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A servo that holds may be a little outside of it; one that is limp counts another turn once it is on."""
    with wire.bus() as bus:
        startup, turn = bus._startup(), bus._registers.tables[2].ticks_per_turn
        slack, holding = (round(startup._slack(turn)), [2]) if held else (0, [])
        edges = {"below": (-slack, -slack - 1, 0), "above": (turn + slack - 1, turn + slack, turn - 1)}
        inside, outside, goal = edges[where]
        reads = {"position": inside, "offset": 0}
        monkeypatch.setattr(bus._registers, "get_all", lambda ids, name: dict.fromkeys(ids, reads[name]))
        assert startup.goals_at_present([2], holding) == {2: goal}
        reads["position"] = outside
        with pytest.raises(ServoFault, match=f"reads position {outside}, outside one turn of {turn} steps") as caught:
            startup.goals_at_present([2], holding)
        assert caught.value.servo_ids == (2,)
        assert "turn it back by hand" in caught.value.hint or held


def test_stop_names_who_is_not_confirmed_off_after_all_others_are_off(wire: VirtualBus) -> None:
    bus = wire.bus()
    bus.open()
    bus.start()
    wire.fault("mute:2")
    with pytest.raises(NoReply, match='not confirmed off on virtual: "brow"') as caught:
        bus.stop()
    assert caught.value.servo_ids == (2,)
    assert torques(wire) == [False, True, False]
    assert caught.value.hint
    with pytest.raises(NoReply, match='not confirmed off on virtual: "brow"'):
        bus.close()
    assert not bus.is_open
    bus.close()


def test_closing_switches_off_again_what_was_not_confirmed_off(wire: VirtualBus) -> None:
    with wire.bus() as bus:
        bus.start()
        wire.fault("mute:2")
        with pytest.raises(NoReply):
            bus.stop()
        assert (bus.running, bus.may_be_on) == (False, True)
        wire.clear()
    assert torques(wire) == [False] * 3
    assert not bus.may_be_on


def test_a_servo_that_held_goes_on_holding_where_another_cannot_start(
    wire: VirtualBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    with wire.bus() as first:
        first.start()  # permanent settings are right from now on
    hold(wire)
    wire.servo(2).put("Torque Enable", 0)
    with wire.bus(watchdog_ms=200) as bus:
        original = bus._registers.get_all

        def far(ids: list[int], name: str) -> dict[int, int]:
            return original(ids, name) | ({2: 50_000} if name == "position" else {})

        monkeypatch.setattr(bus._registers, "get_all", far)
        with pytest.raises(ServoFault, match="reads position 50000"):
            bus.start()
        assert torques(wire) == [True, False, True]
    assert torques(wire) == [True, False, True], "also after the bus was closed"
    wire.clock.sleep(1.0)
    if "Bus Watchdog" in load_table(wire.servos[0].model):
        assert [wire.servo(servo).register("Bus Watchdog") for servo in IDS] == [0] * 3


def test_a_start_that_fails_and_cannot_switch_off_again_is_switched_off_later(
    wire: VirtualBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    bus = wire.bus()
    bus.open()
    original = bus._registers.put_all

    def on(values: dict[int, int], name: str) -> None:
        original(values, name)
        if name == "torque" and set(values.values()) == {1}:
            wire.fault("mute:*")

    monkeypatch.setattr(bus._registers, "put_all", on)
    with pytest.raises(NoReply, match="not confirmed off"):
        bus.start()
    assert torques(wire) == [True] * 3
    assert (bus.running, bus.may_be_on) == (False, True)
    wire.clear()
    bus.close()
    assert torques(wire) == [False] * 3


def test_stop_tries_again_where_replies_are_lost(wire: VirtualBus) -> None:
    with wire.bus() as bus:
        bus.start()
        wire.fault(f"drop:2:count={MAX_OFF_RETRIES - 1}")
        bus.stop()
        assert torques(wire) == [False] * 3


def test_a_port_that_goes_away_while_switching_off_is_named(wire: VirtualBus, monkeypatch: pytest.MonkeyPatch) -> None:
    bus = wire.bus()
    bus.open()
    bus.start()
    original = bus._registers.get

    def unplug(servo: int, name: str, tries: int = 4) -> int:
        if servo == 2:
            wire.fault("unplug")
        return original(servo, name, tries)

    monkeypatch.setattr(bus._registers, "get", unplug)
    with pytest.raises(PortLost, match=r"not confirmed off on virtual: .*\(port virtual went away") as caught:
        bus.stop()
    assert 2 in caught.value.servo_ids
    assert 7 in caught.value.servo_ids
    wire.clear()
    bus.close()
