"""Fill in the shapes that a mesh lacks: a head is given the mesh's form, and its motions are carried over to the mesh.

The mesh is then fitted as if it had these shapes, so lids, lips and eyes are treated as in any other fit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from surface.base.arrays import Floats
from surface.base.errors import FitError
from surface.base.progress import Progress
from surface.fit.features.finish import is_on_purpose
from surface.fit.filling.carry import Carrier
from surface.fit.filling.rims import rims_of_mesh
from surface.fit.source.load import SUFFIXES, Loaded, LoadOptions, fit_mesh_of, read_mesh
from surface.fit.source.mesh import FitMesh
from surface.fit.source.names import NameMap, map_names, read_names
from surface.fit.source.naming.expressions import with_expressions
from surface.fit.source.naming.shapes import empty_shapes, share_of, to_arkit
from surface.fit.source.placing.orient import axis_names
from surface.fit.transfer.api import transfer
from surface.fit.transfer.faults import HINT
from surface.fit.transfer.reports.landmarkfile import read_landmarks
from surface.fit.transfer.scan import read_scan
from surface.head import Head
from surface.head.model.parameters import TONGUE_JAW
from surface.head.model.placement import Placement

MADE = ("mouthClose", "eyeLook")  # beginnings of those that a fit makes itself, from the mesh's jawOpen and its blinks


@dataclass(frozen=True)
class Filling:
    """Where shapes that a mesh lacks come from.

    head : folder of the head. landmarks : file of places on the mesh, as for a bare scan; None: they are found.
    """

    head: Path
    landmarks: Path | None = None


def own_shapes(path: str | Path, options: LoadOptions = LoadOptions()) -> tuple[str, ...]:
    """Parameters for which a mesh has shapes of its own; none for a bare scan.

    Raises FitError: the file, or the table of names, cannot be read.
    """
    path = Path(path)
    if not path.is_dir() and path.suffix.lower() not in SUFFIXES:
        return ()
    raw = read_mesh(path, options.shapes)
    if not raw.names:
        return ()
    mesh, other = with_expressions(fit_mesh_of(raw), raw.expressions)
    own = read_names(options.names) if options.names else None
    named = map_names(mesh.names, own, empty=empty_shapes(mesh), other=other, share=partial(share_of, mesh))
    return tuple(named.sources)


def filled(loaded: Loaded, path: str | Path, filling: Filling, options: LoadOptions, progress: Progress) -> Loaded:
    """A mesh with the shapes that it lacks, from a head that is given its form; unchanged where it lacks none.

    loaded : the mesh as read from ``path`` with ``options``.
    Raises FitError: no face was found, or the head does not follow the mesh, so that its motions would go astray; and
    what :func:`surface.fit.transfer.api.transfer_head` raises of what it reads.
    """
    lacking = tuple(n for n in loaded.named.missing if not n.startswith(MADE))
    if not lacking:
        return loaded
    scan = read_scan(path, options.without)
    picked = read_landmarks(filling.landmarks, scan) if filling.landmarks is not None else {}
    head = Head.load(filling.head)
    rims = rims_of_mesh(loaded.mesh)
    seen = {n: loaded.placement.file_points(at) for n, at in rims.corners().items()} if rims else {}
    axes = _in_its_axes(options, loaded.placement)
    made = transfer(scan, head, head.name, picked, axes, progress, str(path), seen)
    if faults := made.report.fit.faults:
        raise FitError(f"{path}: the head {head.name!r} cannot be given its form: {'; '.join(faults)}", hint=HINT)
    return with_shapes_of(loaded, Head(made.head), lacking)


def _in_its_axes(options: LoadOptions, placement: Placement) -> LoadOptions:
    """The options with the axes that the mesh was found to have, where it stands upright in them."""
    if not np.isclose(np.abs(placement.turn).max(axis=1), 1.0).all():
        return options
    up, forward = axis_names(placement.turn)
    return replace(options, up=up, forward=forward)


def with_shapes_of(loaded: Loaded, head: Head, lacking: tuple[str, ...]) -> Loaded:
    """The mesh with shapes of a head that lies on it. lacking : parameters that it has no shapes for.

    head : its placement says how it lies to the mesh's file. Parameters that it has nothing for stay missing.
    """
    names = tuple(n for n in lacking if n in head.groups)
    ours, theirs = loaded.placement, head.data.placement or Placement()
    there = theirs.points(ours.file_points(loaded.mesh.vertices))
    still = replace(loaded.mesh, vertices=there, names=(), deltas=loaded.mesh.deltas[:0])
    moves = Carrier(still, without_wrinkles(head)).moves(names)
    deltas = np.concatenate([loaded.mesh.deltas, ours.moves(theirs.file_moves(moves))])
    mesh = replace(loaded.mesh, names=(*loaded.mesh.names, *names), deltas=deltas)
    named = loaded.named.filled_up(names, len(loaded.mesh.names), head.name)
    if "tongueOut" in names:
        mesh.deltas[len(loaded.mesh.names) + names.index("tongueOut")] -= _open_for_tongue(mesh, named)
    return replace(loaded, mesh=mesh, named=named, notes=(*loaded.notes, *fill_notes(loaded.named, names, head.name)))


def _open_for_tongue(mesh: FitMesh, named: NameMap) -> Floats:
    """(n, 3) how the mesh's jaw opens when its tongue comes out: not by the tongue's shape, which comes on top."""
    every = to_arkit(mesh, named)
    jaw = [TONGUE_JAW * d for n, d in zip(every.names, every.deltas, strict=True) if n == "jawOpen"]
    return jaw[0] if jaw else np.zeros_like(mesh.vertices)


def without_wrinkles(head: Head) -> Head:
    """The head without the rules that make wrinkles, which are finer than the vertices of a mesh."""
    return Head(replace(head.data, rules=[r for r in head.data.rules if is_on_purpose(r)]))


def fill_notes(own: NameMap, names: tuple[str, ...], head: str) -> list[str]:
    """Which shapes are the mesh's ``own``, and which come from a head, in words."""
    kept = ", ".join(own.sources)
    return [
        f"the mesh's own, kept: {kept}" if kept else "the mesh has no shapes of its own",
        f"filled in from the head {head!r}, for the mesh has no shapes for them: {', '.join(names)}",
    ]
