"""Gaps of lips and lids: which are measured, in which pose, and how much is allowed on heads of any size."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from surface.fit.transfer.reports import gaps
from surface.fit.transfer.reports.gaps import Gap, measure_gaps


@pytest.fixture
def subject(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """A head of usual size that has all shapes: its lips stand open by 0.1 mm for each letter of a pose."""
    every = SimpleNamespace(scale=1.0, rest="rest", claimed={"mouthClose", *gaps.BLINKS}, at_one=lambda name: name)
    monkeypatch.setattr(gaps, "Head", lambda data: data)
    monkeypatch.setattr(gaps, "Subject", lambda head: every)
    monkeypatch.setattr(gaps, "find_mouth", lambda subject: "the mouth")
    monkeypatch.setattr(gaps, "lips_gap", lambda subject, mouth, at: (0.1 * len(at), "where"))
    monkeypatch.setattr(gaps, "eye_opening", lambda subject, side, at: 0.2 + side)
    return every


def test_lips_are_measured_at_rest_and_shut_and_lids_in_a_blink(subject: SimpleNamespace) -> None:
    found = measure_gaps(subject)  # type: ignore[arg-type]
    assert [(gap.what, gap.pose, pytest.approx(gap.mm)) for gap in found] == [
        ("lips", "at rest", 0.4),
        ("lips", "jawOpen 1 with mouthClose 1", 1.0),
        ("left lids", "eyeBlinkLeft 1", 0.2),
        ("right lids", "eyeBlinkRight 1", 1.2),
    ]
    assert {gap.most_mm for gap in found} == {gaps.MOST_MM} == {0.5}


@pytest.mark.parametrize(("scale", "most"), [(0.5, 0.5), (1.0, 0.5), (3.0, 1.5)])
def test_larger_heads_may_have_larger_gaps(subject: SimpleNamespace, scale: float, most: float) -> None:
    subject.scale = scale
    assert {gap.most_mm for gap in measure_gaps(subject)} == {most}  # type: ignore[arg-type]


def test_what_a_head_lacks_is_not_measured(subject: SimpleNamespace, monkeypatch: pytest.MonkeyPatch) -> None:
    subject.claimed = {gaps.BLINKS[1]}
    assert [gap.what for gap in measure_gaps(subject)] == ["lips", "right lids"]  # type: ignore[arg-type]
    monkeypatch.setattr(gaps, "find_mouth", lambda subject: None)
    assert [gap.what for gap in measure_gaps(subject)] == ["right lids"]  # type: ignore[arg-type]


def test_a_gap_says_whether_it_is_closed() -> None:
    assert str(Gap("lips", "at rest", 0.5, 0.5)) == "lips, at rest: closed, 0.50 mm of at most 0.50"
    assert str(Gap("lips", "at rest", 0.51, 0.5)) == "lips, at rest: OPEN, 0.51 mm of at most 0.50"
