"""Reader of openNURBS files (``.3dm``) through the optional package rhino3dm.

Surfaces, the faces of polysurfaces (breps) and extrusions are read, each as its NURBS surface. openNURBS omits the
first and the last knot of every knot vector, which no point inside the domain depends on; they are added here. Periodic
directions become closed ones. rhino3dm does not give the trim curves in (u, v), so :mod:`.trimloops` makes loops from
the edges in space, in chords that deviate from the edge by less than 1/10000 of the face's size. Curves, meshes and
points are skipped; subdivision surfaces are refused.
"""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from surface.base.arrays import Floats
from surface.base.errors import SurfaceFileError
from surface.base.extras import require
from surface.dcp import DCPSurface
from surface.mesh.domain import Domain
from surface.spline.nurbs import nurbs_arrays

from .common import LeaveOut, Location, NamedSurface, read_bytes
from .trimloops import TrimEdge, loop_over, polyline

PATIENCE_S, BYTES_PER_S = 0.7, 20e6  # of processor time, and how much more for large files
MAX_BYTES, GROWTH = 300_000_000, 40  # of memory, and how much more for each byte of the file, which may be compressed
TRIAL = """
import sys, rhino3dm
try:
    import resource, signal
    signal.setitimer(signal.ITIMER_PROF, float(sys.argv[1]))
    resource.setrlimit(resource.RLIMIT_DATA, (int(sys.argv[2]), int(sys.argv[2])))
except (ImportError, AttributeError, OSError, ValueError):
    pass
sys.exit(rhino3dm.File3dm.FromByteArray(sys.stdin.buffer.read()) is None)
"""
CHORD_ERROR = 1e-4  # of the face's size: chords of a trim loop from the edge


def read(path: Path, leave_out: LeaveOut | None = None) -> list[NamedSurface]:
    """Return the surfaces of a file; ``SurfaceFileError`` names the object, ``MissingPackage`` the package rhino3dm.

    leave_out : takes the error of each object or face that cannot be read; without it the first is raised.
    """
    require(f"{path}: a .3dm file", "rhino3dm")
    rhino3dm: Any = import_module("rhino3dm")
    file, data = Location(path), read_bytes(path)
    model = rhino3dm.File3dm.FromByteArray(data) if _is_readable(data) else None
    if model is None:
        raise file.error("is no openNURBS file, or a damaged one")
    skip = leave_out or _refuse
    out: list[NamedSurface] = []
    for number, item in enumerate(model.Objects):
        name = item.Attributes.Name or f"object {number}"
        here = file.at(f"object {number} ({item.Attributes.Id})")
        try:
            out += _object(here, rhino3dm, item.Geometry, name, skip)
        except SurfaceFileError as error:
            skip(error)
    return out


def _refuse(error: SurfaceFileError) -> None:
    raise error


def _is_readable(data: bytes) -> bool:
    """Whether openNURBS comes to an end with it: damaged files can keep it busy for ever, and nothing but the end of
    its process stops it, and others make it ask for gigabytes. So another process reads it first, within limits of
    processor time and memory.
    """
    seconds = PATIENCE_S + len(data) / BYTES_PER_S
    command = [sys.executable, "-P", "-c", TRIAL, str(seconds), str(MAX_BYTES + GROWTH * len(data))]
    try:
        trial = subprocess.run(command, input=data, capture_output=True, timeout=30 * seconds, check=False)
    except subprocess.TimeoutExpired:
        return False
    return trial.returncode == 0


def _object(here: Location, rhino3dm: Any, shape: Any, name: str, skip: LeaveOut) -> list[NamedSurface]:
    """Return the surfaces of one object; none for curves, points and meshes."""
    if type(shape).__name__ == "SubD":
        raise here.error("is a subdivision surface, which is no DCP surface", hint="convert it to NURBS in Rhino")
    if isinstance(shape, rhino3dm.Extrusion):
        shape = shape.ToBrep(True)
    if isinstance(shape, rhino3dm.Brep):
        return _faces(here, shape, name, skip)
    if isinstance(shape, rhino3dm.Surface):
        return [NamedSurface(name, *_nurbs(here, shape))]
    return []


def _faces(here: Location, brep: Any, name: str, skip: LeaveOut) -> list[NamedSurface]:
    """Return the faces of a polysurface, but those that ``skip`` takes the error of."""
    out, count = [], len(brep.Faces)
    for k in range(count):
        title = name if count == 1 else f"{name} face {k}"
        try:
            out.append(NamedSurface(title, *_face(here.child(f", face {k}"), brep, brep.Faces[k])))
        except SurfaceFileError as error:
            skip(error)
    return out


