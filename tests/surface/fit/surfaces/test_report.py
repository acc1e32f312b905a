"""What a head made of surfaces is reported to be, in words and in files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from surface.base.errors import FitError
from surface.fit.surfaces.report import SurfaceReport, SurfaceRow, write_report

SKIN = SurfaceRow("face", "Face | front", "skin", "skin", 120)
STARS = SurfaceRow("back", "Back\nof the head", "skin", "skin", 30, 0.0125)


def report(*parts: SurfaceRow, parameters: tuple[str, ...] = (), missing: tuple[str, ...] = ()) -> SurfaceReport:
    return SurfaceReport("maple", list(parts), list(parameters), list(missing), ["a note"])


def test_exact_surfaces_are_said_to_be_and_others_where_they_are_not() -> None:
    assert report(SKIN, parameters=("jawOpen",)).lines() == [
        "every control point is the file's own: the surfaces are exact", "a note"
    ]  # fmt: skip
    lines = report(SKIN, STARS, parameters=("jawOpen",), missing=("a", "b")).lines()
    assert lines == [
        "back: exact, except near star points: 0.013 mm or less", "a note",
        "no group for a, b: these parameters will not move this head",
    ]  # fmt: skip


def test_a_head_without_groups_says_how_to_get_some() -> None:
    lines = report(SKIN, missing=("jawOpen",)).lines()
    assert (
        len(lines) == 3 and "--groups FILE or --expressions-from ict" in lines[-1] and "no group for" not in lines[-1]
    )


def test_the_files_hold_all_of_it(tmp_path: Path) -> None:
    found = report(SKIN, STARS, parameters=("jawOpen",))
    assert found.points == 150
    write_report(found, tmp_path / "a" / "b")
    table = json.loads((tmp_path / "a" / "b" / "report.json").read_text(encoding="utf-8"))
    assert (table["format"], table["version"], table["name"]) == ("omote surface report", 1, "maple")
    assert [SurfaceRow(**row) for row in table["parts"]] == [SKIN, STARS] and table["notes"] == ["a note"]
    lines = (tmp_path / "a" / "b" / "report.md").read_text(encoding="utf-8").splitlines()
    assert lines[0] == "# maple: 150 control points, 1 shapes"
    assert lines[2:4] == [f"- {line}" for line in found.lines()]
    assert lines[-2:] == [
        "| face | Face | front | skin | skin | 120 | 0.000 |", "| back | Back of the head | skin | skin | 30 | 0.013 |"
    ]  # fmt: skip


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(FitError, match="the report cannot be written") as caught:
        write_report(report(SKIN), tmp_path / "file")
    assert "--report" in str(caught.value.hint)
