"""What a head shares with the other heads of its stage, and the options that each has for itself."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

from controller.body.member import Member, options_of
from controller.body.messages import RunOptions


def test_a_head_that_joins_has_the_clocks_name_place_and_stop_of_all() -> None:
    heads: list[Any] = []
    everyone: Any = SimpleNamespace(add=heads.append)
    member = Member("maple", "left of the door", everyone, "their clock", "their latch")  # type: ignore[arg-type]
    state: Any = SimpleNamespace(name="", placement=None, heads=None, stop_latch=None)
    member.join(state)
    assert (state.name, state.placement, state.heads, state.stop_latch) == (
        "maple", "left of the door", everyone, "their latch",
    )  # fmt: skip
    assert heads == [state]


def test_each_head_has_a_recording_of_its_own_and_only_the_first_takes_and_panels() -> None:
    options = RunOptions(mirror=True, record=Path("takes/a.rec"), at_rest=True)
    first, second = (options_of(options, name, first=name == "maple") for name in ("maple", "willow"))
    assert first.record == Path("takes/a-maple.rec") and first.at_rest and first.mirror
    assert second.record == Path("takes/a-willow.rec") and not second.at_rest and second.mirror
    assert options_of(RunOptions(), "maple", first=True) == RunOptions()
    assert options_of(RunOptions(), "willow", first=False).record is None
