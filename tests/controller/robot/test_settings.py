"""controller.robot.settings: what each table of a robot file may hold, its defaults, and what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from controller.robot.settings import (
    AnchorSettings,
    Calibration,
    ChannelSettings,
    LoadRule,
    PreventRule,
    PulseSettings,
    RobotSettings,
    RuleSettings,
    TimingRule,
)

CHANNEL: dict[str, Any] = {
    "name": "jaw", "bus": "b", "id": 1, "model": "xl330-m288", "mix": {"jawOpen": 1},
    "map": {"at": [0, 1], "deg": [0, 30]}, "limit_deg": [0, 30], "max_speed_deg_s": 300, "max_accel_deg_s2": 3000,
}  # fmt: skip
TIMING = TimingRule(channels=["a", "b"], toward="high", extreme=0.5, hold_s=1, fall_s=1, rest_s=0, recover_s=1)
PREVENT = PreventRule(channel="a", toward="high", extreme=0.5, other="b", other_toward="low", other_extreme=0.5)
LOAD = LoadRule(channels=["c", "a"], current_a=0.5, after_s=0.2)


def robot(*channels: dict[str, Any], **more: Any) -> RobotSettings:
    buses = [{"name": name, "kind": "simulated"} for name in ("b", "c")]
    return RobotSettings.model_validate({"name": "r", "buses": buses, "channels": list(channels) or [CHANNEL], **more})


def fault(model: type, /, **table: Any) -> str:
    with pytest.raises(ValidationError) as caught:
        model.model_validate(table)
    first = caught.value.errors()[0]
    return f"{'.'.join(map(str, first['loc']))}: {first['msg'].removeprefix('Value error, ')}"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"id": 253}, "id: Input should be less than or equal to 252"),
        ({"id": -1}, "id: Input should be greater than or equal to 0"),
        ({"limit_deg": [30, 30]}, "limit_deg: the lower limit must be below the upper one"),
        ({"limit_deg": [0, 181]}, "limit_deg.1: Input should be less than or equal to 180"),
        ({"max_speed_deg_s": 0}, "max_speed_deg_s: Input should be greater than 0"),
        ({"dead_band_deg": -0.1}, "dead_band_deg: Input should be greater than or equal to 0"),
        ({"slack_deg": 21}, "slack_deg: Input should be less than or equal to 20"),
        ({"trim_deg": float("nan")}, "trim_deg: Input should be a finite number"),
        ({"join": "mean"}, "join: Input should be 'sum', 'min' or 'max'"),
        ({"anchor": {"point": [0, 0], "direction": [0, 1, 0]}}, ": needs one of mix, formula and anchor"),
    ],
)
def test_a_channel_refuses(change: dict[str, Any], message: str) -> None:
    assert fault(ChannelSettings, **(CHANNEL | change)).startswith(message)


def test_a_channel_has_usual_values() -> None:
    channel = ChannelSettings.model_validate(CHANNEL | {"id": 252})
    assert (channel.join, channel.reverse, channel.wire_name, channel.profile) == ("sum", False, "", None)
    assert (channel.zero_deg, channel.trim_deg, channel.dead_band_deg, channel.slack_deg) == (0, 0, 0, 0)
    assert channel.max_jerk_deg_s3 is None and channel.pulse is None and channel.map.curve == "straight"


def test_points_rise_and_pulses_rise_or_fall() -> None:
    assert fault(Calibration, at=[0, 0], deg=[0, 1]).endswith("at must rise from point to point")
    assert "same number of points" in fault(Calibration, at=[0, 1, 2], deg=[0, 1])
    for us in ([1000, 1500, 2000], [2000, 1500, 1000]):
        assert PulseSettings(deg=[-10, 0, 10], us=us).us == us
    for us in ([1000, 1000, 2000], [1000, 2000, 1500]):
        assert fault(PulseSettings, deg=[-10, 0, 10], us=us).endswith("us must rise, or fall, with every angle")
    assert fault(PulseSettings, deg=[-10, 10], us=[63, 2000]).startswith("us.0: ")


def test_an_anchor_has_a_direction_and_pulls_at_both_sides_or_like_a_parameter() -> None:
    anchor = AnchorSettings(point=[0.5, 0.5], direction=(0, 3, -4))
    assert anchor.unit_direction == pytest.approx([0, 0.6, -0.8])
    assert (anchor.part, anchor.reach_mm, anchor.both) == ("face", 15.0, False)
    assert fault(AnchorSettings, point="x", direction=[0, 0, 0]) == "direction: a direction must not be zero"
    assert fault(AnchorSettings, point="x", direction=[0, 0, 1], like="jawOpen", both=True).endswith(
        "do not go together"
    )
    assert AnchorSettings(point="x", direction=(0, 0, -1e-3), both=True).unit_direction == pytest.approx([0, 0, -1])
    assert fault(AnchorSettings, point=[1], direction=[0, 0, 1]).startswith("point")


def test_rules_are_cut_to_the_channels_of_a_bus() -> None:
    rules = RuleSettings(prevent=[PREVENT], timing=[TIMING], load=[LOAD])
    first = rules.within(["a", "x"])
    assert first.prevent == [] and first.timing[0].channels == ["a"] and first.load[0].channels == ["a"]
    assert first.timing[0].extreme == 0.5 and TIMING.channels == ["a", "b"]
    both = rules.within(["b", "a"])
    assert both.prevent == [PREVENT] and both.timing == [TIMING]
    assert rules.within(["x"]) == RuleSettings()


def test_rules_name_their_channels_by_key() -> None:
    assert list(RuleSettings(prevent=[PREVENT], timing=[TIMING], load=[LOAD]).mentions()) == [
        ("rules.prevent[0].channel", "a"),
        ("rules.prevent[0].other", "b"),
        ("rules.timing[0].channels[0]", "a"),
        ("rules.timing[0].channels[1]", "b"),
        ("rules.load[0].channels[0]", "c"),
        ("rules.load[0].channels[1]", "a"),
    ]


def test_the_figures_of_rules_have_bounds() -> None:
    assert (LOAD.most_deg, LOAD.fall_deg_s, LOAD.rest_s, LOAD.rise_deg_s) == (15.0, 30.0, 1.0, 10.0)
    table = TIMING.model_dump()
    for key, wrong in (("extreme", 1.01), ("extreme", -0.01), ("hold_s", 3601), ("fall_s", 0), ("channels", [])):
        assert fault(TimingRule, **(table | {key: wrong})).startswith(f"{key}: ")
    assert TimingRule(**(table | {"extreme": 1, "hold_s": 0, "rest_s": 3600})).extreme == 1.0


def test_profiles_give_what_a_channel_does_not_set() -> None:
    bare = {key: value for key, value in CHANNEL.items() if key != "max_speed_deg_s"}
    profiles = {"lid": {"max_speed_deg_s": 600, "slack_deg": 2}, "jaw": {"max_speed_deg_s": 100}}
    first, second = robot(bare | {"profile": "lid"}, CHANNEL | {"profile": "jaw"}, profiles=profiles).channels
    assert (first.max_speed_deg_s, first.slack_deg) == (600, 2)
    assert (second.max_speed_deg_s, second.slack_deg) == (300, 0)
    unknown = robot(bare | {"profile": "nose"}, profiles=profiles).channels[0]  # a fault, but not this one's
    assert unknown.max_speed_deg_s == 100
    assert fault(RobotSettings, name="r", channels=3, buses=[], profiles=4)


def test_channels_are_found_by_bus_and_by_anchor() -> None:
    mix = {key: value for key, value in CHANNEL.items() if key != "mix"}
    pulled = mix | {"name": "lip", "bus": "c", "anchor": {"point": [0.5, 0.5], "direction": [0, 1, 0]}}
    found = robot(CHANNEL, pulled)
    assert [channel.name for channel in found.on_bus("c")] == ["lip"] and found.on_bus("d") == []
    assert [channel.name for channel in found.anchored_channels] == ["lip"]
    assert np.array(found.channels[0].limit_deg).tolist() == [0, 30]
