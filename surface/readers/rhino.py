"""Reader of openNURBS files (``.3dm``) through the optional package rhino3dm.

Surfaces, the faces of polysurfaces (breps) and extrusions are read, each as its NURBS surface. openNURBS omits the
first and the last knot of every knot vector, which no point inside the domain depends on; they are added here. Periodic
directions become closed ones. rhino3dm does not give the trim curves in (u, v), so loops are made from the edges in
space: points of each edge, inverted to (u, v) and joined by straight lines that deviate
from the edge by less than 1/10000 of the face's size. Curves, meshes and points are skipped; subdivision surfaces are
refused.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from surface.base.arrays import Floats
from surface.base.extras import require
from surface.dcp import DCPSurface
from surface.mesh.domain import Domain
from surface.spline.nurbs import nurbs_arrays

from .common import Location, NamedSurface, read_bytes

PATIENCE_S, BYTES_PER_S = 0.7, 20e6  # of processor time, and how much more for large files
TRIAL = """
import sys, rhino3dm
try:
    import signal
    signal.setitimer(signal.ITIMER_PROF, float(sys.argv[1]))
except (ImportError, AttributeError):
    pass
sys.exit(rhino3dm.File3dm.FromByteArray(sys.stdin.buffer.read()) is None)
"""
CHORD_ERROR = 1e-4  # of the face's size: chords of a trim loop from the edge
MOST_DISTANCE = 1e-3  # of the face's size: an edge from its face; modelling tolerances are smaller
STARTS = 24  # samples along u and v, in every quarter, where the search may begin
ITERATIONS = 40
MOST_POINTS = 1024  # points along one edge


def read(path: Path) -> list[NamedSurface]:
    """The surfaces of a file; ``SurfaceFileError`` names the object, ``MissingPackage`` the package rhino3dm."""
    require(f"{path}: a .3dm file", "rhino3dm")
    rhino3dm: Any = import_module("rhino3dm")
    file, data = Location(path), read_bytes(path)
    model = rhino3dm.File3dm.FromByteArray(data) if _is_readable(data) else None
    if model is None:
        raise file.error("is no openNURBS file, or a damaged one")
    out: list[NamedSurface] = []
    for number, item in enumerate(model.Objects):
        name = item.Attributes.Name or f"object {number}"
        out += _object(file.at(f"object {number} ({item.Attributes.Id})"), rhino3dm, item.Geometry, name)
    return out


def _is_readable(data: bytes) -> bool:
    """Whether openNURBS comes to an end with it: damaged files can keep it busy for ever, and nothing but the end of
    its process stops it. So another process reads it first, within a limit of processor time.
    """
    seconds = PATIENCE_S + len(data) / BYTES_PER_S
    command = [sys.executable, "-P", "-c", TRIAL, str(seconds)]
    try:
        trial = subprocess.run(command, input=data, capture_output=True, timeout=30 * seconds, check=False)
    except subprocess.TimeoutExpired:
        return False
    return trial.returncode == 0


def _object(here: Location, rhino3dm: Any, shape: Any, name: str) -> list[NamedSurface]:
    """The surfaces of one object; none for curves, points and meshes."""
    if type(shape).__name__ == "SubD":
        raise here.error("is a subdivision surface, which is no DCP surface", hint="convert it to NURBS in Rhino")
    if isinstance(shape, rhino3dm.Extrusion):
        shape = shape.ToBrep(True)
    if isinstance(shape, rhino3dm.Brep):
        faces = [_face(here.child(f", face {k}"), shape, shape.Faces[k]) for k in range(len(shape.Faces))]
        single = len(faces) == 1
        return [NamedSurface(name if single else f"{name} face {k}", *face) for k, face in enumerate(faces)]
    if isinstance(shape, rhino3dm.Surface):
        return [NamedSurface(name, *_nurbs(here, shape))]
    return []


def _nurbs(here: Location, shape: Any) -> tuple[DCPSurface, Domain | None]:
    """A surface of openNURBS, and its domain if that is less than its points reach."""
    if not shape.IsValid or (form := shape.ToNurbsSurface()) is None:
        raise here.error("is not valid, or has no NURBS form", hint="repair it in Rhino: _SelBadObjects")
    count = form.Points.CountU, form.Points.CountV
    corners = [form.Points.GetControlPoint(i, j) for i in range(count[0]) for j in range(count[1])]
    table = np.array([(p.X, p.Y, p.Z, p.W) for p in corners]).reshape(*count, 4)
    if not form.IsRational:
        table[..., 3] = 1.0
    degrees = form.Degree(0), form.Degree(1)
    knots = [_full_knots(p, k.ToList()) for p, k in zip(degrees, (form.KnotsU, form.KnotsV), strict=True)]
    ends = [(float(t[p]), float(t[-p - 1])) for p, t in zip(degrees, knots, strict=True)]
    bad = ~(np.isfinite(table).all(axis=2) & (table[..., 3] > 0))
    if bad.any():
        i, j = np.argwhere(bad)[0]
        why = f"control point ({i}, {j}) is {table[i, j].tolist()} (x, y, z, weight): not finite, or no positive weight"
        raise here.error(why)
    net, weights = table[..., :3] / table[..., 3:], table[..., 3]
    try:
        points, w, ku, kv = nurbs_arrays(*degrees, knots[0], knots[1], net, weights)
        closed = [ends[axis] if form.IsPeriodic(axis) else None for axis in range(2)]
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


def _full_knots(degree: int, inner: list[float]) -> Floats:
    """One direction's knots with the first and last one, which openNURBS omits."""
    k = np.array(inner, dtype=np.float64)
    first = k[0] if k[0] == k[degree - 1] else 2 * k[0] - k[1]
    last = k[-1] if k[-1] == k[len(k) - degree] else 2 * k[-1] - k[-2]
    return np.concatenate([[first], k, [last]])


