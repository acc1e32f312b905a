"""Write the report of a transfer: report.json, report.md, and two pictures, which need no OpenGL."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from surface.base.arrays import Floats
from surface.base.errors import MissingPackage
from surface.fit.measures.report_folder import report_folder
from surface.fit.points.report import Errors, face_bounds, plain
from surface.fit.transfer.align import Similarity
from surface.fit.transfer.reports.distances import distances_from, sample_head
from surface.fit.transfer.reports.picture import Frontal, draw_distances, draw_landmarks, frontal
from surface.fit.transfer.reports.report import TransferReport
from surface.fit.transfer.scan import Scan
from surface.head import Head, HeadData

FORMAT, VERSION = "omote transfer report", 1
PICTURES = ("landmarks.png", "error.png")
LEGEND = "blue 0, green 0.25, yellow 0.5, orange 0.75, red 1 mm and more from the head; grey: more than 20 mm"


def write_transfer_report(
    report: TransferReport, scan: Scan, head: HeadData, found: Similarity, folder: str | Path
) -> None:  # fmt: skip
    """Write the report of a transfer, completely or not at all.

    scan : in its file's coordinates. found : maps these to the frame of the head that the expressions come from.

    Raises FitError: the folder cannot be written to.
    """
    with report_folder(Path(folder)) as new:
        pictures = _draw(report, scan, head, found, new)
        (new / "report.json").write_text(json.dumps(as_table(report), indent=1), encoding="utf-8")
        (new / "report.md").write_text(as_markdown(report, pictures), encoding="utf-8")


def as_table(report: TransferReport) -> dict[str, Any]:
    """The report as plain values; None for what could not be measured."""
    table: dict[str, Any] = plain(_as_table(report))
    return table


def _as_table(report: TransferReport) -> dict[str, Any]:
    return {
        "format": FORMAT, "version": VERSION, "head": report.fit.name, "expressions_from": report.source,
        "control_points": report.fit.points, "parameters": report.fit.parameters, "notes": report.fit.notes,
        "scan_to_head_mm": {p.name: {"samples": p.samples, **asdict(p.neutral)} for p in report.fit.parts},
        "registration_mm": asdict(report.registration), "registration_matched": report.matched,
        "landmarks": {m.name: {k: v for k, v in asdict(m).items() if k != "name"} for m in report.landmarks},
        "openings": report.openings,
        "reseated": {name: {"least": low, "most": high} for name, (low, high) in report.reseated.items()},
        "gaps_mm": [asdict(gap) for gap in report.gaps],
    }  # fmt: skip


def as_markdown(report: TransferReport, pictures: list[str]) -> str:
    """The report as Markdown."""
    fit = report.fit
    counts = f"{fit.points} control points, {len(fit.parameters)} shapes"
    title = f"# {fit.name}: the expressions of {report.source}, {counts}"
    lines = [title, "", *(f"- {note}" for note in [face_bounds(fit), *fit.notes]), ""]
    lines += ["## Errors, mm", "", "| from, to | RMS | 99 % | max |", "|---|---|---|---|"]
    map_ = report.registration
    lines += [f"| scan, head: {p.samples} samples of {p.name} | {_row(p.neutral)} |" for p in fit.parts]
    lines.append(
        f"| the map alone, scan: {100 * report.matched:.0f} % of the front, where it has a match | {_row(map_)} |"
    )
    lines += ["", *(f"![{name}]({name})" for name in pictures), *([LEGEND] if pictures else [])]
    lines += ["", "## Landmarks", "", "| landmark | how | confidence | place in the scan | off the head's, mm |"]
    lines += ["|---|---|---|---|---|"]
    for m in report.landmarks:
        place = ", ".join(f"{x:.5g}" for x in m.place)
        lines.append(f"| {m.name} | {m.how} | {m.sure:.2f} | {place} | {m.off_mm:.1f} |")
    lines += ["", "## Openings", "", *(f"- {name}: {what}" for name, what in report.openings.items())]
    lines += ["", "## Shapes that were lengthened or shortened to lie on the eyeballs and to close", ""]
    lines += [f"- {name}: {low:.2f} to {high:.2f} times" for name, (low, high) in report.reseated.items()] or ["none"]
    lines += ["", "## Gaps where lips and lids should be closed", "", *(f"- {gap}" for gap in report.gaps)]
    return "\n".join(lines) + "\n"


def _row(errors: Errors) -> str:
    return " | ".join(errors.figures())


def _draw(report: TransferReport, scan: Scan, head: HeadData, found: Similarity, folder: Path) -> list[str]:
    """Draw the landmarks and the scan's distance from the head; returns no file names without Pillow."""
    places = np.array([m.place for m in report.landmarks])
    view = view_of(found, places)
    try:
        draw_landmarks(scan, view, {m.name: (np.array(m.place), m.how) for m in report.landmarks}, folder / PICTURES[0])
        draw_distances(scan, view, _distances(scan, head), folder / PICTURES[1])
    except MissingPackage:
        return []
    return list(PICTURES)


def view_of(found: Similarity, places: Floats) -> Frontal:
    """The front view of the face about landmarks (k, 3) in a scan's own coordinates, from chin to forehead."""
    at = found.points(places)
    low, high = at.min(axis=0), at.max(axis=0)
    tall = high - low
    return frontal(found, low - 0.25 * tall, high + 0.45 * tall)


def _distances(scan: Scan, data: HeadData) -> Floats:
    """(t,) mm from the middle of each triangle of a scan to the nearest place of a head's skin or eyeballs."""
    middle = scan.vertices[scan.triangles].mean(axis=1)
    at = middle if data.placement is None else data.placement.points(middle)
    return distances_from(sample_head(Head(data)), at).mm
