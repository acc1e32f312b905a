"""drivers.sim.wire.simulator: how the simulator of a family is found, and what its far end is made with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import pytest

from drivers.base.errors import PluginError
from drivers.base.options import option
from drivers.core.registry import FAMILIES
from drivers.core.traffic import TextDecoder
from drivers.sim.boards.ssc32 import SIMULATOR, Ssc32
from drivers.sim.wire.line import Line
from drivers.sim.wire.simulator import BoardOptions, Servos, Setting, Simulator, make_line, simulator_of


@dataclass(frozen=True, kw_only=True)
class NoBaud:
    """Options without a bit rate."""

    names: str = option("Names.", "")


@dataclass(frozen=True, kw_only=True)
class Unreadable:
    """Options of a type that no file can hold."""

    baud: complex = option("Rate.", 1j)


def with_simulator(monkeypatch: pytest.MonkeyPatch, found: object) -> None:
    """Make the family of SSC-32 boards name this object as its simulator."""
    load = FAMILIES.load
    wanted = FAMILIES.get("ssc32").simulator
    monkeypatch.setattr(FAMILIES, "load", lambda family, name: found if name == wanted else load(family, name))


def test_a_family_has_its_simulator():
    assert simulator_of("ssc32") is SIMULATOR


def test_an_unknown_kind_is_refused():
    with pytest.raises(PluginError, match="'nonsense'"):
        simulator_of("nonsense")


@pytest.mark.parametrize(
    ("found", "why"),
    [
        (3, "is no Simulator"),
        (replace(SIMULATOR, options=NoBaud), "has no option baud"),
        (replace(SIMULATOR, options=Unreadable), "Unreadable.baud: its type must be"),
        (replace(SIMULATOR, options=int), "must be a dataclass"),
    ],
)
def test_a_simulator_that_cannot_be_used_is_refused_with_the_reason(monkeypatch: pytest.MonkeyPatch, found, why: str):
    with_simulator(monkeypatch, found)
    with pytest.raises(PluginError, match=why) as error:
        simulator_of("ssc32")
    assert "'ssc32'" in str(error.value)
    assert error.value.hint == "update the package that it comes from"


def test_a_far_end_is_made_from_plain_values(monkeypatch: pytest.MonkeyPatch):
    made: list[tuple[Any, ...]] = []

    def far_end(servos: Servos, options: Mapping[str, Any], setting: Setting) -> Line:
        made.append((servos, options, setting))
        return Ssc32()

    with_simulator(monkeypatch, replace(SIMULATOR, far_end=far_end))
    make_line("ssc32", [(1, "rc-180")], 4.0, baud=9600, seed=5, options={"x": 1})
    make_line("ssc32", [], 4.0)
    assert made == [
        ([(1, "rc-180")], {"x": 1}, Setting(now_s=4.0, baud=9600, seed=5)),
        ([], {}, Setting(now_s=4.0, baud=1_000_000)),
    ]
    assert (made[1][2].seed, made[1][2].names) == (0, ())


def test_traffic_is_shown_as_text_by_default():
    def unused(*arguments: object) -> Line:
        raise AssertionError

    simulator = Simulator(far_end=unused, alone=unused, options=BoardOptions, help="")
    assert isinstance(simulator.decoder(Ssc32()), TextDecoder)
    assert BoardOptions().baud == 115_200
