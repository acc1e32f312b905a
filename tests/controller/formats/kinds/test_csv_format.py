"""Numbers between commas as tables have them, and wrong ones; written by the standard library's csv."""

from __future__ import annotations

import csv
import io

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.formats.kinds.csv_format import CsvDecoder, CsvEncoder
from tests.controller.formats.faces import face


def feed(decoder: CsvDecoder, *lines: str) -> list[dict[str, float]]:
    frames = [frame for line in lines for frame in decoder.feed(line.encode())]
    return [{name: float(f.values[i]) for i, name in enumerate(P.names) if f.mask[i]} for f in frames]


def test_columns_are_known_by_their_names_in_any_order() -> None:
    decoder = CsvDecoder(P)
    found = feed(decoder, "jawOpen, time ,mouthSmile_L\r", "0.5,1.25,0.1", "0.6, 1.5,")
    assert found == [{"jawOpen": 0.5, "mouthSmileLeft": 0.1}, {"jawOpen": 0.6}]
    (frame,) = decoder.feed(b"0,2.5,0")
    assert frame.time_s == 2.5


def test_a_datagram_may_hold_names_and_numbers() -> None:
    assert feed(CsvDecoder(P), "jawOpen,time\r\n0.5,1\r\n0.75,2\r\n") == [{"jawOpen": 0.5}, {"jawOpen": 0.75}]


def test_the_standard_library_writes_what_is_read_and_reads_what_is_written() -> None:
    text = io.StringIO()
    table = csv.writer(text)
    table.writerow(["time", "headYaw", "other", "jawOpen"])
    table.writerow([0.5, -0.25, 99, 1])
    assert feed(CsvDecoder(P), *text.getvalue().splitlines()) == [{"headYaw": -0.25, "jawOpen": 1.0}]
    encoder, sent = CsvEncoder(P), [face(seed, seed / 60) for seed in range(3)]
    lines = [line.decode() for frame in sent for line in encoder.encode(frame)]
    for row, frame in zip(csv.DictReader(lines), sent, strict=True):
        np.testing.assert_allclose([float(row[name]) for name in P.names], frame.values, atol=1e-5)


@pytest.mark.parametrize(
    ("lines", "why"),
    [
        (["0.5,0.1"], "numbers before their names"),
        (["jawOpen,time", "1,2,3"], "a line with another number of cells"),
        (["jawOpen,time", "1"], "a line with another number of cells"),
        (["foo,bar"], "neither names nor numbers"),
        ([""], "neither names nor numbers"),
        (["jawOpen,time", "x,1"], "cells that are not numbers"),
        (["jawOpen,time", "nan,1"], "cells that are not numbers"),
        (["jawOpen,cheekPuff", "jawOpn,x"], "neither names nor numbers"),
        (["jawOpen,cheekPuff", "jawOpen,chxekPuff"], "unknown names"),
    ],
)
def test_what_is_wrong_is_refused_with_a_reason(lines: list[str], why: str) -> None:
    decoder = CsvDecoder(P)
    assert [found for found in feed(decoder, *lines) if found] == [] and decoder.refused == {why: 1}


def test_a_damaged_line_of_names_leaves_those_before_it() -> None:
    lines = ["time,jawOpen,cheekPuff", "0,0.1,0.2", "time,jaxOpen,cheekPuff", "1,0.3,0.4", "time,ja", "2,0.5,0.6"]
    frames = feed(CsvDecoder(P), *lines)
    assert [face for face in frames if face] == [
        {"jawOpen": 0.1, "cheekPuff": 0.2}, {"jawOpen": 0.3, "cheekPuff": 0.4}, {"jawOpen": 0.5, "cheekPuff": 0.6},
    ]  # fmt: skip


def test_other_names_count_once_numbers_fit_them_alone_or_they_come_twice() -> None:
    before = ["time,jawOpen", "0,0.1"]
    assert feed(CsvDecoder(P), *before, "time,mine,cheekPuff", "1,7,0.4")[-1] == {"cheekPuff": 0.4}
    assert feed(CsvDecoder(P), *before, "mine,cheekPuff", "7,0.4")[-1] == {"jawOpen": 0.4}
    assert feed(CsvDecoder(P), *before, "mine,cheekPuff", "7,0.4", "mine,cheekPuff", "7,0.5")[-1] == {"cheekPuff": 0.5}


def test_names_come_again_for_those_who_begin_late() -> None:
    encoder = CsvEncoder(P)
    lines = [line for n in range(250) for line in encoder.encode(face(n))]
    late = CsvDecoder(P)
    assert len(feed(late, *(line.decode() for line in lines[60:]))) > 100
