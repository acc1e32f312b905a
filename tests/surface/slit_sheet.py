"""A small mesh with a slit: a bulging sheet of 24 x 24 quads, one row of them missing in the middle."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from surface.fit.source.mesh import FitMesh

N = 24
SLIT = (8, 16)  # columns of the missing quads
ROW = 12
SIZE_MM = 200.0


def slit_sheet() -> FitMesh:
    """A sheet 200 mm wide and high; jawOpen pulls down what is below the slit, mouthSmile_L bulges the left side."""
    s = np.linspace(0, 1, N + 1)
    u, v = (a.ravel() for a in np.meshgrid(s, s, indexing="ij"))
    vertices = SIZE_MM * np.column_stack([u - 0.5, v - 0.5, 0.2 * np.cos(3 * (u - 0.5)) * np.cos(3 * (v - 0.5))])
    at = np.arange((N + 1) ** 2).reshape(N + 1, N + 1)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(N), np.arange(N), indexing="ij"))
    keep = ~((j == ROW) & (i >= SLIT[0]) & (i < SLIT[1]))
    i, j = i[keep], j[keep]
    faces = np.column_stack([at[i, j], at[i + 1, j], at[i + 1, j + 1], at[i, j + 1]])
    across = np.clip(1 - np.abs(u - 0.5) / 0.17, 0, 1)
    below = v < (ROW + 0.5) / N
    drop = np.where(below, 15 * across**2 * np.exp(-(((v - 0.5) / 0.2) ** 2)), 0.0)
    smile = 6 * np.exp(-(((u - 0.75) / 0.15) ** 2 + ((v - 0.5) / 0.2) ** 2))
    zero = np.zeros_like(u)
    deltas = np.stack([np.column_stack([zero, -drop, zero]), np.column_stack([smile, zero, smile])])
    return FitMesh(vertices, faces, np.column_stack([u, v]), faces.copy(), ("jawOpen", "mouthSmile_L"), deltas)


def write_npz(path: Path, mesh: FitMesh, **other: np.ndarray) -> Path:
    """The mesh in the NPZ layout; ``other`` replaces arrays, None leaves one out."""
    arrays = {
        "neutral": mesh.vertices, "deltas": mesh.deltas, "names": np.array(mesh.names), "faces": mesh.faces,
        "uv": mesh.uv, "face_uv": mesh.face_uv, **other,
    }  # fmt: skip
    np.savez(path, **{k: v for k, v in arrays.items() if v is not None})
    return path
