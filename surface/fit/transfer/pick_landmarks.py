"""Find landmarks on a bare mesh, and write a file and a picture of them that a user can correct by hand."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from surface.base.arrays import Floats
from surface.base.errors import FitError
from surface.base.progress import Progress, no_progress
from surface.fit.source.load import LoadOptions
from surface.fit.transfer.align import NoFaceFound, Similarity
from surface.fit.transfer.api import direction, find_face, in_frame, upright
from surface.fit.transfer.register import Mark, register
from surface.fit.transfer.reports.landmarkfile import read_landmarks
from surface.fit.transfer.reports.picture import Frontal, draw_landmarks, frontal
from surface.fit.transfer.reports.reportfile import view_of
from surface.fit.transfer.scan import Scan, read_scan, sample
from surface.fit.transfer.symmetry import symmetrised
from surface.fit.transfer.template import NAMES, make_template
from surface.head import Head

MANY = 250_000  # samples of the head once it is found
LEAST_HEIGHT = 1e-6  # of a mesh that can be drawn, relative to its size
SLENDER, TOP = (
    3.0,
    0.35,
)  # heights by depths of what has more than a bust; share of it, from the top, that is drawn then
BY_HAND = ("nose_tip", "chin", "left_eye_inner", "left_eye_outer", "right_eye_inner", "right_eye_outer",
           "mouth_left", "mouth_right")  # fmt: skip


def pick_landmarks(
    mesh_path: str | Path, source: str | Path, out: Path, *, keep: bool = False,
    options: LoadOptions = LoadOptions(), progress: Progress | None = None,
) -> tuple[dict[str, Mark], Path]:  # fmt: skip
    """Find the landmarks of a face and write them, and beside the file a picture of the same name that ends in .png.

    mesh_path, options : as for :func:`surface.fit.transfer.api.transfer_head`. source : folder of a head whose face the
    mesh is compared with. out : a .toml file. keep : only find the landmarks that ``out`` does not have yet.

    Returns the landmarks in the mesh's own coordinates, and the picture's path.

    Raises NoFaceFound: no face was found in the mesh; then the picture shows the mesh in its own axes, and ``out`` has
    lines to be filled in. FitError: the mesh cannot be read, ``out`` exists and ``keep`` is False, or a file cannot be
    written; MissingPackage: Pillow is not installed. After these two nothing is written.
    """
    if out.suffix.lower() != ".toml":
        raise FitError(f"{out}: landmarks are written as TOML", hint=f"-o {out.with_suffix('.toml')}")
    if out.exists() and not keep:
        raise FitError(f"{out}: is there already", hint="--keep keeps its landmarks, finds the others, draws all again")
    report = progress or no_progress
    scan = read_scan(mesh_path, options.without)
    given = read_landmarks(out, scan) if out.exists() else {}
    template = make_template(Head.load(source), str(source))
    report("face", 0.05)
    try:
        found = find_face(scan, template, given, options, str(mesh_path))
    except NoFaceFound as e:
        view = as_it_stands(scan, options, str(mesh_path))
        picture = _write(Path(mesh_path), out, scan, view, {n: Mark(p, "given") for n, p in given.items()}, BY_HAND)
        hint = f"look at {picture}, give their pixels in {out}, and then omote landmarks {mesh_path} -o {out} --keep"
        raise NoFaceFound(f"{e}; {out} has lines for landmarks by hand", hint=hint) from e
    found, mirrored = upright(scan, template, found)
    report("face", 0.25)
    samples, held = sample(in_frame(scan, template, found), MANY), {n: found.points(p) for n, p in given.items()}
    done = register(template, samples, held, lambda share: report("landmarks", 0.25 + 0.7 * share))
    done = symmetrised(done) if mirrored else done
    marks = {n: Mark(_in_file(found, m), m.how, m.sure) for n, m in done.marks.items()}
    view = view_of(found, np.array([m.place for m in marks.values()]))
    return marks, _write(Path(mesh_path), out, scan, view, marks)


def _in_file(found: Similarity, mark: Mark) -> Floats:
    place: Floats = (mark.place - found.shift) @ found.turn / found.scale
    return place


def as_it_stands(scan: Scan, options: LoadOptions, where: str) -> Frontal:
    """The front view of a scan by the given axes, else with y up and z forward; of a whole body only the upper part.

    Raises FitError: it has no height.
    """
    up = direction("--up", options.up or "y")
    forward = direction("--forward", options.forward or ("z" if abs(up[2]) < 0.5 else "-y"))
    turn = np.array([np.cross(up, forward), up, forward])
    at = scan.vertices[np.unique(scan.triangles)] @ turn.T
    low, high = at.min(axis=0), at.max(axis=0)
    if not high[1] - low[1] > LEAST_HEIGHT * (high - low).max():
        raise FitError(f"{where}: lies flat: it has no height", hint="say with --up which axis points up, as --up z")
    if high[1] - low[1] > SLENDER * (high[2] - low[2]):
        low[1] = high[1] - TOP * (high[1] - low[1])
        above = at[at[:, 1] > low[1]]
        low[0], high[0] = above[:, 0].min(), above[:, 0].max()
    return frontal(Similarity(turn, 1.0, np.zeros(3)), low, high)


def _write(
    mesh: Path, out: Path, scan: Scan, view: Frontal, marks: Mapping[str, Mark], wanted: Sequence[str] = ()
) -> Path:  # fmt: skip
    """Write file and picture, both or none; returns the picture's path. ``wanted`` : as for :func:`as_toml`."""
    picture = out.with_suffix(".png")
    new = {path: path.with_name(f".{path.name}.new") for path in (picture, out)}
    try:
        draw_landmarks(scan, view, {n: (m.place, m.how) for n, m in marks.items()}, new[picture])
        new[out].write_text(as_toml(mesh, out, view, marks, wanted), encoding="utf-8")
        for path, made in new.items():
            os.replace(made, path)
    except OSError as e:
        raise FitError(f"{out}: cannot be written ({e})", hint="choose another -o FILE") from e
    finally:
        for made in new.values():
            made.unlink(missing_ok=True)
    return picture


