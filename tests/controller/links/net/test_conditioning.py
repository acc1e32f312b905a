"""The chain from a source's values to a layer's: eyes, neutral face, ranges, limits."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from controller.base.errors import LinkError
from controller.base.parameters import PARAMETERS as P
from controller.formats.format import FORMATS
from controller.formats.frame import Frame
from controller.links.net.conditioning import Conditioning
from controller.links.net.kinds import link_of
from controller.links.net.neutral import STILL_S, state_file

EVERY = np.ones(len(P), dtype=bool)


def chain(path: Path | None = None, **keys: Any) -> Conditioning:
    return Conditioning(link_of(FORMATS.get("livelink")).settings(**keys), P, path)


def values(**named: float) -> np.ndarray:
    found = P.neutral()
    for name, value in named.items():
        found[P.index(name)] = value
    return found


def shown(chain: Conditioning, now_s: float = 0.0, **named: float) -> dict[str, float]:
    found, _ = chain.apply(Frame(values(**named), EVERY), now_s)
    return {name: round(float(found[i]), 4) for i, name in enumerate(P.names) if abs(found[i]) > 1e-4}


def test_values_are_kept_in_range() -> None:
    assert shown(chain(), jawOpen=1.7, cheekPuff=-0.3, headYaw=-2.0) == {"jawOpen": 1.0, "headYaw": -1.0}


def test_eyes_that_are_told_in_two_ways_count_once() -> None:
    both = {"eyeLookDownLeft": 0.5, "leftEyePitch": 0.4}
    assert shown(chain(), **both) == {"eyeLookDownLeft": 0.5}
    assert shown(chain(eyes="angles"), **both) == {"leftEyePitch": 0.4}
    assert shown(chain(eyes="looks"), **both) == {"eyeLookDownLeft": 0.5}
    assert shown(chain(eyes="both"), **both) == both
    assert shown(chain(), leftEyePitch=0.4) == {"leftEyePitch": 0.4}


def test_a_still_face_becomes_neutral_and_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "phone.json"
    learning = chain(path, calibrate="keep")
    for n in range(30):  # moving: nothing is learned
        shown(learning, n / 30, jawOpen=n % 2)
    assert not learning.neutral_known
    for n in range(80):
        now_s = 1.0 + n / 30
        shown(learning, now_s, jawOpen=0.2, headYaw=0.1)
    assert learning.neutral_known and STILL_S < 80 / 30
    assert shown(learning, 5.0, jawOpen=0.2, headYaw=0.1) == {}
    assert shown(learning, 5.1, jawOpen=1.0, headYaw=0.3) == {"jawOpen": 1.0, "headYaw": 0.2}
    again = chain(path, calibrate="keep")
    assert again.neutral_known and shown(again, jawOpen=0.6, headYaw=0.1) == {"jawOpen": 0.5}
    assert not chain(path, calibrate="again").neutral_known


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (b"", "JSON"), (b"{", "JSON"), (b"[]", "is not a calibration of a link"), (b"\xff", "UTF-8"),
        (b'{"format": 2, "neutral": {}, "ranges": {}}', "written by a newer omote"),
        (b'{"neutral": {}, "ranges": {}}', "format: must be a whole number"),
        (b'{"format": 1, "neutral": {"jawOpen": []}, "ranges": {}}', "jawOpen: must be a number from -2 to 2"),
        (b'{"format": 1, "neutral": 5, "ranges": {}}', "is not a calibration of a link"),
    ],
)  # fmt: skip
def test_a_damaged_file_is_told_with_what_to_do(tmp_path: Path, text: bytes, why: str) -> None:
    path = tmp_path / "phone.json"
    path.write_bytes(text)
    with pytest.raises(LinkError, match=why) as told:
        chain(path, calibrate="keep")
    assert str(path) in str(told.value) and told.value.hint == f"delete it: rm {path}"


def test_a_folder_that_cannot_be_written_ends_nothing(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "file").write_text("")
    learning = chain(tmp_path / "file" / "phone.json", calibrate="again")
    for n in range(80):
        shown(learning, n / 30, jawOpen=0.2)
    assert learning.neutral_known and shown(learning, 5.0, jawOpen=0.2) == {}
    assert "what a link learned is not kept" in caplog.text


def test_ranges_are_widened_to_at_most_twice_as_much(tmp_path: Path) -> None:
    path = tmp_path / "ranges.json"
    learning = chain(path, ranges=True)
    for n in range(400):
        found = shown(learning, n / 30, jawOpen=0.6 * (n % 2), cheekPuff=0.3 * (n % 2), noseSneerLeft=0.1 * (n % 2))
    assert found == {"jawOpen": 1.0, "cheekPuff": 0.6, "noseSneerLeft": 0.1}
    learning.save()
    assert json.loads(path.read_text())["ranges"]["jawOpen"] == 0.6
    assert shown(chain(path, ranges=True), jawOpen=0.3) == {"jawOpen": 0.5}


def test_the_file_of_a_link_lies_in_the_users_state(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert state_file("livelink-../../My iPhone") == tmp_path / "omote/links/livelink-.._.._My_iPhone.json"


@pytest.mark.parametrize("huge", [3.0, 1e30, -1e300])
def test_one_message_with_a_huge_number_is_over_with_the_next_one(tmp_path: Path, huge: float) -> None:
    """Neither the filter nor what is kept remembers it: the link opens again, and the face moves as before."""
    path = tmp_path / "phone.json"
    hit = chain(path, ranges=True, smoothing=True, beta=0.0)
    shown(hit, 0.0, jawOpen=0.1)
    shown(hit, 1 / 60, jawOpen=huge)
    for n in range(2, 60):
        found = shown(hit, n / 60, jawOpen=0.1)
    assert found["jawOpen"] == pytest.approx(0.1, abs=0.05)
    hit.save()
    assert shown(chain(path, ranges=True), jawOpen=0.5) == {"jawOpen": 0.5}


def test_parameters_of_ones_own_are_learned_in_their_range(tmp_path: Path) -> None:
    """Ears that turn from -2 to 10 and rest at 1, in another unit than all others."""
    file, path = tmp_path / "ears.toml", tmp_path / "phone.json"
    file.write_text(
        '[parameters.earTurn]\nregion = "head"\nrange = [-2, 10]\nrest = 1\nresponse_s = 0.1\n'
        "max_speed = 50\nmax_acceleration = 500\n"
        '[parameters.earUp]\nregion = "head"\nrange = [0, 0.4]\nresponse_s = 0.1\nmax_speed = 1\nmax_acceleration = 9\n'
    )
    own = P.with_files([file])
    turn, up = own.index("earTurn"), own.index("earUp")

    def show(link: Conditioning, now_s: float, turned: float, raised: float) -> list[float]:
        given = own.neutral()
        given[[turn, up]] = turned, raised
        found, _ = link.apply(Frame(given, np.ones(len(own), dtype=bool)), now_s)
        return [round(float(found[at]), 4) for at in (turn, up)]

    def opened(**keys: Any) -> Conditioning:
        return Conditioning(link_of(FORMATS.get("livelink")).settings(**keys), own, path)

    link = opened(calibrate="keep")
    assert show(link, 0.0, 3.0, 0.1) == [3.0, 0.1]
    for n in range(1, 90):
        show(link, n / 30, 3.0, 0.1)
    assert link.neutral_known and show(link, 3.0, 3.0, 0.1) == [1.0, 0.0], "at rest where the source is neutral"
    assert show(link, 3.1, 10.0, 0.4) == [8.0, 0.4]
    assert show(opened(calibrate="keep"), 0.0, 3.0, 0.1) == [1.0, 0.0]
    path.unlink()
    link = opened(ranges=True)
    for n in range(400):
        show(link, n / 30, 1.0 + 9.0 * (n % 2), 0.4 * (n % 2))
    assert show(link, 14.0, 5.0, 0.2) == [5.0, 0.2], "what goes through its whole range is not widened"
    link.save()
    assert show(opened(ranges=True), 0.0, 5.0, 0.2) == [5.0, 0.2]


def test_smoothing_takes_noise_away() -> None:
    smooth, rng = chain(smoothing=True, min_cutoff_hz=1.0, beta=0.1), np.random.default_rng(1)
    found = [shown(smooth, n / 60, jawOpen=0.5 + rng.normal(0, 0.05))["jawOpen"] for n in range(300)]
    assert np.std(found[60:]) < 0.02 and np.mean(found[60:]) == pytest.approx(0.5, abs=0.02)
