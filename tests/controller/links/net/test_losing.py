"""What a face shows of a source that goes: its face, its stream, or its wire."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.formats.format import FORMATS
from controller.formats.frame import Frame
from controller.layers.commands import CommandState
from controller.links.net.kinds import link_of
from controller.links.net.shown import GONE_S, Shown

EARS = """
regions = ["ears"]
[parameters.earLeft]
profile = "mouth"
region = "ears"
range = [-1.0, 1.0]
rest = 0.25
"""
NOBODY = Frame(P.neutral(), np.zeros(len(P), dtype=bool), face=False)


def opened(kind: str = "json", parameters: object = P, **keys: object) -> tuple[Shown, CommandState]:
    settings = link_of(FORMATS.get(kind)).settings(listen="127.0.0.1", **keys)
    state = CommandState(parameters)  # type: ignore[arg-type]
    shown = Shown(settings, state, "the link")
    return shown, state


def face(value: float) -> Frame:
    values = P.neutral()
    values[0] = value
    return Frame(values, np.ones(len(P), dtype=bool))


def holding(state: CommandState) -> bool:
    return bool(state.mixer["capture"].holding)


def test_a_source_of_changes_is_silent_as_long_as_it_likes() -> None:
    shown, state = opened()
    shown.show(face(0.5), 1.0)
    shown.watch(1e6, 1.0)
    assert holding(state) and not shown.lost


def test_a_face_that_is_said_to_be_gone_fades_whatever_the_time_out() -> None:
    shown, state = opened()
    shown.show(face(0.5), 1.0)
    shown.show(NOBODY, 1.1)
    shown.watch(1.1, 1.1)
    assert holding(state)
    shown.show(face(0.25), 1.2)  # it came back in time
    shown.watch(1.3 + GONE_S, 1.3)
    assert holding(state) and state.mixer["capture"].values[0] == 0.25
    shown.show(NOBODY, 3.0)
    shown.watch(3.0, 3.0)
    assert not holding(state) and shown.lost


def test_a_stream_that_ended_is_lost_whatever_the_time_out() -> None:
    shown, state = opened(lost="stop")
    shown.show(face(0.5), 1.0)
    shown.watch(1.0 + GONE_S / 2, 1.0, ended=True)
    assert holding(state) and state.stop_latch.stopped is None
    shown.watch(1.1 + GONE_S, 1.0, ended=True)
    assert not holding(state) and state.stop_latch.stopped is not None


def test_a_wire_that_is_lost_after_the_face_stops_once() -> None:
    shown, state = opened("livelink", lost="stop", timeout_s=0.5)
    shown.show(face(0.5), 1.0)
    for now_s in (1.4, 1.8, 2.2):  # no face is seen, but datagrams come
        shown.show(NOBODY, now_s)
        shown.watch(now_s, now_s)
    assert not holding(state) and state.stop_latch.stopped is None
    shown.watch(2.8, 2.2)
    assert state.stop_latch.stopped is not None and state.stop_latch.stopped.who == "the link"
    state.stop_latch.start()
    shown.watch(9.0, 2.2)
    assert state.stop_latch.stopped is None


@pytest.mark.parametrize(("keys", "wanted"), [({"lost": "neutral"}, 0.25), ({"gains": {"ears": 0.5}}, 0.5)])
def test_ones_own_parameters_rest_where_they_rest(tmp_path: Path, keys: dict[str, object], wanted: float) -> None:
    (tmp_path / "ears.toml").write_text(EARS)
    own = P.with_files([tmp_path / "ears.toml"])
    shown, state = opened("json", own, timeout_s=0.5, **keys)
    values = own.neutral()
    values[-1] = 0.75
    shown.show(Frame(values, np.ones(len(own), dtype=bool)), 1.0)
    if "lost" in keys:
        shown.watch(2.0, 1.0)
    assert state.mixer["capture"].values[-1] == wanted
