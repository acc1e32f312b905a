"""Action units of OpenFace and py-feat as takes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import TakeError
from controller.base.parameters import PARAMETERS as P
from controller.formats.format import FORMATS
from controller.formats.frame import Frame
from controller.takes.reader import load_take, reader_of
from controller.vocabulary.facs import Facs

HEAD = "frame, face_id, timestamp, confidence, success, gaze_angle_x, gaze_angle_y, pose_Rx, pose_Ry, pose_Rz"
UNITS = "AU01_r, AU12_r, AU26_r, AU45_r, AU12_c, AU28_c"


def openface(path: Path, *rows: str) -> Path:
    path.write_text("\n".join([f"{HEAD}, {UNITS}", *rows]) + "\n")
    return path


def at(take: object, name: str) -> list[float]:
    return [round(float(v), 4) for v in take.values[:, P.index(name)]]  # type: ignore[attr-defined]


def test_openface_intensities_presences_angles_and_times(tmp_path: Path) -> None:
    path = openface(
        tmp_path / "a.csv",
        "1, 0, 0.5, 0.98, 1, 0.1, 0.2, 0.0, 0.0, 0.0, 0, 5, 2.5, 0, 1, 0",
        "2, 0, 0.533, 0.98, 1, 0.3, 0.0, 0.1, -0.2, 0.3, 2.5, 0, 0, 5.6, 0, 1",
    )
    take = load_take(path, P)
    assert reader_of(path).kind == "openface" and reader_of(path).layer == "capture"
    np.testing.assert_allclose(take.times_s, [0.0, 0.033])
    assert at(take, "mouthSmileRight") == [1.0, 0.0] and at(take, "browInnerUp") == [0.0, 0.5]
    assert at(take, "jawOpen") == [0.25, 0.0] and at(take, "eyeBlinkLeft") == [0.0, 1.0]
    assert at(take, "mouthRollLower") == [0.0, 0.6]
    degrees = np.degrees([0.2, 0.1, -0.3])  # to the own left, down, own left side up, against 60, 40 and 30
    assert [at(take, n)[1] for n in ("headYaw", "headPitch", "headRoll")] == [
        round(float(d / full), 4) for d, full in zip(degrees, (60, 40, 30), strict=True)
    ]
    assert at(take, "leftEyeYaw") == [round(float(np.degrees(0.1) / 35), 4)] * 2  # the eye in the head
    assert take.mask[P.index("eyeLookUpLeft")] and not take.mask[P.index("tongueOut")]


def test_rows_without_a_face_are_left_out_and_one_face_is_followed(tmp_path: Path) -> None:
    row = "{n}, {face}, {t}, {sure}, {ok}, 0, 0, 0, 0, 0, {v}, 0, 0, 0, 0, 0"
    rows = [row.format(n=1, face=0, t=0.0, sure=0, ok=0, v=0)]
    rows += [row.format(n=n, face=1, t=n / 30, sure=0.9, ok=1, v=5) for n in (2, 3, 5)]
    rows += [
        row.format(n=3, face=0, t=0.1, sure=0.9, ok=1, v=0),
        row.format(n=4, face=1, t=4 / 30, sure=0.2, ok=1, v=1),
    ]
    take = load_take(openface(tmp_path / "a.csv", *rows), P)
    np.testing.assert_allclose(take.times_s, [0.0, 1 / 30, 0.1])
    assert at(take, "browInnerUp") == [1.0] * 3


def test_a_stream_of_the_format_au_csv_that_was_saved_is_a_take(tmp_path: Path) -> None:
    encoder, facs = FORMATS.get("au-csv").encoder(P), Facs.load(P)
    mask, lines = np.ones(len(P), dtype=bool), []
    for n in range(130):
        lines += encoder.encode(Frame(facs.expand("L12:0.6+26:0.4"), mask, n / 30))
    (tmp_path / "a.csv").write_bytes(b"\n".join(lines))
    take = load_take(tmp_path / "a.csv", P)
    assert reader_of(tmp_path / "a.csv").kind == "openface" and take.frames == 130
    assert take.duration_s == pytest.approx(129 / 30, abs=1e-5)
    assert at(take, "mouthSmileLeft")[5] > 0.4 and at(take, "mouthSmileRight")[5] < 0.05
    np.testing.assert_allclose(take.values[7], facs.expand("L12:0.6+26:0.4"), atol=0.1)


def test_pyfeat_rows_of_faces_and_its_clock(tmp_path: Path) -> None:
    lines = ["input,frame,FaceRectX,FaceScore,Pitch,Roll,Yaw,AU01,AU12,AU43,happiness,approx_time,Identity"]
    for frame in range(0, 101, 2):
        clock = f"00:{frame // 25:02}"
        lines.append(f"v.mp4,{frame},1,0.9,0,0,0,0.5,{frame / 100},1.2,0.1,{clock},Person_0")
        if frame < 4:
            lines.append(f"v.mp4,{frame},1,0.9,0,0,0,0,0,0,0,{clock},Person_1")
    lines.append("v.mp4,102,,,,,,,,,,00:04,Person_0")
    path = tmp_path / "feat.csv"
    path.write_text("\n".join(lines))
    take = load_take(path, P)
    assert reader_of(path).kind == "pyfeat" and take.frames == 51
    assert take.duration_s == pytest.approx(4.0, abs=0.1)  # 25 frames a second, as the clock says
    assert at(take, "mouthSmileLeft")[:3] == [0.0, 0.02, 0.04] and at(take, "eyeBlinkRight")[0] == 1.0


def test_pyfeat_without_a_clock_has_30_frames_a_second(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("frame,FaceScore,AU01\n0,1,0\n30,1,1\n")
    assert load_take(tmp_path / "a.csv", P).duration_s == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (f"{HEAD}, {UNITS}\n" + "1, 0, 0, 0, 0" + ", 0" * 11, "no face was found in any row"),
        ("frame, confidence, AU01_r\n1, 0.9, 1", "no column timestamp"),
        ("timestamp, confidence, AU01_r\n0, 0.9, x", "line 2, column AU01_r: ' x' is not a finite number"),
        ("timestamp, confidence, AU01_r\n0, 0.9, nan", "is not a finite number"),
        ("timestamp, confidence, AU01_r\n0, 0.9", "2 cells where the header has 3"),
        ("timestamp, confidence, AU99_r\n0, 0.9, 1", "none of its action units is known"),
        ("frame,FaceScore,AU01\n0,,\n", "no face was found in any row"),
        ("frame,FaceScore,AU01\nx,1,1\n", "line 2, column frame"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, text: str, why: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(TakeError, match=why) as caught:
        load_take(tmp_path / "a.csv", P)
    assert caught.value.hint and "a.csv" in str(caught.value)


def test_levels_above_the_scale_count_as_full_and_units_together_stay_within_the_parameter(tmp_path: Path) -> None:
    columns = "timestamp, confidence, AU26_r, AU27_r"
    (tmp_path / "a.csv").write_text(f"{columns}\n0, 0.9, 5, 0\n1, 0.9, 7.5, 0\n2, 0.9, -1, 0\n3, 0.9, 5, 5\n")
    full, above, below, both = at(load_take(tmp_path / "a.csv", P), "jawOpen")
    assert 0.0 < full == above < both == 1.0 and below == 0.0
    (tmp_path / "b.csv").write_text("frame,FaceScore,AU01,AU26,AU27\n0,1,0,1,0\n1,1,0,1.5,0\n2,1,0,-0.2,0\n3,1,0,1,1\n")
    assert at(load_take(tmp_path / "b.csv", P), "jawOpen") == [full, above, below, both]
