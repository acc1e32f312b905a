"""What lines the mouth is cut into triangles that suit a mouth that closes over an open jaw."""

from dataclasses import replace

import numpy as np

from surface import DCPSurface
from surface.fit.api import _with_mesh
from surface.head import Head
from surface.head.model.data import Group, HeadData, Jaw, Neck, PartData

N = 12


def sheet(shape: str) -> PartData:
    """A plane of 60 x 60 mm, the middle of which a shape takes out of it."""
    knots = np.concatenate([[0] * 3, np.linspace(0, 1, N - 2), [1] * 3])
    x, y = np.meshgrid(np.linspace(-30, 30, N), np.linspace(-30, 30, N), indexing="ij")
    points = np.stack([x, y, 0 * x], axis=-1)
    surface = DCPSurface.from_nurbs(3, 3, knots, knots, points, np.ones((N, N)))
    ku, kv = surface.padded
    ids = np.flatnonzero(np.linalg.norm(surface.points, axis=1) < 10.0).astype(np.int32)
    group = Group(shape, ids, np.tile([0.0, 0.0, 9.0], (len(ids), 1)).astype(np.float32))
    loop, none = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]), np.zeros(N * N)
    return PartData(
        "a", "skin", "skin", surface.points.copy(), surface.weights.copy(), ku.copy(), kv.copy(),
        np.stack(surface.degrees, axis=1), [loop], np.zeros((0, 3)), (0, 0.2, 7), [group], none, none,
    )  # fmt: skip


def triangles(part: PartData) -> int:
    head = HeadData("a", {}, Neck((0.0, -90.0, 0.0)), np.zeros((2, 3)), 0.0, Jaw((0.0, 0.0, 0.0), 0.0, (0.0, 0.0, 0.0)),
                    [part], [], [])  # fmt: skip
    return len(Head(replace(head, parts=[_with_mesh(part, head)])).parts[0].triangles)


def test_a_lining_is_finer_where_a_closing_mouth_bends_it() -> None:
    skin = sheet("mouthClose")
    flat = triangles(replace(skin, groups=[]))
    assert triangles(skin) == flat, "a face closes over teeth, and hardly bends"
    assert triangles(replace(skin, material="mouth")) > 4 * flat
    assert triangles(replace(sheet("mouthSmileLeft"), material="mouth")) > flat, "what moves a face counts, too"
