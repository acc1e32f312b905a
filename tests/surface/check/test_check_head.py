"""Ten defects are seeded into the shipped head, and the check names each; heads without any pass."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from surface.check import Finding, borders, check_head, overlaps, spikes, stance
from surface.check.checker import unsealed_lips
from surface.check.mouth import find_mouth
from surface.check.places import Places
from surface.check.subject import Subject
from surface.head import Head
from surface.head.model.data import HeadData
from surface.head.model.file import load_data
from tests.surface.check import seeded

Seed = Callable[[HeadData], HeadData]
DEFECTS: dict[str, tuple[Seed, str]] = {
    "spike": (seeded.spike_at_rest, "left cheek"),
    "missing eye": (seeded.without_an_eye, "left eye"),
    "blind lid": (seeded.weak_blink, "eyeBlinkLeft = 1 leaves the eye"),
    "swapped sides": (seeded.swapped, "eyeBlinkLeft"),
    "hole": (seeded.hole_of_triangles, "left cheek"),
    "wrong unit": (lambda h: seeded.scaled(h, 10.0), "636 mm apart"),
    "off camera": (lambda h: seeded.moved(h, (0.0, 1500.0, 0.0)), "not in the front camera's picture"),
    "empty shape": (seeded.empty_shape, "browInnerUp = 1 moves nothing"),
    "inside-out part": (seeded.inside_out_part, "'face': its triangles run inwards"),
    "unsealed lips": (seeded.weak_mouth_close, "mouthClose = 1"),
}
TOGETHER = (
    ("blind lid", "hole", "empty shape", "inside-out part", "unsealed lips"),
    ("missing eye", "off camera"),
    ("spike", "swapped sides"),
    ("wrong unit",),
)
"""Defects that do not hide each other share a head, since a check of a whole head takes seconds."""
OTHERS: dict[str, tuple[Seed, Callable[[Subject], Iterator[Finding]], str]] = {
    "spike in a pose": (
        seeded.spike_in_a_pose,
        lambda s: spikes.spikes(s, Places(s, None), borders.find_borders(s)),
        "mouthSmileLeft = 1",
    ),
    "hole of a loop": (
        seeded.hole_of_a_loop,
        lambda s: borders.holes(s, None, Places(s, None), borders.find_borders(s)),
        "forehead",
    ),
    "turned round": (seeded.turned_round, lambda s: stance.off_camera(s, None), "back of the head"),
    "open lips": (seeded.open_lips, lambda s: unsealed_lips(s, find_mouth(s)), "neutral face"),
}


@pytest.fixture(scope="module")
def good(root: Path) -> HeadData:
    return load_data(root / "configs" / "heads" / "ict")


@pytest.fixture
def without_overlaps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leaves out the check that takes longest, which has tests of its own."""
    monkeypatch.setattr("surface.check.overlaps.overlapping", lambda *_: ())


def findings(head: HeadData) -> list[Finding]:
    return check_head(Head(head))


@pytest.mark.slow
def test_the_shipped_head_passes_without_a_warning(good: HeadData) -> None:
    assert findings(good) == []


@pytest.mark.slow
@pytest.mark.parametrize("kinds", TOGETHER, ids="+".join)
@pytest.mark.usefixtures("without_overlaps")
def test_seeded_defects_are_named_and_nothing_else_is(good: HeadData, kinds: tuple[str, ...]) -> None:
    found = findings(functools.reduce(lambda head, kind: DEFECTS[kind][0](head), kinds, good))
    for kind in kinds:
        named = [f for f in found if f.kind == kind]
        assert len(named) == 1 and not named[0].warning and DEFECTS[kind][1] in named[0].text and named[0].hint, found
        assert "\n" not in named[0].line("heads/me") and "{" not in named[0].line("heads/me")
    # eyes that the other side's blink closes are open, too
    follows = {"blind lid"} if "swapped sides" in kinds else set()
    assert {f.kind for f in found} - follows == {*kinds} - follows


def test_every_defect_is_seeded() -> None:
    assert sorted(kind for kinds in TOGETHER for kind in kinds) == sorted(DEFECTS)


@pytest.mark.slow
@pytest.mark.parametrize("name", OTHERS)
def test_other_forms_of_defects_are_found(good: HeadData, name: str) -> None:
    make, check, words = OTHERS[name]
    (found,) = check(Subject(Head(make(good))))
    assert words in found.text and not found.warning


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.7, (1.5, 1.3, 1.3)], ids=str)
@pytest.mark.usefixtures("without_overlaps")
def test_heads_of_other_sizes_and_proportions_pass(good: HeadData, factor: float | tuple[float, float, float]) -> None:
    assert findings(seeded.scaled(good, factor)) == []


@pytest.mark.slow
def test_an_eye_that_comes_through_the_lids_is_found(good: HeadData) -> None:
    few = seeded.with_groups(good, lambda g: g if g.name == "eyeBlinkLeft" else None)
    assert overlaps.overlap_notes(few) == []
    for factor in (1.0, 2.0):
        subject = Subject(Head(seeded.scaled(seeded.swollen_eye(few), factor)))
        (found,) = overlaps.overlapping(subject, Places(subject, None))
        assert "skin passes through the eyeball" in found.text and "left eye" in found.text
        assert found.kind == "overlap" and not found.warning
        assert 2.0 * factor < float(found.text.split(" mm")[0]) < 4.5 * factor  # the radius grew by 3.6 mm


@pytest.mark.slow
@pytest.mark.usefixtures("without_overlaps")
def test_a_head_without_eyes_or_blinks_is_a_warning(good: HeadData) -> None:
    none = seeded.without_parts(good, "eye_left", "eye_right", "sockets")
    found = findings(replace(none, eye_radius=0.0, contacts=[c for c in none.contacts if c.eye < 0]))
    assert [(f.kind, f.warning) for f in found if f.kind == "missing eye"] == [("missing eye", True)]


@pytest.mark.slow
def test_places_have_names(good: HeadData) -> None:
    subject = Subject(Head(good))
    mouth = find_mouth(subject)
    assert mouth is not None
    assert mouth.width == pytest.approx(46.0, abs=6.0) and abs(mouth.middle[0]) < 1.0
    places = Places(subject, mouth)
    wanted = {
        "left mouth corner": (26, -34, 104), "right cheek": (-50, -15, 92), "chin": (0, -72, 112), "nose": (0, 2, 128),
        "forehead": (5, 90, 115), "left ear": (78, 10, 12), "top of the head": (0, 140, 10), "lower lip": (0, -42, 118),
        "upper lip": (0, -25, 120), "right eye": (-32, 36, 96),
    }  # fmt: skip
    assert {n: places.name(np.array(at, float)) for n, at in wanted.items()} == {n: n for n in wanted}
    assert (
        places.name(np.zeros(3), "teeth") == "teeth" and places.name(np.array([30.0, 36, 90]), "eye") == "left eyeball"
    )
