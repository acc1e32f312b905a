"""Measure whether texture coordinates of a mesh can serve as charts.

They can where no two places of an island share a point of (u, v) and no large part of the surface is squeezed. What
lies in different islands, tiles or mirrored halves is no fault: every island is a chart of its own. A seam through the
face is one, since slopes are not kept across it and a mouth that it cuts is no slit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surface.base.arrays import Bools, Floats, Floats32, Ints
from surface.base.jit import kernel
from surface.fit.source.islands import Island, boundary_loops, find_islands, signed_areas
from surface.fit.source.layout import separate
from surface.fit.source.mesh import FitMesh, face_areas, triangles

RASTER = (256, 2048)  # least and most pixels along the longer side of an island
PER_FACE = 6.0  # pixels that a face of usual size covers along each side
OVERLAP_MM = 2.0  # two places of the surface that share a point in (u, v) and lie further apart are an overlap
OVERLAP_SHARE = 0.002  # of the surface's area: less is a crease that least squares smooths over
MIN_OVERLAP_MM = 12.0  # a distance above this is never a crease
SQUEEZED, SQUEEZED_SHARE = 8.0, 0.06  # times the usual stretch; of the area
MIN_UV_AREA = 1e-6  # per area of surface, relative to the usual ratio: less counts as nothing
FRONT = 0.35  # z of the normal of what is seen from the front
RIM_MOTION = 0.05  # fraction of all motion on each side beyond which a place is not in front
MIN_ISLAND_AREA = 0.04  # fraction of the area: smaller islands line the mouth and the sockets
SEAM_MM = 20.0  # of a head of usual size: a longer seam through its front is seen


@dataclass(frozen=True)
class UVDefects:
    """What is wrong with the texture coordinates of some faces.

    faces : how many there are. missing, flipped, overlapping, flat : how many have no coordinates, run the other way
    round than their island, share places in (u, v) with others that lie elsewhere, have no area in (u, v).
    overlap : their share of the surface's area; apart_mm : the most that lies between two places at one (u, v).
    squeezed : share of the area that is stretched more than :data:`SQUEEZED` times as much as is usual.
    seam_mm : length of seams through the front of a face.
    """

    faces: int
    missing: int = 0
    flipped: int = 0
    overlapping: int = 0
    flat: int = 0
    overlap: float = 0.0
    apart_mm: float = 0.0
    squeezed: float = 0.0
    seam_mm: float = 0.0

    def faults(self, scale: float = 1.0) -> list[str]:
        """What makes these coordinates unusable, in words; empty where they serve. ``scale`` : the head's size."""
        out = []
        if self.missing:
            out.append("none at all" if self.missing == self.faces else f"{self.missing} faces have none")
        if self.overlap > OVERLAP_SHARE or self.apart_mm > MIN_OVERLAP_MM * scale:
            out += [f"{self.flipped} faces flipped"] if self.flipped else []
            out.append(f"{self.overlapping} faces overlapping others up to {self.apart_mm:.0f} mm away")
        if self.squeezed > SQUEEZED_SHARE:
            out.append(f"{100 * self.squeezed:.0f} % of the surface squeezed")
        if self.seam_mm > SEAM_MM * scale:
            out.append(f"a seam of {self.seam_mm:.0f} mm through the face")
        return out


def measure_uv(mesh: FitMesh, faces: Ints, scale: float = 1.0, *, face: bool = False) -> UVDefects:
    """Defects of the texture coordinates of some faces (f,) of a mesh; ``scale`` : the head's size.

    ``face`` : they are the skin of a face, whose front shall have no seams.
    """
    missing = int((mesh.face_uv[faces, :3] < 0).any(axis=1).sum())
    if missing:
        return UVDefects(len(faces), missing)
    found = find_islands(mesh, faces)
    islands = [part for island in found for part in separate(island)]
    total = sum(float(face_areas(mesh.vertices[i.vertex], i.faces).sum()) for i in islands)
    rows = np.array([_measure_island(mesh, island, scale) for island in islands])
    areas, most = rows[:, :5].sum(axis=0), float(rows[:, 5].max())
    flipped, overlapping, flat, overlap, squeezed = areas.tolist()
    seam = front_seams(mesh, islands, faces) if face else 0.0
    whole = max(total, 1e-12)
    return UVDefects(
        len(faces), 0, int(flipped), int(overlapping), int(flat), overlap / whole, most, squeezed / whole, seam
    )


