"""drivers.core.registry: a bus by the name of its kind, and errors that say which kinds and models there are."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

import drivers
from drivers.base.bus import ServoSpec
from drivers.base.errors import DriverError, PluginError
from drivers.core import registry
from drivers.core.families import AnySettings, Family
from drivers.core.registry import FAMILIES, check_model, driver_of, open_bus, usual_rate_hz

SERVO = ServoSpec(1, "jaw", "rc-180", -0.5, 0.5, 5.0, 50.0)


def make_nothing(servos: tuple[ServoSpec, ...], **options: Any) -> None:
    """A driver with a fault of its own."""
    raise KeyError(f"{servos[0].name} {sorted(options)}")


@pytest.fixture
def lame(monkeypatch: pytest.MonkeyPatch) -> Family:
    """A family without a simulator, of another package."""
    family = Family(
        api=1, kind="lame", title="lame boards", driver=f"{__name__}:choose", settings=AnySettings,
        check_model=f"{__name__}:check_nothing",
    )  # fmt: skip
    monkeypatch.setitem(FAMILIES._loaded, "lame", family)
    return family


def test_every_kind_is_listed() -> None:
    assert {"dynamixel", "feetech", "maestro", "omote", "ssc32", "text"} <= {*drivers.kinds()}
    assert drivers.SIMULATED not in drivers.kinds()
    assert drivers.kinds() == sorted(drivers.kinds())


@pytest.mark.parametrize(
    ("kind", "name"), [("maestro", "MaestroBus"), ("ssc32", "Ssc32Bus"), ("text", "TextBus"), ("omote", "LineOutBus")]
)
def test_a_bus_is_made_closed_with_its_servos_and_options(kind: str, name: str) -> None:
    texts = {"template": "{us}\n"} if kind == "text" else {}
    bus = open_bus(kind, iter([SERVO]), port="/dev/null", margin_s=0.25, **texts)
    assert type(bus).__name__ == name
    assert driver_of(kind, [SERVO]) is type(bus)
    assert bus.servos == (SERVO,)
    assert not bus.is_open
    assert bus._margin_s == 0.25


def test_a_family_may_choose_its_driver_by_the_servos() -> None:
    new, old = (replace(SERVO, model=model) for model in ("xl330-m288", "ax-12a"))
    assert driver_of("dynamixel", [new]) is not driver_of("dynamixel", [old])


def test_a_simulated_bus_is_the_driver_of_its_family_over_a_simulated_far_end() -> None:
    with open_bus("simulated", [SERVO], simulates="maestro", process=False, stagger_s=0.0, margin_s=0.6) as bus:
        assert isinstance(bus, driver_of("maestro", [SERVO]))
        bus.start()
        assert bus.read().torque.all()


def test_faults_are_for_simulated_buses_and_an_empty_list_for_all() -> None:
    with pytest.raises(DriverError, match="only be given to a simulated bus") as caught:
        open_bus("maestro", [SERVO], port="/dev/null", faults=["mute:1"])
    assert 'kind = "simulated"' in caught.value.hint
    assert open_bus("maestro", [SERVO], port="/dev/null", faults=[])


def test_an_unknown_kind_names_those_there_are() -> None:
    with pytest.raises(PluginError, match="unknown bus kind 'maestr', did you mean 'maestro'") as caught:
        open_bus("maestr", [SERVO])
    assert caught.value.hint == f"use one of: {', '.join(sorted([*drivers.kinds(), 'simulated']))}"


@pytest.mark.parametrize("kind", ["robot", "host"])
def test_commands_of_simulate_are_no_kinds(kind: str) -> None:
    with pytest.raises(PluginError, match="unknown bus kind"):
        open_bus(kind, [SERVO])


@pytest.mark.parametrize(("kind", "simulates"), [("maestro", "dynamixel"), ("simulated", "maestro")])
def test_models_are_those_of_the_family_or_of_the_one_that_is_simulated(kind: str, simulates: str) -> None:
    check_model(kind, "RC-180", simulates)
    with pytest.raises(DriverError, match="no hobby servo model 'rc-18'") as caught:
        check_model(kind, "rc-18", simulates)
    assert "rc-180" in caught.value.hint


def test_a_family_without_a_simulator_says_so(lame: Family) -> None:
    with pytest.raises(PluginError, match="bus kind 'lame' has no simulator") as caught:
        open_bus("simulated", [SERVO], simulates="lame")
    assert 'kind = "lame"' in caught.value.hint


def test_an_error_in_the_driver_of_another_package_names_the_package(
    lame: Family, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(registry.FAMILIES, "load", lambda family, name: lambda servos: make_nothing)
    monkeypatch.setattr(registry.FAMILIES, "package_of", lambda kind: "lame-boards 2" if kind == "lame" else "")
    with pytest.raises(PluginError, match=r"'lame' of the package lame-boards 2 failed: KeyError: \"jaw \['port'\]\""):
        open_bus("lame", [SERVO], port="x")


@pytest.mark.parametrize(
    ("kind", "models", "baud", "rate_hz"),
    [
        ("dynamixel", ["xl330-m288"] * 24, 1_000_000, 100.0),
        ("dynamixel", ["xl330-m288"] * 25, 1_000_000, 50.0),
        ("dynamixel", ["xl330-m288"] * 24, 115_200, 50.0),
        ("dynamixel", ["xl330-m288"], 57_600, 50.0),
        ("dynamixel", ["ax-12a"], 1_000_000, 50.0),
        ("feetech", ["sts3215"] * 17, 1_000_000, 100.0),
        ("feetech", ["sts3215"] * 18, 1_000_000, 50.0),
        ("maestro", ["rc-180"], 115_200, 50.0),
    ],
)
def test_the_usual_rate_is_the_high_one_where_the_wire_carries_it(
    kind: str, models: list[str], baud: int, rate_hz: float
) -> None:
    assert usual_rate_hz(kind, models, baud) == rate_hz
