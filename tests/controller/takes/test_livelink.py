"""Takes of Live Link Face."""

from __future__ import annotations

import math
from dataclasses import FrozenInstanceError
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import TakeError
from controller.base.parameters import PARAMETERS as P
from controller.layers.commands import CommandState
from controller.takes.livelink import Take, TakePlayer

JAW = P.index("jawOpen")


def write(path: Path, header: str, *rows: str) -> Path:
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


@pytest.fixture(scope="module")
def take(shared: Path) -> Take:
    return Take.load(shared / "data" / "livelink" / "alex_rom_3.csv", P)


def test_what_was_read_cannot_be_changed(tmp_path: Path) -> None:
    one = Take.load(write(tmp_path / "a.csv", "Timecode,BlendshapeCount,JawOpen", "0:0:0:0,61,0.1"), P)
    for array in (one.times_s, one.values, one.mask):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_a_real_take(take: Take) -> None:
    assert take.frames == 4030
    assert take.rate_hz == pytest.approx(30.0, abs=1e-6)
    assert take.duration_s == pytest.approx(134.3818, abs=1e-3)
    assert take.gaps == 3
    assert take.mask.sum() == 56 and not take.mask[P.region("head")].any()  # head angles were not recorded
    eyes = P.indices(["leftEyeYaw", "leftEyePitch", "rightEyeYaw", "rightEyePitch"])
    assert not take.values[:, eyes].any()
    assert take.values.max() > 1.0  # the reader does not clamp ...


def test_a_real_take_samples_in_range_from_end_to_end(take: Take) -> None:
    out = P.neutral()
    for t in np.linspace(-1.0, take.duration_s + 1.0, 3000):
        take.sample(t, out)
        assert np.all(out >= P.low) and np.all(out <= P.high)  # ... the point of use does
    np.testing.assert_array_equal(take.sample(1e9, out), np.clip(take.values[-1], P.low, P.high))


def test_sampling_at_a_row_gives_the_row_and_between_the_mean(take: Take) -> None:
    out, row = P.neutral(), 100
    t = take.times_s
    np.testing.assert_allclose(take.sample(t[row], out), np.clip(take.values[row], P.low, P.high), atol=1e-12)
    middle = np.clip((take.values[row] + take.values[row + 1]) / 2, P.low, P.high)
    np.testing.assert_allclose(take.sample((t[row] + t[row + 1]) / 2, out), middle, atol=1e-9)


