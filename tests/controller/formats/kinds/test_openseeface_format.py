"""Records of OpenSeeFace against the layout of its receiver, written out by hand."""

from __future__ import annotations

import math
import struct

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.formats.frame import Frame
from controller.formats.kinds.openseeface_format import FORMAT, SIZES, OpenSeeFaceDecoder, OpenSeeFaceEncoder
from tests.controller.formats.faces import face

FEATURES = (
    "eye_l eye_r steepness_l updown_l quirk_l steepness_r updown_r quirk_r corner_updown_l corner_inout_l "
    "corner_updown_r corner_inout_r mouth_open mouth_wide"
)


def record(
    *,
    open_right: float = 1.0,
    open_left: float = 1.0,
    got_3d: int = 1,
    euler: tuple[float, ...] = (-180, 0, 90),
    points: float = 0.0,
    features: dict[str, float] | None = None,
) -> bytes:
    """A record, field by field in the order of facetracker.py."""
    data = struct.pack("<d", 12.5) + struct.pack("<i", 3) + struct.pack("<ff", 640, 480)
    data += struct.pack("<ff", open_right, open_left) + struct.pack("<B", got_3d) + struct.pack("<f", 1.0)
    data += struct.pack("<ffff", 0, 0, 0, 1) + struct.pack("<fff", *euler) + struct.pack("<fff", 1, 2, 3)
    data += (
        struct.pack("<68f", *[0.9] * 68) + struct.pack("<136f", *[points] * 136) + struct.pack("<210f", *[points] * 210)
    )
    if features is not None:
        data += struct.pack("<14f", *(features.get(name, 0.0) for name in FEATURES.split()))
    return data


def read(data: bytes) -> dict[str, float]:
    (frame,) = OpenSeeFaceDecoder(P).feed(data)
    return {name: float(frame.values[i]) for i, name in enumerate(P.names) if frame.mask[i]}


def test_records_have_the_two_documented_sizes() -> None:
    assert SIZES == (1729, 1785) == (len(record()), len(record(features={})))


def test_eyes_come_right_first() -> None:
    found = read(record(open_right=0.25, open_left=1.0))
    assert (found["eyeBlinkRight"], found["eyeBlinkLeft"]) == (0.75, 0.0)


def test_features_move_brows_and_mouth() -> None:
    found = read(record(features={"updown_l": 0.5, "updown_r": -0.25, "corner_updown_l": -0.75, "corner_updown_r": 0.5,
                                  "mouth_open": 0.625, "mouth_wide": -0.375}))  # fmt: skip
    moved = {name: value for name, value in found.items() if abs(value) > 1e-6}
    assert moved == {
        "browOuterUpLeft": 0.5, "browDownRight": 0.25, "browInnerUp": 0.25, "mouthSmileLeft": 0.75,
        "mouthFrownRight": 0.5, "jawOpen": 0.625, "mouthPucker": 0.375,
    }  # fmt: skip
    assert read(record(features={"mouth_wide": 0.5}))["mouthStretchLeft"] == 0.5


def test_a_head_that_looks_ahead_is_straight_and_one_that_turns_is_not() -> None:
    straight = read(record())
    assert [straight[name] for name in ("headYaw", "headPitch", "headRoll")] == pytest.approx([0, 0, 0], abs=1e-6)
    also = read(record(euler=(180, 0, 90)))
    assert also["headPitch"] == pytest.approx(0.0, abs=1e-6)
    turned = read(record(euler=(170, 30, 75)))
    assert turned["headYaw"] == pytest.approx(30 / 60) and turned["headPitch"] == pytest.approx(10 / 40)
    assert turned["headRoll"] == pytest.approx(15 / 30)


def test_a_pose_that_was_not_found_is_left_to_other_layers() -> None:
    assert {*read(record(got_3d=0))} == {"eyeBlinkLeft", "eyeBlinkRight"}


def test_of_several_faces_the_first_one_counts() -> None:
    assert read(record(open_left=0.5) + record(open_left=0.0))["eyeBlinkLeft"] == 0.5
    (frame,) = OpenSeeFaceDecoder(P).feed(record())
    assert (frame.subject, frame.time_s) == ("face 3", 12.5)


@pytest.mark.parametrize("data", [b"", b"?", record()[:-1], record() + b"?", record(features={})[:-4], bytes(1700)])
def test_other_lengths_are_refused(data: bytes) -> None:
    decoder = OpenSeeFaceDecoder(P)
    assert decoder.feed(data) == [] and decoder.refused == {"not a whole number of records": 1}


def test_what_is_no_number_is_left_out() -> None:
    found = read(
        record(open_left=math.nan, euler=(math.nan, math.inf, 90), features={"mouth_open": math.inf}, points=math.nan)
    )
    assert {"eyeBlinkLeft", "jawOpen", "headYaw", "headPitch"} & {*found} == set() and "eyeBlinkRight" in found


def test_of_a_smile_and_a_frown_the_difference_comes_back() -> None:
    sent = face(5, 2.0)
    (data,) = OpenSeeFaceEncoder(P).encode(sent)
    assert len(data) == 1785
    found = read(data)
    difference = sent.values[P.index("mouthSmileLeft")] - sent.values[P.index("mouthFrownLeft")]
    assert found["mouthSmileLeft"] - found["mouthFrownLeft"] == pytest.approx(difference, abs=1e-6)
    for name in ("eyeBlinkLeft", "eyeBlinkRight", "jawOpen", "headYaw", "headPitch", "headRoll"):
        assert found[name] == pytest.approx(sent.values[P.index(name)], abs=1e-5), name
    nobody = Frame(sent.values, sent.mask, face=False)
    assert OpenSeeFaceEncoder(P).encode(nobody) == []


def test_the_format_says_what_it_carries_and_what_only_about() -> None:
    carries, about = (np.flatnonzero(flags(P)) for flags in (FORMAT.carries, FORMAT.about))
    assert {P.names[i] for i in carries} >= {"jawOpen", "eyeBlinkLeft", "headYaw"}
    assert {P.names[i] for i in about} >= {"mouthSmileLeft", "mouthFrownLeft"}
    assert not {*carries} & {*about} and len(carries) + len(about) < len(P.names)
