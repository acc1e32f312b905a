"""controller.links.net.neutral: neutral faces and ranges that are learned, and the file that keeps them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import LinkError
from controller.base.parameters import PARAMETERS as P
from controller.links.net.neutral import STILL_S, Neutral, Ranges, load_state, save_state, state_file

JAW, YAW = P.index("jawOpen"), P.index("headYaw")


def face(**values: float) -> np.ndarray:
    out = P.neutral()
    for name, value in values.items():
        out[P.index(name)] = value
    return out


def learned(**values: float) -> Neutral:
    neutral = Neutral(P)
    for k in range(30):
        neutral.learn(face(**values), 0.1 * k)
    assert neutral.known
    return neutral


def test_the_first_two_still_seconds_are_the_neutral_face_and_their_mean_counts() -> None:
    neutral = Neutral(P)
    assert not any(neutral.learn(face(jawOpen=0.1 * k), 0.1 * k) for k in range(10)), "it moves"
    values = [0.20, 0.22] * 20
    known = [neutral.learn(face(jawOpen=value), 2.0 + 0.1 * k) for k, value in enumerate(values)]
    assert known.index(True) == round(STILL_S / 0.1)
    assert neutral.values[JAW] == pytest.approx(0.21, abs=0.001)


def test_a_move_begins_the_still_time_again() -> None:
    neutral = Neutral(P)
    for k in range(19):
        assert not neutral.learn(face(jawOpen=0.2), 0.1 * k)
    assert not neutral.learn(face(jawOpen=0.24), 1.9)
    assert not neutral.learn(face(jawOpen=0.24), 3.8)
    assert neutral.learn(face(jawOpen=0.24), 3.95)


def test_neutral_is_zero_and_one_stays_one() -> None:
    neutral = learned(jawOpen=0.2, headYaw=-0.1)
    at_rest, open_, turned = (neutral.apply(face(**each)) for each in (
        {"jawOpen": 0.2, "headYaw": -0.1}, {"jawOpen": 1.0}, {"headYaw": 0.4}))  # fmt: skip
    assert np.abs(at_rest).max() < 1e-12
    assert open_[JAW] == pytest.approx(1.0)
    assert neutral.apply(face(jawOpen=0.6))[JAW] == pytest.approx(0.5)
    assert neutral.apply(face(jawOpen=0.1))[JAW] == 0.0, "never below the neutral face"
    assert turned[YAW] == pytest.approx(0.5), "signed parameters are shifted"


@pytest.mark.parametrize("rest", [0.95, 1.0])
def test_a_parameter_that_rests_at_its_end_still_counts_there(rest: float) -> None:
    """At most 0.9 is taken off, so that 1 stays 1 and nothing is divided by 0."""
    assert learned(jawOpen=rest).apply(face(jawOpen=1.0))[JAW] == pytest.approx(1.0)


def test_ranges_that_stay_small_are_widened_to_twice_at_most() -> None:
    for top, factor in ((0.8, 1.25), (0.3, 2.0), (0.2, 1.0)):
        ranges = Ranges(P)
        for k in range(300):
            found = ranges.apply(face(jawOpen=top), 0.05 * k)
        assert found[JAW] == pytest.approx(top * factor), top


def test_ranges_count_the_more_the_longer_they_were_seen_and_pauses_count_little() -> None:
    ranges = Ranges(P)
    assert ranges.apply(face(jawOpen=0.5), 0.0)[JAW] == 0.5
    assert ranges.apply(face(jawOpen=0.5), 1000.0)[JAW] == pytest.approx(0.5 * 1.01)
    assert ranges.seen_s == pytest.approx(0.1)


def test_what_was_learned_is_kept(tmp_path: Path) -> None:
    neutral, ranges, path = learned(jawOpen=0.2), Ranges(P), tmp_path / "a.json"
    ranges.apply(face(jawOpen=0.7), 0.0)
    save_state(path, P, neutral, ranges)
    again, tops = Neutral(P), Ranges(P)
    load_state(path, P, again, tops)
    assert again.known and again.values == pytest.approx(neutral.values, abs=1e-6)
    assert tops.top[JAW] == pytest.approx(0.7) and tops.apply(face(jawOpen=0.35), 0.0)[JAW] == pytest.approx(0.5)


def test_an_unknown_neutral_face_is_not_kept(tmp_path: Path) -> None:
    save_state(tmp_path / "a.json", P, Neutral(P), Ranges(P))
    again = Neutral(P)
    load_state(tmp_path / "a.json", P, again, Ranges(P))
    assert not again.known
    load_state(tmp_path / "none.json", P, again, Ranges(P))


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("[]", "not a calibration of a link"),
        ('{"format": 1, "neutral": {}}', "not a calibration of a link"),
        ('{"format": 99, "neutral": {}, "ranges": {}}', "newer"),
        ('{"format": 1, "neutral": {"jawOpen": true}, "ranges": {}}', "jawOpen: must be a number"),
        ('{"format": 1, "neutral": {"jawOpen": 2.5}, "ranges": {}}', "jawOpen: must be a number"),
        ("{", "a.json"),
    ],
)
def test_a_damaged_file_is_named_and_changes_nothing(tmp_path: Path, text: str, why: str) -> None:
    path = tmp_path / "a.json"
    path.write_text(text)
    neutral = Neutral(P)
    with pytest.raises(LinkError, match=why) as caught:
        load_state(path, P, neutral, Ranges(P))
    assert f"rm {path}" in caught.value.hint
    assert not neutral.known


def test_any_name_makes_a_file_name(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    path = state_file("../../etc/passwd ü" + "x" * 300)
    assert path.parent.name == "links" and ".." not in path.parts and len(path.name) == 114


def test_sources_in_other_alphabets_have_files_of_their_own() -> None:
    assert state_file("livelink-左") != state_file("livelink-右")
    assert state_file("x" * 150) != state_file("x" * 151)
    assert state_file("livelink-capture").name == "livelink-capture.json"


def test_a_name_that_no_file_can_have_is_no_file_and_no_error(tmp_path: Path) -> None:
    """As in a folder of somebody else's: the link opens, and learns again."""
    neutral = Neutral(P)
    load_state(tmp_path / ("x" * 300), P, neutral, Ranges(P))
    assert not neutral.known
