"""JSON messages as programs write them, and wrong ones."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.formats.frame import Frame
from controller.formats.kinds.json_format import JsonDecoder, JsonEncoder
from tests.controller.formats.faces import face
from tests.controller.formats.test_landmarks import points


def given(frame: Frame) -> dict[str, float]:
    return {name: float(frame.values[i]) for i, name in enumerate(P.names) if frame.mask[i]}


@pytest.mark.parametrize(
    "text",
    ['{"type": "set", "parameters": {"jawOpen": 0.5}}', '{"jawOpen": 0.5}', ' {"JawOpen": 5e-1}\r',
     '{"type": "state", "parameters": {"jaw_open": 0.5}, "more": [1]}', '{"jawOpen": 0.1, "jawOpen": 0.5}',
     '[{"categoryName": "_neutral", "score": 0.9}, {"categoryName": "jawOpen", "score": 0.5}]',
     '{"blendshapes": [{"category_name": "jawOpen", "score": 0.5, "index": 25}]}'],
)  # fmt: skip
def test_one_meaning_has_several_spellings(text: str) -> None:
    (frame,) = JsonDecoder(P).feed(text.encode())
    assert given(frame) == {"jawOpen": 0.5}


def test_what_is_not_named_stays_and_null_releases() -> None:
    decoder = JsonDecoder(P)
    decoder.feed(b'{"jawOpen": 0.5}')
    (frame,) = decoder.feed(b'{"cheekPuff": 1, "time": 2.5, "subject": "Ann"}')
    assert given(frame) == {"jawOpen": 0.5, "cheekPuff": 1.0}
    assert (frame.time_s, frame.subject) == (2.5, "Ann")
    (frame,) = decoder.feed(b'{"jawOpen": null}')
    assert given(frame) == {"cheekPuff": 1.0} and frame.face
    (frame,) = decoder.feed(b'{"cheekPuff": null}')
    assert not frame.face


def test_what_is_not_given_any_more_is_written_as_null() -> None:
    encoder, decoder, sent = JsonEncoder(P), JsonDecoder(P), face(3)
    mask = np.zeros(len(P), dtype=bool)
    mask[4] = True
    assert b"null" not in encoder.encode(replace(sent, mask=mask))[0]
    for part in (sent.mask, mask):
        (frame,) = (found for each in encoder.encode(replace(sent, mask=part)) for found in decoder.feed(each))
        np.testing.assert_array_equal(frame.mask, part)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (b"", "not JSON"),
        (b"{", "not JSON"),
        (b"\xff\xfe", "not JSON"),
        (b"[" * 60_000, "not JSON"),
        (b"1" * 6000, "not JSON"),
        (b"5", "no object that sets parameters"),
        (b'"jawOpen"', "no object that sets parameters"),
        (b'{"type": "stop"}', "no object that sets parameters"),
        (b'{"jawOpn": 1}', "unknown names"),
        (b'{"type": "set", "parameters": {"jawOpn": 1}}', "unknown names"),
        (b'{"jawOpen": "1"}', "values that are not numbers"),
        (b'{"jawOpen": true}', "values that are not numbers"),
        (b'{"jawOpen": NaN}', "values that are not numbers"),
        (b'{"jawOpen": 1e999}', "values that are not numbers"),
        (b'{"jawOpen": [0.5]}', "values that are not numbers"),
        (b'{"jawOpen": 1' + b"0" * 400 + b"}", "values that are not numbers"),
    ],
)
def test_what_is_wrong_is_refused_with_a_reason(text: bytes, why: str) -> None:
    decoder = JsonDecoder(P)
    assert decoder.feed(text) == [] and decoder.refused == {why: 1}


@pytest.mark.parametrize(
    "text", [b'{"parameters": 5}', b'{"parameters": [1]}', b'{"blendshapes": [1, null]}', b"[]", b"{}"]
)
def test_what_gives_nothing_gives_no_frame(text: bytes) -> None:
    assert JsonDecoder(P).feed(text) == []


def test_a_good_value_beside_a_wrong_one_is_taken() -> None:
    (frame,) = JsonDecoder(P).feed(b'{"jawOpen": "x", "cheekPuff": 0.25}')
    assert given(frame) == {"cheekPuff": 0.25}


def test_a_message_is_json_of_one_line_that_others_read() -> None:
    sent = face(2, 1.5)
    (data,) = JsonEncoder(P).encode(sent)
    table = json.loads(data)
    assert b"\n" not in data and table["type"] == "set" and table["time"] == 1.5
    np.testing.assert_allclose([table["parameters"][name] for name in P.names], sent.values, atol=1e-6)


def test_nobody_is_seen() -> None:
    (data,) = JsonEncoder(P).encode(Frame(P.neutral(), np.zeros(len(P), dtype=bool), face=False))
    (frame,) = JsonDecoder(P).feed(data)
    assert not frame.face


def landmarks(**moved: tuple[float, float, float]) -> list[dict[str, float]]:
    """Landmarks as MediaPipe gives them for a picture of 640 by 480."""
    image = points(**moved) * (1.0, -1.0, -1.0) / 40.0 * (1.0, 4 / 3, 1.0) + (0.5, 0.5, 0.0)
    return [dict(zip("xyz", row, strict=True)) for row in image.tolist()]


def test_results_of_mediapipe_nested_as_its_tasks_give_them() -> None:
    shapes = [{"categories": [{"index": 25, "categoryName": "jawOpen", "score": 0.5, "displayName": ""}],
               "headIndex": -1, "headName": ""}]  # fmt: skip
    (frame,) = JsonDecoder(P).feed(json.dumps({"faceBlendshapes": shapes, "faceLandmarks": [landmarks()]}).encode())
    assert {*given(frame)} == {"jawOpen", "headYaw", "headPitch", "headRoll"} and given(frame)["jawOpen"] == 0.5
    (frame,) = JsonDecoder(P).feed(json.dumps({"faceBlendshapes": shapes}).encode())
    assert given(frame) == {"jawOpen": 0.5}


@pytest.mark.parametrize("wrap", [
    lambda face: face, lambda face: [face], lambda face: [[*row.values()] for row in face],
    lambda face: {"landmarks": face}, lambda face: {"faceLandmarks": [face], "width": 640, "height": 480},
    lambda face: {"multi_face_landmarks": [{"landmark": face[:468]}]},
])  # fmt: skip
def test_landmarks_alone_make_a_face(wrap: Callable[[list[dict[str, float]]], object]) -> None:
    (frame,) = JsonDecoder(P).feed(json.dumps(wrap(landmarks(p14=(0, -2.0, 0)))).encode())
    found = given(frame)
    assert 0.4 < found["jawOpen"] < 0.7 and found["eyeBlinkLeft"] < 0.1 and abs(found["headYaw"]) < 0.02


def test_a_result_without_a_face_says_so() -> None:
    (frame,) = JsonDecoder(P).feed(b'{"faceLandmarks": [], "faceBlendshapes": []}')
    assert not frame.face


@pytest.mark.parametrize("wrong", [{"landmarks": [{"x": 0.5, "y": 0.5, "z": 0}] * 467}, {"landmarks": [[0, 0]] * 468},
                                   {"landmarks": [[0, 0, None]] * 478}, {"landmarks": [[1, 1, 1]] * 468}])  # fmt: skip
def test_what_is_no_face_of_landmarks_is_counted(wrong: object) -> None:
    decoder = JsonDecoder(P)
    assert decoder.feed(json.dumps(wrong).encode()) == []
    assert decoder.refused == {"landmarks that are not a face of 468 or 478 points": 1}
