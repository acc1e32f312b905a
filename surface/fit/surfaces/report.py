"""The report on a head made from surfaces: its parts, how exact each is, what was left out and what is missing."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from surface.base.errors import FitError

FORMAT, VERSION = "omote surface report", 1


@dataclass(frozen=True)
class SurfaceRow:
    """One part: its name in the head and in the file, its material, what it follows, how many control points it has.

    deviation_mm : greatest distance from the file's surface where it is fitted; 0 where it is exact everywhere.
    """

    name: str
    title: str
    material: str
    follows: str
    points: int
    deviation_mm: float = 0.0


@dataclass(frozen=True)
class SurfaceReport:
    """The report on the head. parameters : shapes that move it. missing : shapes that do not. notes : messages."""

    name: str
    parts: list[SurfaceRow]
    parameters: list[str]
    missing: list[str]
    notes: list[str]

    @property
    def points(self) -> int:
        """Control points of all parts."""
        return sum(row.points for row in self.parts)

    def lines(self) -> list[str]:
        """The report in words, without the table of parts."""
        fitted = [row for row in self.parts if row.deviation_mm > 0]
        exact = "every control point is the file's own: the surfaces are exact"
        lines = [exact] if not fitted else []
        lines += [f"{row.name}: exact, except near star points: {row.deviation_mm:.3f} mm or less" for row in fitted]
        lines += self.notes
        if self.parameters and self.missing:
            lines.append(f"no group for {', '.join(self.missing)}: these parameters will not move this head")
        if not self.parameters:
            lines.append("no groups: this head turns, but has no expressions (--groups FILE or --expressions-from ict)")
        return lines


def write_report(report: SurfaceReport, folder: str | Path) -> None:
    """Write report.json and report.md. Raises FitError: the folder cannot be written to."""
    folder = Path(folder)
    table = {"format": FORMAT, "version": VERSION, **asdict(report)}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "report.json").write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")
        (folder / "report.md").write_text("\n".join(_markdown(report)) + "\n", encoding="utf-8")
    except OSError as error:
        why = f"{folder}: the report cannot be written ({error})"
        raise FitError(why, hint="choose another --report folder") from error


def _markdown(report: SurfaceReport) -> Sequence[str]:
    rows = [
        f"| {r.name} | {r.title} | {r.material} | {r.follows} | {r.points} | {r.deviation_mm:.3f} |".replace("\n", " ")
        for r in report.parts
    ]
    return [
        f"# {report.name}: {report.points} control points, {len(report.parameters)} shapes", "",
        *(f"- {line}" for line in report.lines()), "",
        "| part | in the file | material | follows | control points | greatest deviation, mm |",
        "|---|---|---|---|---|---|", *rows,
    ]  # fmt: skip