def _measure_island(mesh: FitMesh, island: Island, scale: float) -> tuple[float, ...]:
    """Numbers of flipped, overlapping and flat faces; overlapping and squeezed area; greatest distance."""
    area = signed_areas(island)
    surface = face_areas(mesh.vertices[island.vertex], island.faces)
    usual = np.median(np.abs(area) / np.maximum(surface, 1e-12))
    way = 1.0 if area.sum() >= 0 else -1.0
    flat = np.abs(area) <= MIN_UV_AREA * usual * surface
    apart, owner = _overlaps(mesh, island)
    over = apart > OVERLAP_MM * scale
    faces = np.zeros(len(island.faces), bool)
    faces[owner[over]] = True
    squeezed = _stretch(mesh, island) > SQUEEZED
    return (
        float((way * area < 0).sum()), float(faces.sum()), float(flat.sum()), float(surface[faces].sum()),
        float(surface[squeezed | flat].sum()), float(apart.max(initial=0.0)),
    )  # fmt: skip


def squeezed_share(mesh: FitMesh, island: Island) -> float:
    """Share of an island's area that is stretched more than :data:`SQUEEZED` times as much as is usual."""
    surface = face_areas(mesh.vertices[island.vertex], island.faces)
    return float(surface[_stretch(mesh, island) > SQUEEZED].sum() / max(float(surface.sum()), 1e-12))


def unevenness(mesh: FitMesh, islands: list[Island]) -> float:
    """How many times as much as is usual all but a hundredth of the surface of islands is stretched, at most."""
    stretch = np.concatenate([_stretch(mesh, island) for island in islands])
    area = np.concatenate([face_areas(mesh.vertices[i.vertex], i.faces) for i in islands])
    order = np.argsort(stretch)
    return float(stretch[order][np.searchsorted(np.cumsum(area[order]), 0.99 * area.sum())])


def _stretch(mesh: FitMesh, island: Island) -> Floats:
    """(f,) the longest way on the surface per way in (u, v), relative to what is usual in the island."""
    a, b, c = island.faces[:, :3].T
    at = mesh.vertices[island.vertex]
    sides, rise = (np.stack([x[b] - x[a], x[c] - x[a]], axis=1) for x in (island.uv, at))
    det = np.linalg.det(sides)
    good = np.abs(det) > 1e-12
    sides[~good] = np.eye(2)
    slope = np.linalg.solve(sides, rise)
    # a chart may be stretched as a whole along one direction: laying out undoes that
    metric, weight = np.einsum("fik,fjk->fij", slope, slope), np.abs(det) * good
    usual = np.median(np.trace(metric[good], axis1=1, axis2=2)) if good.any() else 1.0
    weight = np.where(np.trace(metric, axis1=1, axis2=2) < 16.0 * usual, weight, 0.0)
    mean = np.einsum("f,fij->ij", weight, metric) / max(float(weight.sum()), 1e-30)
    value, axes = np.linalg.eigh(mean + 1e-12 * np.trace(mean) * np.eye(2))
    even = (axes / np.sqrt(np.maximum(value, 1e-300))) @ axes.T
    longest = np.sqrt(np.maximum(np.linalg.eigvalsh(even @ metric @ even)[:, 1], 0.0))
    return np.where(good, longest / max(float(np.median(longest[good])) if good.any() else 1.0, 1e-12), np.inf)


def _overlaps(mesh: FitMesh, island: Island) -> tuple[Floats, Ints]:
    """(t,) the most (mm) that lies between each triangle of the island and others at one (u, v), and its face."""
    corner = triangles(island.faces)
    quads = np.flatnonzero(island.faces[:, 3] >= 0)
    owner = np.concatenate([np.arange(len(island.faces)), quads])
    low, extent = island.uv.min(axis=0), float(np.ptp(island.uv, axis=0).max())
    size = int(np.clip(PER_FACE * np.sqrt(2.0 * len(corner)), *RASTER))
    at = (island.uv - low) * ((size - 3) / max(extent, 1e-12)) + 1.0
    apart = np.zeros(len(corner))
    seen = np.full((size, size, 3), np.nan, np.float32)
    holder = np.full((size, size), -1, np.int32)
    mark_overlaps(at[corner], mesh.vertices[island.vertex][corner], seen, holder, apart)
    return apart, owner


