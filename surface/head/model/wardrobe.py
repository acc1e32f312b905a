"""What is put on a head: hair, beards and clothes, read from a file and seated on the head's own skin.

A garment's control points are kept as offsets from places on the skin, given by part and (u, v). So they fit every
identity of a head, and a head whose control points were refined. Files are written by :mod:`surface.fit.wardrobe`.

Arrays of a file, by part as ``PART/key``, with n control points and m vertices:

``points`` (n, 3) offsets, mm; ``anchor`` (n, 3) number of the part in ``anchors``, u, v; ``degrees``, ``knots_u``,
``knots_v`` and ``mesh_*`` as in docs/head-format.md; ``follow`` (n,) share of the skin's motion that a point takes;
``sway`` (n,) share of the motion that lags behind the head's; ``strands`` (m, 4) texture coordinates across and along,
cover and occlusion; ``tint`` (m,) share of the tips' colour; ``shade`` (m,) brightness; ``fast`` (t, 3) fewer
triangles. ``cover/PART``, ``hidden/PART`` and ``shadow/PART`` (h, w) are pictures over (u, v) of a part of the head,
0 to 255: skin that has the garment's colour, that is covered, and that lies in its shade. ``fit`` (1,) is the
:func:`outline` of the head it was made for; files without it are put on any head that has the parts.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from surface.base.arrays import Array, Floats, Floats32
from surface.base.errors import HeadFileError
from surface.head.model.data import Group, HeadData, PartData
from surface.head.model.finer_mesh import FinerMesh
from surface.head.model.look import Worn
from surface.head.model.meshes import KEYS, make_surface
from surface.head.model.sidecar import DAMAGED, Sidecar, read_sidecar, reason
from surface.head.model.sway import SWAYS, sway_moves

HINT = "names are those of configs/wardrobe"
OTHER_HEAD = "leave out hair, beard and clothes"
STORED = ("points", "anchor", "degrees", "knots_u", "knots_v", "follow", "sway", "strands", "tint", "shade", "fast")
BY_POINT = {"points": (3,), "anchor": (3,), "degrees": (2,), "follow": (), "sway": ()}  # shape of a row of each
BY_VERTEX = {"mesh_uv": (2,), "strands": (4,), "tint": (), "shade": (), "mesh_side": ()}
DRAWN = ("strands", "tint", "shade")  # what dresses the vertices of a mesh
FIELDS = ("cover", "hidden", "shadow")
MAX_NAMES, MAX_NAME_BYTES = 64, 512  # names; bytes, four a character


@dataclass(frozen=True)
class WornPart:
    """One surface of a garment; ``arrays`` as the module says."""

    name: str
    material: str
    arrays: Mapping[str, Array]


@dataclass(frozen=True)
class Garment:
    """Contents of a file.

    anchors : the head's parts that its points are offsets from. fields : pictures by "KIND/PART", 0..1.
    fit : :func:`outline` of the head it was made for; None where the file does not say.
    """

    worn: Worn
    anchors: tuple[str, ...]
    parts: tuple[WornPart, ...]
    fields: Mapping[str, Floats32]
    fit: int | None = None


def outline(head: HeadData, anchors: Sequence[str]) -> int:
    """Return CRC-32 over how parts lie in (u, v): their trim loops and slits. Identities and refinement leave it as it
    is."""
    out = 0
    for part in (p for name in anchors for p in head.parts if p.name == name):
        for line in (*part.loops, part.slits):
            out = zlib.crc32(np.rint(1e4 * np.asarray(line, np.float64)).astype(np.int64).tobytes(), out)
    return out


def read_garment(worn: Worn) -> Garment:
    """Read what is worn.

    Raises HeadFileError: there is no such file, or it is damaged or of a newer version.
    """

    def make(file: Sidecar) -> Garment:
        z = file.arrays
        names = [n.split(":") for n in _names(z, "parts")]
        anchors = _names(z, "anchors")
        parts = tuple(WornPart(n, material, {k: z[f"{n}/{k}"] for k in (*STORED, *KEYS)}) for n, material in names)
        for part in parts:
            _check_rows(part)
            if not np.isin(part.arrays["anchor"][:, 0], np.arange(len(anchors))).all():
                raise ValueError(f"{part.name}/anchor names a part that is not in anchors")
        fields = {k: z[k].astype(np.float32) / np.float32(255) for k in z if k.split("/")[0] in FIELDS}
        fit = int(z["fit"][0]) if "fit" in z else None
        return Garment(worn, anchors, parts, fields, fit)

    found = read_sidecar(worn.path, make, HINT)
    if found is None:
        raise HeadFileError(f"{worn.path}: missing", hint=HINT)
    return found


def _names(arrays: Mapping[str, Array], key: str) -> tuple[str, ...]:
    """Return names in an array of texts. Raises ValueError: it is another array, or too long."""
    names = arrays[key]
    if names.ndim != 1 or names.dtype.kind != "U" or len(names) > MAX_NAMES or names.itemsize > MAX_NAME_BYTES:
        raise ValueError(f"{key} is no list of at most {MAX_NAMES} names")
    return tuple(str(name) for name in names)


def _check_rows(part: WornPart) -> None:
    """Raises ValueError: arrays of points or of vertices differ in length or hold what is no finite number, or
    triangles name vertices there are not."""
    a = part.arrays
    for rows, first in ((BY_POINT, "points"), (BY_VERTEX, "mesh_uv")):
        for name, row in rows.items():
            if a[name].shape != (len(a[first]), *row):
                raise ValueError(f"{part.name}/{name} has the shape {a[name].shape}, not {(len(a[first]), *row)}")
            if a[name].dtype.kind == "f" and not np.isfinite(a[name]).all():
                raise ValueError(f"{part.name}/{name} holds what is no finite number")
    for name in ("fast", "mesh_triangles"):
        if a[name].ndim != 2 or a[name].shape[1] != 3 or a[name].min() < 0 or a[name].max() >= len(a["mesh_uv"]):
            raise ValueError(f"{part.name}/{name} is no table of triangles of its {len(a['mesh_uv'])} vertices")


def carried(garment: Garment, finer: Mapping[str, FinerMesh]) -> Garment:
    """Return the garment for meshes that became finer, by part: new vertices are dressed as those around them."""

    def carry(worn: WornPart) -> WornPart:
        mesh = finer.get(worn.name)
        if mesh is None or len(mesh.mesh.uv) != len(worn.arrays["strands"]):  # of another mesh: refused as it is put on
            return worn
        return replace(worn, arrays={**worn.arrays, **{key: mesh.carry(worn.arrays[key]) for key in DRAWN}})

    return replace(garment, parts=tuple(carry(worn) for worn in garment.parts))


def with_garments(head: HeadData, garments: tuple[Garment, ...], where: str) -> HeadData:
    """Return the head with the parts of what is worn after its own.

    Raises HeadFileError: a garment was made for a head of other parts, does not lie on this one, or its arrays do not
    belong together (names the file).
    """
    parts = list(head.parts)
    for garment in garments:
        missing = [name for name in garment.anchors if name not in {p.name for p in head.parts}]
        if missing:
            why = f"fits a head with the parts {', '.join(garment.anchors)}, which this one has not"
            raise HeadFileError(f"{where}: {garment.worn.path.stem} {why}", hint=OTHER_HEAD)
        if garment.fit is not None and garment.fit != outline(head, garment.anchors):
            raise HeadFileError(f"{where}: {garment.worn.path.stem} was made for another head", hint=OTHER_HEAD)
        try:
            parts += [_seat(worn, garment, head, where) for worn in garment.parts]
        except DAMAGED as error:
            raise HeadFileError(f"{garment.worn.path}: is damaged: {reason(error)}", hint=HINT) from error
    return replace(head, parts=parts)


def _seat(worn: WornPart, garment: Garment, head: HeadData, where: str) -> PartData:
    a = worn.arrays
    anchor, follow = np.asarray(a["anchor"], float), np.asarray(a["follow"], float)
    n = len(anchor)
    points, jaw = np.array(a["points"], float), np.zeros(n)
    moves: dict[str, Floats] = {}
    of = {p.name: p for p in head.parts}
    for k, name in enumerate(garment.anchors):
        rows, skin = np.flatnonzero(anchor[:, 0] == k), of[name]
        basis = make_surface(skin).basis_rows(anchor[rows, 1:])
        points[rows] += basis @ skin.points
        moving = follow[rows] > 0.0
        if moving.any():
            jaw[rows] = follow[rows] * (basis @ skin.jaw)
            reached = np.zeros(len(skin.points), bool)
            reached[basis.column] = True
            for group in skin.groups:
                if reached[group.ids].any():
                    dense = np.zeros((len(skin.points), 3))
                    np.add.at(dense, group.ids, group.moves)
                    moves.setdefault(group.name, np.zeros((n, 3)))[rows] += follow[rows, None] * (basis @ dense)
    if not np.isfinite(points).all():
        raise HeadFileError(f"{where}: {garment.worn.path.stem} does not lie on this head", hint=HINT)
    moves |= dict(zip(SWAYS, sway_moves(points, np.asarray(a["sway"], float), head.neck.pivot), strict=True))
    (u0, v0), (u1, v1) = a["mesh_uv"].min(axis=0), a["mesh_uv"].max(axis=0)
    cell, chord, depth = np.asarray(a["mesh_made"])[:3].tolist()
    return PartData(
        name=worn.name, material=worn.material, follows="skin", points=points, weights=np.ones(n),
        knots_u=np.asarray(a["knots_u"], float), knots_v=np.asarray(a["knots_v"], float),
        degrees=np.asarray(a["degrees"], np.int64), loops=[], slits=np.zeros((0, 3)),
        budget=(int(cell), float(chord), int(depth)), groups=[_sparse(k, m) for k, m in moves.items() if m.any()],
        jaw=jaw, lids=np.zeros(n), mesh={k: a[k] for k in KEYS}, rect=(float(u0), float(u1), float(v0), float(v1)),
    )  # fmt: skip


def _sparse(name: str, moves: Floats) -> Group:
    ids = np.flatnonzero(np.abs(moves).max(axis=1) > 1e-4)
    return Group(name, ids.astype(np.int32), moves[ids].astype(np.float32))