def test_jaw_and_mouth_sides_are_swapped_unless_asked_otherwise(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", "Timecode,BlendshapeCount,JawLeft,JawRight,MouthLeft", "0:0:0:0,61,0.1,0.2,0.3")
    out = P.neutral()
    indices = P.indices(["jawLeft", "jawRight", "mouthLeft", "mouthRight"])
    assert list(Take.load(path, P).sample(0, out)[indices]) == [0.2, 0.1, 0.0, 0.3]
    assert list(Take.load(path, P, swap_jaw_mouth_lr=False).sample(0, out)[indices]) == [0.1, 0.2, 0.3, 0.0]


def test_time_comes_from_the_timecode_over_gaps_and_midnight(tmp_path: Path) -> None:
    rows = ["23:59:59:58.500,1,0.0", "23:59:59:59.500,1,0.1", "00:00:00:00.500,1,0.2", "00:00:00:05.500,1,0.7"]
    take = Take.load(write(tmp_path / "a.csv", "TIMECODE,BLENDSHAPECOUNT,JAWOPEN", *rows), P)
    np.testing.assert_allclose(take.times_s * 60, [0, 1, 2, 7], atol=1e-6)
    assert take.rate_hz == pytest.approx(60) and take.gaps == 1
    assert take.sample(4.5 / 60, P.neutral())[JAW] == pytest.approx(0.45)
    assert take.mask.sum() == 1


def test_any_columns_in_any_order(tmp_path: Path) -> None:
    take = Take.load(write(tmp_path / "a.csv", "jawOpen,Joy, Timecode ,LeftEyeRoll", "0.5,0.9,1:2:3:4.5,0.1"), P)
    assert take.sample(0, P.neutral())[JAW] == 0.5
    assert (take.frames, take.duration_s, take.rate_hz) == (1, 0.0, 0.0)


HEADER = "Timecode,BlendShapeCount,EyeLookOutLeft,HeadYaw,LeftEyeYaw,LeftEyePitch"


def test_head_angles_are_radians_to_the_subjects_right(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", HEADER, f"0:0:0:0,61,0.5,{math.radians(30)},-0.3,0.1")
    take = Take.load(path, P)
    assert take.values[0, P.index("headYaw")] == pytest.approx(-0.5)
    assert take.values[0, P.index("leftEyeYaw")] == 0.0 and take.mask[P.index("leftEyeYaw")]


def test_eye_angles_on_request_replace_the_look_columns(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", HEADER, "0:0:0:0,61,0.5,0,-0.3,0.1")
    take = Take.load(path, P, use_eye_angles=True)
    assert take.values[0, P.index("leftEyeYaw")] == pytest.approx(0.3 / math.radians(35))
    assert take.values[0, P.index("eyeLookOutLeft")] == 0.0 and take.mask[P.index("eyeLookOutLeft")]


def test_eye_angles_only_where_no_look_column_carries_anything(tmp_path: Path) -> None:
    take = Take.load(write(tmp_path / "a.csv", HEADER, "0:0:0:0,61,0,0,-0.3,0.1"), P)
    assert take.values[0, P.index("leftEyeYaw")] == pytest.approx(0.3 / math.radians(35))
    assert take.values[0, P.index("leftEyePitch")] == pytest.approx(0.1 / math.radians(30))
    assert not take.mask[P.index("headYaw")]  # all zero: no data
    take = Take.load(write(tmp_path / "b.csv", HEADER, "0:0:0:0,61,0.5,0,-0.3,0.1"), P)
    eyes = P.indices(["leftEyeYaw", "leftEyePitch", "rightEyeYaw", "rightEyePitch"])
    assert not take.values[:, eyes].any() and take.mask[eyes].all()
    assert take.values[0, P.index("eyeLookOutLeft")] == 0.5


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("Time,JawOpen\n0,1\n", "line 1: no column Timecode"),
        ("Timecode,JawOpen\n", "a header but no rows"),
        ("Timecode,JawOpen\n0:0:0:0,0.1\n0:0:0:1\n", "line 3: 1 cells where the header has 2"),
        ("Timecode,JawOpen\n0:0:0:0,0.1\n\n0:0:0:1,oops\n", "line 4, column JawOpen: 'oops' is not a finite number"),
        ("Timecode,JawOpen\n0:0:0:0,nan\n", "line 2, column JawOpen: 'nan'"),
        ("Timecode,JawOpen\n0:0:0,0.1\n", "line 2, column Timecode: '0:0:0' is not HH:MM:SS:FF.fff"),
        ("Timecode,JawOpen\n0:0:1:0,0.1\n0:0:0:0,0.1\n", "line 3, column Timecode: goes back in time"),
        ("Timecode,JawOpen\n0:0:0:0,\xff\n", "not UTF-8 (line 2), but probably Latin-1"),
    ],
)
def test_a_broken_take_names_file_line_and_column(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "broken.csv"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(TakeError) as caught:
        Take.load(path, P)
    assert message in str(caught.value) and str(path) in str(caught.value) and caught.value.hint


def test_a_missing_take(tmp_path: Path) -> None:
    with pytest.raises(TakeError, match="cannot be read"):
        Take.load(tmp_path / "none.csv", P)


def test_playing_follows_the_take_and_releases_the_face_at_the_end(tmp_path: Path) -> None:
    rows = [f"0:0:{i // 30}:{2 * (i % 30)}.0,61,{0.5 - 0.5 * math.cos(i / 15)}" for i in range(90)]
    take = Take.load(write(tmp_path / "a.csv", "Timecode,BlendShapeCount,JawOpen", *rows), P)
    state, out, now = CommandState(P), P.neutral(), 5 * 10**9
    player = TakePlayer(take, state)
    worst, wanted = 0.0, P.neutral()
    while not player.finished:
        player.tick(now)
        state.tick(now, 0.01, out)
        if player.position_s > 0.5:
            delayed = take.sample(player.position_s - 0.03, wanted)[JAW]
            worst = max(worst, abs(out[JAW] - delayed))
        now += 10_000_000
    assert player.position_s == pytest.approx(take.duration_s, abs=0.011)
    assert worst < 0.05  # the motion limits cost about 30 ms, not the shape
    for _ in range(300):
        now += 10_000_000
        player.tick(now)
        state.tick(now, 0.01, out)
    assert out[JAW] == pytest.approx(0.0, abs=1e-3)


def test_a_record_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        object.__new__(Take).anything = 1


def test_a_take_is_finished_at_its_last_row(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", "Timecode,JawOpen", "00:00:00:00.000,0", "00:00:01:00.000,1")
    player = TakePlayer(Take.load(path, P), CommandState(P))
    player.tick(5_000_000_000)
    player.tick(5_999_999_999)
    assert not player.finished
    player.tick(6_000_000_000)
    assert player.finished and player.position_s == player.take.duration_s == 1.0
