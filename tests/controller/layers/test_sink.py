"""controller.layers.sink: what links may ask is what faces, groups of heads and players do, under the same names."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from controller.base.errors import ParameterError
from controller.base.parameters import PARAMETERS as P
from controller.base.placement import Placement
from controller.layers.commands import CommandState
from controller.layers.heads import Group, Heads, Turns, _Players
from controller.layers.sink import CommandSink, Directory, HeadSink, Player, TurnTaking
from controller.links.line.script import Script
from controller.links.line.show import Shows

PAIRS = [
    (CommandSink, CommandState), (CommandSink, Group), (HeadSink, CommandState), (Directory, Heads),
    (TurnTaking, Turns), (Player, _Players),
    (Player, Shows(lambda name: Script(()), CommandState(P))),
]  # fmt: skip


def methods(protocol: type) -> dict[str, Callable[..., Any]]:
    """The methods of a protocol, those it inherits from another one too, without its properties."""
    return {name: each for name, each in inspect.getmembers(protocol, inspect.isfunction) if not name.startswith("_")}


def shape(method: Callable[..., Any]) -> list[tuple[str, object, object]]:
    """Name, kind and default of every argument."""
    return [(each.name, each.kind, each.default) for each in inspect.signature(method).parameters.values()]


@pytest.mark.parametrize(("protocol", "kind"), PAIRS, ids=lambda each: getattr(each, "__name__", "Shows"))
def test_every_method_of_an_interface_is_there_with_the_same_arguments(protocol: type, kind: object) -> None:
    wanted = methods(protocol)
    assert wanted
    for name, method in wanted.items():
        own = shape(getattr(kind, name))
        needed = shape(method)[0 if inspect.isclass(kind) else 1 :]
        assert own[: len(needed)] == needed, name  # it may take more, which nobody needs to give
        assert all(default is not inspect.Parameter.empty for *_, default in own[len(needed) :]), name
        assert method.__doc__, f"{name} has no docstring"


def test_interfaces_have_the_methods_that_links_use() -> None:
    assert methods(CommandSink).keys() == {
        "set_parameters", "release", "write_layer", "release_layer", "expression", "gaze", "gaze_at", "gaze_room",
        "gaze_head", "gaze_off", "neutral", "live", "viseme", "snapshot", "measured", "holder", "layer_names", "status",
        "overview", "held",
    }  # fmt: skip
    assert methods(HeadSink).keys() == methods(CommandSink).keys()
    assert isinstance(inspect.getattr_static(CommandSink, "beside"), property)
    assert methods(Player).keys() == {
        "start", "prepare_start", "names", "control", "prepare_control", "tick", "abandon", "status",
    }  # fmt: skip


VALUES, MASK = np.full(len(P), 0.25), np.ones(len(P), dtype=bool)
COMMANDS: dict[str, tuple[Any, ...]] = {
    "set_parameters": ([3, 4], [0.5, 0.25], 7), "release": ([3], 7), "write_layer": ("link", VALUES, MASK, 5, 7),
    "release_layer": ("link",), "expression": ("happiness", 0.5, 2.0, 7), "gaze": (0.1, 0.2, 7),
    "gaze_at": (1.0, 2.0, 3.0, 7), "gaze_room": (1.0, 2.0, 3.0, 7), "gaze_off": (7,), "neutral": (0.5, 7),
    "live": (0.5, 7, "calm"), "viseme": (["aa"], [0.5], 7),
}  # fmt: skip
"""A call of every command that a group passes on as it is."""
QUESTIONS = {"snapshot": (VALUES,), "measured": (VALUES,), "holder": (3,), "status": (), "overview": (), "held": ()}


class Head:
    """A head that keeps what it is commanded."""

    parameters, vocabulary, stop_latch, shows, placement = P, None, None, None, Placement()

    def __init__(self, name: str, heads: Heads) -> None:
        self.name, self.heads = name, heads
        self.calls: list[tuple[str, tuple[Any, ...]]] = []

    def layer_names(self) -> tuple[str, ...]:
        return ("link",)

    def __getattr__(self, name: str) -> Callable[..., None]:
        return lambda *given: self.calls.append((name, given))


def group() -> tuple[Any, list[Any]]:
    heads = Heads()
    members = [Head(name, heads) for name in ("maple", "oak", "willow")]
    for member in members:
        heads.add(member)  # type: ignore[arg-type]
    return Group("all", members), members  # type: ignore[arg-type]


def test_a_group_passes_on_every_command_and_asks_for_one_head_at_every_question() -> None:
    rest = {"gaze_head", "layer_names"}
    assert COMMANDS.keys() | QUESTIONS.keys() | rest == methods(CommandSink).keys()
    together, members = group()
    for name, given in COMMANDS.items():
        getattr(together, name)(*given)
        for member in members:
            assert member.calls.pop() == (name, given) and not member.calls
    for name, given in QUESTIONS.items():
        with pytest.raises(ParameterError, match="a query needs one of maple, oak, willow"):
            getattr(together, name)(*given)
    with pytest.raises(ParameterError, match="a query needs one of maple, oak, willow"):
        _ = together.beside
    together.gaze_head("oak", 7)
    assert [member.calls for member in members] == [[("gaze_head", ("oak", 7))], [], [("gaze_head", ("oak", 7))]]