def as_toml(mesh: Path, out: Path, view: Frontal, marks: Mapping[str, Mark], wanted: Sequence[str] = ()) -> str:
    """The text of a file of landmarks, with instructions. ``wanted`` : landmarks that get a line to be filled in."""
    digits = max(0, 2 - int(np.floor(np.log10(1.0 / view.scale))))  # a hundredth of a pixel
    lines = [
        f"# Landmarks of {mesh.name}; the numbers are those in {out.with_suffix('.png').name}.",
        "# Correct a place, or give a pixel of the picture's left half, as nose_tip = { pixel = [412, 388] },",
        f"# or delete a line. Then draw again: omote landmarks {mesh} -o {out} --keep",
        f"# and fit: omote fit {mesh} -o heads/me --expressions-from ict --landmarks {out}",
        "[landmarks]",
    ]
    for name in (n for n in NAMES if n in marks):
        mark = marks[name]
        place = ", ".join(f"{x:.{digits}f}" for x in mark.place)
        sure = f", {mark.sure:.2f} sure" if mark.how == "found" else ""
        lines.append(f"{name} = [{place}]  # {NAMES.index(name) + 1}, {mark.how}{sure}")
    if missing := [n for n in wanted if n not in marks]:
        lines += ["# Fill in column and row, and delete the #; left is the subject's left, on the picture's right."]
        lines += [f"# {name} = {{ pixel = [0, 0] }}" for name in missing]
    turn, shift = (", ".join(f"{x:.9g}" for x in values) for values in (view.turn.ravel(), view.shift))
    lines += ["", "[picture]  # how a place becomes a pixel; leave it as it is"]
    return "\n".join([*lines, f"turn = [{turn}]", f"scale = {view.scale:.9g}", f"shift = [{shift}]", ""])
