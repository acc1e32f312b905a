"""MIDI: bytes that mido writes are read, and what omote writes is read by mido."""

from __future__ import annotations

import pytest

from controller.base.parameters import PARAMETERS as P
from controller.formats.format import FORMATS
from controller.formats.frame import Frame
from tests.controller.formats.faces import face

mido = pytest.importorskip("mido")
FORM = FORMATS.get("midi")
JAW, YAW = P.index("jawOpen"), P.index("headYaw")


def change(control: int, value: int, channel: int = 0) -> bytes:
    return bytes(mido.Message("control_change", channel=channel, control=control, value=value).bytes())


def test_a_controller_moves_its_parameter_over_its_whole_range() -> None:
    decoder = FORM.decoder(P)
    for step, value in ((0, 0.0), (127, 1.0), (64, 64 / 127)):
        (frame,) = decoder.feed(change(1, step, channel=9))
        assert frame.values[JAW] == pytest.approx(value) and frame.mask.sum() == 1
    for step, value in ((0, -1.0), (64, 0.0), (127, 1.0)):
        (frame,) = decoder.feed(change(8, step))  # headYaw is the seventh of the table; 6 is left out
        assert frame.values[YAW] == pytest.approx(value)


def test_other_messages_are_passed_over_wherever_they_come() -> None:
    decoder, stream = FORM.decoder(P), b""
    for message in (
        mido.Message("note_on", note=1, velocity=100), mido.Message("pitchwheel", pitch=100),
        mido.Message("program_change", program=1), mido.Message("sysex", data=[1, 127, 1, 5]),
        mido.Message("clock"), mido.Message("songpos", pos=1),
    ):  # fmt: skip
        stream += bytes(message.bytes())
    assert decoder.feed(stream) == [] and not decoder.refused
    (frame,) = decoder.feed(b"\xb0\x01\xf8\x7f\xfe")  # real-time bytes between the others
    assert frame.values[JAW] == 1.0
    assert decoder.feed(change(100, 1)) == [] and decoder.refused["controllers that move nothing"] == 1


@pytest.mark.parametrize("size", [1, 2, 5])
def test_running_status_and_pieces_of_any_size(size: int) -> None:
    decoder, frames = FORM.decoder(P), list[Frame]()
    stream = b"\x40" + b"\xb3" + b"\x01\x10" + b"\x01\x20" + b"\x02\x7f"
    for at in range(0, len(stream), size):
        frames += decoder.feed(stream[at : at + size])
    assert frames[-1].values[JAW] == pytest.approx(0x20 / 127)
    assert frames[-1].values[P.index("mouthSmileLeft")] == 1.0


def test_what_is_written_is_read_by_mido_and_few_controllers_are_written_again() -> None:
    encoder, sent = FORM.encoder(P), face(3)
    (message,) = encoder.encode(sent)
    found = mido.parse_all(message)
    assert len(found) == len(P) and {each.type for each in found} == {"control_change"}
    again = [
        each.control for _ in range(len(P)) for message in encoder.encode(sent) for each in mido.parse_all(message)
    ]
    assert sorted(again) == sorted(each.control for each in found)
    values = sent.values.copy()
    values[JAW] = 0.0
    (message,) = encoder.encode(Frame(values, sent.mask))
    assert (1, 0) in [(each.control, each.value) for each in mido.parse_all(message)] and len(message) <= 6
