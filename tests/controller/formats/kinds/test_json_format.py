"""JSON messages as programs write them, and wrong ones."""

from __future__ import annotations

import json

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.formats.frame import Frame
from controller.formats.kinds.json_format import JsonDecoder, JsonEncoder
from tests.controller.formats.faces import face


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
    assert given(frame) == {"cheekPuff": 1.0}


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
        (b'{"jawOpen": "1"}', "values that are no numbers"),
        (b'{"jawOpen": true}', "values that are no numbers"),
        (b'{"jawOpen": NaN}', "values that are no numbers"),
        (b'{"jawOpen": 1e999}', "values that are no numbers"),
        (b'{"jawOpen": [0.5]}', "values that are no numbers"),
        (b'{"jawOpen": 1' + b"0" * 400 + b"}", "values that are no numbers"),
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
