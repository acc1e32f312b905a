"""From a surface file to a head of its own control points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from surface.base.arrays import Floats
from surface.base.progress import Progress, no_progress, part_of
from surface.fit.features.findings import findings
from surface.fit.measures.saving import save_head
from surface.fit.source.load import LoadOptions
from surface.fit.source.placing.anatomy import Eyes, Landmarks
from surface.fit.surfaces.build import make_part, with_mesh
from surface.fit.surfaces.expressions import with_expressions
from surface.fit.surfaces.eyes import Eyeballs, find_eyeballs
from surface.fit.surfaces.facing import seen
from surface.fit.surfaces.groupfile import Context, add_group_files
from surface.fit.surfaces.pieces import Piece, joined, make_pieces, read_pieces, with_face
from surface.fit.surfaces.placing import Placed, place
from surface.fit.surfaces.report import SurfaceReport, SurfaceRow, write_report
from surface.fit.transfer.api import transfer
from surface.fit.transfer.reports.landmarkfile import read_landmarks
from surface.fit.transfer.scan import make_scan
from surface.head import Head
from surface.head.model.data import HeadData, Jaw, Seam
from surface.head.model.file import check_writable
from surface.head.model.parameters import SHAPES
from surface.readers import NamedSurface

MADE = "surfaces of {}, by omote fit: the file's own control points"


@dataclass(frozen=True)
class SurfaceOptions:
    """How to make a head of surfaces; what is not given is guessed.

    unit, up, forward : as for meshes, see :func:`surface.fit.source.placing.frame.find_frame`.
    without, only : surfaces to leave out, or to take alone, by name; a part of the name will do.
    strict : refuse a file of which anything cannot be read, instead of leaving it out by name.
    groups : files of groups, see :mod:`surface.fit.surfaces.groupfile`.
    expressions_from : folder of a head whose expressions the surfaces get; landmarks : a file for that, see
        :func:`surface.fit.transfer.reports.landmarkfile.read_landmarks`.
    """

    unit: str | None = None
    up: str | None = None
    forward: str | None = None
    without: tuple[str, ...] = ()
    only: tuple[str, ...] = ()
    strict: bool = False
    groups: tuple[Path, ...] = ()
    expressions_from: Path | None = None
    landmarks: Path | None = None


def fit_surfaces(
    path: str | Path, out_dir: str | Path, *, name: str, options: SurfaceOptions = SurfaceOptions(),
    progress: Progress = no_progress, report_dir: str | Path | None = None,
) -> SurfaceReport:  # fmt: skip
    """Make a head of a surface file and write it.

    path : .3dm, .tsm, .xml or .json, see :func:`surface.readers.read_surface`.
    out_dir : folder that gets head.toml and head.npz. report_dir : folder that gets report.json and report.md.
    progress : called with what is being done and the fraction of it, 0..1.

    Raises SurfaceFileError: the file cannot be read. FitError: an option or a file of groups or landmarks does not fit
    it, or no face was found for ``expressions_from``. HeadFileError: a folder cannot be written to. Nothing is written
    then.
    """
    for folder in (out_dir, report_dir):
        check_writable(folder or out_dir)
    pieces, notes = read_pieces(path, options.without, options.only, strict=options.strict)
    head, report = _make(pieces, name, options, progress, str(path), notes)
    if report_dir is not None:
        write_report(report, report_dir)
    save_head(out_dir, head)
    return report


def head_of(
    surfaces: Sequence[NamedSurface], *, name: str, options: SurfaceOptions = SurfaceOptions(),
    progress: Progress = no_progress,
) -> HeadData:  # fmt: skip
    """A head of surfaces in memory; their names, but for the face's, become those of its parts.

    ``without``, ``only`` and ``strict`` of the options are about files and are not used.

    Raises FitError: as :func:`fit_surfaces`, or there are no surfaces.
    """
    return _make(make_pieces(surfaces, name), name, options, progress, name, [])[0]


def _make(
    pieces: list[Piece], name: str, options: SurfaceOptions, progress: Progress, where: str, notes: list[str]
) -> tuple[HeadData, SurfaceReport]:  # fmt: skip
    progress("placing", 0.0)
    placed, other = _placed(pieces, options, name, part_of(progress, 0.0, 0.8), where)
    head, order = _bare_head(pieces, placed, name, Path(where).name)
    titles = {part.name: piece.title for part, piece in zip(head.parts, order, strict=True)}
    progress("groups", 0.8)
    if other is not None:
        head = with_expressions(head, order, other)
    ties = {part.name: p.ties for part, p in zip(head.parts, order, strict=True) if p.ties is not None}
    parts = add_group_files(head.parts, options.groups, Context(placed.placement, titles, ties))
    progress("triangles", 0.9)
    head = replace(head, parts=[with_mesh(part, head) for part in parts])
    notes = [*notes, *placed.notes, *findings(head, placed.marks)]
    deviations = [placed.placement.scale * piece.deviation for piece in order]
    return head, _report(head, titles, deviations, notes)


def _placed(
    pieces: list[Piece], options: SurfaceOptions, name: str, progress: Progress, where: str
) -> tuple[Placed, HeadData | None]:  # fmt: skip
    """Where the surfaces stand; and the head whose expressions they get, in their form."""
    points, triangles = joined(pieces)
    if options.expressions_from is None:
        return place(points, triangles, options.unit, options.up, options.forward), None
    scan = make_scan(points, triangles, where)
    picked = read_landmarks(options.landmarks, scan) if options.landmarks is not None else {}
    load = LoadOptions(unit=options.unit, up=options.up, forward=options.forward)
    made = transfer(scan, Head.load(options.expressions_from), name, picked, load, progress, where)
    placement = made.head.placement
    assert placement is not None  # a transfer finds one
    eyes = Eyes(made.head.eyes, True, True, "the head that expressions come from")
    return Placed(placement, Landmarks(eyes), made.head.neck, tuple(made.report.fit.notes)), made.head


def _bare_head(pieces: list[Piece], placed: Placed, name: str, where: str) -> tuple[HeadData, list[Piece]]:
    """The head without groups, and the pieces that its parts are made of."""
    points = [placed.placement.points(piece.mesh.vertices) for piece in pieces]
    eyes = find_eyeballs(pieces, points)
    front, flips = seen([(at, piece.mesh.triangles) for at, piece in zip(points, pieces, strict=True)])
    face = _face_of(pieces, front, eyes)
    order = [face, *(k for k in range(len(pieces)) if k != face)]
    size = float(np.ptp(np.concatenate(points), axis=0).max())
    parts = [
        make_part(piece, placed.placement, size, _follows(k, eyes), flip=bool(flips[k]))
        for piece, k in zip(with_face(pieces, face), order, strict=True)
    ]
    seams = [
        Seam(part.name, part.name, *pair) for part, k in zip(parts, order, strict=True) for pair in pieces[k].seams
    ]
    centres, radius = (eyes.centres, eyes.radius) if eyes else (np.zeros((2, 3)), 0.0)
    still = Jaw((0.0, 0.0, 0.0), 0.0, (0.0, 0.0, 0.0))
    head = HeadData(
        name, {"made": MADE.format(where)}, placed.neck, centres, radius, still, parts, seams, [],
        placement=placed.placement,
    )  # fmt: skip
    return head, [pieces[k] for k in order]


def _face_of(pieces: list[Piece], front: Floats, eyes: Eyeballs | None) -> int:
    """Number of the piece that is the face: of the skin, the one most of which is seen from the front."""
    own = {k for side in eyes.pieces for k in side} if eyes else set()
    rank = [(k not in own, piece.material == "skin", front[k]) for k, piece in enumerate(pieces)]
    return max(range(len(pieces)), key=lambda k: rank[k])


def _follows(number: int, eyes: Eyeballs | None) -> str:
    for side, own in zip(("left_eye", "right_eye"), eyes.pieces if eyes else (), strict=False):
        if number in own:
            return side
    return "skin"


def _report(head: HeadData, titles: dict[str, str], deviations: list[float], notes: list[str]) -> SurfaceReport:
    rows = [
        SurfaceRow(p.name, titles[p.name], p.material, p.follows, len(p.points), off)
        for p, off in zip(head.parts, deviations, strict=True)
    ]
    moved = {g.name for p in head.parts for g in p.groups}
    shapes = [n for n in SHAPES if n in moved]
    return SurfaceReport(head.name, rows, shapes, [n for n in SHAPES if n not in moved], notes)
