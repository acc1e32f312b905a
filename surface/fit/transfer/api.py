"""Make a head from a bare mesh and another head: the form of the mesh with the expressions of the head."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from surface.base.arrays import Floats
from surface.base.errors import FitError
from surface.base.progress import Progress, no_progress
from surface.check.overlaps import overlap_notes
from surface.fit.eyes.drawn_lids import seat_drawn_lids
from surface.fit.features.accessories import Kept, keep_accessories
from surface.fit.measures.refusal import save_or_refuse
from surface.fit.painting.scan import scan_texture
from surface.fit.points.report import FitReport
from surface.fit.source.load import LoadOptions
from surface.fit.source.placing.frame import AXES, EYES_MM, UNITS
from surface.fit.source.placing.place import HeadSize
from surface.fit.transfer.align import Similarity, align, from_pairs
from surface.fit.transfer.colours import with_colours
from surface.fit.transfer.detail.broken_neck import without_end
from surface.fit.transfer.detail.hidden import in_sight
from surface.fit.transfer.faults import HINT, faults_of_transfer
from surface.fit.transfer.lashes import rooted_lashes
from surface.fit.transfer.lids import close_lids
from surface.fit.transfer.lining import keep_lining_behind
from surface.fit.transfer.place_parts import scaled
from surface.fit.transfer.register import STAGES, Matcher, Registered, register
from surface.fit.transfer.reports.errors import face_errors, skin_errors
from surface.fit.transfer.reports.gaps import measure_gaps
from surface.fit.transfer.reports.landmarkfile import read_landmarks, swapped
from surface.fit.transfer.reports.report import (
    TransferReport,
    landmarks_of,
    openings_of,
    registration_errors,
    reseated,
)
from surface.fit.transfer.reports.reportfile import write_transfer_report
from surface.fit.transfer.scan import Samples, Scan, read_scan, sample
from surface.fit.transfer.symmetry import levelled, mirror_plane, symmetrised
from surface.fit.transfer.template import Template, make_template
from surface.fit.transfer.warp_head import warp_head
from surface.head import Head, HeadData
from surface.head.model.accessories import Accessory
from surface.head.model.data import with_greatest_error
from surface.head.model.file import check_writable
from surface.head.model.placement import Placement
from surface.head.model.texture import HeadTexture

NONE_SEEN: Mapping[str, Floats] = MappingProxyType({})
MANY = 250_000  # samples of the scan's head once it is found
MARGIN = 0.35  # around the head, in heights of the face: what lies within it belongs to the head
USUAL = (0.7, 1.45)  # range of people's sizes, relative to the head that the expressions come from
WRONG = 0.2  # greatest RMS distance of given landmarks from the head's own, in heights of the face
SWAPPED, MUCH = 0.04, 0.5  # left and right are exchanged if that distance is above the first, and exchanging them
# leaves less than the second share of it: a few landmarks that are right may fit better by chance
LEAST_PICKED = 4  # given landmarks that suffice to align a scan; with fewer its face is searched for


@dataclass(frozen=True)
class Transferred:
    """A head in the form of a scan, the report on it, and the transform ``found`` from the scan's coordinates to the
    frame in which the scan was registered.

    errors : by part, (m,) mm from each vertex of the skin at rest to the scan; NaN where the scan has nothing there.
    accessories : meshes that it wears as they are. texture : of its skin; None without one.
    """

    head: HeadData
    report: TransferReport
    found: Similarity
    errors: dict[str, Floats] = field(default_factory=dict)
    accessories: tuple[Accessory, ...] = ()
    texture: HeadTexture | None = None


def transfer_head(
    mesh_path: str | Path, source: str | Path, out_dir: str | Path, *, name: str, landmarks: Path | None = None,
    options: LoadOptions = LoadOptions(), progress: Progress | None = None, report_dir: str | Path | None = None,
    force: bool = False,
) -> TransferReport:  # fmt: skip
    """Give a bare mesh the expressions of a head, and write the new head.

    mesh_path : .obj, .glb, .gltf, .vrm, .npz, .ply, .stl or .off; its own shapes and texture coordinates are not used.
    source : folder of the head that the expressions come from. out_dir : folder that gets head.toml and head.npz.
    landmarks : file of places on the mesh (see :func:`surface.fit.transfer.reports.landmarkfile.read_landmarks`).
    options : ``unit``, ``up``, ``forward`` and ``without`` are used; those that are not given are found.
    report_dir : folder that gets the report (see :mod:`surface.fit.transfer.reports.reportfile`).
    force : write the head even where it does not follow the mesh.

    Raises FitError: the mesh or the landmarks cannot be read, no face was found, or the head has no eyes or openings;
    nothing is written then. FitError also where the head does not follow the mesh (:func:`faults_of_transfer`): then it
    is written to :func:`surface.fit.measures.refusal.refused_folder`, so that it can be inspected.
    HeadFileError: the head cannot be read, or a folder cannot be written to.
    """
    for folder in (out_dir, report_dir):
        check_writable(folder or out_dir)
    scan = read_scan(mesh_path, options.without)
    picked = read_landmarks(landmarks, scan) if landmarks is not None else {}
    made = transfer(scan, Head.load(source), name, picked, options, progress or no_progress, str(mesh_path))
    if report_dir is not None:
        write_transfer_report(made.report, scan, made.head, made.found, report_dir)
    faults = made.report.fit.faults
    beside = made.errors, made.accessories, made.texture
    save_or_refuse(out_dir, made.head, faults, *beside, force=force, hint=HINT)
    return made.report


def transfer(
    scan: Scan, head: Head, name: str, picked: dict[str, Floats], options: LoadOptions, progress: Progress, where: str,
    seen: Mapping[str, Floats] = NONE_SEEN,
) -> Transferred:  # fmt: skip
    """As :func:`transfer_head`, in memory. picked : landmarks (3,) on the scan. where : names the scan in messages.

    seen : further landmarks (3,), which are known better than they can be found, but do not say where the head is.
    """
    template = make_template(head, head.name)
    progress("face", 0.02)
    found = find_face(scan, template, picked, options, where)
    found, mirrored = upright(scan, template, found)
    scan, marks = in_frame(scan, template, found), {n: found.points(p) for n, p in {**seen, **picked}.items()}
    axis = np.array(head.data.neck.pivot)
    samples, done = _registered(scan, template, axis, marks, progress, mirrored=mirrored)
    matcher, shown = Matcher(samples), samples.kept(in_sight(scan, samples.points))
    provenance = {**head.data.provenance, "made": f"omote fit: form of a scan, expressions of the head {head.name!r}"}
    warped = warp_head(head, template, done.warp, done.smooth, matcher, shown, provenance, name)
    progress("lids", 0.75)
    data, mended = _with_lids_and_lining(warped, head)
    changed = reseated(warped, data)
    progress("report", 0.95)
    factor, notes = _true_size(found, options.unit, picked)
    notes += [*scan.notes, *mended]
    notes += ["the face is symmetric, and was fitted symmetrically"] if mirrored else []
    texture = None
    if scan.colours is not None:
        data, colour_notes = with_colours(data, scan.colours, scan.eye_colours)
        if colour_notes:
            data, texture = scan_texture(data, scan.colours)
        notes += [*colour_notes, *["skin drawn with the scan's own colours"] * (texture is not None)]
    measured = face_errors(data, template, done.warp, shown)
    parts = measured.parts
    registered = registration_errors(template, done, matcher, STAGES[-1].farthest)
    faults = tuple(faults_of_transfer(parts, registered[1], data, head))
    face = Head(data)
    notes += measured.lines(face)
    data = with_greatest_error(data, "; ".join(measured.in_words(face)))
    landmarks, openings = landmarks_of(face, done.marks, found), openings_of(face, samples)
    errors = {part: factor * mm for part, mm in skin_errors(face, scan).items()}
    data = _in_true_size(data, found, factor, options.unit or "")
    worn = _worn(scan, data)
    notes += worn.notes
    moving = [n for n in head.parameters if any(g.name == n for p in data.parts for g in p.groups)]
    notes += overlap_notes(data)
    gaps = measure_gaps(data)
    notes += [str(gap) for gap in gaps]
    fit = FitReport(name, parts, moving, notes=notes, scale=1.0, faults=faults)
    report = TransferReport(fit, head.name, *registered, landmarks, openings, changed, gaps)
    return Transferred(data, report, found, errors, worn.accessories, texture)


def _registered(
    scan: Scan, template: Template, axis: Floats, marks: dict[str, Floats], progress: Progress, *, mirrored: bool
) -> tuple[Samples, Registered]:  # fmt: skip
    """Samples of a scan that is in the head's frame, and the template's registration to them, symmetric if
    ``mirrored``. axis : (3,) within the neck. marks : landmarks (3,) there."""
    samples = without_end(sample(scan, MANY), scan, axis, float(template.landmarks["chin"][1]))
    progress("face", 0.15)
    done = register(template, samples, marks, lambda share: progress("face", 0.15 + 0.5 * share))
    return samples, symmetrised(done) if mirrored else done


def _with_lids_and_lining(warped: HeadData, source: Head) -> tuple[HeadData, list[str]]:
    """The warped head with lids that close as those of its ``source``, lashes that move with them, and a mouth's lining
    behind the skin; notes."""
    data, lid_notes = seat_drawn_lids(close_lids(warped, source.data))
    data, lining_notes = keep_lining_behind(rooted_lashes(data, source))
    return data, [*lid_notes, *lining_notes]


def _in_true_size(data: HeadData, found: Similarity, factor: float, unit: str) -> HeadData:
    """The head enlarged by ``factor`` about the middle of its eyes, with its placement."""
    middle = data.eyes.mean(axis=0)
    return replace(scaled(data, factor, middle), placement=_placement(found, factor, middle, unit))


def _worn(scan: Scan, head: HeadData) -> Kept:
    """What the scan wears, where the head is now."""
    apart = float(np.linalg.norm(head.eyes[0] - head.eyes[1])) / EYES_MM
    return keep_accessories(scan.worn, head.placement or Placement(), head.eyes.mean(axis=0), HeadSize(apart, apart))


def find_face(
    scan: Scan, template: Template, picked: dict[str, Floats], options: LoadOptions, where: str
) -> Similarity:  # fmt: skip
    """The similarity from the scan to the head's frame, by landmarks where enough are given, else by the scan's form.

    Raises FitError: no face is there, or the landmarks or options are wrong.
    """
    up, forward = (None if w is None else direction(f"--{n}", w)
                   for n, w in (("up", options.up), ("forward", options.forward)))  # fmt: skip
    if up is not None and forward is not None and abs(float(up @ forward)) > 0.5:
        raise FitError(f"--up {options.up} --forward {options.forward}: are one axis", hint="--up y --forward z")
    if options.unit is not None and options.unit not in UNITS:
        raise FitError(f"--unit {options.unit}: is not one of {', '.join(UNITS)}", hint="--unit cm")
    if len(picked) < LEAST_PICKED:
        return align(template, sample(scan), up, forward, where)
    found, off = _by_landmarks(picked, template)
    mirrored = _by_landmarks(swapped(picked), template)[1]
    if off > SWAPPED and mirrored < MUCH * off:
        hint = "left is the subject's left, which is on the right of a picture from the front"
        raise FitError(f"{where}: left and right of its landmarks are exchanged", hint=hint)
    if off > WRONG:
        raise FitError(f"{where}: its landmarks do not lie as those of a face do", hint="check their names and places")
    return found


def upright(scan: Scan, template: Template, found: Similarity) -> tuple[Similarity, bool]:
    """The similarity, turned so that a symmetric scan is symmetric about x = 0; and whether the scan is symmetric."""
    plane = mirror_plane(template, sample(in_frame(scan, template, found)))
    return (found, False) if plane is None else (levelled(found, plane), True)


def _by_landmarks(picked: dict[str, Floats], template: Template) -> tuple[Similarity, float]:
    """The similarity by landmarks, and the RMS distance between both sets of them, in heights of the face."""
    own = np.array([template.landmarks[n] for n in picked])
    found = from_pairs(np.array(list(picked.values())), own)
    off = np.linalg.norm(found.points(np.array(list(picked.values()))) - own, axis=1)
    return found, float(np.sqrt((off**2).mean())) / template.height


def direction(option: str, word: str) -> Floats:
    """The unit vector (3,) of an axis that ``word`` names, as the value of a command line's ``option``.

    Raises FitError: it names none.
    """
    if word not in AXES:
        raise FitError(f"{option} {word}: is not one of {', '.join(AXES)}", hint=f"{option} y")
    axis, sign = AXES[word]
    unit: Floats = sign * np.eye(3)[axis]
    return unit


def in_frame(scan: Scan, template: Template, found: Similarity) -> Scan:
    """The scan in the head's frame, without what is far from a head, such as the rest of a body."""
    scan = scan.turned(found.turn, found.scale, found.shift)
    margin = MARGIN * template.height
    low, high = template.points.min(axis=0) - margin, template.points.max(axis=0) + margin
    at = scan.vertices[scan.triangles].mean(axis=1)
    return scan.kept(((at > low) & (at < high)).all(axis=1))


