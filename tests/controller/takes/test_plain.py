"""Plain tables of parameters, read and written."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ControllerError, TakeError
from controller.base.parameters import PARAMETERS as P
from controller.formats.format import FORMATS
from controller.takes.plain import write_plain
from controller.takes.reader import load_take, reader_of
from tests.controller.formats.faces import face


def read(path: Path, text: str) -> dict[str, list[float]]:
    path.write_text(text, encoding="utf-8")
    take = load_take(path, P)
    found = {P.names[i]: [round(float(v), 5) for v in take.values[:, i]] for i in np.flatnonzero(take.mask)}
    return {"time": [round(float(t), 5) for t in take.times_s], **found}


def test_spellings_sides_degrees_and_units_of_time(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    assert read(path, "time,jawOpen,eyeBlink_L\n1,0.5,0\n1.5,1.1,1\n") == {
        "time": [0.0, 0.5], "jawOpen": [0.5, 1.1], "eyeBlinkLeft": [0.0, 1.0]
    }  # fmt: skip
    assert read(path, "Time (ms);MouthSmile;headYaw_deg\n0;0,5;-30\n40;1;60\n") == {
        "time": [0.0, 0.04], "headYaw": [-0.5, 1.0], "mouthSmileLeft": [0.5, 1.0], "mouthSmileRight": [0.5, 1.0]
    }  # fmt: skip
    assert read(path, "\ufefft\tJawOpen\tnotes\n0\t1\tx\n")["jawOpen"] == [1.0]
    assert reader_of(path).kind == "plain" and reader_of(path).layer == "capture"


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    random, path = np.random.default_rng(0), tmp_path / "a.csv"
    times = np.sort(random.uniform(0, 9, 40)).round(5)
    times -= times[0]
    values = random.uniform(P.low, P.high, (40, len(P))).round(6)
    mask = random.random(len(P)) < 0.5
    write_plain(path, times, values, mask, P)
    take = load_take(path, P)
    np.testing.assert_allclose(take.times_s, times, atol=1e-6)
    np.testing.assert_array_equal(take.mask, mask)
    np.testing.assert_allclose(take.values[:, mask], values[:, mask], atol=1e-6)
    assert list(tmp_path.iterdir()) == [path]
    with pytest.raises(ControllerError, match=r"a\.csv/b\.csv: cannot be written"):
        write_plain(path / "b.csv", times, values, mask, P)


def test_a_stream_of_the_format_csv_that_was_saved_is_a_take(tmp_path: Path) -> None:
    """Its names come again, and what is not given is empty."""
    encoder, sent = FORMATS.get("csv").encoder(P), [face(seed, seed / 60) for seed in range(130)]
    given = np.arange(len(P)) % 3 > 0
    text = b"\n".join(each for frame in sent for each in encoder.encode(replace(frame, mask=given)))
    (tmp_path / "a.csv").write_bytes(text)
    take = load_take(tmp_path / "a.csv", P)
    np.testing.assert_array_equal(take.mask, given)
    np.testing.assert_allclose(take.times_s, np.arange(130) / 60, atol=1e-6)
    np.testing.assert_allclose(take.values[:, given], [frame.values[given] for frame in sent], atol=1e-5)


def test_an_empty_cell_leaves_a_value_as_it_was(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time,jawOpen,cheekPuff\n0,,\n1,0.5,\n2,,\n3,0.25,\n")
    take = load_take(tmp_path / "a.csv", P)
    assert take.values[:, P.index("jawOpen")].tolist() == [0.5, 0.5, 0.5, 0.25] and take.mask.sum() == 1


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("time,jawOpn\n0,1\n", "unknown column 'jawOpn', did you mean 'jawOpen'"),
        ("time,x,y\n0,1,2\n", "no column is a parameter"),
        ("jawOpen\n1\n", "no column time"),
        ("time,jawOpen,JawOpen\n0,1,1\n", "column JawOpen: occurs twice"),
        ("time,jawOpen\n0,1\n0,1\n", "line 3, column time: the time is not later"),
        ("time,jawOpen\n1,1\n0,1\n", "line 3, column time: the time is not later"),
        ("time,jawOpen\n0,\n", "no column is a parameter, or none has a value"),
        ("time,jawOpen\n,1\n", "column time: '' is not a finite number"),
        ("time,jawOpen\n0,inf\n", "is not a finite number"),
        ("time,jawOpen\n", "a header but no rows"),
        ("", "the file is empty"),
        ("time,jawOpen\n0,1,2\n", "3 cells where the header has 2"),
        ('time,"jawOpen\n0,1\n', "a header but no rows"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, text: str, why: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(TakeError, match=why) as caught:
        load_take(tmp_path / "a.csv", P)
    assert caught.value.hint