def _face(here: Location, brep: Any, face: Any) -> tuple[DCPSurface, Domain | None]:
    """A face's surface, trimmed where the face is."""
    surface, domain = _nurbs(here, face.UnderlyingSurface())
    rect = domain.rect if domain is not None else surface.rect
    size = float(np.linalg.norm(np.ptp(surface.points, axis=0)))
    loops, whole = [], False
    for k in range(len(face.Loops)):
        loop = _loop(here.child(f", loop {k}"), brep, face.Loops[k], surface, size)
        if _along_border(loop, rect):
            whole = True
            continue
        if (np.abs(np.diff(loop, axis=0)) > [(rect[1] - rect[0]) / 2, (rect[3] - rect[2]) / 2]).any():
            why, hint = "crosses the seam of its face, which is not read", "split the face at its seam in Rhino: _Split"
            raise here.child(f", loop {k}").error(why, hint=hint)
        loops.append(loop)
    if not loops:
        return surface, domain
    u0, u1, v0, v1 = rect
    border = [np.array([[u0, v0], [u1, v0], [u1, v1], [u0, v1]])] if whole else []
    return surface, Domain(rect, [*border, *loops])


def _loop(here: Location, brep: Any, loop: Any, surface: DCPSurface, size: float) -> Floats:
    """(k, 2): corners of a loop in (u, v)."""
    parts = []
    for k in range(loop.TrimCount):
        trim = loop.Trims[k]
        if trim.EdgeIndex < 0:
            continue  # a pole: no curve in space
        edge = brep.Edges[trim.EdgeIndex]
        ends = edge.Domain.T0, edge.Domain.T1
        curve = polyline(lambda t, e=edge: _xyz(e.PointAt(t)), *ends, CHORD_ERROR * size)  # type: ignore[misc]
        parts.append((curve[::-1] if trim.IsReversed else curve)[:-1])
    if not parts:
        raise here.error("has no edge in space")
    uv, distance = invert(surface, np.concatenate(parts))
    if not (distance < MOST_DISTANCE * size).all():
        raise here.error(
            f"lies up to {np.nanmax(distance):.3g} from its face", hint="repair it in Rhino: _SelBadObjects"
        )
    return uv