def _placement(found: Similarity, factor: float, middle: Floats, unit: str) -> Placement:
    """From the scan's own coordinates to the head, which was enlarged by ``factor`` about ``middle``."""
    return Placement(found.turn, factor * found.scale, middle + factor * (found.shift - middle), unit)


def _true_size(found: Similarity, unit: str | None, picked: dict[str, Floats]) -> tuple[float, list[str]]:
    """Factor from the head's frame to true millimetres, and notes for the report."""
    how = f"by {len(picked)} landmarks" if len(picked) >= LEAST_PICKED else f"by its form, score {found.score:.3f}"
    degrees = np.degrees(np.arccos(np.clip((np.trace(found.turn) - 1.0) / 2.0, -1.0, 1.0)))
    notes = [f"face found {how}; turned by {degrees:.0f} degrees"]
    if unit is not None:
        return UNITS[unit] / found.scale, notes
    guess = min(UNITS, key=lambda u: abs(np.log(UNITS[u] / found.scale)))
    factor = UNITS[guess] / found.scale
    if USUAL[0] < factor < USUAL[1]:
        return factor, [
            *notes,
            f"unit taken to be {guess}: {factor:.2f} times the size of the head of the expressions",
        ]
    return 1.0, [*notes, "unit unknown: the head got the size of the head of the expressions (set --unit)"]
