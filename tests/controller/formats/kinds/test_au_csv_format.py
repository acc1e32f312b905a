"""Action units as numbers between commas."""

from __future__ import annotations

import csv
import io

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.formats.format import FORMATS
from controller.formats.frame import Frame
from controller.vocabulary.facs import Facs

FORM = FORMATS.get("au-csv")
JAW = P.index("jawOpen")


def shown(*lines: str) -> list[Frame]:
    decoder = FORM.decoder(P)
    return [frame for line in lines for frame in decoder.feed(line.encode())]


def test_columns_of_openface_are_read_and_others_left_out() -> None:
    (frame,) = shown("frame, face_id, timestamp, confidence, AU12_r, AU26_r, AU12_c", "1, 0, 0.033, 0.98, 2.5, 5.0, 1")
    wanted = Facs.load(P).expand("AU12", 0.5) + Facs.load(P).expand("AU26", 1.0)
    np.testing.assert_allclose(frame.values, np.minimum(wanted, 1.0), atol=1e-9)
    assert frame.time_s == 0.033


def test_a_row_without_success_says_that_no_face_is_seen() -> None:
    names = "frame, timestamp, confidence, success, AU12_r"
    seen = [frame.face for frame in shown(f"{names}\n1, 0, 0.98, 1, 2", "2, 0.03, 0, 0, 0", "3, 0.07, 0.9, 1, 1")]
    assert seen == [True, False, True]


@pytest.mark.parametrize("name", ["AU12", "au12", "AU12_r", "AU012"])
def test_units_in_other_spellings(name: str) -> None:
    (frame,) = shown(f"time,{name}", "0,5")
    assert frame.values[P.index("mouthSmileLeft")] > 0.5 and frame.values[P.index("mouthSmileRight")] > 0.5
    (frame,) = shown("time,AUL12_r", "0,5")
    assert frame.values[P.index("mouthSmileLeft")] > 0.5 and frame.values[P.index("mouthSmileRight")] == 0.0


@pytest.mark.parametrize("lines", [["1,2,3"], ["a,b", "1,2"], ["AU1,AU2", "1"], ["AU1", "nan"], ["AU1", "1e99"]])
def test_what_is_wrong_gives_no_frame(lines: list[str]) -> None:
    decoder = FORM.decoder(P)
    assert [frame for line in lines for frame in decoder.feed(line.encode())] == []
    assert sum(decoder.refused.values()) >= 1


def test_what_is_written_is_a_table_that_other_programs_read() -> None:
    encoder, values = FORM.encoder(P), Facs.load(P).expand("AU12+26", 0.6)
    mask = np.ones(len(P), dtype=bool)
    messages = [m for n in range(3) for m in encoder.encode(Frame(values, mask, n / 30))]
    rows = list(csv.DictReader(io.StringIO("\n".join(m.decode() for m in messages))))
    assert len(rows) == 3 and float(rows[2]["timestamp"]) == pytest.approx(2 / 30, abs=1e-6)
    assert float(rows[0]["AUL12_r"]) == pytest.approx(3.0, abs=0.3)
    (back,) = shown(*(m.decode() for m in messages[:2]))
    np.testing.assert_allclose(back.values, values, atol=0.1)