def _xyz(point: Any) -> Floats:
    return np.array([point.X, point.Y, point.Z])


def _along_border(loop: Floats, rect: tuple[float, float, float, float]) -> bool:
    """Whether a loop lies on the border of the rectangle, so that it trims nothing."""
    near = 1e-7 * max(rect[1] - rect[0], rect[3] - rect[2])
    gaps = [np.abs(loop[:, side // 2] - rect[side]) for side in range(4)]
    return bool((np.min(gaps, axis=0) <= near).all())


def polyline(point: Callable[[float], Floats], start: float, end: float, error: float) -> Floats:
    """(k, 3): points of a curve whose chords deviate from it by less than ``error``, or :data:`MOST_POINTS` points."""
    count = 8
    while True:
        fine = np.array([point(t) for t in np.linspace(start, end, 2 * count + 1)])
        deviation = np.linalg.norm(fine[1::2] - (fine[:-2:2] + fine[2::2]) / 2, axis=1).max()
        if deviation < error or count >= MOST_POINTS:
            return fine[::2] if deviation < error else fine
        count *= 2


def invert(surface: DCPSurface, points: Floats) -> tuple[Floats, Floats]:
    """The nearest (u, v) of points near the surface.

    Gauss-Newton steps from the nearest of a grid of samples, in each quarter of the rectangle: where a surface
    closes, the nearest sample may lie at the wrong end.

    points : (k, 3) float64

    Returns uv (k, 2), and distances (k,).
    """
    u0, u1, v0, v1 = surface.rect
    found = []
    for a, b in ((u0, (u0 + u1) / 2), ((u0 + u1) / 2, u1)):
        for c, d in ((v0, (v0 + v1) / 2), ((v0 + v1) / 2, v1)):
            grid = np.stack(np.meshgrid(np.linspace(a, b, STARTS), np.linspace(c, d, STARTS)), axis=-1).reshape(-1, 2)
            samples = surface.evaluate(grid)
            starts = np.array([grid[np.nanargmin(((samples - xyz) ** 2).sum(axis=1))] for xyz in points])
            found.append(_gauss_newton(surface, points, starts))
    uv, distance = (np.array(each) for each in zip(*found, strict=True))
    best = np.argmin(distance, axis=0), np.arange(len(points))
    return uv[best], distance[best]


def _gauss_newton(surface: DCPSurface, points: Floats, uv: Floats) -> tuple[Floats, Floats]:
    """Gauss-Newton steps that stay in the rectangle; (u, v) and distances."""
    u0, u1, v0, v1 = surface.rect
    low, high = np.array([u0, v0]), np.array([u1, v1])
    for _ in range(ITERATIONS):
        s, su, sv = surface.derivatives(uv)
        r = points - s
        a, b, c = (su * su).sum(1), (su * sv).sum(1), (sv * sv).sum(1)
        determinant = a * c - b * b
        flat = determinant <= 1e-14 * a * c  # at a pole: one direction alone
        determinant[flat] = 1.0
        ru, rv = (r * su).sum(1), (r * sv).sum(1)
        step = np.stack([(c * ru - b * rv) / determinant, (a * rv - b * ru) / determinant], axis=1)
        step[flat] = np.stack([ru / np.where(a > 0, a, 1), rv / np.where(c > 0, c, 1)], axis=1)[flat] / 2
        moved = np.clip(uv + step, low, high)
        done = np.abs(moved - uv).max() <= 1e-14 * (high - low).max()
        uv = moved
        if done:
            break
    return uv, np.linalg.norm(surface.evaluate(uv) - points, axis=1)
