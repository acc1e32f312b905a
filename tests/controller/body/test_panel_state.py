"""What the panel shows besides the values."""

from __future__ import annotations

import numpy as np
import pytest

from controller.base.mailboxes import Mailbox
from controller.base.parameters import PARAMETERS as P
from controller.base.paths import find_config
from controller.body.panel_state import PanelState
from controller.layers.commands import CommandState
from controller.robot.channels import build_table
from controller.robot.following import FollowingStatistics, MeasuredFace
from controller.robot.robot import load_robot
from drivers.base.bus import BusState

JAW = P.index("jawOpen")


def standing(position: np.ndarray) -> BusState:
    n = len(position)
    none, no, yes = np.zeros(n), np.zeros(n, bool), np.ones(n, bool)
    return BusState(
        0.0, position, none, none, yes, none, none.astype(np.uint8), no, none, none, none.astype(np.uint8), no
    )


def test_holders_measured_values_and_differences_reach_the_other_side() -> None:
    state, out = CommandState(P), P.neutral()
    table = build_table(load_robot(find_config("robots", "head24"), P).channels, P)
    following = FollowingStatistics(table, P)
    wanted = table.angles(P.neutral())[0]
    there = wanted + np.radians(np.where(np.array(table.names) == "jawOpen", 14.0, 0.0))
    reflection = MeasuredFace([table], [lambda: standing(there)], P, [following])
    following.add(wanted, standing(there))
    with Mailbox.create(PanelState.size(P)) as mailbox:
        insight = PanelState(mailbox, state.layer_names(), P)
        insight.refresh()
        assert insight.holder(JAW) == "" and insight.measured(JAW) is None and insight.away_deg("jaw") is None
        state.set_parameters([JAW], [0.5], 0)
        state.tick(10_000_000, 0.01, out)
        PanelState(mailbox, state.layer_names(), P).publish(state, reflection)
        insight.refresh()
        assert insight.holder(JAW) == "manual" and insight.holder(P.index("browInnerUp")) == "expression"
        assert insight.measured(JAW) == pytest.approx(0.5, abs=0.15)
        assert insight.measured(P.index("tongueOut")) is None  # no servo for it
        assert insight.away_deg("jaw") == pytest.approx(14.0 / np.sqrt(2)) and insight.away_deg("brows") == 0.0
        assert insight.away_deg("tongue") is None


def test_what_is_held_by_hand_reaches_the_other_side_until_it_is_released() -> None:
    state, out = CommandState(P), P.neutral()
    with Mailbox.create(PanelState.size(P)) as mailbox:
        body, panel = (PanelState(mailbox, state.layer_names(), P) for _ in range(2))
        panel.refresh()
        assert panel.held() is None  # not known is not released
        state.set_parameters([JAW], [0.5], 0)
        state.tick(10_000_000, 0.01, out)
        body.publish(state, None)
        panel.refresh()
        assert panel.held() == {JAW: 0.5}
        state.release([JAW], 20_000_000)
        state.tick(30_000_000, 0.01, out)
        body.publish(state, None)
        panel.refresh()
        assert panel.held() == {}


def test_who_stopped_the_servos_reaches_the_other_side() -> None:
    state = CommandState(P)
    with Mailbox.create(PanelState.size(P)) as mailbox:
        body, panel = (PanelState(mailbox, state.layer_names(), P) for _ in range(2))
        assert panel.stopped_by == ""
        for who, shown in (("panel", "panel"), ("line /dev/ttyUSB0", "line /dev/ttyUSB0"), ("x" * 300, "x" * 64)):
            state.stop_latch.stop(who, 5)
            body.publish(state, None)
            panel.refresh()
            assert panel.stopped_by == shown
            state.stop_latch.start()
            body.publish(state, None)
            panel.refresh()
            assert panel.stopped_by == ""


def test_without_servos_only_holders_are_known() -> None:
    state, out = CommandState(P), P.neutral()
    state.tick(10_000_000, 0.01, out)
    with Mailbox.create(PanelState.size(P)) as mailbox:
        insight = PanelState(mailbox, state.layer_names(), P)
        PanelState(mailbox, state.layer_names(), P).publish(state, None)
        insight.refresh()
        assert insight.holder(JAW) == "expression" and insight.measured(JAW) is None
