"""What Azure's speech synthesis says of the mouth, as takes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from controller.base.errors import TakeError
from controller.base.parameters import PARAMETERS as P
from controller.takes.reader import load_take, reader_of

JAW, PRESS, SMILE = P.index("jawOpen"), P.index("mouthRollLower"), P.index("mouthSmileLeft")
MS = 10_000
SPOKEN = [(0, 0), (200, 21), (320, 2), (700, 0)]  # (ms, viseme): silence, p, a as in father, silence


def write(path: Path, found: Any) -> Path:
    path.write_text(found if isinstance(found, str) else json.dumps(found))
    return path


def frames(*jaws: float) -> list[list[float]]:
    rows = [[0.0] * 55 for _ in jaws]
    for row, jaw in zip(rows, jaws, strict=True):
        row[17], row[23] = jaw, 0.25
    return rows


@pytest.mark.parametrize(
    "form",
    [
        [{"audio_offset": t * MS, "viseme_id": v} for t, v in SPOKEN],
        [{"AudioOffset": t * MS, "VisemeId": v, "Animation": ""} for t, v in SPOKEN],
        {"visemes": [{"privAudioOffset": t * MS, "privVisemeId": v} for t, v in SPOKEN]},
        "\n".join(json.dumps({"audioOffset": t * MS, "visemeId": v}) for t, v in SPOKEN),
    ],
    ids=["python", "c#", "javascript", "lines"],
)
def test_visemes_by_number_in_the_spelling_of_every_language(tmp_path: Path, form: Any) -> None:
    path = write(tmp_path / "a.json", form)
    take = load_take(path, P)
    assert reader_of(path).layer == "speech" and take.duration_s == pytest.approx(0.88, abs=0.02)
    assert take.values[26, PRESS] > 0.3 > 0.1 > take.values[26, JAW] and take.values[50, JAW] > 0.45


def test_events_of_blend_shapes_behind_visemes_are_passed_over(tmp_path: Path) -> None:
    events: list[dict[str, Any]] = [{"audio_offset": t * MS, "viseme_id": v} for t, v in SPOKEN * 1]
    events += [{"audio_offset": 0, "viseme_id": 0, "animation": "<svg></svg>"}]
    assert load_take(write(tmp_path / "a.json", events), P).frames > 70


@pytest.mark.parametrize(
    "form",
    [
        {"FrameIndex": 0, "BlendShapes": frames(0.0, 0.5, 1.0, 0.5)},
        [{"FrameIndex": 2, "BlendShapes": frames(1.0, 0.5)}, {"FrameIndex": 0, "BlendShapes": frames(0.0, 0.5)}],
        [{"audio_offset": 0, "viseme_id": 0, "animation": json.dumps({"FrameIndex": at, "BlendShapes": rows})}
         for at, rows in ((0, frames(0.0, 0.5)), (2, frames(1.0, 0.5)))]
        + [{"audio_offset": 5, "viseme_id": 3, "animation": ""}],
    ],
    ids=["object", "list", "events"],
)  # fmt: skip
def test_blend_shapes_are_arkits_at_60_frames_a_second(tmp_path: Path, form: Any) -> None:
    take = load_take(write(tmp_path / "a.json", form), P)
    np.testing.assert_allclose(take.times_s, np.arange(4) / 60)
    assert take.values[:, JAW].tolist() == [0.0, 0.5, 1.0, 0.5] and take.values[:, SMILE].tolist() == [0.25] * 4
    assert set(np.flatnonzero(take.mask)) == {JAW, SMILE}


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('[{"viseme_id": 1}]', r"\[0\]: its offset must be a number of ticks"),
        ('[{"viseme_id": 22, "audio_offset": 0}]', "viseme 22: must be 0 to 21"),
        ('[{"viseme_id": "x", "audio_offset": 0}]', "viseme 'x'"),
        ('[{"viseme_id": [1], "audio_offset": 0}]', r"viseme \[1\]"),
        ('[{"viseme_id": true, "audio_offset": 0}]', "viseme True"),
        ('[{"viseme_id": 1, "audio_offset": 9}, {"viseme_id": 1, "audio_offset": 5}]', "ascending times"),
        ('[{"viseme_id": 1, "audio_offset": 0}, {"viseme_id": 2, "audio_offset": 90}]', "2 visemes within 0.009 ms"),
        ('[{"viseme_id": 1, "audio_offset": 1e300}]', "3600 s are read"),
        ('[{"viseme_id": 1, "audio_offset": 0}, 5]', r"\[1\]: must be an object"),
        ('{"FrameIndex": 0, "BlendShapes": 5}', "BlendShapes must be a list"),
        ('{"FrameIndex": -1, "BlendShapes": []}', "FrameIndex must be the number"),
        ('{"FrameIndex": 0, "BlendShapes": []}', "no frame of blend shapes"),
        ('{"FrameIndex": 0, "BlendShapes": [[1, 2]]}', "frame 0: must be a list of 55 numbers"),
        (json.dumps({"FrameIndex": 0, "BlendShapes": [["x"] * 55]}), "not a finite number"),
        ('{"FrameIndex": 0, "BlendShapes": ' + json.dumps([[float("nan")] * 55]) + "}", "not a finite number"),
        (json.dumps({"FrameIndex": 0, "BlendShapes": [[10**400] * 55]}), "not a finite number"),
        (json.dumps([{"viseme_id": 1, "audio_offset": 10**400}]), "offset must be a number"),
        (json.dumps([{"viseme_id": 1, "audio_offset": float("inf")}]), "offset must be a number"),
        ('{"viseme_id": 1, "animation": "{\\"BlendShapes\\": [", "FrameIndex": 0}', "not valid JSON"),
        ('{"viseme_id": 1, "audio_offset"', "not valid JSON"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, text: str, why: str) -> None:
    with pytest.raises(TakeError, match=why) as caught:
        load_take(write(tmp_path / "a.json", text), P)
    assert caught.value.hint
