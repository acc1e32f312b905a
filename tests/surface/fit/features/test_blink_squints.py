"""A squint that opens a blinking eye is subtracted in proportion to the blink."""

from dataclasses import replace

import numpy as np
import pytest

from surface.check.lids import eye_opening
from surface.check.subject import Subject
from surface.fit.features import blink_squints
from surface.fit.features.blink_squints import cancel_squints_in_blinks
from surface.head import Head
from surface.head.model.data import Group, HeadData

BOTH = {"eyeBlinkLeft": 1.0, "eyeSquintLeft": 1.0}


def squinting(data: HeadData, share: float, *sides: str) -> HeadData:
    """The head whose squints undo a part of its blinks."""
    parts = []
    for part in data.parts:
        own = [g for g in part.groups if g.name in {f"eyeBlink{s}" for s in sides}]
        more = [Group(g.name.replace("Blink", "Squint"), g.ids, np.float32(-share) * g.moves) for g in own]
        parts.append(replace(part, groups=[*part.groups, *more]))
    return replace(data, parts=parts)


def opening(data: HeadData, pose: dict[str, float]) -> float:
    head = Head(data)
    head.pose(head.values(pose))
    return eye_opening(Subject(Head(data)), 0, [np.array(p.vertices) for p in head.parts])


@pytest.mark.slow
def test_a_blink_stays_shut_with_a_squint_that_opened_it(head: Head) -> None:
    bad = squinting(head.data, 0.7, "Left")
    alone = opening(bad, {"eyeBlinkLeft": 1.0})
    assert opening(bad, BOTH) > alone + 1.0
    mended, (note,) = cancel_squints_in_blinks(bad)
    assert opening(mended, BOTH) == pytest.approx(alone, abs=0.05) and note.startswith("eyeSquintLeft left ")
    only = {"eyeSquintLeft": 1.0}
    assert opening(mended, only) == pytest.approx(opening(bad, only), abs=0.01)
    assert cancel_squints_in_blinks(mended) == (mended, [])


@pytest.mark.slow
def test_a_squint_that_leaves_the_eye_shut_and_a_head_without_squints_stay(head: Head) -> None:
    good = squinting(head.data, -0.2, "Left", "Right")
    for data in (good, head.data):
        same, notes = cancel_squints_in_blinks(data)
        assert not notes and same.rules == data.rules


@pytest.mark.slow
@pytest.mark.parametrize(("alone", "both", "bad"), [(0.1, 0.4, False), (0.1, 0.6, True), (0.7, 0.6, False)])
def test_half_a_millimetre_of_a_blinking_eye_may_show(
    head: Head, monkeypatch: pytest.MonkeyPatch, alone: float, both: float, bad: bool
) -> None:
    monkeypatch.setattr(
        blink_squints, "_opening_mm", lambda face, subject, side, pose: both if len(pose) > 1 else alone
    )
    _, notes = cancel_squints_in_blinks(squinting(head.data, 0.7, "Left"))
    assert bool(notes) == bad
