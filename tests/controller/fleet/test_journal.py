"""Commands as JSON for another conductor: what comes out at one state was put in at the other."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from controller.base.errors import LinkError
from controller.base.parameters import PARAMETERS as P
from controller.fleet import journal
from controller.layers.commands import CommandState

NOW = 7_000_000_000


class Recorder:
    """A state that only records what is asked of it."""

    parameters = P

    def __init__(self) -> None:
        self.calls: list[tuple[Any, ...]] = []

    def __getattr__(self, name: str) -> Any:
        return lambda *arguments, **named: self.calls.append((name, *arguments, *named.items()))


@pytest.mark.parametrize(
    ("method", "arguments", "given"),
    [
        ("set_parameters", ((3, 5), np.array([0.5, 1.0]), 11), ([3, 5], [0.5, 1.0])),
        ("release", (range(2), 11), ([0, 1],)),
        ("expression", ("joy", 0.5, None, 11), ("joy", 0.5, None)),
        ("gaze", (0.1, -0.2, 11), (0.1, -0.2)),
        ("gaze_at", (1.0, 2.0, 300.0, 11), (1.0, 2.0, 300.0)),
        ("gaze_off", (11,), ()),
        ("neutral", (0.5, 11), (0.5,)),
    ],
)
def test_a_command_is_carried_out_at_its_own_time(method: str, arguments: tuple[Any, ...], given: Any) -> None:
    data, state = journal.encode(method, arguments), Recorder()
    assert data is not None
    journal.apply(data, state, NOW)  # type: ignore[arg-type]
    assert state.calls == [(method, *given, NOW)]


@pytest.mark.parametrize("manner", [(), ("listen",)])
def test_idle_motion_goes_over_with_its_manner(manner: tuple[str, ...]) -> None:
    data, state = journal.encode("live", (0.25, 11, *manner)), Recorder()
    assert data is not None
    journal.apply(data, state, NOW)  # type: ignore[arg-type]
    assert state.calls == [("live", 0.25, NOW, *manner)]


@pytest.mark.parametrize("through", [None, P.neutral() + 0.5])
def test_layers_go_over_as_arrays(through: np.ndarray | None) -> None:
    values, mask = np.linspace(0, 1, len(P)), np.arange(len(P)) % 2 == 0
    data, state = journal.encode("write_layer", ("capture", values, mask, 11, 12, through)), Recorder()
    assert data is not None
    journal.apply(data, state, NOW)  # type: ignore[arg-type]
    ((method, name, got, where, now, stamp, (word, shown)),) = state.calls
    assert (method, name, now, stamp, word) == ("write_layer", "capture", NOW, NOW, "through")
    np.testing.assert_array_equal(got, values)
    np.testing.assert_array_equal(where, mask)
    assert where.dtype == bool and (shown is None) == (through is None)
    if through is not None:
        np.testing.assert_array_equal(shown, through)


def test_ticks_are_no_events() -> None:
    assert journal.encode("tick", (11,)) is None


def event(**other: Any) -> bytes:
    return json.dumps({"version": 1, "method": "gaze", "arguments": [0.1, 0.2], **other}).encode()


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (event(version=2), "version 2 of an event is not understood"),
        (event(method="stop"), "'stop' is not an event"),
        (event(method="__init__"), "'__init__' is not an event"),
        (event(arguments=[0.1]), "'gaze' is not an event"),
        (event(method="set_parameters", arguments=[[len(P)], [0.5]]), "cannot be carried out"),
        (event(method="write_layer", arguments=["capture", [0.0], [True], None]), "a layer of other parameters"),
        (event(method="write_layer", arguments=["capture"]), "cannot be carried out"),
        (event(method="live", arguments=[]), "cannot be carried out"),
        (b"[]", "cannot be carried out"),
        (b"{}", "cannot be carried out"),
        (b"\xff{", "cannot be carried out"),
        (b"[" * 60_000, "cannot be carried out"),
        (event() + b" " * 70_000 + b"x", "^$"),
    ],
)
def test_what_is_no_event_is_named(data: bytes, why: str) -> None:
    if why == "^$":  # of an event that is too long only the first 65,536 bytes count
        journal.apply(data, CommandState(P), NOW)
        return
    with pytest.raises(LinkError, match=why):
        journal.apply(data, CommandState(P), NOW)


def test_one_that_comes_late_gets_what_still_holds() -> None:
    state, late = CommandState(P), CommandState(P)
    state.set_parameters(P.indices(["jawOpen", "mouthSmileLeft"]), [0.25, 0.75], NOW)
    state.expression("happiness", 0.5, None, NOW)
    state.live(0.3, NOW, "listen")
    state.gaze(0.1, -0.2, NOW)
    found = json.loads(json.dumps(journal.snapshot(state)))
    assert found["held"] == {"jawOpen": 0.25, "mouthSmileLeft": 0.75} and found["expression"] == ["happiness", 0.5]
    journal.restore(found, late, 2 * NOW)
    assert journal.snapshot(late) == journal.snapshot(state)
    away = {**found, "gaze": None, "held": {}}
    other = CommandState(P)
    journal.restore(away, other, NOW)
    assert journal.snapshot(other)["gaze"] is None and journal.snapshot(other)["held"] == {}


@pytest.mark.parametrize(
    "change",
    [{"held": {"nose": 1}}, {"held": {"jawOpen": "x"}}, {"expression": ["joy"]}, {"life": [0.5]}, {"gaze": [1]},
     {"expression": None}],
)  # fmt: skip
def test_a_state_that_does_not_fit_is_named(change: dict[str, Any]) -> None:
    good = journal.snapshot(CommandState(P))
    with pytest.raises(LinkError, match="a state that cannot be taken over"):
        journal.restore(good | change, CommandState(P), NOW)
