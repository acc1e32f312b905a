"""Islands of a piece of a mesh: as its texture coordinates have them, or of our own where those cannot serve."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from surface.base.arrays import Ints
from surface.fit.source.flatten import flatten
from surface.fit.source.islands import Island, find_islands, signed_areas
from surface.fit.source.layout import separate
from surface.fit.source.mesh import FitMesh, triangles
from surface.fit.source.regions import connected, face_regions, in_two, own_corners
from surface.fit.source.uvcheck import SQUEEZED_SHARE, measure_uv, squeezed_share, unevenness

MAX_UNEVENNESS = 2.2  # of a face's chart; a more uneven one is replaced where another is better
MIN_GAIN = 0.85  # the other chart's unevenness over this one's must be below this
MIN_FACES = 24  # of a region that is cut in two only because its chart is squeezed
NO_FACES = np.zeros(0, np.int64)


def usable_islands(
    mesh: FitMesh,
    faces: Ints,
    scale: float,
    notes: list[str],
    what: str,
    *,
    face: bool = False,
    others: Ints = NO_FACES,
) -> list[Island]:
    """Islands without flips or overlaps of the faces (f,) of one piece.

    scale : the head's size. notes : gets a line where charts were made. what : names the piece in it. face : it is the
    face's skin; its front and sides become one chart. others : faces of what stands in its openings, as eyeballs do.
    """
    faults = measure_uv(mesh, faces, scale, face=face).faults(scale)
    if not faults:
        given = _as_given(mesh, faces)
        return _evener(mesh, faces, scale, notes, given, others) if face and given else given
    bad = faces if face else _at_fault(mesh, faces, scale)
    good = _as_given(mesh, np.setdiff1d(faces, bad))
    made = own_islands(mesh, bad, scale, face=face, others=others)
    whole = "no" if len(bad) == len(faces) else "not everywhere"
    notes.append(
        f"{what}: the file has {whole} usable texture coordinates ({', '.join(faults)}): omote made its own, "
        f"{len(made)} {'charts' if len(made) != 1 else 'chart'} without flipped or overlapping faces"
    )
    return [*made, *good]


def _evener(
    mesh: FitMesh, faces: Ints, scale: float, notes: list[str], given: list[Island], others: Ints
) -> list[Island]:  # fmt: skip
    """The face's islands as the texture has them, or charts of our own where parts of these are squeezed: there (u, v)
    has little room for control points.
    """
    before = unevenness(mesh, given)
    if before <= MAX_UNEVENNESS:
        return given
    made = own_islands(mesh, faces, scale, face=True, others=others)
    if not made or unevenness(mesh, made) > MIN_GAIN * before:
        return given
    notes.append(f"face: its texture coordinates are squeezed {before:.1f} times in places: omote made its own")
    return made


def _as_given(mesh: FitMesh, faces: Ints) -> list[Island]:
    """Islands as the texture has them, halves that lie on each other apart; those without area are dropped."""
    if not len(faces):
        return []
    found = [part for island in find_islands(mesh, faces) for part in separate(island)]
    return [i for i in found if np.ptp(i.uv, axis=0).min() > 1e-6 and np.abs(signed_areas(i)).sum() > 1e-12]


def _at_fault(mesh: FitMesh, faces: Ints, scale: float) -> Ints:
    """Those of the faces whose islands cannot serve, so that all others keep their charts."""
    bare = (mesh.face_uv[faces, :3] < 0).any(axis=1)
    mapped = faces[~bare]
    out = [faces[bare]]
    for island in find_islands(mesh, mapped) if len(mapped) else []:
        own = faces_of(mesh, mapped, island)
        if measure_uv(mesh, own, scale).faults(scale):
            out.append(own)
    return np.unique(np.concatenate(out))


def faces_of(mesh: FitMesh, faces: Ints, island: Island) -> Ints:
    """The faces of the mesh, among ``faces``, that an island consists of."""
    rows = np.where(island.faces >= 0, island.vertex[island.faces], -1)
    wanted = {tuple(row) for row in rows.tolist()}
    return faces[[tuple(row) in wanted for row in mesh.faces[faces].tolist()]]


def own_islands(
    mesh: FitMesh, faces: Ints, scale: float = 1.0, *, face: bool = False, others: Ints = NO_FACES
) -> list[Island]:
    """Charts of our own for faces (f,) of a mesh, in mm; see :func:`usable_islands`."""
    regions = face_regions(mesh, faces, others, scale) if face else connected(mesh, faces)
    return [island for region in regions for island in _unwrapped(mesh, region)]


def _unwrapped(mesh: FitMesh, faces: Ints) -> list[Island]:
    """A region that hangs together as one island; cut up where it is no disc or would be squeezed."""
    island = own_corners(mesh, faces)
    uv = flatten(mesh.vertices[island.vertex], triangles(island.faces))
    if uv is not None:
        flat = replace(island, uv=uv)
        if len(faces) <= MIN_FACES or squeezed_share(mesh, flat) <= SQUEEZED_SHARE:
            return [flat]
    if len(faces) == 1:
        return []  # a face without area
    return [flat for part in in_two(mesh, faces) for flat in _unwrapped(mesh, part)]
