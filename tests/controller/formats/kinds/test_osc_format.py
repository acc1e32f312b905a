"""OSC faders against python-osc."""

from __future__ import annotations

import pytest

from controller.base.parameters import PARAMETERS as P
from controller.formats.kinds.osc_format import OscDecoder, OscEncoder
from controller.formats.osc import message
from tests.controller.formats.faces import face


@pytest.mark.parametrize("address", ["/omote/jawOpen", "/avatar/parameters/JawOpen", "/jawOpen", "/a/b/c/jaw_open"])
def test_the_last_part_of_an_address_names_the_parameter(address: str) -> None:
    (frame,) = OscDecoder(P).feed(message(address, 0.5))
    assert frame.values[P.index("jawOpen")] == 0.5 and frame.mask.sum() == 1


def test_a_fader_that_is_moved_leaves_the_others() -> None:
    decoder = OscDecoder(P)
    decoder.feed(message("/omote/jawOpen", 0.5))
    (frame,) = decoder.feed(message("/omote/cheekPuff", 1))
    assert frame.mask.sum() == 2 and frame.values[P.index("cheekPuff")] == 1.0


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        (message("/omote/jawOpen"), "a message without a number"),
        (message("/omote/jawOpen", "1"), "a message without a number"),
        (message("/omote/jawOpen", float("nan")), "a message without a number"),
        (message("/omote/jawOpn", 1.0), "unknown names"),
        (b"jawOpen 0.5\0", "not an OSC message"),
    ],
)
def test_what_is_wrong_is_refused_with_a_reason(wrong: bytes, why: str) -> None:
    decoder = OscDecoder(P)
    assert decoder.feed(wrong) == [] and decoder.refused == {why: 1}


def test_another_library_reads_what_is_sent_and_writes_what_is_read() -> None:
    osc_bundle = pytest.importorskip("pythonosc.osc_bundle")
    builder = pytest.importorskip("pythonosc.osc_message_builder")
    sent = face(1, 3.0)
    (data,) = OscEncoder(P).encode(sent)
    read = osc_bundle.OscBundle(data)
    values = {read.content(i).address: read.content(i).params[0] for i in range(read.num_contents)}
    assert len(values) == len(P) + 1
    assert values["/omote/headYaw"] == pytest.approx(sent.values[P.index("headYaw")])
    made = builder.OscMessageBuilder("/omote/tongueOut")
    made.add_arg(0.75)
    (frame,) = OscDecoder(P).feed(made.build().dgram)
    assert frame.values[P.index("tongueOut")] == 0.75
