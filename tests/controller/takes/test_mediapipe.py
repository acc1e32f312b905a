"""Results of MediaPipe's face landmarker as takes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from controller.base.errors import TakeError
from controller.base.parameters import PARAMETERS as P
from controller.takes.reader import load_take, reader_of
from tests.controller.formats.kinds.test_json_format import landmarks


def results(key: str = "time", scale: float = 1.0) -> list[dict[str, object]]:
    faces = [landmarks(p14=(0, -down, 0)) for down in (0.0, 1.0, 2.0)]
    return [{key: scale * n / 10, "faceLandmarks": [face]} for n, face in enumerate(faces)]


@pytest.mark.parametrize("text", [
    json.dumps(results()), json.dumps({"frames": results("timestampMs", 1000.0)}),
    "\n".join(map(json.dumps, results("timestamp", 1000.0))), json.dumps({"fps": 10, "frames": results("number")}),
])  # fmt: skip
def test_landmarks_open_the_jaw_over_time(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.json").write_text(text)
    assert reader_of(tmp_path / "a.json").kind == "mediapipe"
    take = load_take(tmp_path / "a.json", P)
    assert take.times_s.tolist() == pytest.approx([0.0, 0.1, 0.2])
    jaw = take.values[:, P.index("jawOpen")]
    assert jaw[0] < 0.05 < jaw[1] < jaw[2] and take.mask[P.index("headYaw")]


def test_shapes_of_the_task_for_browsers(tmp_path: Path) -> None:
    rows = [{"faceBlendshapes": [{"categories": [{"categoryName": "jawOpen", "score": n / 4}]}]} for n in range(3)]
    (tmp_path / "a.jsonl").write_text("\n".join(map(json.dumps, [*rows, {"faceBlendshapes": []}])))
    take = load_take(tmp_path / "a.jsonl", P)
    assert take.values[:, P.index("jawOpen")].tolist() == [0.0, 0.25, 0.5] and take.mask.sum() == 1
    assert take.times_s.tolist() == pytest.approx([0.0, 1 / 30, 2 / 30])


@pytest.mark.parametrize(("text", "why"), [
    ('{"faceLandmarks": []}', "no result has a face"), ('{"faceLandmarks": [[1]]}', "not a face of 468"),
    ('{"faceLandmarks": [', "JSON"), (json.dumps(results("time", -1.0)), "are not ascending"),
])  # fmt: skip
def test_what_is_wrong_is_one_message(tmp_path: Path, text: str, why: str) -> None:
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(TakeError, match=why):
        load_take(tmp_path / "a.json", P)
