"""Scanning finds the servos of a port, whatever they speak, and says what they are."""

from __future__ import annotations

from dataclasses import FrozenInstanceError

import pytest

from controller.tools.scan import BAUDS, STEPS, Found, plan_scan, scan_port
from drivers.base.errors import PortMissing
from drivers.sim import SimulatedBus


def test_finds_every_servo_at_its_rate_and_says_how_far_it_is() -> None:
    told: list[tuple[str, int]] = []
    with SimulatedBus([3, 17], baud=57_600) as servos:
        plan = plan_scan([1_000_000, 57_600], [2])
        rows = [found.row for found in scan_port(servos.path, plan, lambda text, step: told.append((text, step)))]
    assert [row[:4] for row in rows] == [("57600", "2.0", "3", "xl330-m288"), ("57600", "2.0", "17", "xl330-m288")]
    assert rows[0][5].endswith(" V")
    assert rows[0][7:] == ("", "off")
    assert [step for _, step in told] == [0, STEPS, 2 * STEPS]
    assert told[1][0] == "57600 baud, Protocol 2.0"


@pytest.mark.parametrize(("model", "ids"), [("ax-12a", [1, 12]), ("sts3215", [9, 200]), ("scs0009", [4, 5])])
def test_finds_servos_of_protocol_1_and_their_makers(model: str, ids: list[int]) -> None:
    with SimulatedBus(ids, model=model, baud=500_000) as servos:
        found = list(scan_port(servos.path, plan_scan([500_000], [2, 1])))
    assert [(f.protocol, f.servo.id, f.servo.model, f.servo.torque) for f in found if f.servo] == [
        (1, i, model, False) for i in ids
    ]
    assert all(f.servo and f.servo.temperature_c for f in found)


def test_an_adapter_that_echoes_makes_no_servos_up() -> None:
    with SimulatedBus([7], model="ax-12a", faults=["echo"]) as servos:
        found = list(scan_port(servos.path, plan_scan([1_000_000], [1])))
    assert [(f.servo.id, f.servo.model) for f in found if f.servo] == [(7, "ax-12a")]


def test_damage_without_an_answer_is_told() -> None:
    assert Found(57_600, 1, None).row[2:4] == ("?", "answers are damaged: two servos with one id, or noise")


def test_all_rates_are_planned_the_usual_ones_first() -> None:
    assert plan_scan(None, [2, 1])[:2] == [(2, 1_000_000), (2, 57_600)]
    assert len(plan_scan(None, [2, 1])) == len(BAUDS[1]) + len(BAUDS[2])


def test_a_missing_port_is_one_error() -> None:
    with pytest.raises(PortMissing) as caught:
        list(scan_port("/dev/not-there", plan_scan([1_000_000], [1])))
    assert caught.value.hint


def test_a_record_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        object.__new__(Found).anything = 1
