"""Meshes whose texture coordinates are traps, and places on them that are nobody's samples."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import igl
import numpy as np
from meshfiles import triangulated

from surface.fit.source.islands import Island
from surface.fit.source.load import load_mesh
from surface.fit.source.mesh import FitMesh, renumbered, triangles

SHAPES = ("jawOpen", "eyeBlink_L", "mouthSmile_L", "mouthPucker")


def bare(mesh: FitMesh) -> FitMesh:
    """Without texture coordinates."""
    return replace(mesh, uv=np.zeros((0, 2)), face_uv=np.full_like(mesh.faces, -1))


def flipped(mesh: FitMesh, count: int = 6) -> FitMesh:
    """Some inner points of (u, v) are drawn far over their neighbours, which turns faces over."""
    uv = mesh.uv.copy()
    middle = uv.mean(axis=0)
    inner = np.argsort(np.linalg.norm(uv - middle - [0.2, 0.2] * np.ptp(uv, axis=0), axis=1))[:count]
    uv[inner] += 0.25 * np.ptp(uv, axis=0)
    return replace(mesh, uv=uv)


def overlapping(mesh: FitMesh) -> FitMesh:
    """Both halves lie on each other without a seam between them, except for a strip that still has both ways round."""
    uv = mesh.uv.copy()
    middle = uv[:, 0].mean()
    beyond = uv[:, 0] > middle
    uv[beyond, 0] = middle - 0.6 * (uv[beyond, 0] - middle)
    uv[beyond, 1] += 0.013
    return replace(mesh, uv=uv)


def around(mesh: FitMesh, *, seam_in_front: bool) -> FitMesh:
    """Cylindrical coordinates of every vertex; faces over the seam run back through the whole width."""
    x, y, z = (mesh.vertices - mesh.vertices.mean(axis=0)).T
    depth = z - z.min() + 1.0 if seam_in_front else z - 0.5 * (z.min() + z.max())
    angle = np.arctan2(-x, -depth) if seam_in_front else np.arctan2(x, depth)
    uv = np.column_stack([angle / (2.0 * np.pi) + 0.5, (y - y.min()) / np.ptp(y)])
    return replace(mesh, uv=uv, face_uv=mesh.faces.copy())


def arkit_like(shared: Path, count: int = 2300) -> FitMesh:
    """ICT's face alone, decimated to as many triangles as ARKit's has, with cylindrical coordinates."""
    mesh = load_mesh(shared / "data/ict-facekit/ict_neutral_and_expressions.npz").mesh
    mesh = triangulated(replace(mesh, piece=np.zeros(0, np.int64), pieces=()))
    own = (mesh.faces[:, :3] < 9409).all(axis=1) & (mesh.vertices[mesh.faces[:, 0], 1] > -75.0)
    used, faces = renumbered(mesh.faces[own])
    got = igl.qslim(mesh.vertices[used], faces[:, :3], count)
    tri, kept = (a for a in got[1:] if isinstance(a, np.ndarray) and a.dtype.kind == "i" and a.ndim == 2), got[-1]
    born = used[np.asarray(kept)]
    chosen = [mesh.names.index(n) for n in SHAPES]
    faces = np.pad(next(tri).astype(np.int64), ((0, 0), (0, 1)), constant_values=-1)
    out = FitMesh(mesh.vertices[born], faces, np.zeros((0, 2)), np.full_like(faces, -1), SHAPES,
                  mesh.deltas[chosen][:, born])  # fmt: skip
    return around(out, seam_in_front=False)


def strewn(island: Island, count: int = 40_000) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places (u, v) at random over an island, the vertices (count, 3) of the mesh around each, and their shares."""
    rng = np.random.default_rng(7)
    tri = triangles(island.faces)[rng.integers(0, len(triangles(island.faces)), count)]
    shares = rng.dirichlet([1.0, 1.0, 1.0], count)
    return np.einsum("tk,tkd->td", shares, island.uv[tri]), island.vertex[tri], shares
