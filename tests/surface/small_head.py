"""A head small enough for tests: two flat patches that share a border, and a rigid tooth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from surface import DCPSurface
from surface.head import save_data
from surface.head.model.data import Group, HeadData, Jaw, Neck, PartData, Seam
from surface.head.model.meshes import make_surface, pack, tessellate

KNOTS = [0, 0, 0, 0, 0.5, 1, 1, 1, 1]
JAW = Jaw(
    (0.0, 0.0, 0.0), 0.4, (0.0, -2.0, 3.0), {"jawForward": np.array([[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 8.0]])}
)


def sheet(x0: float) -> DCPSurface:
    """A curved patch of 40 x 40 mm from x0, at z = 20 and more."""
    i, j = np.meshgrid(np.arange(5), np.arange(5), indexing="ij")
    at = np.array([0, 1 / 6, 0.5, 5 / 6, 1])
    points = np.stack([x0 + 40 * at[i], 40 * at[j] - 20, 20.0 + 6.0 * np.sin(2.5 * at[j])], axis=-1)
    return DCPSurface.from_nurbs(3, 3, KNOTS, KNOTS, points, np.ones((5, 5)))


def part(name: str, x0: float, follows: str = "skin", groups: list[Group] | None = None, **other) -> PartData:
    s = sheet(x0)
    zero, square = np.zeros(s.n), np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    ku, kv = s.padded
    fields = {"jaw": zero, "lids": zero, **other}
    return PartData(
        name, "skin", follows, s.points.copy(), s.weights.copy(), ku.copy(), kv.copy(), np.stack(s.degrees, axis=1),
        [square], np.zeros((0, 3)), (0, 0.1, 4), groups or [], **fields,
    )  # fmt: skip


def all_points(name: str, move: tuple[float, float, float]) -> Group:
    return Group(name, np.arange(25, dtype=np.int32), np.tile(np.array(move, np.float32), (25, 1)))


def small_head(**other) -> HeadData:
    """Patch "a" (x -40..0) bulges with mouthPucker, "b" (x 0..40) shares its border; "tooth" follows the jaw."""
    bulge = Group("mouthPucker", np.array([11, 12, 13], np.int32), np.full((3, 3), [0, 0, 6], np.float32))
    border = np.linspace(0, 1, 6)
    seam = Seam("a", "b", np.column_stack([np.ones(6), border]), np.column_stack([np.zeros(6), border]))
    fields = {
        "name": "small", "provenance": {"made": "for tests"}, "neck": Neck((0.0, -50.0, 0.0)),
        "eyes": np.array([[30.0, 30, 0], [-30, 30, 0]]), "eye_radius": 12.0, "jaw": JAW,
        "parts": [part("a", -40, groups=[bulge]), part("b", 0.5), part("tooth", 100, "jaw")],
        "seams": [seam],
        "paint": [{"part": "a", "attribute": "albedo", "value": [0.1, 0.2, 0.3], "kind": "all"}],
        **other,
    }  # fmt: skip
    return HeadData(**fields)


def save_small_head(folder: Path) -> Path:
    """Write :func:`small_head` with stored meshes; return its folder."""
    data = small_head()
    parts = [replace(p, mesh=pack(tessellate(p, make_surface(p), data.seams), p.budget)) for p in data.parts]
    save_data(folder, replace(data, parts=parts))
    return folder
