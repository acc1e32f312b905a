"""drivers.core.families: what a family may set, and what every family of omote does set."""

from __future__ import annotations

from dataclasses import FrozenInstanceError
from typing import Any

import pytest

from drivers.base.options import check_options, entries
from drivers.core.families import (
    API,
    BOARD_BAUD,
    RESERVED,
    SERVO_BAUD,
    AnySettings,
    Family,
    PulseSettings,
    ServoSettings,
)
from drivers.core.registry import FAMILIES, kinds


@pytest.mark.parametrize(
    ("watchdog_ms", "rate_hz", "fits"),
    [(None, 50.0, True), (None, 10.0, True), (None, 9.9, False), (0, 1.0, True), (20, 100.0, True), (19, 100.0, False)],
)
def test_a_watchdog_spans_two_cycles_or_is_off(watchdog_ms: int | None, rate_hz: float, fits: bool) -> None:
    settings = ServoSettings(watchdog_ms=watchdog_ms)
    if fits:
        settings.check(rate_hz)
    else:
        with pytest.raises(ValueError, match="watchdog_ms must be 0 or span two cycles"):
            settings.check(rate_hz)


def test_nothing_is_set_unless_a_file_sets_it() -> None:
    for settings in (AnySettings, ServoSettings, PulseSettings):
        assert all(entry.default is None for entry in entries(settings))
        check_options(settings, RESERVED)


def limits(settings: type, name: str) -> tuple[Any, ...]:
    (found,) = [entry.option for entry in entries(settings) if entry.name == name]
    return found.at_least, found.at_most, found.above, found.choices


def test_limits_of_the_options() -> None:
    assert limits(AnySettings, "margin_s") == (0, 600, None, ())
    assert limits(PulseSettings, "stagger_s") == (0, 1, None, ())
    assert limits(ServoSettings, "watchdog_ms") == (0, 2540, None, ())  # 127 steps of 20 ms
    assert limits(ServoSettings, "min_voltage_v") == (None, 60, 0, ())
    assert limits(ServoSettings, "voltage_wait_s") == (0, 600, None, ())
    assert limits(ServoSettings, "slow_group") == (0, 252, None, ())
    assert limits(ServoSettings, "takeover")[3] == ("adopt", "release", "refuse")
    assert limits(ServoSettings, "feedback")[3] == ("full", "position")


@pytest.mark.parametrize("kind", ["dynamixel", "feetech", "maestro", "omote", "ssc32", "text"])
def test_every_family_of_omote_can_be_loaded_and_keeps_off_reserved_keys(kind: str) -> None:
    family = FAMILIES.get(kind)
    assert (family.api, family.kind) == (API, kind)
    assert {entry.name for entry in entries(family.settings)}.isdisjoint(RESERVED)
    assert issubclass(family.settings, AnySettings)
    for reference in (family.driver, family.check_model, family.simulator):
        assert FAMILIES.load(family, reference)


def test_servos_on_boards_for_hobby_servos_can_be_calibrated_by_their_pulses() -> None:
    by_check = {kind: FAMILIES.get(kind).check_model.endswith(":check_hobby") for kind in kinds()}
    assert {kind for kind, is_hobby in by_check.items() if is_hobby} == {"maestro", "ssc32", "text"}
    assert all(FAMILIES.get(kind).hobby for kind, is_hobby in by_check.items() if is_hobby)


def test_a_family_is_one_of_boards_unless_it_says_otherwise() -> None:
    family = Family(api=1, kind="x", title="x", driver="a:b", settings=AnySettings, check_model="a:b")
    assert (family.baud, family.hobby, family.simulator, family.install) == (115_200, False, "", "")
    assert (SERVO_BAUD, BOARD_BAUD) == (1_000_000, 115_200)
    assert FAMILIES.get("dynamixel").baud == SERVO_BAUD


@pytest.mark.parametrize("settings", [AnySettings, ServoSettings, PulseSettings])
def test_definitions_are_made_by_name_and_kept(settings: Any) -> None:
    with pytest.raises(TypeError, match="positional"):
        settings(0.1)
    with pytest.raises(FrozenInstanceError):
        settings().margin_s = 0.1
    with pytest.raises(TypeError, match="positional"):
        Family(API, "kind", "title", "a:b", AnySettings, "a:c", "a:d")  # type: ignore[misc]
    with pytest.raises(FrozenInstanceError):
        FAMILIES.get("maestro").kind = "other"  # type: ignore[misc]
