"""Strips of lashes are cut into hairs that grow from the border next to the eye, where no texture draws them."""

from dataclasses import replace

import numpy as np
import pytest

from surface.dcp import DCPSurface
from surface.fit.features.combs import HAIR_MM, combed
from surface.fit.source.islands import Island
from surface.fit.source.mesh import FitMesh
from surface.head.model.data import PartData
from surface.mesh.loops import inside
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


@pytest.mark.parametrize("below", [True, False])
@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_hairs_grow_from_the_border_next_to_the_eye_and_stay_within_the_strip(below: bool, scale: float) -> None:
    part, eyes = strip(below)
    (loop,) = combed(part, *mesh(), eyes, scale).loops
    assert loop.min() >= 0.0 and loop.max() <= 1.0
    u = np.linspace(0.1, 0.9, 4001)
    root, tip = (0.04, 0.6) if below else (0.96, 0.4)
    whole, cut = (inside(_edges(loop), np.column_stack([u, np.full_like(u, v)])) for v in (root, tip))
    assert whole.all()
    hairs = int((np.diff(cut.astype(int)) == 1).sum()) + int(cut[0])
    assert hairs == pytest.approx(0.8 * LONG / (HAIR_MM * scale), rel=0.2) and 0.05 < cut.mean() < 0.5


def test_strips_whose_texture_draws_the_hairs_or_that_have_holes_stay() -> None:
    part, eyes = strip()
    assert combed(part, *mesh(Material("m", (1.0, 1.0, 1.0, 1.0), texture=b"png")), eyes, 1.0) is part
    assert combed(part, *mesh(Material("m", (0.1, 0.1, 0.1, 1.0))), eyes, 1.0) is not part
    holed = replace(part, loops=[*part.loops, 0.3 + 0.1 * part.loops[0]])
    assert combed(holed, *mesh(), eyes, 1.0) is holed


def _edges(loop: np.ndarray) -> np.ndarray:
    return np.hstack([loop, np.roll(loop, -1, axis=0)])
