"""Write the report of a mesh fit: report.json, report.md, and pictures of the error on the face."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from surface.base.arrays import Floats, Floats32
from surface.base.error_colours import error_colours
from surface.base.errors import MissingPackage, ViewError
from surface.base.progress import Progress
from surface.fit.measures.report_folder import report_folder
from surface.fit.points.nurbsnet import UniformNet, uniform_nets
from surface.fit.points.report import NEUTRAL, DenseErrors, Errors, FitReport, FitResult, FittedPart, face_bounds, plain
from surface.fit.source.chart import FIRST_TILE
from surface.head import Head

FORMAT, VERSION = "omote fit report", 1
EXCLUDED = np.array([0.45, 0.05, 0.50])
LEGEND = "blue 0, green 0.25, yellow 0.5, orange 0.75, red 1 mm and more; violet: inside folds, not counted"


def write_report(result: FitResult, folder: str | Path, progress: Progress) -> None:
    """Write the report of a fit, completely or not at all. Raises FitError: the folder cannot be written to."""
    nets = _nets(result)
    progress("report", 0.5)
    with report_folder(Path(folder)) as new:
        pictures = _draw(result, new)
        (new / "report.json").write_text(json.dumps(as_table(result.report, nets), indent=1), encoding="utf-8")
        (new / "report.md").write_text(as_markdown(result.report, nets, pictures), encoding="utf-8")
    progress("report", 1.0)


def _nets(result: FitResult) -> list[UniformNet]:
    """The control net of the face's first and largest tile, and uniform nets to compare it with."""
    face = result.parts[0]
    own = face.chart.uv[:, 0] < FIRST_TILE
    counted = own & ~face.chart.folded
    rms = float(np.sqrt((face.fitted.error[counted] ** 2).mean()))
    points = int((face.fitted.net.centres[:, 0] < FIRST_TILE).sum())
    return [UniformNet(points, rms), *uniform_nets(face.chart, face.targets, points, rms)]


def as_table(report: FitReport, nets: list[UniformNet]) -> dict[str, Any]:
    """The report as plain values; None for what could not be measured."""
    table: dict[str, Any] = plain(_as_table(report, nets))
    return table


def _as_table(report: FitReport, nets: list[UniformNet]) -> dict[str, Any]:
    return {
        "format": FORMAT, "version": VERSION, "head": report.name, "scale": report.scale,
        "control_points": report.points, "parameters": report.parameters,
        "missing": list(report.missing), "left_out": list(report.left_out), "notes": list(report.notes),
        "faults": list(report.faults),
        "shapes": report.shapes, "filled": report.filled,
        "localised": asdict(report.localised) if report.localised else None,
        "empty": list(report.empty), "presets": list(report.presets), "pieces": report.pieces,
        "parts": [
            {
                "name": p.name, "control_points": p.points, "samples": p.samples, "excluded_samples": p.folded,
                "neutral_mm": asdict(p.neutral), "mean_shape_rms_mm": p.mean_shape_rms,
                "detailed_mm": asdict(p.detailed) if p.detailed else None, "detailed_share": p.share,
                "shapes_mm": {n: asdict(e) for n, e in p.shapes.items()},
            }
            for p in report.parts
        ],
        "distances": asdict(replace(report.dense, sticking={}, turned={})) if report.dense else None,
        "nurbs": {
            "control_points": nets[0].points, "rms_mm": nets[0].rms, "uniform_nets": [asdict(n) for n in nets[1:]],
        },
    }  # fmt: skip


def as_markdown(report: FitReport, nets: list[UniformNet], pictures: list[str]) -> str:
    """The report as Markdown: notes, and tables of errors."""
    lines = [f"# {report.name}: {report.points} control points, {len(report.parameters)} shapes", ""]
    lines += [f"- {note}" for note in [face_bounds(report), *report.notes]]
    lines += [f"- no shape for: {', '.join(report.missing)}"] if report.missing else []
    lines += [f"- left out, not ARKit's: {', '.join(report.left_out)}"] if report.left_out else []
    lines += _distance_lines(report.dense) if report.dense else []
    lines += ["", "Distances between mesh and surface at the same (u, v), mm.", ""]
    lines += [
        "| part | control points | samples | excluded | RMS | 99 % | max | mean RMS of shapes |",
        "|---|---|---|---|---|---|---|---|",
        *(
            f"| {p.name} | {p.points} | {p.samples} | {p.folded} | {_figures(p.neutral)} | {p.mean_shape_rms:.3f} |"
            for p in report.parts
        ),
    ]
    lines += ["", *(f"![error]({name})" for name in pictures)]
    lines += [LEGEND] if pictures else ["The error was not drawn, because OpenGL is not available."]
    lines += ["", "## A uniform cubic NURBS net beside the face", "", *_net_lines(nets)]
    lines += _source_lines(report)
    for p in report.parts:
        if p.shapes:
            lines += ["", f"## Shapes of {p.name}", "", "| shape | RMS | 99 % | max |", "|---|---|---|---|"]
            lines += [f"| {n} | {_figures(e)} |" for n, e in p.shapes.items()]
    return "\n".join(lines) + "\n"


