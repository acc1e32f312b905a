"""``omote fit`` around the fitter: a progress bar before it, a table of errors after it."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from controller.tools.tables import show_table
from surface.base.errors import ViewError
from surface.fit.api import fit_head
from surface.fit.identities import add_identities
from surface.fit.points.report import FitReport, face_bounds
from surface.fit.source.load import LoadOptions
from surface.view.draw.decimate import decimate_head
from surface.view.pictures.occlusion import shade_head


def fit_with_progress(
    mesh: Path, out: Path, name: str, console: Console, options: LoadOptions, report_dir: Path | None = None
) -> None:
    """Fit a head to ``mesh`` and write it to the folder ``out``; shows progress, then the errors of every part.

    Parameters
    ----------
    options : how the mesh is to be understood. report_dir : folder for a report, if one is wanted.

    Raises
    ------
    FitError
        when the mesh cannot be turned into a head; nothing is written then.
    """
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("reading", total=1.0)

        def tell(part: str, done: float) -> None:
            doing = "writing the report" if part == "report" else f"fitting {part}"
            bar.update(task, description=doing, completed=done)

        report = fit_head(mesh, out, name=name, progress=tell, options=options, report_dir=report_dir)
    shaded = _shade(out, console)
    show_table(report_table(report), console)
    for line in remarks(report):
        console.print(line, soft_wrap=True, markup=False)
    if not shaded:
        console.print(
            "no OpenGL here: the head has no baked shade; fit it again where there is, for a better picture",
            soft_wrap=True,
        )
    console.print(f"wrote {out}", soft_wrap=True)


def add_with_progress(mesh: Path, head: Path, modes: Path, console: Console) -> None:
    """Add named variations to a head that was fitted to ``mesh``.

    Raises
    ------
    FitError
        when head, mesh and modes do not belong together; nothing is written then.
    """
    with console.status("fitting identities"):
        names = add_identities(head, mesh, modes)
    console.print(f"identities: {', '.join(names)}", soft_wrap=True)


def _shade(out: Path, console: Console) -> bool:
    """Bake how much light reaches each vertex of the head; False without OpenGL. Find its decimated triangles."""
    with console.status("finding fewer triangles for live pictures"):
        decimate_head(out)
    try:
        with console.status("baking shade"):
            shade_head(out)
    except ViewError:
        return False
    return True


def remarks(report: FitReport) -> list[str]:
    """How the face keeps its bounds, what was guessed and what is missing, a line each."""
    out = [face_bounds(report), *report.notes]
    if report.missing:
        out.append(f"no shape for {', '.join(report.missing)}: these parameters will not move this head")
    if report.left_out:
        out.append(f"left out, not ARKit's: {', '.join(report.left_out)}")
    return out


def report_table(report: FitReport) -> Table:
    """Control points and errors (mm) of every fitted part."""
    title = f"{report.name}: {report.points} control points, {len(report.parameters)} shapes"
    table = Table("part", "control points", "RMS", "99 %", "max", "mean RMS of shapes", title=title)
    for part in report.parts:
        neutral = part.neutral
        errors = [f"{value:.3f}" for value in (neutral.rms, neutral.p99, neutral.max, part.mean_shape_rms)]
        table.add_row(part.name, str(part.points), *errors)
    return table
