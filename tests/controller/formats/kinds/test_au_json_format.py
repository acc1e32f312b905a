"""Action units as openFACS sends and reads them."""

from __future__ import annotations

import json

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.formats.frame import Frame
from controller.formats.kinds.au_json_format import UNITS, AuJsonDecoder, AuJsonEncoder, unit_columns
from controller.vocabulary.facs import Facs

SENT = (
    '{"AU1":0,"AU2":0,"AU4":0,"AU5":0,"AU6":0,"AU7":5,"AU9":0,"AU10":0,"AU12":0,"AU14":3,"AU15":0,"AU17":0,"AU20":0,'
    '"AU23":0,"AU25":0,"AU26":5,"AU28":0,"AU45":0,"Speed":0.05}'
)
"""As its Python program sends it."""


def read(decoder: AuJsonDecoder, text: str) -> dict[str, float]:
    (frame,) = decoder.feed(text.encode())
    return {name: round(float(frame.values[i]), 4) for i, name in enumerate(P.names) if frame.values[i]}


@pytest.mark.parametrize("text", [SENT, SENT.replace('"', "'")])
def test_what_openfacs_sends_moves_the_face(text: str) -> None:
    found = read(AuJsonDecoder(P), text)
    assert found == {
        "eyeSquintLeft": 1.0, "eyeSquintRight": 1.0, "mouthDimpleLeft": 0.6, "mouthDimpleRight": 0.6, "jawOpen": 0.5,
    }  # fmt: skip


def test_a_unit_that_is_not_named_stays_and_one_side_moves_alone() -> None:
    decoder = AuJsonDecoder(P)
    read(decoder, '{"AU26": 5}')
    assert read(decoder, '{"AUL12": 2.5}') == {"jawOpen": 0.5, "mouthSmileLeft": 0.5}
    assert read(decoder, '{"AU26": 0}') == {"mouthSmileLeft": 0.5}


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "no object of action units"),
        ("[1]", "no object of action units"),
        ("{'AU1': 5", "no object of action units"),
        ("[" * 5000, "no object of action units"),
        ('{"AU99": 1}', "unknown units"),
        ('{"AU1+2": 1}', "unknown units"),
        ('{"": 1}', "unknown units"),
        ('{"AU1": "5"}', "invalid intensities"),
        ('{"AU1": -1}', "invalid intensities"),
        ('{"AU1": NaN}', "invalid intensities"),
        ('{"AU1": true}', "invalid intensities"),
    ],
)
def test_what_is_wrong_is_refused_with_a_reason(text: str, why: str) -> None:
    decoder = AuJsonDecoder(P)
    assert decoder.feed(text.encode()) == [] and decoder.refused == {why: 1}


def test_intensities_above_five_are_five() -> None:
    assert read(AuJsonDecoder(P), '{"AU1": 50}') == {"browInnerUp": 1.0}


def test_a_face_is_sent_as_the_units_it_was_made_of() -> None:
    (frame,) = AuJsonDecoder(P).feed(b'{"AU1": 4, "AU12": 3, "AU6": 2, "AU45": 5}')
    (data,) = AuJsonEncoder(P).encode(frame)
    table = json.loads(data)
    assert [*table] == [*(f"AU{unit}" for unit in UNITS), "Speed"]
    assert {name: value for name, value in table.items() if value and name != "Speed"} == {
        "AU1": 4, "AU12": 3, "AU6": 2, "AU45": 5,
    }  # fmt: skip
    assert all(isinstance(table[f"AU{unit}"], int) and 0 <= table[f"AU{unit}"] <= 5 for unit in UNITS)


def test_nothing_is_sent_without_a_face() -> None:
    assert AuJsonEncoder(P).encode(Frame(P.neutral(), np.zeros(len(P), dtype=bool), face=False)) == []


@pytest.mark.parametrize(
    ("name", "known"), [("AUL12", True), ("AU12:0.50000", True), ("AU12:0.500000", False), ("AU1+2", False)]
)
def test_a_name_has_twelve_letters_at_most(name: str, known: bool) -> None:
    assert (unit_columns(Facs.load(P), name) is not None) == known
