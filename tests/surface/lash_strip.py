"""A flat strip of lashes: the part, and the mesh of one face that it is fitted to."""

import numpy as np

from surface.dcp import DCPSurface
from surface.fit.source.islands import Island
from surface.fit.source.mesh import FitMesh
from surface.head.model.data import PartData
from surface.readers.meshdata import Material

LONG, TALL = 26.0, 6.0  # mm
EYES = np.array([[40.0, -20.0, 0.0], [-40.0, -20.0, 0.0]])


def strip(eye_below: bool = True) -> tuple[PartData, np.ndarray]:
    """A flat strip of lashes over (u, v) in 0..1, and eyes at its lower border, or at its upper one."""
    grid = np.stack(np.meshgrid(np.linspace(0, LONG, 6), np.linspace(0, TALL, 4), indexing="ij"), axis=-1)
    points = np.concatenate([grid, np.zeros((6, 4, 1))], axis=2)
    knots = [np.pad(np.linspace(0, 1, n - 1), 2, mode="edge") for n in (6, 4)]
    surface = DCPSurface.from_nurbs(2, 2, *knots, points, np.ones((6, 4)))
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    part = PartData(
        "lash_1", "lash", "skin", surface.points, np.ones(24), *surface.padded, np.full((24, 2), 2), [square],
        np.zeros((0, 3)), (0, 0.5, 6), [], np.zeros((24, 3)), np.zeros(24),
    )  # fmt: skip
    return part, EYES if eye_below else np.add(EYES, [0.0, 2 * 20.0 + TALL, 0.0])


def mesh(material: Material | None = None) -> tuple[FitMesh, list[Island]]:
    corners = np.array([[0.0, 0, 0], [LONG, 0, 0], [LONG, TALL, 0], [0, TALL, 0]])
    faces = np.array([[0, 1, 2, 3]])
    whole = FitMesh(
        corners, faces, corners[:, :2], faces, (), np.zeros((0, 4, 3)), np.zeros(1, int), ("lash",), (material,)
    )
    return whole, [Island(np.arange(4), corners[:, :2], faces)]
