"""drivers.dynamixel.compiled_read: the compiled way gives what the general one gives, and leaves the rest to it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from drivers.base.bus import Bus, BusState, ServoSpec
from drivers.dynamixel.compiled_read import CompiledRead
from drivers.dynamixel.telemetry import Telemetry
from drivers.sim.serving.virtual import VirtualBus

MODELS = {
    "alike": ("xl330-m288",) * 3,
    "mixed": ("xl330-m288", "xl320", "xm430-w350"),
    "small": ("xl320",) * 3,
}
FAULTS = ("mute:2", "alert:1", "flip:*:p=0.2", "hw:3:0x20", "temp:1:60", "late:2:70ms:every=2", "echo", "crc:3:every=2")
SEEN = [field.name for field in fields(BusState)]


def specs(models: tuple[str, ...]) -> list[ServoSpec]:
    return [
        ServoSpec(i, f"servo{i}", model, -0.6, 0.6, 4.0, 40.0, reverse=i == 2, zero_rad=0.1 * (i - 2))
        for i, model in enumerate(models, 1)
    ]


def drive(models: tuple[str, ...], options: dict[str, Any], careful: bool) -> Iterator[tuple[BusState, dict[str, Any]]]:
    """Every state of a bus that meets faults one after the other, and what it counted."""
    wire = VirtualBus(specs(models), seed=3)
    with wire.bus(margin_s=0.05, watchdog_ms=100, **options) as bus:
        if careful:
            bus._telemetry._compiled_read = lambda scale: None
        bus.start()
        for fault in ("", *FAULTS, "reboot", "pause"):
            if fault == "reboot":
                wire.chain.servos[0].reboot(wire.clock())
            elif fault == "pause":
                wire.clock.sleep(0.5)
            elif fault:
                wire.fault(fault)
            for k in range(4):
                bus.write(np.full(3, 0.3 * np.sin(0.4 * k)))
                yield bus.read(), bus.report().as_dict()
                wire.clock.sleep(0.02)
            wire.clear()
            wire.clock.sleep(0.05)
            bus.recover()


@pytest.mark.slow
@pytest.mark.parametrize("fast", [False, True])
@pytest.mark.parametrize("feedback", ["full", "position"])
@pytest.mark.parametrize("models", MODELS.values(), ids=MODELS)
def test_quick_and_careful_say_the_same(models: tuple[str, ...], feedback: str, fast: bool) -> None:
    options = {"feedback": feedback, "fast": fast, "reboot_faulted": True}
    both = zip(drive(models, options, False), drive(models, options, True), strict=True)
    for (quick, counted), (careful, as_well) in both:
        for name in SEEN:
            np.testing.assert_array_equal(getattr(quick, name), getattr(careful, name), name)
            assert getattr(quick, name).dtype == getattr(careful, name).dtype if name != "time_s" else True
        assert counted == as_well


@pytest.fixture
def bus() -> Iterator[Bus]:
    wire = VirtualBus(specs(MODELS["alike"]))
    with wire.bus(slow_group=0) as running:
        running.start()
        running.wire = wire
        yield running


def test_an_undisturbed_cycle_is_taken_and_gives_what_nobody_can_change(
    bus: Bus, monkeypatch: pytest.MonkeyPatch
) -> None:
    bus.read()
    with monkeypatch.context() as patch:
        patch.setattr(Telemetry, "_store", None)  # the general way would fail
        bus.write([0.1, 0.1, 0.1])
        first = bus.read()
        kept = first.position_rad.copy()
        bus.write([0.2, 0.2, 0.2])
        bus.wire.clock.sleep(0.05)
        second = bus.read()
    assert second.time_s > first.time_s
    assert (second.position_rad != kept).all()
    np.testing.assert_array_equal(first.position_rad, kept)
    for name in SEEN[1:]:
        assert not getattr(second, name).flags.writeable, name
        assert not getattr(second, name).flags.owndata or name not in {"position_rad", "age_s"}


def test_what_is_not_expected_changes_nothing(bus: Bus) -> None:
    bus.read()
    read: CompiledRead = bus._telemetry._compiled
    known, octets = read._known.copy(), read._octets.copy()
    read.prepare()
    for data in (b"", bytes(read.read.size), bytes(read.read.size + 1)):
        assert not read.take(data, 9.0)
        assert read.state is None
    np.testing.assert_array_equal(read._known, known)
    np.testing.assert_array_equal(read._octets, octets)
