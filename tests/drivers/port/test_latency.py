"""drivers.port.latency: a slow adapter is found by its timer and by late answers, and said with what mends it."""

from __future__ import annotations

import logging

import pytest

from drivers.base.bus import ServoSpec
from drivers.port.latency import MIN_DELAYS, ReplyDelays, latency_remedies, latency_rule, slow_answers
from drivers.servos.bus import ServoBus
from drivers.sim.serving.virtual import VirtualBus

SERVOS = [ServoSpec(i, f"servo {i}", "xl330-m288", -1.0, 1.0, 4.0, 40.0) for i in (1, 2)]


def test_a_judgement_needs_enough_answers_and_ignores_late_ones_of_a_busy_host() -> None:
    delays = ReplyDelays()
    for _ in range(MIN_DELAYS - 1):
        delays.add(0.001)
    assert delays.usual_s is None
    for _ in range(3):
        delays.add(0.5)
    assert delays.usual_s == 0.001
    delays.clear()
    assert delays.usual_s is None


@pytest.mark.parametrize(("timer_s", "delay_s"), [(None, None), (0.001, None), (None, 0.002), (0.001, 0.0005)])
def test_a_quick_port_is_not_mentioned(timer_s: float | None, delay_s: float | None) -> None:
    assert slow_answers("/dev/ttyUSB0", timer_s, delay_s) == ("", "")


def test_a_slow_timer_is_said_with_what_it_costs_and_the_command() -> None:
    message, command = slow_answers("/dev/ttyUSB0", 0.016, None)
    assert "/dev/ttyUSB0" in message
    assert "16 ms" in message
    assert "62 reads a second" in message
    assert command == "echo 1 | sudo tee /sys/bus/usb-serial/devices/ttyUSB0/latency_timer"


def test_late_answers_are_said_where_no_timer_can_be_read() -> None:
    message, command = slow_answers("/dev/ttyUSB3", None, 0.0162)
    assert "16.2 ms after their time on the wire" in message
    assert command == "sudo setserial /dev/ttyUSB3 low_latency"
    assert "far end" in slow_answers("socket://robot:4000", None, 0.0162)[1]


def test_every_remedy_names_the_device_or_its_serial_number() -> None:
    now, by_setserial, always = latency_remedies("/dev/ttyUSB7", "FT6RW5Q1")
    assert "ttyUSB7/latency_timer" in now
    assert by_setserial.split() == ["sudo", "setserial", "/dev/ttyUSB7", "low_latency"]
    assert latency_rule("FT6RW5Q1") in always
    assert "ATTRS" not in latency_rule()


@pytest.mark.parametrize(("family", "model"), [("dynamixel", "xl330-m288"), ("feetech", "sts3215")])
@pytest.mark.parametrize(("latency_s", "slow"), [(0.016, True), (0.001, False)])
def test_a_start_says_that_answers_come_late(
    family: str, model: str, latency_s: float, slow: bool, caplog: pytest.LogCaptureFixture
) -> None:
    servos = [ServoSpec(s.id, s.name, model, -1.0, 1.0, 4.0, 40.0) for s in SERVOS]
    wire = VirtualBus(servos, family, latency_s=latency_s, driver={"margin_s": 0.05, "watchdog_ms": 0})
    with caplog.at_level(logging.WARNING), wire.bus() as bus:
        bus.start()
        assert isinstance(bus, ServoBus)
        assert bus.reply_delay_s == pytest.approx(latency_s, abs=0.001)
    assert ("latency timer" in caplog.text) == slow