@kernel
def mark_overlaps(uv: Floats, points: Floats, seen: Floats32, holder: Ints, apart: Floats) -> None:
    """Draw triangles ``uv (t, 3, 2)`` in pixels; ``apart (t,)`` gets the distance between points that share a pixel.

    points (t, 3, 3) : corners on the surface. seen (h, w, 3), holder (h, w) : what was drawn first at each pixel.
    """
    for t in range(len(uv)):
        a, b, c = uv[t, 0], uv[t, 1], uv[t, 2]
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if abs(area) < 1e-9:
            continue
        y0, y1 = int(np.ceil(min(a[1], b[1], c[1]))), int(np.floor(max(a[1], b[1], c[1])))
        x0, x1 = int(np.ceil(min(a[0], b[0], c[0]))), int(np.floor(max(a[0], b[0], c[0])))
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                p = ((b[0] - x) * (c[1] - y) - (b[1] - y) * (c[0] - x)) / area
                q = ((c[0] - x) * (a[1] - y) - (c[1] - y) * (a[0] - x)) / area
                r = 1.0 - p - q
                if p < 1e-6 or q < 1e-6 or r < 1e-6:
                    continue
                if holder[y, x] < 0:
                    holder[y, x] = t
                    for k in range(3):
                        seen[y, x, k] = p * points[t, 0, k] + q * points[t, 1, k] + r * points[t, 2, k]
                    continue
                total = 0.0
                for k in range(3):
                    off = p * points[t, 0, k] + q * points[t, 1, k] + r * points[t, 2, k] - seen[y, x, k]
                    total += off * off
                distance = np.sqrt(total)
                apart[t] = max(apart[t], distance)
                apart[holder[y, x]] = max(apart[holder[y, x]], distance)


def front_seams(mesh: FitMesh, islands: list[Island], faces: Ints) -> float:
    """Length (mm) of seams through the part of a face that is seen from the front and moves.

    A seam around an opening, where lips or lids go over into what lies behind them, is none: it is a hole of one of
    the two islands. The others have outlines of large islands on both sides.
    """
    area = np.array([face_areas(mesh.vertices[i.vertex], i.faces).sum() for i in islands])
    edges = [np.zeros((0, 2), np.int64)]
    for island in (i for i, own in zip(islands, area, strict=True) if own > MIN_ISLAND_AREA * area.sum()):
        ids = island.vertex[boundary_loops(island)[0]]
        edges.append(np.sort(np.column_stack([ids, np.roll(ids, -1)]), axis=1))
    every, count = np.unique(np.concatenate(edges), axis=0, return_counts=True)
    seams = every[count > 1]
    seams = seams[_front(mesh, faces)[seams].all(axis=1)]
    return float(np.linalg.norm(mesh.vertices[seams[:, 0]] - mesh.vertices[seams[:, 1]], axis=1).sum())


def _front(mesh: FitMesh, faces: Ints) -> Bools:
    """(n,) vertices that look forwards, where most of the movement is; none where the shapes do not show it."""
    used = np.unique(mesh.faces[faces])
    used = used[used >= 0]
    moved = np.linalg.norm(mesh.deltas[:, used], axis=2).sum(axis=0)
    inside = np.zeros(len(mesh.vertices), bool)
    if not moved.sum() > 0:
        return inside
    share = moved / moved.sum()
    inside[used] = True
    for axis in (0, 1):
        order = np.argsort(mesh.vertices[used, axis])
        ends = np.searchsorted(np.cumsum(share[order]), (RIM_MOTION, 1.0 - RIM_MOTION))
        low, high = mesh.vertices[used[order[np.clip(ends, 0, len(used) - 1)]], axis]
        inside &= (mesh.vertices[:, axis] >= low) & (mesh.vertices[:, axis] <= high)
    return inside & (vertex_normals(mesh, faces)[:, 2] > FRONT)


def vertex_normals(mesh: FitMesh, faces: Ints) -> Floats:
    """(n, 3) unit normals of some faces at their vertices; 0 elsewhere."""
    tri = triangles(mesh.faces[faces])
    a, b, c = mesh.vertices[tri].swapaxes(0, 1)
    flat = np.cross(b - a, c - a)
    out = np.zeros_like(mesh.vertices)
    np.add.at(out, tri.ravel(), np.repeat(flat, 3, axis=0))
    unit: Floats = out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-12)
    return unit
