"""Tables of comma-separated values: delimiters, decimal commas, gaps, and faults with their line and column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import TakeError
from controller.takes.csvtable import CsvTable, header_of, read_csv


def read(tmp_path: Path, text: str | bytes) -> CsvTable:
    path = tmp_path / "t.csv"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_csv(path, "a table")


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_cells_are_parted_by_what_the_header_has_most_of(tmp_path: Path, delimiter: str) -> None:
    lines = ["time, s; jaw".replace(";", delimiter * 2), "0.5;a;1".replace(";", delimiter)]
    if delimiter == ",":
        lines[0] = "time,,jaw"
    table = read(tmp_path, f"\ufeff{lines[0]}\r\n\r\n{lines[1]}\r\n")
    assert table.header == ["time" if delimiter == "," else "time, s", "", "jaw"]
    assert table.rows == [(3, ["0.5", "a", "1"])] and table.texts(1) == ["a"]
    np.testing.assert_array_equal(table.numbers([2, 0]), [[1.0, 0.5]])
    assert not table.decimal_comma or delimiter != ","


def test_beside_semicolons_a_comma_is_decimal_and_beside_commas_it_is_none(tmp_path: Path) -> None:
    table = read(tmp_path, "a;b\n1,5;-0,25\n")
    assert table.decimal_comma
    np.testing.assert_array_equal(table.numbers([0, 1]), [[1.5, -0.25]])
    assert not read(tmp_path, "a;b\n1.5;2\n").decimal_comma
    assert not read(tmp_path, 'a,b\n"1,5",2\n').decimal_comma
    with pytest.raises(TakeError, match=r"line 2, column a: '1,5' is not a finite number"):
        read(tmp_path, 'a,b\n"1,5",2\n').numbers([0])


@pytest.mark.parametrize("text", ["nan", "inf", "", "x"])
def test_what_is_no_number_is_a_fault_or_a_gap(tmp_path: Path, text: str) -> None:
    table = read(tmp_path, f"a,b\n1,2\n\n3,{text}\n")
    np.testing.assert_array_equal(table.numbers([0, 1], gaps=True), [[1, 2], [3, np.nan]])
    np.testing.assert_array_equal(table.numbers([0]), [[1], [3]])
    with pytest.raises(TakeError, match=rf"t\.csv, line 4, column b: '{text}' is not a finite number") as caught:
        table.numbers([0, 1])
    assert caught.value.hint == "correct or remove that line"
    assert table.numbers([]).shape == (2, 0)


@pytest.mark.parametrize(
    ("text", "why", "hint"),
    [
        ("", "the file is empty", "a table"),
        ("\n , \n", "the file is empty", "a table"),
        ("a,b\n", "a header but no rows", "export it again"),
        ("a,b\n1,2\n\n3\n", "line 4: 1 cells where the header has 2", "cut off"),
        ("a,b\n1,2,3\n", "line 2: 3 cells where the header has 2", "cut off"),
        (b"a,b\n\xff\xfe,1\n", "UTF-8", "a table"),
        ("a,b\n1," + "x" * 200_000 + "\n", "not a CSV file", "a table"),
    ],
)
def test_what_is_no_table_is_named(tmp_path: Path, text: str | bytes, why: str, hint: str) -> None:
    with pytest.raises(TakeError, match=why) as caught:
        read(tmp_path, text)
    assert "t.csv" in str(caught.value) and hint in str(caught.value.hint)


def test_the_header_of_the_first_bytes() -> None:
    assert header_of(b'\xef\xbb\xbf\r\n"Time" ;Jaw Open; x\r\n1,2,3,4,5\n') == ["time", "jaw open", "x"]
    assert header_of(b"a,b") == ["a", "b"]
    assert header_of("é".encode("latin-1") + b"\tb\n") == ["�", "b"]
