"""What the check does in which order, lips that gape, poses that are no numbers."""

from __future__ import annotations

import numpy as np
import pytest

from surface.check import check_head
from surface.check.checker import not_finite, unsealed_lips
from surface.check.findings import Finding
from surface.check.subject import Subject
from tests.surface.check import plain
from tests.surface.check.test_mouth import DROP, HALF, LIPS_Y, jaw

MOUTH = plain.line_of_lips(LIPS_Y, 2 * HALF, DROP, 5.0)


@pytest.mark.parametrize(("gap", "scale", "named"), [(1.0, 1, False), (1.6, 1, True), (2.0, 2, False), (2.9, 2, True)])
def test_lips_that_gape_at_rest_are_named(gap: float, scale: int, named: bool) -> None:
    found = list(unsealed_lips(plain.subject(*jaw(gap), eyes=scale * plain.EYES), MOUTH))
    assert [f.text.startswith("the neutral face has its lips ") for f in found] == [True] * named


@pytest.mark.parametrize(("rest", "closed", "named"), [(0.0, 1.0, 0), (0.0, 1.6, 1), (3.0, 3.4, 0), (3.0, 4.2, 1)])
def test_lips_that_mouth_close_leaves_open_are_named(rest: float, closed: float, named: int) -> None:
    """Lips that gape at rest may do so by half as much again as closed ones may."""
    upper, lower = jaw(rest)
    lower.moves["mouthClose"] = lower.moves["jawOpen"] * np.float32(-(DROP + rest - closed) / DROP)
    lower = plain.part("lower", lower.rest, lower.triangles, moves=lower.moves)
    found = [f for f in unsealed_lips(plain.subject(upper, lower), MOUTH) if "mouthClose" in f.text]
    assert len(found) == named
    assert all("jawOpen = 1 with mouthClose = 1 leaves the lips" in f.text for f in found)


def test_a_head_without_a_mouth_has_no_lips() -> None:
    assert list(unsealed_lips(plain.subject(*jaw(9.0)), None)) == []


def test_the_first_pose_that_throws_vertices_out_of_space_is_named_with_its_parts() -> None:
    upper, lower = jaw()
    assert list(not_finite(plain.subject(upper, lower))) == []
    lower.moves["jawOpen"][3, 1] = np.inf
    head = plain.PlainHead([upper, plain.part("lower", lower.rest, lower.triangles, moves=lower.moves)])
    with np.errstate(all="ignore"):
        at_rest = check_head(head)  # type: ignore[arg-type]  # 0 x inf is no number
        for part in head.parts:
            part.moves["jawOpen"] = np.zeros((1, 3), np.float32)
            part.moves["cheekPuff"] = np.full((1, 3), 3e38, np.float32)
        in_a_pose = list(not_finite(Subject(far_away(head))))  # type: ignore[arg-type]
    assert [f.text for f in at_rest] == ["the neutral face throws vertices of lower out of space"]
    assert [f.text for f in in_a_pose] == ["cheekPuff = 1 throws vertices of upper, lower out of space"]


def far_away(head: plain.PlainHead) -> plain.PlainHead:
    """Heads whose points overflow once something moves them, but not at rest."""
    for part in head.parts:
        part.rest = np.full_like(part.rest, 3e38)
    return head


def test_a_head_in_a_wrong_unit_is_checked_no_further_and_left_at_rest() -> None:
    head = plain.PlainHead(jaw(9.0), eyes=10.0 * plain.EYES)
    assert [f.kind for f in check_head(head)] == ["wrong unit"]  # type: ignore[arg-type]
    assert head.parts[1].vertices.tolist() == head.parts[1].rest.tolist()


def test_a_line_names_the_folder() -> None:
    found = Finding("hole", "here", "omote fit MESH -o {folder}")
    assert found.line("heads/me") == "hole: here; next: omote fit MESH -o heads/me" and not found.warning
