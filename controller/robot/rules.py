"""Safety rules of a robot file: what no servo does, whoever asks.

Positions in rules are relative: 0 is the channel's angle for the neutral face, 1 is its limit on the side that
``toward`` names, so a rule survives another calibration. The behaviour is in :mod:`controller.robot.safety`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated, Literal, TypeVar

from pydantic import Field

from controller.base.config import Settings

Side = Literal["low", "high"]
Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]
Seconds = Annotated[float, Field(ge=0, le=3600, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Names = Annotated[list[str], Field(min_length=1)]


class PreventRule(Settings):
    """Antagonists: ``channel`` is held at ``extreme`` while ``other`` is, or wants to be, past ``other_extreme``.

    ``other`` goes first, but waits until ``channel`` has left.
    """

    channel: str
    toward: Side
    extreme: Share
    other: str
    other_toward: Side
    other_extreme: Share


class TimingRule(Settings):
    """Time at an extreme: after ``hold_s`` past ``extreme`` the limit falls to it, rests there, and comes back."""

    channels: Names
    toward: Side
    extreme: Share
    hold_s: Seconds
    fall_s: Positive
    rest_s: Seconds
    recover_s: Positive


class LoadRule(Settings):
    """Load: after ``after_s`` above ``current_a`` the servo gives way from where it stands.

    It gives way at ``fall_deg_s`` while overloaded, by at most ``most_deg``; ``rest_s`` after the load has gone the
    limit comes back at ``rise_deg_s``.
    """

    channels: Names
    current_a: Positive
    after_s: Seconds
    most_deg: Positive = 15.0
    fall_deg_s: Positive = 30.0
    rest_s: Seconds = 1.0
    rise_deg_s: Positive = 10.0


Rule = TypeVar("Rule", TimingRule, LoadRule)


class RuleSettings(Settings):
    """All rules of a robot, by kind."""

    prevent: list[PreventRule] = []
    timing: list[TimingRule] = []
    load: list[LoadRule] = []

    def within(self, names: Sequence[str]) -> RuleSettings:
        """The rules as far as they concern the channels called ``names``; ``prevent`` needs both of its channels."""
        return RuleSettings(
            prevent=[rule for rule in self.prevent if {rule.channel, rule.other} <= set(names)],
            timing=_of(self.timing, names),
            load=_of(self.load, names),
        )

    def mentions(self) -> Iterator[tuple[str, str]]:
        """Key and name of every channel that is named."""
        for i, rule in enumerate(self.prevent):
            yield f"rules.prevent[{i}].channel", rule.channel
            yield f"rules.prevent[{i}].other", rule.other
        for kind in ("timing", "load"):
            for i, named in enumerate(getattr(self, kind)):
                for j, name in enumerate(named.channels):
                    yield f"rules.{kind}[{i}].channels[{j}]", name


def _of(rules: list[Rule], names: Sequence[str]) -> list[Rule]:
    kept = [(rule, [name for name in rule.channels if name in names]) for rule in rules]
    return [rule.model_copy(update={"channels": own}) for rule, own in kept if own]
