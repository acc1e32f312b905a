"""The words of iCub's face."""

from __future__ import annotations

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.formats.format import FORMATS
from controller.formats.frame import Frame
from controller.vocabulary.vocabulary import Vocabulary

FORM = FORMATS.get("icub")
SMILE, BROW, LID = P.index("mouthSmileLeft"), P.index("browInnerUp"), P.index("eyeWideLeft")


def test_all_of_the_face_takes_an_emotion() -> None:
    (frame,) = FORM.decoder(P).feed(b"set all hap")
    happy = Vocabulary.load(P)["happiness"].weights
    np.testing.assert_allclose(frame.values[frame.mask], happy[frame.mask])
    assert frame.values[SMILE] > 0.3 and not frame.mask[P.index("headYaw")]


def test_parts_are_set_one_by_one() -> None:
    decoder = FORM.decoder(P)
    (frame,) = decoder.feed(b"SET mou hap\r")
    assert frame.values[SMILE] > 0.3 and frame.values[BROW] == 0.0
    (frame,) = decoder.feed(b"set eli sur")
    assert frame.values[SMILE] > 0.3 and frame.values[LID] > 0.3
    (frame,) = decoder.feed(b"set reb ang")
    assert frame.values[P.index("browDownRight")] > 0.3 and frame.values[P.index("browDownLeft")] == 0.0
    (frame,) = decoder.feed(b"set all ta2")
    assert frame.values[P.index("jawOpen")] > 0.3 and frame.values[LID] > 0.3


@pytest.mark.parametrize(
    "line", [b"", b"help", b"set", b"set all", b"set nose hap", b"set raw M08", b"set all hap now"]
)
def test_what_sets_no_emotion_is_counted(line: bytes) -> None:
    decoder = FORM.decoder(P)
    assert decoder.feed(line) == [] and sum(decoder.refused.values()) == 1
    assert decoder.feed(b"set all xyz") == [] and decoder.refused["unknown emotions"] == 1


@pytest.mark.parametrize("name", ["neu", "hap", "sad", "sur", "ang", "evi", "shy", "cun"])
def test_every_emotion_comes_back(name: str) -> None:
    (frame,) = FORM.decoder(P).feed(f"set all {name}".encode())
    assert FORM.encoder(P).encode(Frame(frame.values, frame.mask)) == [f"set all {name}".encode()]
