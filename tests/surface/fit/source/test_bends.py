"""How far meshes bend, against prisms, and what is left of the weight of slopes."""

import numpy as np
import pytest
from slit_sheet import slit_sheet

from surface.fit.source.bends import HALF_TRUST_RAD, bends, slope_trust
from surface.fit.source.chart import make_chart
from surface.fit.source.islands import find_islands


def prism(sides: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (2n, 3) and quads (n, 4) of a prism without its ends."""
    angle = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.vstack([np.column_stack([ring, np.full(sides, z)]) for z in (0.0, 1.0)])
    a, b = np.arange(sides), np.roll(np.arange(sides), -1)
    return points, np.column_stack([a, b, b + sides, a + sides])


@pytest.mark.parametrize("sides", [4, 9, 36])
def test_a_prism_bends_by_the_angle_between_its_sides(sides: int) -> None:
    points, faces = prism(sides)
    np.testing.assert_allclose(bends(points, faces), 2.0 * np.pi / sides, atol=1e-9)
    np.testing.assert_allclose(bends(points, faces[:2]), 2.0 * np.pi / sides, atol=1e-9)  # one neighbour each
    cut = np.vstack([np.pad(faces[:, c], ((0, 0), (0, 1)), constant_values=-1) for c in ([0, 1, 2], [0, 2, 3])])
    np.testing.assert_allclose(bends(points, cut), 2.0 * np.pi / sides / np.sqrt(2.0), atol=1e-9)  # one side is flat


def test_a_face_alone_and_no_face_do_not_bend() -> None:
    points, faces = prism(5)
    assert bends(points, faces[:1]).tolist() == [0.0] and len(bends(points, faces[:0])) == 0


def test_slopes_count_half_where_the_mesh_bends_by_so_much() -> None:
    points, faces = prism(round(2.0 * np.pi / HALF_TRUST_RAD))
    np.testing.assert_allclose(slope_trust(points, faces), 0.5, atol=1e-9)
    flat = points * [1.0, 1e-9, 1.0]
    assert slope_trust(flat[:, [0, 2, 1]], faces[1:3]).tolist() == pytest.approx([1.0, 1.0])


def test_charts_of_unknown_meshes_trust_bent_faces_less() -> None:
    mesh = slit_sheet()
    kept, less = (
        make_chart(mesh, find_islands(mesh), normalise=False, downweight_slivers=d).slopes for d in (False, True)
    )
    trust = slope_trust(mesh.vertices, mesh.faces)
    assert trust.min() < 0.97
    np.testing.assert_allclose(less.weight, kept.weight * trust, rtol=1e-9)
