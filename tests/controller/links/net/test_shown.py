"""What one face shows of a source: it keeps a slow source's face, and does what is set when the source is lost."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.base.stop_latch import StopLatch
from controller.formats.format import FORMATS
from controller.formats.frame import Frame
from controller.links.net.kinds import link_of
from controller.links.net.shown import Shown

JAW = P.index("jawOpen")


class Sink:
    """Records what a layer gets."""

    def __init__(self) -> None:
        self.parameters, self.stop_latch = P, StopLatch()
        self.calls: list[tuple[Any, ...]] = []

    def write_layer(self, name: str, values: Any, mask: Any, now_ns: int, stamp_ns: int = 0) -> None:
        assert now_ns == stamp_ns
        self.calls.append((name, float(values[JAW]), bool(mask[JAW]), now_ns))

    def release_layer(self, name: str) -> None:
        self.calls.append(("release", name))


def frame(jaw: float, *, face: bool = True, known: bool = True) -> Frame:
    values, mask = P.neutral(), np.zeros(len(P), bool)
    values[JAW], mask[JAW] = jaw, known
    return Frame(values=values, mask=mask, face=face)


@pytest.fixture
def sink() -> Sink:
    return Sink()


def shown(sink: Sink, lost: str = "fade") -> Shown:
    settings = link_of(FORMATS.get("livelink")).settings(listen="127.0.0.1", lost=lost, timeout_s=0.5)
    return Shown(settings, sink, "a link")


def test_a_face_is_shown_at_its_time_and_what_is_none_changes_nothing(sink: Sink) -> None:
    one = shown(sink)
    assert one.lost
    for nothing in (frame(0.5, face=False), frame(0.5, known=False)):
        one.show(nothing, 1.0)
        assert one.lost and not sink.calls
    one.show(frame(0.5), 2.0)
    assert not one.lost and sink.calls == [("capture", 0.5, True, 2_000_000_000)]
    one.show(frame(0.9, face=False), 2.1)
    assert len(sink.calls) == 1 and not one.lost


def test_the_face_of_a_slow_source_is_written_again_until_it_is_lost(sink: Sink) -> None:
    one = shown(sink)
    one.watch(0.0, 0.0)
    assert not sink.calls
    one.show(frame(0.5), 1.0)
    one.watch(1.29, 1.0)
    assert len(sink.calls) == 1
    one.watch(1.31, 1.0)
    assert sink.calls[1:] == [("capture", 0.5, True, 1_310_000_000)] and not one.lost
    one.watch(1.5, 1.0)
    assert len(sink.calls) == 2 and not one.lost
    one.watch(1.51, 1.0)
    assert one.lost and sink.calls[2:] == [("release", "capture")]
    one.watch(9.0, 1.0)  # it is lost once
    assert len(sink.calls) == 3
    one.show(frame(0.25), 10.0)
    assert not one.lost and sink.calls[3:] == [("capture", 0.25, True, 10_000_000_000)]


@pytest.mark.parametrize(("lost", "jaw"), [("hold", 0.5), ("neutral", 0.0)])
def test_a_face_that_holds_or_becomes_neutral_stays_on_its_layer(sink: Sink, lost: str, jaw: float) -> None:
    one = shown(sink, lost)
    one.show(frame(0.5), 1.0)
    one.watch(1.6, 1.0)
    one.watch(2.0, 1.0)
    assert one.lost and {call[:3] for call in sink.calls[1:]} == {("capture", jaw, True)}
    assert sink.calls[-1][3] == 2_000_000_000 and sink.stop_latch.stopped is None


def test_stop_is_set_where_the_wire_is_silent_and_not_where_only_the_face_is_gone(sink: Sink) -> None:
    one = shown(sink, "stop")
    one.show(frame(0.5), 1.0)
    one.watch(1.6, 1.2)  # something was heard since
    assert one.lost and sink.calls[1:] == [("release", "capture")] and sink.stop_latch.stopped is None
    one.show(frame(0.5), 2.0)
    one.watch(2.6, 2.0)
    stopped = sink.stop_latch.stopped
    assert stopped is not None and stopped.who == "a link"
    assert sink.calls[-1] == ("release", "capture")