def _source_lines(report: FitReport) -> list[str]:
    """Tables of the mesh's pieces, and of the mesh's shapes that each parameter was made from."""
    lines = []
    if report.pieces:
        lines += ["", "## Pieces of the mesh", "", "| piece | kind |", "|---|---|"]
        lines += [f"| {_cell(name)} | {kind} |" for name, kind in report.pieces.items()]
    if report.shapes:
        lines += ["", "## Shapes of the mesh", "", "| parameter | made from |", "|---|---|"]
        lines += [f"| {p} | {_cell(', '.join(names))} |" for p, names in report.shapes.items()]
    for title, names in (("empty", report.empty), ("presets, made from parameters", report.presets)):
        lines += ["", f"{title}: {', '.join(names)}"] if names else []
    return lines


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def _distance_lines(dense: DenseErrors) -> list[str]:
    """Distances of the posed head from the mesh and back: for every part the neutral face, and the worst shape."""
    lines = ["", f"True distances of {dense.samples} samples in every shape, the head posed as it is drawn, mm.", ""]
    lines += [f"- {line}" for line in dense.lines()]
    lines += [
        "", "| part | way | RMS | 99 % | max | greatest of all shapes | in folds |", "|---|---|---|---|---|---|---|"
    ]  # fmt: skip
    for name, by_shape in dense.parts.items():
        folds = max((b.folds.max for b in by_shape.values() if b.folds.measured), default=None)
        for way, words in (("to_mesh", "surface to mesh"), ("to_surface", "mesh to surface")):
            far = {s: e.max for s, b in by_shape.items() if (e := getattr(b, way)).measured}
            shape = max(far, key=lambda s: far[s], default=NEUTRAL)
            most = f"{far[shape]:.3f} {shape}" if far else "-"
            neutral = _figures(getattr(by_shape[NEUTRAL], way))
            lines.append(f"| {name} | {words} | {neutral} | {most} | {'-' if folds is None else f'{folds:.3f}'} |")
    return lines


def _figures(errors: Errors) -> str:
    return " | ".join(errors.figures())


def _net_lines(nets: list[UniformNet]) -> list[str]:
    own, uniform = nets[0], nets[1:]
    reached = [n for n in uniform if n.rms <= own.rms]
    most = uniform[-1]
    verdict = (
        f"As good a uniform net needs {reached[0].points / own.points:.1f} times the points."
        if reached
        else f"With {most.points / own.points:.1f} times the points it is still not as good."
    )
    return [
        "| net | control points | RMS |", "|---|---|---|", f"| this head's | {own.points} | {own.rms:.3f} |",
        *(f"| uniform | {n.points} | {n.rms:.3f} |" for n in uniform), "", verdict,
    ]  # fmt: skip


def _draw(result: FitResult, folder: Path) -> list[str]:
    """Draw the error at rest, and at every sample that of its worst shape; returns no file names without OpenGL."""
    head = Head(result.head)
    for part in head.parts:
        kept = {k: v for k, v in part.attributes.items() if k == "eye_local"}
        part.attributes = {"albedo": np.full((len(part.vertices), 3), 0.35, np.float32), **kept}
    errors = {
        "error_neutral.png": [p.fitted.error for p in result.parts],
        "error_shapes.png": [p.fitted.shape_error.max(axis=0, initial=0.0) for p in result.parts],
    }
    for name, values in errors.items():
        for fitted, error in zip(result.parts, values, strict=True):
            part = head.part(fitted.name)
            part.attributes["albedo"] = _colours(part.uv.astype(float), fitted, error)
        try:
            _picture(head, folder / name)
        except (ViewError, MissingPackage):
            return []
    return list(errors)


def _colours(uv: Floats, part: FittedPart, error: Floats) -> Floats32:
    """(m, 3) linear RGB of the error at vertices, the mean over the nearest samples; violet where it is excluded."""
    nearest = cKDTree(part.chart.uv).query(uv, k=min(4, len(part.chart.uv)))[1].reshape(len(uv), -1)
    out = error_colours(error[nearest].mean(axis=1))
    out[part.chart.folded[nearest].mean(axis=1) > 0.5] = EXCLUDED
    return out.astype(np.float32)


def _picture(head: Head, path: Path) -> None:
    """Front, three-quarter, profile, and from below into the nostrils."""
    from surface.view.pictures.offscreen import Offscreen  # slow to import, and most fits draw nothing
    from surface.view.pictures.sheet import compose, write_png
    from surface.view.scene.camera import Camera
    from surface.view.scene.framing import framed

    views = {
        "front": Camera.front(), "three-quarter": Camera.three_quarter(), "profile": Camera.profile(),
        "from below": Camera.front().orbit(0.0, -55.0),
    }  # fmt: skip
    rest = head.values({})
    with Offscreen(head, (420, 480), quality="fast") as screen:
        pictures = [screen.render(rest, framed(camera, head)) for camera in views.values()]
    write_png(compose(pictures, list(views), columns=4), path)
