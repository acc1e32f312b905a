"""Scanning finds the servos of a port, whatever they speak, and says what they are."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, replace
from types import SimpleNamespace

import pytest

from controller.tools import scan as module
from controller.tools.scan import BAUDS, STEPS, Found, plan_scan, scan_port
from drivers.base.bus import ServoInfo
from drivers.base.errors import PortMissing
from drivers.sim import SimulatedBus


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.parametrize(
    ("ids", "noise", "told"), [((), True, [None]), ((), False, []), ((3, 5), True, [3, 5]), ((3,), False, [3])]
)
def test_noise_is_told_only_where_no_servo_answers(
    monkeypatch: pytest.MonkeyPatch, ids: tuple[int, ...], noise: bool, told: list[int | None]
) -> None:
    monkeypatch.setattr(module, "SerialPort", lambda port, baud: SimpleNamespace(open=lambda: 0, close=lambda: 0))
    monkeypatch.setattr(module, "ping_all", lambda link, step: SimpleNamespace(ids=ids, noise=noise))
    monkeypatch.setattr(module, "describe", lambda link, servo: servo)
    found = list(scan_port("port", [(1, 57_600)]))
    assert [item.servo for item in found] == told
    assert all((item.baud, item.protocol) == (57_600, 1) for item in found)


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


def test_a_row_tells_what_is_known_and_leaves_the_rest_empty() -> None:
    plain = ServoInfo(id=7, model="", model_number=999, firmware=3)
    assert Found(9600, 2, plain).row == ("9600", "2.0", "7", "number 999", "3", "", "", "", "")
    known = replace(plain, model="ax-12a", voltage_v=11.96, temperature_c=30.6, hardware_error=0x0C, torque=True)
    assert Found(1, 1, known).row == ("1", "1.0", "7", "ax-12a", "3", "12.0 V", "31 C", "0x0c", "on")
    assert Found(1, 1, replace(known, hardware_error=0, torque=False)).row[-2:] == ("", "off")
    assert len(Found(1, 1, None).row) == 9


def test_progress_of_protocol_1_goes_on_from_entry_to_entry() -> None:
    told: list[tuple[str, int]] = []
    with SimulatedBus([1], model="ax-12a", baud=500_000) as servos:
        plan = [(2, 500_000), (1, 500_000)]
        list(scan_port(servos.path, plan, lambda text, step: told.append((text, step))))
    steps = [step for _, step in told]
    assert steps[0] == 0 and steps[1] == STEPS == 254 and told[-1] == ("done", 508) and steps == sorted(steps)
    assert {text for text, step in told if 254 <= step < 508} == {"500000 baud, Protocol 1.0"}


def test_rates_are_those_of_the_manuals() -> None:
    assert plan_scan(None, [1])[0] == (1, 1_000_000)
    assert sorted(BAUDS[2]) == [9_600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000]
    assert sorted(BAUDS[1]) == [
        9_600, 19_200, 38_400, 57_600, 76_800, 115_200, 128_000, 200_000, 250_000, 400_000, 500_000, 1_000_000
    ]  # fmt: skip
    assert plan_scan([7, 8], [1, 2]) == [(1, 7), (1, 8), (2, 7), (2, 8)]
