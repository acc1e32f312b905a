"""P- and Y-series servos from start to recovery: units, permanent pointers, and Y-series' codes, state and gear."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from drivers.base.bus import Bus, ServoSpec
from drivers.base.errors import ServoFault, ServoRefused
from drivers.sim.serving.virtual import VirtualBus
from tests.drivers.contract import read_until, settle

MODELS = ("ph54-100-s500", "pm42-010-s260", "ym070-210-r051", "ym080-230-a099", "ym070-210-a051")
Y_MODELS = MODELS[2:]
TURN = {"ph54-100-s500": 1_003_846, "pm42-010-s260": 526_374}
"""Steps of a turn by the manual's specifications; of Y-series 524,288 with the model's electronic gear."""
SERVOS = (
    ServoSpec(1, "neck", "", -0.8, 0.8, 1.0, 10.0),
    ServoSpec(2, "waist", "", -0.5, 0.5, 1.0, 10.0, reverse=True),
)


def head(model: str, **driver: object) -> VirtualBus:
    servos = [replace(servo, model=model) for servo in SERVOS]
    return VirtualBus(servos, "dynamixel", driver={"margin_s": 0.05, **driver})


@pytest.fixture(params=MODELS)
def wire(request: pytest.FixtureRequest) -> VirtualBus:
    return head(request.param)


@pytest.fixture
def bus(wire: VirtualBus) -> Iterator[Bus]:
    with wire.bus() as running:
        running.start()
        yield running
        wire.clear()


def model(wire: VirtualBus) -> str:
    return wire.servos[0].model


def test_goals_arrive_in_the_makers_units_and_are_read_back(wire: VirtualBus, bus: Bus) -> None:
    state = settle(bus, [0.3, -0.2], 1e-3)
    turn = TURN.get(model(wire), 524_288)
    assert wire.servo(1).position_ticks == pytest.approx(0.3 / (2 * np.pi) * turn, abs=2 + turn / 4096)
    assert wire.servo(2).position_ticks == pytest.approx(0.2 / (2 * np.pi) * turn, abs=2 + turn / 4096), "reversed"
    assert state.torque.all()
    full = read_until(bus, lambda state: np.isfinite(state.voltage_v).all() and np.isfinite(state.temperature_c).all())
    assert full.voltage_v == pytest.approx(24.0, abs=0.5)
    assert full.temperature_c == pytest.approx(30.0, abs=2.0)
    assert np.isfinite(full.current_a).all()


def test_it_is_no_faster_than_it_was_told(wire: VirtualBus, bus: Bus) -> None:
    fastest, before = 0.0, bus.read()
    for _ in range(60):
        bus.write([0.8, 0.5])
        wire.clock.sleep(0.02)
        state = bus.read()
        fastest = max(fastest, float(np.abs(state.velocity_rad_s).max()))
        assert np.abs(state.position_rad - before.position_rad).max() <= 1.05 * (state.time_s - before.time_s) + 1e-3
        before = state
    assert 0.5 < fastest < 1.05


@pytest.mark.parametrize("asked", [3.0, 50.0])
def test_a_y_series_servo_accelerates_as_told_and_at_most_by_its_own_limit(asked: float) -> None:
    """YM070-210-R051: Acceleration Limit 313 x 10 rev/min2 are 5.46 rad/s2. Half of a step that is all ramp."""
    wire = VirtualBus([ServoSpec(1, "one", "ym070-210-r051", -1.2, 1.2, 30.0, asked)], "dynamixel")
    acceleration = min(asked, 313 * 10 * 2 * np.pi / 3600)
    with wire.bus() as bus:
        bus.start()
        begun, half_s = wire.clock(), np.sqrt(0.4 / acceleration)
        while wire.clock() - begun < half_s:
            bus.write([0.4])
            wire.clock.sleep(0.001)
        turned = wire.servo(1).position_ticks / 524_288 * 2 * np.pi
    assert turned == pytest.approx(0.2, rel=0.1)


def test_goals_stay_within_the_limits_of_specification_and_servo(wire: VirtualBus, bus: Bus) -> None:
    for _ in range(200):
        sent = bus.write([3.0, -3.0])
        wire.clock.sleep(0.02)
        bus.read()
    assert sent.tolist() == pytest.approx([0.8, -0.5], abs=1e-3)


def test_no_permanent_register_is_worn_by_a_start(wire: VirtualBus, bus: Bus) -> None:
    """Their pointers (Indirect Address) are permanent registers, unlike those of X-series."""
    written = set(wire.chain.servo(1).eeprom_writes)
    assert written <= {"Return Delay Time", "Operating Mode"}
    assert not any(name.startswith("Indirect") for name in written)


def test_nobody_feeds_the_watchdog_and_then_goals_begin_where_it_stands(wire: VirtualBus, bus: Bus) -> None:
    settle(bus, [0.2, 0.2], 1e-3)
    for _ in range(10):
        bus.write([0.8, -0.5])
        bus.read()
        wire.clock.sleep(0.01)
    wire.clock.sleep(1.0)
    here = bus.scale.radians(np.array([wire.servo(1).position_ticks, wire.servo(2).position_ticks]))
    assert here[0] < 0.5, "it stopped"
    bus.read()
    sent = bus.write([0.8, -0.5])
    assert np.abs(sent - here).max() < 0.1
    assert bus.report().errors["watchdog"] == 2
    settle(bus, [0.2, 0.2], 1e-3)


def test_an_overload_is_told_and_only_recover_switches_it_on_again(wire: VirtualBus, bus: Bus) -> None:
    settle(bus, [0.0, 0.0], 1e-3)
    bits = 5 if model(wire) in Y_MODELS else 0x20
    wire.servo(1).latch(bits)
    state = read_until(bus, lambda state: not state.torque[0] and state.hardware_error[0] == bits)
    assert state.torque[1]
    with pytest.raises(ServoFault, match="code 5" if bits == 5 else "0x20"):
        bus.recover([1])
    assert bus.driven.tolist() == [False, True]
    object.__setattr__(bus.policy, "reboot_faulted", True)
    bus.recover([1])
    assert wire.servo(1).torque
    assert bus.driven.all()
    settle(bus, [0.1, 0.1], 1e-3)


def test_an_error_that_persists_keeps_it_off(wire: VirtualBus, bus: Bus) -> None:
    if "Shutdown" in wire.chain.servo(1).table:
        wire.servo(1).put("Shutdown", 62)  # by default heat switches a P-series servo not off
    wire.fault("temp:1:95")
    read_until(bus, lambda state: not state.torque[0])
    object.__setattr__(bus.policy, "reboot_faulted", True)
    with pytest.raises(ServoFault):
        bus.recover([1])
    assert not wire.servo(1).torque
    wire.clear()
    bus.recover([1])
    assert wire.servo(1).torque


def test_everything_is_off_and_confirmed_at_the_end(wire: VirtualBus) -> None:
    with wire.bus() as bus:
        bus.start()
        settle(bus, [0.2, 0.2], 1e-3)
    assert not wire.servo(1).torque
    assert not wire.servo(2).torque
    assert not bus.may_be_on


# ---------------------------------------------------------------------------- Y-series alone


@pytest.mark.parametrize("name", Y_MODELS)
def test_goals_wait_until_a_brake_is_open(name: str) -> None:
    """e-Manual, Brake Delay and Goal Update Delay: a goal before that is refused, and would come as a jump later."""
    wire = head(name)
    with wire.bus() as bus:
        bus.start()
        assert wire.servo(1).register("Controller State") == 5
        sent = bus.write([0.1, 0.1])
        assert wire.servo(1).goal == pytest.approx(sent[0] / bus.scale.rad_per_tick[0], abs=1)


def test_a_motor_that_does_not_run_in_time_is_switched_off_again() -> None:
    wire = head("ym070-210-a051")
    wire.servo(2).put("Brake Delay", 4_000)
    with wire.bus() as bus:
        with pytest.raises(ServoFault, match=r'do not run 3 s after torque: "waist"'):
            bus.start()
        assert not wire.servo(1).torque
        assert not wire.servo(2).torque


@pytest.mark.parametrize("name", Y_MODELS)
def test_one_that_holds_is_released_and_started(name: str) -> None:
    """It refuses goals and torque until its brake is closed."""
    wire = head(name, takeover="release")
    wire.servo(1).put("Torque Enable", 1)
    wire.clock.sleep(1.0)
    with wire.bus() as bus:
        bus.start()
        settle(bus, [0.1, 0.1], 1e-3)


def test_one_that_does_not_let_go_in_time_is_not_started() -> None:
    wire = head("ym070-210-a051", takeover="release")
    wire.servo(1).put("Torque Enable", 1)
    wire.clock.sleep(1.0)
    wire.servo(1).put("Brake Delay", 4_000)
    with wire.bus() as bus:
        with pytest.raises(ServoFault, match=r'"neck".* is not off 3 s after'):
            bus.start()
        assert not wire.servo(2).torque


def test_the_others_seldom_wait_for_one_that_does_not_run() -> None:
    """Each try to start it takes seconds, in which nobody gets goals."""
    wire = head("ym070-210-a051")
    with wire.bus() as bus:
        bus.start()
        bus.read()
        wire.servo(1).put("Torque Enable", 0)
        wire.clock.sleep(1.0)
        wire.servo(1).put("Brake Delay", 4_000)
        with pytest.raises(ServoFault, match="do not run"):
            bus.recover([1])
        begun, waited = wire.clock(), 0.0
        while wire.clock() - begun < 200.0:
            before = wire.clock()
            bus.write([0.1, 0.1])
            bus.read()
            waited += wire.clock() - before if wire.clock() - before > 1.0 else 0.0
            wire.clock.sleep(0.1)
        assert 0.0 < waited < 0.15 * (wire.clock() - begun)
        wire.servo(1).put("Brake Delay", 20)
        read_until(bus, lambda state: bool(bus.driven.all()), 100.0)


@pytest.mark.parametrize("register", ["Electronic GearRatio Numerator", "Electronic GearRatio Denominator"])
def test_another_electronic_gear_is_refused_before_anything_moves(register: str) -> None:
    wire = head("ym070-210-r051")
    wire.servo(2).put(register, 7)
    with wire.bus() as bus:
        with pytest.raises(ServoRefused, match=f'"waist".*{register} 7') as caught:
            bus.start()
        assert "write" in caught.value.hint
        assert not wire.servo(1).torque


@pytest.mark.parametrize(("code", "starts"), [(0, True), (9, True), (18, True), (2, True), (5, False), (13, False)])
def test_codes_that_let_a_servo_start(code: int, starts: bool) -> None:
    """9 warns of its battery, 18 is the watchdog's, 2 the supply's, which is good again; 13 is its encoder's."""
    wire = head("ym070-210-r051")
    if code:
        wire.servo(1).latch(code)
    with wire.bus() as bus:
        if starts:
            bus.start()
            settle(bus, [0.1, 0.1], 1e-3)
            return
        with pytest.raises(ServoFault, match=f"code {code}"):
            bus.start()
        assert not wire.servo(2).torque


def test_codes_that_clear_does_not_end_stay_with_every_leave() -> None:
    wire = head("ym070-210-r051", reboot_faulted=True)
    wire.servo(1).latch(13)
    with wire.bus() as bus, pytest.raises(ServoFault, match="code 13"):
        bus.start()
    assert not wire.servo(1).torque


def test_positions_outlast_a_reboot_and_turns_beyond_one_are_refused() -> None:
    wire = head("ym070-210-r051")
    wire.servo(1).place(300_000)
    wire.chain.servo(1).reboot(wire.clock())
    wire.clock.sleep(1.0)
    assert wire.servo(1).position_ticks == 300_000
    with wire.bus() as bus, pytest.raises(ServoFault, match="reads position 300000"):
        bus.start()
    assert not wire.servo(1).torque
