"""VMC against python-osc, bytes of other implementers, and senders that keep the rules loosely."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.formats.frame import Frame
from controller.formats.kinds.vmc_format import VmcDecoder, VmcEncoder
from controller.formats.osc import bundle, message
from tests.controller.formats.faces import face

VALUE, APPLY = "/VMC/Ext/Blend/Val", message("/VMC/Ext/Blend/Apply")


def value(name: str, amount: float) -> bytes:
    return message(VALUE, name, amount)


def bone(name: str, x: float, y: float, z: float, w: float) -> bytes:
    return message("/VMC/Ext/Bone/Pos", name, 0.0, 0.0, 0.0, x, y, z, w)


def got(frame: Frame, name: str) -> float:
    return float(frame.values[P.index(name)])


def feed(decoder: VmcDecoder, *messages: bytes) -> list[Frame]:
    return [frame for each in messages for frame in decoder.feed(each)]


def test_values_count_from_apply_on() -> None:
    decoder = VmcDecoder(P)
    assert feed(decoder, value("JawOpen", 0.5), APPLY)
    assert feed(decoder, value("JawOpen", 0.9)) == []
    (frame,) = feed(decoder, value("MouthSmileLeft", 0.25), APPLY)
    assert (got(frame, "jawOpen"), got(frame, "mouthSmileLeft")) == pytest.approx((0.9, 0.25))
    (frame,) = feed(decoder, APPLY)
    assert got(frame, "jawOpen") == pytest.approx(0.9)  # what is not named stays


def test_the_bytes_of_the_specification_are_read() -> None:
    """Section 3 of the sheet of facts has them written out."""
    one = bytes.fromhex("2f564d432f4578742f426c656e642f56616c00002c7366004a6f79003f000000")
    two = bytes.fromhex("2f564d432f4578742f426c656e642f4170706c79000000002c000000")
    (frame,) = feed(VmcDecoder(P), one, two)
    assert got(frame, "mouthSmileLeft") > 0.2


def test_bytes_of_other_implementers_are_read(shared: Path) -> None:
    decoder = VmcDecoder(P)
    vectors = shared / "data" / "protocol-vectors" / "vmc_osc.json"
    for vector in json.loads(vectors.read_text(encoding="utf-8")):
        frames = decoder.feed(bytes.fromhex(vector["hex"]))
        if "Apply" in vector["meaning"]:
            assert got(frames[0], "jawOpen") > 0.1  # A 0.5
    assert not decoder.refused


@pytest.mark.parametrize("name", ["jawOpen", "JawOpen", "JAWOPEN", "jaw_open"])
def test_names_are_known_in_any_case(name: str) -> None:
    (frame,) = feed(VmcDecoder(P), value(name, 0.5), APPLY)
    assert got(frame, "jawOpen") == pytest.approx(0.5)


def test_presets_of_lips_do_not_add_to_names_of_arkit() -> None:
    decoder = VmcDecoder(P)
    (frame,) = feed(decoder, value("A", 1.0), value("Blink_L", 1.0), APPLY)
    assert got(frame, "jawOpen") > 0.3 and got(frame, "eyeBlinkLeft") == 1.0
    (frame,) = feed(decoder, value("JawOpen", 0.0), value("Joy", 1.0), APPLY)
    assert got(frame, "eyeBlinkLeft") == 0.0 and got(frame, "mouthSmileLeft") > 0.5
    (frame,) = feed(decoder, value("Joy", 0.0), APPLY)
    assert got(frame, "mouthSmileLeft") == 0.0


def test_a_sender_without_apply_gives_a_frame_when_a_name_comes_again() -> None:
    decoder = VmcDecoder(P)
    assert feed(decoder, value("JawOpen", 0.5), value("CheekPuff", 0.1)) == []
    (frame,) = feed(decoder, value("JawOpen", 0.6))
    assert (got(frame, "jawOpen"), got(frame, "cheekPuff")) == pytest.approx((0.5, 0.1))
    feed(decoder, APPLY)
    assert feed(decoder, value("JawOpen", 0.1), value("JawOpen", 0.2)) == []  # from an Apply on it keeps the rule


def test_bones_turn_head_and_eyes_in_unitys_axes() -> None:
    """30 degrees about y to the right; Unity's Quaternion.Euler(0, 30, 0) is (0, 0.2588, 0, 0.9659)."""
    (frame,) = feed(VmcDecoder(P), bone("Head", 0.0, 0.258819, 0.0, 0.965926), APPLY)
    assert got(frame, "headYaw") == pytest.approx(-30 / 60, abs=1e-5)
    (frame,) = feed(VmcDecoder(P), bone("LeftEye", 0.0871557, 0.0, 0.0, 0.9961947), APPLY)  # Euler(10, 0, 0): down
    assert got(frame, "leftEyePitch") == pytest.approx(10 / 30, abs=1e-5) and not frame.mask[P.index("headYaw")]


