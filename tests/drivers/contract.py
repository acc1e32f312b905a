"""What every bus must do, whatever the driver: one class of tests that runs over each of them."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import ClassVar

import numpy as np
import pytest

from drivers.base.bus import Bus, BusState, ServoSpec
from drivers.base.errors import BusError, DriverError, PortLost, PortMissing
from drivers.sim.serving.virtual import VirtualLink
from drivers.sim.servos.device import SimulatedServo

SERVOS = (
    ServoSpec(1, "jaw", "xl330-m288", -0.6, 0.4, 8.0, 200.0),
    ServoSpec(2, "brow", "xl330-m288", -0.5, 0.5, 8.0, 200.0, reverse=True),
    ServoSpec(7, "neck", "xl330-m288", -0.3, 0.9, 8.0, 200.0, zero_rad=0.2),
)
STEP_RAD = 2 * np.pi / 4096
PERIOD_S = 0.005
CYCLE_S = 0.02


def pause(bus: Bus, span_s: float = PERIOD_S) -> None:
    """Let time pass, in the time that the bus lives in."""
    getattr(bus._clock, "sleep", time.sleep)(span_s)


def settle(
    bus: Bus, target: np.ndarray | list[float], tolerance: float = 2 * STEP_RAD, *, measured: bool = True
) -> BusState:
    """Drive towards a target until it is measured there (or, where nothing is measured, said to be there)."""
    end = bus._clock() + 10.0
    while True:
        bus.write(target)
        state = bus.read()
        known = state.fresh.all() or not measured
        if known and np.abs(state.position_rad - target).max() < tolerance:
            return state
        if bus._clock() > end:
            raise AssertionError(f"still at {state.position_rad}, wanted {target}")
        pause(bus)


def step(bus: Bus, target: np.ndarray | list[float]) -> BusState:
    """Drive one cycle."""
    bus.write(target)
    return bus.read()


def read_until(bus: Bus, done: Callable[[BusState], bool], timeout_s: float = 60.0) -> BusState:
    """Read until something is known."""
    end = bus._clock() + timeout_s
    while not done(state := bus.read()):
        assert bus._clock() < end, state
        pause(bus)
    return state


def all_known(values: np.ndarray, wanted: bool) -> bool:
    """Whether all values have arrived, where any are wanted."""
    return not wanted or bool(np.isfinite(values).all())


def link_of(bus: Bus) -> VirtualLink:
    """The port of a bus that runs in virtual time, with short waits from now on; other tests are skipped."""
    port = getattr(bus, "_new", bus)._port
    link = getattr(port, "link", port)
    if not isinstance(link, VirtualLink):
        pytest.skip("this takes seconds; the same driver does it in virtual time")
    port.margin_s = 0.005
    return link


def angle_of(spec: ServoSpec, servo: SimulatedServo, ticks: float) -> float:
    """The angle of a servo at a step."""
    shaft = (ticks - servo.table.center) * servo.table.rad_per_tick
    return (-1.0 if spec.reverse else 1.0) * (shaft - spec.zero_rad)


class GoalWatch:
    """Drives cycles; no goal of one servo may lie further from where it is than its top speed takes it in a cycle."""

    def __init__(self, bus: Bus, spec: ServoSpec, servo: SimulatedServo) -> None:
        self._bus, self._spec, self._servo = bus, spec, servo
        self._written_s = bus._clock()

    def cycle(self, target: np.ndarray) -> float:
        """Drive one cycle; returns how far the goal moved."""
        bus, servo = self._bus, self._servo
        before, here = servo.goal, servo.position_ticks(bus._clock())
        span_s, self._written_s = bus._clock() - self._written_s, bus._clock()
        step(bus, target)
        goal, was, shaft = (angle_of(self._spec, servo, ticks) for ticks in (servo.goal, before, here))
        reach = self._spec.max_speed_rad_s * span_s + 2 * servo.table.rad_per_tick
        assert goal == was or min(abs(goal - shaft), abs(goal - was)) <= reach, (goal, was, shaft, reach)
        pause(bus, CYCLE_S)
        return abs(goal - was)


class BusContract:
    """Subclasses give a fixture ``bus``: a closed bus of ``SERVOS``, alone on its wire, and say what the family can.

    Attributes
    ----------
    SERVOS : three servos whose ranges hold every angle from -0.3 to 0.4 rad and, for the third, up to 0.5.
    MODELS : what ``discover`` calls them.
    ABSENT_ID : an id that nobody has; None where the family cannot tell.
    STEP_RAD : the coarsest step of the three.
    VOLTS : supply that every servo reads; None where it cannot be asked.
    TEMPERATURE : temperatures can be asked.
    MEASURES : positions are measured; otherwise a position is what the servo was told, and never fresh.
    TORQUE : motors say whether they are on; otherwise the bus only knows what it told them.
    """

    SERVOS: ClassVar[tuple[ServoSpec, ...]] = SERVOS
    MODELS: ClassVar[tuple[str, ...]] = ("xl330-m288",) * 3
    ABSENT_ID: ClassVar[int | None] = 3
    STEP_RAD: ClassVar[float] = STEP_RAD
    VOLTS: ClassVar[float | None] = 5.0
    TEMPERATURE: ClassVar[bool] = True
    MEASURES: ClassVar[bool] = True
    TORQUE: ClassVar[bool] = True

    def settle(self, bus: Bus, target: list[float]) -> BusState:
        """Drive towards a target until it is there."""
        return settle(bus, target, 2 * self.STEP_RAD, measured=self.MEASURES)

    def on(self, bus: Bus) -> list[bool]:
        """Which motors are on, as far as the family can tell."""
        if self.TORQUE:
            return [bool(info.torque) for info in bus.discover(bus.ids)]
        return [bool(on) for on in bus.read().torque]

    def test_a_bus_opens_and_closes_any_number_of_times(self, bus: Bus) -> None:
        assert not bus.is_open
        for _ in range(2):
            bus.open()
            assert bus.is_open
            assert not bus.running
            bus.close()
            bus.close()
            assert not bus.is_open

    def test_discover_names_who_is_there_without_moving_anything(self, bus: Bus) -> None:
        ids = [*bus.ids] if self.ABSENT_ID is None else [*bus.ids, self.ABSENT_ID]
        torque = False if self.TORQUE else None
        with bus:
            found = bus.discover(ids)
            assert [(info.id, info.model, info.torque) for info in found] == [
                (servo.id, model, torque) for servo, model in zip(self.SERVOS, self.MODELS, strict=True)
            ]
            volts = None if self.VOLTS is None else pytest.approx(self.VOLTS, abs=0.3)
            assert all(info.voltage_v == volts for info in found)

    def test_start_switches_on_without_a_movement(self, bus: Bus) -> None:
        with bus:
            before = bus.read()
            assert (before.fresh == self.MEASURES).all()
            bus.start()
            assert bus.running
            after = bus.read()
            assert after.torque.all()
            known = np.isfinite(before.position_rad)
            assert known.all() or not self.MEASURES
            moved = np.abs(after.position_rad - before.position_rad)[known]
            assert (moved <= self.STEP_RAD * 1.5).all()

    def test_targets_are_reached_and_measured(self, bus: Bus) -> None:
        with bus:
            bus.start()
            state = self.settle(bus, [0.2, -0.3, 0.5])
            assert (state.fresh == self.MEASURES).all()
            assert (state.age_s >= 0).all()
            assert (state.age_s < 1).all() or not self.MEASURES
            assert not state.error.any()
            assert not state.silent.any()

    def test_what_was_sent_is_returned_after_limits(self, bus: Bus) -> None:
        low = np.array([servo.min_rad for servo in self.SERVOS])
        high = np.array([servo.max_rad for servo in self.SERVOS])
        with bus:
            bus.start()
            for target, wall in ((np.full(3, 9.0), high), (np.full(3, -9.0), low)):
                end = bus._clock() + 10
                while np.abs((sent := bus.write(target)) - wall).max() > self.STEP_RAD:
                    assert bus._clock() < end
                    pause(bus)
                assert (sent <= high).all()
                assert (sent >= low).all()
            assert bus.report().limits_hit > 0

    def test_first_targets_are_a_ramp_from_where_the_servos_are(self, bus: Bus) -> None:
        speed = np.array([servo.max_speed_rad_s for servo in self.SERVOS])
        with bus:
            bus.start()
            here = bus.read().position_rad
            start = bus._clock()
            sent = bus.write([servo.max_rad for servo in self.SERVOS])
            reach = speed * (bus._clock() - start + 0.05) + self.STEP_RAD
            assert (np.abs(sent - here) <= reach).all()

    def test_a_target_that_is_no_number_keeps_the_last_one(self, bus: Bus) -> None:
        with bus:
            bus.start()
            self.settle(bus, [0.1, 0.1, 0.1])
            sent = bus.write([np.nan, 0.1, np.inf])
            np.testing.assert_allclose(sent, 0.1, atol=self.STEP_RAD)
            assert bus.report().refused_targets == 2

    def test_arrays_that_leave_the_bus_are_read_only(self, bus: Bus) -> None:
        with bus:
            bus.start()
            arrays = [bus.write(np.zeros(3))]
            state = bus.read()
            arrays += [getattr(state, name) for name in BusState.__slots__ if name != "time_s"]
            for array in arrays:
                assert array.shape == (3,)
                assert not array.flags.writeable

    def test_slow_values_arrive_in_turn_and_what_cannot_be_asked_is_nan(self, bus: Bus) -> None:
        volts, celsius = self.VOLTS is not None, self.TEMPERATURE
        with bus:
            bus.start()
            state = read_until(bus, lambda s: all_known(s.voltage_v, volts) and all_known(s.temperature_c, celsius))
            assert (np.isfinite(state.voltage_v) == volts).all()
            assert (np.isfinite(state.temperature_c) == celsius).all()
            if self.VOLTS is not None:
                np.testing.assert_allclose(state.voltage_v, self.VOLTS, atol=0.5)
            assert not celsius or (state.temperature_c > 10).all()

    def test_wrong_use_is_told(self, bus: Bus) -> None:
        with pytest.raises(PortLost, match="not open"):
            bus.read()
        with bus:
            with pytest.raises(BusError, match="not started"):
                bus.write(np.zeros(3))
            bus.start()
            with pytest.raises(ValueError, match="angle_rad"):
                bus.write(np.zeros(4))

    def test_stop_switches_everything_off_and_may_be_repeated(self, bus: Bus) -> None:
        with bus:
            bus.start()
            bus.stop()
            assert not bus.running
            assert not any(self.on(bus))
            bus.stop()
            bus.start()
            assert all(self.on(bus))

    def test_an_error_in_the_loop_leaves_nothing_on(self, bus: Bus) -> None:
        with pytest.raises(ZeroDivisionError), bus:
            bus.start()
            raise ZeroDivisionError
        assert not bus.running
        assert not bus.is_open

    @pytest.mark.parametrize("fault", ["mute:2", "silent:2"])
    def test_a_servo_that_was_silent_is_sent_nothing_and_then_starts_where_it_is(self, bus: Bus, fault: str) -> None:
        with bus:
            link = link_of(bus)
            bus.start()
            self.settle(bus, [0.3, -0.3, 0.3])
            if not self.MEASURES:
                self._pulses_go_on(bus, link)
                return
            servo = link._line.servo(2)
            watch = GoalWatch(bus, self.SERVOS[1], servo)
            goals, away = np.array([0.3, -0.3, 0.3]), np.array([-0.2, 0.3, -0.2])
            link._line.faults.add([fault], bus._clock())
            read_until(bus, lambda state: not bus.driven[1])
            servo.registers.put("Goal Position", servo.goal + 5)  # where it receives, a goal would undo this
            goal, end = servo.goal, bus._clock() + 2.5
            while bus._clock() < end:
                assert watch.cycle(away) == 0.0
            assert servo.goal == goal
            assert bus.driven.tolist() == [True, False, True] and bus.report().not_driven == (2,)
            assert np.abs(bus.read().position_rad - away)[[0, 2]].max() < 3 * self.STEP_RAD, "the others went on"
            link._line.faults.clear(None, bus._clock())
            end = bus._clock() + 4.0
            while bus._clock() < end:
                watch.cycle(away)
            assert bus.driven.all() and bus.report().not_driven == ()
            assert np.abs(bus.read().position_rad - away).max() < 3 * self.STEP_RAD
            self.settle(bus, goals.tolist())

    def _pulses_go_on(self, bus: Bus, link: VirtualLink) -> None:
        """Servos that measure nothing: a board that does not answer gets all goals, and limits of speed hold."""
        link._line.faults.add(["mute:*"], bus._clock())
        for _ in range(50):
            bus.write([-0.2, 0.3, -0.2])
            bus.read()
            pause(bus, CYCLE_S)
        assert bus.driven.all() and bus.report().not_driven == ()
        link._line.faults.clear(None, bus._clock())
        self.settle(bus, [-0.2, 0.3, -0.2])

    @pytest.mark.parametrize("sick", ["mute:2", "hw:2:0x20"])
    def test_a_sick_servo_stays_out_when_the_port_comes_back_and_joins_where_it_is(self, bus: Bus, sick: str) -> None:
        with bus:
            link = link_of(bus)
            bus.start()
            self.settle(bus, [0.3, -0.3, 0.3])
            servos = link._line.servo if self.MEASURES else None
            link._line.faults.add([sick] if servos else [], bus._clock())
            link._line.faults.add(["unplug:for=1s"], bus._clock())
            with pytest.raises(PortLost):
                step(bus, [0.3, -0.3, 0.3])
            with pytest.raises(PortMissing):
                bus.reconnect()
            pause(bus, 1.1)
            bus.reconnect()
            if servos is None:
                self.settle(bus, [-0.2, 0.3, -0.2])
                return
            servo, target = servos(2), np.array([-0.2, 0.3, -0.2])
            watch = GoalWatch(bus, self.SERVOS[1], servo)
            assert bus.driven.tolist() == [True, False, True] and bus.report().not_driven == (2,)
            for _ in range(100):
                assert watch.cycle(target) == 0.0
            assert np.abs(bus.read().position_rad - target)[[0, 2]].max() < 3 * self.STEP_RAD, "the others went on"
            link._line.faults.clear(None, bus._clock())
            if sick.startswith("hw"):
                servo.reboot(bus._clock())
            end = bus._clock() + 5.0
            while bus._clock() < end:
                watch.cycle(target)
            assert bus.driven.all() and servo.torque
            assert np.abs(bus.read().position_rad - target).max() < 3 * self.STEP_RAD

    def test_counters_are_a_copy(self, bus: Bus) -> None:
        with bus:
            bus.start()
            bus.write(np.zeros(3))
            bus.read()
            report = bus.report()
            assert (report.cycles, report.writes, report.errors) == (1, 1, {})
            report.count("no_reply", 1)
            assert bus.report().errors == {}
            assert bus.report().as_dict()["cycles"] == 1

    def test_errors_of_the_room_are_one_tree(self) -> None:
        assert issubclass(PortLost, DriverError)
        assert issubclass(BusError, DriverError)
