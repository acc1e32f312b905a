"""What lines a mouth is darker next to its rim."""

from __future__ import annotations

import numpy as np
import pytest

from surface.view.draw.rims import rim_shade


def bag(rows: int = 12, around: int = 24, *, split: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """A tube of 2 mm rows that is closed at its end: vertices (m, 3), triangles (t, 3); the rim is at z = 0."""
    angle = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    ring = 20.0 * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(around)])
    rings = [ring - [0.0, 0.0, 2.0 * k] for k in range(rows)]
    vertices = np.vstack([*rings, [[0.0, 0.0, -2.0 * rows]]])
    i, j = (a.ravel() for a in np.meshgrid(np.arange(rows - 1), np.arange(around), indexing="ij"))
    a, b, c, d = (p * around + q % around for p, q in ((i, j), (i, j + 1), (i + 1, j + 1), (i + 1, j)))
    last = (rows - 1) * around + np.arange(around)
    end = np.column_stack([last, np.roll(last, -1), np.full(around, len(vertices) - 1)])
    triangles = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d]), end])
    if not split:
        return vertices, triangles
    return vertices[triangles].reshape(-1, 3), np.arange(triangles.size).reshape(-1, 3)


@pytest.mark.parametrize("split", [False, True])
def test_the_rim_is_dark_and_the_deep_is_not(split: bool) -> None:
    vertices, triangles = bag(split=split)
    shade = rim_shade(vertices, triangles)
    assert shade.dtype == np.float32 and shade.shape == (len(vertices),)
    deep = -vertices[:, 2]
    assert shade[deep == 0.0] == pytest.approx(0.12)
    assert shade[deep >= 8.0] == pytest.approx(1.0)
    means = [shade[deep == 2.0 * k].mean() for k in range(5)]
    assert means == sorted(means) and 0.2 < means[1] < means[2] < 0.99


def test_what_has_no_rim_is_as_bright_all_over() -> None:
    vertices, triangles = bag()
    rim = np.arange(24)
    lid = np.column_stack([np.full(24, len(vertices)), np.roll(rim, -1), rim])
    closed = np.vstack([vertices, [[0.0, 0.0, 1.0]]]), np.vstack([triangles, lid])
    assert (rim_shade(*closed) == 1.0).all()
    assert (rim_shade(np.zeros((3, 3)), np.zeros((0, 3), np.int32)) == 1.0).all()