def test_a_neck_turns_the_head_with_it() -> None:
    half = (0.0, math.sin(math.radians(7.5)), 0.0, math.cos(math.radians(7.5)))
    (frame,) = feed(VmcDecoder(P), bone("Neck", *half), bone("Head", *half), APPLY)
    assert got(frame, "headYaw") == pytest.approx(-30 / 60, abs=1e-5)


def test_a_sender_of_bones_alone_gives_a_frame_with_each_time() -> None:
    decoder = VmcDecoder(P)
    time = message("/VMC/Ext/T", 5.0)
    assert feed(decoder, time, bone("Head", 0.0, 0.0, 0.1, 1.0)) == []
    (frame,) = feed(decoder, time)
    assert got(frame, "headRoll") < -0.1 and frame.time_s == 5.0


@pytest.mark.parametrize(
    "wrong",
    [message(VALUE), message(VALUE, "JawOpen"), message(VALUE, 0.5, "JawOpen"), message(VALUE, "JawOpen", "0.5"),
     message(VALUE, "JawOpen", math.nan), message(VALUE, "JawOpen", math.inf),
     message("/VMC/Ext/Bone/Pos", "Head"), message("/VMC/Ext/Bone/Pos", "Head", 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
     bone("Head", 0.0, 0.0, 0.0, 0.0), bone("Head", math.nan, 0.0, 0.0, 1.0), message("/VMC/Ext/Bone/Pos", 1, 2)],
)  # fmt: skip
def test_a_wrong_message_is_counted_and_the_rest_of_its_bundle_is_taken(wrong: bytes) -> None:
    decoder = VmcDecoder(P)
    (frame,) = decoder.feed(bundle([value("JawOpen", 0.5), wrong, value("CheekPuff", 0.25), APPLY]))
    assert (got(frame, "jawOpen"), got(frame, "cheekPuff")) == (0.5, 0.25) and np.isfinite(frame.values).all()
    assert sum(decoder.refused.values()) == 1


def test_unknown_addresses_surplus_arguments_and_names_of_an_avatar_do_no_harm() -> None:
    decoder = VmcDecoder(P)
    (frame,) = decoder.feed(
        bundle([message("/VMC/Ext/Cam", "Camera", 1.0), message("/other", 5), value("MTH_Fcl_A", 1.0),
                message(VALUE, "JawOpen", 0.5, 99, "more"), message("/VMC/Ext/OK", 1, 3, 0, 1),
                message("/VMC/Ext/Bone/Pos", "Head", 0.0, 0.0, 0.0, 0.0, 0.258819, 0.0, 0.965926, 7.0), APPLY])
    )  # fmt: skip
    assert got(frame, "jawOpen") == 0.5 and got(frame, "headYaw") < -0.4 and not decoder.refused
    assert frame.mask.sum() == 4, "the jaw and three angles of the head"


def test_names_without_end_take_bounded_memory() -> None:
    decoder = VmcDecoder(P)
    for n in range(10_000):
        decoder.feed(value(f"name{n}", 1.0))
    assert len(decoder._pending) + len(decoder._names) < 10_000
    (frame,) = feed(decoder, APPLY)
    assert not frame.mask.any()


def test_another_library_reads_what_is_sent() -> None:
    osc_bundle = pytest.importorskip("pythonosc.osc_bundle")
    sent = face(3, 7.5)
    (data,) = VmcEncoder(P).encode(sent)
    contents = [osc_bundle.OscBundle(data).content(i) for i in range(osc_bundle.OscBundle(data).num_contents)]
    values = {each.params[0]: each.params[1] for each in contents if each.address == VALUE}
    assert len(values) == 52 and contents[-1].address == "/VMC/Ext/Blend/Apply" and contents[-1].params == []
    assert values["MouthUpperUpRight"] == pytest.approx(sent.values[P.index("mouthUpperUpRight")])
    assert [each.params for each in contents if each.address == "/VMC/Ext/T"] == [[7.5]]
    bones = {each.params[0]: each.params[1:] for each in contents if each.address == "/VMC/Ext/Bone/Pos"}
    assert {*bones} == {"Head", "LeftEye", "RightEye"}
    assert all(len(each) == 7 and math.hypot(*each[3:]) == pytest.approx(1.0) for each in bones.values())


def test_frames_without_a_time_are_a_sixtieth_of_a_second_apart_from_0_on() -> None:
    osc_bundle = pytest.importorskip("pythonosc.osc_bundle")
    encoder = VmcEncoder(P)
    sent = [osc_bundle.OscBundle(encoder.encode(face(3, None))[0]) for _ in range(3)]
    assert [each.content(1).params[0] for each in sent] == pytest.approx([0.0, 1 / 60, 2 / 60])


def test_a_frame_without_a_face_says_that_nothing_is_tracked() -> None:
    osc_bundle = pytest.importorskip("pythonosc.osc_bundle")
    (data,) = VmcEncoder(P).encode(Frame(P.neutral(), np.zeros(len(P), dtype=bool), face=False))
    first = osc_bundle.OscBundle(data).content(0)
    assert (first.address, first.params[-1]) == ("/VMC/Ext/OK", 0)