def _nurbs(here: Location, shape: Any) -> tuple[DCPSurface, Domain | None]:
    """Return a surface of openNURBS, and its domain if that is less than its points reach."""
    if not shape.IsValid or (form := shape.ToNurbsSurface()) is None:
        raise here.error("is not valid, or has no NURBS form", hint="repair it in Rhino: _SelBadObjects")
    count = form.Points.CountU, form.Points.CountV
    corners = [form.Points.GetControlPoint(i, j) for i in range(count[0]) for j in range(count[1])]
    table = np.array([(p.X, p.Y, p.Z, p.W) for p in corners]).reshape(*count, 4)
    if not form.IsRational:
        table[..., 3] = 1.0
    degrees = form.Degree(0), form.Degree(1)
    closing = form.IsPeriodic(0), form.IsPeriodic(1)
    inner = form.KnotsU.ToList(), form.KnotsV.ToList()
    knots = [_full_knots(p, k, periodic=c) for p, k, c in zip(degrees, inner, closing, strict=True)]
    ends = [(float(t[p]), float(t[-p - 1])) for p, t in zip(degrees, knots, strict=True)]
    bad = ~(np.isfinite(table).all(axis=2) & (table[..., 3] > 0))
    if bad.any():
        i, j = np.argwhere(bad)[0]
        why = f"control point ({i}, {j}) is {table[i, j].tolist()} (x, y, z, weight): not finite, or no positive weight"
        raise here.error(why)
    net, weights = table[..., :3] / table[..., 3:], table[..., 3]
    try:
        points, w, ku, kv = nurbs_arrays(*degrees, knots[0], knots[1], net, weights)
        closed = [ends[axis] if closing[axis] else None for axis in range(2)]
        keep = np.ones(count, dtype=bool)
        for axis in range(2):
            if closed[axis] is not None:  # the last points repeat the first
                keep[(slice(None),) * axis + (slice(count[axis] - degrees[axis], None),)] = False
        kept = keep.ravel()
        surface = DCPSurface(points[kept], w[kept], ku[kept], kv[kept], closed_u=closed[0], closed_v=closed[1])
    except ValueError as error:
        raise here.error(str(error)) from error
    rect = (*ends[0], *ends[1])
    return surface, None if rect == surface.rect else Domain(rect)


def _full_knots(degree: int, inner: list[float], *, periodic: bool) -> Floats:
    """Return one direction's knots with the first and last one, which openNURBS omits.

    In a closed direction they are those that a whole turn further on, or back, the file has. In others nothing inside
    the domain depends on them.
    """
    k = np.array(inner, dtype=np.float64)
    first = k[0] if k[0] == k[degree - 1] else 2 * k[0] - k[1]
    last = k[-1] if k[-1] == k[len(k) - degree] else 2 * k[-1] - k[-2]
    if periodic:
        turn = k[-degree] - k[degree - 1]
        first, last = k[-2 * degree] - turn, k[2 * degree - 1] + turn
    return np.concatenate([[first], k, [last]])


def _face(here: Location, brep: Any, face: Any) -> tuple[DCPSurface, Domain | None]:
    """Return a face's surface, trimmed where the face is."""
    surface, domain = _nurbs(here, face.UnderlyingSurface())
    rect = domain.rect if domain is not None else surface.rect
    alone = face.DuplicateFace(False)  # openNURBS says of whole polysurfaces only whether they are untrimmed
    if alone is not None and alone.IsSurface:
        return surface, domain
    size = float(np.linalg.norm(np.ptp(surface.points, axis=0)))
    loops, whole = [], False
    for k in range(len(face.Loops)):
        try:
            loop = loop_over(surface, rect, _edges(brep, face.Loops[k], CHORD_ERROR * size), size)
        except ValueError as error:
            raise here.child(f", loop {k}").error(str(error), hint="repair it in Rhino: _SelBadObjects") from error
        if _along_border(loop, rect):
            whole = True
        else:
            loops.append(loop)
    if not loops:
        return surface, domain
    u0, u1, v0, v1 = rect
    border = [np.array([[u0, v0], [u1, v0], [u1, v1], [u0, v1]])] if whole else []
    return surface, Domain(rect, [*border, *loops])


def _edges(brep: Any, loop: Any, error: float) -> list[TrimEdge]:
    """Return the edges of a loop as it runs, in points whose chords deviate from them by less than ``error``."""
    out = []
    for k in range(loop.TrimCount):
        trim = loop.Trims[k]
        if trim.EdgeIndex < 0:
            out.append(TrimEdge(np.zeros((0, 3))))
            continue
        edge = brep.Edges[trim.EdgeIndex]
        curve = polyline(lambda t, e=edge: _xyz(e.PointAt(t)), edge.Domain.T0, edge.Domain.T1, error)  # type: ignore[misc]
        out.append(TrimEdge(curve[::-1] if trim.IsReversed else curve))
    return out


def _xyz(point: Any) -> Floats:
    return np.array([point.X, point.Y, point.Z])


def _along_border(loop: Floats, rect: tuple[float, float, float, float]) -> bool:
    """Whether a loop lies on the border of the rectangle, so that it trims nothing."""
    near = 1e-7 * max(rect[1] - rect[0], rect[3] - rect[2])
    gaps = [np.abs(loop[:, side // 2] - rect[side]) for side in range(4)]
    return bool((np.min(gaps, axis=0) <= near).all())
