"""What a link sends: the face, what the servos show, or both."""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.base.parameters import Floats, Parameters
from controller.formats.format import FORMATS
from controller.formats.frame import Frame
from controller.links.links import read_link
from controller.links.net.outgoing import Outgoing
from controller.takes.reader import load_take
from tests.controller.formats.faces import KINDS
from tests.controller.links.net.sockets import wait_for

JAW = P.index("jawOpen")


class Head:
    """A face with the jaw half open, whose servos have it nearly so, or are not known."""

    def __init__(self, *, known: bool = True) -> None:
        self.parameters: Parameters = P
        self.known = known

    def snapshot(self, out: Floats) -> None:
        out[JAW] = 0.5

    def measured(self, out: Floats) -> bool:
        out[JAW] = 0.375
        return self.known


class Basket:
    """Keeps messages."""

    def __init__(self) -> None:
        self.error, self.messages = "", list[bytes]()

    def send(self, message: bytes) -> bool:
        self.messages.append(message)
        return True

    def close(self) -> None:
        pass


def sent(kind: str, head: Head, enough: int, **keys: object) -> list[bytes]:
    """The first messages."""
    basket = Basket()
    settings = read_link({"kind": kind, "send": "127.0.0.1:1", "rate_hz": 500.0, **keys}).own
    outgoing = Outgoing(settings, basket, head, "x")
    outgoing.start()
    try:
        wait_for(lambda: len(basket.messages) >= enough)
    finally:
        outgoing.stop()
    return basket.messages


def test_a_link_sends_as_often_as_its_rate_says() -> None:
    settings = read_link({"kind": "json", "send": "127.0.0.1:1", "rate_hz": 40.0}).own
    basket = Basket()
    outgoing = Outgoing(settings, basket, Head(), "x")
    began_s = time.monotonic()
    outgoing.start()
    try:
        wait_for(lambda: len(basket.messages) >= 5)
        lasted_s = time.monotonic() - began_s
    finally:
        outgoing.stop()
    assert len(basket.messages) <= 40.0 * lasted_s + 3, "on a busy machine fewer, but never more"


def decoded(kind: str, messages: list[bytes]) -> Frame:
    decoder = FORMATS.get(kind).decoder(P)
    return next(frame for message in messages for frame in decoder.feed(message))


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "icub"])  # which has emotions only
def test_every_format_sends_the_face_as_far_as_it_can(kind: str) -> None:
    frame = decoded(kind, sent(kind, Head(), 2))
    assert frame.values[JAW] == pytest.approx(0.5, abs=0.11)  # au-json has steps of a fifth


def test_any_format_can_send_what_the_servos_show() -> None:
    frame = decoded("vmc", sent("vmc", Head(), 1, sends="servos"))
    assert frame.values[JAW] == pytest.approx(0.375)


def test_servos_that_are_not_known_are_not_sent() -> None:
    head, basket = Head(known=False), Basket()
    settings = read_link({"kind": "osc", "send": "127.0.0.1:1", "rate_hz": 500.0, "sends": "servos"}).own
    outgoing = Outgoing(settings, basket, head, "x")
    assert outgoing._frame(0.0) is None
    head.known = True
    frame = outgoing._frame(0.0)
    assert frame is not None and frame.values[JAW] == 0.375


def test_json_has_both_side_by_side() -> None:
    table = json.loads(sent("json", Head(), 1, sends="both")[0])
    assert (table["parameters"]["jawOpen"], table["measured"]["jawOpen"]) == (0.5, 0.375)
    assert decoded("json", [json.dumps(table).encode()]).values[JAW] == 0.5
    assert "measured" not in json.loads(sent("json", Head(known=False), 1, sends="both")[0])


def test_csv_has_both_in_columns_that_its_own_decoder_leaves_out() -> None:
    names, line, *_ = sent("csv", Head(), 200, sends="both")
    cells = dict(zip(names.decode().split(","), line.decode().split(","), strict=True))
    assert (cells["jawOpen"], cells["servos:jawOpen"]) == ("0.5", "0.375")
    decoder, encoder = FORMATS.get("csv").decoder(P), FORMATS.get("csv").encoder(P)
    face, mask = np.full(len(P), 0.25), np.ones(len(P), dtype=bool)
    frames = [Frame(face, mask, measured=face / 2 if n > 3 else None) for n in range(300)]
    found = [frame for each in frames for message in encoder.encode(each) for frame in decoder.feed(message)]
    assert len(found) == 300 and not decoder.refused
    np.testing.assert_allclose(found[-1].values, face)


def test_a_table_of_both_is_a_take(tmp_path: Path) -> None:
    names, *lines = [line.decode() for line in sent("csv", Head(), 20, sends="both")[:20]]
    path = tmp_path / "both.csv"
    path.write_text("\n".join([names, *lines]) + "\n")
    take = load_take(path, P)
    assert take.mask.all() and np.allclose(take.values[:, JAW], 0.5)


def test_formats_without_room_for_both_say_so() -> None:
    with pytest.raises(ValueError, match="osc has no room for both"):
        read_link({"kind": "osc", "send": "127.0.0.1:1", "sends": "both"})
